"""What an observer without an LMI rests on: identities, and the sign of functions, on the domain of its plant.

Each is proved, or refuted by a point of the domain at which it fails, or neither. An identity is proved by the algebra
of `expressions.algebra`, a sign by interval arithmetic over the whole domain; both are refuted in balls.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from flint import arb, fmpq

from obsdesign.expressions import Expression, ExpressionError
from obsdesign.expressions.algebra import Symbols, simplified
from obsdesign.expressions.constant import ball
from obsdesign.nonlinearities.evidence.enclosure import supremum
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, Ends, outward

Domain = Mapping[str, Ends]
TRIES = 200  # points at which a statement is tried
DIGITS = 3  # of their coordinates, if the domain is wide enough
PRECISIONS = (64, 256, 1024)  # bits
WORK = 20_000  # boxes at which a sign is looked for, and fewer the more operations a function has:
OPERATIONS = 1_000_000  # on boxes, at most
LONGEST = 120  # characters of a function that are shown


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
    point: Mapping[str, fmpq] = field(default_factory=dict)  # where it does not
    wanted: str = "0"  # what it should be
    value: float = 0.0  # of the residual there
    bound: float | None = None  # proved supremum of a sign

    def written(self) -> dict[str, Any]:
        """Entry of a diagnosis."""
        where = {name: float(value) for name, value in self.point.items()}
        return {"statement": self.name, "residual": self.residual, "point": where, "value": self.value}

    @property
    def sentence(self) -> str:
        """What fails, and where."""
        where = ", ".join(f"{name} = {float(value):g}" for name, value in self.point.items())
        return f"{self.name} fails: {self.residual} is {self.value:.6g} at {where or 'every point'}, not {self.wanted}"


@dataclass(frozen=True)
class Identity:
    """A residual that must vanish at every point."""

    name: str
    residual: Expression

    def decided(self, domain: Domain) -> Verdict:
        """Whether it does."""
        shown = self.residual
        try:
            symbols = Symbols.of([self.residual])
            fraction = symbols.fraction(self.residual)
            if symbols.equal(fraction, symbols.constant(0)):
                return Verdict(self.name, Answer.PROVED)
            shown = symbols.expression(fraction)
        except ExpressionError:
            pass  # too large to be multiplied out: only a point can tell
        for point in points(self.residual, domain):
            value = at(self.residual, point)
            if value is not None and value.is_finite() and 0 not in value:
                return Verdict(self.name, Answer.REFUTED, short(shown), point, "0", float(value.mid()))
        return Verdict(self.name, Answer.OPEN, short(shown))


@dataclass(frozen=True)
class Negative:
    """A function that must be below zero on the whole domain, or at most zero."""

    name: str
    value: Expression
    strict: bool = True

    def decided(self, domain: Domain) -> Verdict:
        """Whether it is, with a bound on its supremum."""
        names = sorted(self.value.names)
        box = {name: outward(domain.get(name, EVERYWHERE)) for name in names}
        target = (-np.finfo(float).tiny if self.strict else 0.0) if names else None
        work = min(WORK, OPERATIONS / len(self.value.order))
        found = supremum(self.value.enclose, box, work, target=target)
        if found.bound < 0 or (found.bound == 0 and not self.strict):
            tight = supremum(self.value.enclose, box, work)
            return Verdict(self.name, Answer.PROVED, bound=tight.bound)
        wanted = "below 0" if self.strict else "at most 0"
        for point in points(self.value, domain):
            value = at(self.value, point)
            if value is not None and value.is_finite() and (value >= 0 if self.strict else value > 0):
                shown = short(simplified(self.value))
                return Verdict(self.name, Answer.REFUTED, shown, point, wanted, float(value.mid()))
        return Verdict(self.name, Answer.OPEN, short(self.value))


def nonzero(name: str, value: Expression, domain: Domain) -> Verdict:
    """Whether a function has no zero on the domain: it keeps its sign."""
    negative = Expression.combination([fmpq(-1)], [value])
    signs = [Negative(name, side).decided(domain) for side in (value, negative)]
    proved = next((sign for sign in signs if sign.answer is Answer.PROVED), None)
    if proved:
        return Verdict(name, Answer.PROVED)
    low, high = (sign.answer is Answer.REFUTED for sign in signs)
    if low and high and value.smooth:  # both signs occur, and 0 between them, or 0 itself
        zero = min(signs, key=lambda sign: abs(sign.value))
        return Verdict(name, Answer.REFUTED, short(value), zero.point, "of one sign", zero.value)
    return Verdict(name, Answer.OPEN, short(value))


def points(value: Expression, domain: Domain) -> Iterator[dict[str, fmpq]]:
    """Points of the domain, ends and middle first, then at random; coordinates have few digits where they can."""
    names = sorted(value.names)
    ranges = [span(domain.get(name, EVERYWHERE)) for name in names]
    draw = np.random.default_rng(0)
    for share in (fmpq(1, 2), fmpq(0), fmpq(1)):
        yield {name: low + share * (high - low) for name, (low, high) in zip(names, ranges, strict=True)}
    for _ in range(TRIES if names else 0):
        shares = [fmpq(int(n), 10**DIGITS) for n in draw.integers(0, 10**DIGITS + 1, len(names))]
        yield {n: low + s * (high - low) for n, (low, high), s in zip(names, ranges, shares, strict=True)}


def span(ends: Ends) -> tuple[fmpq, fmpq]:
    """Range in which points are tried: that of the signal, or a part of it where it has no end."""
    low, high = ends
    if low is None:
        low = fmpq(-2) if high is None else high - 4
    return low, low + 4 if high is None else high


def at(value: Expression, point: Mapping[str, fmpq]) -> arb | None:
    """Ball that holds the value at a point, as tight as tells it from zero; None where it has no value."""
    for bits in PRECISIONS:
        found = ball(value.order, point, bits)
        if not found.is_finite():
            return None
        if 0 not in found:
            return found
    return found


def short(value: Expression) -> str:
    """Text of an expression, its end left out where it is long."""
    return value.text if len(value.text) <= LONGEST else f"{value.text[:LONGEST]} .."
