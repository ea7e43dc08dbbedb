"""Time of a spec: continuous, or counted in samples that are a period apart."""

import re
from collections.abc import Iterator

from flint import fmpq

from obsdesign.families import FAMILIES, Family
from obsdesign.reading.plant_schema import Equations, InMatrices
from obsdesign.reading.schema import File
from obsdesign.sections.document import Loc
from obsdesign.sections.values import Reader

LOC: Loc = ("system", "period")
TIME = re.compile(r"(?<![a-zA-Z])(s|ms|us|min|h)(?![a-zA-Z])")  # in a unit
RATE = "1/s"  # unit of a key of an observer


def read_period(reader: Reader, file: File, family: Family | None) -> fmpq | None:
    """Period of the samples in s; None in continuous time."""
    system = file.system
    if system is None:
        return None
    if system.discretise is not None:
        return read_discretised(reader, system, family)
    if system.time != "discrete":
        if system.period is not None:
            said = "goes with time: discrete; leave it out, or, where only y is sampled, take another observer.type"
            reader.wrong(LOC, said, at_key=True, id="OBS213")
        return None
    require_discrete(reader, family, "time")
    if system.period is not None:
        return reader.number(system.period, LOC, "> 0")
    if why := next(in_seconds(file), ""):
        said = f"period is missing, and {why}; give system.period in s"
        reader.wrong(("system",), said, at_key=True, id="OBS205")
    return fmpq(1)


def require_discrete(reader: Reader, family: Family | None, key: str) -> None:
    """Refuse a family that takes no plants in samples."""
    if family is not None and not family.discrete:
        taken = ", ".join(name for name, one in FAMILIES.items() if one.discrete)
        said = f"discrete time is not available for type {' or '.join(family.names)}; take {taken}"
        reader.wrong(("system", key), said, id="OBS406")


def read_discretised(reader: Reader, system: Equations | InMatrices, family: Family | None) -> fmpq:
    """Period of the plant that stands for a continuous one."""
    loc: Loc = ("system", "discretise")
    assert system.discretise is not None
    if system.time == "discrete" or system.period is not None:
        said = "turns a continuous plant into samples, with a period of its own; leave time and period out"
        reader.wrong(loc, said, at_key=True, id="OBS206")
    require_discrete(reader, family, "discretise")
    return reader.number(system.discretise.period, (*loc, "period"), "> 0")


def in_seconds(file: File) -> Iterator[str]:
    """What of a spec is in seconds."""
    for name, one in (file.observer.declared if file.observer else {}).items():
        if one.unit == RATE and getattr(file.observer, name) is not None:
            yield f"observer.{name} is in {RATE}"
    if file.disturbance not in (None, "unknown"):
        yield "the disturbance model is driven per second"
    for name, unit in (file.system.units if file.system else {}).items():
        if TIME.search(unit):
            yield f"the unit of {name} is {unit}"
