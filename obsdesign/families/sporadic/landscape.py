"""The least gamma, and what is missing for feasibility, as functions of the exponent delta.

A search takes one solve a point, in the scaling of its data, and believes it: what a design ships is proved later.
"""

import math
from collections.abc import Callable

import numpy as np

from obsdesign.dissipation.bounds import Range
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.scan import Minimum
from obsdesign.families.sporadic.relaxations import UNBOUNDED, Bound, Relaxation, WithGains
from obsdesign.families.sporadic.theorem import Sporadic
from obsdesign.lmi.equilibrate import Scales, scales
from obsdesign.lmi.formula import Array, Problem, Values
from obsdesign.lmi.probe import Block, Program, matrices, probe
from obsdesign.lmi.reduce import reduce
from obsdesign.lmi.solve import Search, unscaled, violation
from obsdesign.lmi.solvers import Ending, call
from obsdesign.records import dataclass, field, replace

Form = Callable[[Sporadic], Relaxation]
LEAST_DELTA = 1.001  # least delta / (2 lambda_t) of a relaxation that needs delta > 2 lambda_t
LARGEST = 60.0  # of delta T2
CLOSE = 1.2  # bracket of the best delta about that of a neighbor
VALLEYS = 4  # points of the whole range that guard a search nearby where there may be several valleys
GUARD = 9  # points of the whole range where a search nearby finds nothing
MISSING = -1e-6  # what is missing is negative, beyond the noise of a solver (about 2e-8)
VIOLATION = 5e-5  # of a constraint that a search tolerates, in units of the data, whatever the solver says


@dataclass(frozen=True)
class Optimum:
    """Outcome of one solve; without values there is none."""

    objective: float = math.inf
    values: Values = field(default_factory=dict)

    @property
    def found(self) -> bool:
        """Whether there is a solution."""
        return bool(self.values)


def solve_once(
    engine: Engine,
    relaxation: Relaxation,
    problem: Problem,
    program: Program | None = None,
    scaling: Scales | None = None,
) -> Optimum:
    """One solve, in the scaling of its data; nothing found is no proof that there is nothing."""
    reduced = reduce(problem, program, scaling)
    if reduced.contradiction:
        return Optimum()
    scaled, T = relaxation.scaled(problem, reduced.program)
    search = Search(call(engine.solver))
    ending, y = search.solve(scaled)
    engine.solves += 1
    z = unscaled(T, y)
    if ending in {Ending.INFEASIBLE, Ending.IMPROPER} or not np.isfinite(z).all() or violation(scaled, y) > VIOLATION:
        return Optimum()
    objective = reduced.program.constant + float(reduced.program.cost @ z)
    return Optimum(objective, matrices(problem.unknowns, reduced.point(z)))


class Pieces:
    """A problem affine in 1, delta, r and delta r: probed at four points, put together at any other."""

    def __init__(self, problem: Callable[[float, float], Problem]) -> None:
        self.problem = problem(0.0, 0.0)
        corners = [probe(problem(delta, ratio)) for delta in (0.0, 1.0) for ratio in (0.0, 1.0)]
        self.program, self.scales = corners[0], scales(self.problem)
        self.terms = [combined(terms) for terms in zip(*([b.terms for b in c.blocks] for c in corners), strict=True)]

    def at(self, delta: float, ratio: float) -> Program:
        """The probed problem at one point."""
        weights = np.array([1.0, delta, ratio, delta * ratio])
        blocks = tuple(
            Block(block.name, np.tensordot(weights, terms, axes=1), block.strict)
            for block, terms in zip(self.program.blocks, self.terms, strict=True)
        )
        return replace(self.program, blocks=blocks)


def combined(corners: tuple[Array, ...]) -> Array:
    """Coefficients of 1, delta, r and delta r from the values at (0, 0), (0, 1), (1, 0) and (1, 1)."""
    origin, ratio, delta, both = corners
    return np.stack([origin, delta - origin, ratio - origin, both - delta - ratio + origin])


@dataclass
class Landscape:
    """One relaxation as a function of delta and T2, in the units of the spec, which it takes to those of the search."""

    engine: Engine
    family: Sporadic  # in doubles, in the units
    form: Form
    range: Range  # of delta
    kappa: float | None = None  # bound on |L|
    pieces: Pieces | None = None
    exponent: float | None = None  # delta T2 of the last minimum

    @property
    def interval(self) -> tuple[float, float]:
        """Where delta is searched."""
        low, high = float(self.range.low), float(self.range.high)
        above = self.form(self.family).delta_above_decay  # delta > 2 lambda_t is necessary
        return (max(low, 2 * LEAST_DELTA * self.family.decay / self.family.units.time) if above else low), high

    def relaxation(self, delta: float, T2: float) -> Relaxation:
        """The relaxation at one point."""
        return self.form(replace(self.family, delta=delta * self.family.units.time, ratio=math.exp(delta * T2)))

    def with_gains(self, delta: float, T2: float) -> WithGains:
        """The relaxation at one point, of a form that has the gains in it."""
        relaxation = self.relaxation(delta, T2)
        assert isinstance(relaxation, WithGains)
        return relaxation

    def least(self, relaxation: Relaxation) -> Problem:
        """Least gamma within the bound on |L|."""
        return relaxation.least_gamma(self.bound(relaxation))

    def bound(self, relaxation: Relaxation) -> Bound:
        """Bound on |L|, if there is one: the form has the gains in it then."""
        if self.kappa is None:
            return UNBOUNDED
        assert isinstance(relaxation, WithGains)
        return relaxation.bound(self.kappa)

    # Functions of delta

    def gamma(self, delta: float, T2: float) -> float:
        """Least gamma, by one solve."""
        if delta * T2 > LARGEST:
            return math.inf
        if self.pieces is None:
            self.pieces = Pieces(lambda d, r: self.least(self.form(replace(self.family, delta=d, ratio=r))))
        relaxation, program = (
            self.relaxation(delta, T2),
            self.pieces.at(delta * self.family.units.time, math.exp(delta * T2)),
        )
        return root(solve_once(self.engine, relaxation, self.pieces.problem, program, self.pieces.scales))

    def missing(self, delta: float, T2: float) -> float:
        """What is missing for feasibility at any gamma, by one solve."""
        if delta * T2 > LARGEST:
            return math.inf
        relaxation = self.relaxation(delta, T2)
        return solve_once(self.engine, relaxation, relaxation.elastic(self.bound(relaxation))).objective

    # Minima over delta

    def least_gamma(self, T2: float, exponent: float | None = None) -> tuple[float, float]:
        """Best delta and least gamma, near an exponent delta T2 or in the whole range.

        With a bound on |L| the curve may have several valleys, so that a coarse grid guards the search nearby.
        """
        search = Minimum(lambda delta: self.gamma(delta, T2), *self.interval, width=CLOSE)
        if exponent is None or math.isinf(search.near(exponent / T2)[1]):
            search.everywhere(self.range.points)
        elif self.kappa is not None:
            search.everywhere(VALLEYS)
        return search.best

    def least_missing(self, T2: float) -> float:
        """What is missing for feasibility at the best delta; a delta at which nothing is will do."""
        search = Minimum(lambda delta: self.missing(delta, T2), *self.interval)
        if self.exponent is not None and search.at(self.exponent / T2) >= MISSING:
            search.near(self.exponent / T2)
        if not search.values or search.best[1] >= MISSING:
            search.everywhere(GUARD)
        delta, value = search.best
        self.exponent = delta * T2
        return value - MISSING


def root(found: Optimum) -> float:
    """Square root of an objective; infinite if there is none."""
    return math.sqrt(max(found.objective, 0.0)) if found.found else math.inf
