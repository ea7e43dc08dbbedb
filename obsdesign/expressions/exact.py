"""Rational arithmetic of bounded size, and its way to doubles."""

from collections.abc import Callable
from math import inf
from typing import Any

from flint import fmpq

from obsdesign.errors import UsageError

MAX_EXPONENT = 10_000
MAX_BITS = 20_000


class ExpressionError(UsageError):
    """An expression that is refused.

    `message`: what is wrong, and what is allowed instead; `column`: offset in the text of the expression, from 0.
    """

    def __init__(self, message: str, column: int = 0, *, id: str) -> None:
        super().__init__(message, id=id)
        self.message = message
        self.column = column
        self.id = id

    def __reduce__(self) -> tuple[Any, ...]:
        return UsageError, self.problems  # in another process


def bounded(value: fmpq) -> fmpq:
    """Return the value, or raise `ExpressionError` if writing it takes too many digits."""
    if value.height_bits() > MAX_BITS:
        raise ExpressionError(f"a number grows beyond {MAX_BITS} bits", id="OBS303")
    return value


def decimal(text: str) -> fmpq:
    """Rational of a decimal with or without an exponent."""
    mantissa, _, exponent = text.lower().partition("e")
    whole, _, fraction = mantissa.partition(".")
    shift = int(exponent or 0) - len(fraction)
    number = int(whole + fraction)
    return fmpq(number * 10**shift) if shift > 0 else fmpq(number, 10**-shift)


def double(value: fmpq) -> float:
    """Nearest double; infinite if there is none."""
    try:
        return int(value.p) / int(value.q)
    except OverflowError:
        return inf if value > 0 else -inf


def rational_power(base: fmpq, exponent: fmpq) -> fmpq | None:
    """Exact base**exponent, or None where it is irrational or undefined; the exponent is neither 0 nor too large."""
    if base == 0:
        return fmpq(0) if exponent > 0 else None
    n, root = int(exponent.p), int(exponent.q)
    if root > 1:
        base = rational_root(base, root)
        if base is None:
            return None
    if base.height_bits() * abs(n) > 2 * MAX_BITS:
        raise ExpressionError(f"a number grows beyond {MAX_BITS} bits", id="OBS303")
    return bounded(base**n)


def rational_root(base: fmpq, root: int) -> fmpq | None:
    """Exact root of a positive number, or None where it is irrational or undefined."""
    if base < 0 or root > MAX_BITS:
        return None
    candidate = fmpq(base.p.root(root), base.q.root(root))
    return candidate if candidate**root == base else None


def at(argument: int, value: int) -> Callable[[fmpq], fmpq | None]:
    """Rule of a function that is rational at one rational argument only (Lindemann and Weierstrass)."""
    return lambda x: fmpq(value) if x == argument else None


def sign(x: Any) -> fmpq:
    """-1, 0 or 1."""
    return fmpq(int(x > 0) - int(x < 0))
