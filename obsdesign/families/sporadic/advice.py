"""What would be possible instead of a request without gains: only what was tried with all of it, and certified."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from flint import fmpq

from obsdesign.dissipation.bounds import ends
from obsdesign.dissipation.decimals import round_down, round_up
from obsdesign.families.outcome import Diagnosis
from obsdesign.families.sporadic.gains import SHORTER
from obsdesign.families.sporadic.request import EXPONENTS
from obsdesign.families.sporadic.study import Study
from obsdesign.lmi.formula import printed

ROOM = (0.02, 0.05, 0.15, 0.4)  # relative, from where solutions end to what is tried
DIGITS = 3  # of what is suggested


def certified(study: Study, T2: fmpq, decay: fmpq, **bounds: fmpq) -> bool:
    """Whether gains are proved with another T2 and decay, T1 no longer than T2, and other bounds, all else as it is."""
    low, delta = ends(study.request.T2)[0], study.setting.delta
    if delta.low * low == EXPONENTS.low and delta.high * low == EXPONENTS.high:  # the default, which follows T2
        delta = replace(delta, low=delta.low * low / T2, high=delta.high * low / T2)
    setting = replace(study.setting, T1=min(study.setting.T1, T2), delta=delta)
    request = replace(study.request, T2=T2, decay=decay, delta=delta, **bounds)
    return Study(setting, study.scheme, request).at(T2, decay).status == "certified"


def lower(study: Study, edges: Mapping[str, float | None], T2: fmpq, decay: fmpq) -> Iterator[str]:
    """Suggest a T2, or a decay, below where solutions seem to end."""
    for name, end in edges.items():
        tried = [printed(round_down(end * (1 - room), DIGITS)) for room in ROOM] if end else []
        asked = ((v, {"T2": T2, "decay": decay} | {name: v}) for v in tried)
        found = next((v for v, values in asked if certified(study, **values)), None)
        if found is not None:
            also = f" and T1, which is {float(study.setting.T1):g}, no longer than T2"
            yield f"ask for {name} at most {float(found):g}" + (
                also if name == "T2" and found < study.setting.T1 else ""
            )


def wider(study: Study, known: Diagnosis, T2: fmpq, decay: fmpq) -> Diagnosis:
    """Complete an answer that bounds are in the way: one that would do, or a T2 or decay within them."""
    bound, key, words = {"gamma": ("largest_gamma", "gamma", "gamma"), "bounds": ("largest_gain", "L", "|L|")}[
        known["condition"]
    ]
    feasible: dict[str, Any] = dict(known["feasible"])
    least: float | None = study.enough(float(T2), float(decay)) if key == "L" else feasible["gamma"]
    said = [known["suggestion"]] if key == "L" and feasible else []
    for value in [round_up(least * (1 + room), DIGITS + 1) for room in ROOM] if least else []:
        if certified(study, T2, decay, **{bound: printed(value)}):
            said.append(f"allow {words} up to {value:g}, with which there is one")
            feasible = {key: value, **feasible}
            break
    asked = {"T2": (float(T2), float(decay)), "decay": (float(decay), float(T2))}
    edges = {
        name: study.farthest(name, SHORTER * value, value, other, bounded=True)
        for name, (value, other) in asked.items()
        if value
    }
    said += lower(study, edges, T2, decay)
    otherwise = f"no larger {words}, and no smaller T2 or decay, was found to do; look at another measurement"
    return {**known, "feasible": feasible, "suggestion": ", or ".join(said) or otherwise}
