"""From a probed program to the smaller, better conditioned one that the solver gets, and the way back.

1. Rows and coordinates are scaled by powers of two, so that units do not matter (`equilibrate`).
2. A diagonal entry that is zero for every value of the unknowns makes its whole row zero: the row becomes
   linear equalities, which are eliminated, and is deleted; repeated until none is left. (Left inside the
   semidefinite constraint, such rows make solvers call infeasible problems optimal.)
3. An unknown that enters as He(left Y right) only is projected out: F <= 0 for some Y iff F <= 0 on ker(right)
   and on ker(left').
4. The rows of a next state are taken out of the first inequality (`condense`).
5. Before each solve, rows and coordinates are scaled by powers of two.
"""

from collections.abc import Sequence
from itertools import accumulate

import numpy as np

from obsdesign.lmi.condense import ahead, condensed, least_slack, spaces
from obsdesign.lmi.equilibrate import Scales, scaled_coordinates, scales
from obsdesign.lmi.formula import Array, NextState, Problem
from obsdesign.lmi.probe import Block, Program, entries, flat, places, probe, split, with_one
from obsdesign.records import dataclass, replace

SLACK = 1e-3  # relative size below which the slack of a constraint counts as none
ZERO = 1e-13  # relative size below which an entry is a rounded zero
TINY = 1e-100  # slack that a block without any is given


@dataclass(frozen=True)
class Reduced:
    """A program over z, where x = offset + basis @ z are the coordinates of the unknowns.

    z is a selection of x in scales of its own: x[free] = s[free] z, and behind it are the coordinates of a slack.
    `pivots` are the coordinates that the equalities determine from these, and `rows` the (block, row) pairs that must
    vanish. `contradiction` says why the equalities have no solution at all.
    """

    program: Program
    free: Array  # (M,)
    offset: Array  # (N,)
    basis: Array  # (N, M)
    scales: Scales
    pivots: tuple[int, ...] = ()
    rows: tuple[tuple[str, int], ...] = ()
    contradiction: str = ""
    slack: int = 0  # order of that of the second block

    def point(self, z: Array) -> Array:
        """Coordinates x of the unknowns; what was projected out is zero."""
        x: Array = self.offset + self.basis @ z
        return x

    def near(self, x: Array) -> Array:
        """Return z of a point x."""
        z = np.asarray(x[self.free] / self.scales.s[self.free])
        return np.append(z, least_slack(self.program.blocks[1], z, self.slack)) if self.slack else z


def reduce(problem: Problem, program: Program | None = None, scaling: Scales | None = None) -> Reduced:
    """Apply steps 1 to 4; an injection that an equality ties is left in.

    What is known already, the probed program or the scales, is not made again.
    """
    program = program or probe(problem)
    scaling = scaling or scales(problem, program)
    size = len(program.cost)
    reduced = eliminate(Reduced(scaling.of(program), np.arange(size), np.zeros(size), np.diag(scaling.s), scaling))
    if reduced.contradiction:
        return reduced
    if problem.injection and (projected := project(reduced, problem)):
        return eliminate(projected)
    state = problem.next_state
    return condense(reduced, state) if state and state.slow else reduced


def between(a: Reduced, b: Reduced, weight: float) -> Reduced | None:
    """Reduction (1 - weight) a + weight b of a formula affine in a parameter; None if they differ in structure."""
    same = a.scales is b.scales and a.rows == b.rows and a.pivots == b.pivots and np.array_equal(a.free, b.free)
    same = same and a.slack == b.slack
    if not same or a.contradiction or b.contradiction or (a.basis != b.basis).any() or (a.offset != b.offset).any():
        return None

    def mixed(x: Array, y: Array) -> Array:
        return (1 - weight) * x + weight * y

    blocks = tuple(
        replace(x, terms=mixed(x.terms, y.terms)) for x, y in zip(a.program.blocks, b.program.blocks, strict=True)
    )
    return replace(a, program=replace(a.program, cost=mixed(a.program.cost, b.program.cost), blocks=blocks))


def eliminate(reduced: Reduced) -> Reduced:
    """Turn structurally zero rows into equalities and solve these, until no such row is left."""
    labels = {b.name: np.arange(b.order) for b in reduced.program.blocks}
    while True:
        equalities, kept, rows, zeros = [], [], [], zero_diagonals(reduced.program.blocks)
        if not any(zero.any() for zero in zeros):
            return reduced
        for block, zero in zip(reduced.program.blocks, zeros, strict=True):
            if not zero.any():
                kept.append(block)
                continue
            if block.strict:
                return replace(reduced, contradiction=f"{block.name} cannot hold: a diagonal entry must vanish")
            equalities.append(block.terms[:, zero].reshape(len(block.terms), -1).T)
            rows += [(block.name, int(i)) for i in labels[block.name][zero]]
            labels[block.name] = labels[block.name][~zero]
            if not zero.all():
                kept.append(block.rows(~zero))
        reduced = replace(
            reduced, program=replace(reduced.program, blocks=tuple(kept)), rows=reduced.rows + tuple(rows)
        )
        reduced = solve_equalities(reduced, np.concatenate(equalities))
        if reduced.contradiction:
            return reduced


def zero_diagonals(blocks: Sequence[Block]) -> list[Array]:
    """Masks of the rows whose diagonal entry vanishes for every value of the unknowns, relative to its row."""
    if not blocks:
        return []
    row, column = places(tuple(block.order for block in blocks))
    size = np.concatenate([np.maximum(part.max(axis=0), -part.min(axis=0)) for part in flat(blocks)])
    ends = list(accumulate(block.order for block in blocks))
    return split(size[row == column] <= ZERO * largest(size, row, ends[-1]), ends)


def solve_equalities(reduced: Reduced, equalities: Array) -> Reduced:
    """Eliminate equalities [c0, c], one a row, c0 + c z = 0, by Gauss-Jordan with complete pivoting."""
    scale = np.abs(equalities).max(axis=1, initial=0)
    E = equalities[scale > 0] / scale[scale > 0, None]
    pivots: list[int] = []
    for row in range(len(E)):
        rest = np.abs(E[row:, 1:])
        i, j = divmod(int(rest.argmax()), rest.shape[1])
        if rest[i, j] < 10 * ZERO:
            break
        E[[row, row + i]] = E[[row + i, row]]
        E[row] /= E[row, j + 1]
        column = E[:, j + 1].copy()
        column[row] = 0
        E -= column[:, None] * E[row]
        E[np.abs(E) < ZERO] = 0
        pivots.append(j)
    if np.abs(E[len(pivots) :, 0]).max(initial=0) > 100 * ZERO:
        return replace(reduced, contradiction="the rows that must vanish contradict each other")
    size = E.shape[1] - 1
    is_free = np.ones(size, dtype=bool)
    is_free[pivots] = False
    free = np.flatnonzero(is_free)
    S = np.zeros((size + 1, len(free) + 1))  # (1, z) = S (1, free z)
    S[0, 0] = 1
    S[free + 1, np.arange(len(free)) + 1] = 1
    S[np.array(pivots, dtype=int) + 1] = -E[: len(pivots)][:, np.append(0, free + 1)]
    return replace(
        reduced,
        program=over(reduced.program, S),
        free=reduced.free[free],
        offset=reduced.offset + reduced.basis @ S[1:, 0],
        basis=reduced.basis @ S[1:, 1:],
        pivots=reduced.pivots + tuple(int(i) for i in reduced.free[pivots]),
    )


def over(program: Program, S: Array) -> Program:
    """Same program over z, where (1, x) = S (1, z)."""
    cost = np.append(program.constant, program.cost) @ S
    return Program(cost[1:], float(cost[0]), tuple(block.over(S) for block in program.blocks))


def project(reduced: Reduced, problem: Problem) -> Reduced | None:
    """Drop the injection: its inequality F <= 0 becomes F <= 0 on ker(right) and on ker(left'); None where it is tied.

    Of a next state, the former is without its rows: there these are -P <= 0 by themselves.
    """
    injection, state = problem.injection, problem.next_state
    assert injection is not None
    edges = np.cumsum([0, *(u.size for u in problem.unknowns)])
    d, keep = reduced.scales.rows[0], kept(reduced)
    place = [u.name for u in problem.unknowns].index(injection.unknown)
    inside = (reduced.free >= edges[place]) & (reduced.free < edges[place + 1])
    first, *others = reduced.program.blocks
    terms = np.append(False, inside)
    untouched = inside.sum() == problem.unknowns[place].size and not any(b.terms[terms].any() for b in others)
    if not untouched or keep.sum() != first.order:
        return None
    onward, right = ahead(state, d, keep) if state else (np.eye(first.order), (injection.right * d)[:, keep])
    parts = (
        replace(first.congruent(basis), name=f"{first.name} {where}")
        for basis, where in (
            (onward @ null_space(right), "without injection"),
            (null_space((injection.left.T * d)[:, keep]), "beyond it"),
        )
    )
    blocks = [replace(b, terms=b.terms[~terms]) for b in (*parts, *others) if b.order]
    return replace(
        reduced,
        program=Program(reduced.program.cost[~inside], reduced.program.constant, tuple(blocks)),
        free=reduced.free[~inside],
        basis=reduced.basis[:, ~inside],
    )


def kept(reduced: Reduced) -> Array:
    """Mask of the rows of the first inequality that need not vanish."""
    keep = np.ones(len(reduced.scales.rows[0]), dtype=bool)
    keep[[row for name, row in reduced.rows if name == reduced.program.blocks[0].name]] = False
    return keep


def condense(reduced: Reduced, state: NextState) -> Reduced:
    """Take the rows of the next state out of the first inequality; P > 0 is in the slack, where there is one."""
    first, *others = reduced.program.blocks
    made, order = condensed(first, *ahead(state, reduced.scales.rows[0], kept(reduced)))
    more = order * (order + 1) // 2
    rest = [b for b in others if not order or b.name != state.positive]
    blocks = [replace(b, terms=np.concatenate([b.terms, np.zeros((more, b.order, b.order))])) for b in rest]
    return replace(
        reduced,
        program=Program(np.append(reduced.program.cost, np.zeros(more)), reduced.program.constant, (*made, *blocks)),
        basis=np.hstack([reduced.basis, np.zeros((len(reduced.basis), more))]),
        slack=order,
    )


def null_space(matrix: Array) -> Array:
    """Orthonormal basis of the null space, as columns; the units of rows do not matter."""
    return spaces(matrix)[1]


def balance(program: Program, sweeps: int = 3) -> tuple[Program, Array]:
    """Scale rows of each block (by congruence) and coordinates z by powers of two; z = T scaled z."""
    return balanced(program, *balancing(program, sweeps))


def balanced(program: Program, rows: list[Array], factors: Array) -> tuple[Program, Array]:
    """Program in given scales; z = T scaled z."""
    blocks = tuple(block.scaled(row) for block, row in zip(program.blocks, rows, strict=True))
    return scaled_coordinates(replace(program, blocks=blocks), factors), np.diag(factors)


def balancing(program: Program, sweeps: int = 3) -> tuple[list[Array], Array]:
    """Powers of two for the rows of each block and for the coordinates that take all entries near 1."""
    ends = list(accumulate(block.order for block in program.blocks))
    rows, factors = np.ones(ends[-1] if ends else 0), np.ones(len(program.cost))
    if not ends:
        return [], factors
    term, i, j, sizes = entries(program.blocks)
    for _ in range(sweeps):
        d = 1 / power_of_two(np.sqrt(largest(sizes, i, len(rows))))
        sizes = sizes * (d[i] * d[j])
        step = 1 / power_of_two(largest(sizes, term, len(factors) + 1)[1:])
        sizes = sizes * with_one(step)[term]
        rows, factors = rows * d, factors * step
    return split(rows, ends), factors


def largest(sizes: Array, at: Array, count: int) -> Array:
    """Largest of the sizes at each of so many places; zero where there is none."""
    found = np.zeros(count)
    np.maximum.at(found, at, sizes)
    return found


def diagonal(program: Program, z: Array) -> tuple[Program, Array]:
    """Scale rows and coordinates by powers of two so that z and the diagonals of -F(z) come near 1; z = T scaled z.

    A diagonal entry counts as no smaller than `SLACK` times its terms: an active constraint has none left.
    """
    factors = power_of_two(np.maximum(np.abs(z), 1e-8 * np.abs(z).max()))
    blocks = tuple(block.scaled(1 / power_of_two(np.sqrt(slack(block, z)))) for block in program.blocks)
    return scaled_coordinates(replace(program, blocks=blocks), factors), np.diag(factors)


def dense(program: Program, z: Array) -> tuple[Program, Array]:
    """Congruences that take -F(z) near the identity, and orthonormal coordinates; z = T scaled z.

    A change of state coordinates or of units makes no difference. Eigenvalues below `SLACK` count as that.
    """
    blocks = tuple(block.congruent(whitening(block, z)) for block in program.blocks)
    triangle = np.linalg.qr(np.concatenate([b.terms[1:].reshape(len(z), -1) for b in blocks], axis=1).T, mode="r")
    if len(triangle) < len(z) or np.abs(np.diag(triangle)).min(initial=1) <= ZERO * np.abs(triangle).max(initial=0):
        return diagonal(program, z)  # coordinates that have no effect cannot be made orthonormal
    S = np.zeros((len(z) + 1, len(z) + 1))
    S[0, 0], S[1:, 1:] = 1, np.linalg.inv(triangle) * max(float(np.linalg.norm(triangle @ z)), np.finfo(float).tiny)
    return over(replace(program, blocks=blocks), S), S[1:, 1:]


def slack(block: Block, z: Array) -> Array:
    """Sizes of the diagonal of -F(z), at least `SLACK` times those of its terms."""
    return slack_at(block, z, block.at(z))


def slack_at(block: Block, z: Array, value: Array) -> Array:
    """Slack at a point where the value of the block is known."""
    terms = np.abs(with_one(z)) @ np.abs(block.terms.diagonal(axis1=1, axis2=2))
    size = np.maximum(np.abs(value.diagonal()), SLACK * terms)
    return np.asarray(np.maximum(size, 1e-12 * size.max(initial=0) + TINY))


def whitening(block: Block, z: Array) -> Array:
    """N with N'(-F(z))N = I, but for eigenvalues below `SLACK`, relative to the diagonal and to the largest."""
    value = block.at(z)
    d = 1 / np.sqrt(slack_at(block, z, value))
    values, vectors = np.linalg.eigh(-value * (d[:, None] * d))
    return np.asarray(d[:, None] * vectors / np.sqrt(np.maximum(values, SLACK * max(values[-1], SLACK))))


def power_of_two(x: Array) -> Array:
    """Nearest power of two; 1 for zero."""
    return np.asarray(np.exp2(np.rint(np.log2(np.where(x > 0, x, 1.0)))))
