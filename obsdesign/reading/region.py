"""The region on which the type of a nonlinearity holds."""

from collections.abc import Mapping, Sequence

from obsdesign.expressions import Expression
from obsdesign.nonlinearities.evidence.restriction import Ends
from obsdesign.nonlinearities.slope import INFINITE
from obsdesign.reading.schema import Auto, Function
from obsdesign.sections.document import Loc
from obsdesign.sections.values import Reader
from obsdesign.sections.words import unknown
from obsdesign.spec import arguments

MINUS_INFINITE = ("-.inf", "-.Inf", "-.INF")


def read_region(
    reader: Reader, section: Function, loc: Loc, nq: int, f: Sequence[Expression] | None, known: Sequence[str]
) -> dict[str, Ends]:
    """Ranges of the variables that are limited; a single component of q is q1.

    `f`, `known`: the function, and what it may depend on besides its argument.
    """
    given = written_regions(section, loc)
    if not given:
        return {}
    for place, _ in given[1:]:
        reader.wrong(place, "the region is given twice; give it once", at_key=True)
    place, written = given[0]
    used = known if f is None else [name for name in known if any(name in g.names for g in f)]
    region: dict[str, Ends] = {}
    for name, ends in written.items():
        here, variable = (*place, name), "q1" if name == "q" and nq == 1 else name
        if name not in (*arguments(nq), *known):
            reader.wrong(here, unknown("variable", name, (*arguments(nq), *used), {}), at_key=True)
        elif name not in (*arguments(nq), *used):
            reader.wrong(here, f"f does not depend on {name}; leave it out", at_key=True)
        elif variable in region:
            reader.wrong(here, "q and q1 are the same; give one of them", at_key=True)
        else:
            region[variable] = read_range(reader, ends, here)
    return region


def written_regions(section: Function, loc: Loc) -> Sequence[tuple[Loc, Mapping[str, Sequence[str]]]]:
    """Regions of a block with their places; there should be one at most."""
    found = []
    if not isinstance(section.type, str):
        if isinstance(section.type.data, Auto) and section.type.data.region is not None:
            found.append(((*loc, "type", "auto", "region"), section.type.data.region))
        if section.type.region is not None:
            found.append(((*loc, "type", "region"), section.type.region))
    if section.region is not None:
        found.append(((*loc, "region"), section.region))
    return found


def read_range(reader: Reader, ends: Sequence[str], loc: Loc) -> Ends:
    """Limits of one variable."""
    before = len(reader.problems)
    low = None if ends[0] in MINUS_INFINITE else reader.number(ends[0], (*loc, 0))
    high = None if ends[1] in INFINITE else reader.number(ends[1], (*loc, 1))
    if len(reader.problems) == before and low is not None and high is not None and low >= high:
        reader.wrong(loc, f"{ends[0]} is not below {ends[1]}; give [low, high]")
    return low, high
