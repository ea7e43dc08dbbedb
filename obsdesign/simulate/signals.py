"""Signals of time alone: their values, their largest value, rate and energy."""

from collections.abc import Sequence

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.families.guarantee import ROUNDING
from obsdesign.lmi.formula import Array
from obsdesign.simulate.recorded import Recordings
from obsdesign.simulate.scenario import Scenario

GRID = 20_001  # instants at which a signal of time is looked at
JUMP = 1e-9  # of w against its size: smaller is rounding
NONE = Recordings()


def largest_so_far(acting: Scenario, breaks: Sequence[tuple[float, float]], t: Array, values: Array) -> Array:
    """Largest |v| over [0, t], (M,), of v with the values (M, nv) at the instants t.

    Signals of time alone are looked at on a fine grid and on both sides of each break and row of a file, too.
    """
    sizes = np.linalg.norm(values, axis=1)
    if not acting.timed:
        return np.maximum.accumulate(sizes)
    grid = fine_grid(acting, breaks, float(t[-1]))
    times = np.concatenate((t, grid))
    order = np.argsort(times, kind="stable")
    sizes = np.concatenate((sizes, np.linalg.norm(table(acting.driving, grid, acting.recorded), axis=1)))[order]
    largest = np.maximum.accumulate(np.where(np.isfinite(sizes), sizes, 0.0))
    return np.asarray(largest[np.searchsorted(times[order], t, side="right") - 1])


def fine_grid(acting: Scenario, breaks: Sequence[tuple[float, float]], end: float) -> Array:
    """Instants in [0, end], with both sides of each break, and of each row of a file where a signal jumps or bends."""
    sides = np.array([*breaks, *acting.recorded.edges(end)]).ravel()
    return np.concatenate((np.linspace(0, end, GRID), sides[sides <= end]))


def table(signals: Sequence[Expression], t: Array, recorded: Recordings = NONE) -> Array:
    """Values of signals of time alone, (len(t), len(signals)), some of them in files."""
    known = {"t": t, **recorded.at(t)}
    columns = [np.broadcast_to(s.function([*known])(*known.values()), t.shape) for s in signals]
    return np.column_stack(columns) if columns else np.zeros((len(t), 0))


def jump_of(acting: Scenario, breaks: Sequence[tuple[float, float]]) -> float | None:
    """First instant at which a w of time alone jumps; a kink is no jump."""
    pairs = np.array(sorted([*breaks, *acting.recorded.edges(acting.horizon)])).reshape(-1, 2)
    low, high = (table(acting.v, side, acting.recorded) for side in pairs.T)
    jumps = np.flatnonzero((np.abs(high - low) > JUMP * (1 + np.abs(low))).any(axis=1))
    return float(pairs[jumps[0], 0]) if len(jumps) else None


def largest_rate(acting: Scenario, breaks: Sequence[tuple[float, float]], t: Array) -> float:
    """Largest |w'| of a w of time alone; infinite where it has no bound."""
    instants = np.concatenate((t, fine_grid(acting, breaks, float(t[-1]))))
    size = np.linalg.norm(np.column_stack([rate_of(signal, acting, instants) for signal in acting.v]), axis=1)
    return float(size.max()) if np.isfinite(size).all() else float("inf")


def rate_of(signal: Expression, acting: Scenario, t: Array) -> Array:
    """Rate of a signal of time alone at instants (N,)."""
    slopes = acting.recorded.rate(signal, t)
    return table([signal.derivative("t")], t)[:, 0] if slopes is None else slopes


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
