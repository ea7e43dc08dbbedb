"""Numbers as a result file holds them: doubles that print as short decimals."""

import decimal

import numpy as np

from obsdesign.lmi.formula import Array, rational


def significant(matrix: Array, digits: int) -> Array:
    """Doubles of so many significant decimal digits."""
    return np.asarray(np.vectorize(lambda x: float(f"{x:.{digits}g}") + 0.0, otypes=[float])(matrix))


def exact(decimals: Array) -> Array:
    """Rationals of doubles, each read as the shortest decimal that prints it."""
    return rational(np.vectorize(lambda x: repr(float(x)), otypes=[object])(decimals))


def round_down(x: float, digits: int) -> float:
    """Largest decimal of so many significant digits that is not above x."""
    with decimal.localcontext(prec=digits, rounding=decimal.ROUND_FLOOR):
        return float(+decimal.Decimal(x))


def round_up(x: float, digits: int) -> float:
    """Smallest decimal of so many significant digits that is not below x."""
    return -round_down(-x, digits)
