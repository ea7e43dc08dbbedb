"""Componentwise slope bounds: f_i(q) depends on q_i only."""

from collections.abc import Sequence

from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import rational
from obsdesign.model.multiplier import Multiplier, Scaled

Slopes = Sequence[tuple[fmpq, fmpq | None]]


def slope(bounds: Slopes, nq: int, nf: int) -> Multiplier:
    """Slopes a_i <= df_i / dq_i <= b_i: (df_i - a_i dq_i)(b_i dq_i - df_i) >= 0, with a scale for each i.

    M_i = lambda_i [[-2ab, a+b], [a+b, -2]]; without an upper bound (b = None) the limit of M_i / b,
    [[-2a, 1], [1, 0]].

    Parameters
    ----------
    bounds
        (a_i, b_i) for each of the nq = nf components.

    Raises
    ------
    UsageError
        nf is not nq, there is not one pair for each component, or a_i > b_i.
    """
    if not nf == nq == len(bounds):
        sizes = f"{len(bounds)} bounds for {nq} components of q and {nf} of f"
        raise UsageError(f"slope: {sizes}; it takes as many of each")
    for a, b in bounds:
        if b is not None and a > b:
            raise UsageError(f"slope: the lower bound {a} is above the upper bound {b}")
    return Multiplier(tuple(component(a, b) for a, b in bounds))


def component(a: fmpq, b: fmpq | None) -> Scaled:
    """Set for one slope in [a, b]; the member is zero where the class contains it, or else the nearer end."""
    M = [[-2 * a, 1], [1, 0]] if b is None else [[-2 * a * b, a + b], [a + b, -2]]
    if a > 0:
        member = a
    elif b is not None and b < 0:
        member = b
    else:
        member = fmpq(0)
    return Scaled.of(rational(M), 1, rational([[member]]))
