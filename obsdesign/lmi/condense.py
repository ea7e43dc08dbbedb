"""The rows of a next state, taken out of an inequality: what is left is smaller, and an equivalent of it.

With M, R known and P, Y unknown, and P > 0,

    [[S, (P M + Y R)'], [., -P]] <= 0   iff   S + M' P M + he(M' Y R) + R' Z R <= 0,  [[Z, Y'], [., P]] >= 0 for some Z,

since (P M + Y R)' P^-1 (P M + Y R) = M' P M + he(M' Y R) + R' Y' P^-1 Y R, and only the last term has a product of
unknowns. Z is as small as R has independent rows: as outputs are fewer than states, a solver takes the two inequalities
in about half the time. V+ - V also stands in them as one term, where the first form has a difference of large ones.

Where Y is projected out, the first of the two on ker R and S <= 0 are left, without any Z.
"""

from dataclasses import replace

import numpy as np

from obsdesign.lmi.formula import Array, NextState, positions
from obsdesign.lmi.probe import Block

ZERO = 1e-13  # relative size below which a singular value is a rounded zero
FORM = 1e-9  # relative size of what is not of the form above and is still rounding


def spaces(matrix: Array) -> tuple[Array, Array]:
    """Orthonormal bases of the row space and the null space, as columns; the units of rows do not matter."""
    size = np.abs(matrix).max(axis=1, initial=0.0, keepdims=True)
    _, singular, Vt = np.linalg.svd(matrix / np.where(size > 0, size, 1.0))
    rank = int((singular > ZERO * max(matrix.shape) * singular.max(initial=0) * 100).sum())
    return np.asarray(Vt[:rank].T), np.asarray(Vt[rank:].T)


def ahead(state: NextState, d: Array, keep: Array) -> tuple[Array, Array]:
    """[I; M], by which (e, f, v) say the next state without a gain, and R, in scaled rows of which some are kept.

    `d`: factors of all rows (N,); `keep`: mask (N,), with all rows of the next state.
    """
    n = len(state.direct)
    within = keep[:-n]
    M = (state.direct * d[:-n] / d[-n:, None])[:, within]
    return np.vstack([np.eye(M.shape[1]), M]), (state.output * d[:-n])[:, within]


def condensed(block: Block, onward: Array, R: Array) -> tuple[tuple[Block, ...], int]:
    """The two inequalities in place of one, the coordinates of Z behind those of the block, and the order of Z.

    `onward`, `R`: of `ahead`. Raises `ArithmeticError`: the block is not of the form (a defect).
    """
    k, Q = onward.shape[1], spaces(R)[0]
    first, Y = block.congruent(onward), onward.T @ block.terms[:, :, k:]
    if np.abs(Y - Q @ (Q.T @ Y)).max(initial=0.0) > FORM * np.abs(block.terms).max(initial=0.0):
        raise ArithmeticError(f"the inequality {block.name!r} has other rows of the next state")
    row, column = positions((Q.shape[1], Q.shape[1]), symmetric=True)
    if not len(row):
        return (first,), 0
    Z = np.zeros((len(row), Q.shape[1], Q.shape[1]))
    Z[np.arange(len(row)), row, column] = Z[np.arange(len(row)), column, row] = 1.0
    r, n = Q.shape[1], block.order - k
    slack = np.zeros((len(block.terms) + len(Z), r + n, r + n))
    slack[: len(block.terms), :r, r:] = Q.T @ Y
    slack[: len(block.terms), r:, :r] = slack[: len(block.terms), :r, r:].mT
    slack[: len(block.terms), r:, r:] = block.terms[:, k:, k:]
    slack[len(block.terms) :, :r, :r] = -Z
    first = replace(first, terms=np.concatenate([first.terms, Q @ Z @ Q.T]))
    return (first, Block(f"{block.name} slack", slack, strict=False)), r


def least_slack(block: Block, z: Array, order: int) -> Array:
    """Coordinates of Z = Y' P^-1 Y, the least of a slack, for those of the rest."""
    value = -block.at(np.append(z, np.zeros(order * (order + 1) // 2)))
    Y, P = value[order:, :order], value[order:, order:]
    return np.asarray((Y.T @ np.linalg.pinv(P, hermitian=True) @ Y)[positions((order, order), symmetric=True)])
