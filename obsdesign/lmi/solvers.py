"""The only code that knows a solver: a program in, how the solve ended and a point out."""

import warnings
from collections.abc import Callable
from enum import StrEnum
from functools import cache
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import Array
from obsdesign.lmi.probe import Block, Program, split


class Ending(StrEnum):
    """How one solve ended, in words that say why an optimum was not believed where it was the last."""

    SOLVED = "solves in different scalings do not agree"
    INACCURATE = "it was solved to a low accuracy only"
    INFEASIBLE = "a solver takes it for infeasible, but the largest margin does not decide it"
    IMPROPER = "it seems to be infeasible or unbounded, as far as a solver tells"
    STALLED = "the search for its optimum made no progress"
    FAILED = "the search for its optimum broke down numerically"


class Solved(NamedTuple):
    """How a solve ended, the point z, and the dual matrices Z >= 0 of the blocks: the cost is -sum_k tr(Z_k F_k,i)."""

    ending: Ending
    point: Array
    duals: tuple[Array, ...]


Solver = Callable[[Program], Solved]

CLARABEL = {
    "Solved": Ending.SOLVED,
    "AlmostSolved": Ending.INACCURATE,
    "PrimalInfeasible": Ending.INFEASIBLE,
    "AlmostPrimalInfeasible": Ending.IMPROPER,
    "DualInfeasible": Ending.IMPROPER,
    "AlmostDualInfeasible": Ending.IMPROPER,
    "NumericalError": Ending.FAILED,
}  # any other: it stalled


class Columns(NamedTuple):
    """A sparse matrix by columns in the form that Clarabel reads; saves importing scipy.sparse."""

    shape: tuple[int, int]
    data: Array
    indices: Array
    indptr: Array
    has_canonical_format: bool = True
    has_sorted_indices: bool = True


def columns(dense: Array) -> Columns:
    """Compress a dense matrix."""
    across, down = np.nonzero(dense.T)
    counts = np.bincount(across, minlength=dense.shape[1])
    return Columns(dense.shape, dense[down, across], down, np.concatenate([[0], np.cumsum(counts)]))


@cache
def no_columns(size: int) -> Columns:
    """Square matrix of zeros."""
    return columns(np.zeros((size, size)))


@cache
def triangle_of(order: int) -> tuple[Array, Array, Array]:
    """Columns, rows and weights of the triangle cone: upper triangle by columns, off-diagonals times sqrt 2."""
    column, row = np.tril_indices(order)
    return column, row, np.where(row == column, 1.0, np.sqrt(2.0))


def triangle(block: Block) -> Array:
    """Return [-b, A] with b - A z in the triangle cone."""
    column, row, weight = triangle_of(block.order)
    return weight[:, None] * block.terms[:, row, column].T


def from_triangle(entries: Array, order: int) -> Array:
    """Symmetric matrix of a point of the triangle cone."""
    column, row, weight = triangle_of(order)
    matrix = np.zeros((order, order))
    matrix[row, column] = matrix[column, row] = entries / weight
    return matrix


def quickly(program: Program) -> Solved:
    """Clarabel without refinement of its linear systems, at two thirds of the time; it would hardly solve more."""
    return clarabel_once(program, chordal=False, refined=False)


def with_clarabel(program: Program) -> Solved:
    """Clarabel without chordal decomposition; with it once more before a point is called infeasible or unsolved."""
    found = clarabel_once(program, chordal=False)
    if found.ending is Ending.SOLVED:
        return found
    again = clarabel_once(program, chordal=True)
    return again if again.ending is Ending.SOLVED else found


@cache
def settings_of(*, chordal: bool, refined: bool) -> Any:
    """Settings of Clarabel."""
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.presolve_enable = False
    settings.chordal_decomposition_enable = chordal
    settings.iterative_refinement_enable = refined
    settings.max_iter = 100
    return settings


def clarabel_once(program: Program, *, chordal: bool, refined: bool = True) -> Solved:
    """One call."""
    import scipy.linalg  # noqa: F401  # which clarabel does else within Rust, where an interrupt would be a panic
    import clarabel  # isort: skip

    order = sorted(range(len(program.blocks)), key=lambda k: program.blocks[k].order > 1)
    blocks = [program.blocks[k] for k in order]
    scalars = sum(b.order == 1 for b in blocks)
    cones: list[Any] = [clarabel.NonnegativeConeT(scalars)] if scalars else []
    cones += [clarabel.PSDTriangleConeT(b.order) for b in blocks[scalars:]]
    rows = np.concatenate([triangle(b) for b in blocks])
    settings = settings_of(chordal=chordal, refined=refined)
    P = no_columns(len(program.cost))
    solution = clarabel.DefaultSolver(P, program.cost, columns(rows[:, 1:]), -rows[:, 0], cones, settings).solve()
    ends = accumulate(b.order * (b.order + 1) // 2 for b in blocks)
    parts = zip(order, blocks, split(np.array(solution.z), ends), strict=True)
    duals = {k: from_triangle(part, block.order) for k, block, part in parts}
    ending = CLARABEL.get(str(solution.status), Ending.STALLED)
    return Solved(ending, np.array(solution.x), tuple(duals[k] for k in range(len(blocks))))


CVXPY = {
    "optimal": Ending.SOLVED,
    "optimal_inaccurate": Ending.INACCURATE,
    "infeasible": Ending.INFEASIBLE,
    "infeasible_inaccurate": Ending.IMPROPER,
    "infeasible_or_unbounded": Ending.IMPROPER,
    "unbounded": Ending.IMPROPER,
    "unbounded_inaccurate": Ending.IMPROPER,
    "solver_error": Ending.FAILED,
}


def through_cvxpy(name: str) -> Solver:
    """Any other solver, given the same probed matrices through cvxpy.

    Raises `UsageError` if it is not installed, or knows no semidefinite matrices.
    """
    import cvxpy as cp

    def able(known: str) -> bool:
        try:
            cp.Problem(cp.Minimize(0), [cp.Variable((2, 2), symmetric=True) >> 0]).get_problem_data(known)
        except cp.SolverError:
            return False
        return True

    installed = cp.installed_solvers()
    if name.upper() not in installed or not able(name.upper()):
        why = "knows no semidefinite matrices" if name.upper() in installed else "not installed"
        others = (known.lower() for known in installed if known != "CLARABEL" and able(known))
        raise UsageError(f"--solver {name}: {why}; available: {', '.join(['clarabel', *others])}", id="OBS506")

    def solve(program: Program) -> Solved:
        z = cp.Variable(len(program.cost))
        constraints = []
        for block in program.blocks:
            k = block.order
            flat = block.terms.reshape(-1, k * k).T
            F = cp.reshape(flat[:, 1:] @ z + flat[:, 0], (k, k), order="C")
            constraints.append((F + F.T) / 2 << 0)
        model = cp.Problem(cp.Minimize(program.cost @ z), constraints)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # what cvxpy warns of is in the status
                model.solve(solver=name.upper())
        except cp.SolverError:
            return Solved(Ending.FAILED, np.zeros(len(program.cost)), ())
        point = np.zeros(len(program.cost)) if z.value is None else z.value
        duals = tuple(np.atleast_2d(0.0 if c.dual_value is None else c.dual_value) for c in constraints)
        return Solved(CVXPY.get(model.status, Ending.STALLED), point, duals)

    return solve


def call(name: str, *, quick: bool = False) -> Solver:
    """Solver of a name; a quick one is for searches, of which nothing is shipped as it is."""
    if name.lower() == "clarabel":
        return quickly if quick else with_clarabel
    return through_cvxpy(name)
