"""What an observer achieves by clock-dependent certificates: the solver proposes witnesses, rationals decide.

A search takes one solve, in the scaling of its data, and believes it: what is shipped is proved later.
"""

import math
from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np
from flint import fmpq

from obsdesign.dissipation.decimals import round_up
from obsdesign.dissipation.engine import Engine
from obsdesign.families.sporadic.clock.bernstein import SHAPE, Clock, Shape, clock
from obsdesign.families.sporadic.clock.theorem import DECREASE, SETTLES, ClockTheorem, ErrorSystem
from obsdesign.families.sporadic.clock.tied import tied
from obsdesign.families.sporadic.clock.units import ErrorUnits, error_units
from obsdesign.families.sporadic.clock.witness import GOALS, Goal, Witness
from obsdesign.lmi.equilibrate import Scales
from obsdesign.lmi.formula import Array, Float, Inequality, Problem, Unknown, Values, printed
from obsdesign.lmi.probe import Program, matrices, probe
from obsdesign.lmi.proof import with_digits
from obsdesign.lmi.reduce import Reduced, balance, balanced, balancing, reduce
from obsdesign.lmi.solve import Search, Status, homogeneous, unscaled, violation, with_margin
from obsdesign.lmi.solvers import Ending, call
from obsdesign.lmi.spectrum import extremes, lower
from obsdesign.model.multiplier import Multiplier
from obsdesign.records import dataclass, field, replace

ONE = np.ones((1, 1))
VIOLATION, RELATIVE = 1e-5, 1e-7  # of a constraint that a search tolerates, the latter relative to the unknowns
MAGNIFIED = 100.0  # constant terms, at least, of a second solve: a solver loses them beside large unknowns
FEASIBLE = 1e-7  # normalised margin above which there is a solution
DOUBTFUL = 1e-8, 1e-5  # margins about that, of a quick solve, that are solved for more accurately
BACKOFFS = (1e-3, 5e-3, 2e-2, 0.1)  # of the least number that a claim needs
DIGITS = (8, 12, 17)  # of a witness
ROOM = 1e-6  # relative, of numbers that follow from P
NOTHING: Mapping[str, fmpq] = MappingProxyType({})


@dataclass(frozen=True)
class Found:
    """Outcome of one solve; without values there is none."""

    objective: float = math.inf
    values: Values | None = None


@dataclass(frozen=True)
class Slope:
    """Least mu and its derivatives with respect to the matrices F and J of an error; infinite where there is none."""

    mu: float = math.inf
    flow: Float = field(default_factory=lambda: np.zeros((0, 0)))
    jump: Float = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True)
class Analysis:
    """An observer's error, in rationals, for intervals from T1 on."""

    engine: Engine
    system: ErrorSystem
    multiplier: Multiplier
    T1: fmpq
    shape: Shape = SHAPE
    clock: Clock | None = None  # of a K that depends on the interval: that of K

    def theorem(self, T2: fmpq, decay: fmpq) -> ClockTheorem:
        """The inequalities for a longest interval and a rate."""
        s = self.shape
        pieces = self.clock or clock(self.T1, T2, s.degree, s.segments, s.lookahead)
        loose = not self.T1 and not self.system.kept and self.system.J.dtype == object
        held = tied(self.system.J) if loose else None
        return ClockTheorem(self.system, self.multiplier, pieces, self.T1, decay, s.lookahead, held)

    # Searches

    def least(self, goal: Goal, T2: fmpq, decay: fmpq) -> Found:
        """Least number of a claim, mu, r or kappa; without values there is none."""
        _, units, theorem = self.asked(goal, T2, decay)
        found = self.solved(least_problem(goal, theorem, units))
        return Found(units.number(goal.least) * found.objective, found.values)

    def asked(self, goal: Goal, T2: fmpq, decay: fmpq) -> tuple[ClockTheorem, ErrorUnits, ClockTheorem]:
        """Theorem of a claim, the units in which a solver is asked, and the theorem in these, in doubles."""
        exact = goal.theorem(self.theorem(T2, decay))
        units = error_units(exact.doubles.system, float(T2), weighed=goal.weighed)
        return exact, units, units.theorem(exact.doubles)

    def slope(self, T2: fmpq, decay: fmpq) -> Slope:
        """Least mu of gamma, and its derivatives with respect to F and J, from the dual matrices of (F) and (J).

        If Z_k are those of (F)_k at the optimum and P_k the control values there, d mu / dF = 2 sum_k P_k Z_k, each Z_k
        without the rows of w and f; likewise 2 sum P(tau) J Z over the pairs of (J).
        """
        _, units, theorem = self.asked(GOALS["gamma"], T2, decay)
        problem = least_problem(GOALS["gamma"], theorem, units)
        found, duals = self.with_duals(problem)
        if found.values is None:
            return Slope()
        P, J, m = theorem.P(found.values), theorem.system.J, theorem.system.order
        flow, jump = np.zeros((m, m)), np.zeros((m, m))
        stacks = zip(theorem.clock.on(P).reshape(-1, m, m), named(duals, DECREASE), strict=True)
        for at, Z in stacks:
            flow += 2 * at @ Z[:m, :m]
        after = np.concatenate([A for _, A in theorem.followed(P)])
        for at, Z in zip(after, named(duals, SETTLES), strict=True):
            jump += 2 * at @ J @ Z[:m, :m]
        mu, inner = units.number("mu"), units.x / units.x[:, None]
        return Slope(mu * found.objective, mu * units.time * inner * flow, mu * inner * jump)

    def with_duals(self, problem: Problem) -> tuple[Found, dict[str, Array]]:
        """One solve, with the dual matrix of every inequality, by its name."""
        program = probe(problem)
        plain = Scales(tuple(np.ones(b.order) for b in program.blocks), np.ones(len(program.cost)))
        reduced = reduce(problem, program, plain)
        if reduced.contradiction:
            return Found(), {}
        rows, factors = balancing(reduced.program)
        search = Search(call(self.engine.solver, quick=True))
        found = self.solved(problem, reduced, search, (rows, factors))
        if found.values is None:
            return found, {}
        duals = {b.name: np.zeros((b.order, b.order)) for b in program.blocks}
        for block, row, Z in zip(reduced.program.blocks, rows, search.duals, strict=True):
            gone = [i for name, i in reduced.rows if name == block.name]
            kept = np.delete(np.arange(len(duals[block.name])), gone)
            duals[block.name][np.ix_(kept, kept)] = row[:, None] * Z * row
        return found, duals

    def gamma(self, T2: fmpq, decay: fmpq) -> float:
        """Least gain from w to z; infinite if none is found."""
        return math.sqrt(max(self.least(GOALS["gamma"], T2, decay).objective, 0.0))

    def margin(self, T2: fmpq, decay: fmpq, *, quick: bool = False) -> float:
        """Largest normalised margin of the inequalities without w and z: there is a solution iff it is positive.

        `quick`: whether a quick solve does, where its margin is not doubtful.
        """
        *_, theorem = self.asked(GOALS["overshoot"], T2, decay)
        fixed = {"weight": 0 * ONE, "mu": 0 * ONE, "floor": 0 * ONE}
        problem = Problem(theorem.unknowns, lambda v: theorem.inequalities({**v, **fixed}))
        reduced = reduce(problem)
        t = self.widest(reduced, quick=True)[1] if quick else -math.inf
        return t if t > DOUBTFUL[1] or -math.inf < t < DOUBTFUL[0] else self.widest(reduced)[1]

    def solved(
        self,
        problem: Problem,
        reduced: Reduced | None = None,
        search: Search | None = None,
        scales: tuple[list[Array], Array] | None = None,
    ) -> Found:
        """One solve; what is known of it is not made again."""
        reduced = reduced or reduce(problem)
        if reduced.contradiction:
            return Found()
        scaled, T = balanced(reduced.program, *(scales or balancing(reduced.program)))
        ending, y = self.careful(scaled, search or Search(call(self.engine.solver, quick=True)))
        z = unscaled(T, y)
        if (
            ending in {Ending.INFEASIBLE, Ending.IMPROPER}
            or not np.isfinite(z).all()
            or violation(scaled, y) > max(VIOLATION, RELATIVE * np.abs(y).max())
        ):
            return Found()
        values = matrices(problem.unknowns, reduced.point(z))
        return Found(reduced.program.constant + float(reduced.program.cost @ z), values)

    def optimum(self, problem: Problem) -> Found:
        """Same, by solves in different scalings that agree."""
        answer = self.engine.minimise(problem)
        return Found(answer.objective, answer.values) if answer.status is Status.OPTIMAL else Found()

    def solve(self, program: Program, search: Search) -> tuple[Ending, Array]:
        """One call of the solver, counted."""
        self.engine.solves += 1
        return search.solve(program)

    def careful(self, program: Program, search: Search) -> tuple[Ending, Array]:
        """One call, and where it breaks down another one with larger constant terms; the more accurate of the two."""
        ending, y = self.solve(program, search)
        doubtful, duals = {Ending.INACCURATE, Ending.STALLED, Ending.FAILED}, search.duals
        if ending not in doubtful or not np.isfinite(y).all():
            return ending, y
        factor = max(MAGNIFIED, math.sqrt(np.abs(y).max()))
        again, x = self.solve(magnified(program, factor), search)
        if again in {Ending.SOLVED, *doubtful} and violation(program, x / factor) < violation(program, y):
            return again, x / factor
        search.duals = duals
        return ending, y

    def widest(self, reduced: Reduced, *, quick: bool = False) -> tuple[Array, float]:
        """Point of the largest normalised margin, and the margin, by one solve."""
        scaled, T = balance(homogeneous(reduced.program))
        ending, y = self.solve(with_margin(scaled), Search(call(self.engine.solver, quick=quick)))
        *z, size = unscaled(T, y[:-1])
        t = float(y[-1])
        broken = ending is Ending.FAILED or not np.isfinite([*z, size, t]).all() or size <= 0
        return reduced.point(np.array(z) / (size if size > 0 else 1.0)), -math.inf if broken else t

    # Proofs

    def prove(
        self,
        goal: Goal,
        T2: fmpq,
        decay: fmpq,
        found: Found | None = None,
        given: Mapping[str, fmpq] = NOTHING,
        *,
        quick: bool = False,
    ) -> Witness | None:
        """Witness of nearly the least number; the last attempt if none holds, None if there is none.

        `found`: the least number, if it is known; `given`: other numbers of the claim; `quick`: as of `witness`.
        """
        if goal.least == "mu" and not self.system.Bx.shape[1]:
            return self.witness(goal, T2, decay, {"mu": fmpq(0)})
        if found is None:
            _, units, theorem = self.asked(goal, T2, decay)
            problem = least_problem(goal, theorem, units, given)
            one = self.solved(problem)
            found = one if one.values is not None else self.optimum(problem)  # one solve was not enough
            found = Found(units.number(goal.least) * found.objective, found.values)
        if found.values is None:
            return None
        witness = None
        for backoff in BACKOFFS:
            numbers = {**given, goal.least: number(found.objective, backoff)}
            witness = self.witness(goal, T2, decay, numbers, quick=quick)
            if witness and witness.holds:
                break
        return witness

    def witness(
        self, goal: Goal, T2: fmpq, decay: fmpq, numbers: Mapping[str, fmpq], *, quick: bool = False
    ) -> Witness | None:
        """Witness for the numbers of a claim; the last attempt if none holds, None if there is none.

        `quick`: whether a quick solve is tried first, which does for a proof that is not near its edge.
        """
        exact, units, theorem = self.asked(goal, T2, decay)
        fixed = in_units({**goal.fixed(ONE), **in_matrices(numbers, units)}, units.unity)
        reduced = reduce(Problem(theorem.unknowns, lambda v: theorem.inequalities({**fixed, **v})))
        witness = None
        for rough in (True, False) if quick else (False,):
            point, t = self.widest(reduced, quick=rough)
            for P, M in written(exact, units, matrices(theorem.unknowns, point)) if t > 0 else ():
                size = {"r": largest(P)} if "r" in goal.also else {}
                witness = Witness(goal, replace(exact, tied=None), {**numbers, **size}, P, M)
                if goal.normal and units.far:
                    witness = normalised(witness)
                if witness.holds:
                    return witness
        return witness


def written(exact: ClockTheorem, units: ErrorUnits, v: Values) -> Iterator[tuple[Array, dict[str, Array]]]:
    """P and the multipliers of a solution in the units of the spec, in more and more digits."""
    theorem = units.theorem(exact.doubles)
    for digits in DIGITS:
        P, M = with_digits(units.storage(theorem.P(v)), digits), units.multipliers(theorem.multipliers(v))
        M = {name: with_digits(stack, digits) for name, stack in M.items()}
        if exact.tied:
            P[0, 0] = exact.first(with_digits(units.V * v["P0"], digits))
        yield P, M


def in_units(v: Values, unity: Float) -> dict[str, Array]:
    """Numbers of which those that bound P are multiples of I of the spec."""
    return {name: value * unity if name in {"floor", "r"} else value for name, value in v.items()}


def least_problem(goal: Goal, theorem: ClockTheorem, units: ErrorUnits, given: Mapping[str, fmpq] = NOTHING) -> Problem:
    """Minimise the number of a claim, others given; without w the least mu is zero."""
    fixed = {**goal.fixed(ONE), **in_matrices(given, units)}

    def inequalities(v: Values) -> list[Inequality]:
        found = theorem.inequalities(in_units({**fixed, **v}, units.unity))
        return [*found, Inequality("mu >= 0", -v["mu"])] if "mu" in v and not theorem.system.Bx.shape[1] else found

    unknowns = *theorem.unknowns, Unknown(goal.least, (1, 1))
    return Problem(unknowns, inequalities, lambda v: v[goal.least])


def in_matrices(numbers: Mapping[str, fmpq], units: ErrorUnits) -> dict[str, Array]:
    """Numbers as 1x1 matrices, in doubles and in units."""
    return {name: np.array([[float(value) / units.number(name)]]) for name, value in numbers.items()}


def magnified(program: Program, size: float) -> Program:
    """Program for unknowns that are so many times as large; its dual solution is the same."""
    factor = np.array([size, *np.ones(len(program.cost))])[:, None, None]
    return replace(program, blocks=tuple(replace(b, terms=factor * b.terms) for b in program.blocks))


def named(duals: Mapping[str, Array], name: str) -> list[Array]:
    """Dual matrices of an inequality at all of its control values, in their order."""
    return [Z for key, Z in duals.items() if key.startswith(name)]


def number(least: float, backoff: float) -> fmpq:
    """Decimal a little above the least number that there is a solution for: mu of a gamma of few digits."""
    root = printed(round_up(math.sqrt(max(least, 0.0)) * (1 + backoff), 6))
    return root * root


def normalised(witness: Witness) -> Witness:
    """Witness with P >= I, of one with P > 0 of a claim that is homogeneous in P, the multipliers and the numbers."""
    least = min(lower(extremes(P)[0]) for P in witness.P.reshape(-1, *witness.P.shape[-2:]))
    if least <= 0:
        return witness
    factor = printed(round_up(1 / least, 6))
    P, M = factor * witness.P, {name: factor * stack for name, stack in witness.multipliers.items()}
    numbers = {name: factor * value for name, value in witness.numbers.items()}
    return replace(witness, numbers={**numbers, **({"r": largest(P)} if "r" in numbers else {})}, P=P, multipliers=M)


def largest(P: Array) -> fmpq:
    """Decimal a little above the largest eigenvalue of control values of P."""
    return printed(round_up(float(np.linalg.eigvalsh(P.astype(float))[..., -1].max()) * (1 + ROOM), 6))
