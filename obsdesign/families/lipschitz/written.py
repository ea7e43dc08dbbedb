"""What a result holds of an observer of a Lipschitz system, with the gain L."""

import math
from collections.abc import Mapping
from typing import Any

from obsdesign.dissipation.bounds import Range
from obsdesign.dissipation.certificate import lipschitz_claim
from obsdesign.dissipation.figures import figures
from obsdesign.families.incremental import written as incremental
from obsdesign.families.lipschitz.outcome import LipschitzDesign, Proved
from obsdesign.lmi.formula import approximate
from obsdesign.spec import Spec


def content(spec: Spec, design: LipschitzDesign) -> dict[str, Any]:
    """Observer, guarantee, certificate and search, whichever there are."""
    made: dict[str, Any] = {}
    if design.gains:
        made["observer"] = observer(spec, design)
    if design.proved:
        made["guarantee"] = guarantee(spec, design, design.proved)
        made["certificate"] = incremental.certificate(design.proved.certificate)
        if design.admissible:
            made["certificate"]["admissible"] = admissible(spec, design.admissible)
    elif design.limit:
        made["guarantee"] = limits(spec, design)
    if design.points:
        ranges = [key for key in ("weight", "decay") if isinstance(getattr(spec.lipschitz, key), Range)]
        parameters = {"parameters": ranges} if len(ranges) > 1 else {}
        made["search"] = {"parameter": ranges[0], **parameters, "points": [*map(finite, design.points)]}
    return made


def observer(spec: Spec, design: LipschitzDesign) -> dict[str, Any]:
    """Gain and what an engineer asks first of it."""
    L = design.gains["L"]
    P = design.certificate.P.astype(float) if design.certificate else None
    return {
        "type": spec.observer.type,
        "relaxation": spec.lipschitz.relaxation,
        "L": L.tolist(),
        **figures(spec.augmented.doubles, -L, P),
    }


def guarantee(spec: Spec, design: LipschitzDesign, proved: Proved) -> dict[str, Any]:
    """What is proved, what that leaves for an uncertainty, and the limit it is near to."""
    g = proved.certificate.guarantee
    more = design.admissible
    beyond = (more.lipschitz, more.certificate.guarantee) if more else None
    claim = lipschitz_claim(spec, proved.lipschitz, g, beyond)
    return {
        "lipschitz": approximate(proved.lipschitz),
        **({"constants": claim.constants} if len(claim.declared) > 1 else {}),
        **({"gamma": g.gamma} if spec.disturbed else {}),
        "decay": g.alpha,
        **({"mu1": g.mu1, "mu2": g.mu2} if spec.disturbed else {}),
        **({"admissible": approximate(more.lipschitz)} if more else {}),
        "margin": claim.margin,
        **limits(spec, design),
        "statement": claim.statement(),
    }


def limits(spec: Spec, design: LipschitzDesign) -> dict[str, Any]:
    """Limits of the objective, and what the relaxations cost."""
    known: dict[str, Any] = {"limit": finite(design.limit or {"attained": False})}
    if design.limit_bounded:
        known["limit_bounded"] = finite(design.limit_bounded)
    if design.widened:
        known["widened"] = design.widened
    if design.ceiling is not None:
        known["ceiling"] = design.ceiling
    if design.comparison:
        known["comparison"] = [compared(row, spec.disturbed) for row in design.comparison]
    return known


def compared(row: Mapping[str, Any], disturbed: bool) -> dict[str, Any]:
    """Row of a comparison; without w its gamma means nothing."""
    made = {**row, **({"limit": finite(row["limit"])} if "limit" in row else {})}
    if "certified" in row and not disturbed:
        made["certified"] = {key: value for key, value in row["certified"].items() if key != "gamma"}
    return made


def finite(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers that a file can hold: "unbounded" stands for those that are infinite."""
    kept = {k: v for k, v in numbers.items() if v != math.inf}
    return kept if len(kept) == len(numbers) else {"unbounded": True, **kept, "attained": False}


def admissible(spec: Spec, proved: Proved) -> dict[str, Any]:
    """Proof of the largest constant that is tolerated."""
    level = proved.certificate
    numbers = {key: approximate(getattr(level, key)) for key in ("gamma", "mu1", "mu2") if spec.disturbed}
    return {"lipschitz": approximate(proved.lipschitz), **numbers, **incremental.certificate(level)}
