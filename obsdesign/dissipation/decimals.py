"""Numbers as a result file holds them: doubles that print as short decimals."""

import decimal
import math

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array, printed, rational_number


def significant(matrix: Array, digits: int) -> Array:
    """Doubles of so many significant decimal digits."""
    return np.asarray(np.vectorize(lambda x: float(f"{x:.{digits}g}") + 0.0, otypes=[float])(matrix))


def square_below(x: fmpq) -> fmpq:
    """Largest double, as the decimal that prints it, that is not above x squared."""
    return rational_number(repr(below(x * x)))


def below(x: fmpq) -> float:
    """Largest double, read as the decimal that prints it, that is not above x."""
    double = float(x)
    while printed(double) > x:
        double = math.nextafter(double, -math.inf)
    return double


def round_down(x: float, digits: int) -> float:
    """Largest decimal of so many significant digits that is not above x."""
    with decimal.localcontext(prec=digits, rounding=decimal.ROUND_FLOOR):
        return float(+decimal.Decimal(x))


def round_up(x: float, digits: int) -> float:
    """Smallest decimal of so many significant digits that is not below x."""
    return -round_down(-x, digits)
