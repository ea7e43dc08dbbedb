"""A pair of arguments that contradicts a declared type.

The search is by sampling and decides nothing: pairs far apart and close ones, and those that the Jacobian points to. A
pair is confirmed in rational arithmetic, with balls for the values of f, before it is shown, so that a type that is
exactly tight is never refused for a rounding error.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import floor, log10

import numpy as np
from flint import ctx, fmpq

from obsdesign.expressions import Expression, ExpressionError, Interval
from obsdesign.expressions.constant import ball
from obsdesign.lmi.formula import Array, rational_number
from obsdesign.nonlinearities.evidence.claims import Claim, Quadratic
from obsdesign.nonlinearities.evidence.enclosure import middle, negative, supremum_of
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, Ends, Range, Restriction
from obsdesign.records import dataclass, replace

BITS = 256  # of the balls
VISIBLE = 1e-9  # relative violation, below which sampling sees rounding errors only
TRIED = 6  # pairs of a claim
DIGITS = (1, 2, 3, 5, 8, 12, 17)  # to which a pair is rounded, until it still refutes the type
COUNT = 1024  # points
SLOWER = 6  # how many times fewer for a claim that takes longer to evaluate
CHAINS = 8  # points that are improved
ROUNDS = 12  # of improvement
TRIALS = 24  # around each of these points in a round
HALVINGS = 24  # of pairs
STEPS = 10.0 ** -np.arange(6)  # distances of pairs, in relation to the scale
NEAR = 10.0  # what an engineer tries first of an unbounded variable
FAR = NEAR**4  # .. and last
FARTHEST = 1e12  # where an enclosure may point to
MAX_OPERATIONS = 5000  # in a Jacobian that is worth the time
MAX_SIZE = 32  # of q and f together, likewise

Point = dict[str, fmpq]
Members = tuple[Array, Array]  # of pairs, (k, N) each


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


@dataclass(frozen=True)
class Pairs:
    """Pairs of points (k, N): the components of q first, then the other variables, which both share."""

    first: Array
    second: Array
    violation: Array  # (N,), as the claim rates it; never NaN

    def plainness(self, nq: int) -> Array:
        """Least (N,) for pairs around zero whose members are 1 apart, which are the easiest to follow."""
        distance = np.linalg.norm(self.first[:nq] - self.second[:nq], axis=0)
        size = np.maximum(abs(self.first[:nq]), abs(self.second[:nq])).max(axis=0)
        with np.errstate(all="ignore"):
            return np.asarray(size / distance + abs(np.log10(distance)))


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
                df = [ball(g.order, first, BITS) - ball(g.order, second, BITS) for g in f.f]
                reason = claim.refuted(dq, df)
            if reason:
                return Counterexample(first, second, reason)
    return None


def rounded(f: Restriction, first: Array, second: Array) -> Iterator[tuple[Point, Point]]:
    """Pair in decimals of more and more digits, counted from the first one in which its members differ."""
    distance = float(abs(first - second).max())
    for digits in DIGITS:
        places = [digits - 1 - floor(log10(distance))] * f.nq + [digits + 1] * len(f.others)
        yield point(f, first, places), point(f, second, places)


def point(f: Restriction, values: Array, places: Sequence[int]) -> Point:
    """Point of the region, in decimals with so many places or at its limits."""
    decimals = (rational_number(repr(round(float(x), k))) for x, k in zip(values, places, strict=True))
    return {name: within(x, ends) for x, (name, ends) in zip(decimals, f.region.items(), strict=True)}


def within(x: fmpq, ends: Ends) -> fmpq:
    """Nearest number within exact limits."""
    low, high = ends
    return low if low is not None and x < low else high if high is not None and x > high else x


def listed(f: Restriction, point: Point, names: Sequence[str]) -> str:
    """Variables with their values."""
    return ", ".join(f"{f.shown(name)} = {str(float(point[name])).removesuffix('.0')}" for name in names)


def pairs(f: Restriction, claim: Claim) -> Pairs:
    """Pairs to try, rated."""
    rng = np.random.default_rng(0)
    quick = isinstance(claim, Quadratic)
    points = np.hstack([spread(f.box, rng, COUNT if quick else COUNT // SLOWER), extremes(f)])
    found = [apart(f, points, rng), astray(f, points, rng)]
    found += steepest(f, claim, points, TRIALS if quick else TRIALS // SLOWER, rng)
    found += halved(f, claim, joined(found), HALVINGS if quick else HALVINGS // SLOWER)
    return rated(f, claim, *joined(found))


def moderate(f: Restriction) -> list[Expression]:
    """Entries of the Jacobian, row by row; empty where they are not worth the time."""
    if f.nq + len(f.f) > MAX_SIZE:
        return []
    try:
        entries = [g for row in f.jacobian for g in row]
    except ExpressionError:
        return []
    return entries if sum(len(g.order) for g in entries) <= MAX_OPERATIONS else []


def extremes(f: Restriction) -> Array:
    """Points (k, N) where an entry of the Jacobian is largest or smallest, however far out, as far as it is found."""
    entries = [g for g in dict.fromkeys(moderate(f)) if g.names]
    found = [anywhere(f)]
    for g in entries:
        found += [{**found[0], **supremum_of(h, f, 1 / (2 * len(entries))).point} for h in (g, negative(g))]
    return np.asarray(np.clip([[*point.values()] for point in found], -FARTHEST, FARTHEST)).T


def anywhere(f: Restriction) -> dict[str, float]:
    """Point of the region."""
    return {name: float(middle(np.array([[limits]]))[0, 0]) for name, limits in f.box.items()}


def searched(f: Restriction) -> str:
    """Where pairs are looked for, in words."""
    parts = []
    for name, (low, high) in f.region.items():
        limits = (-FAR if low is None else float(low)), (FAR if high is None else float(high))
        if any(name in g.names for g in f.f):
            inside = "{} in [{:g}, {:g}]".format(f.shown(name), *limits)
            parts.append(f"|{f.shown(name)}| <= {FAR:g}" if (low, high) == EVERYWHERE else inside)
    return " and ".join(parts)


def undefined(f: Restriction) -> tuple[int, str] | None:
    """Component of f, from 0, that surely has no value somewhere on the region, and where; None if none is seen."""
    ends = clipped(f, np.outer(np.ones(len(f.box)), (-FAR, FAR)))
    points = np.hstack([spread(f.box, np.random.default_rng(0), COUNT), ends])
    boxes = {name: Interval(x, x) for name, x in zip(f.box, points, strict=True)}
    for i, g in enumerate(f.f):
        empty = np.broadcast_to(g.enclose(boxes).empty, points.shape[1])
        if empty.all():
            return i, "anywhere"
        if empty.any():
            at = points[:, np.argmin(np.where(empty, abs(points).max(axis=0), np.inf))].tolist()
            names = zip(f.box, at, strict=True)
            return i, "at " + ", ".join(f"{f.shown(name)} = {x:.6g}" for name, x in names if name in g.names)
    return None


def joined(found: Sequence[Members]) -> Members:
    """All pairs in one."""
    first, second = (np.concatenate(ends, axis=1) for ends in zip(*found, strict=True))
    return first, second


def halved(f: Restriction, claim: Claim, ends: Members, count: int) -> list[Members]:
    """Halves of the worst pairs, the worse one each time: they close in on a jump or a kink."""
    worst = np.argsort(rated(f, claim, *ends).violation)[: 4 * CHAINS]
    first, second = (points[:, worst] for points in ends)
    found = []
    for _ in range(count):
        middle = first / 2 + second / 2
        lower, upper = rated(f, claim, first, middle).violation, rated(f, claim, middle, second).violation
        first, second = np.where(lower <= upper, first, middle), np.where(lower <= upper, middle, second)
        found.append((first, second))
    return found


def rated(f: Restriction, claim: Claim, first: Array, second: Array) -> Pairs:
    """Pairs with what the claim says of them."""
    with np.errstate(all="ignore"):
        dq, df = first[: f.nq] - second[: f.nq], values(f, first) - values(f, second)
        violation = claim.violation(dq.T, df.T)
    unknown = np.isnan(violation) | (dq == 0).all(axis=0) | ~np.isfinite(df).all(axis=0)
    return Pairs(first, second, np.where(unknown, 1.0, violation))


def values(f: Restriction, points: Array) -> Array:
    """Values (nf, N) of f at points (k, N)."""
    names = tuple(f.box)
    return np.array([np.broadcast_to(g.function(names)(*points), points.shape[1]) for g in f.f])


def spread(box: Mapping[str, Range], rng: "np.random.Generator", count: int) -> Array:
    """Points (k, count) that cover the box in every variable evenly (a Latin hypercube)."""
    places = [(rng.permutation(count) + 0.5) / count for _ in box]
    return np.array([placed(u, limits) for u, limits in zip(places, box.values(), strict=True)])


def placed(u: Array, limits: Range) -> Array:
    """Numbers in a range from numbers in (0, 1); of an unbounded one, most are near 0 or near its end."""
    low, high = limits
    if np.isfinite(high - low):
        return low + (high - low) * u
    if np.isfinite(low):
        return low + abs(far(u / 2 + 0.5))
    if np.isfinite(high):
        return high - abs(far(u / 2 + 0.5))
    return far(u)


def far(u: Array) -> Array:
    """Numbers from numbers in (0, 1): three quarters in [-10, 10], the others up to 10^4."""
    centered = 2 * u - 1
    beyond = np.maximum(abs(centered) - 0.75, 0.0)
    return np.where(beyond > 0, np.sign(centered) * NEAR ** (1 + 12 * beyond), NEAR * centered / 0.75)


def scale(f: Restriction, points: Array) -> Array:
    """Typical size (k, N) of a step at each point."""
    limits = np.array([*f.box.values()])
    width = (limits[:, 1] - limits[:, 0])[:, None]
    return np.where(np.isfinite(width), width, 1 + abs(points))


def clipped(f: Restriction, points: Array) -> Array:
    """Points moved into the box."""
    limits = np.array([*f.box.values()])
    return np.clip(points, limits[:, :1], limits[:, 1:])


def apart(f: Restriction, points: Array, rng: "np.random.Generator") -> Members:
    """Pairs of any two points, the other variables taken from the first."""
    second = points.copy()
    second[: f.nq] = points[: f.nq, rng.permutation(points.shape[1])]
    return points, second


def astray(f: Restriction, points: Array, rng: "np.random.Generator") -> Members:
    """Pairs of points at all distances, in all directions and along the axes."""
    count = points.shape[1]
    direction = rng.standard_normal((f.nq, count))
    axis = np.arange(count) % (2 * f.nq)
    direction = np.where(axis < f.nq, np.eye(f.nq)[:, axis % f.nq], direction)
    second = points.copy()
    second[: f.nq] += rng.choice(STEPS[:4], count) * scale(f, points)[: f.nq] * direction / 4
    return points, clipped(f, second)


def steepest(f: Restriction, claim: Claim, points: Array, trials: int, rng: "np.random.Generator") -> list[Members]:
    """Close pairs around the points where the Jacobian violates the claim most, in its worst direction."""
    entries = moderate(f)
    if not entries:
        return []
    names, shape = tuple(f.box), (len(f.f), f.nq)
    functions = [g.function(names) for g in entries]

    def rate(some: Array) -> tuple[Array, Array]:
        count = some.shape[1]
        J = np.array([np.broadcast_to(g(*some), count) for g in functions]).T.reshape(count, *shape)
        known = np.asarray((abs(J) < 1e150).all(axis=(1, 2)))
        violation, direction = claim.worst_direction(np.where(known[:, None, None], J, 0.0))
        return np.where(known & ~np.isnan(violation), violation, 1.0), direction

    best = points[:, np.argsort(rate(points)[0])[:CHAINS]]
    for k in range(ROUNDS):
        tried = np.repeat(best, trials, axis=1)
        step = rng.standard_normal(tried.shape) * scale(f, tried) * 0.5**k / 10
        step[:, ::trials] = 0  # the point itself is kept
        tried = clipped(f, tried + step)
        winner = np.argmin(rate(tried)[0].reshape(-1, trials), axis=1)
        best = tried[:, winner + trials * np.arange(len(winner))]
    direction = rate(best)[1].T
    return [around(f, best, direction, h) for h in STEPS]


def around(f: Restriction, points: Array, direction: Array, h: float) -> Members:
    """Pairs around points, at the same distance on both sides where the box allows it."""
    step = np.zeros_like(points)
    step[: f.nq] = h * scale(f, points)[: f.nq].max(axis=0) * direction / 2
    return clipped(f, points + step), clipped(f, points - step)
