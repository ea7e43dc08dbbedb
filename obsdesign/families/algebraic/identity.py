"""What an observer without an LMI rests on: identities, and the sign of functions, wherever its plant can be.

Each is proved, or refuted by a point at which it fails and the plant can be, or neither. An identity is proved by the
algebra of `expressions.algebra`, a sign by interval arithmetic over the whole domain; both are refuted in balls.
"""

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.expressions import Expression, ExpressionError
from obsdesign.expressions.algebra import Symbols, simplified
from obsdesign.expressions.constant import ball
from obsdesign.expressions.functions import apply
from obsdesign.expressions.interval import Interval, point
from obsdesign.expressions.needs import needs
from obsdesign.expressions.tree import Call, number, product
from obsdesign.families.algebraic.region import PRECISIONS, Point, Region, at
from obsdesign.model.equations import Named
from obsdesign.nonlinearities.evidence.enclosure import supremum
from obsdesign.records import dataclass, field, replace

WORK = 20_000  # boxes at which a sign is looked for, and fewer the more operations a function has:
OPERATIONS = 1_000_000  # on boxes, at most
HALVINGS = 40  # of the way between two signs, on which a zero is looked for
LONGEST = 120  # characters of a function that are shown

Place = Mapping[str, float]  # a point in doubles


class Answer(StrEnum):
    """How a statement ends."""

    PROVED = "proved"
    REFUTED = "refuted"
    OPEN = "open"


@dataclass(frozen=True)
class Verdict:
    """A statement, what was found of it, and what shows it."""

    name: str  # what it says, in the words of the observer
    answer: Answer
    residual: str = ""  # what should vanish, or the function whose sign is wrong
    point: Place = field(default_factory=dict)  # where it does not
    wanted: str = "0"  # what it should be
    value: float = 0.0  # of the residual there
    bound: float | None = None  # proved supremum of a sign
    leaves: str = ""  # what is not known where it fails; nothing: it is false

    def written(self) -> dict[str, Any]:
        """Entry of a diagnosis."""
        return {"statement": self.name, "residual": self.residual, "point": dict(self.point), "value": self.value}

    @property
    def sentence(self) -> str:
        """What fails, and where; or what is not known."""
        where = ", ".join(f"{name} = {value:g}" for name, value in self.point.items()) or "every point"
        said = f"{self.name} fails: {self.residual} is {self.value:.6g} at {where}, not {self.wanted}"
        if self.answer is Answer.REFUTED:
            return said
        return f"not known {self.leaves}: {said}" if self.leaves else f"neither proved nor refuted: {self.name}"


@dataclass(frozen=True)
class Identity:
    """A residual that must vanish at every point.

    `leaves`: what is not known where it does not; if that is nothing, the observer is none. `places`: signals of the
    observer in terms of those of the plant, where it is looked for a point at which it does not.
    """

    name: str
    residual: Expression
    leaves: str = ""
    places: Named = field(default_factory=dict)

    def decided(self, region: Region) -> Verdict:
        """Whether it does."""
        shown = self.residual
        for residual in dict.fromkeys((self.residual, region.on(self.residual))):
            try:
                symbols = Symbols.of([residual])
                fraction = symbols.fraction(residual)
                if symbols.equal(fraction, symbols.constant(0)):
                    return Verdict(self.name, Answer.PROVED)
                shown = symbols.expression(fraction) if shown is residual else shown
            except ExpressionError:
                pass  # too large to be multiplied out: only a point can tell
        value = region.on(self.residual.substituted(self.places))
        for place in region.points(value):
            found = at(value, place)
            if found is not None and 0 not in found and region.holds(place):
                sides = {name: region.on(self.places.get(name, variable(name))) for name in sorted(shown.names)}
                where = {name: value_at(side, place) for name, side in sides.items()}
                return failed(self, shown, where, "0", float(found.mid()))
        return Verdict(self.name, Answer.OPEN, short(shown))


@dataclass(frozen=True)
class Negative:
    """A function that must be below zero on the whole domain, or at most zero, on a branch where it is looked at.

    `leaves`: as of an `Identity`, `unknown` says it of a point; `given`: those without which it says nothing where it
    is not.
    """

    name: str
    value: Expression
    strict: bool = True
    branch: tuple[Expression, ...] = ()
    leaves: str = ""
    given: tuple[Identity, ...] = ()
    unknown: Callable[[Region, Point], str] | None = None

    def decided(self, region: Region) -> Verdict:
        """Whether it is, with a bound on its supremum."""
        looked = on_branch(self.value, self.branch, -1)
        for value in dict.fromkeys((region.on(looked), looked)):
            if (bound := self.supremum(region, value)) is not None:
                return Verdict(self.name, Answer.PROVED, bound=bound)
        if region.implies(Expression.combination([fmpq(-1)], [self.value]), "> 0" if self.strict else ">= 0"):
            return Verdict(self.name, Answer.PROVED)
        if any(one.decided(region).answer is not Answer.PROVED for one in self.given):
            return Verdict(self.name, Answer.OPEN, short(self.value))
        value, wanted = region.on(looked), "below 0" if self.strict else "at most 0"
        for place in region.points(value):
            found = at(value, place)
            if found is not None and (found >= 0 if self.strict else found > 0) and region.holds(place):
                shown = simplified(region.on(self.value))
                leaves = self.leaves or (self.unknown(region, place) if self.unknown else "")
                said = replace(self, leaves=leaves)
                return failed(said, shown, coordinates(shown, place), wanted, float(found.mid()))
        return Verdict(self.name, Answer.OPEN, short(self.value))

    def supremum(self, region: Region, value: Expression) -> float | None:
        """Bound on a function that proves that it has this sign; None where it is not proved."""
        box = region.box(value.names)
        target = (-np.finfo(float).tiny if self.strict else 0.0) if box else None
        work = min(WORK, OPERATIONS / len(value.order))
        found = supremum(value.enclose, box, work, target=target)
        if found.bound < 0 or (found.bound == 0 and not self.strict):
            return supremum(value.enclose, box, work).bound
        return None


@dataclass(frozen=True)
class Nonzero:
    """A divisor that must not vanish on the domain, on a branch where it is looked at.

    `leaves`: as of an `Identity`.
    """

    name: str
    value: Expression
    branch: tuple[Expression, ...] = ()
    leaves: str = ""

    def decided(self, region: Region) -> Verdict:
        """Whether it does not: it keeps its sign."""
        looked = on_branch(self.value, self.branch, 1)
        for value in dict.fromkeys((region.on(looked), looked)):
            negative = Expression.combination([fmpq(-1)], [value])
            if any(Negative(self.name, side).supremum(region, side) is not None for side in (value, negative)):
                return Verdict(self.name, Answer.PROVED)
        if region.implies(self.value, "is not 0"):
            return Verdict(self.name, Answer.PROVED)
        value = region.on(looked)
        if (zero := vanishing(value, region)) is None:
            return Verdict(self.name, Answer.OPEN, short(self.value))
        return failed(self, region.on(self.value), coordinates(value, zero), "of one sign", value_at(value, zero))


@dataclass(frozen=True)
class Undecided:
    """A statement for which there is no proof here, and no refutation."""

    name: str

    def decided(self, region: Region) -> Verdict:  # noqa: ARG002
        """That it is not."""
        return Verdict(self.name, Answer.OPEN)


def failed(
    statement: Identity | Negative | Nonzero, shown: Expression, where: Place, wanted: str, value: float
) -> Verdict:
    """Verdict of a statement that does not hold at a point where the plant can be: it is false, or leaves something."""
    answer = Answer.OPEN if statement.leaves else Answer.REFUTED
    return Verdict(statement.name, answer, short(shown), where, wanted, value, leaves=statement.leaves)


def vanishing(value: Expression, region: Region) -> Point | None:
    """Point where the plant can be at which a function vanishes, or next to it; None where none was found."""
    sides: dict[bool, Point] = {}
    for place in region.points(value):
        found = at(value, place)
        if found is not None and region.holds(place):
            if found == 0:
                return place
            if 0 not in found:
                sides.setdefault(bool(found > 0), place)
    return crossing(value, region, sides[True], sides[False]) if len(sides) > 1 else None


def crossing(value: Expression, region: Region, above: Point, below: Point) -> Point | None:
    """Point next to which a function vanishes between two of different sign; None where it is not proved to."""
    if not value.smooth or any(isinstance(node, Call) and node.operation == "atan2" for node in value.order):
        return None  # it may jump over 0
    for _ in range(HALVINGS):
        middle = {name: (above[name] + below[name]) / 2 for name in above}
        found = at(value, middle)
        if found is None or 0 in found:
            return middle if found is not None and found == 0 and region.holds(middle) else None
        above, below = (middle, below) if found > 0 else (above, middle)
    box = {name: point(above[name]).hull(point(below[name])) for name in above}
    return above if all(continuous(side, box) for side in (value, *region.defined)) and region.around(box) else None


def continuous(value: Expression, box: Mapping[str, Interval]) -> bool:
    """Whether all that an expression needs to have a value holds on a box."""
    found = [(need.sign, need.value.enclose(box)) for need in needs(value)]
    return all(bool((e.low > 0) | ((e.high < 0) & (sign == "is not 0"))) for sign, e in found)


def on_branch(value: Expression, branch: tuple[Expression, ...], otherwise: int) -> Expression:
    """Function that is another number off a branch."""
    if not branch:
        return value
    return Expression(apply("where", product([c.root for c in branch]), value.root, number(otherwise)))


def variable(name: str) -> Expression:
    """A signal."""
    return Expression.variable(name)


def coordinates(value: Expression, place: Point) -> Place:
    """Values, in doubles, of the signals of an expression at a point."""
    return {name: value_at(variable(name), place) for name in sorted(value.names)}


def value_at(value: Expression, place: Point) -> float:
    """Value at a point, in doubles."""
    return float(ball(value.order, place, PRECISIONS[-1]).mid())


def short(value: Expression) -> str:
    """Text of an expression, its end left out where it is long."""
    return value.text if len(value.text) <= LONGEST else f"{value.text[:LONGEST]} .."
