"""What a guarantee promises of a run, and whether the run keeps it."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from obsdesign.dissipation.guarantee import Guarantee
from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array

ROUNDING = 1e-6  # relative, of a quantity that meets its bound with equality
RESOLVED = 1e-9  # of the largest error: what the integration tells from zero
LAST = 0.8  # of the run: the limit of an error for t -> infinity is looked for after that
GRID = 20_001  # instants at which a signal of time is looked at


class Errors(NamedTuple):
    """The error along a run, with what its bounds are made of up to each time."""

    t: Array  # (M,)
    e: Array  # (M, n + nm)
    z: Array  # (M,): |z|
    z2: Array  # (M,): integral of |z|^2
    v2: Array  # (M,): integral of |v|^2
    v_sup: Array  # (M,): largest |v|
    b: Array  # (M,): integral of c exp(-2 alpha (t - s)) |v(s)|^2, with V' <= -2 alpha V + c |v|^2

    def before(self, time: float) -> "Errors":
        """Return the part before a time."""
        return Errors(*(column[self.t < time] for column in self))

    def late(self) -> Array:
        """Which instants belong to the last fifth of the run, (M,)."""
        return np.asarray(self.t >= LAST * self.t[-1])


def storage(errors: Errors, guarantee: Guarantee) -> tuple[Array, Array]:
    """V(e(t)) = e' P e, and its bound exp(-2 alpha t) V(e(0)) + b(t)."""
    V = np.einsum("ti,ij,tj->t", errors.e, guarantee.P, errors.e)
    return V, np.exp(-2 * guarantee.alpha * errors.t) * V[0] + errors.b


def bounds(errors: Errors, guarantee: Guarantee, drive: str = "v") -> list[dict[str, Any]]:
    """Check what the guarantee implies; a bound for all t is reported at the instant where it is tightest.

    Parameters
    ----------
    drive
        What v is called.
    """
    return linf(errors, guarantee) if guarantee.family == "linf" else l2(errors, guarantee, drive)


def l2(errors: Errors, guarantee: Guarantee, drive: str = "v") -> list[dict[str, Any]]:
    """Check the bounds that V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 <= 0 implies.

    norm2(z)     <= sqrt(lmax(P) / mu1) |e(0)| + gamma norm2(v)
    norm2(z)     <= sqrt(e(0)' P e(0) / mu1) + gamma norm2(v)
    |e(t)|       <= exp(-alpha t) sqrt(lmax(P) / lmin(P)) |e(0)| + sqrt(mu2 / lmin(P)) norm2(v)   for all t
    V(e(t))      <= exp(-2 alpha t) V(e(0)) + b(t)                                                for all t

    The first and the third are (16) and (17) of Corless and Chakrabarty (2019), (17) with its two ratios the
    right way up. alpha may be zero; the family lipschitz calls it decay, and has mu1 = 1.
    """
    size = np.linalg.norm(errors.e, axis=1)
    spectrum = np.linalg.eigvalsh(guarantee.P)
    low, high = spectrum[0], spectrum[-1]
    z, v = np.sqrt(errors.z2[-1]), np.sqrt(errors.v2)
    gain = guarantee.gamma * v[-1]
    V, V_bound = storage(errors, guarantee)
    decay = np.exp(-guarantee.alpha * errors.t) * np.sqrt(high / low) * size[0]
    ultimate = np.sqrt(guarantee.mu2 / low) * v
    rate, weight = ("decay", "") if guarantee.family == "lipschitz" else ("alpha", "/mu1")
    once, twice, since = (
        (f"exp(-{rate} t) ", f"exp(-2 {rate} t) ", f"exp(-2 {rate} (t-s)) ") if guarantee.alpha else ("", "", "")
    )
    return [
        bound(
            f"norm2(z) <= sqrt(lmax(P){weight}) |e(0)| + gamma norm2({drive})",
            z,
            np.sqrt(high / guarantee.mu1) * size[0] + gain,
        ),
        bound(
            f"norm2(z) <= sqrt(e(0)' P e(0){weight}) + gamma norm2({drive})", z, np.sqrt(V[0] / guarantee.mu1) + gain
        ),
        tightest(
            f"|e(t)| <= {once}sqrt(lmax(P)/lmin(P)) |e(0)| + sqrt(mu2/lmin(P)) norm2({drive})",
            errors.t,
            size,
            decay + ultimate,
        ),
        tightest(
            f"sqrt(V(e(t))) <= sqrt({twice}V(e(0)) + mu2 integral {since}|{drive}(s)|^2 ds)",
            errors.t,
            np.sqrt(V),
            np.sqrt(V_bound),
        ),
    ]


def linf(errors: Errors, guarantee: Guarantee) -> list[dict[str, Any]]:
    """Check the bounds that V' <= -2 alpha (V - mu1 |v|^2) and |z|^2 <= mu2 V imply.

    |z(t)|^2     <= mu2 (exp(-2 alpha t) V(e(0)) + mu1 (1 - exp(-2 alpha t)) sup|v|^2)   for all t
    |z(t)|       <= gamma sup|v|                                                         for all t, if e(0) = 0
    |z(t)|       <= gamma sup|v| + sqrt(mu2 V(e(0))) exp(-alpha t)                       ultimately
    V(e(t))      <= exp(-2 alpha t) V(e(0)) + b(t)                                       for all t

    This is Lemma 1 of Chakrabarty, Corless, Buzzard, Zak and Rundell on exogenous inputs; the first bound
    also with lmax(P) |e(0)|^2 for V(e(0)). The sup is that over [0, t].
    """
    V, V_bound = storage(errors, guarantee)
    largest_V = np.linalg.eigvalsh(guarantee.P)[-1] * (errors.e[0] @ errors.e[0])
    left = np.exp(-2 * guarantee.alpha * errors.t)
    gain = guarantee.gamma * errors.v_sup

    def envelope(start: float) -> Array:
        return np.sqrt(guarantee.mu2 * left * start + (1 - left) * gain**2)

    late = errors.late()
    zero = [] if errors.e[0].any() else [tightest("|z(t)| <= gamma sup|v| from zero error", errors.t, errors.z, gain)]
    rate = "exp(-2 alpha t)"
    return [
        *(
            tightest(
                f"|z(t)| <= sqrt(mu2 ({rate} {start} + mu1 (1 - {rate}) sup|v|^2))", errors.t, errors.z, envelope(size)
            )
            for start, size in (("V(e(0))", float(V[0])), ("lmax(P) |e(0)|^2", float(largest_V)))
        ),
        *zero,
        tightest(
            "last fifth: |z(t)| <= gamma sup|v| + sqrt(mu2 V(e(0))) exp(-alpha t)",
            errors.t[late],
            errors.z[late],
            (gain + np.sqrt(guarantee.mu2 * V[0] * left))[late],
            float(errors.z.max()),
        ),
        tightest(
            f"sqrt(V(e(t))) <= sqrt({rate} V(e(0)) + 2 alpha mu1 integral exp(-2 alpha (t-s)) |v(s)|^2 ds)",
            errors.t,
            np.sqrt(V),
            np.sqrt(V_bound),
        ),
    ]


def bound(name: str, value: float, limit: float, resolved: float = 0.0) -> dict[str, Any]:
    """One bound; a value that exceeds it by no more than the integration resolves keeps it."""
    return {
        "name": name,
        "value": float(value),
        "bound": float(limit),
        "holds": bool(value <= limit * (1 + ROUNDING) + resolved),
    }


def tightest(name: str, t: Array, value: Array, limit: Array, peak: float | None = None) -> dict[str, Any]:
    """Return a bound for all t > 0, at the instant where the value is the largest part of it.

    Parameters
    ----------
    peak
        Largest value of the run, if it is not among these.
    """
    after = t > 0 if t[-1] > 0 else t >= 0
    t, value, limit = t[after], value[after], limit[after]
    resolved = RESOLVED * (float(value.max()) if peak is None else peak)
    i = int(np.argmax(value / np.maximum(limit + resolved, np.finfo(float).tiny)))
    return bound(name, value[i], limit[i], resolved) | {"time": float(t[i])}


def largest_so_far(
    signals: Sequence[Expression], breaks: Sequence[tuple[float, float]], t: Array, values: Array
) -> Array:
    """Largest |v| over [0, t], (M,), of signals v with the values (M, nv) at the instants t.

    Signals of time alone are looked at on a fine grid and on both sides of each break, too.
    """
    sizes = np.linalg.norm(values, axis=1)
    if any(signal.names - {"t"} for signal in signals):
        return np.maximum.accumulate(sizes)
    grid = fine_grid(breaks, float(t[-1]))
    times = np.concatenate((t, grid))
    order = np.argsort(times, kind="stable")
    sizes = np.concatenate((sizes, np.linalg.norm(table(signals, grid), axis=1)))[order]
    largest = np.maximum.accumulate(np.where(np.isfinite(sizes), sizes, 0.0))
    return np.asarray(largest[np.searchsorted(times[order], t, side="right") - 1])


def fine_grid(breaks: Sequence[tuple[float, float]], end: float) -> Array:
    """Instants in [0, end], with both sides of each break."""
    sides = np.array([side for pair in breaks for side in pair])
    return np.concatenate((np.linspace(0, end, GRID), sides[sides <= end]))


def table(signals: Sequence[Expression], t: Array) -> Array:
    """Values of signals of time alone, (len(t), len(signals))."""
    columns = [np.broadcast_to(s.function(["t"])(t) if s.names else s.function([])(), t.shape) for s in signals]
    return np.column_stack(columns) if columns else np.zeros((len(t), 0))
