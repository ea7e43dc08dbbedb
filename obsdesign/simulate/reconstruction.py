"""How well w is reconstructed by what = pinv(B) L1 (yhat - y), against the bound that is proved of it."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from obsdesign.dissipation.guarantee import Guarantee
from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array
from obsdesign.simulate.bounds import Errors, bound, fine_grid, table

JUMP = 1e-9  # of w against its size: smaller is rounding


def accuracy(errors: Errors, w_error: Array) -> dict[str, Any]:
    """Largest |what - w| of the run and of its last fifth."""
    size = np.linalg.norm(w_error, axis=1)
    return {"limsup": float(size[errors.late()].max()), "peak": float(size.max())}


def proved(
    errors: Errors, guarantee: Guarantee, limsup: float, rates: tuple[Array, Array], w_rate: float
) -> dict[str, Any]:
    """Bound on limsup |what - w|, as Theorems 2 and 4 of the L-infinity paper prove it.

    |what - w| <= c_w |w| + c_w' |w'| + c_x' |x'| + (c_w sqrt(V(e(s))) + c_w' sqrt(V(e'(s)))) exp(-alpha (t - s))

    with the sup norms over the run, and V and alpha of the guarantee's `Reconstruction`. The last term is what is left
    of the transient, and vanishes; any s < t will do, and the best one is taken.

    Parameters
    ----------
    rates
        x' and e' along the run, (M, n) each.
    w_rate
        Largest |w'| of the run.
    """
    constants = guarantee.reconstruction
    assert constants
    x_rates, e_rates = rates
    x_rate = float(np.linalg.norm(x_rates, axis=1).max())
    limit = constants.w * errors.v_sup[-1] + constants.w_rate * w_rate + constants.x_rate * x_rate
    V, V_rate = (np.sqrt(np.einsum("ti,ij,tj->t", s, constants.P, s)) for s in (errors.e, e_rates))
    before = errors.t[errors.late()][0] - errors.t
    sizes = (constants.w * V + constants.w_rate * V_rate) * np.exp(-constants.alpha * before)
    left = sizes[before >= 0].min()
    return {
        "bound": float(limit),
        "transient_left": float(left),
        "w_sup": float(errors.v_sup[-1]),
        "w_rate_sup": w_rate,
        "x_rate_sup": x_rate,
        "holds": entry(limsup, limit + left)["holds"],
    }


def entry(limsup: float, limit: float) -> dict[str, Any]:
    """Return the bound on |what - w| among the bounds of a run."""
    return bound(
        "last fifth: |what - w| <= c1 sup|w| + c2 sup|w'| + c3 sup|x'| + what is left of the transient", limsup, limit
    )


def jump_of(w: Sequence[Expression], breaks: Sequence[tuple[float, float]]) -> float | None:
    """First instant at which a w of time alone jumps; a kink is no jump."""
    for before, after in breaks:
        low, high = table(w, np.array([before, after]))
        if (np.abs(high - low) > JUMP * (1 + np.abs(low))).any():
            return after
    return None


def largest_rate(w: Sequence[Expression], breaks: Sequence[tuple[float, float]], t: Array) -> float:
    """Largest |w'| of a w of time alone; infinite where it has no bound."""
    instants = np.concatenate((t, fine_grid(breaks, float(t[-1]))))
    size = np.linalg.norm(table([signal.derivative("t") for signal in w], instants), axis=1)
    return float(size.max()) if np.isfinite(size).all() else float("inf")
