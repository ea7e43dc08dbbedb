"""What a spec allows an observer of a Lipschitz system."""

from math import isfinite
from typing import Any

import numpy as np

from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError
from obsdesign.families.finding import Finding, detectability, finding
from obsdesign.families.lipschitz.relaxations import RELAXATIONS, S_PROCEDURE, Lipschitz, proportions
from obsdesign.families.lipschitz.request import LipschitzRequest, request_of
from obsdesign.families.lipschitz.samples import feedback
from obsdesign.families.lipschitz.suprema import cancels, ceiling, largest_constant, largest_for_gamma
from obsdesign.lmi.formula import in_floats
from obsdesign.model.edge import Edge
from obsdesign.spec import Spec

SMALLER = "declare a smaller constant, on a `region`, or describe f by a slope and use type l2"
STRUCTURE, INSTEAD = "say by Bf and Cq on what f acts and depends", "type l2 with L2: free"


def check(spec: Spec, engine: Engine) -> list[Finding]:
    """Detectability at the decay that is asked for, constants that no gain can exceed, sigma(H), and L D = B."""
    request = request_of(spec)
    rate, kind, shares = request.rates[0], S_PROCEDURE[request.pace], proportions(request.lipschitz)
    plant, K = spec.posed.doubles, in_floats(spec.multiplier.member)
    found = detectability(plant, K, Edge(float(rate), request.pace.sampled), request.pace)
    unit = kind.of(spec.posed, spec.multiplier, shares, spec.H, rate)
    most = ceiling(unit) if all(f.holds for f in found) else None
    levels = request.objective != "max-lipschitz"
    if most is not None:
        declared = float(max(request.lipschitz))
        below = declared < most
        said = f"a linear f of the constant {most:.6g} hides a mode, and the declared one is {declared:g}"
        found.append(finding("ceiling", below, said, decides=levels, advice=SMALLER, ceiling=most, id="OBS607"))
    if all(f.stands for f in found):
        found += suprema(engine, unit, request)
    if request.pace.sampled:
        found += returning(unit, request)
    return [*found, *(attenuation(spec, request) if plant.B.shape[1] else [])]


def returning(unit: Lipschitz, request: LipschitzRequest) -> list[Finding]:
    """What f rules out, whatever the gain, where it comes back to its argument before y can tell."""
    found = feedback(in_floats(unit))
    if found is None:
        return []
    declared, levels = float(max(request.lipschitz)), request.objective != "max-lipschitz"
    known = "" if request.filtered else "take estimate: filtered, "
    said = f"no gain tolerates more than {found.most:.8g} = {found.sentence}, and the declared one is {declared:g}"
    numbers: dict[str, Any] = {"decides": levels, "advice": f"{STRUCTURE}, {known}or take {INSTEAD}"}
    return [finding("feedback", declared <= found.most, said, **numbers, supremum=found.most, id="OBS607")]


def suprema(engine: Engine, unit: Lipschitz, request: LipschitzRequest) -> list[Finding]:
    """Suprema of the constants for which each relaxation has a gain, and a gamma where that is asked for."""
    declared, found, enough = float(max(request.lipschitz)), list[Finding](), list[str]()
    levels = request.objective != "max-lipschitz"
    asked = RELAXATIONS[0] if request.relaxation == "compare" else request.relaxation
    shown = RELAXATIONS if request.relaxation == "compare" else (asked,)
    for relaxation in RELAXATIONS[:1] if request.pace.sampled else RELAXATIONS:
        try:
            most = (largest_for_gamma if levels else largest_constant)(engine, unit, relaxation).value
        except UndecidedError:
            continue
        bound = f"below {most:.8g}" if isfinite(most) else "of any size"
        numbers: dict[str, Any] = {"supremum": most} if isfinite(most) else {}
        said = f"{relaxation}: there are gains for constants {bound}, and the declared one is {declared:g}"
        numbers["decides"] = levels and relaxation == asked
        if relaxation in shown:
            numbers["advice"] = f"take relaxation: {enough[0]}" if enough else SMALLER
        enough += [relaxation] * (declared < most)
        found.append(finding(f"supremum, {relaxation}", declared < most, said, **numbers, id="OBS607"))
    return found


def attenuation(spec: Spec, request: LipschitzRequest) -> list[Finding]:
    """What Theorems 3 and 4 need of H, and whether a finite gain keeps w from the error."""
    free = cancels(spec.posed)
    exact = "and gamma = 0 is possible with that gain if it also converges" if free else "so that gamma > 0"
    product = finding("L D = B", free, f"L D = B has {'a' if free else 'no'} solution L, {exact}", id="OBS614")
    if request.pace.sampled:
        return [product]
    size = float(np.linalg.norm(in_floats(spec.H), 2))
    needed = request.relaxation == "abbaszadeh" and request.objective != "max-lipschitz"
    said = f"sigma(H) = {size:.6g}, and Theorems 3 and 4 (relaxation abbaszadeh) need it to be below 1"
    return [finding("sigma(H)", size < 1, said, decides=needed, sigma=size, id="OBS608"), product]
