"""The nonlinear blocks f_i of a spec: their sizes, their types and their functions."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression, parse
from obsdesign.nonlinearities import FUNCTIONS, TEMPLATES
from obsdesign.spec.document import Loc, described
from obsdesign.spec.model import Nonlinearity
from obsdesign.spec.names import arguments
from obsdesign.spec.schema import Function, TypeData
from obsdesign.spec.values import Axis, Entries, Reader, Size

UNEQUAL = ("lipschitz", "multiplier")  # types for which q and f may have different sizes
ARGUMENT = re.compile(r"\bq\b")
INFINITE = (".inf", "+.inf", ".Inf", "+.Inf", ".INF", "+.INF")
POINTS = np.concatenate([np.linspace(-10, 10, 201), np.geomspace(1e-3, 100, 50), -np.geomspace(1e-3, 100, 50)])
TOLERANCE = 1e-9  # relative, of two ways to write the same function
Slopes = tuple[list[fmpq | None], list[fmpq | None]]


@dataclass(frozen=True)
class Kind:
    """The type of a block, with its data as they are written."""

    name: str
    text: str
    data: fmpq | Slopes | Entries | None

    def components(self) -> Size:
        """Components of q (and of f) that the data speak of; None if of any number."""
        longest = max(map(len, self.data)) if isinstance(self.data, tuple) else 1
        return longest if longest > 1 else None


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
    kind = read_type(reader, section.type, (*loc, "type"))
    if isinstance(section.f, list):
        nf = nf or len(section.f)
    if kind.name not in UNEQUAL:
        nf = nf or nq or kind.components()
    if isinstance(kind.data, Entries) and kind.data.values.ndim == 2:
        total = len(kind.data.values)
        nf = nf or total - (nq or total // 2)
        nq = nq or total - nf
    nf = nf or 1
    nq = nq or (1 if kind.name in UNEQUAL else nf)
    return Block(loc, section, kind, max(nq, 1), max(nf, 1))


def read_type(reader: Reader, written: str | TypeData, loc: Loc) -> Kind:
    """Type of a block with its data in exact numbers."""
    if isinstance(written, str):
        return Kind(written, written, None)
    if written.lipschitz == "auto":
        reader.wrong((*loc, "lipschitz"), "auto is not available in this version; give a number >= 0")
        return Kind("lipschitz", "lipschitz auto", fmpq(1))
    if written.lipschitz is not None:
        k = reader.number(written.lipschitz, (*loc, "lipschitz"), ">= 0")
        return Kind("lipschitz", f"lipschitz {described(written.lipschitz)}", k)
    if written.slope is not None:
        low = read_bounds(reader, written.slope[0], (*loc, "slope", 0))
        high = read_bounds(reader, written.slope[1], (*loc, "slope", 1), infinite=True)
        return Kind("slope", described(f"slope {written.slope}".replace("'", "")), (low, high))
    return Kind("multiplier", "multiplier", reader.entries(written.multiplier, (*loc, "multiplier")))


def read_bounds(reader: Reader, written: str | Sequence[str], loc: Loc, *, infinite: bool = False) -> list[fmpq | None]:
    """Bounds of slopes; None is infinite."""
    if isinstance(written, str):
        return [None if infinite and written in INFINITE else reader.number(written, loc)]
    reader.limit(len(written), "bounds", loc)
    return [None if infinite and text in INFINITE else reader.number(text, (*loc, i)) for i, text in enumerate(written)]


def read_nonlinearity(reader: Reader, block: Block, known: Sequence[str] | None) -> Nonlinearity | None:
    """Read the function and the multiplier of a block; None after an error.

    Parameters
    ----------
    known
        What f may depend on besides its argument; None if an earlier error leaves it open.
    """
    if not reader.clean((*block.loc, "type")):
        return None
    try:
        multiplier = TEMPLATES[block.kind.name](template_data(block), block.nq, block.nf)
    except UsageError as error:
        reader.wrong((*block.loc, "type"), error.problems[0].message)
        return None
    f = read_function(reader, block, known)
    if not reader.clean((*block.loc, "f")):
        return None
    if f is not None and block.kind.name in FUNCTIONS and known is not None:
        compare(reader, block, f, known)
    return Nonlinearity(block.kind.text, block.nq, multiplier, f)


def template_data(block: Block) -> Any:
    """Return the data of the type as its template takes them."""
    data = block.kind.data
    if isinstance(data, Entries):
        return np.atleast_2d(data.values)
    if not isinstance(data, tuple):
        return data
    low, high = (bounds * block.nq if len(bounds) == 1 else bounds for bounds in data)
    if len(low) != len(high):
        raise UsageError(f"slope: {len(low)} lower and {len(high)} upper bounds; it takes as many of each")
    return list(zip(low, high, strict=True))


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
