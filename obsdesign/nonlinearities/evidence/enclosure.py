"""Rigorous bounds of the Jacobian of a nonlinearity over a box, by branch and bound.

For a continuous, piecewise smooth f, df = J dq with J in the closed convex hull of the Jacobians that f has where it
is differentiable (Clarke 1983, Prop. 2.6.5): bounds of these bound every difference quotient. Boxes are bisected
where the bound is attained least (Moore, Kearfott and Cloud 2009, ch. 5), all in one batch, and the work is limited:
what is left of it makes a bound loose, never wrong.
"""

from collections.abc import Callable, Mapping, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from functools import lru_cache
from itertools import product
from math import inf

import numpy as np
from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression, Interval
from obsdesign.lmi.formula import Array, rational_number
from obsdesign.nonlinearities.evidence.continuity import continuous
from obsdesign.nonlinearities.evidence.restriction import Range, Restriction
from obsdesign.records import dataclass

Boxes = Mapping[str, Interval]
DIGITS = 12  # of a bound, rounded outward
TOLERANCE = 1e-5  # relative, at which a bound is tight enough
WORK = 600_000  # boxes times operations: about 0.1 s
BATCH = 256  # most boxes looked at in one go: a few take as long as that
HUGE = 1e300
MIN_BOXES = 1000  # for which the mean value form pays
CORNERS = 6  # most variables of which all corners of a box are looked at
STEPS = 0.3 ** np.arange(14)  # around the best point, in relation to the whole box
ROUNDS = 3  # of such steps at a time


@dataclass(frozen=True)
class Supremum:
    """The supremum of a function over a box is in [attained, bound]."""

    bound: float
    attained: float
    scale: float  # largest magnitude that was seen
    place: Mapping[str, Range]  # a box with the bound
    point: Mapping[str, float]  # where it is at least `attained`
    boxes: int  # that were looked at

    @property
    def gap(self) -> float:
        """Looseness of a finite bound, relative to the scale."""
        return (self.bound - self.attained) / max(self.scale, abs(self.bound)) if self.bound else 0.0


def supremum(
    value: Callable[[Boxes], Interval],
    box: Mapping[str, Range],
    work: float,
    target: float | None = None,
    at: Callable[[Boxes], Interval] | None = None,
    tolerance: float = TOLERANCE,
) -> Supremum:
    """Supremum of a function over a box.

    `value` encloses the function over boxes, one an entry (empty entries have no value), `at` at points, if that takes
    less time; `box` may be unbounded; `work`: most boxes to look at. The search ends once the supremum is known to be
    at most the `target`, or more, or the bound is as tight as the `tolerance`, relative to the largest magnitude.
    """
    batch = int(np.clip(work / 16, 16, BATCH))
    boxes = np.array([*box.values()], dtype=float).reshape(len(box), 1, 2)
    names, measure = tuple(box), np.maximum(extent(boxes), 1e-300)
    over = enclosed(value, names)
    bounds, best = over(boxes).high, Attained(enclosed(at or value, names), boxes)
    seen = 1
    while names and work > 0:
        with np.errstate(over="ignore"):
            loose = np.flatnonzero(bounds > best.value + tolerance * best.scale)
        if not len(loose) or (target is not None and not best.value <= target < bounds.max()):
            break
        split = loose[np.argsort(-bounds[loose], kind="stable")][: batch // 2]
        parts, before = boxes[:, split], bounds[split]
        while len(before) <= batch // 2:
            parts, before = bisected(parts, measure), np.tile(before, 2)
        boxes = np.concatenate([np.delete(boxes, split, axis=1), parts], axis=1)
        bounds = np.concatenate([np.delete(bounds, split), np.minimum(over(parts).high, before)])
        best.improve(parts)
        work -= 4 * batch
        seen += len(before)
    worst = boxes[:, np.argmax(bounds)]
    place = {name: (float(low), float(high)) for name, (low, high) in zip(names, worst, strict=True)}
    point = dict(zip(names, best.point.tolist(), strict=True))
    return Supremum(float(bounds.max()), best.value, best.scale, place, point, seen)


def enclosed(value: Callable[[Boxes], Interval], names: Sequence[str]) -> Callable[[Array], Interval]:
    """Function of boxes (k, N, 2)."""

    def over(boxes: Array) -> Interval:
        found = value({name: Interval(*ends.T) for name, ends in zip(names, boxes, strict=True)})
        return Interval(*(np.broadcast_to(end, boxes.shape[1]) for end in (found.low, found.high)))

    return over


class Attained:
    """Largest value of a function that was seen in a box, and the point."""

    def __init__(self, over: Callable[[Array], Interval], root: Array) -> None:
        self.over, self.root = over, root
        self.value, self.scale, self.point = -inf, 0.0, middle(root)[:, 0]
        self.improve(root)

    def improve(self, boxes: Array) -> None:
        """Look at corners and in the middle of boxes (k, N, 2), then around the best point."""
        count = min(len(boxes), CORNERS if boxes.shape[1] == 1 else 1)  # all corners of a single box
        sides = product((False, True), repeat=count)
        corners = [np.where(np.resize(side, (len(boxes), 1)), boxes[..., 1], boxes[..., 0]) for side in sides]
        better = self.look(np.concatenate([*corners, middle(boxes)], axis=1))
        rounds = ROUNDS if better and len(boxes) and self.value < HUGE else 0
        while rounds and self.look(self.around()):
            rounds -= 1

    def look(self, points: Array) -> bool:
        """Compare points (k, N) with the best one; whether one of them is better."""
        found = self.over(np.stack([points, points], axis=2))
        limits = np.isinf(points).any(axis=0) & (found.low < HUGE)  # a finite limit is not attained
        values = np.where(found.empty | limits, -inf, found.low)
        self.scale = max(self.scale, float(abs(values[np.isfinite(values)]).max(initial=0.0)))
        k = int(np.argmax(values)) if values.size else 0
        better = bool(values.size) and bool(values[k] > self.value)
        if better:
            self.value, self.point = float(values[k]), points[:, k]
        return better

    def around(self) -> Array:
        """Points (k, N) at many distances from the best one along the axes."""
        low, high = self.root[:, 0].T
        with np.errstate(over="ignore"):
            size = np.where(np.isfinite(high - low), high - low, 1 + abs(self.point))
            axes = np.hstack([np.diag(size), -np.diag(size)])
            steps = (axes[..., None] * STEPS).reshape(len(size), -1)
            return np.asarray(np.clip(self.point[:, None] + steps, low[:, None], high[:, None]))


def compressed(x: Array) -> Array:
    """All reals to [-1, 1], so that an unbounded box has a size."""
    return np.where(np.isinf(x), np.sign(x), x / (1 + abs(np.where(np.isinf(x), 0.0, x))))


def extent(boxes: Array) -> Array:
    """Size of each box in each direction."""
    return compressed(boxes[..., 1]) - compressed(boxes[..., 0])


def middle(boxes: Array) -> Array:
    """Where a box is cut: in the middle, or, if it is unbounded, at 0 or where its end is doubled."""
    low, high = boxes[..., 0], boxes[..., 1]
    finite_low, finite_high = np.where(np.isinf(low), 0.0, low), np.where(np.isinf(high), 0.0, high)
    with np.errstate(over="ignore"):
        above = np.where(finite_low < 0, 0.0, np.maximum(1.0, 2 * finite_low))
        below = np.where(finite_high > 0, 0.0, np.minimum(-1.0, 2 * finite_high))
    between = finite_low / 2 + finite_high / 2
    inner = np.where(np.isinf(high), np.where(np.isinf(low), 0.0, above), np.where(np.isinf(low), below, between))
    return np.clip(inner, low, high)


def bisected(boxes: Array, measure: Array) -> Array:
    """Halves of boxes, each cut where it is largest in relation to the whole box."""
    widest = np.argmax(extent(boxes) / measure, axis=0)
    index = np.arange(boxes.shape[1])
    lower, upper = boxes.copy(), boxes.copy()
    lower[widest, index, 1] = upper[widest, index, 0] = middle(boxes)[widest, index]
    return np.concatenate([lower, upper], axis=1)


@dataclass(frozen=True)
class Enclosure:
    """Every difference quotient of f is a matrix with entries in [low, high]."""

    low: Array  # (nf, nq); -inf where none was found
    high: Array  # (nf, nq)
    gap: float  # largest relative looseness of a finite bound


def enclosure(f: Restriction) -> Enclosure:
    """Bounds of every entry of the Jacobian.

    Raises `UsageError`: f may jump or be undefined in the box.
    """
    require_continuous(f)
    entries = list(dict.fromkeys(entry for row in f.jacobian for entry in row))
    share = 1 / (2 * len(entries))
    found = {entry: (supremum_of(negative(entry), f, share), supremum_of(entry, f, share)) for entry in entries}
    low = np.array([[-found[entry][0].bound for entry in row] for row in f.jacobian])
    high = np.array([[found[entry][1].bound for entry in row] for row in f.jacobian])
    gaps = [s.gap for pair in found.values() for s in pair if np.isfinite(s.bound)]
    return Enclosure(low + 0.0, high + 0.0, max(gaps, default=0.0))


def supremum_of(g: Expression, f: Restriction, share: float = 1.0, target: float | None = None) -> Supremum:
    """Supremum of an expression over the box of f, for a share of the work."""
    return looked_for(g, tuple((name, limits) for name, limits in f.box.items() if name in g.names), share, target)


@lru_cache(maxsize=1000)  # a design, its proof and its run read the same plant
def looked_for(g: Expression, limits: tuple[tuple[str, Range], ...], share: float, target: float | None) -> Supremum:
    """The same over a box of limits by names."""
    box, work = dict(limits), share * WORK
    if work >= MIN_BOXES * len(g.order):
        form = MeanValueForm(g, {name: g.derivative(name) for name in box})
        if work >= MIN_BOXES * form.operations:
            return supremum(form.enclose, box, work / form.operations, target, g.enclose)
    return supremum(g.enclose, box, work / len(g.order), target)


@dataclass(frozen=True)
class MeanValueForm:
    """An expression g and its slopes: g(x) is in g(m) + g'(X) (x - m) for x and m in X, where g is continuous.

    The form is tight to second order in the size of X, interval arithmetic alone to first order.
    """

    g: Expression
    slopes: Mapping[str, Expression]

    @property
    def operations(self) -> int:
        """Cost of an enclosure."""
        return 3 * len(self.g.order) + sum(len(slope.order) for slope in self.slopes.values())

    def enclose(self, boxes: Boxes) -> Interval:
        """Enclosure of g over boxes."""
        plain = self.g.enclose(boxes)
        ends = {name: np.stack([boxes[name].low, boxes[name].high], axis=-1) for name in self.slopes}
        middles = {name: Interval(*[middle(ends[name])] * 2) for name in self.slopes}
        with np.errstate(all="ignore"):
            mean = self.g.enclose(middles)
            for name, slope in self.slopes.items():
                mean = mean + slope.enclose(boxes) * (boxes[name] + -middles[name])
        sound = continuous(self.g, boxes, self.slopes)
        low, high = np.where(sound, mean.low, -inf), np.where(sound, mean.high, inf)
        return Interval(np.maximum(plain.low, low), np.minimum(plain.high, high))


def negative(g: Expression) -> Expression:
    """Return -g."""
    return Expression(-g.root)


@dataclass(frozen=True)
class Doubt:
    """A component of f that may jump or be undefined, and a box in which it may."""

    name: str
    place: Mapping[str, Range]


def require_continuous(f: Restriction) -> None:
    """Refuse an f whose derivative may not tell of all its changes.

    Raises `UsageError`: f may jump or be undefined in the box, and where.
    """
    found = doubt(f)
    if found is not None:
        raise UsageError(
            f"{found.name} may jump or be undefined at {shown(f, found.place)}; write it with abs, sat, min or max "
            "(q*abs(q), not sign(q)*q**2), or give a region without that",
            id="OBS403",
        )


def doubt(f: Restriction) -> Doubt | None:
    """First component of f that is not surely continuous in q in the whole box."""
    for i, component in enumerate(f.f, start=1):

        def doubtful(boxes: Boxes, g: Expression = component) -> Interval:
            return Interval(np.array(0.0), np.where(continuous(g, boxes, f.arguments), 0.0, 1.0))

        box = {name: f.box[name] for name in f.box if name in component.names}
        found = supremum(doubtful, box, WORK / 4 / len(component.order) / len(f.f), target=0.0)
        if found.bound > 0:
            return Doubt("f" if len(f.f) == 1 else f"f{i}", found.place)
    return None


def outward(value: float, *, up: bool) -> fmpq:
    """Shortest decimal of at most DIGITS digits that is not below (up) or not above the value."""
    context = Context(prec=DIGITS, rounding=ROUND_CEILING if up else ROUND_FLOOR)
    return rational_number(str(context.create_decimal(Decimal(float(value)))))


def shown(f: Restriction, place: Mapping[str, Range]) -> str:
    """Box as a message has it."""
    limits = [f"{f.shown(name)} in [{low:.4g}, {high:.4g}]" for name, (low, high) in place.items()]
    return ", ".join(limits) or "any argument"
