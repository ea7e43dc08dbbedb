"""Functions whose type is known: f is given, and with it the tightest template."""

from dataclasses import replace

from flint import fmpq

from obsdesign.nonlinearities.monotone import MONOTONE
from obsdesign.nonlinearities.slope import slope, slope_bounds
from obsdesign.nonlinearities.template import Template


def within(low: int, high: int, f: str) -> Template:
    """Type of the function f(q), applied to each component of q, whose slopes are in [low, high], ends included."""
    ends = fmpq(low), fmpq(high)
    return Template(
        lambda _, nq, nf: slope([ends] * nq, nq, nf),
        f=f,
        slopes=lambda _, nq: [ends] * nq,
        conditions=lambda _, multiplier: slope_bounds([ends] * len(multiplier.blocks), multiplier),
    )


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
