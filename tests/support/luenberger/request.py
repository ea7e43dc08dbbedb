"""What is asked of the observer, in a spec and in numbers."""

from dataclasses import dataclass
from typing import ClassVar

from flint import fmpq

from obsdesign.dissipation.pace import Pace
from obsdesign.families.asked import SEARCHED, ObserverSection, read_searched
from obsdesign.families.frozen import Demand
from obsdesign.model.edge import Edge
from obsdesign.sections.forms import ENTRY, key, required


class LuenbergerSection(ObserverSection):
    """What is asked of an observer with given poles."""

    poles: str = required(ENTRY, "1/s, all of them")
    speed: str | None = key(SEARCHED, "1/s")


@dataclass(frozen=True)
class LuenbergerRequest:
    """The same in numbers."""

    type: str
    poles: fmpq
    drive: ClassVar[str] = "v"
    reconstruct: ClassVar[bool] = False
    filtered: ClassVar[bool] = False
    gains: ClassVar[None] = None
    restrictions: ClassVar[tuple[str, ...]] = ()


def request(reader, section, problem):
    """Poles, which are not positive; as many states as the plant has."""
    if section.speed is not None:
        read_searched(reader, section.speed, ("observer", "speed"), "> 0")
    poles = reader.number(section.poles, ("observer", "poles"))
    if poles > 0:
        reader.wrong(("observer", "poles"), f"must not be positive, for {problem.states.size} states", id="OBS208")
    return LuenbergerRequest(section.type, poles)


def demand(spec):
    """Any decay."""
    return Demand(Edge(fmpq(0)), spec.multiplier, Pace("poles"))


SECTION = LuenbergerSection
RESULTS = {"guarantee": ("gamma", "alpha", "mu1", "mu2", "limit"), "observer": ("L1",)}
