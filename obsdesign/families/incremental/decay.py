"""Searches over the decay rate alpha: the curve of the least gamma, its minimum, and the edge of feasibility."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from flint import fmpq

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import searchable
from obsdesign.dissipation.inequality import Incremental
from obsdesign.lmi.formula import rational_number
from obsdesign.lmi.reduce import between
from obsdesign.lmi.solve import Answer, Status, reduction

BISECTIONS = 24
EDGE = 1e-5  # relative, of the largest alpha
GOLDEN = (math.sqrt(5) - 1) / 2
NARROW = 1.01  # ratio of the ends between which the minimum of a curve is left
DIGITS = 6  # of a searched alpha
JUMP = 2.0  # ratio of gamma^2 at two points beyond which the scaling of one is not believed at the other

Point = dict[str, Any]  # alpha, status and, where it is optimal, gamma


@dataclass(frozen=True)
class Decay:
    """The least gamma of a family, within bounds (None: over all gains), as a function of alpha."""

    engine: Engine
    family: Incremental  # in rationals
    bounds: Bounds | None = None

    def curve(self, grid: Sequence[fmpq]) -> Iterator[Point]:
        """Points of the grid; nothing is solved above an infeasible one.

        The inequality is affine in alpha, so the reductions at both ends give those between.
        """
        search, low, high = searchable(self.family), float(grid[0]), float(grid[-1])
        first, last = (reduction(replace(search, alpha=a).least_gamma(self.restricting)) for a in (low, high))
        start: Answer | None = None
        lost = False
        for i, alpha in enumerate(map(float, grid)):
            self.engine.report(0.7 * i / len(grid), f"alpha = {alpha:.4g}")
            point: Point = {"alpha": alpha, "status": str(Status.INFEASIBLE)}
            if not lost:
                problem = replace(search, alpha=alpha).least_gamma(self.restricting)
                reduced = between(first, last, (alpha - low) / (high - low))
                answer = self.engine.minimise(problem, start.values if start else None, reduced)
                if start and not near(start.objective, answer.objective):
                    answer = self.engine.minimise(problem, reduced=reduced)
                lost = answer.status is Status.INFEASIBLE
                point["status"] = str(answer.status)
                if answer.status is Status.OPTIMAL:
                    start = answer
                    point["gamma"] = math.sqrt(max(answer.objective, 0.0))
            yield point

    def at(self, alpha: float) -> Point:
        """One point."""
        family = replace(self.family, alpha=rational_number(repr(alpha)))
        answer = self.engine.minimise(searchable(family).least_gamma(self.restricting))
        known = {"gamma": math.sqrt(max(answer.objective, 0.0))} if answer.status is Status.OPTIMAL else {}
        return {"alpha": alpha, "status": str(answer.status), **known}

    def lowest(self, points: Sequence[Point]) -> list[Point]:
        """Points of a golden section around the lowest of a curve that falls and then rises."""
        best = min(range(len(points)), key=lambda i: points[i].get("gamma", math.inf))
        if "gamma" not in points[best]:
            return []
        low, high = points[max(best - 1, 0)]["alpha"], points[min(best + 1, len(points) - 1)]["alpha"]
        tried: list[Point] = []

        def probe(share: float) -> Point:
            self.engine.report(0.65, f"alpha = {low:.5g} .. {high:.5g}")
            tried.append(self.at(float(f"{low * (high / low) ** share:.{DIGITS}g}")))
            return tried[-1]

        left, right = probe(1 - GOLDEN), probe(GOLDEN)
        while high > NARROW * low:
            if left.get("gamma", math.inf) <= right.get("gamma", math.inf):
                high, right = right["alpha"], left
                left = probe(1 - GOLDEN)
            else:
                low, left = left["alpha"], right
                right = probe(GOLDEN)
        return tried

    def feasible(self, alpha: fmpq) -> tuple[bool, bool]:
        """Whether the inequality has a solution at alpha, and whether that stayed undecided."""
        family = searchable(replace(self.family, alpha=alpha))
        level = self.bounds.gamma if self.bounds else None
        answer = self.engine.minimise(family.least_gamma(self.restricting))
        if answer.status is Status.OPTIMAL:
            return level is None or answer.objective <= float(level) ** 2, False
        if level is None and self.restricting is None:
            wide = self.engine.widest(family.feasible())
            return wide.status is Status.OPTIMAL, wide.status is Status.UNDECIDED
        return False, answer.status is Status.UNDECIDED

    @property
    def restricting(self) -> Bounds | None:
        """The bounds that the least gamma is subject to: not that on gamma itself."""
        bounds = self.bounds
        return bounds if bounds and (bounds.L1 is not None or bounds.P is not None) else None

    def largest(self, low: float, high: float) -> float:
        """Edge of feasibility between a feasible and an infeasible alpha, to 1e-5."""
        for i in range(BISECTIONS):
            if high - low <= EDGE * high:
                break
            self.engine.report(0.7 * i / BISECTIONS, f"alpha = {low:.5g} .. {high:.5g}")
            middle = math.sqrt(low * high) if high > 4 * low > 0 else (low + high) / 2
            feasible, _ = self.feasible(rational_number(repr(middle)))
            low, high = (middle, high) if feasible else (low, middle)
        return low

    def largest_below(self, alpha: fmpq) -> float | None:
        """Largest feasible alpha below an infeasible one, searched over four decades; None if none was found."""
        high = float(alpha)
        for _ in range(4):
            low = high / 10
            if self.feasible(rational_number(repr(low)))[0]:
                return self.largest(low, high)
            high = low
        return None


def near(one: float, other: float) -> bool:
    """Whether gamma^2 hardly changes between two points of a curve."""
    return 0 < one <= JUMP * other and other <= JUMP * one
