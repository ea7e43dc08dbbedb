"""What is said about a run: its norms, its errors, and whether they keep the bounds that are proved."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array
from obsdesign.simulate.bounds import ROUNDING, Errors, bounds
from obsdesign.simulate.reconstruction import accuracy, entry, jump_of, largest_rate, proved
from obsdesign.simulate.record import Record
from obsdesign.simulate.validity import is_local, validity

SETTLED = 0.01  # of the peak of |e|


def summarise(record: Record) -> dict[str, Any]:
    """Everything that is said about a run; None where a quantity does not apply."""
    trajectory, errors, guarantee = record.trajectory, record.errors, record.guarantee
    return {
        "status": trajectory.status,
        "time": trajectory.time,
        "reason": trajectory.reason or None,
        **norms(record),
        "gamma": guarantee.gamma if guarantee and record.acting.v else None,
        **checks(record),
        **convergence(errors, record.acting.plant.states),
    }


def norms(record: Record) -> dict[str, Any]:
    """Sizes of z and v (or w, as the family has it), and the ratio of those that gamma relates."""
    errors, acting, guarantee, drive = record.errors, record.acting, record.guarantee, record.spec.drive
    sup = guarantee is not None and guarantee.family == "linf"
    z2, z_sup = (float(np.sqrt(errors.z2[-1])), float(errors.z.max())) if record.has_z else (None, None)
    v2, v_sup = (None, None) if acting.unmodeled else (float(np.sqrt(errors.v2[-1])), float(errors.v_sup[-1]))
    z, v = (z_sup, v_sup) if sup else (z2, v2)
    endless = None if sup or v2 is None else norm_to_infinity(acting.v, record.trajectory.time, errors.v2[-1])
    return {
        "z_norm2": z2,
        f"{drive}_norm2": v2,
        f"{drive}_norm2_infinite": endless,
        "z_sup": z_sup,
        f"{drive}_sup": v_sup,
        "ratio": z / v if z is not None and v else None,
        "ratio_of": "sup|z| / sup|v|" if sup else f"norm2(z) / norm2({drive})",
    }


def checks(record: Record) -> dict[str, Any]:
    """Bounds, the accuracy of a reconstruction, and where the run leaves the region of a local guarantee."""
    found: dict[str, Any] = {"bounds": [], "bounds_omitted": record.uncovered or None}
    if record.guarantee and not record.uncovered:
        until = record.left[0].time if record.left else np.inf
        covered = record.errors.before(until)
        if len(covered.t) > 1:
            found["bounds"] = bounds(covered, record.guarantee, record.spec.drive)
        if record.left:
            found["bounds_omitted"] = f"the guarantee is local, and the run left its region at t = {until:.4g}"
    if record.spec.reconstructs:
        found["reconstruction"] = accurate = reconstruction(record)
        if "bound" in accurate and "note" not in accurate:
            found["bounds"] += [entry(accurate["limsup"], accurate["bound"] + accurate["transient_left"])]
    if is_local(record.spec.nonlinearities):
        found["validity"] = validity(record.left, record.guarantee is not None)
    return found


def reconstruction(record: Record) -> dict[str, Any]:
    """Accuracy of what, and the bound on it, or a note why there is none or nothing is proved by it."""
    found = accuracy(record.errors, record.signals.w_error)
    guarantee, w = record.guarantee, record.acting.v
    if guarantee is None or guarantee.reconstruction is None:
        return found | {"note": "no bound on what - w is proved for these gains"}
    if why := no_reconstruction_bound(record):
        return found | {"note": why}
    n = record.acting.plant.n
    rates = record.now.rates[:, :n], record.now.rates[:, n:]
    known = not any(signal.names - {"t"} for signal in w)
    rate = largest_rate(w, record.breaks, record.t) if known else sampled_rate(record)
    if not np.isfinite(rate):
        return found | {"note": "w' is not bounded: no bound on what - w holds"}
    found |= proved(record.errors, guarantee, found["limsup"], rates, rate)
    return found if known else found | {"note": "w depends on the states, w' is a difference: nothing is proved"}


def no_reconstruction_bound(record: Record) -> str:
    """Why the bound on what - w does not apply to this run, or nothing."""
    if record.uncovered:
        return record.uncovered
    if record.left:
        return f"the guarantee is local, and the run left its region at t = {record.left[0].time:.4g}"
    w = record.acting.v
    if not any(signal.names - {"t"} for signal in w) and (jump := jump_of(w, record.breaks)) is not None:
        return f"w jumps at t = {jump:.6g}, so that w' is not bounded: no bound on what - w holds"
    return ""


def sampled_rate(record: Record) -> float:
    """Largest |w'| by differences of the samples."""
    samples = record.at_samples()
    return float((np.linalg.norm(np.diff(samples.w, axis=0), axis=1) / np.diff(samples.t)).max(initial=0.0))


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
