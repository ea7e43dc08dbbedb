"""Componentwise slope bounds: f_i(q) depends on q_i only."""

from collections.abc import Sequence

from flint import fmpq

from obsdesign.lmi.formula import rational
from obsdesign.nonlinearities.multiplier import Multiplier, Scaled

Slopes = Sequence[tuple[fmpq, fmpq | None]]


def slope(bounds: Slopes, nq: int, nf: int) -> Multiplier:  # noqa: ARG001
    """a_i dq_i^2 <= dq_i df_i <= b_i dq_i^2 with (df_i - a_i dq_i)(b_i dq_i - df_i) >= 0, one scale for each i.

    M_i = lambda_i [[-2ab, a+b], [a+b, -2]]; without an upper bound (b = None) its limit M_i / b = [[-2a, 1], [1, 0]].

    Parameters
    ----------
    bounds
        (a_i, b_i) for each of the nq = nf components.
    """
    return Multiplier(tuple(component(a, b) for a, b in bounds))


def component(a: fmpq, b: fmpq | None) -> Scaled:
    """Set for one scalar slope in [a, b]; the member is zero where the class contains it, else the nearer end."""
    M = [[-2 * a, 1], [1, 0]] if b is None else [[-2 * a * b, a + b], [a + b, -2]]
    if a > 0:
        member = a
    elif b is not None and b < 0:
        member = b
    else:
        member = fmpq(0)
    return Scaled.of(rational(M), 1, rational([[member]]))
