"""What many runs say together: the worst of each bound and of each error, with the seed that shows it."""

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.errors import Problem, ViolatedError
from obsdesign.families.guarantee import Bound
from obsdesign.simulate.member import Member
from obsdesign.tables.text import at_most

if TYPE_CHECKING:
    from obsdesign.simulate.montecarlo import MonteCarlo

MOMENT = re.compile(r"(?<=at t = )[-+.\de]+")  # which differs from run to run
SAME = "nothing is drawn, so that every run is the same: give simulation.x0_width, noise or uncertainty"

FEWER = (
    "which bounds are stated of a run depends on the disturbance and the noise in it and on when its guarantee ends: "
    "some are stated of a part of the runs"
)


def share(bound: Bound) -> float:
    """Part of a bound that a run takes, as far as the run resolves it; infinite where it exceeds a bound that is 0."""
    if bound["bound"] > 0:
        return bound["value"] / bound["bound"]
    return 0.0 if bound["holds"] else np.inf


def report_of(found: "MonteCarlo") -> dict[str, Any]:
    """Everything that is said of some runs, as `--json`; null where a quantity has no value."""
    members, kept = found.members, found.kept
    without = {"no_guarantee": found.why} if found.why else {}
    bounds = bounds_of(members, proved=not found.why)
    ended = {"stalled": "stall", "stopped": "stopped"}
    return {
        "runs": len(members),
        "seed": members[0].seed,
        **without,
        "bounds": bounds,
        "bounds_omitted": omissions(members, found.why),
        "errors": {name: errors_of(kept, k) for k, name in enumerate(found.names)},
        "escaped": [one.seed for one in members if one.status == "escape"],
        **{name: [one.seed for one in members if one.status == status] for name, status in ended.items()},
        "left_region": [one.seed for one in members if one.left],
        "drawn": drawn_of(found),
        "notes": notes_of(found, bounds),
    }


def bounds_of(members: Sequence[Member], *, proved: bool) -> list[dict[str, Any]]:
    """Each bound in the run that takes the largest part of it."""
    names = dict.fromkeys(bound["name"] for one in members for bound in one.bounds)
    return [{**bound_of(members, name), "proved": proved} for name in names]


def bound_of(members: Sequence[Member], name: str) -> dict[str, Any]:
    """One bound over the runs of which it is told: a run that does not keep it comes before all that do."""
    pairs = [(bound, one.seed) for one in members for bound in one.bounds if bound["name"] == name]
    bound, seed = max(pairs, key=lambda pair: (not pair[0]["holds"], share(pair[0])))
    part = share(bound)
    cut = [
        (each["until"], one.cut_by)
        for one in members
        for each in one.bounds
        if each["name"] == name and "until" in each
    ]
    return {
        "name": name,
        "worst": part if np.isfinite(part) else None,
        "holds": all(each["holds"] for each, _ in pairs),
        "seed": seed,
        "value": bound["value"],
        "bound": bound["bound"],
        "kept": sum(each["holds"] for each, _ in pairs),
        "checked": len(pairs),
        "until": min((time for time, _ in cut), default=None),
        "cut": len(cut),
        "cut_by": [*dict.fromkeys(why for _, why in cut)],
    }


def omissions(members: Sequence[Member], why: str) -> list[dict[str, Any]]:
    """Why bounds are left out, or not checked from some time on, with the number of runs and the first such time.

    `why`: why nothing is proved of any run, which is told once.
    """
    told: dict[str, list[str]] = {}
    for omitted in (one.omitted for one in members if one.omitted and one.omitted != why):
        told.setdefault(MOMENT.sub("", omitted), []).append(omitted)
    return [{"reason": earliest(reasons), "runs": len(reasons)} for reasons in told.values()]


def earliest(reasons: Sequence[str]) -> str:
    """The same reason of some runs, each with its time: that with the earliest one, which is said to be so."""
    first = min(reasons, key=lambda reason: [float(moment) for moment in MOMENT.findall(reason)])
    return first if len(set(reasons)) == 1 else MOMENT.sub(r"\g<0> at the earliest", first)


def errors_of(kept: Sequence[Member], k: int) -> dict[str, Any]:
    """Errors of one estimate in runs that did not escape: over all, and in the worst run."""
    if not kept:
        return dict.fromkeys(("rms", "peak", "seed", "worst_rms", "worst_rms_seed"))
    peak, rms = (max(kept, key=lambda one: one.peak[k]), max(kept, key=lambda one: one.rms[k]))
    return {
        "rms": float(np.sqrt(np.mean([one.rms[k] ** 2 for one in kept]))),
        "peak": peak.peak[k],
        "seed": peak.seed,
        "worst_rms": rms.rms[k],
        "worst_rms_seed": rms.seed,
    }


def worst_seeds(found: "MonteCarlo") -> set[int]:
    """Seeds of the runs that are told of."""
    report = found.report
    told = [bound["seed"] for bound in report["bounds"]]
    told += [errors[key] for errors in report["errors"].values() for key in ("seed", "worst_rms_seed")]
    return {seed for seed in told if seed is not None}


def drawn_of(found: "MonteCarlo") -> dict[str, Any]:
    """What differs from run to run: half-widths of x0, ranges of parameters, noise."""
    simulation = found.spec.simulation
    assert simulation
    width = simulation.x0_width if simulation.x0_width is not None else np.zeros(0)
    ranges = {
        name: [float(one.nominal * (1 - one.share)), float(one.nominal * (1 + one.share))]
        for name, one in simulation.uncertainty.items()
        if one.share
    }
    noisy = simulation.noise is not None and bool(simulation.noise.amplitude.any())
    return {
        "x0_width": {name: float(w) for name, w in zip(found.spec.plant.states, width, strict=False) if w},
        "parameters": {name: sorted(ends) for name, ends in ranges.items()},
        "noise": noisy,
        "intervals": found.intervals,
    }


def notes_of(found: "MonteCarlo", bounds: Sequence[Mapping[str, Any]]) -> list[str]:
    """What is to be known of the runs."""
    said = [SAME] if found.same else []
    lost = len(found.members) - len(found.kept)
    if lost:
        said.append(f"errors and envelope are of the {len(found.kept)} runs that went on; {lost} did not")
    if any(bound["checked"] < len(found.members) for bound in bounds):
        said.append(FEWER)
    return said


def require_all_kept(found: "MonteCarlo", file: str) -> None:
    """Hold runs to the bounds that are proved of them. Raises `ViolatedError` if one breaks one."""
    broken = [bound for bound in found.report["bounds"] if bound["proved"] and not bound["holds"]]
    if broken:
        first = broken[0]
        said = (
            f"the run of seed {first['seed']} breaks a bound that is proved of it: {first['value']:.6g} is not below "
            f"{at_most(first['bound'])} in {first['name']}; this is a defect of obsdesign: please report it with the "
            "spec and the gains file"
        )
        raise ViolatedError(Problem(said, file, id="OBS807"))
