"""Errors that move in a cascade of blocks: e' = M e in each, where those before it are 0.

A block of one error falls by the sign of its rate. Errors that act on each other fall where M is constant and Hurwitz;
where it varies, that it is Hurwitz at every point does not prove it.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property

from obsdesign.expressions import Expression
from obsdesign.expressions.algebra import simplified
from obsdesign.families.algebraic.high_gain import blocks, falling, reached, seen, stable
from obsdesign.families.algebraic.identity import Identity, Negative, Undecided
from obsdesign.families.algebraic.scheme import DECAYS, ZERO, Plant, Statement, decay, less, multiplied, unbounded
from obsdesign.families.algebraic.seen import Matrix
from obsdesign.model.equations import Named
from obsdesign.records import dataclass


@dataclass(frozen=True)
class Error:
    """An error of an observer, which vanishes where it is right."""

    name: str  # in words
    moves: str  # how the statement begins that says how it moves
    falls: str  # and the one that it falls
    moving: Expression  # its derivative, of signals of the plant and the symbols of errors


@dataclass(frozen=True)
class Block:
    """Errors that act on each other, and how they fall."""

    own: tuple[str, ...]  # symbols
    before: tuple[str, ...]  # of the errors that act on them
    statements: tuple[Statement, ...]
    said: str  # what follows if they hold
    open: tuple[str, ...]  # couplings that are not proved to be bounded

    @property
    def rate(self) -> str:
        """Statement that gives the rate of a single error on which no other acts; nothing if it is none."""
        return "" if len(self.own) > 1 or self.before else self.statements[-1].name


@dataclass(frozen=True)
class Cascade:
    """Errors e of an observer by their symbols, of which xhat - x is E e while they are small."""

    plant: Plant
    errors: Mapping[str, Error]
    E: Matrix
    given: tuple[Identity, ...] = ()  # without which they need not move so
    hidden: frozenset[str] = frozenset()  # signals of the observer of which it is not known where they can be
    leaves: str = ""  # what is not known of a rate that depends on them

    @cached_property
    def slopes(self) -> Matrix:
        """Derivatives of each e' with respect to each e."""
        return [[slope(each.moving, name) for name in self.errors] for each in self.errors.values()]

    @cached_property
    def reach(self) -> list[list[bool]]:
        """Whether the error of a column acts on that of a row."""
        return reached(self.slopes)

    @property
    def zero(self) -> Named:
        """All errors as 0."""
        return dict.fromkeys(self.errors, ZERO)

    @cached_property
    def M(self) -> Matrix:
        """Of e' = M e, for small errors."""
        return [[simplified(entry.substituted(self.zero)) for entry in row] for row in self.slopes]

    @cached_property
    def rows(self) -> list[Identity]:
        """Statements that each e' is linear in the errors of its block."""
        found = []
        for i, (symbol, each) in enumerate(self.errors.items()):
            own = [name for j, name in enumerate(self.errors) if self.reach[i][j] and self.reach[j][i]]
            later = each.moving.substituted({name: ZERO for name in self.errors if name not in own})
            row = {name: c for name, c in zip(self.errors, self.M[i], strict=True) if name in own and c.text != "0"}
            terms = " + ".join(f"({c}) {name}" for name, c in row.items()) or "0"
            ahead = ", ".join(name for j, name in enumerate(self.errors) if self.reach[i][j] and name not in own)
            said = f"{each.moves}: {symbol}' = {terms}" + (f", where {ahead} = 0" if ahead else "")
            residual = less(later, *(multiplied(c, Expression.variable(name)) for name, c in row.items()))
            found.append(Identity(said, residual, f"whether {DECAYS}"))
        return found

    def blocks(self) -> list[Block]:
        """How each block falls."""
        symbols, found = list(self.errors), []
        for block in blocks(self.slopes):
            before = [j for j, acts in enumerate(self.reach[block[0]]) if acts and j not in block]
            signs, said = self.falls(block, before)
            pairs = [(i, j) for i in block for j in before if not self.plant.region.bounds(self.slopes[i][j])]
            names = [each.name for each in self.errors.values()]
            open_ = tuple(unbounded(names[j], names[i], self.slopes[i][j]) for i, j in pairs)
            own, ahead = tuple(symbols[i] for i in block), tuple(symbols[j] for j in before)
            found.append(Block(own, ahead, (*(self.rows[i] for i in block), *signs), said, open_))
        return found

    def falls(self, block: Sequence[int], before: Sequence[int]) -> tuple[tuple[Statement, ...], str]:
        """Statements that the errors of a block fall where those before it are 0, and what they say."""
        errors = list(self.errors.values())
        part = [[self.M[i][j] for j in block] for i in block]
        name = ", ".join(errors[i].name for i in block)
        given = (*(self.rows[i] for i in [*block, *before]), *self.given)
        unknown = seen(self.M, self.E, block, self.plant.inputs, self.reach).unknown
        varying = {name for row in part for entry in row for name in entry.names}
        if len(block) == 1:
            rate = part[0][0]
            leaves = self.leaves if rate.names & self.hidden else ""
            sign = Negative(f"{errors[block[0]].falls}: {rate} < 0", rate, leaves=leaves, given=given, unknown=unknown)
            return (sign,), f"{name} {decay(rate)}"
        what = " and ".join(errors[i].falls for i in block)
        signs = stable(part, f"{what} are stable", given, unknown)
        if varying:
            said = f"{name} fall, which act on each other while {', '.join(sorted(varying))} varies"
            return (*signs, Undecided(said)), said
        faster, rate_ = falling(part, f"{what} fall at least as exp")
        said = f"{name} act on each other and fall exponentially, for e' = M e with a constant M{rate_}"
        return (*signs, *faster), said


def slope(moving: Expression, name: str) -> Expression:
    """Derivative with respect to an error, 0 where it is not held."""
    return simplified(moving.derivative(name)) if name in moving.names else ZERO
