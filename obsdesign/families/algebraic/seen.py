"""Whether errors e' = M e that do not fall are seen in the estimate, where xhat - x = E e."""

from collections.abc import Collection

from flint import fmpq, fmpq_mat

from obsdesign.expressions import Expression
from obsdesign.expressions.algebra import simplified
from obsdesign.expressions.tree import Number
from obsdesign.families.algebraic.identity import Negative
from obsdesign.families.algebraic.rational import controlled
from obsdesign.families.algebraic.region import Point, Region
from obsdesign.records import dataclass

Matrix = list[list[Expression]]
HIDDEN = "whether xhat - x holds a part of this error that does not fall"


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
        E, M = self.constant(self.E, region, place), self.constant(self.M, region, place)
        if E is None:
            return HIDDEN
        seen = E.rank() == E.ncols() if M is None else not hurwitz(observed(M, E))
        return "" if seen else HIDDEN

    def spreads(self, region: Region) -> bool:
        """Whether the trace of M is at least 0 on the whole domain."""
        trace = [row[i] for i, row in enumerate(self.part)]
        falls = simplified(region.on(Expression.combination([fmpq(-1)] * len(trace), trace)))
        return Negative("spreads", falls, strict=False).supremum(region, falls) is not None

    def constant(self, M: Matrix, region: Region, place: Point) -> fmpq_mat | None:
        """Matrix at the inputs of a point; None if it depends on what varies, or is not rational."""
        inputs = {name: Expression.number(place[name]) for name in self.inputs if name in place}
        roots = [simplified(region.on(entry).substituted(inputs)).root for row in M for entry in row]
        values = [root.value for root in roots if isinstance(root, Number)]
        return fmpq_mat(len(M), len(M[0]), values) if M and len(values) == len(roots) else None


def signals(M: Matrix, region: Region) -> set[str]:
    """Signals of the plant on which a matrix depends."""
    return {name for row in M for entry in row for name in simplified(region.on(entry)).names}


def observed(M: fmpq_mat, E: fmpq_mat) -> fmpq_mat:
    """Matrix of the part of e' = M e that E e shows."""
    shown = controlled(M.transpose(), E.transpose())
    if not shown.ncols():
        return fmpq_mat(0, 0)
    return (shown.transpose() * shown).inv() * shown.transpose() * M.transpose() * shown


def hurwitz(M: fmpq_mat) -> bool:
    """Whether every eigenvalue has a negative real part, by the minors of the matrix of Hurwitz."""
    n, c = M.nrows(), [fmpq(a) for a in reversed(M.charpoly().coeffs())]
    H = [[c[2 * j - i + 1] if 0 <= 2 * j - i + 1 <= n else fmpq(0) for j in range(n)] for i in range(n)]
    minors = (fmpq_mat(k, k, [H[i][j] for i in range(k) for j in range(k)]).det() for k in range(1, n + 1))
    return all(minor > 0 for minor in minors)
