"""Matrices of fractions, for proofs that share nothing with the package."""

from fractions import Fraction

import numpy as np


def fractions(M):
    """Array of the fractions that the entries print."""
    M = np.asarray(M, dtype=object)
    return np.array([Fraction(str(x)) for x in M.flat], dtype=object).reshape(M.shape)


def positive(M, *, strict=False):
    """Whether a symmetric matrix is positive (semi)definite, by elimination."""
    assert (M == M.T).all()
    while len(M):
        pivot, rest = M[0, 0], M[0, 1:]
        if pivot < 0 or (pivot == 0 and (strict or rest.any())):
            return False
        M = M[1:, 1:] - (np.outer(rest, rest) / pivot if pivot else 0)
    return True
