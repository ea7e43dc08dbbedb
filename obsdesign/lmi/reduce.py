"""From a probed program to the smaller, better conditioned one that the solver gets, and the way back.

1. A diagonal entry that is zero for every value of the unknowns makes its whole row zero: the row becomes
   linear equalities, which are eliminated, and is deleted; repeated until none is left. (Left inside the
   semidefinite constraint, such rows make solvers call infeasible problems optimal.)
2. An unknown that enters as He(left Y right) only is projected out: F <= 0 for some Y iff F <= 0 on ker(right)
   and on ker(left').
3. Rows and coordinates are scaled by powers of two.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from obsdesign.lmi.formula import Array, Injection, Unknown
from obsdesign.lmi.probe import Block, Program

ZERO = 1e-13  # relative size below which an entry is a rounded zero


@dataclass(frozen=True)
class Reduced:
    """A program over z, where x = offset + basis @ z are the coordinates of the unknowns.

    z is a selection of x: z = x[free]. `pivots` are the coordinates that the equalities determine from these, and
    `rows` the (block, row) pairs that must vanish. `contradiction` says why the equalities have no solution at all.
    """

    program: Program
    free: Array  # (M,)
    offset: Array  # (N,)
    basis: Array  # (N, M)
    pivots: tuple[int, ...] = ()
    rows: tuple[tuple[str, int], ...] = ()
    contradiction: str = ""

    def point(self, z: Array) -> Array:
        """Coordinates x of the unknowns; what was projected out is zero."""
        x: Array = self.offset + self.basis @ z
        return x


def reduce(program: Program, unknowns: Sequence[Unknown] = (), injection: Injection | None = None) -> Reduced:
    """Apply steps 1 and 2; an injection that an equality ties is left in."""
    size = len(program.cost)
    reduced = eliminate(Reduced(program, np.arange(size), np.zeros(size), np.eye(size)))
    if injection and not reduced.contradiction:
        reduced = eliminate(project(reduced, unknowns, injection))
    return reduced


def eliminate(reduced: Reduced) -> Reduced:
    """Turn structurally zero rows into equalities and solve these, until no such row is left."""
    labels = {b.name: np.arange(len(b.constant)) for b in reduced.program.blocks}
    while True:
        equalities, kept, rows = [], [], []
        for block in reduced.program.blocks:
            zero = zero_diagonal(block)
            if block.strict and zero.any():
                return replace(reduced, contradiction=f"{block.name} cannot hold: a diagonal entry must vanish")
            entries = np.concatenate([block.constant[None], block.coefficients])
            equalities.append(entries[:, zero, :].reshape(len(entries), -1).T)
            rows += [(block.name, int(i)) for i in labels[block.name][zero]]
            labels[block.name] = labels[block.name][~zero]
            if not zero.all():
                kept.append(block.rows(~zero))
        if not rows:
            return reduced
        reduced = replace(
            reduced, program=replace(reduced.program, blocks=tuple(kept)), rows=reduced.rows + tuple(rows)
        )
        reduced = solve_equalities(reduced, np.concatenate(equalities))
        if reduced.contradiction:
            return reduced


def zero_diagonal(block: Block) -> Array:
    """Mask of the rows whose diagonal entry vanishes for every value of the unknowns, relative to its row."""
    diagonal = np.abs(np.diagonal(block.coefficients, axis1=1, axis2=2)).max(axis=0, initial=0)
    diagonal = np.maximum(diagonal, np.abs(np.diag(block.constant)))
    return np.asarray(diagonal <= ZERO * largest_by_row(block))


def solve_equalities(reduced: Reduced, equalities: Array) -> Reduced:
    """Eliminate equalities [c0, c], one a row, c0 + c z = 0, by Gauss-Jordan with complete pivoting."""
    scale = np.abs(equalities).max(axis=1, initial=0)
    E = equalities[scale > 0] / scale[scale > 0, None]
    pivots: list[int] = []
    for row in range(len(E)):
        rest = np.abs(E[row:, 1:])
        i, j = np.unravel_index(np.argmax(rest), rest.shape) if rest.size else (0, 0)
        if not rest.size or rest[i, j] < 10 * ZERO:
            break
        E[[row, row + i]] = E[[row + i, row]]
        E[row] /= E[row, j + 1]
        E[:row] -= E[:row, j + 1, None] * E[row]
        E[row + 1 :] -= E[row + 1 :, j + 1, None] * E[row]
        E[np.abs(E) < ZERO] = 0
        pivots.append(int(j))
    if np.abs(E[len(pivots) :, 0]).max(initial=0) > 100 * ZERO:
        return replace(reduced, contradiction="the rows that must vanish contradict each other")
    size = E.shape[1] - 1
    free = np.setdiff1d(np.arange(size), pivots)
    offset, basis = np.zeros(size), np.zeros((size, len(free)))
    basis[free, np.arange(len(free))] = 1
    offset[pivots] = -E[: len(pivots), 0]
    basis[pivots] = -E[: len(pivots), 1:][:, free]
    return replace(
        reduced,
        program=Program(
            reduced.program.cost @ basis,
            reduced.program.constant + float(reduced.program.cost @ offset),
            tuple(block.substituted(offset, basis) for block in reduced.program.blocks),
        ),
        free=reduced.free[free],
        offset=reduced.offset + reduced.basis @ offset,
        basis=reduced.basis @ basis,
        pivots=reduced.pivots + tuple(int(i) for i in reduced.free[pivots]),
    )


def project(reduced: Reduced, unknowns: Sequence[Unknown], injection: Injection) -> Reduced:
    """Drop the injection: its inequality F <= 0 becomes F <= 0 on ker(right) and on ker(left')."""
    edges = np.cumsum([0, *(u.size for u in unknowns)])
    place = [u.name for u in unknowns].index(injection.unknown)
    inside = (reduced.free >= edges[place]) & (reduced.free < edges[place + 1])
    first, *others = reduced.program.blocks
    deleted = [row for name, row in reduced.rows if name == first.name]
    keep = np.setdiff1d(np.arange(len(injection.left)), deleted)
    untouched = inside.sum() == unknowns[place].size and not any(b.coefficients[inside].any() for b in others)
    if not untouched or len(keep) != len(first.constant):
        return reduced
    blocks = [
        replace(first.congruent(null_space(factor)), name=f"{first.name} {where}")
        for factor, where in ((injection.right[:, keep], "without injection"), (injection.left[keep].T, "beyond it"))
    ]
    program = replace(reduced.program, blocks=(*(b for b in blocks if b.constant.size), *others))
    return replace(
        reduced,
        program=Program(
            program.cost[~inside],
            program.constant,
            tuple(replace(b, coefficients=b.coefficients[~inside]) for b in program.blocks),
        ),
        free=reduced.free[~inside],
        basis=reduced.basis[:, ~inside],
    )


def null_space(matrix: Array) -> Array:
    """Orthonormal basis of the null space, as columns."""
    _, singular, Vt = np.linalg.svd(matrix)
    rank = int((singular > ZERO * max(matrix.shape) * singular.max(initial=0) * 100).sum())
    return np.asarray(Vt[rank:].T)


def balance(program: Program, sweeps: int = 3) -> tuple[Program, Array]:
    """Scale rows of each block (by congruence) and coordinates z by powers of two; z = factors * scaled z."""
    factors = np.ones(len(program.cost))
    scaled = program
    for _ in range(sweeps):
        blocks = [scaled_rows(b, np.sqrt(largest_by_row(b))) for b in scaled.blocks]
        largest = np.max([np.abs(b.coefficients).max(axis=(1, 2)) for b in blocks], axis=0)
        step = 1 / power_of_two(largest)
        factors = factors * step
        scaled = scaled_coordinates(replace(scaled, blocks=tuple(blocks)), step)
    return scaled, factors


def scale_to(program: Program, z: Array) -> tuple[Program, Array]:
    """Scale coordinates and rows so that the point z and the terms of the diagonals at z come near 1.

    The terms before they cancel, not their sum: an active constraint has no slack at an optimum.
    """
    factors = power_of_two(np.maximum(np.abs(z), 1e-8 * np.abs(z).max()))
    blocks = []
    for block in program.blocks:
        diagonals = np.abs(np.diagonal(block.coefficients, axis1=1, axis2=2))
        size = np.maximum(
            np.abs(np.diag(block.at(z))), 1e-3 * (np.abs(z) @ diagonals + np.abs(np.diag(block.constant)))
        )
        blocks.append(scaled_rows(block, np.sqrt(np.maximum(size, 1e-12 * size.max()))))
    return scaled_coordinates(replace(program, blocks=tuple(blocks)), factors), factors


def largest_by_row(block: Block) -> Array:
    """Largest entry of each row over all coefficients."""
    return np.asarray(
        np.maximum(np.abs(block.coefficients).max(axis=(0, 2), initial=0), np.abs(block.constant).max(axis=1))
    )


def power_of_two(x: Array) -> Array:
    """Nearest power of two; 1 for zero."""
    return np.asarray(np.exp2(np.round(np.log2(np.where(x > 0, x, 1.0)))))


def scaled_rows(block: Block, size: Array) -> Block:
    """D^-1 F D^-1 with the powers of two nearest to the sizes in D."""
    return block.scaled(1 / power_of_two(size))


def scaled_coordinates(program: Program, factors: Array) -> Program:
    """Write z = factors * scaled z."""
    blocks = [replace(b, coefficients=b.coefficients * factors[:, None, None]) for b in program.blocks]
    return replace(program, cost=program.cost * factors, blocks=tuple(blocks))
