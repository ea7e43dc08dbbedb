"""The nonlinear blocks f_i of a spec: their sizes, functions and types, and the regions on which the types hold."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression, parse
from obsdesign.nonlinearities import TEMPLATES, Multiplier, Template
from obsdesign.nonlinearities.evidence.automatic import choose
from obsdesign.nonlinearities.evidence.refutation import counterexample, searched, spread, undefined
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, SINCE_ZERO, Ends, Restriction
from obsdesign.nonlinearities.slope import INFINITE
from obsdesign.reading.plant_schema import AUTO, Auto, Function, TypeData
from obsdesign.records import dataclass
from obsdesign.sections.document import Loc, dotted
from obsdesign.sections.values import Axis, Reader, Size
from obsdesign.sections.words import unknown
from obsdesign.spec import PROVED, Nonlinearity, arguments

MINUS_INFINITE = ("-.inf", "-.Inf", "-.INF")
ARGUMENT = re.compile(r"\bq\b")
POINTS = 1000  # at which a function is compared with the one that its type names
TOLERANCE = 1e-9  # relative, of two ways to write the same function


@dataclass(frozen=True)
class Kind:
    """The type of a block, with its data in exact numbers."""

    name: str
    text: str
    data: Any = None  # whatever sizes q and f have
    automatic: bool = False  # the data follow from f

    def sizes(self, nq: Size, nf: Size) -> tuple[int, int]:
        """Sizes of q and f: those that are known, or else what the type and its data say."""
        template = TEMPLATES.get(self.name)
        square = template is not None and template.square
        if template is not None and template.data is not None and not self.automatic and self.data is not None:
            nq, nf = template.data.sizes(self.data, nq, nf)
        nf = nf or (nq if square else None) or 1
        nq = nq or (nf if square else 1)
        return max(nq, 1), max(nf, 1)


def read_kind(reader: Reader, written: str | TypeData, loc: Loc) -> Kind:
    """Type of a block with its data in exact numbers."""
    if isinstance(written, str):
        return Kind(written, written, automatic=written == AUTO)
    name, value = written.name, written.data
    data = TEMPLATES[name].data if name != AUTO else None
    if data is None:
        return Kind(name, name, automatic=True)
    if value == AUTO and TEMPLATES[name].derive is not None:
        return Kind(name, f"{name} {AUTO}", automatic=True)
    return Kind(name, data.words(name, value), data.read(reader, value, (*loc, name)))


@dataclass(frozen=True)
class Block:
    """One block: where it stands, its type, and its sizes."""

    loc: Loc
    section: Function
    kind: Kind
    nq: int
    nf: int


def read_block(reader: Reader, section: Function, loc: Loc, nq: Size, nf: Size) -> Block:
    """Type and sizes of a block.

    `nq`, `nf`: sizes of q_i and f_i as the matrices have them; None if they leave them open.
    """
    kind = read_kind(reader, section.type, (*loc, "type"))
    if isinstance(section.f, list):
        nf = nf or len(section.f)
    return Block(loc, section, kind, *kind.sizes(nq, nf))


@dataclass(frozen=True)
class Assumption:
    """What the design may assume of f."""

    name: str
    text: str
    data: Any
    multiplier: Multiplier

    @classmethod
    def of(cls, block: Block, name: str, text: str, data: Any) -> "Assumption":
        """Assumption with the multiplier that its template makes; raises `UsageError` if it makes none."""
        return cls(name, text, data, TEMPLATES[name](data, block.nq, block.nf))

    @property
    def template(self) -> Template:
        """The type."""
        return TEMPLATES[self.name]

    @property
    def entry(self) -> Any:
        """The type as a spec has it, with exact numbers."""
        form = self.template.data
        return self.name if form is None else {self.name: form.entry(self.data)}


def read_nonlinearity(
    reader: Reader, block: Block, known: Sequence[str] | None, about: str = "f is a function of q"
) -> Nonlinearity | None:
    """Read the function and the multiplier of a block; None after an error.

    `known`: what f may depend on besides its argument; None if an earlier error leaves it open; `about`: which it is.
    """
    if not reader.clean((*block.loc, "type")):
        return None
    declared = None if block.kind.automatic else read_declared(reader, block)
    if not reader.clean((*block.loc, "type")):
        return None
    f = read_function(reader, block, known, about)
    if known is None or not reader.clean((*block.loc, "f")):
        return None
    region = read_region(reader, block.section, block.loc, block.nq, f, known)
    if f is not None and reader.clean((*block.loc, "region")):
        require_defined(reader, block, restricted(f, block.nq, region))
    if not all(reader.clean((*block.loc, key)) for key in ("type", "region", "f")):
        return None
    assumed = ""
    if declared is None:
        declared = derive(reader, block, f, region)
    elif f is None or block.section.f is not None:
        assumed = examine(reader, block, declared, f, region)
    if declared is None:
        return None
    own = {f"q{i + 1}": EVERYWHERE for i in range(block.nq)}
    limits = tuple((own | region)[q] for q in own)
    others = {name: limits for name, limits in region.items() if name not in own}
    local = None if set(limits) == {EVERYWHERE} else limits
    constants = declared.template.constants(declared.data, block.nq)
    entry = declared.entry
    return Nonlinearity(declared.text, block.nq, declared.multiplier, f, local, others, constants, assumed, entry)


def read_declared(reader: Reader, block: Block) -> Assumption | None:
    """Type as it is declared; None after an error."""
    kind = block.kind
    try:
        form = TEMPLATES[kind.name].data
        data = None if form is None else form.fitted(reader, kind.data, block.nq, block.nf)
        if reader.clean((*block.loc, "type")):
            return Assumption.of(block, kind.name, kind.text, data)
    except UsageError as error:
        reader.wrong((*block.loc, "type"), error.problems[0].message, id=error.problems[0].id)
    return None


def restricted(f: Sequence[Expression], nq: int, region: Mapping[str, Ends]) -> Restriction:
    """Return f on its region; a run begins at t = 0."""
    return Restriction.of(f, nq, {"t": SINCE_ZERO, **region})


def derive(
    reader: Reader, block: Block, f: Sequence[Expression] | None, region: Mapping[str, Ends]
) -> Assumption | None:
    """Type that f is proved to have on its region; None after an error."""
    place = (*block.loc, "type")
    if f is None:
        reader.wrong(place, f"{block.kind.text} is derived from f; give f", id="OBS402")
        return None
    try:
        derivation = TEMPLATES[block.kind.name].derive if block.kind.name != AUTO else choose
        assert derivation is not None  # or the type would not be automatic
        choice = derivation(restricted(f, block.nq, region))
        derived = Assumption.of(block, choice.name, f"{choice.label} (auto)", choice.data)
    except UsageError as error:
        reader.wrong(place, error.problems[0].message, id=error.problems[0].id)
        return None
    reader.notes.append(f"{dotted(place)}: {choice.text} {PROVED}: {choice.reason}")
    return derived


def require_defined(reader: Reader, block: Block, f: Restriction) -> None:
    """Refuse an f that surely has no value somewhere on its region."""
    written, found = block.section.f, undefined(f)
    if found is not None:
        i, where = found
        place, text = ((i,), written[i]) if isinstance(written, list) else ((), written)
        instead = "give a region without that, or an f that is defined there (abs, max, where)"
        reader.wrong((*block.loc, "f", *place), f"{text} has no value {where}; {instead}", id="OBS304")


def examine(
    reader: Reader, block: Block, declared: Assumption, f: Sequence[Expression] | None, region: Mapping[str, Ends]
) -> str:
    """Prove a declared type, or refute it; of what is neither, return what is known of the assumption of the user."""
    place, template = (*block.loc, "type"), declared.template
    if f is None:
        reader.notes.append(f"{dotted(place)}: {declared.text} is assumed: no f is given")
        return "no f is given"
    if not reader.judged:
        return "not examined"
    where = restricted(f, block.nq, region)
    if template.f is not None and not same(reader, block, template.f, where):
        return ""
    if template.proved(where, declared.data):
        reader.notes.append(f"{dotted(place)}: {declared.text} {PROVED}")
        return ""
    found = counterexample(where, template.claims(declared.data, declared.multiplier))
    if found is not None:
        free = [where.shown(name) for name, ends in where.region.items() if ends == EVERYWHERE]
        narrower = (
            f"; if {' or '.join(free)} cannot have that value, declare where it stays: region: {{{free[-1]}: [lo, hi]}}"
            if free
            else ""
        )
        reader.wrong(place, f"{declared.text} is refuted by {found.text(where)}{narrower}", id="OBS401")
        return ""
    sought = f"on {searched(where)}"
    said = f"{declared.text} is assumed {sought}, where no pair of arguments that was tried contradicts it"
    reader.notes.append(f"{dotted(place)}: {said}; it is not proved")
    return f"searched {sought}, not proved"


def read_function(
    reader: Reader, block: Block, known: Sequence[str] | None, about: str
) -> tuple[Expression, ...] | None:
    """Read the function of a block: as given, or that of its type."""
    library = TEMPLATES[block.kind.name].f if block.kind.name != AUTO else None
    if block.section.f is not None:
        names = None if known is None else (*arguments(block.nq), *known)
        axis = Axis(block.nf, "component of f")
        return reader.expressions(block.section.f, (*block.loc, "f"), axis, names, about)
    if library is None:
        return None
    components = ["q"] if block.nq == 1 else arguments(block.nq)
    return tuple(parse(ARGUMENT.sub(q, library), (q,)) for q in components)


def same(reader: Reader, block: Block, text: str, f: Restriction) -> bool:
    """Compare a function that is given with the one that its type names, by value at points of the region."""
    points = spread(f.box, np.random.default_rng(0), POINTS)
    values = dict(zip(f.box, points, strict=True))
    expected = parse(text, ("q",)).function(("q",))
    for component, name in zip(f.f, f.arguments, strict=True):
        q = values[name]
        found, right = component.function(tuple(f.box))(*points), expected(q)
        wrong = np.isfinite(found) & (abs(found - right) > TOLERANCE * (1 + abs(right)))  # not where it overflows
        if wrong.any():
            k = int(np.argmin(np.where(wrong, abs(q), np.inf)))
            place = f"{text} is {right[k]:.6g} at q = {q[k]:.6g}, where f is {found[k]:.6g}"
            reader.wrong((*block.loc, "f"), f"differs from its type {block.kind.name}: {place}", id="OBS401")
            return False
    return True


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
        reader.wrong(place, "the region is given twice; give it once", at_key=True, id="OBS206")
    place, written = given[0]
    used = known if f is None else [name for name in known if any(name in g.names for g in f)]
    region: dict[str, Ends] = {}
    for name, ends in written.items():
        here, variable = (*place, name), "q1" if name == "q" and nq == 1 else name
        if name not in (*arguments(nq), *known):
            reader.wrong(here, unknown("variable", name, (*arguments(nq), *used), {}), at_key=True, id="OBS203")
        elif name not in (*arguments(nq), *used):
            reader.wrong(here, f"f does not depend on {name}; leave it out", at_key=True, id="OBS213")
        elif variable in region:
            reader.wrong(here, "q and q1 are the same; give one of them", at_key=True, id="OBS206")
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
        reader.wrong(loc, f"{ends[0]} is not below {ends[1]}; give [low, high]", id="OBS208")
    return low, high
