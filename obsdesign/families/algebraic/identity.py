"""What an observer without an LMI rests on: identities, and the sign of functions, wherever its plant can be.

Each is proved, or refuted by a point at which it fails and the plant can be, or neither. An identity is proved by the
algebra of `expressions.algebra`, a sign by interval arithmetic over the whole domain; both are refuted in balls.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
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
from obsdesign.families.algebraic.region import Point, Region, at
from obsdesign.model.equations import Named
from obsdesign.nonlinearities.evidence.enclosure import supremum

WORK = 20_000  # boxes at which a sign is looked for
HALVINGS = 40  # of the way between two signs, on which a zero is looked for
LONGEST = 400  # characters of a residual that are shown


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
    point: Mapping[str, float] = field(default_factory=dict)  # where it does not
    wanted: str = "0"  # what it should be
    value: float = 0.0  # of the residual there
    bound: float | None = None  # proved supremum of a sign

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
        if self.point:
            return f"an error is not linear, and it is not proved that it decays: {said}"
        return f"neither proved nor refuted: {self.name}"


@dataclass(frozen=True)
class Identity:
    """A residual that must vanish at every point.

    `places`: expressions of some signals, where it is false if it does not. An identity of the tool itself, that an
    error is linear, is supposed and never false: another error may decay as well.
    """

    name: str
    residual: Expression
    places: Named = field(default_factory=dict)
    supposed: bool = False

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
                where = {name: value_at(region.on(self.places.get(name, variable(name))), place) for name in names(shown)}
                answer = Answer.OPEN if self.supposed else Answer.REFUTED
                return Verdict(self.name, answer, short(shown), where, "0", float(found.mid()))
        return Verdict(self.name, Answer.OPEN, short(shown))


@dataclass(frozen=True)
class Negative:
    """A function that must be below zero on the whole domain, or at most zero, on a branch where it is looked at.

    `given`: identities without which it says nothing where it is not.
    """

    name: str
    value: Expression
    strict: bool = True
    branch: tuple[Expression, ...] = ()
    given: tuple[Identity, ...] = ()

    def decided(self, region: Region) -> Verdict:
        """Whether it is, with a bound on its supremum."""
        looked = on_branch(self.value, self.branch, -1)
        for value in dict.fromkeys((region.on(looked), looked)):
            if (bound := self.supremum(region, value)) is not None:
                return Verdict(self.name, Answer.PROVED, bound=bound)
        value, wanted = region.on(looked), "below 0" if self.strict else "at most 0"
        for place in region.points(value):
            found = at(value, place)
            if found is not None and (found >= 0 if self.strict else found > 0) and region.holds(place):
                shown = simplified(region.on(self.value))
                where = {name: value_at(variable(name), place) for name in names(shown)}
                linear = all(one.decided(region).answer is Answer.PROVED for one in self.given)
                answer = Answer.REFUTED if linear else Answer.OPEN
                return Verdict(self.name, answer, short(shown), where, wanted, float(found.mid()))
        return Verdict(self.name, Answer.OPEN, short(self.value))

    def supremum(self, region: Region, value: Expression) -> float | None:
        """Bound on a function that proves that it has this sign; None where it is not proved."""
        box = region.box(value.names)
        target = (-np.finfo(float).tiny if self.strict else 0.0) if box else None
        found = supremum(value.enclose, box, WORK, target=target)
        if found.bound < 0 or (found.bound == 0 and not self.strict):
            return supremum(value.enclose, box, WORK).bound
        return None


@dataclass(frozen=True)
class Nonzero:
    """A divisor that must not vanish on the domain, on a branch where it is looked at."""

    name: str
    value: Expression
    branch: tuple[Expression, ...] = ()

    def decided(self, region: Region) -> Verdict:
        """Whether it does not: it keeps its sign."""
        looked = on_branch(self.value, self.branch, 1)
        for value in dict.fromkeys((region.on(looked), looked)):
            negative = Expression.combination([fmpq(-1)], [value])
            if any(Negative(self.name, side).supremum(region, side) is not None for side in (value, negative)):
                return Verdict(self.name, Answer.PROVED)
        value, sides = region.on(looked), {}
        for place in region.points(value):
            found = at(value, place)
            if found is not None and region.holds(place):
                if found == 0:
                    return self.refuted(region, place)
                sides.setdefault(bool(found > 0), place) if 0 not in found else None
        zero = crossing(value, region, sides[True], sides[False]) if len(sides) > 1 and not self.branch else None
        return self.refuted(region, zero) if zero else Verdict(self.name, Answer.OPEN, short(self.value))

    def refuted(self, region: Region, place: Point) -> Verdict:
        """Verdict of a point at which it vanishes, or near which it does."""
        value = region.on(self.value)
        where = {name: value_at(variable(name), place) for name in names(value)}
        return Verdict(self.name, Answer.REFUTED, short(value), where, "of one sign", value_at(value, place))


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


def names(value: Expression) -> list[str]:
    """Signals of an expression, in order."""
    return sorted(value.names)


def value_at(value: Expression, place: Point) -> float:
    """Value at a point, in doubles."""
    return float(ball(value.order, place, PRECISIONS[-1]).mid())


def short(value: Expression) -> str:
    """Text of an expression, its end left out where it is long."""
    return value.text if len(value.text) <= LONGEST else f"{value.text[:LONGEST]} .."
