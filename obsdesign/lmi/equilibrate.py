"""Units that follow from the data alone, so that those in which a problem is written do not matter.

Units multiply every entry of the data by one factor for each of its row, its column and its term. The factors that take
the logarithms of all entries nearest to zero, in the least squares, undo them: the same numbers come out of any units,
but for the rounding of the factors.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from obsdesign.lmi.formula import Array, Problem, Unknown
from obsdesign.lmi.probe import Block, Program, entries, matrices, probe, with_one
from obsdesign.records import dataclass, replace

ROUNDED = 1e-13  # relative size of an entry that the first fit shows to be a rounded zero: the second is without it
TAME = 20.0  # powers of two within which units are left as they are where no data are known to set better ones
FREEDOM = 1e-9  # weight that keeps a factor at 1 on which nothing depends


def factors(sizes: Array, powers: Sequence[tuple[Array, Any]], count: int) -> Array:
    """Powers of two u with log sizes + sum_j p_j log u[at_j] nearest to 0 in the least squares.

    `sizes`: (m,), positive; `powers`: pairs (at, p) of indices (m,) into u and an exponent for each or for all;
    `count`: length of u.
    """
    logs: Array = np.log2(sizes)
    used: Array = np.ones(len(sizes), dtype=bool)
    u: Array = np.zeros(count)
    for _ in range(2):
        normal, right = FREEDOM * np.eye(count), np.zeros(count)
        for a, p in powers:
            right -= np.bincount(a, used * logs * p, count)
            for b, q in powers:
                normal += np.bincount(a * count + b, used * p * q, count * count).reshape(count, count)
        u = np.linalg.solve(normal, right)
        left = logs + sum(p * u[a] for a, p in powers)
        used = left > np.log2(ROUNDED) + left.max(initial=0.0)
        if used.all():
            break
    return np.asarray(np.exp2(np.round(u)))


@dataclass(frozen=True)
class Scales:
    """Factors of the rows of the first blocks (by congruence) and of the coordinates: z = s scaled z."""

    rows: tuple[Array, ...]
    s: Array

    def of(self, program: Program) -> Program:
        """Scaled program."""
        if all((factors == 1).all() for factors in (*self.rows, self.s)):
            return program
        known = zip(program.blocks, self.rows, strict=False)
        rows = (*(block.scaled(row) for block, row in known), *program.blocks[len(self.rows) :])
        return scaled_coordinates(replace(program, blocks=rows), self.s)


def scales(problem: Problem, program: Program | None = None) -> Scales:
    """Scales of a problem: F_k,ij d_i d_j s_k near 1 with s_k = r_a c_b for the entry (a, b) of an unknown.

    A symmetric unknown has c = r. The constant term has no factor. `program`: the problem, if it was probed.
    """
    if program is None or problem.data:
        program = probe(replace(problem, inequalities=problem.data or problem.inequalities, minimise=None))
    blocks = program.blocks
    orders = [block.order for block in blocks]
    first = np.cumsum([0, *orders])
    down, across, count = indices(problem.unknowns, first[-1])
    k, i, j, sizes = above(entries(blocks), np.repeat(np.arange(len(orders)), orders))
    term, some = np.maximum(k - 1, 0), k > 0
    powers = [(i, 1.0), (j, 1.0), (down[term], some), (across[term], some)]
    u = factors(sizes, powers, count)
    if problem.data is None and np.abs(np.log2(u)).max(initial=0.0) <= TAME:
        u = np.ones(count)
    return Scales(tuple(np.split(u[: first[-1]], first[1:-1])), u[down] * u[across])


def indices(unknowns: Sequence[Unknown], count: int) -> tuple[Array, Array, int]:
    """Places, from a count on, of the row and column factors of every coordinate; and the count with these."""
    down, across = [], []
    for unknown in unknowns:
        row, column = unknown.positions
        down.append(count + row)
        across.append(count + column + (0 if unknown.symmetric else unknown.shape[0]))
        count += unknown.shape[0] if unknown.symmetric else sum(unknown.shape)
    return np.concatenate(down), np.concatenate(across), count


def above(found: tuple[Array, ...], block: Array) -> tuple[Array, ...]:
    """Those of the entries that are on and above the diagonal, block by block; `block`: that of each row."""
    _, i, j, _ = found
    upper = np.flatnonzero(i <= j)
    kept = upper[np.argsort(block[i[upper]].astype(np.int16), kind="stable")]
    return tuple(part[kept] for part in found)


def units(problem: Problem) -> dict[str, Array]:
    """Sizes that the unknowns have by the data: one for each entry."""
    return matrices(problem.unknowns, scales(problem).s)


def scaled_coordinates(program: Program, factors: Array) -> Program:
    """Write z = factors * scaled z."""
    weights = with_one(factors)[:, None, None]
    blocks = tuple(Block(b.name, b.terms * weights, b.strict) for b in program.blocks)
    return replace(program, cost=program.cost * factors, blocks=blocks)
