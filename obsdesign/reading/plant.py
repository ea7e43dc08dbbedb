"""The plant of a spec: sizes from its matrices, then every matrix checked against them; names of its signals."""

from collections.abc import Collection, Mapping, Sequence
from itertools import accumulate

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.expressions.functions import FUNCTIONS
from obsdesign.lmi.formula import Array, Exact, rational
from obsdesign.model.disturbance import empty
from obsdesign.model.equations import Typed
from obsdesign.model.plant import Plant
from obsdesign.reading.blocks import Block, read_block, read_nonlinearity
from obsdesign.reading.plant_schema import Equations, InMatrices
from obsdesign.reading.plant_schema import Nonlinearity as Section
from obsdesign.records import dataclass
from obsdesign.sections.document import Loc
from obsdesign.sections.scalars import described
from obsdesign.sections.values import Axis, Entries, Reader, Size, counted, meaning
from obsdesign.sections.words import unknown
from obsdesign.spec import Nonlinearity, numbered

KINDS = (  # key of a section, attribute of `Names`, and what each is
    ("states", "states", "a state"),
    ("outputs", "outputs", "an output"),
    ("inputs", "inputs", "an input"),
    ("disturbances", "w", "a disturbance"),
)
KNOWN = {"t", "pi", *FUNCTIONS}  # in every expression
X, Y, W = Axis(None, "state"), Axis(None, "output"), Axis(None, "w")
Q, F = Axis(None, "component of q"), Axis(None, "component of f")


@dataclass(frozen=True)
class Names:
    """Names of the signals of a plant."""

    states: tuple[str, ...]
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    w: tuple[str, ...]


@dataclass(frozen=True)
class Layout:
    """Sizes and names of a plant, open where an earlier error leaves them open."""

    states: Axis = X
    outputs: Axis = Y
    w: Axis = W
    q: Axis = Q
    f: Axis = F
    names: Names | None = None

    def known(self, *kinds: str) -> tuple[str, ...] | None:
        """Return t and the names of these kinds of signals."""
        if self.names is None:
            return None
        return ("t", *(name for kind in kinds for name in getattr(self.names, kind)))


@dataclass(frozen=True)
class Reading:
    """What was read of a plant, with stand-ins after an error."""

    layout: Layout
    plant: Plant[Exact] | None = None
    gx: tuple[Expression, ...] = ()
    gy: tuple[Expression, ...] = ()
    gq: tuple[Expression, ...] = ()
    nonlinearities: tuple[Nonlinearity | None, ...] = ()
    typed: Typed | None = None  # the plant as it is typed, for families that take it so


def read_plant(
    reader: Reader,
    system: InMatrices | None,
    sections: Sequence[Section] | None,
    *,
    identity: bool = False,
    sampled: bool = False,
) -> Reading:
    """Plant, known terms and nonlinearities; a section is None if its structure is wrong.

    `identity`: whether a Bf or Cq that is missing is the identity, instead of zero; `sampled`: whether y is known at
    instants only.
    """
    if system is None:
        return Reading(Layout())
    matrices = {key: reader.entries(getattr(system, key), ("system", key)) for key in ("A", "B", "C", "D")}
    n = order(reader, matrices["A"], len(system.states or ["x1"]))
    ny = matrices["C"].shape(None, n)[0] or matrices["D"].shape()[0] or len(system.outputs or ["y1"])
    parts = [read_part(reader, section, i, n, ny, identity=identity) for i, section in enumerate(sections or ())]
    layout = lay_out(reader, system, matrices, (n, ny), parts if sections is not None else None)
    plant = read_matrices(reader, layout, matrices, parts)
    known = layout.known("outputs", "inputs")
    gx = reader.expressions(system.gx, ("system", "gx"), layout.states, known)
    gy = reader.expressions(system.gy, ("system", "gy"), layout.outputs, layout.known("inputs"))
    gq = [reader.expressions(part.gq, (*part.block.loc, "gq"), part.q, known) for part in parts]
    firsts = accumulate((part.block.nq for part in parts), initial=0)
    blocks = tuple(
        read_nonlinearity(reader, part.block, known, arguments_of(plant, first, part.block.nq))
        for part, first in zip(parts, firsts, strict=False)
    )
    if sampled and layout.names:
        outputs = layout.names.outputs
        refuse_outputs(reader, ("system", "gx"), system.gx, gx, outputs)
        for part, q, block in zip(parts, gq, blocks, strict=True):
            refuse_outputs(reader, (*part.block.loc, "gq"), part.gq, q, outputs)
            refuse_outputs(reader, (*part.block.loc, "f"), part.block.section.f, (block and block.f) or (), outputs)
    return Reading(layout, plant, gx, gy, tuple(e for q in gq for e in q), blocks)


def refuse_outputs(
    reader: Reader,
    loc: Loc,
    written: object,
    sides: Sequence[Expression],
    outputs: Collection[str],
    instead: str = "states (as an argument q) and inputs",
) -> None:
    """Refuse what an observer that knows y at instants only cannot compute between them."""
    for i, side in enumerate(sides):
        if measured := sorted(side.names.intersection(outputs)):
            place = (*loc, i) if isinstance(written, list) else loc
            why = f"needs {measured[0]}, which the observer does not know between two measurements"
            reader.wrong(place, f"{side} {why}; write it in {instead}", id="OBS308")


def arguments_of(plant: Plant[Exact], first: int, nq: int) -> str:
    """What f is a function of, in words, with the part of q that is linear in the states."""
    names = ["q"] if nq == 1 else [f"q{k + 1}" for k in range(nq)]
    rows = plant.Cq[first : first + nq] if len(plant.states) == plant.Cq.shape[1] else ()
    sums = (
        " + ".join(f"{c}*{x}" if c != 1 else x for c, x in zip(row, plant.states, strict=True) if c) for row in rows
    )
    here = ", ".join(f"{q} = {text or '0'}" for q, text in zip(names, sums, strict=False))
    return f"f is a function of {', '.join(names)}" + (f", and here Cq x is {here}" if here else "")


def order(reader: Reader, A: Entries, otherwise: Size) -> Size:
    """Return the size of A, or `otherwise` if A is just 0; None if A is not square."""
    if A.wrong:
        return None
    if A.zero:
        return otherwise
    if A.values.size == 1:
        return 1
    rows, columns = A.shape()
    if not rows or rows != columns:
        reader.wrong(A.loc, f"expected a square matrix, found {A}", id="OBS209")
        return None
    return rows


@dataclass(frozen=True)
class Part:
    """One block f_i and how it is connected."""

    block: Block
    matrices: Mapping[str, Entries]
    gq: str | Sequence[str] | None

    @property
    def q(self) -> Axis:
        """Components of its argument."""
        return Q.of(self.block.nq)

    @property
    def f(self) -> Axis:
        """Components of its value."""
        return F.of(self.block.nf)


def read_part(reader: Reader, section: Section, i: int, n: Size, ny: Size, *, identity: bool = False) -> Part:
    """One block, with its sizes from its own matrices."""
    loc = ("nonlinearities", i)
    matrices = {key: reader.entries(getattr(section, key), (*loc, key)) for key in ("Bf", "Cq", "Dqf", "Dq", "Df")}
    if identity and n:
        matrices |= {key: Entries((*loc, key), rational(np.eye(n))) for key in left_out(reader, section, loc, n)}
    nf = matrices["Bf"].shape(n)[1] or matrices["Df"].shape(ny)[1]
    nq = matrices["Cq"].shape(None, n)[0] or matrices["Dqf"].shape()[0] or matrices["Dq"].shape()[0]
    if isinstance(section.gq, list):
        nq = nq or len(section.gq)
    return Part(read_block(reader, section, loc, nq, nf), matrices, section.gq)


def left_out(reader: Reader, section: Section, loc: Loc, n: int) -> list[str]:
    """Which of Bf and Cq are missing and can be the identity; Bf cannot where f has another size than the state."""
    missing = [key for key in ("Bf", "Cq") if getattr(section, key) is None]
    count = len(section.f) if isinstance(section.f, list) else 1
    if "Bf" in missing and section.f is not None and count != n:
        components = counted(count, "component")
        reader.wrong(
            (*loc, "Bf"), f"is missing, and f has {components}, not one for each of {n} states; give Bf", id="OBS205"
        )
        missing.remove("Bf")
    return missing


def lay_out(
    reader: Reader,
    system: InMatrices,
    matrices: Mapping[str, Entries],
    sizes: tuple[Size, int],
    parts: Sequence[Part] | None,
) -> Layout:
    """Sizes and names of the whole plant.

    `sizes`: number of states, and of outputs; `parts`: the blocks f_i; None if their structure is wrong.
    """
    x, y = X.of(sizes[0]), Y.of(sizes[1])
    w = W.of(exogenous_inputs(matrices, parts or (), x, y))
    q, f = Q, F
    if parts is not None:
        q, f = Q.of(sum(part.block.nq for part in parts)), F.of(sum(part.block.nf for part in parts))
    elif not w.size:
        w = W
    reader.limit(y.size, "outputs", ("system", "outputs"))
    reader.limit(q.size, "components of q", ("nonlinearities",))
    reader.limit(f.size, "components of f", ("nonlinearities",))
    guess = len(system.states or ()) or max(matrices["A"].values.shape, default=1) or 1
    names = read_names(reader, system, x if x.size else X.of(guess), y, w)
    return Layout(x, y if matrices["C"].fits(Y, x) else Y, w, q, f, names)


def exogenous_inputs(matrices: Mapping[str, Entries], parts: Sequence[Part], x: Axis, y: Axis) -> Size:
    """Count the exogenous inputs, from the first matrix that says it; None if that one is wrong, or one beside it."""
    for entries, rows in ((matrices["B"], x), (matrices["D"], y)):
        count = entries.shape(rows.size)[1]
        if count is not None:
            return count if entries.fits(rows, W) else None
        if not entries.zero and entries.values.size:  # a vector, and no vector fits so many rows, or that is open
            return None
    counts = ((part.matrices["Dq"], part.q) for part in parts)
    return next((count if Dq.fits(q, W) else None for Dq, q in counts if (count := Dq.shape(q.size)[1]) is not None), 0)


def read_matrices(reader: Reader, layout: Layout, whole: Mapping[str, Entries], parts: Sequence[Part]) -> Plant[Exact]:
    """Every matrix in its size, the blocks f_i side by side."""
    x, y, w = layout.states, layout.outputs, layout.w
    names = layout.names or Names((), (), (), ())

    def across(key: str, rows: Axis) -> Array:
        blocks = [reader.matrix(part.matrices[key], rows, part.f) for part in parts]
        return np.hstack([empty(rows.size or 0, 0), *blocks])

    def down(key: str, columns: Axis) -> Array:
        blocks = [reader.matrix(part.matrices[key], part.q, columns) for part in parts]
        return np.vstack([empty(0, columns.size or 0), *blocks])

    return Plant(
        A=reader.matrix(whole["A"], x, x),
        Bf=across("Bf", x),
        B=reader.matrix(whole["B"], x, w),
        Cq=down("Cq", x),
        Dqf=down("Dqf", layout.f),
        Dq=down("Dq", w),
        C=reader.matrix(whole["C"], y, x),
        Df=across("Df", y),
        D=reader.matrix(whole["D"], y, w),
        states=names.states,
        exogenous=names.w,
        outputs=names.outputs,
    )


def read_parameters(reader: Reader, parameters: Mapping[str, str]) -> None:
    """Values of the parameters, each from those before it; one with a wrong name is not told where it is used."""
    for name, text in parameters.items():
        if reason := meaning(name):
            reader.wrong(("parameters", name), f"{described(name)} {reason}", at_key=True, id="OBS211")
        value = reader.number(text, ("parameters", name))
        if reason is None or name not in KNOWN:
            reader.parameters[name] = value


def read_names(reader: Reader, system: InMatrices | Equations, states: Axis, outputs: Axis, w: Axis) -> Names | None:
    """Names of the signals; None if an earlier error leaves them open."""
    before = len(reader.problems)
    disturbances = given_or(reader, "disturbances", system.disturbances, w, "w")
    taken = {} if system.disturbances else dict.fromkeys(disturbances, "an exogenous input")
    names = Names(
        states=given_or(reader, "states", system.states or getattr(system, "dynamics", None), states, "x"),
        outputs=given_or(reader, "outputs", system.outputs, outputs, "y"),
        inputs=tuple(system.inputs),
        w=disturbances,
    )
    for key, group, each in KINDS:
        given = getattr(system, key)
        for i, name in enumerate(getattr(names, group) if given or group != "w" else ()):
            if reason := meaning(name) or (name in taken and f"is {taken[name]} already; choose another name"):
                place: Loc = ("system", key, *([i] if isinstance(given, list) else [name] if given else []))
                if given is None and group == "states" and isinstance(system, Equations):
                    place = ("system", "dynamics", name)
                reader.wrong(place, f"{described(name)} {reason}", at_key=not isinstance(given, list), id="OBS211")
            taken[name] = each
    for name in reader.parameters:
        if name in taken:
            message = f"{name} is {taken[name]} already; choose another name"
            reader.wrong(("parameters", name), message, at_key=True, id="OBS211")
    for name in system.units:
        if name not in taken:
            reader.wrong(("system", "units", name), unknown("signal", name, tuple(taken), {}), at_key=True, id="OBS203")
    return names if len(reader.problems) == before else None


def given_or(reader: Reader, key: str, given: Collection[str] | None, axis: Axis, letter: str) -> tuple[str, ...]:
    """Names as given, or the default ones."""
    if given is not None and not axis.admits(len(given)):
        reader.wrong(
            ("system", key), f"expected {counted(axis.size, 'name')} ({axis}), found {len(given)}", id="OBS209"
        )
    return numbered(letter, axis.size or 0) if given is None else tuple(given)
