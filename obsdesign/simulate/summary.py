"""What is said about a run: its norms, its errors, and whether they keep the bounds that are proved."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from obsdesign.families.guarantee import Bound, Course
from obsdesign.lmi.formula import Array
from obsdesign.simulate.definitions import error, rate
from obsdesign.simulate.record import Record
from obsdesign.simulate.signals import jump_of, largest_rate, norm_to_infinity
from obsdesign.simulate.validity import is_local, validity

LOCAL = "the guarantee is local, and the run left its region"
SETTLED = 0.01  # of the peak of |e|
SHARES = {"t5": 0.05, "t1": 0.01}  # of the initial error of an estimate, by the name of the time at which it is reached


def summarise(record: Record) -> dict[str, Any]:
    """Everything that is said about a run; None where a quantity does not apply."""
    trajectory = record.trajectory
    return {
        "status": trajectory.status,
        "time": trajectory.time,
        "reason": trajectory.reason or None,
        **(norms(record) if record.schedule is None else sampled_norms(record)),
        **checks(record),
        **convergence(record.course, record.acting.plant.states, record.acting.clock is not None),
        "settling": settling(record),
        **distances(record),
        **({} if record.course.inner is None else {"initial_eps": float(np.linalg.norm(record.course.inner[0]))}),
    }


def norms(record: Record) -> dict[str, Any]:
    """Sizes of z and v (or w, as the family has it), and the ratio of those that gamma relates."""
    course, acting, guarantee = record.course, record.acting, record.guarantee
    sup = guarantee is not None and guarantee.norm == "sup"
    z2, z_sup = (float(np.sqrt(course.z2[-1])), float(course.z.max())) if record.has_z else (None, None)
    nothing = acting.unmodeled or record.impulse is not None  # no v of which a norm could be told
    v2, v_sup = (None, None) if nothing else (float(np.sqrt(course.v2[-1])), float(course.v_sup[-1]))
    z, v = (z_sup, v_sup) if sup else (z2, v2)
    endless = (
        None
        if sup or v2 is None or acting.clock or acting.noises
        else norm_to_infinity(acting.driving, record.trajectory.time, course.v2[-1])
    )
    return {
        "z_norm2": z2,
        f"{course.drive}_norm2": v2,
        f"{course.drive}_norm2_infinite": endless,
        "z_sup": z_sup,
        f"{course.drive}_sup": v_sup,
        "ratio": z / v if z is not None and v else None,
        "ratio_of": "sup|z| / sup|v|" if sup else f"norm2(z) / norm2({course.drive})",
        "gamma": guarantee.gamma if guarantee and acting.drive and not record.foreign else None,
    }


def sampled_norms(record: Record) -> dict[str, Any]:
    """Sizes of z and w, their ratio, and how the measurements arrived."""
    course, guarantee, schedule = record.course, record.guarantee, record.schedule
    assert schedule
    z, v = float(np.sqrt(course.z2[-1])), float(np.sqrt(course.v2[-1]))
    return {
        "z_norm2": z,
        "v_norm2": v,
        "ratio": z / v if v else None,
        "ratio_of": "norm2(z) / norm2(w)",
        "gamma": guarantee.gamma if guarantee and not record.foreign else None,
        "sampling": schedule.report(),
    }


def distances(record: Record) -> dict[str, float]:
    """Length of (e, theta~) at the start and at the end, where there is a theta beside the estimates."""
    if not record.system.corrections:
        return {}
    distance = record.signals.distance
    return {"initial_distance": float(distance[0]), "final_distance": float(distance[-1])}


def checks(record: Record) -> dict[str, Any]:
    """Bounds, the accuracy of a reconstruction, and where the run leaves the region of a local guarantee."""
    found: dict[str, Any] = {"bounds": [], "bounds_omitted": omitted(record)}
    if not record.uncovered:
        found["bounds"], endless = stated(record)
        endless = [f"left out, for it has no finite limit: {name}" for name in endless]
        found["bounds_omitted"] = "; ".join(filter(None, (found["bounds_omitted"], *endless))) or None
    if record.foreign:
        found |= {"no_guarantee": record.foreign, "observed": [] if record.uncheckable else stated(record)[0]}
    if record.spec.observer.reconstruct:
        found["reconstruction"], bounds = reconstruction(record)
        found["bounds"] += bounds
    if is_local(record.spec.nonlinearities):
        found["validity"] = validity(
            record.spec.nonlinearities, record.left, record.guarantee is not None and not record.foreign
        )
    until, _ = record.cut
    if np.isfinite(until):
        found |= {
            key: [{**one, "until": until} for one in found[key]] for key in ("bounds", "observed") if key in found
        }
    return found


def stated(record: Record) -> tuple[list[Bound], list[str]]:
    """Bounds against the run as far as a guarantee covers it, and the names of those that have no finite limit."""
    covered = record.course.before(record.until)
    every = record.guarantee.bounds(covered) if record.guarantee and len(covered.t) > 1 else []
    finite = [entry for entry in every if np.isfinite(entry["bound"])]
    return finite, [entry["name"] for entry in every if not np.isfinite(entry["bound"])]


def omitted(record: Record) -> str | None:
    """Why a bound, or all, are not checked, or not from some time on."""
    if record.uncovered:
        return record.uncovered
    if record.left and record.left[0].time <= record.until:
        return f"every bound from then on: {LOCAL} at t = {record.left[0].time:.4g}"
    outside = record.schedule.report().get("note") if record.schedule else None
    return str(outside) if outside else None


def reconstruction(record: Record) -> tuple[dict[str, Any], list[Bound]]:
    """Accuracy of what, the bound on it or a note why there is none, and the bound where something is proved by it."""
    size = np.linalg.norm(record.signals.w_error, axis=1)
    found = {"limsup": float(size[record.course.late()].max()), "peak": float(size.max())}
    guarantee, acting = record.guarantee, record.acting
    if guarantee is None or guarantee.reconstruction is None:
        return found | {"note": "no bound on what - w is proved for these gains"}, []
    if why := no_reconstruction_bound(record):
        return found | {"note": why}, []
    states = record.acting.plant.states
    rates = record.now.of(map(rate, states)), record.now.of(rate(error(name)) for name in states)
    w_rate = largest_rate(acting, record.breaks, record.t) if acting.timed else sampled_rate(record)
    if not np.isfinite(w_rate):
        return found | {"note": "w' is not bounded: no bound on what - w holds"}, []
    terms, proved = guarantee.reconstruction.check(record.course, found["limsup"], rates, w_rate)
    found |= terms
    if acting.timed:
        return found, [proved]
    return found | {"note": "w depends on the states, w' is a difference: nothing is proved"}, []


def no_reconstruction_bound(record: Record) -> str:
    """Why the bound on what - w does not apply to this run, or nothing."""
    if record.uncovered:
        return record.uncovered
    if record.left:
        return f"{LOCAL} at t = {record.left[0].time:.4g}"
    if record.acting.timed and (jump := jump_of(record.acting, record.breaks)) is not None:
        return f"w jumps at t = {jump:.6g}, so that w' is not bounded: no bound on what - w holds"
    return ""


def sampled_rate(record: Record) -> float:
    """Largest |w'| by differences of the samples."""
    samples = record.at_samples()
    return float((np.linalg.norm(np.diff(samples.w, axis=0), axis=1) / np.diff(samples.t)).max(initial=0.0))


def convergence(course: Course, names: Sequence[str], in_samples: bool = False) -> dict[str, Any]:
    """Sizes of the error, and the time after which |e| stays below 1 % of its peak (None if it does not)."""
    size = np.linalg.norm(course.e, axis=1)
    row, column = divmod(int(np.argmax(np.abs(course.e))), course.e.shape[1])
    return {
        "initial_error": float(size[0]),
        "final_error": float(size[-1]),
        "settling_time": settling_time(course.t, size, in_samples),
        "worst_peak": {
            "name": names[column],
            "value": float(abs(course.e[row, column])),
            "time": float(course.t[row]),
        },
    }


def settling(record: Record) -> dict[str, dict[str, float | None]]:
    """Last times at which each estimate, of a state or of w, is off by more than 5 % and 1 % of its error at first.

    They are 0 where there is no error at first; `peak` is the largest |error|.
    """
    states = zip(record.acting.plant.states[: record.acting.n], record.e.T, strict=False)
    inputs = zip((record.acting.inputs[i] for i in record.estimated), record.signals.w_error.T, strict=True)
    in_samples = record.acting.clock is not None
    return {name: settled(record.t, e, in_samples) for name, e in (*states, *inputs)}


def settled(t: Array, e: Array, in_samples: bool = False) -> dict[str, float | None]:
    """Entry of `settling` of an error (N,) at times t."""
    size = abs(float(e[0]))
    times = {key: last_above(t, e, share * size, in_samples) if size else 0.0 for key, share in SHARES.items()}
    return {**times, "peak": float(np.abs(e).max())}


def settling_time(t: Array, size: Array, in_samples: bool = False) -> float | None:
    """Time after which |e| stays below 1 % of its peak."""
    return last_above(t, size, SETTLED * size.max(), in_samples)


def last_above(t: Array, e: Array, level: float, in_samples: bool = False) -> float | None:
    """Last time at which |e| is above a level, (N,) values at times t; None if it still is at the end.

    Between two steps e is taken as exponential, as a straight line where it changes its sign. In samples it is the
    first from which on |e| is not above the level.
    """
    above = np.flatnonzero(np.abs(e) > level)
    if not len(above):
        return float(t[0])
    last, after = above[-1], above[-1] + 1
    if after == len(e):
        return None
    if in_samples:
        return float(t[after])
    values = e[[last, after]] * np.sign(e[last])
    high, low, wanted = (*values, level) if values[1] <= 0 else np.log(np.maximum([*values, level], 1e-300))
    return float(t[last] + (t[after] - t[last]) * (high - wanted) / (high - low))
