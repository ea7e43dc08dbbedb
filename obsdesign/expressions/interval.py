"""Interval arithmetic with outward rounding, over arrays of boxes.

Arithmetic rounds outward by one unit in the last place, and only where the rounding error, known from an
error-free transformation (Dekker 1971; Ogita, Rump and Oishi 2005), says so: 1 - 1 is exactly 0. Other
functions are widened by four units, the accuracy numpy documents, except where their value is exact.
"""

from collections.abc import Callable
from math import inf, nan, pi

import numpy as np
import numpy.typing as npt
from flint import fmpq

from obsdesign.expressions.exact import double
from obsdesign.records import dataclass

Array = npt.NDArray[np.float64]
ULPS = 4
PI_ABOVE = float(np.nextafter(pi, inf))
SPLITTER = 134217729.0  # 2^27 + 1


@dataclass(frozen=True)
class Interval:
    """Real intervals [low, high], one an entry; empty where low > high. Never NaN: unknown is unbounded."""

    low: Array
    high: Array

    def __post_init__(self) -> None:
        low, high = np.asarray(self.low, float), np.asarray(self.high, float)
        object.__setattr__(self, "low", np.where(np.isnan(low), -inf, low))
        object.__setattr__(self, "high", np.where(np.isnan(high), inf, high))

    @property
    def empty(self) -> npt.NDArray[np.bool_]:
        """Where there is no value: an argument outside the domain of a function."""
        return self.low > self.high

    def emptied(self, where: npt.NDArray[np.bool_]) -> "Interval":
        """Return the same intervals, empty in the given places."""
        return Interval(np.where(where, inf, self.low), np.where(where, -inf, self.high))

    def meet(self, low: float, high: float) -> "Interval":
        """Intersection with [low, high]."""
        return Interval(np.maximum(self.low, low), np.minimum(self.high, high))

    def hull(self, other: "Interval") -> "Interval":
        """Smallest interval that holds both."""
        return Interval(np.minimum(self.low, other.low), np.maximum(self.high, other.high))

    def __add__(self, other: "Interval") -> "Interval":
        low, high, left, right = np.broadcast_arrays(self.low, self.high, other.low, other.high)
        x, y = ends(low, high), ends(left, right)
        s = x + y
        part = s - x
        return rounded(s, (x - (s - part)) + (y - part))

    def __mul__(self, other: "Interval") -> "Interval":
        x, y = corners(self, other)
        p = x * y
        p = np.where(np.isnan(p), 0.0, p)  # 0 * inf: an infinite end is never attained
        return rounded(p, product_error(x, y, p))

    def __truediv__(self, other: "Interval") -> "Interval":
        x, y = corners(self, other)
        q = x / y
        q = np.where(np.isnan(q), 0.0, q)  # inf / inf: the limit 0 is there already
        p = q * y
        residual = (x - p) - product_error(q, y, p)
        error = np.where(q == 0, np.sign(x), residual) * np.sign(y)
        pole = (other.low <= 0) & (other.high >= 0)
        quotient = rounded(q, error)
        whole = Interval(np.where(pole, -inf, quotient.low), np.where(pole, inf, quotient.high))
        return self.over_end(other, whole) if np.any(pole) else whole

    def over_end(self, other: "Interval", whole: "Interval") -> "Interval":
        """Quotient where the divisor has zero at one end only: then what has one sign stays on one side of a bound."""
        far = np.where(other.low == 0, other.high, other.low)
        ended = ((other.low == 0) | (other.high == 0)) & (far != 0) & ~self.empty & ~other.empty
        upward, downward = (self.low >= 0) & ended, (self.high <= 0) & ended
        least = np.where(upward, self.low, self.high) / far
        above, below = np.where(far > 0, upward, downward), np.where(far > 0, downward, upward)
        low = np.where(above, np.maximum(np.nextafter(least, -inf), 0.0), whole.low)
        return Interval(low, np.where(below, np.minimum(np.nextafter(least, inf), 0.0), whole.high))

    def __neg__(self) -> "Interval":
        return Interval(-self.high, -self.low)

    def __abs__(self) -> "Interval":
        nearest = np.maximum(0.0, np.maximum(self.low, -self.high))
        return Interval(nearest, np.maximum(-self.low, self.high))


def point(value: fmpq) -> Interval:
    """Tightest interval around a number: its double if it is one, else two neighbors."""
    nearest = double(value)
    if abs(nearest) == inf:
        side = 1 if nearest > 0 else -1
    else:
        error = value - fmpq(*nearest.as_integer_ratio())
        side = int(error > 0) - int(error < 0)
    low, high = (nearest, np.nextafter(nearest, side * inf)) if side else (nearest, nearest)
    return Interval(np.array(min(low, high)), np.array(max(low, high)))


def ends(low: Array, high: Array) -> Array:
    """Both ends along a new first axis."""
    return np.stack(np.broadcast_arrays(low, high))


def corners(a: Interval, b: Interval) -> tuple[Array, Array]:
    """Every end of a with every end of b, along a new first axis."""
    low, high, left, right = np.broadcast_arrays(a.low, a.high, b.low, b.high)
    return np.stack([low, low, high, high]), np.stack([left, right, left, right])


def rounded(values: Array, errors: Array) -> Interval:
    """Hull, along the first axis, of values whose exact counterparts lie on the side of the sign of `errors`.

    An unknown error (NaN) widens to both sides, never across zero: a double has the sign of what it rounds.
    """
    low = np.where(errors >= 0, values, np.nextafter(values, -inf))
    high = np.where(errors <= 0, values, np.nextafter(values, inf))
    return Interval(low.min(axis=0), high.max(axis=0))


def product_error(x: Array, y: Array, p: Array) -> Array:
    """Exact x y - p for p = fl(x y); its sign if p is zero; NaN if it may not be representable."""
    (x1, x2), (y1, y2) = split(x), split(y)
    error = ((x1 * y1 - p) + x1 * y2 + x2 * y1) + x2 * y2
    return np.where(p == 0, np.sign(x) * np.sign(y), np.where(np.abs(p) < 1e-280, nan, error))


def split(x: Array) -> tuple[Array, Array]:
    """Two halves of 26 bits whose sum is x (NaN where that overflows)."""
    scaled = SPLITTER * x
    high = scaled - (scaled - x)
    return high, x - high


def power(x: Interval, n: Interval) -> Interval:
    """Power: of an integer exponent by multiplication, else for x >= 0 (and at the integers that n holds).

    The first rule is for an exponent that is the same in all boxes.
    """
    exponent = float(n.low.flat[0])
    if exponent.is_integer() and np.all(n.low == exponent) and np.all(n.high == exponent):
        return integer_power(x, int(exponent))
    positive = x.meet(0.0, inf)
    result = around(np.power(*corners(positive, n))).meet(0.0, inf).emptied(positive.empty)
    magnitude = around(np.power(*corners(abs(x), n)))
    signed = (x.low < 0) & (np.floor(n.high) >= np.ceil(n.low))
    return result.hull(magnitude.hull(-magnitude).emptied(~signed))


def integer_power(x: Interval, n: int) -> Interval:
    """Integer power from the ends of x (even n: of |x|), each by repeated squaring."""
    if n < 0:
        return Interval(np.array(1.0), np.array(1.0)) / integer_power(x, -n)
    base = abs(x) if n % 2 == 0 else x
    low, high = (repeated(Interval(end, end), n) for end in (base.low, base.high))
    return Interval(low.low, high.high)


def repeated(x: Interval, n: int) -> Interval:
    """Product of n factors x of one sign."""
    result = None
    while n:
        if n % 2:
            result = x if result is None else result * x
        n //= 2
        if n:
            x = x * x
    return Interval(np.array(1.0), np.array(1.0)) if result is None else result


def around(values: Array, exact: Array | bool = False) -> Interval:
    """Hull, along the first axis, of values that are right within ULPS units (where exact: right)."""
    low = high = values
    for _ in range(ULPS):
        low, high = np.nextafter(low, -inf), np.nextafter(high, inf)
    return Interval(np.where(exact, values, low).min(axis=0), np.where(exact, values, high).max(axis=0))


Rule = Callable[..., Interval]


def monotone(
    function: Callable[[Array], Array],
    exact: float,
    domain: tuple[float, float] = (-inf, inf),
    image: tuple[float, float] = (-inf, inf),
) -> Rule:
    """Rule of a monotone function whose value at the argument `exact` is a double."""

    def rule(x: Interval) -> Interval:
        inside = x.meet(*domain)
        arguments = ends(inside.low, inside.high)
        return around(function(arguments), arguments == exact).meet(*image).emptied(inside.empty)

    return rule


def even(rule: Rule) -> Rule:
    """Rule of an even function from that of its half on x >= 0."""
    return lambda x: rule(abs(x))


def unwidened(function: Callable[..., Array]) -> Rule:
    """Rule of a function that never decreases in any argument and is computed without error."""
    return lambda *x: Interval(function(*(a.low for a in x)), function(*(a.high for a in x)))


def sqrt(x: Interval) -> Interval:
    """Square root, correctly rounded."""
    inside = x.meet(0.0, inf)
    arguments = ends(inside.low, inside.high)
    root = np.sqrt(arguments)
    square = root * root
    return rounded(root, (arguments - square) - product_error(root, root, square)).emptied(inside.empty)


def holds(x: Interval, point: float, period: float) -> npt.NDArray[np.bool_]:
    """Whether point + k period may lie in x for an integer k; surely true for arguments too large to tell."""
    first, last = (x.low - point) / period, (x.high - point) / period
    slack = 1e-15 * (1 + np.abs(first) + np.abs(last))
    return ~(np.floor(last + slack) < np.ceil(first - slack))


def wave(function: Callable[[Array], Array], crest: float, exact: float) -> Rule:
    """Rule of a sine with a crest at the given argument."""

    def rule(x: Interval) -> Interval:
        arguments = ends(x.low, x.high)
        between = around(function(arguments), arguments == exact)
        low = np.where(holds(x, crest + pi, 2 * pi), -1.0, between.low)
        high = np.where(holds(x, crest, 2 * pi), 1.0, between.high)
        return Interval(low, high).meet(-1.0, 1.0)

    return rule


def tan(x: Interval) -> Interval:
    """Tangent: unbounded across a pole."""
    pole = holds(x, pi / 2, pi)
    between = monotone(np.tan, 0.0)(x)
    return Interval(np.where(pole, -inf, between.low), np.where(pole, inf, between.high))


def atan2(y: Interval, x: Interval) -> Interval:
    """Angle of (x, y): from the corners, or all of [-pi, pi] if the box meets the cut x <= 0, y = 0."""
    cut = (x.low <= 0) & (y.low <= 0) & (y.high >= 0)
    between = around(np.arctan2(*corners(y, x)))
    return Interval(np.where(cut, -PI_ABOVE, between.low), np.where(cut, PI_ABOVE, between.high))


def less(a: Interval, b: Interval) -> Interval:
    """Truth of a < b."""
    return truth(a.high < b.low, a.low >= b.high)


def equal(a: Interval, b: Interval) -> Interval:
    """Truth of a == b."""
    same = (a.low == b.high) & (a.high == b.low)
    return truth(same, (a.high < b.low) | (b.high < a.low))


def truth(true: npt.NDArray[np.bool_], false: npt.NDArray[np.bool_]) -> Interval:
    """Return 1 where surely true, 0 where surely false, else [0, 1]."""
    return Interval(np.where(true, 1.0, 0.0), np.where(false, 0.0, 1.0))


def negation(a: Interval) -> Interval:
    """Return the opposite of a truth."""
    return Interval(1.0 - a.high, 1.0 - a.low)


def where(condition: Interval, a: Interval, b: Interval) -> Interval:
    """Choice of a or b; their hull where the condition is undecided."""
    true = (condition.low > 0) | (condition.high < 0)
    false = (condition.low == 0) & (condition.high == 0)
    return a.emptied(false).hull(b.emptied(true)).emptied(condition.empty)
