"""The plant of a spec: sizes from its matrices, then every matrix checked against them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array
from obsdesign.model.disturbance import empty
from obsdesign.model.plant import Plant
from obsdesign.spec.blocks import Block, read_block, read_nonlinearity
from obsdesign.spec.model import Nonlinearity
from obsdesign.spec.names import Names, arguments, read_names
from obsdesign.spec.schema import Nonlinearity as Section
from obsdesign.spec.schema import System
from obsdesign.spec.values import Axis, Entries, Reader, Size


@dataclass(frozen=True)
class Layout:
    """Sizes and names of a plant, open where an earlier error leaves them open."""

    states: Axis = Axis(None, "state")
    outputs: Axis = Axis(None, "output")
    w: Axis = Axis(None, "w")
    q: Axis = Axis(None, "component of q")
    f: Axis = Axis(None, "component of f")
    names: Names | None = None

    def known(self, *kinds: str) -> tuple[str, ...] | None:
        """Return t and the names of these kinds of signals."""
        if self.names is None:
            return None
        return ("t", *(name for kind in kinds for name in getattr(self.names, kind)))


@dataclass(frozen=True)
class Reading:
    """What was read of a plant; there is no plant after an error."""

    layout: Layout
    plant: Plant | None = None
    gx: tuple[Expression, ...] = ()
    gy: tuple[Expression, ...] = ()
    gq: tuple[Expression, ...] = ()
    nonlinearities: tuple[Nonlinearity | None, ...] = ()


def read_plant(reader: Reader, system: System | None, sections: Sequence[Section] | None) -> Reading:
    """Plant, known terms and nonlinearities; a section is None if its structure is wrong."""
    if system is None:
        return Reading(Layout())
    matrices = {key: reader.entries(getattr(system, key), ("system", key)) for key in ("A", "B", "C", "D")}
    n = order(reader, matrices["A"], len(system.states or ["x1"]))
    ny = matrices["C"].shape(None, n)[0] or matrices["D"].shape()[0] or len(system.outputs or ["y1"])
    parts = [read_part(reader, section, i, n, ny) for i, section in enumerate(sections or ())]
    nw = matrices["B"].shape(n)[1] or matrices["D"].shape(ny)[1]
    for part in parts:
        nw = nw or part.matrices["Dq"].shape(part.block.nq)[1]
    nw = nw or 0
    sizes = {
        "states": n,
        "outputs": ny,
        "w": nw,
        "q": sum(p.block.nq for p in parts),
        "f": sum(p.block.nf for p in parts),
    }
    if sections is None:
        sizes |= {"w": nw or None, "q": None, "f": None}
    layout = lay_out(reader, system, sizes)
    plant = read_matrices(reader, layout, matrices, parts)
    known = layout.known("outputs", "inputs")
    gx = reader.expressions(system.gx, ("system", "gx"), layout.states, known)
    gy = reader.expressions(system.gy, ("system", "gy"), layout.outputs, layout.known("inputs"))
    gq = [e for part in parts for e in reader.expressions(part.gq, (*part.block.loc, "gq"), part.q, known)]
    blocks = tuple(read_nonlinearity(reader, part.block, known) for part in parts)
    return Reading(layout, plant, gx, gy, tuple(gq), blocks)


def order(reader: Reader, A: Entries, otherwise: Size) -> Size:
    """Number of states: the size of A, or `otherwise` if A is just 0; None if A is not square."""
    if A.zero:
        return otherwise
    if A.values.size == 1:
        return 1
    rows, columns = A.shape()
    if rows is None or rows != columns:
        reader.wrong(A.loc, f"expected a square matrix, found {A}")
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
        return Axis(self.block.nq, Layout.q.each)

    @property
    def f(self) -> Axis:
        """Components of its value."""
        return Axis(self.block.nf, Layout.f.each)


def read_part(reader: Reader, section: Section, i: int, n: Size, ny: Size) -> Part:
    """One block, with its sizes from its own matrices."""
    loc = ("nonlinearities", i)
    matrices = {
        key: reader.entries(getattr(section, key), (*loc, key)) for key in ("Bf", "Cq", "Dqf", "Dq", "Df")
    }
    nf = matrices["Bf"].shape(n)[1] or matrices["Df"].shape(ny)[1]
    nq = matrices["Cq"].shape(None, n)[0] or matrices["Dqf"].shape()[0] or matrices["Dq"].shape()[0]
    if isinstance(section.gq, list):
        nq = nq or len(section.gq)
    return Part(read_block(reader, section, loc, nq, nf), matrices, section.gq)


def lay_out(reader: Reader, system: System, sizes: Mapping[str, Size]) -> Layout:
    """Sizes and names of the whole plant."""
    axes = {key: replace(getattr(Layout, key), size=size) for key, size in sizes.items()}
    reader.limit(axes["states"], ("system", "A"))
    reader.limit(axes["outputs"], ("system", "C"))
    reader.limit(axes["w"], ("system", "B"))
    reader.limit(axes["q"], ("nonlinearities",))
    reader.limit(axes["f"], ("nonlinearities",))
    return Layout(**axes, names=read_names(reader, system, axes["states"], axes["outputs"], axes["w"]))


def read_matrices(
    reader: Reader, layout: Layout, whole: Mapping[str, Entries], parts: Sequence[Part]
) -> Plant:
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
