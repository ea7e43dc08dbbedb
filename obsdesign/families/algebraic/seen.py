"""Whether errors e' = M e that do not fall are seen in the estimate, where xhat - x = E e."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from flint import arb, arb_mat, ctx, fmpq

from obsdesign.expressions import Expression
from obsdesign.expressions.algebra import simplified
from obsdesign.expressions.constant import ball
from obsdesign.families.algebraic.identity import Negative
from obsdesign.families.algebraic.region import PRECISIONS, Point, Region

Matrix = list[list[Expression]]
HIDDEN = "whether xhat - x holds a part of this error"


@dataclass(frozen=True)
class Seen:
    """Errors that act on each other, and those on which they act."""

    part: Matrix  # M of the errors that act on each other
    M: Matrix  # of these and all on which they act
    E: Matrix  # of xhat - x, a row for each state
    inputs: Collection[str]  # which may be constant

    def unknown(self, region: Region, place: Point) -> str:
        """What is not known of an observer with an M that is not Hurwitz at a point; nothing: it is none.

        With constant inputs M is constant there if it depends on nothing else. Where it varies, some of the errors
        do not fall if its trace, which says how fast the volume of a set of errors does, is nowhere negative.
        """
        varying = signals(self.part, region) - {*self.inputs}
        if varying and not self.spreads(region):
            return f"whether this error decays while {', '.join(sorted(varying))} varies"
        return "" if self.shown(region, place) else HIDDEN

    def spreads(self, region: Region) -> bool:
        """Whether the trace of M is at least 0 on the whole domain."""
        trace = [row[i] for i, row in enumerate(self.part)]
        falls = simplified(region.on(Expression.combination([fmpq(-1)] * len(trace), trace)))
        return Negative("spreads", falls, strict=False).supremum(region, falls) is not None

    def shown(self, region: Region, place: Point) -> bool:
        """Whether no error but 0 has E e = 0 for ever, by the matrix of observability, with constant inputs."""
        known = {*self.inputs} & place.keys()
        if not self.E or not signals(self.E, region) <= known:
            return False
        still = signals(self.M, region) <= known
        with ctx.workprec(PRECISIONS[-1]):
            rows = balls(self.E, region, place)
            gram = rows.transpose() * rows
            for _ in self.M[1:] if still else ():
                rows = rows * balls(self.M, region, place)
                gram += rows.transpose() * rows
            return 0 not in gram.det()


def signals(M: Matrix, region: Region) -> set[str]:
    """Signals of the plant on which a matrix depends."""
    return {name for row in M for entry in row for name in simplified(region.on(entry)).names}


def balls(M: Sequence[Sequence[Expression]], region: Region, place: Point) -> arb_mat:
    """Matrix at a point, in balls."""
    values: list[list[arb]] = [[ball(region.on(e).order, place, PRECISIONS[-1]) for e in row] for row in M]
    return arb_mat(values)
