"""Extreme eigenvalues of symmetric rational matrices, in balls: roots of the exact characteristic polynomial.

Those of large ones take minutes to find so: what doubles find and a little more is proved of them.
"""

import math

import numpy as np
from flint import arb, ctx, fmpq, fmpq_mat

from obsdesign.lmi.dominance import definite
from obsdesign.lmi.formula import Array, Float, above, approximate, below, printed

BITS = 128  # of a ball, and as many more until it is
ACCURACY = 80  # bits, relative
LARGE = 24  # order from which roots take longer than they are worth
MORE = (1e-8, 1e-6, 1e-4)  # relative: what doubles find is told so much larger, the first that is proved


def extremes(matrix: Array) -> tuple[arb, arb]:
    """Balls that hold the smallest and the largest eigenvalue of a symmetric matrix (n, n) of rationals, n > 0.

    Whatever its condition, each is known to `ACCURACY`, or exactly.
    """
    polynomial, bits = fmpq_mat(matrix.tolist()).charpoly(), BITS
    while True:
        with ctx.workprec(bits):
            roots = [root.real for root, _ in polynomial.complex_roots()]
            low, high = lowest(roots), -lowest([-root for root in roots])
        if min(low.rel_accuracy_bits(), high.rel_accuracy_bits()) >= ACCURACY:
            return low, high
        bits *= 2


def near_largest_ratio(P: Array, H: Array) -> fmpq | None:
    """Number just above the largest |H e|^2 / e' P e, P > 0 and H in rationals; None where none is proved.

    It is a little more than what doubles find, r, and r P - H' H > 0 is proved.
    """
    in_P, in_H = (np.vectorize(approximate, otypes=[float])(M) for M in (P, H))
    d = np.sqrt(np.diag(in_P))
    try:
        back: Float = np.linalg.solve(np.linalg.cholesky(in_P / np.outer(d, d)), (in_H / d).T)
    except np.linalg.LinAlgError:
        return None
    size = float(np.linalg.norm(back, 2)) ** 2
    if not 0 < size < math.inf:
        return None
    HT, whole = fmpq_mat(H.mT.tolist()), fmpq_mat(P.tolist())
    square = HT * HT.transpose()
    for more in MORE:
        ratio: fmpq = printed(size * (1 + more))
        if definite(np.array((ratio * whole - square).tolist(), dtype=object)):
            return ratio
    return None


def upper(ball: arb) -> float:
    """Smallest double, as the decimal that prints it, that is not below a number in a ball; infinity if none is."""
    return above(ball.upper().fmpq()) if ball.is_finite() else math.inf


def lower(ball: arb) -> float:
    """Largest double, as the decimal that prints it, that is not above a number in a finite ball."""
    return below(ball.lower().fmpq())


def lowest(balls: list[arb]) -> arb:
    """Ball that holds the least of the numbers in some balls."""
    least, *others = balls
    for ball in others:
        least = least.min(ball)
    return least
