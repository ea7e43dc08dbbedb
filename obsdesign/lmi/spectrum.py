"""Extreme eigenvalues of symmetric rational matrices, in balls: roots of the exact characteristic polynomial."""

import math

from flint import arb, ctx, fmpq_mat

from obsdesign.lmi.formula import Array, above, below

BITS = 128  # of a ball, and as many more until it is
ACCURACY = 80  # bits, relative


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
