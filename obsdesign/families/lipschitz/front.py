"""Objective pareto: minimise weight / lipschitz + (1 - weight) gamma^2, with the declared constant at least.

Theorem 4 is one problem for each weight. In the other relaxations the least gamma is a function of the constant, and
the minimum is searched over it.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.gain import ROOM, bounded, rounded_gains, within
from obsdesign.dissipation.inequality import LARGE, ONE
from obsdesign.dissipation.scan import Minimum, edge
from obsdesign.dissipation.zero import settled
from obsdesign.families.lipschitz.claim import Claim
from obsdesign.families.lipschitz.closed_forms import regular
from obsdesign.families.lipschitz.max_lipschitz import unlimited
from obsdesign.families.lipschitz.min_gamma import small_gains
from obsdesign.families.lipschitz.relaxations import Lipschitz, Theorem4
from obsdesign.families.lipschitz.study import Study, recast
from obsdesign.families.lipschitz.suprema import Supremum, largest_for_gamma
from obsdesign.families.outcome import BEST_FOUND
from obsdesign.lmi.formula import Array, Inequality, Problem, Unknown, Values, in_floats
from obsdesign.lmi.reduce import Reduced, between
from obsdesign.lmi.solve import Answer, Status, reduction
from obsdesign.records import dataclass, field

GRID = 1 - np.geomspace(1, 1e-3, 16)  # share of the way from the declared constant to the supremum
ROUNDED = 2e-5  # share of the objective below which gamma^2 is rounding
UNBOUNDED = 1e4  # times the declared constant, or 1: how far it is searched where there is no supremum
SHARP = 1e-6  # relative accuracy of the constant
EDGE = 3e-5  # .. and of the largest within bounds


@dataclass(frozen=True)
class Optimum:
    """Limit for one weight. At the weight 0 the constant, and at the weight 1 gamma, is arbitrary."""

    weight: float
    lipschitz: float
    gamma: float  # infinite at the weight 1
    attained: bool
    values: Values = field(default_factory=dict)
    searched: bool = False  # on a grid of constants

    @property
    def objective(self) -> float:
        """Return weight / lipschitz + (1 - weight) gamma^2."""
        return weighted(self.weight, self.lipschitz, self.gamma)

    @property
    def numbers(self) -> dict[str, Any]:
        """What is determined of it."""
        determined = {"lipschitz": self.lipschitz} if self.weight else {}
        if self.weight < 1:
            determined["gamma"] = self.gamma
        kind = BEST_FOUND if self.searched else {}
        return {**determined, "objective": self.objective, "attained": self.attained, **kind}


def weighted(weight: float, lipschitz: float, gamma: float) -> float:
    """Objective; what has no weight does not enter."""
    slow = weight / lipschitz if weight else 0.0
    return slow + ((1 - weight) * gamma**2 if weight < 1 else 0.0)


@dataclass(frozen=True)
class Front(ABC):
    """Limits of one relaxation at one rate, over the gains within bounds."""

    study: Study
    bounds: Bounds = NO_BOUNDS  # not on gamma

    @abstractmethod
    def optimum(self, weight: float, start: Values | None = None) -> Optimum | Status:
        """Limit for a weight; or why there is none, such as that no gain is within the bounds."""

    @abstractmethod
    def family(self, constant: float) -> Lipschitz:
        """Inequalities that the gains of the front satisfy for a constant that is no larger than theirs."""

    def gains(self, constant: fmpq, gamma: float) -> Iterator[tuple[Array, Claim | None]]:
        """Gains of small norm for a point that is a little worse than a limit, and their proofs."""
        yield from small_gains(self.study, self.family(float(constant)), constant, gamma)

    @property
    def declared(self) -> float:
        """Least constant."""
        return float(self.study.declared)

    def endless(self, weight: float, gamma: float) -> Optimum:
        """Limit where the constant grows without end. Raises `UsageError`: nothing bounds the gain."""
        if not self.study.restricted:
            raise unlimited(self.study)
        return Optimum(weight, math.inf, gamma, attained=False)

    @cached_property
    def supremum(self) -> Supremum:
        """Largest constant for which there is a gamma, over all gains."""
        return largest_for_gamma(self.study.engine, self.study.unit, self.study.relaxation)


class Direct(Front):
    """Theorem 4."""

    def family(self, constant: float) -> Theorem4:
        """Theorem 4 with xi <= 1 / constant."""
        return in_floats(recast(self.study.unit, Theorem4)).stretched(constant)

    def gains(self, constant: fmpq, gamma: float) -> Iterator[tuple[Array, Claim | None]]:
        """Those of the largest least eigenvalue of P, where nothing is bounded, before those of small norm."""
        if not self.bounds.restricted:
            family = self.family(float(constant) * (1 + ROOM))
            highest = family.problem(  # P >= -t I, at a gamma: Theorem 4 keeps P bounded
                [Unknown("t", (1, 1))],
                lambda v: {**v, **family.weights((gamma * (1 - ROOM)) ** 2 * ONE)},
                lambda v: [Inequality(LARGE, -v["t"] * family.eye - v["P"])],
                minimise="t",
            )
            answer = self.study.engine.minimise(highest)
            for L1 in rounded_gains(answer.values, self.bounds) if answer.status is Status.OPTIMAL else ():
                yield -L1, self.study.proved(-L1, constant, gamma, answer.values)
        yield from super().gains(constant, gamma)

    @cached_property
    def ends(self) -> tuple[Reduced, Reduced]:
        """Reductions at the weights 0 and 1: the objective is affine in the weight."""
        first = reduction(self.problem(0.0, self.bounds))
        return first, reduction(self.problem(1.0, self.bounds), first)

    def problem(self, weight: float, bounds: Bounds) -> Problem:
        """Minimise weight / lipschitz + (1 - weight) mu."""
        return self.family(self.declared).pareto(weight, 1 / self.study.constant_of(1.0), bounds)

    def optimum(self, weight: float, start: Values | None = None) -> Optimum | Status:
        """One problem; at the weight 1 over all gains the closed form."""
        if weight == 1 and not self.bounds.restricted:
            most = self.supremum.value
            return Optimum(weight, most, math.inf, attained=False) if most < math.inf else self.endless(1.0, math.inf)
        answer = self.solved(weight, start)
        if not weight:
            answer = settled(self.study.engine, self.family(self.declared), answer)
        if answer.status is not Status.OPTIMAL:
            return answer.status
        mu = answer.values["mu"].item() if weight else max(answer.objective, 0.0)
        certain = (1 - weight) * mu > ROUNDED * answer.objective
        gamma = math.inf if weight == 1 else math.sqrt(mu) if certain else 0.0
        constant = max(self.study.constant_of(answer.values["xi"].item()), self.declared)
        return Optimum(weight, constant, gamma, regular(answer.values["P"]), answer.values)

    def solved(self, weight: float, start: Values | None) -> Answer:
        """Optimum for a weight within the bounds."""
        engine = self.study.engine
        if self.bounds.L1 is not None:
            return bounded(lambda bounds, near: engine.minimise(self.problem(weight, bounds), near), self.bounds)
        problem = self.problem(weight, self.bounds)
        return engine.minimise(problem, start, between(*self.ends, weight))


class Searched(Front):
    """The s-procedure and the norm bound: the least gamma is a function of the constant."""

    def family(self, constant: float) -> Lipschitz:
        """The relaxation for the constant."""
        return self.study.attenuation(constant)

    @cached_property
    def known(self) -> dict[float, Answer]:
        """What was solved."""
        return {}

    def at(self, constant: float) -> Answer:
        """Least gamma^2 for a constant."""
        if constant not in self.known:
            engine, family = self.study.engine, self.family(constant)
            self.known[constant] = settled(engine, family, within(engine, family, self.bounds), self.bounds)
        return self.known[constant]

    def gamma(self, constant: float) -> float:
        """Least gamma for a constant; infinite if there is none."""
        answer = self.at(constant)
        return math.sqrt(max(answer.objective, 0.0)) if answer.status is Status.OPTIMAL else math.inf

    @cached_property
    def largest(self) -> float:
        """Supremum of the constant within the bounds."""
        low, high = self.declared, self.supremum.value
        if not self.bounds.restricted:
            return high
        high = min(high, UNBOUNDED * max(low, 1.0))
        return edge(lambda constant: self.gamma(constant) < math.inf, low, high, EDGE)

    @cached_property
    def grid(self) -> tuple[float, ...]:
        """Constants from the declared one up, denser towards the supremum."""
        low, high = self.declared, self.largest
        if high == math.inf:
            return tuple(map(float, np.geomspace(low or 1.0, UNBOUNDED * max(low, 1.0), len(GRID))))
        return tuple(float(low + (high - low) * share) for share in GRID if low or share)

    def optimum(self, weight: float, start: Values | None = None) -> Optimum | Status:  # noqa: ARG002
        """Grid over the constant, then a search between the neighbors of its best."""
        if weight == 1:
            return self.extreme()
        costs = [weighted(weight, constant, self.gamma(constant)) for constant in self.grid]
        best = int(np.argmin(costs))
        if costs[best] == math.inf:
            return self.at(self.grid[0]).status
        if weight and self.largest == math.inf and min(costs[best + 1 :], default=math.inf) == math.inf:
            return self.endless(weight, self.gamma(self.grid[best]))
        constant = self.grid[best] if not weight else self.between(weight, best)
        attained = regular(self.at(constant).values["P"])
        return Optimum(weight, constant, self.gamma(constant), attained, searched=bool(weight))

    def extreme(self) -> Optimum | Status:
        """Limit for the weight 1."""
        if self.largest == math.inf:
            return self.endless(1.0, math.inf)
        if self.bounds.restricted and self.at(self.largest).status is not Status.OPTIMAL:
            return self.at(self.largest).status
        return Optimum(1.0, self.largest, math.inf, attained=False)

    def between(self, weight: float, best: int) -> float:
        """Constant of the least objective about a point of the grid."""
        grid = (*self.grid, self.largest)

        def cost(constant: float) -> float:
            return weighted(weight, constant, self.gamma(constant))

        costs = {constant: cost(constant) for constant in self.grid}
        return Minimum(cost, grid[0], grid[-1], SHARP, 12, costs).between(grid[max(best - 1, 0)], grid[best + 1])[0]


def front(study: Study, bounds: Bounds) -> Front:
    """Front of a relaxation."""
    return (Direct if study.relaxation == "abbaszadeh" else Searched)(study, bounds)
