"""What a spec asks of a filter: its weights, by matrix or by name."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from obsdesign.families.asked import Estimation, ObserverSection
from obsdesign.lmi.formula import Array, in_floats
from obsdesign.records import dataclass
from obsdesign.sections.document import Loc
from obsdesign.sections.forms import ENTRY, MATRIX, Either, Entries, MapOf, OneOf, key, required
from obsdesign.sections.values import Axis, Reader
from obsdesign.sections.words import unknown

WEIGHT = Either("a number, a matrix, or a mapping of names to numbers", MATRIX, MATRIX, MATRIX, MapOf(ENTRY))


ESTIMATES = ("predicted", "filtered")


class FilterSection(ObserverSection):
    """Intensities of white noise that the filter supposes."""

    Q: Entries | dict[str, str] | None = key(
        WEIGHT,
        "intensity (of samples covariance) of the white noise that w is taken for: a number, a matrix, or one by name, "
        "0 for a w that is not named",
        otherwise="without w none is needed; with w it must be given",
        example="{w1: 100, w2: 1000}",
    )
    R: Entries | dict[str, str] = required(
        WEIGHT,
        "intensity (of samples covariance) of the noise of y: a number, a matrix, or one by name, of each output",
        example="{y1: 1.0e-2, y2: 1.0e-4}",
    )
    estimate: str = key(
        OneOf("estimate", ESTIMATES),
        "in discrete time: predicted, xhat_k knows y_0 .. y_{k-1}; or filtered, it knows y_k as well",
        default="predicted",
        example="filtered",
    )


class ExtendedSection(FilterSection):
    """Keys of the extended Kalman filter."""

    P0: Entries | dict[str, str] | None = key(
        WEIGHT,
        "covariance of x at first: a number, a matrix, or one by name, 1 for a state that is not named",
        otherwise="I",
        example="{x1: 1, x2: 36}",
    )


class UnscentedSection(ExtendedSection):
    """Keys of the unscented Kalman filter."""

    alpha: str = key(
        ENTRY,
        "how far the sigma points lie from the mean, > 0: sqrt(alpha^2 (n + kappa)) deviations",
        default="1",
        example="1.0e-3",
    )
    beta: str = key(
        ENTRY,
        "what is known of the distribution beside its covariance: 2 is best of a Gaussian one",
        default="2",
        example="2",
    )
    kappa: str = key(ENTRY, "further scaling of the sigma points, > -n", default="0", example="1")


class StationarySection(FilterSection):
    """Keys of the stationary Kalman filter."""

    at: dict[str, str] | None = key(
        MapOf(ENTRY),
        "where the plant is linearised, by the names of states and known inputs",
        otherwise="xhat0 of simulation, and known inputs 0",
        example="{x1: 0.5, u: 0.45}",
    )


@dataclass(frozen=True)
class FilterRequest:
    """The same in numbers."""

    type: str
    Q: Array  # over what drives the augmented plant
    R: Array  # (ny, ny)
    P0: Array  # (n + nm, n + nm)
    estimate: str
    alpha: float  # of sigma points, as beta and kappa
    beta: float
    kappa: float
    at: Mapping[str, float]  # where the plant is linearised
    drive: ClassVar[str] = "w"
    restrictions: ClassVar[tuple[str, ...]] = ()
    reconstruct: ClassVar[bool] = False
    filtered: ClassVar[bool] = False  # there is no inequality, whose v would be in part that of the next sample
    gains: ClassVar[None] = None


def request(reader: Reader, section: FilterSection, problem: Estimation) -> FilterRequest:
    """Weights, which must be symmetric and not negative, and that of y positive; sigma points; a point."""
    plant, model = problem.plant, problem.generator
    nv = None if model is None else model.Bm.shape[1]
    if problem.typed and model is not None and model.Am.size:
        said = f"type {section.type} takes it with a plant in matrices; add its states to system.dynamics"
        reader.wrong(("disturbance",), said, id="OBS406")
    names: tuple[Sequence[str], ...] = ((), (), ())
    if plant is not None:
        names = plant.exogenous, plant.outputs, plant.states
    if section.Q is None and nv:
        reader.wrong(
            ("observer", "Q"), "is required: how strong w is; a number, a matrix, or a mapping of names", id="OBS205"
        )
    Q = read_weight(reader, section.Q, "Q", Axis(nv, "disturbance"), names[0], 0.0)
    R = read_weight(reader, section.R, "R", problem.outputs, names[1], 0.0, positive=True)
    started = section.P0 if isinstance(section, ExtendedSection) else None
    P0 = read_weight(reader, started, "P0", problem.states, names[2], 1.0, positive=spread_in_time(section, problem))
    if section.estimate != ESTIMATES[0] and problem.period is None:
        said = "is of a plant with time: discrete; in continuous time there is no next sample"
        reader.wrong(("observer", "estimate"), said, at_key=True, id="OBS213")
    sigma, point = read_sigma(reader, section, problem.states), read_point(reader, section, problem, names[2])
    return FilterRequest(section.type, Q, R, P0, section.estimate, *sigma, point)


def spread_in_time(section: FilterSection, problem: Estimation) -> bool:
    """Whether P must have a root at all times, and so at first."""
    return isinstance(section, UnscentedSection) and problem.period is None


def read_sigma(reader: Reader, section: FilterSection, states: Axis) -> tuple[float, float, float]:
    """Alpha, beta and kappa of the unscented transform; those that are not used, of a filter without it."""
    if not isinstance(section, UnscentedSection):
        return 1.0, 2.0, 0.0
    alpha = float(reader.number(section.alpha, ("observer", "alpha"), "> 0"))
    beta, kappa = (float(reader.number(getattr(section, k), ("observer", k))) for k in ("beta", "kappa"))
    if states.size is not None and kappa <= -states.size:
        said = f"{section.kappa} is not allowed; give a number > -n, which is -{states.size} here"
        reader.wrong(("observer", "kappa"), said, id="OBS208")
    return alpha, beta, kappa


def read_point(reader: Reader, section: FilterSection, problem: Estimation, states: Sequence[str]) -> dict[str, float]:
    """Point at which the plant is linearised, of a filter that has one."""
    if not isinstance(section, StationarySection):
        return {}
    point, allowed = {}, (*states, *problem.inputs)
    for name, text in (section.at or {}).items():
        if states and name not in allowed:
            said = unknown("signal", name, allowed, {})
            reader.wrong(("observer", "at", name), said, at_key=True, id="OBS203")
        point[name] = float(reader.number(text, ("observer", "at", name)))
    return point


def read_weight(
    reader: Reader,
    written: Entries | Mapping[str, str] | None,
    what: str,
    axis: Axis,
    names: Sequence[str],
    default: float,
    *,
    positive: bool = False,
) -> Array:
    """Weight over an axis, in doubles; a single number is a multiple of the identity.

    Where it must be positive and there is no default that is, each name must be given.
    """
    loc: Loc = ("observer", what)
    size = axis.size or 0
    if written is None:
        return default * np.eye(size)
    if isinstance(written, Mapping):
        diagonal = np.full(size, default)
        for name, text in written.items():
            if name in names and names.index(name) < size:
                diagonal[names.index(name)] = float(reader.number(text, (*loc, name), "> 0" if positive else ">= 0"))
            elif names:
                reader.wrong((*loc, name), unknown("signal", name, tuple(names), {}), at_key=True, id="OBS203")
        if positive and not default and (missing := [name for name in names[:size] if name not in written]):
            require_named(reader, missing, loc)
        found = np.diag(diagonal)
    elif isinstance(written, str):
        found = float(reader.number(written, loc, ">= 0")) * np.eye(size)
    else:
        found = in_floats(reader.matrix(reader.entries(written, loc), axis, axis))
    if reader.clean(loc) and size:
        require_weight(reader, found, loc, positive=positive)
    return found


def require_named(reader: Reader, missing: Sequence[str], loc: Loc) -> None:
    """Refuse a mapping without some names; where one is unknown, it may be one of these misspelt."""
    if reader.clean(loc):
        verb = "is" if len(missing) == 1 else "are"
        said = f"{', '.join(missing)} {verb} missing; give each output a number > 0"
        reader.wrong(loc, said, id="OBS205")


def require_weight(reader: Reader, found: Array, loc: Loc, *, positive: bool) -> None:
    """Refuse what is no covariance."""
    least = float(np.linalg.eigvalsh(found)[0])
    if (found != found.T).any():
        reader.wrong(loc, "is not symmetric; a covariance is", id="OBS208")
    elif least < -1e-12 * np.abs(found).max() or (positive and least <= 0):
        kind = "positive definite" if positive else "positive semidefinite"
        reader.wrong(loc, f"has the eigenvalue {least:.4g}; it must be {kind}", id="OBS208")


RESULTS: Mapping[str, Sequence[str]] = {}  # nothing is proved: what is expected is expected of a run
