"""Where the plant of an observer without an LMI can be, and points of it."""

from collections.abc import Collection, Iterator, Mapping
from functools import cached_property

import numpy as np
from flint import arb, fmpq

from obsdesign.expressions import Expression, Interval
from obsdesign.expressions.algebra import simplified
from obsdesign.expressions.constant import ball
from obsdesign.expressions.needs import Sign, needs
from obsdesign.expressions.tree import Variable
from obsdesign.model.equations import Named
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, Ends, Range, outward
from obsdesign.records import dataclass, field

Domain = Mapping[str, Ends]
Point = Mapping[str, fmpq]
TRIES = 200  # points at which a statement is tried
DIGITS = 3  # of their coordinates, if the domain is wide enough
PRECISIONS = (64, 256, 1024)  # bits


@dataclass(frozen=True)
class Region:
    """Ranges of the signals of a plant, its outputs in terms of the others, and what has a value wherever it is."""

    ranges: Domain = field(default_factory=dict)  # of what is not named, all reals
    outputs: Named = field(default_factory=dict)
    defined: tuple[Expression, ...] = ()  # right sides of the plant, those of the outputs too

    def on(self, value: Expression) -> Expression:
        """Expression with the outputs in terms of states, inputs and t."""
        return value.substituted(self.outputs)

    @cached_property
    def signs(self) -> frozenset[tuple[str, Sign]]:
        """Functions whose sign every right side of the plant needs, with the sign."""
        found = (need for side in self.defined for need in needs(side) if not (need.branch or need.leaves))
        return frozenset((simplified(need.value).text, need.sign) for need in found)

    def implies(self, value: Expression, sign: Sign) -> bool:
        """Whether a function has a sign wherever the plant has equations."""
        text = simplified(self.on(value)).text
        return any((text, known) in self.signs for known in (sign, "> 0"))

    def box(self, names: Collection[str]) -> dict[str, Range]:
        """Ranges of signals, in doubles."""
        return {name: outward(self.ranges.get(name, EVERYWHERE)) for name in sorted(names)}

    def bounds(self, value: Expression) -> bool:
        """Whether interval arithmetic bounds a function on the domain."""
        inside = simplified(self.on(value))
        ranges = {name: Interval(*map(np.array, ends)) for name, ends in self.box(inside.names).items()}
        found = inside.enclose(ranges)
        return bool(np.isfinite(found.low).all() and np.isfinite(found.high).all())

    def points(self, value: Expression) -> Iterator[dict[str, fmpq]]:
        """Points for a value without outputs: middle, ends and what is nearest to 0, then some at random.

        Coordinates have few digits where they can.
        """
        names = sorted(value.names.union(*(side.names for side in self.defined)))
        ranges = [span(self.ranges.get(name, EVERYWHERE)) for name in names]
        draw = np.random.default_rng(0)
        for share in (fmpq(1, 2), fmpq(0), fmpq(1)):
            yield {name: low + share * (high - low) for name, (low, high) in zip(names, ranges, strict=True)}
        yield {name: min(max(fmpq(0), low), high) for name, (low, high) in zip(names, ranges, strict=True)}
        for _ in range(TRIES if value.names else 0):
            shares = [fmpq(int(n), 10**DIGITS) for n in draw.integers(0, 10**DIGITS + 1, len(names))]
            yield {n: low + s * (high - low) for n, (low, high), s in zip(names, ranges, shares, strict=True)}

    def holds(self, place: Point) -> bool:
        """Whether the plant can be at a point: its equations have values there, and outputs are in their ranges."""
        if not all(ball(side.order, place, PRECISIONS[0]).is_finite() for side in self.defined):
            return False
        return all(within(ball(h.order, place, PRECISIONS[0]), *ends) for h, ends in self.limited)

    def around(self, box: Mapping[str, Interval]) -> bool:
        """Whether its outputs are in their ranges on a whole box."""
        found = ((h.enclose(box), outward(ends)) for h, ends in self.limited)
        return all(bool((e.low >= low) & (e.high <= high)) for e, (low, high) in found)

    @property
    def limited(self) -> list[tuple[Expression, Ends]]:
        """Outputs with a range that no range of a state says."""
        shown = ((h, self.ranges[y]) for y, h in self.outputs.items() if y in self.ranges)
        return [(h, ends) for h, ends in shown if not isinstance(h.root, Variable)]


def within(value: arb, low: fmpq | None, high: fmpq | None) -> bool:
    """Whether a ball is in a range."""
    return bool((low is None or value >= arb(low)) and (high is None or value <= arb(high)))


def span(ends: Ends) -> tuple[fmpq, fmpq]:
    """Range in which points are tried: that of the signal, or a part of it where it has no end."""
    low, high = ends
    if low is None:
        low = fmpq(-2) if high is None else high - 4
    return low, low + 4 if high is None else high


def at(value: Expression, place: Point) -> arb | None:
    """Ball that holds the value at a point, as tight as tells it from zero; None where it has no value."""
    for bits in PRECISIONS:
        found = ball(value.order, place, bits)
        if not found.is_finite():
            return None
        if 0 not in found:
            return found
    return found
