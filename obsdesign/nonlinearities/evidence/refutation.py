"""A pair of arguments that contradicts a declared type.

The search is by sampling and decides nothing. A pair is confirmed in rational arithmetic, with balls for the values
of f, before it is shown, so that a type that is exactly tight is never refused for a rounding error.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import floor, log10

import numpy as np
from flint import arb, ctx, fmpq

from obsdesign.expressions import Expression
from obsdesign.expressions.constant import ball
from obsdesign.lmi.formula import Array, rational_number
from obsdesign.nonlinearities.evidence.claims import Claim
from obsdesign.nonlinearities.evidence.restriction import Ends, Restriction
from obsdesign.nonlinearities.evidence.search import Pairs, pairs

BITS = 256  # of the balls
VISIBLE = 1e-9  # relative violation, below which sampling sees rounding errors only
TRIED = 6  # pairs of a claim
DIGITS = (1, 2, 3, 5, 8, 12, 17)  # to which a pair is rounded, until it still refutes the type

Point = dict[str, fmpq]


@dataclass(frozen=True)
class Counterexample:
    """Two arguments, with the same other variables, whose difference a type excludes."""

    first: Point
    second: Point
    reason: str

    def text(self, f: Restriction) -> str:
        """Pair and reason as a message has them."""
        same = f" (at {listed(f, self.first, f.others)})" if f.others else ""
        pair = f"{listed(f, self.first, f.arguments)} and {listed(f, self.second, f.arguments)}"
        return f"{pair}{same}: {self.reason}"


def counterexample(f: Restriction, claims: Iterable[Claim]) -> Counterexample | None:
    """Search for a pair that violates one of the claims of a type; None says nothing of the type."""
    for claim in claims:
        candidates = pairs(f, claim)
        worst = np.argsort(candidates.violation)
        seen = worst[candidates.violation[worst] < -VISIBLE]
        if not len(seen):
            continue
        clear = seen[candidates.violation[seen] <= 0.8 * candidates.violation[seen[0]]]
        plain = clear[np.argsort(candidates.plainness(f.nq)[clear], kind="stable")]
        for k in (*plain[:TRIED], *seen[:TRIED]):
            found = confirmed(f, claim, candidates, int(k))
            if found:
                return replace(found, reason=found.reason + claim.instead(f))
    return None


def confirmed(f: Restriction, claim: Claim, candidates: Pairs, k: int) -> Counterexample | None:
    """Return the pair in as few digits as still refute the claim, about as clearly as the pair itself."""
    for first, second in rounded(f, candidates.first[:, k], candidates.second[:, k]):
        dq = np.array([first[q] - second[q] for q in f.arguments], dtype=object)
        if any(dq):
            with ctx.workprec(BITS):
                df = [value(g, first) - value(g, second) for g in f.f]
                reason = claim.refuted(dq, df)
            if reason:
                return Counterexample(first, second, reason)
    return None


def value(component: Expression, point: Point) -> arb:
    """Ball around the value of a component of f."""
    return ball(component.order, point, BITS)


def rounded(f: Restriction, first: Array, second: Array) -> Iterator[tuple[Point, Point]]:
    """Pair in decimals of more and more digits, counted from the first one in which its members differ."""
    distance = float(abs(first - second).max())
    for digits in DIGITS:
        places = [digits - 1 - floor(log10(distance))] * f.nq + [digits + 1] * len(f.others)
        yield point(f, first, places), point(f, second, places)


def point(f: Restriction, values: Array, places: Sequence[int]) -> Point:
    """Point of the region, in decimals with so many places or at its limits."""
    decimals = (decimal(float(x), k) for x, k in zip(values, places, strict=True))
    return {name: within(x, ends) for x, (name, ends) in zip(decimals, f.region.items(), strict=True)}


def within(x: fmpq, ends: Ends) -> fmpq:
    """Nearest number within exact limits."""
    low, high = ends
    return low if low is not None and x < low else high if high is not None and x > high else x


def decimal(x: float, places: int) -> fmpq:
    """Double rounded to so many decimal places, exactly."""
    return rational_number(repr(round(x, places)))


def listed(f: Restriction, point: Point, names: Sequence[str]) -> str:
    """Variables with their values."""
    return ", ".join(f"{f.shown(name)} = {str(float(point[name])).removesuffix('.0')}" for name in names)
