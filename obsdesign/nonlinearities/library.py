"""Functions whose type is known: f is given, and with it the tightest template."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from flint import fmpq

from obsdesign.model.multiplier import Multiplier
from obsdesign.nonlinearities.monotone import monotone
from obsdesign.nonlinearities.slope import slope


@dataclass(frozen=True)
class Function:
    """A scalar function, applied to each component of q, and the template of its slope."""

    f: str  # expression of q
    template: Callable[[None, int, int], Multiplier]


def within(low: int, high: int) -> Callable[[None, int, int], Multiplier]:
    """Template of the slope bound [low, high] for every component."""
    return partial(repeated, fmpq(low), fmpq(high))


def repeated(low: fmpq, high: fmpq, data: None, nq: int, nf: int) -> Multiplier:  # noqa: ARG001
    """Slope in [low, high] for each of nq components."""
    return slope([(low, high)] * nq, nq, nf)


FUNCTIONS = {
    "q|q|": Function("q*abs(q)", monotone),
    "cubic": Function("q**3", monotone),
    "sin": Function("sin(q)", within(-1, 1)),
    "cos": Function("cos(q)", within(-1, 1)),
    "tanh": Function("tanh(q)", within(0, 1)),
    "atan": Function("atan(q)", within(0, 1)),
    "sat": Function("sat(q)", within(0, 1)),
    "deadzone": Function("q - sat(q)", within(0, 1)),
    "relu": Function("max(q, 0)", within(0, 1)),
}
