"""Largest Lipschitz constants: for given gains, and over the gains within bounds."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import Solve
from obsdesign.dissipation.inequality import ONE
from obsdesign.dissipation.scan import edge, strides
from obsdesign.families.lipschitz.relaxations import Lipschitz, Unstructured
from obsdesign.lmi.formula import Inequality, Problem, Unknown, Values
from obsdesign.lmi.solve import Answer, Status

EDGE = 1e-6  # relative, of a constant that is found by bisection
STRIDE = 4.0  # between constants, until one holds and another does not
STRIDES = 10  # .. up from the scale: from there on any constant counts as tolerated
NONE = 1e-10  # least objective that is told from zero: the constant is not bounded


@dataclass(frozen=True)
class Stretch:
    """Largest constant c for which the error of a family without w and z converges at its rate.

    Theorems 1 and 2 minimise xi = 1 / c subject to X < -I and 2 l P <= xi I, l for the constant 1. The s-procedure
    with one block minimises lambda = 1 / c^2 subject to [X + Cq'M11 Cq, P Bf; ., -lambda I] <= 0. With several blocks
    c is found by bisection. The constants are those of the problem in units of `scale`.
    """

    engine: Engine
    family: Lipschitz  # without w and z, for the constant 1, in doubles

    @property
    def power(self) -> int:
        """The objective is c to minus this."""
        return 1 if isinstance(self.family, Unstructured) else 2

    @cached_property
    def scale(self) -> float:
        """Constant of f that is as large as the dynamics are fast, so that units do not matter."""
        p, whole = self.family.plant, self.family.lipschitz
        rate = float(np.linalg.norm(p.A + self.family.alpha * self.family.eye, 2))
        return rate / whole if rate and whole else 1.0

    def objective(self, constant: float) -> float:
        """Objective of a constant."""
        return float((constant / self.scale) ** -self.power)

    def constant(self, answer: Answer) -> float:
        """Constant of an answer; infinite if any will do."""
        return float(self.scale * answer.objective ** (-1 / self.power)) if answer.objective > NONE else math.inf

    def least(self, bounds: Bounds, start: Values | None = None) -> Answer:
        """Least objective within the bounds on L1 and (Theorem 1) P >= t I."""
        return self.engine.minimise(self.problem(bounds), start) if self.convex else self.bisected(bounds)

    def reaching(self, constant: float) -> Solve:
        """Least objective within bounds, as far as it takes to know whether it is that of a constant."""

        def feasible(bounds: Bounds, _: Values | None) -> Answer:
            return replace(self.feasible(constant, bounds), objective=self.objective(constant))

        return self.least if self.convex else feasible

    @property
    def convex(self) -> bool:
        """Whether the largest constant is one problem."""
        return self.power == 1 or len(self.family.multiplier.blocks) == 1

    def problem(self, bounds: Bounds) -> Problem:
        """Minimise the objective, in one unknown xi."""
        family = self.family.stretched(self.scale)
        rates = self.by_norm if isinstance(family, Unstructured) else self.by_scale

        def inequalities(v: Values) -> list[Inequality]:
            return [*rates(family, {**v, "Y": family.injected(v)}), *family.within(v, bounds)]

        p, limited = family.plant, family.gain_unknowns(bounds)
        gains = [] if family.L1 is not None else [Unknown("Y", p.C.mT.shape)]
        unknowns = (Unknown("P", p.A.shape, symmetric=True), *gains, Unknown("xi", (1, 1)), *limited)
        return Problem(unknowns, inequalities, lambda v: v["xi"])

    def by_norm(self, family: Lipschitz, v: Values) -> list[Inequality]:
        """X < -I and P <= xi / (2 l) I."""
        assert isinstance(family, Unstructured)
        small = Inequality("2 l P <= xi I", 2 * family.lipschitz * v["P"] - v["xi"] * family.eye)
        return [family.convergence(v, ONE), small, Inequality("P > 0", -v["P"], strict=True)]

    def by_scale(self, family: Lipschitz, v: Values) -> list[Inequality]:
        """[X + Cq'M11 Cq, P Bf; ., -xi I] <= 0."""
        (block,) = family.multiplier.scaled_blocks()
        Cq = family.plant.Cq
        forced = family.stretched(0.0).dissipation({**v, "lambda1": v["xi"]}, Cq.mT @ block.M11 @ Cq, ONE)
        return [
            Inequality(family.about.decrease, forced, strict=not family.alpha),
            Inequality("P > 0", -v["P"], strict=True),
        ]

    def bisected(self, bounds: Bounds) -> Answer:
        """Largest constant of several blocks, with the point of widest margin at nearly that."""
        known: dict[float, Answer] = {}

        def holds(constant: float) -> bool:
            known[constant] = self.feasible(constant, bounds)
            return known[constant].status is Status.OPTIMAL

        low, high = strides(holds, self.scale, STRIDE, STRIDES)
        if low is None:
            return known[min(known)]
        if high is None:
            return replace(known[low], objective=0.0)
        low = edge(holds, low, high, EDGE)
        return replace(known[low], objective=self.objective(low))

    def feasible(self, constant: float, bounds: Bounds) -> Answer:
        """Point of largest margin at a constant, within bounds."""
        problem = self.family.stretched(constant).witness(1.0)
        within = replace(
            problem,
            unknowns=(*problem.unknowns, *self.family.gain_unknowns(bounds)),
            inequalities=lambda v: (*problem.inequalities(v), *self.family.within(v, bounds)),
        )
        return self.engine.widest(within)
