"""The only code that knows a solver: a program in, how the solve ended and a point out."""

import warnings
from collections.abc import Callable, Sequence
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


PRECISE = 1e-10  # relative gap of a program of a few unknowns


class Columns(NamedTuple):
    """A sparse matrix by columns in the form that Clarabel reads; saves importing scipy.sparse."""

    shape: tuple[int, int]
    data: Array
    indices: Array
    indptr: Array
    has_canonical_format: bool = True
    has_sorted_indices: bool = True


def columns(transposed: Array) -> Columns:
    """Compress a dense matrix that is given transposed."""
    count, size = transposed.shape
    place = np.flatnonzero(transposed != 0)  # many times as fast as a search by two indices
    across, down = np.divmod(place, size)
    ends = np.cumsum([0, *np.bincount(across, minlength=count)])
    return Columns((size, count), transposed.ravel()[place], down, ends)


@cache
def no_columns(size: int) -> Columns:
    """Square matrix of zeros."""
    return columns(np.zeros((size, size)))


@cache
def triangles(orders: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """Places among the entries of blocks that are those of triangle cones, their mirror images, and their weights.

    A triangle cone holds an upper triangle by columns, off-diagonals times sqrt 2.
    """
    parts, first = [np.zeros((2, 0), dtype=int)], 0
    for order in orders:
        column, row = np.tril_indices(order)
        parts.append(first + np.stack([row * order + column, column * order + row]))
        first += order * order
    upper, lower = np.concatenate(parts, axis=1)
    return upper, lower, np.where(upper == lower, 1.0, np.sqrt(2.0))


def in_triangles(blocks: Sequence[Block]) -> Array:
    """Return [-b, A]', (1 + N, rows), with b - A z in triangle cones."""
    parts = []
    for block in blocks:
        upper, _, weights = triangles((block.order,))
        parts.append(block.terms.reshape(len(block.terms), -1)[:, upper] * weights)
    return np.concatenate(parts, axis=1)


def from_triangles(point: Array, orders: tuple[int, ...]) -> list[Array]:
    """Symmetric matrices of a point of triangle cones."""
    upper, lower, weights = triangles(orders)
    squares = [order * order for order in orders]
    entries = np.zeros(sum(squares))
    entries[upper] = entries[lower] = point / weights
    parts = zip(split(entries, accumulate(squares)), orders, strict=True)
    return [part.reshape(order, order) for part, order in parts]


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
    orders = tuple(block.order for block in blocks)
    scalars = orders.count(1)
    cones: list[Any] = [clarabel.NonnegativeConeT(scalars)] if scalars else []
    cones += [clarabel.PSDTriangleConeT(k) for k in orders[scalars:]]
    terms = in_triangles(blocks)
    settings = settings_of(chordal=chordal, refined=refined)
    P = no_columns(len(program.cost))
    solution = clarabel.DefaultSolver(P, program.cost, columns(terms[1:]), -terms[0], cones, settings).solve()
    duals = dict(zip(order, from_triangles(np.array(solution.z), orders), strict=True))
    ending = CLARABEL.get(str(solution.status), Ending.STALLED)
    return Solved(ending, np.array(solution.x), tuple(duals[k] for k in range(len(blocks))))


@cache
def settings_of_few() -> Any:
    """Settings of Clarabel for a program of a few unknowns."""
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.presolve_enable = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = PRECISE
    return settings


def quadratic(cost: Array, G: Array, h: Array, bend: float = 0.0) -> tuple[Array, float] | None:
    """Minimise cost x + bend |x|^2 / 2 over G x >= h: x, and the bound of its dual; None where it is not solved."""
    import scipy.linalg  # noqa: F401  # as above
    import clarabel  # isort: skip

    cones = [clarabel.NonnegativeConeT(len(h))]
    curved = columns(bend * np.eye(len(cost)))
    solution = clarabel.DefaultSolver(curved, cost, columns(-G.T), -h, cones, settings_of_few()).solve()
    x, ending = np.array(solution.x), CLARABEL.get(str(solution.status))
    solved = ending in (Ending.SOLVED, Ending.INACCURATE) and bool(np.isfinite(x).all())
    return (x, float(solution.obj_val_dual)) if solved else None


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
