"""Norms of a run against what the guarantee promises."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array
from obsdesign.observers.guarantee import Guarantee

SETTLED = 0.01  # of the peak of |e|
ROUNDING = 1e-6  # relative, of a quantity that meets its bound with equality


class Errors(NamedTuple):
    """The error along a run, with the integrals up to each time."""

    t: Array  # (M,)
    e: Array  # (M, n + nm)
    z2: Array  # (M,): integral of |z|^2
    v2: Array  # (M,): integral of |v|^2
    b: Array  # (M,): integral of mu2 exp(-2 alpha (t - s)) |v(s)|^2


def convergence(errors: Errors, names: Sequence[str]) -> dict[str, Any]:
    """Sizes of the error, and the time after which |e| stays below 1 % of its peak (None if it does not)."""
    size = np.linalg.norm(errors.e, axis=1)
    row, column = divmod(int(np.argmax(np.abs(errors.e))), errors.e.shape[1])
    return {
        "initial_error": float(size[0]),
        "final_error": float(size[-1]),
        "settling_time": settling_time(errors.t, size),
        "worst_peak": {
            "name": names[column],
            "value": float(abs(errors.e[row, column])),
            "time": float(errors.t[row]),
        },
    }


def settling_time(t: Array, size: Array) -> float | None:
    """Time after which |e| stays below 1 % of its peak, exponential between two steps."""
    level = SETTLED * size.max()
    above = np.flatnonzero(size > level)
    if not len(above):
        return float(t[0])
    last, after = above[-1], above[-1] + 1
    if after == len(size):
        return None
    low, high = np.log(np.maximum(size[[after, last]], 1e-300))
    return float(t[after] - (t[after] - t[last]) * (np.log(level) - low) / (high - low))


def storage(errors: Errors, guarantee: Guarantee) -> tuple[Array, Array]:
    """V(e(t)) = e' P e, and its bound exp(-2 alpha t) V(e(0)) + b(t)."""
    V = np.einsum("ti,ij,tj->t", errors.e, guarantee.P, errors.e)
    return V, np.exp(-2 * guarantee.alpha * errors.t) * V[0] + errors.b


def bounds(errors: Errors, guarantee: Guarantee) -> list[dict[str, Any]]:
    """Check the bounds that V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 <= 0 implies.

    norm2(z)     <= sqrt(lmax(P) / mu1) |e(0)| + gamma norm2(v)
    norm2(z)     <= sqrt(e(0)' P e(0) / mu1) + gamma norm2(v)
    |e(t)|       <= exp(-alpha t) sqrt(lmax(P) / lmin(P)) |e(0)| + sqrt(mu2 / lmin(P)) norm2(v)   for all t
    V(e(t))      <= exp(-2 alpha t) V(e(0)) + b(t)                                                for all t

    The first and the third are (16) and (17) of Corless and Chakrabarty (2019), (17) with its two ratios the
    right way up. A bound for all t is reported at the instant where it is tightest.
    """
    size = np.linalg.norm(errors.e, axis=1)
    spectrum = np.linalg.eigvalsh(guarantee.P)
    low, high = spectrum[0], spectrum[-1]
    z, v = np.sqrt(errors.z2[-1]), np.sqrt(errors.v2)
    gain = guarantee.gamma * v[-1]
    V, V_bound = storage(errors, guarantee)
    decay = np.exp(-guarantee.alpha * errors.t) * np.sqrt(high / low) * size[0]
    ultimate = np.sqrt(guarantee.mu2 / low) * v
    return [
        bound(
            "norm2(z) <= sqrt(lmax(P)/mu1) |e(0)| + gamma norm2(v)",
            z,
            np.sqrt(high / guarantee.mu1) * size[0] + gain,
        ),
        bound("norm2(z) <= sqrt(e(0)' P e(0)/mu1) + gamma norm2(v)", z, np.sqrt(V[0] / guarantee.mu1) + gain),
        tightest(
            "|e(t)| <= exp(-alpha t) sqrt(lmax(P)/lmin(P)) |e(0)| + sqrt(mu2/lmin(P)) norm2(v)",
            errors.t,
            size,
            decay + ultimate,
        ),
        tightest(
            "V(e(t)) <= exp(-2 alpha t) V(e(0)) + mu2 integral exp(-2 alpha (t-s)) |v(s)|^2 ds",
            errors.t,
            V,
            V_bound,
        ),
    ]


def bound(name: str, value: float, limit: float) -> dict[str, Any]:
    """One bound."""
    return {
        "name": name,
        "value": float(value),
        "bound": float(limit),
        "holds": bool(value <= limit * (1 + ROUNDING)),
    }


def tightest(name: str, t: Array, value: Array, limit: Array) -> dict[str, Any]:
    """Return a bound for all t > 0, at the instant where the value is the largest part of it."""
    after = slice(1, None) if len(t) > 1 else slice(None)
    t, value, limit = t[after], value[after], limit[after]
    i = int(np.argmax(value / np.maximum(limit, np.finfo(float).tiny)))
    return bound(name, value[i], limit[i]) | {"time": float(t[i])}


def norm_to_infinity(v: Sequence[Expression], horizon: float, so_far: float) -> float | None:
    """norm2(v) over [0, infinity) from the integral of |v|^2 over [0, horizon], if the rest converges."""
    from scipy.integrate import quad

    if any(e.names - {"t"} for e in v):
        return None
    signals = [e.scalar(["t"]) for e in v]
    try:
        tail, error, *trouble = quad(lambda t: sum(s(t) ** 2 for s in signals), horizon, np.inf, full_output=1)
    except ArithmeticError:
        return None
    converged = len(trouble) == 1 and np.isfinite(tail) and error <= ROUNDING * (so_far + tail) + 1e-300
    return float(np.sqrt(so_far + tail)) if converged else None
