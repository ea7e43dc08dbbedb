"""Numbers as a result file holds them: doubles that print as short decimals."""

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array, below, rational_number
from obsdesign.tables.text import at_least, at_most


def significant(matrix: Array, digits: int) -> Array:
    """Doubles of so many significant decimal digits."""
    return np.asarray(np.vectorize(lambda x: float(f"{x:.{digits}g}") + 0.0, otypes=[float])(matrix))


def square_below(x: fmpq) -> fmpq:
    """Largest double, as the decimal that prints it, that is not above x squared."""
    return rational_number(repr(below(x * x)))


def round_down(x: float, digits: int) -> float:
    """Largest decimal of so many significant digits that is not above x."""
    return float(at_least(x, digits))


def round_up(x: float, digits: int) -> float:
    """Smallest decimal of so many significant digits that is not below x."""
    return float(at_most(x, digits))
