"""What is said about a run of an observer with sporadic measurements."""

from typing import Any

import numpy as np

from obsdesign.simulate.hybrid.record import Record
from obsdesign.simulate.summary import convergence
from obsdesign.simulate.validity import is_local, validity


def summarise(record: Record) -> dict[str, Any]:
    """Everything that is said about a run; None where a quantity does not apply."""
    trajectory, course, guarantee = record.trajectory, record.course, record.system.guarantee
    z, v = float(np.sqrt(course.z2[-1])), float(np.sqrt(course.v2[-1]))
    distance = record.signals.distance
    return {
        "status": trajectory.status,
        "time": trajectory.time,
        "reason": trajectory.reason or None,
        "z_norm2": z,
        "v_norm2": v,
        "ratio": z / v if v else None,
        "ratio_of": "norm2(yp) / norm2(w)",
        "gamma": guarantee.gamma if guarantee else None,
        "sampling": record.system.schedule.report(),
        **checks(record),
        **convergence(course, record.system.plant.states),
        "initial_distance": float(distance[0]),
        "final_distance": float(distance[-1]),
    }


def checks(record: Record) -> dict[str, Any]:
    """Bounds, as far as the guarantee holds, and where the run leaves the region of a local guarantee."""
    found: dict[str, Any] = {"bounds": [], "bounds_omitted": omitted(record)}
    guarantee = record.system.guarantee
    if guarantee is not None:
        covered = record.course.before(record.until)
        if len(covered.t) > 1:
            found["bounds"] = guarantee.bounds(covered)
    if is_local(record.system.spec.nonlinearities):
        found["validity"] = validity(record.left, guarantee is not None)
    return found


def omitted(record: Record) -> str | None:
    """Why a bound, or all, are not checked from some time on."""
    if record.system.guarantee is None:
        return "no guarantee: the gains are not certified"
    if record.left and record.left[0].time <= record.until:
        return f"the guarantee is local, and the run left its region at t = {record.left[0].time:.4g}"
    outside = record.system.schedule.report().get("note")
    return str(outside) if outside else None
