"""Result files of clock-dependent certificates: what is written of a claim, and how it is read and held again."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from obsdesign.families.sporadic.clock.bernstein import Clock
from obsdesign.families.sporadic.clock.claim import CONSTANTS, ClockClaim
from obsdesign.families.sporadic.clock.outage import Outage
from obsdesign.families.sporadic.clock.outage import read as read_outage
from obsdesign.families.sporadic.clock.theorem import ClockTheorem, error_system
from obsdesign.families.sporadic.clock.witness import GOALS, Witness
from obsdesign.families.sporadic.clock.witness import read as read_witness
from obsdesign.families.sporadic.held import held, read_gains, require_asked
from obsdesign.families.sporadic.observer import sampled
from obsdesign.families.sporadic.request import request_of
from obsdesign.files import ResultFile
from obsdesign.lmi.formula import Array, approximate
from obsdesign.spec import Spec

WITNESSED = {"overshoot", "disturbance", "noise", "T2_max"}  # claims with a witness of the same name


def read(spec: Spec, file: ResultFile) -> ClockClaim:
    """Claim of a file, checked: every witness of it.

    Raises `UsageError`: it is malformed, or not what the spec asks for.
    """
    request, plant, gains = request_of(spec), spec.augmented, read_gains(spec, file)
    asked = {key: file.number("guarantee", key) for key in ("decay", "T1", "T2")}
    require_asked(file, request, gains, asked, plant.C)
    root = ("certificate", "witnesses")
    named = file.table(*root)
    if wrong := named.keys() - {*GOALS, "T2_max"} or {"gamma"} - named.keys():
        known = ", ".join((*GOALS, "T2_max"))
        raise file.wrong(".".join((*root, min(wrong))), f"expected gamma, and of {known} those that apply", id="OBS702")
    if missing := (WITNESSED & file.table("guarantee").keys()) - named.keys():
        raise file.wrong(".".join((*root, min(missing))), "missing: the guarantee claims it", id="OBS702")
    error = error_system(plant, spec.H, gains)
    theorem = ClockTheorem(
        error, spec.multiplier, Clock((asked["T2"],), 1), asked["T1"], asked["decay"], request.shape.lookahead
    )
    found = {
        name: read_witness(file, GOALS[name], theorem, asked["T2"], *root, name) for name in named if name in GOALS
    }
    longest = None
    if "T2_max" in named:
        most = file.number("guarantee", "T2_max")
        if most < asked["T2"] or "K_of_gap" in gains:
            said = "is for a gain that does not depend on the interval" if "K_of_gap" in gains else "is below T2"
            raise file.wrong("guarantee.T2_max", said, id="OBS702")
        longest = read_witness(file, GOALS["overshoot"], theorem, most, *root, "T2_max")
    overdue = None
    if "outage" in file.table("guarantee") or "outage" in file.table(*root).get("overshoot", {}):
        if "overshoot" not in found:
            raise file.wrong(".".join((*root, "overshoot")), "missing: an outage is one of its V", id="OBS702")
        overdue = read_outage(file, found["overshoot"], *root, "overshoot", "outage")
        require_outage(file, overdue)
    require_segments(file, gains, found.values())
    direct = any([*plant.D.flat, *plant.Df.flat])
    claim = ClockClaim(
        error,
        spec.multiplier,
        direct,
        gains,
        asked["T1"],
        asked["T2"],
        asked["decay"],
        found,
        longest,
        overdue,
        held(request, gains),
    )
    told = {*claim.least, *file.table("guarantee")}
    stated = {key: file.number("guarantee", key) for key in CONSTANTS if key in told}
    return replace(claim, stated=stated) if stated != claim.constants else claim


def require_segments(file: ResultFile, gains: Mapping[str, Array], witnesses: Iterable[Witness]) -> None:
    """Refuse storage functions that are not polynomials on the segments of a gain that depends on the interval."""
    for witness in witnesses if "K_of_gap" in gains else ():
        clock, T1 = witness.theorem.clock, witness.theorem.T1
        late = [s for s in clock.knots if s >= T1]
        if late != gains["knots"].tolist() or clock.degree != gains["K_of_gap"].shape[1] - 1:
            said = "the storage functions and K have not the same degree on the same segments"
            raise file.wrong("observer.K_of_gap", said, id="OBS702")


def require_outage(file: ResultFile, outage: Outage) -> None:
    """Refuse a growth or a share that is better than what is proved."""
    growth, share = (file.number("guarantee", "outage", name) for name in ("growth", "share"))
    if growth < outage.growth or share > outage.share:
        raise file.wrong("guarantee.outage", "is better than what its witness proves", id="OBS705")


def written(spec: Spec, claim: ClockClaim) -> dict[str, Any]:
    """Entry `observer`: gains, their intervals, and how the error contracts over one."""
    gains = {name: gain.astype(float) for name, gain in claim.gains.items()}
    told = {name: gain.tolist() for name, gain in gains.items()}
    if "K_of_gap" in told:
        told = {"K_of_gap": {"knots": told["knots"], "K": told["K_of_gap"]}}
    return {
        **told,
        "T1": approximate(claim.T1),
        "T2": approximate(claim.T2),
        **sampled(spec, gains, claim.guarantee(spec)).figures(),
    }
