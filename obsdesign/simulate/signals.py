"""Signals of time alone: their values, their largest value, rate and energy."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.families.guarantee import ROUNDING
from obsdesign.lmi.formula import Array

SWITCH_GRID = 20_000  # cells in which the sign of a switching function is watched
GRID = 20_001  # instants at which a signal of time is looked at
JUMP = 1e-9  # of w against its size: smaller is rounding


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


def switch_times(expressions: Sequence[Expression], horizon: float) -> list[tuple[float, float]]:
    """Instants in (0, horizon) at which a switching function of t alone changes its sign.

    Returns
    -------
    list of (before, after)
        Neighboring doubles, increasing. A zero of the function itself lies between two such pairs.
    """
    switches = [s for e in expressions for s in e.switches("t") if s.names == {"t"}]
    found = {pair for s in switches for pair in sign_changes(s, horizon)}
    return sorted(found)


def sign_changes(switch: Expression, horizon: float) -> Iterator[tuple[float, float]]:
    """Neighboring doubles between which a function of t changes its sign: seen on a grid, then bisected."""
    scalar = switch.scalar(["t"])

    def sign(t: float) -> float:
        return float(np.sign(scalar(t)))

    grid = np.linspace(0, horizon, SWITCH_GRID + 1)
    signs = np.sign(switch.function(["t"])(grid))
    for i in np.flatnonzero(signs[1:] != signs[:-1]):
        low, high = float(grid[i]), float(grid[i + 1])
        end = sign(high)
        while sign(low) != end:
            low, after = bisect(sign, low, high)
            yield low, after
            low = after


def bisect(sign: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    """Neighboring doubles in [low, high]: the sign of `low` at the first and another at the second."""
    start = sign(low)
    while low < (middle := 0.5 * (low + high)) < high:
        if sign(middle) == start:
            low = middle
        else:
            high = middle
    return low, high
