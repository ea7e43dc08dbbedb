"""The observer section of a spec: what is asked of the design."""

from collections.abc import Mapping
from typing import Literal

from flint import fmpq, fmpq_mat

from obsdesign.dissipation.bounds import SLACK, Bounds, Range
from obsdesign.families.incremental.request import Request
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.lmi.formula import Array, Exact
from obsdesign.model.disturbance import Generator
from obsdesign.model.plant import Plant
from obsdesign.reading import families
from obsdesign.reading.document import Loc, described
from obsdesign.reading.families import Frobenius, Gains, Level, Observer
from obsdesign.reading.values import Axis, Reader, Sign

ALPHA = Range(fmpq(1, 1000), fmpq(1000), points=25, log=True)  # where the search looks if the spec does not say
MAX_POINTS = 10_000
SEARCHED = ("max-alpha", "pareto")  # objectives that need a range of alpha


def read_incremental(reader: Reader, section: Observer, states: Axis, outputs: Axis, q: Axis) -> Request:
    """Return the request for an observer with the gains L1 and L2.

    Parameters
    ----------
    states, outputs, q
        Augmented states, measured outputs, and components of q, those of the disturbance model included.
    """
    objective = "gamma" if isinstance(section.objective, Level) else section.objective
    gamma = None
    if isinstance(section.objective, Level):
        gamma = reader.number(section.objective.gamma, ("observer", "objective", "gamma"), "> 0")
    return Request(
        type=section.type,
        L2=read_L2(reader, section, q, outputs),
        alpha=read_alpha(reader, section),
        objective=objective,
        gamma=gamma,
        slack=read_slack(reader, section.slack),
        bounds=read_bounds(reader, section.bounds),
        gains=read_gains(reader, section.gains, states, outputs, q),
        reconstruct=section.reconstruct is not None,
    )


def require_agreement(reader: Reader, request: SporadicRequest | LipschitzRequest) -> None:
    """Refuse keys that do not go with others."""
    for keys, why in request.conflicts():
        if reader.clean(("observer", *keys)):
            reader.wrong(("observer", *keys), why, at_key=True)


def require_reconstructible(
    reader: Reader, request: Request, plant: Plant[Exact] | None, generator: Generator | None
) -> None:
    """Refuse what = pinv(B) L1 (yhat - y) for another family, a disturbance model, or a B without a left inverse."""
    loc: Loc = ("observer", "reconstruct")
    if request.type != "linf":
        reader.wrong(loc, f"not available for type {request.type}; it needs type linf")
        return
    if generator is not None and len(generator.Am):
        reader.wrong(loc, "the disturbance model estimates w already; leave out one of the two")
    if plant is not None:
        columns = plant.B.shape[1]
        rank = fmpq_mat(plant.B.tolist()).rank() if plant.B.size else 0
        if not columns or rank < columns:
            reader.wrong(
                loc, f"needs system.B of full column rank, for its left inverse; it has rank {rank} of {columns}"
            )


def read_L2(reader: Reader, section: Observer, q: Axis, outputs: Axis) -> Array | None:
    """Feedback into the argument of f; None if it is free."""
    if section.L2 == "free":
        return None
    return reader.matrix(reader.entries(section.L2, ("observer", "L2")), q, outputs)


def read_alpha(reader: Reader, section: Observer) -> fmpq | Range:
    """Decay rate, or where to search it."""
    loc: Loc = ("observer", "alpha")
    if section.alpha is None:
        reader.notes.append(
            f"observer.alpha is not given and is searched from {float(ALPHA.low):g} to {float(ALPHA.high):g}"
        )
        return ALPHA
    if isinstance(section.alpha, families.Range):
        return read_range(reader, section.alpha, loc)
    if section.objective in SEARCHED:
        reader.wrong(loc, f"objective {section.objective} needs a range; give {{min: .., max: ..}}")
    return reader.number(section.alpha, loc, "> 0")


def read_searched(
    reader: Reader, written: str | families.Range, loc: Loc, sign: Sign, first: Sign = "> 0"
) -> fmpq | Range:
    """Read a number, or the range in which it is searched.

    Parameters
    ----------
    sign, first
        Of the number, and of the end at which a range begins.
    """
    if isinstance(written, families.Range):
        return read_range(reader, written, loc, first)
    return reader.number(written, loc, sign)


def read_range(reader: Reader, section: families.Range, loc: Loc, sign: Sign = "> 0") -> Range:
    """Interval that is searched; one that is spaced by a factor cannot begin at zero."""
    before = len(reader.problems)
    low = reader.number(section.min, (*loc, "min"), "> 0" if section.log else sign)
    high = reader.number(section.max, (*loc, "max"), "> 0")
    points = reader.integer(section.points, (*loc, "points"), 25, 2, MAX_POINTS)
    if len(reader.problems) == before and low >= high:
        reader.wrong(
            loc, f"min {described(section.min)} is not below max {described(section.max)}; a range needs min < max"
        )
    return Range(low, high, points, section.log)


def read_slack(reader: Reader, written: str | None) -> fmpq:
    """How far from the optimum a design may be."""
    return SLACK if written is None else reader.number(written, ("observer", "slack"), ">= 0")


def read_bounds(reader: Reader, section: families.Bounds | None) -> Bounds:
    """Largest gain, storage function and level."""
    if section is None:
        return Bounds()
    gain, norm = read_largest_gain(reader, section.L1, "L1")
    return Bounds(gain, norm, read_bound(reader, section.P, "P"), read_bound(reader, section.gamma, "gamma"))


def read_largest_gain(
    reader: Reader, written: str | Frobenius | None, key: str
) -> tuple[fmpq | None, Literal["spectral", "frobenius"]]:
    """Largest gain, and the norm that is meant."""
    if isinstance(written, Frobenius):
        return read_bound(reader, written.frobenius, key, "frobenius"), "frobenius"
    return read_bound(reader, written, key), "spectral"


def read_bound(reader: Reader, written: str | None, *keys: str) -> fmpq | None:
    """One number of the bounds."""
    return None if written is None else reader.number(written, ("observer", "bounds", *keys), "> 0")


def read_gains(
    reader: Reader, section: Gains | None, states: Axis, outputs: Axis, q: Axis
) -> Mapping[str, Array] | None:
    """Gains to be analyzed."""
    if section is None:
        return None
    loc: Loc = ("observer", "gains")
    rows = {"L1": states, "L2": q}
    return {key: reader.matrix(reader.entries(getattr(section, key), (*loc, key)), rows[key], outputs) for key in rows}
