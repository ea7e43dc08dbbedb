"""What arbitrarily short intervals ask of P(0) where a measurement leaves no entry of the error as it is."""

import numpy as np
from flint import fmpq, fmpq_mat

from obsdesign.lmi.formula import Array, identity, rational, zeros
from obsdesign.records import dataclass


@dataclass(frozen=True)
class Tied:
    """What (J) at tau = 0 asks of P(0), where J = I - E leaves no entry of x as it is.

    With E N = 0, (J) is an equality on the columns of N, which needs N' P(0) E = 0; what is left of it is the
    inequality on the row space of E.
    """

    basis: Array  # of these P(0), (k, m, m)
    across: Array  # of the row space of E, (m, rank)


def tied(J: Array) -> Tied:
    """Equalities of a J, in rationals; exact."""
    m = len(J)
    E = fmpq_mat((identity(m, J) - J).tolist())
    N, across = null_space(E), row_space(E)
    places = [(i, j) for i in range(m) for j in range(i, m)]
    units = [rational(np.eye(m)[[i]].T @ np.eye(m)[[j]]) for i, j in places]
    symmetric_units = [U + U.T if (U != U.T).any() else U for U in units]
    exact = np.array((identity(m, J) - J).tolist(), dtype=object)
    equations = [[(N.T @ U @ exact)[a, b] for U in symmetric_units] for a in range(N.shape[1]) for b in range(m)]
    weights = null_space(fmpq_mat(equations)) if equations else rational(np.eye(len(places)))
    basis = np.array([sum(w * U for w, U in zip(column, symmetric_units, strict=True)) for column in weights.T])
    return Tied(basis, across)


def null_space(matrix: fmpq_mat) -> Array:
    """Columns x with matrix x = 0, a basis, in rationals."""
    reduced, rank = matrix.rref()
    n = matrix.ncols()
    rows = reduced.tolist()[:rank]
    pivots = [next(j for j in range(n) if row[j] != 0) for row in rows]
    free = [j for j in range(n) if j not in pivots]
    found = zeros((n, len(free)), like=[np.array([fmpq(0)])])
    for k, j in enumerate(free):
        found[j, k] = fmpq(1)
        for row, pivot in zip(rows, pivots, strict=True):
            found[pivot, k] = -row[j]
    return found


def row_space(matrix: fmpq_mat) -> Array:
    """Basis of the rows, as columns, in rationals."""
    reduced, rank = matrix.rref()
    return np.array(reduced.tolist()[:rank], dtype=object).reshape(rank, matrix.ncols()).T
