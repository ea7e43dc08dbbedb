"""Searches over the decay rate: the curve of the least gamma, its minimum, and the edge of feasibility."""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import Any

from flint import fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.elimination import least_gamma
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import excluded, least, searchable, within
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.pace import Pace
from obsdesign.dissipation.scan import Minimum, edge, strides
from obsdesign.dissipation.zero import settled, share_of_widest
from obsdesign.lmi.reduce import Reduced, between
from obsdesign.lmi.solve import Answer, Status, reduction
from obsdesign.records import dataclass, replace

EDGE = 1e-6  # relative, of the largest rate
FEW, APART = 4, 0.1  # points of a curve and the relative step of their gammas, where a proof fails at the least
JUMP = 2.0  # ratio of gamma^2 at two points beyond which the scaling of one is not believed at the other

Point = dict[str, Any]  # rate, status and, where it is optimal, gamma


@dataclass(frozen=True)
class Decay:
    """The least gamma of a family, within bounds, as a function of its rate."""

    engine: Engine
    family: Incremental  # in rationals
    bounds: Bounds = NO_BOUNDS
    doubted: bool = True  # whether a solver's word that there is no solution is held against other solves

    @property
    def trusting(self) -> "Decay":
        """Same for what else would do, where a solver's word is enough."""
        return replace(self, doubted=False)

    def curve(self, grid: Sequence[fmpq]) -> Iterator[Point]:
        """Points of the grid; nothing is solved above an infeasible one.

        The inequality is affine in its loss, so the reductions at both ends give those between. Every point is solved
        from nothing, but in the scaling of its neighbor; a bound on L1 takes several solves, as it does at one alpha.
        """
        search = searchable(self.family)
        low, high = (replace(search, rate=float(end)) for end in (grid[0], grid[-1]))

        @cache
        def ends() -> tuple[Reduced, Reduced]:
            first = reduction(low.least_gamma(self.bounds))
            return first, reduction(high.least_gamma(self.bounds), first)

        neighbor: Answer | None = None
        lost = False
        for i, rate in enumerate(map(float, grid)):
            self.engine.report(0.7 * i / len(grid), self.pace.said(rate, 4))
            if lost:
                yield {"rate": rate, "status": str(Status.INFEASIBLE)}
                continue
            here = replace(search, rate=rate)
            known = least_gamma(self.engine, here, self.bounds)
            if known is not None:
                yield self.point(rate, known)
                continue
            if self.bounds.L1 is not None:
                answer = within(self.engine, here, self.bounds)
            else:
                problem = here.least_gamma(self.bounds)
                reduced = between(*ends(), (here.loss - low.loss) / (high.loss - low.loss))
                answer = self.engine.minimise(problem, neighbor.values if neighbor else None, reduced)
                if neighbor and not near(neighbor.objective, answer.objective):
                    answer = self.engine.minimise(problem, reduced=reduced)
            lost = answer.status is Status.INFEASIBLE
            neighbor = answer if answer.status is Status.OPTIMAL else neighbor
            yield self.point(rate, answer)

    @property
    def pace(self) -> Pace:
        """How the rate is told."""
        return self.family.about.pace

    def at(self, rate: float) -> Point:
        """One point."""
        family = replace(self.family, rate=self.pace.found(rate))
        return self.point(rate, within(self.engine, searchable(family), self.bounds))

    def point(self, rate: float, answer: Answer) -> Point:
        """Point of a curve; its gamma is 0 where a finite gain cancels the disturbance and the rest is rounding."""
        found = settled(self.engine, replace(searchable(self.family), rate=rate), answer, self.bounds)
        gamma = {"gamma": math.sqrt(max(found.objective, 0.0))} if found.status is Status.OPTIMAL else {}
        return {"rate": rate, "status": str(found.status), **gamma}

    def fastest(self, points: Sequence[Point], slack: float) -> float:
        """Largest rate within a slack of the least gamma of a curve, or of what is certified where that is zero."""
        levels: dict[float, float] = {point["rate"]: point["gamma"] for point in points if "gamma" in point}
        if not min(levels.values()):
            zeros = [rate for rate, gamma in levels.items() if not gamma]
            shares = (share_of_widest(self.engine, replace(searchable(self.family), rate=rate)) for rate in zeros)
            levels = {rate: share or math.inf for rate, share in zip(zeros, shares, strict=True)}
        least, cap = min(levels.values()), math.inf if self.bounds.gamma is None else float(self.bounds.gamma)
        most = max(min(least * (1 + slack), cap), least)
        return max(rate for rate, level in levels.items() if level <= most)

    def choice(self, points: Sequence[Point], rate: float, *, pareto: bool) -> str:
        """Why this rate, in words."""
        here, key = self.pace.said(self.pace.found(rate)), self.pace.key
        if self.family.about.monotone and not pareto:
            end = f"never increases with {key}" if self.pace.sampled else f"never decreases with {key}"
            lower = "upper" if self.pace.sampled else "lower"
            return f"the least gamma {end}, so min-gamma takes the {lower} end of the range"
        if any(point.get("gamma") == 0 for point in points):
            where = "is the fastest decay within the slack of" if pareto else "has"
            return f"the least gamma is zero in the range, and {here} {where} the least that was reached"
        if pareto:
            return f"{here} is the fastest decay of the curve that was found within the slack of its least"
        return f"{here} has the least gamma that was found in the range, by a grid and Brent's method"

    def lowest(self, points: Sequence[Point]) -> list[Point]:
        """Further points about the lowest of a curve that falls and then rises; none where it is zero."""
        known = {point["rate"]: point.get("gamma", math.inf) for point in points}
        if not min(known.values()):
            return []
        tried: list[Point] = []

        def gamma(rate: float) -> float:
            self.engine.report(0.65, self.pace.said(rate, 5))
            tried.append(self.at(rate))
            return float(tried[-1].get("gamma", math.inf))

        Minimum(gamma, min(known), max(known), values=known).around()
        return tried

    def feasible(self, rate: fmpq) -> tuple[bool, bool]:
        """Whether the inequality has a solution at a rate, and whether that stayed undecided."""
        family = searchable(replace(self.family, rate=rate))
        level = self.bounds.gamma
        found = within(self.engine, family, self.bounds, doubted=self.doubted)
        answer = settled(self.engine, family, found, self.bounds)
        if answer.status is Status.OPTIMAL:
            goal = math.inf if level is None else float(level) ** 2
            inside = answer.objective <= goal
            return inside, not inside and not excluded(least(self.engine, family), self.bounds, goal)
        if level is None and not self.bounds.restricted:
            wide = self.engine.widest(family.feasible())
            return wide.status is Status.OPTIMAL, wide.status is Status.UNDECIDED
        return False, answer.status is Status.UNDECIDED

    def largest(self, low: float, high: float) -> float:
        """Edge of feasibility between a feasible and an infeasible rate."""
        return edge(self.holds, low, high, EDGE)

    def holds(self, rate: float) -> bool:
        """Whether a rate is feasible, as far as it was decided."""
        self.engine.report(0.5, self.pace.said(rate, 5))
        return self.feasible(self.pace.found(rate))[0]

    def largest_below(self, rate: fmpq) -> float | None:
        """Largest feasible rate below an infeasible one, searched over four decades; None if none was found."""
        high = float(rate)
        low, above = strides(lambda r: r < high and self.holds(r), high, 10.0, 4)
        return None if low is None or above is None else self.largest(low, above)


def near(one: float, other: float) -> bool:
    """Whether gamma^2 hardly changes between two points of a curve."""
    return 0 < one <= JUMP * other and other <= JUMP * one


def apart(points: Iterable[Point]) -> Iterator[float]:
    """Rates of a few points of a curve, each with a gamma that is larger by a step, the first than the least one."""
    found = sorted((point for point in points if "gamma" in point), key=lambda point: point["gamma"])
    for _ in range(FEW if found else 0):
        level = found[0]["gamma"] * (1 + APART)
        found = [point for point in found if point["gamma"] > level]
        if not found:
            return
        yield found[0]["rate"]
