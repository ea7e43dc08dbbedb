"""Largest Lipschitz constants: for given gains, and over the gains within bounds."""

import math
from functools import cached_property

import numpy as np

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.elimination import LARGE, least_supply
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import Solve
from obsdesign.dissipation.scan import edge, strides
from obsdesign.families.lipschitz.relaxations import Lipschitz
from obsdesign.lmi.formula import Inequality, Problem, Unknown, Values
from obsdesign.lmi.solve import Answer, Status
from obsdesign.records import dataclass, replace
from obsdesign.riccati.form import Form

EDGE = 1e-6  # relative, of a constant that is found by bisection
STRIDE = 4.0  # between constants, until one holds and another does not
STRIDES = 10  # .. up from the scale: from there on any constant counts as tolerated
NONE = 1e-10  # least objective that is told from zero: the constant is not bounded


@dataclass(frozen=True)
class Stretch:
    """Largest constant c for which the error of a family without w and z converges at its rate.

    Theorems 1 and 2 minimise xi = 1 / c subject to X < -I and 2 l P <= xi I, l for the constant 1. The s-procedure
    with one block minimises lambda = 1 / c^2 subject to [X + Cq'M11 Cq, P Bf; ., -lambda I] <= 0, or of samples to
    V+ - rho^2 V + |M11^(1/2) Cq e|^2 - lambda |f|^2 <= 0. With several blocks c is found by bisection. The constants
    are those of the problem in units of `scale`.
    """

    engine: Engine
    family: Lipschitz  # without w and z, for the constant 1, in doubles

    @cached_property
    def scale(self) -> float:
        """Constant of f that is as large as the dynamics are fast, so that units do not matter."""
        p, whole = self.family.plant, self.family.lipschitz
        rate = float(np.linalg.norm(p.A + self.family.rate * self.family.eye, 2))
        return rate / whole if rate and whole else 1.0

    def objective(self, constant: float) -> float:
        """Objective of a constant."""
        return float((constant / self.scale) ** -self.family.power)

    def constant(self, answer: Answer) -> float:
        """Constant of an answer; infinite if any will do."""
        return float(self.scale * answer.objective ** (-1 / self.family.power)) if answer.objective > NONE else math.inf

    def least(self, bounds: Bounds, start: Values | None = None) -> Answer:
        """Least objective within the bounds on L1 and (Theorem 1) P >= t I."""
        known = None if bounds.restricted else self.eliminated
        if known is not None:
            return known
        direct = self.convex and bounds.poles is None  # whose multipliers are products with the constant
        return self.engine.minimise(self.problem(bounds), start) if direct else self.bisected(bounds)

    @cached_property
    def eliminated(self) -> Answer | None:
        """Least objective over all gains of a large plant by Riccati equations; None where these do not tell."""
        family = self.family.stretched(self.scale)
        p, sampled = family.plant, family.about.pace.sampled
        if p.n < LARGE or sampled or family.power == 1 or not self.convex:
            return None
        (block,) = family.multiplier.scaled_blocks()
        n, nf = p.Bf.shape
        Qc, Qm = np.zeros((2, n + nf, n + nf))
        Qc[:n, :n], Qm[n:, n:] = p.Cq.T @ block.M11 @ p.Cq, -np.eye(nf)
        form = Form(p.A + family.rate * family.eye, p.Bf, p.C, p.Df, Qc, Qm, np.zeros((0, *Qc.shape)))
        return least_supply(self.engine, form if family.L1 is None else form.injected(family.L1))

    def best(self) -> Answer:
        """Least objective over all gains, as accurate as can be."""
        return self.engine.minimise(self.problem(NO_BOUNDS), precise=True) if self.convex else self.bisected(NO_BOUNDS)

    def reaching(self, constant: float) -> Solve:
        """Least objective within bounds, as far as it takes to know whether it is that of a constant."""

        def feasible(bounds: Bounds, _: Values | None) -> Answer:
            return replace(self.feasible(constant, bounds), objective=self.objective(constant))

        return lambda bounds, start: (self.least if self.convex and bounds.poles is None else feasible)(bounds, start)

    @property
    def convex(self) -> bool:
        """Whether the largest constant is one problem."""
        return self.family.power == 1 or len(self.family.multiplier.blocks) == 1

    def problem(self, bounds: Bounds) -> Problem:
        """Minimise the objective, in one unknown xi."""
        family = self.family.stretched(self.scale)

        def inequalities(v: Values) -> list[Inequality]:
            return [*family.converging({**v, "Y": family.injected(v)}), *family.within(v, bounds)]

        p, limited = family.plant, family.gain_unknowns(bounds)
        gains = [] if family.L1 is not None else [Unknown("Y", p.C.mT.shape)]
        unknowns = (Unknown("P", p.A.shape, symmetric=True), *gains, Unknown("xi", (1, 1)), *limited)
        return Problem(unknowns, inequalities, lambda v: v["xi"])

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
        family = self.family.stretched(constant)
        problem = family.witness(1.0)
        within = replace(
            problem,
            unknowns=(*problem.unknowns, *family.gain_unknowns(bounds)),
            inequalities=lambda v: (*problem.inequalities(v), *family.within(v, bounds)),
        )
        return self.engine.widest(within)
