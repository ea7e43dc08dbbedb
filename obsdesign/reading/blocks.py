"""The nonlinear blocks f_i of a spec: their sizes, their types and their functions."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression, parse
from obsdesign.nonlinearities import FUNCTIONS, TEMPLATES, Multiplier
from obsdesign.nonlinearities.evidence.automatic import AUTOMATIC, proved
from obsdesign.nonlinearities.evidence.refutation import counterexample
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, Range, Restriction
from obsdesign.reading.document import Loc, dotted
from obsdesign.reading.kinds import Kind, read_kind
from obsdesign.reading.names import arguments
from obsdesign.reading.region import read_region
from obsdesign.reading.schema import Function
from obsdesign.reading.values import Axis, Reader, Size
from obsdesign.spec import Nonlinearity

ARGUMENT = re.compile(r"\bq\b")
POINTS = np.concatenate([np.linspace(-10, 10, 201), np.geomspace(1e-3, 100, 50), -np.geomspace(1e-3, 100, 50)])
UNIT_SLOPE = ("sin", "cos", "tanh", "atan", "sat", "deadzone", "relu")  # |slope| <= 1, with equality
TOLERANCE = 1e-9  # relative, of two ways to write the same function


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

    Parameters
    ----------
    nq, nf
        Sizes of q_i and f_i as the matrices have them; None if they leave them open.
    """
    kind = read_kind(reader, section.type, (*loc, "type"))
    if isinstance(section.f, list):
        nf = nf or len(section.f)
    return Block(loc, section, kind, *kind.sizes(nq, nf))


@dataclass(frozen=True)
class Assumption:
    """What the design may assume of f."""

    name: str  # in TEMPLATES
    text: str
    data: Any
    multiplier: Multiplier

    @property
    def lipschitz(self) -> tuple[fmpq, ...]:
        """Lipschitz constant, or that of each component with a slope of its own; empty if none is known."""
        if self.name in ("lipschitz", "cocoercive"):
            return (self.data,)
        if self.name in UNIT_SLOPE:
            return (fmpq(1),) * len(self.multiplier.blocks)
        finite = self.name == "slope" and all(high is not None for _, high in self.data)
        return tuple(max(abs(low), abs(high)) for low, high in self.data) if finite else ()

    @classmethod
    def of(cls, block: Block, name: str, text: str, data: Any) -> "Assumption":
        """Assumption with the multiplier that its template makes; raises `UsageError` if it makes none."""
        return cls(name, text, data, TEMPLATES[name](data, block.nq, block.nf))


def read_nonlinearity(reader: Reader, block: Block, known: Sequence[str] | None) -> Nonlinearity | None:
    """Read the function and the multiplier of a block; None after an error.

    Parameters
    ----------
    known
        What f may depend on besides its argument; None if an earlier error leaves it open.
    """
    if not reader.clean((*block.loc, "type")):
        return None
    declared = None if block.kind.automatic else read_declared(reader, block)
    if not reader.clean((*block.loc, "type")):
        return None
    f = read_function(reader, block, known)
    if known is None or not reader.clean((*block.loc, "f")):
        return None
    region = read_region(reader, block.section, block.loc, block.nq, f, known)
    if not all(reader.clean((*block.loc, key)) for key in ("type", "region")):
        return None
    if declared is None:
        declared = derive(reader, block, f, region)
    elif f is not None and block.kind.name in FUNCTIONS:
        compare(reader, block, f, known)
    elif f is not None:
        examine(reader, block, declared, f, region)
    if declared is None:
        return None
    own = {f"q{i + 1}": EVERYWHERE for i in range(block.nq)}
    limits = tuple((own | region)[q] for q in own)
    others = {name: limits for name, limits in region.items() if name not in own}
    local = None if set(limits) == {EVERYWHERE} else limits
    return Nonlinearity(declared.text, block.nq, declared.multiplier, f, local, others, declared.lipschitz)


def read_declared(reader: Reader, block: Block) -> Assumption | None:
    """Type as it is declared; None after an error."""
    kind = block.kind
    try:
        data = kind.template_data(reader, block.nq, block.nf)
        if reader.clean((*block.loc, "type")):
            return Assumption.of(block, kind.name, kind.text, data)
    except UsageError as error:
        reader.wrong((*block.loc, "type"), error.problems[0].message)
    return None


def restricted(f: Sequence[Expression], nq: int, region: Mapping[str, Range]) -> Restriction:
    """Return f on its region; a run begins at t = 0."""
    return Restriction.of(f, nq, {"t": (0.0, inf), **region})


def derive(
    reader: Reader, block: Block, f: Sequence[Expression] | None, region: Mapping[str, Range]
) -> Assumption | None:
    """Type that f is proved to have on its region; None after an error."""
    place = (*block.loc, "type")
    if f is None:
        reader.wrong(place, f"{block.kind.text} is derived from f; give f")
        return None
    try:
        choice = AUTOMATIC[block.kind.name](restricted(f, block.nq, region))
        derived = Assumption.of(block, choice.name, f"{choice.text} (auto)", choice.data)
    except UsageError as error:
        reader.wrong(place, error.problems[0].message)
        return None
    reader.notes.append(f"{dotted(place)}: {choice.text} is proved from f: {choice.reason}")
    return derived


def examine(
    reader: Reader, block: Block, declared: Assumption, f: Sequence[Expression], region: Mapping[str, Range]
) -> None:
    """Prove a declared type, or refute it; what is neither is the assumption of the user."""
    where, place = restricted(f, block.nq, region), (*block.loc, "type")
    if proved(where, declared.name, declared.data):
        reader.notes.append(f"{dotted(place)}: {declared.text} is proved from f")
        return
    found = counterexample(where, declared.name, declared.data, declared.multiplier)
    if found is not None:
        reader.wrong(place, f"{declared.text} is refuted by {found.text(where)}")


def read_function(reader: Reader, block: Block, known: Sequence[str] | None) -> tuple[Expression, ...] | None:
    """Read the function of a block: as given, or that of its type."""
    library = FUNCTIONS.get(block.kind.name)
    if block.section.f is not None:
        names = None if known is None else (*arguments(block.nq), *known)
        axis = Axis(block.nf, "component of f")
        return reader.expressions(block.section.f, (*block.loc, "f"), axis, names)
    if library is None:
        return None
    components = ["q"] if block.nq == 1 else arguments(block.nq)
    return tuple(parse(ARGUMENT.sub(q, library.f), (q,)) for q in components)


def compare(reader: Reader, block: Block, f: Sequence[Expression], known: Sequence[str]) -> None:
    """Compare a function that is given with the one that its type names, by value."""
    text = FUNCTIONS[block.kind.name].f
    expected = parse(text, ("q",)).function(("q",))
    names = (*arguments(block.nq), *known)
    for i, component in enumerate(f):
        q = np.roll(POINTS, 7 * i)
        values = {name: np.roll(POINTS, 31 * (k + 1)) for k, name in enumerate(names)} | {f"q{i + 1}": q}
        if block.nq == 1:
            values["q"] = q
        found, right = component.function(names)(*(values[name] for name in names)), expected(q)
        wrong = ~(abs(found - right) <= TOLERANCE * (1 + abs(right)))
        if wrong.any():
            k = int(np.argmax(wrong))
            value = f"{found[k]:.6g}" if np.isfinite(found[k]) else "not defined"
            place = f"{text} is {right[k]:.6g} at q = {q[k]:.6g}, where f is {value}"
            reader.wrong((*block.loc, "f"), f"differs from its type {block.kind.name}: {place}")
            return
