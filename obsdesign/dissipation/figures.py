"""What an engineer asks first of a gain: figures of the linear error dynamics e' = (A + L1 C) e - L1 n."""

from typing import Any

import numpy as np

from obsdesign.lmi.formula import Array, Float
from obsdesign.model.plant import Plant

RUNGE_KUTTA = 2.78  # on the negative real axis, the stability limit of the classical fourth-order method
FREQUENCIES = 400


def figures(plant: Plant[Float], L1: Array, P: Array | None) -> dict[str, Any]:
    """Poles, the fastest of them, the largest step of a fixed-step observer, noise gains, condition of P.

    Returns `poles` as [real, imaginary] in 1/s, the slowest first; `fastest` in 1/s; `largest_step` in s, of the
    classical Runge-Kutta method on these poles; `noise_gain` from measurement noise to each estimate (largest singular
    value over frequency; empty where a pole lies on the imaginary axis); `condition_P`.
    """
    A = plant.A + L1 @ plant.C
    poles = sorted(np.linalg.eigvals(A), key=lambda p: (-p.real, p.imag))
    fastest = max(map(abs, poles))
    found: dict[str, Any] = {"poles": [[float(p.real), float(p.imag)] for p in poles], "fastest": float(fastest)}
    if fastest > 0:
        found["largest_step"] = RUNGE_KUTTA / float(fastest)
    found["noise_gain"] = dict(zip(plant.states, noise_gain(A, L1, poles), strict=False))
    if P is not None:
        found["condition_P"] = float(np.linalg.cond(P))
    return found


def noise_gain(A: Array, L1: Array, poles: list[complex]) -> list[float]:
    """Peak over frequency of each row of (s I - A)^-1 L1, on a grid around the poles."""
    sizes = [abs(p) for p in poles if abs(p) > 0] or [1.0]
    omega = np.concatenate([[0.0], np.geomspace(min(sizes) / 100, max(sizes) * 100, FREQUENCIES), sizes])
    s = 1j * omega[:, None, None]
    try:
        response = np.linalg.solve(s * np.eye(len(A)) - A, np.broadcast_to(L1, (len(omega), *L1.shape)))
    except np.linalg.LinAlgError:  # a pole on the imaginary axis: no gain is finite
        return []
    return [float(g) for g in np.linalg.norm(response, axis=2).max(axis=0)]
