"""Searches of one variable: a valley over a logarithmic scale, and the zero of an increasing function."""

import math
from collections.abc import Callable

import numpy as np

Function = Callable[[float], float]  # infinite where there is nothing
GOLDEN = (math.sqrt(5) - 1) / 2
NARROW = 1.005  # ratio of the ends between which a minimum is left
SHALLOW = 2e-5  # depth that a minimum may have below the best value, relative to its neighbors
LEVEL = 0.2  # relative difference of values that are taken as level ground
BELOW, ABOVE = 0.85, 1.15  # first bracket about a minimum nearby, relative to it
FARTHER = 0.7  # how it is widened
STEPS = 40


class Valley:
    """The least value of a function on an interval, by a grid or near a known minimum, and then by parabolas.

    Every value is kept: the best is the best of all that were tried.
    """

    def __init__(self, function: Function, low: float, high: float) -> None:
        self.function, self.low, self.high = function, low, high
        self.values: dict[float, float] = {}

    def at(self, x: float) -> float:
        """Value at a point, which is rounded to 6 digits and kept inside."""
        x = min(max(float(f"{x:.6g}"), self.low), self.high)
        if x not in self.values:
            self.values[x] = self.function(x)
        return self.values[x]

    @property
    def best(self) -> tuple[float, float]:
        """Point of the least value, and the value."""
        return min(self.values.items(), key=lambda pair: pair[1])

    @property
    def flat(self) -> bool:
        """Whether the values hardly differ, or are not all finite: the search may have seen no valley at all."""
        low, high = min(self.values.values()), max(self.values.values())
        return not math.isfinite(high) or high - low <= LEVEL * max(abs(low), abs(high))

    def everywhere(self, points: int) -> float:
        """Search the whole interval; returns the least value."""
        grid = np.geomspace(self.low, self.high, points) if self.low < self.high else [self.low]
        for x in grid:
            self.at(float(x))
        return self.around_best()

    def near(self, x: float) -> float:
        """Search about a point that is near the minimum of a function with one valley; returns the least value."""
        for factor in (BELOW, 1.0, ABOVE):
            self.at(x * factor)
        for _ in range(STEPS):
            tried = sorted(self.values)
            best, value = self.best
            if math.isinf(value):
                break
            if best == tried[0] and best > self.low:
                self.at(best * FARTHER)
            elif best == tried[-1] and best < self.high:
                self.at(best / FARTHER)
            else:
                break
        return self.around_best()

    def around_best(self) -> float:
        """Go to the vertex of the parabola through the best point and its neighbors until that is no deeper."""
        for _ in range(STEPS):
            x, depth = self.next()
            if depth <= 0 or x in self.values:
                break
            self.at(x)
        return self.best[1]

    def next(self) -> tuple[float, float]:
        """Next point to try, and how much deeper it may be; not at all if the best one is good enough."""
        tried = sorted(self.values)
        best, value = self.best
        if len(tried) < 3 or math.isinf(value):
            return best, 0.0
        place = tried.index(best)
        inner = min(max(place, 1), len(tried) - 2)
        low, middle, high = tried[inner - 1 : inner + 2]
        ends = tried[max(place - 1, 0)], tried[min(place + 1, len(tried) - 1)]
        if ends[1] <= NARROW * ends[0]:
            return best, 0.0
        heights = [self.values[x] for x in (low, middle, high)]
        if not all(map(math.isfinite, heights)):
            return split(best, *ends), math.inf
        u, depth = vertex([math.log(x) for x in (low, middle, high)], heights)
        if math.isnan(u):
            return split(best, *ends), math.inf
        x = min(max(math.exp(u), self.low), self.high)
        deep = depth - (min(heights) - value) > SHALLOW * (max(map(abs, heights)))
        return (float(f"{x:.6g}"), depth) if deep and ends[0] < x < ends[1] else (best, 0.0)


def split(best: float, low: float, high: float) -> float:
    """Golden section of the longer of the two parts of an interval."""
    left, right = best / low, high / best
    x = best * (low / best) ** (1 - GOLDEN) if left > right else best * (high / best) ** (1 - GOLDEN)
    return float(f"{x:.6g}")


def vertex(u: list[float], heights: list[float]) -> tuple[float, float]:
    """Lowest point of the parabola through three points, and how far it is below them; nan if it opens downwards."""
    slopes = [(heights[i + 1] - heights[i]) / (u[i + 1] - u[i]) for i in (0, 1)]
    curvature = (slopes[1] - slopes[0]) / (u[2] - u[0])
    if curvature <= 0:
        return math.nan, 0.0
    at = (u[0] + u[1]) / 2 - slopes[0] / (2 * curvature)
    lowest = heights[0] + (at - u[0]) * (slopes[0] + curvature * (at - u[1]))
    return at, min(heights) - lowest


def edge(function: Function, low: float, high: float, tolerance: float) -> float:
    """Largest x, to a tolerance, at which an increasing function is negative: it is at low, and is not at high.

    Regula falsi with halved weights (Illinois) where both values are finite, else bisection.
    """
    below, above = function(low), function(high)
    for _ in range(STEPS):
        if high - low <= tolerance:
            break
        finite = math.isfinite(below) and math.isfinite(above) and above > below
        share = -below / (above - below) if finite else 0.5
        x = low + min(max(share, 0.02), 0.98) * (high - low)
        value = function(x)
        if value < 0:
            low, below, above = x, value, above / 2
        else:
            high, above, below = x, value, below / 2
    return low
