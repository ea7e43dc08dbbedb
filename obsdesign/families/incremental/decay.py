"""Searches over the decay rate alpha: the curve of the least gamma, its minimum, and the edge of feasibility."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from flint import fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import excluded, least, searchable, within
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.scan import Minimum, edge, strides
from obsdesign.dissipation.zero import settled, share_of_widest
from obsdesign.lmi.formula import rational_number
from obsdesign.lmi.reduce import between
from obsdesign.lmi.solve import Answer, Status, reduction

EDGE = 1e-6  # relative, of the largest alpha
FEW, APART = 4, 0.1  # points of a curve and the relative step of their gammas, where a proof fails at the least
JUMP = 2.0  # ratio of gamma^2 at two points beyond which the scaling of one is not believed at the other

Point = dict[str, Any]  # alpha, status and, where it is optimal, gamma


@dataclass(frozen=True)
class Decay:
    """The least gamma of a family, within bounds, as a function of alpha."""

    engine: Engine
    family: Incremental  # in rationals
    bounds: Bounds = NO_BOUNDS

    def curve(self, grid: Sequence[fmpq]) -> Iterator[Point]:
        """Points of the grid; nothing is solved above an infeasible one.

        The inequality is affine in alpha, so the reductions at both ends give those between. Every point is solved from
        nothing, but in the scaling of its neighbor; a bound on L1 takes several solves, as it does at one alpha.
        """
        search, low, high = searchable(self.family), float(grid[0]), float(grid[-1])
        first = reduction(replace(search, alpha=low).least_gamma(self.bounds))
        last = reduction(replace(search, alpha=high).least_gamma(self.bounds), first)
        neighbor: Answer | None = None
        lost = False
        for i, alpha in enumerate(map(float, grid)):
            self.engine.report(0.7 * i / len(grid), f"alpha = {alpha:.4g}")
            if lost:
                yield {"alpha": alpha, "status": str(Status.INFEASIBLE)}
                continue
            if self.bounds.L1 is not None:
                answer = within(self.engine, replace(search, alpha=alpha), self.bounds)
            else:
                problem = replace(search, alpha=alpha).least_gamma(self.bounds)
                reduced = between(first, last, (alpha - low) / (high - low))
                answer = self.engine.minimise(problem, neighbor.values if neighbor else None, reduced)
                if neighbor and not near(neighbor.objective, answer.objective):
                    answer = self.engine.minimise(problem, reduced=reduced)
            lost = answer.status is Status.INFEASIBLE
            neighbor = answer if answer.status is Status.OPTIMAL else neighbor
            yield self.point(alpha, answer)

    def at(self, alpha: float) -> Point:
        """One point."""
        family = replace(self.family, alpha=rational_number(repr(alpha)))
        return self.point(alpha, within(self.engine, searchable(family), self.bounds))

    def point(self, alpha: float, answer: Answer) -> Point:
        """Point of a curve; its gamma is 0 where a finite gain cancels the disturbance and the rest is rounding."""
        found = settled(self.engine, replace(searchable(self.family), alpha=alpha), answer, self.bounds)
        gamma = {"gamma": math.sqrt(max(found.objective, 0.0))} if found.status is Status.OPTIMAL else {}
        return {"alpha": alpha, "status": str(found.status), **gamma}

    def fastest(self, points: Sequence[Point], slack: float) -> float:
        """Largest alpha within a slack of the least gamma of a curve, or of what is certified where that is zero."""
        levels: dict[float, float] = {point["alpha"]: point["gamma"] for point in points if "gamma" in point}
        if not min(levels.values()):
            zeros = [alpha for alpha, gamma in levels.items() if not gamma]
            shares = (share_of_widest(self.engine, replace(searchable(self.family), alpha=alpha)) for alpha in zeros)
            levels = {alpha: share or math.inf for alpha, share in zip(zeros, shares, strict=True)}
        least, cap = min(levels.values()), math.inf if self.bounds.gamma is None else float(self.bounds.gamma)
        most = max(min(least * (1 + slack), cap), least)
        return max(alpha for alpha, level in levels.items() if level <= most)

    def choice(self, points: Sequence[Point], alpha: float, *, pareto: bool) -> str:
        """Why this alpha, in words."""
        if self.family.about.monotone and not pareto:
            return "the least gamma never decreases with alpha, so min-gamma takes the lower end of the range"
        if any(point.get("gamma") == 0 for point in points):
            where = "is the fastest decay within the slack of" if pareto else "has"
            return f"the least gamma is zero in the range, and alpha = {alpha:g} {where} the least that was reached"
        if pareto:
            return f"alpha = {alpha:g} is the fastest decay of the curve that was found within the slack of its least"
        return f"alpha = {alpha:g} has the least gamma that was found in the range, by a grid and Brent's method"

    def lowest(self, points: Sequence[Point]) -> list[Point]:
        """Further points about the lowest of a curve that falls and then rises; none where it is zero."""
        known = {point["alpha"]: point.get("gamma", math.inf) for point in points}
        if not min(known.values()):
            return []
        tried: list[Point] = []

        def gamma(alpha: float) -> float:
            self.engine.report(0.65, f"alpha = {alpha:.5g}")
            tried.append(self.at(alpha))
            return float(tried[-1].get("gamma", math.inf))

        Minimum(gamma, min(known), max(known), values=known).around()
        return tried

    def feasible(self, alpha: fmpq) -> tuple[bool, bool]:
        """Whether the inequality has a solution at alpha, and whether that stayed undecided."""
        family = searchable(replace(self.family, alpha=alpha))
        level = self.bounds.gamma
        answer = settled(self.engine, family, within(self.engine, family, self.bounds), self.bounds)
        if answer.status is Status.OPTIMAL:
            goal = math.inf if level is None else float(level) ** 2
            inside = answer.objective <= goal
            return inside, not inside and not excluded(least(self.engine, family), self.bounds, goal)
        if level is None and not self.bounds.restricted:
            wide = self.engine.widest(family.feasible())
            return wide.status is Status.OPTIMAL, wide.status is Status.UNDECIDED
        return False, answer.status is Status.UNDECIDED

    def largest(self, low: float, high: float) -> float:
        """Edge of feasibility between a feasible and an infeasible alpha."""
        return edge(self.holds, low, high, EDGE)

    def holds(self, alpha: float) -> bool:
        """Whether alpha is feasible, as far as it was decided."""
        self.engine.report(0.5, f"alpha = {alpha:.5g}")
        return self.feasible(rational_number(repr(alpha)))[0]

    def largest_below(self, alpha: fmpq) -> float | None:
        """Largest feasible alpha below an infeasible one, searched over four decades; None if none was found."""
        high = float(alpha)
        low, above = strides(lambda a: a < high and self.holds(a), high, 10.0, 4)
        return None if low is None or above is None else self.largest(low, above)


def near(one: float, other: float) -> bool:
    """Whether gamma^2 hardly changes between two points of a curve."""
    return 0 < one <= JUMP * other and other <= JUMP * one


def apart(points: Iterable[Point]) -> Iterator[fmpq]:
    """Alphas of a few points of a curve, each with a gamma that is larger by a step, the first than the least one."""
    found = sorted((point for point in points if "gamma" in point), key=lambda point: point["gamma"])
    for _ in range(FEW if found else 0):
        level = found[0]["gamma"] * (1 + APART)
        found = [point for point in found if point["gamma"] > level]
        if not found:
            return
        yield rational_number(repr(found[0]["alpha"]))
