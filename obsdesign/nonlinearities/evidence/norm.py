"""Certified bounds of the 2-norm of a Jacobian: on a convex region its supremum is the Lipschitz constant of f.

Over a box of center m and half widths h, a matrix J enclosed in [C - R, C + R] has

    |J| <= |C| + |R|,    |J| <= | |J| |,    |R| <= min(|R|_F, sqrt(|R|_1 |R|_inf)),

tight to first order in h. With its slopes dJ/dx_k enclosed in [D_k - S_k, D_k + S_k],

    J(x) = J(m) + sum_k s_k D_k + E,    |s_k| <= h_k,    |E| <= sum_k h_k S_k,
    |J| <= max over the corners s of |J(m) + sum_k s_k D_k| + |E|,

since a norm is convex: tight to second order, so that a maximum inside the region takes no more boxes than one at a
corner.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from math import inf
from operator import mul

import numpy as np

from obsdesign.expressions import Expression, ExpressionError, Interval
from obsdesign.lmi.formula import Array
from obsdesign.nonlinearities.evidence.continuity import continuous
from obsdesign.nonlinearities.evidence.enclosure import (
    CORNERS,
    WORK,
    Boxes,
    Supremum,
    middle,
    require_continuous,
    supremum,
)
from obsdesign.nonlinearities.evidence.restriction import Range, Restriction
from obsdesign.records import dataclass, replace

Matrix = Sequence[Sequence[Expression]]
TIGHT = 1e-6  # relative
MARGIN = 1 + 1e-10  # of a computed norm, far above the rounding of its singular value decomposition
ROUNDING = 1e-14  # of a sum, in relation to its magnitudes
ZERO = Expression.number(0)
EFFORT = 4 * WORK  # of a design that needs the constant
PATIENCE = 40 * WORK  # of a user who asks for the constant
MAX_SLOPES = 2000  # operations in slopes that are worth the time


def norm_bound(f: Restriction, target: float | None = None) -> Supremum:
    """Lipschitz constant of f: the supremum of the 2-norm of its Jacobian.

    Raises `UsageError`: f may jump or be undefined in the box.
    """
    require_continuous(f)
    return largest_norm(f.jacobian, f.box, target)


def largest_norm(J: Matrix, box: Mapping[str, Range], target: float | None = None, work: float = EFFORT) -> Supremum:
    """Supremum of the 2-norm of a matrix of expressions over a box.

    `target`: the search ends once the supremum is known to be at most this, or more; `work`: boxes times operations, at
    most.

    The bounds are tight to 1e-6, relative, unless the work ends before that.
    """
    found = []
    for part in uncoupled(J):
        names = [name for name in box if any(name in g.names for row in part for g in row)]
        norm = Norm.of(part, names)
        own = {name: box[name] for name in names}
        found.append(supremum(norm.enclose, own, work / norm.operations, target, norm.at, TIGHT))
    worst = max(found, key=lambda part: part.bound)
    best = max(found, key=lambda part: part.attained)
    anywhere = {name: float(middle(np.array([[limits]]))[0, 0]) for name, limits in box.items()}
    return replace(
        worst,
        attained=best.attained,
        scale=max(best.scale, worst.scale),
        point=anywhere | dict(best.point),
        boxes=sum(part.boxes for part in found),
    )


def uncoupled(J: Matrix) -> list[Matrix]:
    """Blocks of a matrix that share neither a row nor a column, without its zeros: |J| is the largest of theirs."""
    parts: list[tuple[set[int], set[int]]] = []
    for i, j in ((i, j) for i, row in enumerate(J) for j, g in enumerate(row) if g != ZERO):
        touched = [part for part in parts if i in part[0] or j in part[1]]
        parts = [part for part in parts if part not in touched]
        parts.append(({i}.union(*(rows for rows, _ in touched)), {j}.union(*(columns for _, columns in touched))))
    return [[[J[i][j] for j in sorted(columns)] for i in sorted(rows)] for rows, columns in parts] or [[[ZERO]]]


@dataclass(frozen=True)
class Norm:
    """The 2-norm of a matrix of expressions, with the slopes of its entries where these are worth the time."""

    J: Matrix
    slopes: Mapping[str, Matrix]

    @classmethod
    def of(cls, J: Matrix, names: Sequence[str]) -> "Norm":
        """Norm of a matrix in the given variables."""
        if len(names) > CORNERS:
            return cls(J, {})
        try:
            slopes = {name: [[g.derivative(name) for g in row] for row in J] for name in names}
        except ExpressionError:
            return cls(J, {})
        return cls(J, slopes if sum(map(operations, slopes.values())) <= MAX_SLOPES else {})

    @property
    def operations(self) -> int:
        """Cost of an enclosure."""
        return (3 if self.slopes else 1) * operations(self.J) + sum(map(operations, self.slopes.values()))

    def at(self, boxes: Boxes) -> Interval:
        """Norm over boxes, from the entries alone."""
        if len(self.J) == len(self.J[0]) == 1:
            return abs(self.J[0][0].enclose(boxes))
        center, radius = enclosed(self.J, boxes)
        bounded = np.asarray(np.isfinite(radius).all(axis=(-2, -1)))
        center, radius = (np.where(bounded[..., None, None], part, 0.0) for part in (center, radius))
        with np.errstate(over="ignore"):
            norm, rest = norm2(center), radius_norm(radius)
            upper = np.minimum(norm + rest, norm2(abs(center) + radius)) * MARGIN
            lower = np.maximum(norm / MARGIN - rest, 0.0)
        return Interval(np.where(bounded, lower, 0.0), np.where(bounded, upper, inf))

    def enclose(self, boxes: Boxes) -> Interval:
        """Norm over boxes, from the slopes too."""
        found = self.at(boxes)
        return Interval(found.low, np.minimum(found.high, self.linearized(boxes))) if self.slopes else found

    def linearized(self, boxes: Boxes) -> Array:
        """Bound of the norm from J(m) and the slopes; infinite where J is not surely continuous."""
        m = {name: middle(np.stack([x.low, x.high], axis=-1)) for name, x in boxes.items()}
        center, radius = enclosed(self.J, {name: Interval(x, x) for name, x in m.items()})
        with np.errstate(all="ignore"):
            half = {name: np.maximum(x.high - m[name], m[name] - x.low)[..., None, None] for name, x in boxes.items()}
            moves = []
            for name, slope in self.slopes.items():
                D, S = enclosed(slope, boxes)
                moves.append(half[name] * D)
                radius = radius + half[name] * S
            radius = radius + ROUNDING * sum(map(abs, moves), abs(center))
            bounded = np.isfinite(radius).all(axis=(-2, -1)) & self.sound(boxes)
            center, radius, *moves = (np.where(bounded[..., None, None], x, 0.0) for x in (center, radius, *moves))
            corners = [sum(map(mul, signs, moves), center) for signs in product((-1, 1), repeat=len(moves))]
            upper = (np.max([norm2(corner) for corner in corners], axis=0) + radius_norm(radius)) * MARGIN
        return np.where(bounded, upper, inf)

    def sound(self, boxes: Boxes) -> Array:
        """Where every entry surely is continuous."""
        return np.asarray(
            np.all(np.broadcast_arrays(*(continuous(g, boxes, self.slopes) for g in entries(self.J))), axis=0)
        )


def entries(J: Matrix) -> set[Expression]:
    """Different entries."""
    return {g for row in J for g in row}


def operations(J: Matrix) -> int:
    """Cost of an enclosure of a matrix."""
    return sum(len(g.order) for g in entries(J))


def enclosed(J: Matrix, boxes: Boxes) -> tuple[Array, Array]:
    """Center and radius of interval matrices (.., nf, nq); the radius of an entry without a bound is infinite."""
    values = {g: g.enclose(boxes) for g in entries(J)}
    low, high = (stacked([[getattr(values[g], end) for g in row] for row in J]) for end in ("low", "high"))
    bounded = np.isfinite(low) & np.isfinite(high)
    low, high = (np.where(bounded, end, 0.0) for end in (low, high))
    center = low / 2 + high / 2
    return center, np.where(bounded, np.maximum(high - center, center - low), inf)


def stacked(rows: Sequence[Sequence[Array]]) -> Array:
    """Matrices (.., nf, nq) from entries that broadcast."""
    flat = np.broadcast_arrays(*(entry for row in rows for entry in row))
    return np.moveaxis(np.reshape(flat, (len(rows), len(rows[0]), *flat[0].shape)), (0, 1), (-2, -1))


def norm2(M: Array) -> Array:
    """2-norm of matrices (.., nf, nq)."""
    return np.asarray(np.linalg.norm(M, 2, axis=(-2, -1)))


def radius_norm(R: Array) -> Array:
    """Bound of the 2-norm of nonnegative matrices."""
    mixed = np.sqrt(np.linalg.norm(R, 1, axis=(-2, -1)) * np.linalg.norm(R, inf, axis=(-2, -1)))
    return np.asarray(np.minimum(np.linalg.norm(R, axis=(-2, -1)), mixed) * MARGIN)
