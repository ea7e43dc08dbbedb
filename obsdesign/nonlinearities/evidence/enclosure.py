"""Rigorous bounds of the Jacobian of a nonlinearity over a box, by branch and bound.

For a continuous, piecewise smooth f, df = J dq with J in the closed convex hull of the Jacobians that f has where it
is differentiable (Clarke 1983, Prop. 2.6.5): bounds of these bound every difference quotient. Boxes are bisected
where the bound is attained least (Moore, Kearfott and Cloud 2009, ch. 5), all in one batch, and the work is limited:
what is left of it makes a bound loose, never wrong.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression, Interval
from obsdesign.lmi.formula import Array
from obsdesign.nonlinearities.evidence.continuity import continuous
from obsdesign.nonlinearities.evidence.restriction import Range, Restriction

Boxes = Mapping[str, Interval]
TOLERANCE = 1e-5  # relative, at which a bound is tight enough
WORK = 600_000  # boxes times operations: about 0.1 s
BATCH = 256  # most boxes looked at in one go: a few take as long as that
MIN_BOXES = 1000  # for which the mean value form pays
SVD_MARGIN = 1 + 1e-10  # of a computed norm, far above the rounding of its singular value decomposition


@dataclass(frozen=True)
class Supremum:
    """The supremum of a function over a box is in [attained, bound]."""

    bound: float
    attained: float
    scale: float  # largest magnitude that was seen
    place: Mapping[str, Range]  # a box with the bound

    @property
    def gap(self) -> float:
        """Looseness of a finite bound, relative to the scale."""
        return (self.bound - self.attained) / max(self.scale, abs(self.bound)) if self.bound else 0.0


def supremum(
    value: Callable[[Boxes], Interval], box: Mapping[str, Range], work: float, target: float | None = None
) -> Supremum:
    """Supremum of a function over a box.

    Parameters
    ----------
    value
        Encloses the function over boxes, one an entry; empty entries have no value.
    box
        May be unbounded.
    work
        Most boxes to look at.
    target
        The search ends once the supremum is known to be at most this, or more.
    """
    batch = int(np.clip(work / 16, 16, BATCH))
    boxes = np.array([*box.values()], dtype=float).reshape(len(box), 1, 2)
    names, measure = tuple(box), np.maximum(extent(boxes), 1e-300)

    def over(some: Array) -> Interval:
        found = value({name: Interval(*ends.T) for name, ends in zip(names, some, strict=True)})
        return Interval(*(np.broadcast_to(end, some.shape[1]) for end in (found.low, found.high)))

    bounds, (attained, scale) = over(boxes).high, sampled(over, boxes)
    while names and work > 0:
        with np.errstate(over="ignore"):
            loose = np.flatnonzero(bounds > attained + TOLERANCE * scale)
        if not len(loose) or (target is not None and not attained <= target < bounds.max()):
            break
        split = loose[np.argsort(-bounds[loose], kind="stable")][: batch // 2]
        parts, before = boxes[:, split], bounds[split]
        while len(before) <= batch // 2:
            parts, before = bisected(parts, measure), np.tile(before, 2)
        boxes = np.concatenate([np.delete(boxes, split, axis=1), parts], axis=1)
        bounds = np.concatenate([np.delete(bounds, split), np.minimum(over(parts).high, before)])
        attained, scale = np.maximum((attained, scale), sampled(over, parts))
        work -= 4 * batch
    worst = boxes[:, np.argmax(bounds)]
    place = {name: (float(low), float(high)) for name, (low, high) in zip(names, worst, strict=True)}
    return Supremum(float(bounds.max()), float(attained), float(scale), place)


def sampled(over: Callable[[Array], Interval], boxes: Array) -> tuple[float, float]:
    """Largest value, and largest finite magnitude, at two corners and in the middle of each box."""
    points = np.concatenate([boxes[..., 0], middle(boxes), boxes[..., 1]], axis=1)
    found = over(np.stack([points, points], axis=2))
    values = np.where(found.empty, -inf, found.low)
    return float(values.max()), float(abs(values[np.isfinite(values)]).max(initial=0.0))


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

    Raises
    ------
    UsageError
        f may jump or be undefined in the box.
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
    box = {name: f.box[name] for name in f.box if name in g.names}
    work = share * WORK
    if work >= MIN_BOXES * len(g.order):
        form = MeanValueForm.of(g, tuple(box))
        if work >= MIN_BOXES * form.operations:
            return supremum(form.enclose, box, work / form.operations, target)
    return supremum(g.enclose, box, work / len(g.order), target)


@dataclass(frozen=True)
class MeanValueForm:
    """An expression g and its slopes: g(x) is in g(m) + g'(X) (x - m) for x and m in X, where g is continuous.

    The form is tight to second order in the size of X, interval arithmetic alone to first order.
    """

    g: Expression
    slopes: Mapping[str, Expression]

    @classmethod
    def of(cls, g: Expression, names: Sequence[str]) -> "MeanValueForm":
        """Form of an expression in the given variables."""
        return cls(g, {name: g.derivative(name) for name in names})

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


def require_continuous(f: Restriction) -> None:
    """Refuse an f whose derivative may not tell of all its changes.

    Raises
    ------
    UsageError
        f may jump or be undefined in the box, and where.
    """
    for i, component in enumerate(f.f, start=1):

        def doubtful(boxes: Boxes, g: Expression = component) -> Interval:
            return Interval(np.array(0.0), np.where(continuous(g, boxes, f.arguments), 0.0, 1.0))

        box = {name: f.box[name] for name in f.box if name in component.names}
        found = supremum(doubtful, box, WORK / 4 / len(component.order) / len(f.f), target=0.0)
        if found.bound > 0:
            name = "f" if len(f.f) == 1 else f"f{i}"
            raise UsageError(
                f"{name} may jump or be undefined at {shown(f, found.place)}; write it with abs, sat, min or max "
                "(q*abs(q), not sign(q)*q**2), or give a region without that"
            )


def shown(f: Restriction, place: Mapping[str, Range]) -> str:
    """Box as a message has it."""
    limits = [f"{f.shown(name)} in [{low:.4g}, {high:.4g}]" for name, (low, high) in place.items()]
    return ", ".join(limits) or "any argument"


def norm_bound(f: Restriction, target: float | None = None) -> Supremum:
    """Supremum of the spectral norm of the Jacobian: the Lipschitz constant of f.

    Raises
    ------
    UsageError
        f may jump or be undefined in the box.
    """
    require_continuous(f)
    operations = sum(len(g.order) for row in f.jacobian for g in row)

    def norm(boxes: Boxes) -> Interval:
        return spectral_norm([[g.enclose(boxes) for g in row] for row in f.jacobian])

    return supremum(norm, f.box, WORK / operations, target)


def spectral_norm(entries: Sequence[Sequence[Interval]]) -> Interval:
    """Norm of interval matrices.

    It is that of the centers, but for the norm of the radii (Frobenius), and at most that of the magnitudes.
    """
    low, high = (stacked([[getattr(g, end) for g in row] for row in entries]) for end in ("low", "high"))
    bounded = np.asarray((np.isfinite(low) & np.isfinite(high)).all(axis=(-2, -1)))
    low, high = (np.where(bounded[..., None, None], end, 0.0) for end in (low, high))
    center = low / 2 + high / 2
    with np.errstate(over="ignore"):
        radius = np.linalg.norm(np.maximum(high - center, center - low), axis=(-2, -1))
        norm = np.linalg.norm(center, 2, axis=(-2, -1))
        upper = np.minimum(norm + radius, np.linalg.norm(np.maximum(-low, high), 2, axis=(-2, -1)))
    return Interval(
        np.where(bounded, np.maximum(norm / SVD_MARGIN - radius * SVD_MARGIN, 0.0), 0.0),
        np.where(bounded, upper * SVD_MARGIN, inf),
    )


def stacked(rows: Sequence[Sequence[Array]]) -> Array:
    """Matrices (.., nf, nq) from entries that broadcast."""
    flat = np.broadcast_arrays(*(entry for row in rows for entry in row))
    return np.moveaxis(np.reshape(flat, (len(rows), len(rows[0]), *flat[0].shape)), (0, 1), (-2, -1))
