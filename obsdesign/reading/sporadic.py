"""The observer section of a spec for measurements that arrive sporadically."""

from collections.abc import Mapping

from flint import fmpq

from obsdesign.dissipation.bounds import Range
from obsdesign.families.sporadic.request import INJECTIONS, SporadicRequest
from obsdesign.lmi.formula import Array, Exact
from obsdesign.model.disturbance import Generator
from obsdesign.model.plant import Plant
from obsdesign.reading.document import Loc
from obsdesign.reading.families import SporadicGains, SporadicObserver
from obsdesign.reading.observer import read_bound, read_searched, read_slack, require_agreement
from obsdesign.reading.values import Axis, Reader

DELTA = Range(fmpq(1, 100), fmpq(1000), points=40, log=True)  # where the search looks if the spec does not say
STEEP = ("proposition-3", "proposition-5")  # need delta > 2 decay
ABOVE = fmpq(1001, 1000)  # least delta / (2 decay) for them
SEARCHED = {"max-T2": "T2", "max-decay": "decay"}  # objective: the key that must be a range
ABSENT = ("D", "Dq", "Dqf", "Df")


def read_sporadic(reader: Reader, section: SporadicObserver, states: Axis, outputs: Axis) -> SporadicRequest:
    """Return the request."""
    loc: Loc = ("observer",)
    T1 = reader.number(section.T1, (*loc, "T1"), "> 0")
    T2 = read_searched(reader, section.T2, (*loc, "T2"), "> 0")
    decay = read_searched(reader, section.decay or "0", (*loc, "decay"), ">= 0")
    require_ordered(reader, T1, T2)
    relaxations = listed(section.relaxation)
    require_ranges(reader, section, T2, decay)
    request = SporadicRequest(
        type=section.type,
        T1=T1,
        T2=T2,
        decay=decay,
        delta=read_delta(reader, section, decay, relaxations),
        injections=listed(section.injection) or fitting(relaxations),
        relaxations=relaxations,
        objective=section.objective,
        slack=read_slack(reader, section.slack),
        largest_gain=read_bound(reader, section.bounds.L if section.bounds else None, "L"),
        largest_gamma=read_bound(reader, section.bounds.gamma if section.bounds else None, "gamma"),
        gains=read_gains(reader, section.gains, states, outputs),
    )
    require_agreement(reader, request)
    return request


def listed(written: str | list[str] | None) -> tuple[str, ...]:
    """One word or several as a tuple."""
    return () if written is None else (written,) if isinstance(written, str) else tuple(written)


def ends(value: fmpq | Range) -> tuple[fmpq, fmpq]:
    """Ends of a range; a number is a range of itself."""
    return (value.low, value.high) if isinstance(value, Range) else (value, value)


def require_ordered(reader: Reader, T1: fmpq, T2: fmpq | Range) -> None:
    """Refuse T2 below T1."""
    if ends(T2)[1] < T1 and reader.clean(("observer", "T1")) and reader.clean(("observer", "T2")):
        largest = f"{float(ends(T2)[1]):g}"
        reader.wrong(("observer", "T2"), f"{largest} is below T1 = {float(T1):g}; a longest interval is at least T1")


def require_ranges(reader: Reader, section: SporadicObserver, T2: fmpq | Range, decay: fmpq | Range) -> None:
    """Refuse a search without a range to search."""
    found = {"T2": T2, "decay": decay}
    key = SEARCHED.get(section.objective)
    if key and not isinstance(found[key], Range):
        reader.wrong(("observer", key), f"objective {section.objective} needs a range; give {{min: .., max: ..}}")
    if section.objective == "pareto" and not any(isinstance(value, Range) for value in found.values()):
        reader.wrong(("observer", "objective"), "pareto needs a range of T2 or of decay")


def fitting(relaxations: tuple[str, ...]) -> tuple[str, ...]:
    """Injections where none is named: dynamic, and hold as far as its relaxation is listed."""
    wanted = relaxations or INJECTIONS["dynamic"]
    return tuple(name for name in ("dynamic", "hold") if set(INJECTIONS[name]) & set(wanted))


def read_delta(reader: Reader, section: SporadicObserver, decay: fmpq | Range, relaxations: tuple[str, ...]) -> Range:
    """Where delta is searched; the design cuts the range for a relaxation that needs delta > 2 decay."""
    loc: Loc = ("observer", "delta")
    if section.delta is None:
        return DELTA
    delta = read_searched(reader, section.delta, loc, "> 0")
    low, high = ends(delta)
    least = 2 * ends(decay)[0]
    steep = [name for name in relaxations if name in STEEP] or (
        ["proposition-5"] if "hold" in listed(section.injection) else []
    )
    if steep and not section.gains and high < least * ABOVE and reader.clean(loc):
        reader.wrong(loc, f"{steep[0]} needs delta above 2 decay = {float(least):g}; give a larger one")
    return delta if isinstance(delta, Range) else Range(low, high, points=1)


def read_gains(
    reader: Reader, section: SporadicGains | None, states: Axis, outputs: Axis
) -> Mapping[str, Array] | None:
    """Gains to be analyzed."""
    if section is None:
        return None
    loc: Loc = ("observer", "gains")
    return {
        "L": reader.matrix(reader.entries(section.L, (*loc, "L")), states, outputs),
        "H": reader.matrix(reader.entries(section.H, (*loc, "H")), outputs, outputs),
    }


def require_sporadic(reader: Reader, plant: Plant[Exact] | None, generator: Generator | None) -> None:
    """Refuse what the family does not know: noise in y between the samples, f of f or of w, a disturbance model."""
    if generator is not None and len(generator.Am):
        reader.wrong(("observer", "type"), "sporadic takes no disturbance model; leave `disturbance` out")
    for name in ABSENT if plant is not None else ():
        if getattr(plant, name).any():
            place: Loc = ("system", "D") if name == "D" else ("nonlinearities",)
            instead = "; measurement noise acts at the samples: simulation.noise" if name == "D" else ""
            reader.wrong(place, f"{name} must be zero for type sporadic{instead}")
