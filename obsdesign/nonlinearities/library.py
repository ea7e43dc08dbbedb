"""Functions whose type is known: f is given, and with it the tightest template."""

from dataclasses import dataclass, replace
from typing import Any

from flint import fmpq

from obsdesign.model.multiplier import Multiplier
from obsdesign.nonlinearities.monotone import MONOTONE
from obsdesign.nonlinearities.slope import slope
from obsdesign.nonlinearities.template import Slopes, Template


@dataclass(frozen=True)
class Within(Template):
    """A scalar function, applied to each component of q, with slopes from the first to the second number."""

    low: int = 0
    high: int = 1

    def slopes(self, data: None, nq: int) -> Slopes:  # noqa: ARG002
        """Both bounds, attained."""
        return [(fmpq(self.low), fmpq(self.high))] * nq


def within(low: int, high: int, f: str) -> Within:
    """Type of the function f(q) with slopes in [low, high]."""

    def repeated(data: Any, nq: int, nf: int) -> Multiplier:  # noqa: ARG001
        return slope([(fmpq(low), fmpq(high))] * nq, nq, nf)

    return Within(repeated, f=f, low=low, high=high)


FUNCTIONS = {
    "q|q|": replace(MONOTONE, f="q*abs(q)"),
    "cubic": replace(MONOTONE, f="q**3"),
    "sin": within(-1, 1, "sin(q)"),
    "cos": within(-1, 1, "cos(q)"),
    "tanh": within(0, 1, "tanh(q)"),
    "atan": within(0, 1, "atan(q)"),
    "sat": within(0, 1, "sat(q)"),
    "deadzone": within(0, 1, "q - sat(q)"),
    "relu": within(0, 1, "max(q, 0)"),
}
