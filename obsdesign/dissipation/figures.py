"""What an engineer asks first of a gain: poles of A + L1 C, and what `analysis` finds over the members of the class."""

from typing import Any

import numpy as np

from obsdesign.dissipation.analysis import Errors
from obsdesign.lmi.formula import Array


def figures(errors: Errors, P: Array | None) -> dict[str, Any]:
    """Poles, the fastest of them, the largest step of a fixed-step observer, noise gains, condition of P.

    Returns `poles` of A + L1 C, which leaves f out, as [real, imaginary], the slowest first: in 1/s, or of samples;
    in continuous time `fastest` of these in 1/s and `largest_step` in s of the classical Runge-Kutta method, for every
    frozen member, whereas samples leave no step to choose; `noise_gain` from measurement noise to each estimate, of the
    worst member (largest singular value over frequency; empty where a pole is not stable); `condition_P`, if
    doubles hold it.
    """
    A = errors.plant.A + errors.L1 @ errors.plant.C
    poles = np.linalg.eigvals(A)
    poles = poles[np.lexsort((poles.imag, errors.modes.rates(poles)))]
    found: dict[str, Any] = {"poles": [[float(p.real), float(p.imag)] for p in poles]}
    if not errors.modes.sampled:
        found |= {"fastest": float(np.abs(poles).max()), "largest_step": errors.explicit_step["rk4"]}
    found["noise_gain"] = errors.noise_gain()
    condition = np.inf if P is None else float(np.linalg.cond(P))
    return found | ({"condition_P": condition} if np.isfinite(condition) else {})
