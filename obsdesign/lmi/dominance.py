"""A symmetric matrix of rationals is positive definite: a proof in integers, found in doubles.

S > 0 if T' S T is strictly diagonally dominant with a positive diagonal, for any square T: the dominant matrix is
positive definite, so T is nonsingular, and S = T^-T (T' S T) T^-1. With T near the inverse of a Cholesky factor of S,
T' S T is near the identity. Two products of integers decide, where an exact factorisation takes n^3 growing rationals.
"""

from math import ldexp

import numpy as np
from flint import fmpq_mat, fmpz, fmpz_mat

from obsdesign.lmi.formula import Array

BITS = 22  # of T, below its largest entry
KEPT = 64  # leading bits of an integer that make its double


def definite(S: Array) -> bool:
    """Whether a symmetric matrix of rationals (n, n) is proved to be positive definite; False proves nothing."""
    if not len(S):
        return True
    N, _ = fmpq_mat(S.tolist()).numer_denom()
    T = congruence(N)
    return T is not None and dominant(T.transpose() * N * T)


def congruence(N: fmpz_mat) -> fmpz_mat | None:
    """Integers T with T' N T near a multiple of the identity; None where doubles do not find N positive definite.

    N is scaled by powers of two to a diagonal near 1 before its Cholesky factor L is taken: T = 2^22 L^-T, scaled back.
    """
    n = N.nrows()
    rows = [[int(entry) for entry in row] for row in N.tolist()]
    if any(rows[i][i] <= 0 for i in range(n)):
        return None
    half = [rows[i][i].bit_length() // 2 for i in range(n)]
    scaled: Array = np.zeros((n, n))  # its lower triangle, which is what is factorised
    try:
        for i in range(n):
            scaled[i, : i + 1] = [shifted(rows[i][j], half[i] + half[j]) for j in range(i + 1)]
        inverse: Array = np.linalg.inv(np.linalg.cholesky(scaled)).T
    except (np.linalg.LinAlgError, OverflowError):
        return None
    if not np.isfinite(inverse).all():
        return None
    whole, most = np.rint(np.ldexp(inverse, BITS)), max(half)
    return fmpz_mat([[fmpz(int(entry)) << (most - half[i]) for entry in row] for i, row in enumerate(whole.tolist())])


def shifted(value: int, bits: int) -> float:
    """Double near value / 2^bits, of any size of both."""
    drop = max(0, value.bit_length() - KEPT)
    return ldexp(float(value >> drop), drop - bits)


def dominant(R: fmpz_mat) -> bool:
    """Whether each diagonal entry is above the sum of the absolute values of the others in its row."""
    return all(2 * row[i] > sum(map(abs, row)) for i, row in enumerate(R.tolist()))
