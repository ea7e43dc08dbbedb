"""Whether f surely is of a declared type on its region; what is not proved here may be so all the same.

An inequality on the Jacobian J that holds on a convex set of matrices holds for every pair of arguments, df = J dq with
J in the convex hull of the Jacobians between them (Clarke 1983, Prop. 2.6.5).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from math import inf

import numpy as np
from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression, Interval
from obsdesign.expressions.interval import point
from obsdesign.lmi.formula import Array, Inequality, rational_number
from obsdesign.lmi.proof import holds
from obsdesign.nonlinearities.evidence.enclosure import (
    WORK,
    Boxes,
    negative,
    require_continuous,
    supremum,
    supremum_of,
)
from obsdesign.nonlinearities.evidence.norm import enclosed, norm2, norm_bound, operations, radius_norm
from obsdesign.nonlinearities.evidence.restriction import Ends, Restriction

ONE = Expression.number(1)
MAX_SIZE = 16  # of q and f together, for a proof that nobody asked for
MAX_OPERATIONS = 400  # of f, likewise
MARGIN = 1e-12  # of an eigenvalue, relative to the magnitudes that it is made of, far above its rounding


def surely(f: Restriction, question: Callable[[], bool]) -> bool:
    """Answer about f; False where f is too large for a proof that nobody asked for, or may jump."""
    if sum(len(g.order) for g in f.f) > MAX_OPERATIONS or f.nq + len(f.f) > MAX_SIZE:
        return False
    try:
        require_continuous(f)
        return question()
    except UsageError:  # f may jump, or its derivative is too large
        return False


def lipschitz_proved(f: Restriction, k: fmpq) -> bool:
    """Whether |df| <= k |dq| surely holds; False says nothing."""
    return surely(f, lambda: lipschitz_within(f, k))


def lipschitz_within(f: Restriction, k: fmpq) -> bool:
    """Whether the norm of the Jacobian of a continuous f is at most k."""
    if f.decoupled:
        return all(slope_within(f, i, (-k, k)) for i in range(f.nq))
    if k > 0:  # f / k has round numbers where f has those of the declaration
        f, k = replace(f, f=tuple(Expression.combination([1 / k], [g]) for g in f.f)), fmpq(1)
    bound = norm_bound(f, float(k)).bound
    return bound < inf and rational_number(bound) <= k


def slope_within(f: Restriction, i: int, ends: Ends) -> bool:
    """Whether a component of a continuous f depends on its own q_i only, with slopes within exact limits."""
    own = f.arguments[i]
    return f.f[i].names.intersection(f.arguments) <= {own} and within(f, f.f[i].derivative(own), ends)


def within(f: Restriction, g: Expression, ends: Ends) -> bool:
    """Whether an expression has its values within exact limits on the region of f."""
    low, high = ends
    above = low is None or never_above(f, negative(g), -low)
    return above and (high is None or never_above(f, g, high))


def never_above(f: Restriction, g: Expression, limit: fmpq) -> bool:
    """Whether g <= limit on the region of f, proved without rounding where both are attained at its ends.

    So that 4/5 is the largest value of 1 - d on [1/5, 4/5], d is written as 1/5 + 3/5 s with s in [0, 1], numbers of
    the sum that g is go to the other side, and both sides are divided by what is there.
    """
    units = {name: unit(name, ends) for name, ends in f.region.items() if name in g.names and any(map(inexact, ends))}
    parts = g.substituted({name: x for name, (x, _) in units.items()}).summands()
    right = limit - sum((c for c, term in parts if term == ONE), fmpq(0))
    size = abs(right) or fmpq(1)
    left = [(c / size, term) for c, term in parts if term != ONE]
    scaled = Expression.combination([c for c, _ in left], [term for _, term in left])
    where = replace(f, region=dict(f.region) | {name: ends for name, (_, ends) in units.items()})
    target = float(right / size)  # -1, 0 or 1
    return supremum_of(scaled, where, 0.5, target).bound <= target


def inexact(end: fmpq | None) -> bool:
    """Whether a limit is no double."""
    return end is not None and bool((ends := point(end)).low != ends.high)


def unit(name: str, ends: Ends) -> tuple[Expression, Ends]:
    """Variable of a region as low + (high - low) s, low + s, or high - s, with the limits of s, which are doubles."""
    low, high = ends
    s = Expression.variable(name)
    if low is None:
        assert high is not None
        return Expression.combination([high, fmpq(-1)], [ONE, s]), (fmpq(0), None)
    length = fmpq(1) if high is None else high - low
    return Expression.combination([low, length], [ONE, s]), (fmpq(0), None if high is None else fmpq(1))


def form_holds(f: Restriction, M: Array) -> bool:
    """Whether [dq; df]' M [dq; df] >= 0 for a continuous f and an exact M.

    So it is where [I; J]' M [I; J] >= 0 for every Jacobian and M22 <= 0: this form is concave in J. Where f_i depends
    on q_i only, and M ties nothing of different components together, it is a bound of each slope.
    """
    nq = f.nq
    M11, M12, M22 = M[:nq, :nq], M[:nq, nq:], M[nq:, nq:]
    if not holds(Inequality("M22 <= 0", M22)):
        return False
    if f.decoupled and not any((part - np.diag(np.diag(part)) != 0).any() for part in (M11, M12, M22)):
        return all(slopes_of_form(f, i, *M[[i, i, nq + i], [i, nq + i, nq + i]]) for i in range(nq))
    a, b, c = (np.array(part, dtype=float) for part in (M11, M12, M22))
    names = [name for name in f.box if any(name in g.names for row in f.jacobian for g in row)]

    def deficit(boxes: Boxes) -> Interval:
        return negative_part(a, b, c, *enclosed(f.jacobian, boxes))

    work = WORK / operations(f.jacobian)
    return supremum(deficit, {name: f.box[name] for name in names}, work, target=0.0).bound <= 0


def slopes_of_form(f: Restriction, i: int, a: fmpq, b: fmpq, c: fmpq) -> bool:
    """Whether a + 2 b s + c s^2 >= 0, c <= 0, for every slope s of f_i, which bounds it."""
    if c == 0:
        ends = (None, None) if b == 0 else (-a / (2 * b), None) if b > 0 else (None, -a / (2 * b))
        return (b != 0 or a >= 0) and slope_within(f, i, ends)
    square = b * b - a * c
    if square < 0:
        return False
    root = root_below(square)
    return slope_within(f, i, ((root - b) / c, (-root - b) / c))


def root_below(square: fmpq) -> fmpq:
    """Square root of a rational number, or a rational number just below it."""
    exact = fmpq(square.p.isqrt(), square.q.isqrt())
    return exact if exact**2 == square else fmpq((square * 4**64).floor().isqrt(), 2**64)


def negative_part(M11: Array, M12: Array, M22: Array, center: Array, radius: Array) -> Interval:
    """Enclosure of - lambda_min([I; J]' M [I; J]) for matrices J (.., nf, nq) of a center and a radius.

    With J = C + E it is that of C to within 2 |M12' + M22 C| |E| + |M22| |E|^2.
    """
    bounded = np.asarray(np.isfinite(radius).all(axis=(-2, -1)))
    C, R = (np.where(bounded[..., None, None], part, 0.0) for part in (center, radius))
    cross, quadratic = M12 @ C, C.mT @ M22 @ C
    least = np.linalg.eigvalsh(M11 + cross + cross.mT + quadratic)[..., 0]
    size = radius_norm(R)
    spread = 2 * norm2(M12.T + M22 @ C) * size + norm2(M22) * size**2
    spread += MARGIN * (norm2(M11) + 2 * norm2(M12) * norm2(C) + norm2(M22) * norm2(C) ** 2)
    return Interval(np.where(bounded, -least - spread, -inf), np.where(bounded, -least + spread, inf))


def in_hull(f: Restriction, vertices: Array, *, conic: bool) -> bool:
    """Whether every Jacobian of a continuous f is in the hull (conic: the cone) of exact matrices (count, nf, nq).

    It is decided where the hull is a box in the different entries of the Jacobian, or the cone a range of one number.
    """
    if conic:
        if vertices[0].size > 1:
            return False
        signs = [x > 0 for x in vertices.ravel() if x != 0]
        return slope_within(f, 0, (None if False in signs else fmpq(0), None if True in signs else fmpq(0)))
    places: dict[Expression, list[tuple[int, int]]] = {}
    for place in np.ndindex(vertices[0].shape):
        places.setdefault(f.jacobian[place[0]][place[1]], []).append(place)
    columns = [[[V[place] for place in same] for V in vertices] for same in places.values()]
    if any(len(set(values)) > 1 for column in columns for values in column):
        return False
    ranges = [(min(values), max(values)) for values in ([v[0] for v in column] for column in columns)]
    listed = {tuple(column[k][0] for column in columns) for k in range(len(vertices))}
    if 2 ** sum(low != high for low, high in ranges) > len(listed):
        return False
    corners: Sequence[tuple[fmpq, ...]] = [*product(*(dict.fromkeys(ends) for ends in ranges))]
    return listed.issuperset(corners) and all(within(f, g, ends) for g, ends in zip(places, ranges, strict=True))
