"""Searches of one variable: the least value, the zero of an increasing function, and the end of what is feasible.

A search says where to look, from a neighbor on a curve if there is one; what is written comes from a solve that knows
nothing of the path. Values of a function may be infinite where there is nothing. Where there are values, Brent's
methods of scipy.optimize search; where there is only yes and no these would halve as well, and scipy.optimize takes
0.2 s to import.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from obsdesign.records import dataclass, field

Function = Callable[[float], float]
SHARP = 5e-3  # relative width to which a minimum is found; its value is then good to about 1e-6
WIDTH = 1.35  # ratio of the ends of a first bracket to the guess in it
FEW = 4  # values in it: Brent's method has its parabola then, and its value is good to about 1e-5
LEVEL = 0.05  # relative rise of the neighbors up to which it is; where they are higher the search goes on
MOST = 100  # .. elsewhere
FAR = 1e3  # what stands for infinity, relative to the finite values


@dataclass
class Minimum:
    """The least value of a function of a positive number on an interval; every value is kept."""

    function: Function
    low: float
    high: float
    sharp: float = SHARP
    digits: int = 6  # of a point
    values: dict[float, float] = field(default_factory=dict)
    width: float = WIDTH

    def at(self, x: float) -> float:
        """Value at a point, which is rounded and kept inside."""
        x = min(max(float(f"{x:.{self.digits}g}"), self.low), self.high)
        x = next((known for known in self.values if float(f"{known:.{self.digits}g}") == x), x)
        if x not in self.values:
            self.values[x] = self.function(x)
        return self.values[x]

    @property
    def best(self) -> tuple[float, float]:
        """Point of the least value, and the value."""
        return min(self.values.items(), key=lambda pair: pair[1])

    def everywhere(self, points: int) -> tuple[float, float]:
        """Search by a grid, denser towards zero, and about its best point if that is better than what was known."""
        known = self.best if self.values else None
        for x in np.geomspace(self.low, self.high, points) if self.low < self.high else [self.low]:
            self.at(float(x))
        return self.best if self.best == known else self.around()

    def around(self) -> tuple[float, float]:
        """Search between the neighbors of the best point."""
        best, value = self.best
        return self.best if math.isinf(value) else self.between(*self.neighbors(best))

    def near(self, guess: float) -> tuple[float, float]:
        """Search about a guess at the minimum of a function with one valley, moving on as long as it falls."""
        best = min(max(guess, self.low), self.high)
        reach = self.width if self.low < best < self.high else self.width**4
        below, above, moved = best / reach, best * reach, False
        while True:
            tried = len(self.values)
            best, value = self.between(max(below, self.low), min(above, self.high), FEW)
            below, above = self.neighbors(best)
            if math.isinf(value) or len(self.values) == tried:
                return self.best
            if below < best < above or best in {self.low, self.high}:
                level = max(self.values[below], self.values[above]) <= value + LEVEL * abs(value)
                return self.best if level and not moved else self.between(below, above, 2 * FEW if moved else FEW)
            below, above = (best / reach, above) if below == best else (below, best * reach)
            reach, moved = reach * reach, True

    def neighbors(self, x: float) -> tuple[float, float]:
        """Closest points on both sides that were tried, or the point itself."""
        return max((y for y in self.values if y < x), default=x), min((y for y in self.values if y > x), default=x)

    def between(self, low: float, high: float, most: int = MOST) -> tuple[float, float]:
        """Search a part by the method of Brent, by so many values; an end of the whole interval is tried before."""
        from scipy.optimize import minimize_scalar

        step = 1 + self.sharp
        for end, inside in ((self.low, low * step), (self.high, high / step)):
            if end in {low, high} and low < inside < high and self.at(end) <= self.at(inside) < math.inf:
                return self.best
        if high > low * (1 + 4 * self.sharp):
            largest = FAR * max((abs(v) for v in self.values.values() if math.isfinite(v)), default=1.0)
            minimize_scalar(
                lambda u: min(self.at(math.exp(u)), largest),
                bounds=(math.log(low), math.log(high)),
                method="bounded",
                options={"xatol": self.sharp, "maxiter": most},
            )
        elif not self.values:
            self.at(low)
        return self.best


def zero(function: Function, low: float, high: float, tolerance: float) -> float | None:
    """Largest x of an interval at which an increasing function is found to be negative; None if it is not at `low`.

    Its zero is no more than the tolerance beyond.
    """
    from scipy.optimize import brentq

    below = function(low)
    if below >= 0:
        return None
    above = function(high)
    if above < 0:
        return high
    known = {low: below, high: above}

    def finite(x: float) -> float:
        if x not in known:
            known[x] = function(x)
        return known[x] if math.isfinite(known[x]) else math.copysign(max(-below, 1.0), known[x])

    brentq(finite, low, high, xtol=tolerance / 2, rtol=1e-12)
    return max(x for x, value in known.items() if value < 0)


def knee(x: Sequence[float], y: Sequence[float], least: float) -> int | None:
    """Number of the point of a falling curve that is the farthest below the line from its first point to its last.

    None where that is no more than a least distance.
    """
    across = np.asarray(x) - x[0]
    line = y[0] + (y[-1] - y[0]) * across / (across[-1] or 1.0)
    below = line - np.asarray(y)
    return int(below.argmax()) if below.max() > least else None


def edge(holds: Callable[[float], bool], inside: float, outside: float, tolerance: float) -> float:
    """End, to a relative tolerance, of where a condition holds: it does inside, and does not outside.

    The interval is halved, on a logarithmic scale where both ends are positive.
    """
    while abs(outside - inside) > tolerance * max(inside, outside):
        middle = math.sqrt(inside * outside) if inside * outside > 0 else (inside + outside) / 2
        inside, outside = (middle, outside) if holds(middle) else (inside, middle)
    return inside


def strides(
    holds: Callable[[float], bool], start: float, factor: float, steps: int
) -> tuple[float | None, float | None]:
    """Neighbors x and x factor, the first where a condition holds and the second where it does not.

    From a start on as long as it holds there, or else back until it does; None for what was not found.
    """
    if holds(start):
        for _ in range(steps):
            if not holds(start * factor):
                return start, start * factor
            start *= factor
        return start, None
    for _ in range(steps):
        start /= factor
        if holds(start):
            return start, start * factor
    return None, start
