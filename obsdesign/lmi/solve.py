"""A problem in, an answer with a status out.

"Optimal" is never a proof here: what a solver returns is a proposal, and `proof` decides.
"""

from collections.abc import Callable
from enum import StrEnum

import numpy as np

from obsdesign.lmi.formula import Array, Problem, Values
from obsdesign.lmi.probe import Block, Program, coordinates, matrices
from obsdesign.lmi.reduce import Reduced, balance, dense, diagonal, reduce
from obsdesign.lmi.solvers import Ending, Solver, call
from obsdesign.records import dataclass, field, replace

MARGIN = 1e-8  # phase I: a largest normalised margin above this is feasible
NOISE = 1e-9  # .. and one below this is none (solver noise is about 5e-11)
AGREE = 1e-5  # two solves in different scalings agree to this, relative, before an optimum is believed
CLOSE = 1e-3  # .. or, where more solves do not bring that, the two best of them to this
SWEEPS = 5  # solves, each in the scaling of the last solution
WIDE = 1e-4  # a margin above this needs no other scaling
PATIENCE = 2  # scalings that are tried before phase I says that there is no margin
VIOLATION = 1e-6  # of a constraint, where its slack is scaled to 1


class Status(StrEnum):
    """What is known of a problem after it was solved."""

    OPTIMAL = "optimal"
    INFEASIBLE = "infeasible"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Answer:
    """Outcome of a problem; objective and values mean something if the status is optimal."""

    status: Status
    objective: float = 0.0
    values: dict[str, Array] = field(default_factory=dict)
    ending: Ending = Ending.SOLVED  # of the last solve
    contradiction: str = ""  # that was found before any solve
    solves: int = 0
    gap: float | None = None  # relative, of the root of the objective, where it is known

    @property
    def reason(self) -> str:
        """Why there is no optimum, in words."""
        return self.contradiction or str(self.ending)


Scaling = Callable[[Program, Array], tuple[Program, Array]]  # about a point; z = T scaled z


def reduction(problem: Problem, like: Reduced | None = None) -> Reduced:
    """Probe and reduce a problem, in the scales of another."""
    return reduce(problem, scaling=like.scales if like else None)


def minimise(
    problem: Problem,
    solver: str = "clarabel",
    start: Values | None = None,
    reduced: Reduced | None = None,
    *,
    precise: bool = False,
) -> Answer:
    """Solve a problem; what was projected out is zero in the answer.

    A start is the solution of a problem nearby. In its scaling one solve is believed, where otherwise two in
    different scalings must agree. A reduction that is known already is not made again. A precise optimum is solved anew
    where its slack is the identity: an objective that is small beside the data is then as accurate as they are.

    Raises `UsageError` if the solver is not installed.
    """
    reduced = reduced or reduction(problem)
    if reduced.contradiction:
        return Answer(Status.INFEASIBLE, contradiction=reduced.contradiction)
    search = Search(call(solver))
    z = None if start is None else reduced.near(coordinates(problem.unknowns, start))
    status, z = search.optimum(reduced.program, z)
    if precise and status is Status.OPTIMAL:
        polished, closer = search.sweep(reduced.program, z, dense)
        z = closer if polished is Status.OPTIMAL else z
    return answer(problem, reduced, status, z, search)


def widest(problem: Problem, solver: str = "clarabel", start: Values | None = None) -> Answer:
    """Phase I: the point of largest normalised margin t, F + t I <= 0; its objective is t.

    The inequalities are homogenised (their constant part gets a factor s >= t) and normalised by the trace of
    -F, so that t is at most 1 and is compared with `MARGIN`.
    """
    reduced = reduction(problem)
    if reduced.contradiction:
        return Answer(Status.INFEASIBLE, contradiction=reduced.contradiction)
    search = Search(call(solver))
    z = None if start is None else reduced.near(coordinates(problem.unknowns, start))
    t, z = search.margin(reduced.program, z)
    return replace(answer(problem, reduced, verdict(t), z, search), objective=t)


def marginless(problem: Problem, solver: str = "clarabel") -> tuple[bool, int]:
    """Whether phase I finds no margin in two scalings, and how many solves that took.

    Where there is none by far, its point is zero: no scaling is about it, and further solves break down in `widest`.
    """
    reduced = reduction(problem)
    if reduced.contradiction:
        return True, 0
    search, lifted = Search(call(solver)), homogeneous(reduced.program)
    believed: tuple[Ending, ...] = (Ending.SOLVED,)
    scaled, T = balance(lifted)
    for _ in range(2):
        ending, x = search.solve(with_margin(scaled))
        if ending not in believed or not x[-1] <= NOISE:
            return False, search.solves
        believed = (Ending.SOLVED, Ending.INACCURATE)
        scaled, T = diagonal(lifted, unscaled(T, x[:-1]))
    return True, search.solves


def answer(problem: Problem, reduced: Reduced, status: Status, z: Array, search: "Search") -> Answer:
    """Return to the terms of the problem."""
    objective = reduced.program.constant + float(reduced.program.cost @ z)
    values = matrices(problem.unknowns, reduced.point(z))
    return Answer(status, objective, values, search.ending, solves=search.solves)


class Search:
    """Solves of one program in changing scalings, counted."""

    def __init__(self, solver: Solver) -> None:
        self.solver = solver
        self.solves = 0
        self.ending = Ending.SOLVED
        self.duals: tuple[Array, ...] = ()  # of the last solve

    def solve(self, program: Program) -> tuple[Ending, Array]:
        """One call of the solver, with a cost of unit size: its gap has an absolute tolerance."""
        self.solves += 1
        largest = np.abs(program.cost).max(initial=0.0) or 1.0
        self.ending, z, duals = self.solver(replace(program, cost=program.cost / largest))
        self.duals = tuple(largest * Z for Z in duals)
        return self.ending, z

    def optimum(self, program: Program, start: Array | None = None) -> tuple[Status, Array]:
        """Optimum in diagonal scalings or else in dense ones; infeasible only if phase I finds no margin in either."""
        for scale in (diagonal,) if start is None else (diagonal, dense):
            status, z = self.sweep(program, start, scale)
            if status is Status.OPTIMAL:
                return status, z
        t, point = self.margin(program)
        if verdict(t) is Status.INFEASIBLE:
            return Status.INFEASIBLE, z
        for center in (z, point):
            if np.isfinite(center).all() and center.any():
                status, found = self.sweep(program, center, dense)
                if status is Status.OPTIMAL:
                    return status, found
        return Status.UNDECIDED, z

    def sweep(self, program: Program, start: Array | None, scale: Scaling) -> tuple[Status, Array]:
        """Solve, then solve again in the scaling of the solution until two objectives agree."""
        scaled, T = balance(program) if start is None else scale(program, start)
        found: list[tuple[float, Array]] = []
        z = np.zeros(len(program.cost))
        for _ in range(SWEEPS):
            ending, y = self.solve(scaled)
            z = unscaled(T, y)
            if ending is Ending.SOLVED and np.isfinite(z).all() and violation(scaled, y) <= VIOLATION:
                found.append((float(program.cost @ z) + program.constant, z))
                believed = len(found) > 1 and agree(found[-1][0], found[-2][0], AGREE)
                if believed or (start is not None and self.solves == 1):
                    return Status.OPTIMAL, z
            elif not found and ending is not Ending.SOLVED and self.solves == 1:
                break
            if not np.isfinite(z).all() or not z.any():
                break
            scaled, T = scale(program, z)
        close = len(found) > 1 and agree(found[-1][0], found[-2][0], CLOSE)
        return (Status.OPTIMAL if close else Status.UNDECIDED), (found[-1][1] if close else z)

    def margin(self, program: Program, start: Array | None = None) -> tuple[float, Array]:
        """Largest t with F(z / s) s + t I <= 0, s >= t, trace normalised, and z / s; t is -inf if none was solved."""
        lifted = homogeneous(program)
        best, point = -np.inf, np.zeros(len(lifted.cost))
        begin = point if start is None else np.append(start, 1.0)
        for scale, again in ((diagonal, False), (dense, False), (dense, True)):
            center = point if again else begin
            scaled, T = scale(lifted, center) if center.any() else balance(lifted)
            for sweep in range(SWEEPS):
                ending, x = self.solve(with_margin(scaled))
                t, center = float(x[-1]), unscaled(T, x[:-1])
                if not np.isfinite([t, *center]).all() or not center.any():
                    break
                improved = t > 1.5 * max(best, 0.0)
                if t > best and (ending is Ending.SOLVED or (ending is Ending.INACCURATE and t > MARGIN)):
                    best, point = t, center
                if not improved and (best > MARGIN or sweep >= PATIENCE):
                    break
                scaled, T = scale(lifted, center)
            if best > WIDE:
                break
        if best <= MARGIN and ending is Ending.FAILED:
            best = -np.inf
        return best, point[:-1] / point[-1] if point[-1] > 0 else point[:-1]


def unscaled(T: Array, y: Array) -> Array:
    """Coordinates T y of the program; infinite or not a number where a solver that broke down has left them so."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(T @ y)


def violation(program: Program, z: Array) -> float:
    """Largest eigenvalue of F(z) over all blocks."""
    values = [block.at(z) for block in program.blocks]
    return max(float(F[0, 0] if len(F) == 1 else np.linalg.eigvalsh(F)[-1]) for F in values)


def verdict(t: float) -> Status:
    """What a largest margin says; minus infinity is that of a phase I that was not solved."""
    if t > MARGIN:
        return Status.OPTIMAL
    return Status.INFEASIBLE if -np.inf < t <= NOISE else Status.UNDECIDED


def agree(a: float, b: float, tolerance: float) -> bool:
    """Relative agreement."""
    return abs(a - b) <= tolerance * max(abs(a), abs(b))


def homogeneous(program: Program) -> Program:
    """Give the constant part a factor s of its own, the last coordinate, with s >= 0."""
    blocks = [replace(b, terms=np.concatenate([0 * b.terms[:1], b.terms[1:], b.terms[:1]])) for b in program.blocks]
    s = np.zeros((len(program.cost) + 2, 1, 1))
    s[-1] = -1.0
    return Program(np.zeros(len(program.cost) + 1), 0.0, (*blocks, Block("s >= 0", s, strict=True)))


def with_margin(program: Program) -> Program:
    """Maximise t (the last coordinate) with F + t I <= 0, sum of traces of -F at most the number of rows."""
    blocks = [replace(b, terms=np.concatenate([b.terms, np.eye(b.order)[None]])) for b in program.blocks]
    traces = -sum(np.trace(b.terms, axis1=1, axis2=2) for b in program.blocks)
    total = np.append(traces, 0.0)[:, None, None]
    total[0] = -float(sum(b.order for b in program.blocks))
    cost = np.append(np.zeros(len(program.cost)), -1.0)
    return Program(cost, 0.0, (*blocks, Block("normalised", total, strict=False)))
