"""What a spec allows, before any design."""

from math import isfinite
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import Range
from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError
from obsdesign.families.incremental.stiffness import failing_passivity, too_stiff
from obsdesign.families.incremental.theorems import THEOREMS
from obsdesign.families.lipschitz.relaxations import RELAXATIONS, Lipschitz, proportions
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.families.lipschitz.suprema import cancels, ceiling, largest_constant, largest_for_gamma
from obsdesign.families.sporadic.reasons import hiding_interval
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.lmi.formula import Array, Float, in_floats
from obsdesign.model.loop import well_posed
from obsdesign.model.pencil import invariant_zeros
from obsdesign.model.plant import Plant
from obsdesign.model.structure import accuracy, condition1, decay_limit, linear, undetectable
from obsdesign.spec import Spec


def examine(spec: Spec) -> dict[str, Any]:
    """What the structure rules out, and what it allows, each with a sentence.

    Returns
    -------
    dict
        `possible`: nothing that decides fails; `findings`: each with `name`, `holds`, `decides` (a failure rules every
        gain out), `sentence`, and its numbers.
    """
    request = spec.observer
    if isinstance(request, SporadicRequest):
        found = sampled(spec, request)
    else:
        found = lipschitz(spec, request) if isinstance(request, LipschitzRequest) else continuous(spec)
    return {
        "name": spec.name,
        "possible": all(f["holds"] for f in found if f["decides"]),
        "findings": found,
        "notes": list(spec.notes),
    }


def sampled(spec: Spec, request: SporadicRequest) -> list[dict[str, Any]]:
    """Detectability at the decay that is asked for, and intervals that hide modes."""
    plant, multiplier = spec.augmented, spec.multiplier
    decay, T2 = (float(v.low if isinstance(v, Range) else v) for v in (request.decay, request.T2))
    hiding = hiding_interval(plant, multiplier, decay, max(T2, float(request.T1)))
    seen = f"no interval up to T2 = {T2:g} hides the difference of two modes"
    return [
        *detectability(plant.doubles, in_floats(multiplier.member), decay, "lambda_t"),
        finding("sampling", not hiding, hiding.get("reason", seen), decides=True),
    ]


def lipschitz(spec: Spec, request: LipschitzRequest) -> list[dict[str, Any]]:
    """Detectability at the decay that is asked for, constants that no gain can exceed, sigma(H), and L D = B."""
    decay = request.decay.low if isinstance(request.decay, Range) else request.decay
    plant, K = spec.augmented.doubles, in_floats(spec.multiplier.member)
    found = detectability(plant, K, float(decay), "decay")
    unit = Lipschitz.of(spec.augmented, spec.multiplier, proportions(request.lipschitz), spec.H, decay)
    most = ceiling(unit) if all(f["holds"] for f in found) else None
    levels = request.objective != "max-lipschitz"
    if most is not None:
        declared = float(max(request.lipschitz))
        below = declared < most
        said = f"a linear f of the constant {most:.6g} hides a mode, and the declared one is {declared:g}"
        found.append(finding("ceiling", below, said, decides=levels, ceiling=most))
    if all(f["holds"] for f in found if f["decides"]):
        found += suprema(unit, request)
    return [*found, *(attenuation(spec, request) if plant.B.shape[1] else [])]


def suprema(unit: Lipschitz, request: LipschitzRequest) -> list[dict[str, Any]]:
    """Suprema of the constants for which each relaxation has a gain, and a gamma where that is asked for."""
    engine, declared, found = Engine(), float(max(request.lipschitz)), []
    levels = request.objective != "max-lipschitz"
    asked = RELAXATIONS[0] if request.relaxation == "compare" else request.relaxation
    for relaxation in RELAXATIONS:
        try:
            most = (largest_for_gamma if levels else largest_constant)(engine, unit, relaxation).value
        except UndecidedError:
            continue
        bound, numbers = (f"below {most:.8g}", {"supremum": most}) if isfinite(most) else ("of any size", {})
        said = f"{relaxation}: there are gains for constants {bound}, and the declared one is {declared:g}"
        decides = levels and relaxation == asked
        found.append(finding(f"supremum, {relaxation}", declared < most, said, decides=decides, **numbers))
    return found


def attenuation(spec: Spec, request: LipschitzRequest) -> list[dict[str, Any]]:
    """What Theorems 3 and 4 need of H, and whether a finite gain keeps w from the error."""
    size = float(np.linalg.norm(in_floats(spec.H), 2))
    needed = request.relaxation == "abbaszadeh" and request.objective != "max-lipschitz"
    said = f"sigma(H) = {size:.6g}, and Theorems 3 and 4 (relaxation abbaszadeh) need it to be below 1"
    free = cancels(spec.augmented)
    exact = "and gamma = 0 is possible with that gain if it also converges" if free else "so that gamma > 0"
    return [
        finding("sigma(H)", size < 1, said, decides=needed, sigma=size),
        finding("L D = B", free, f"L D = B has {'a' if free else 'no'} solution L, {exact}"),
    ]


def detectability(plant: Plant[Float], K: Array, rate: float, name: str) -> list[dict[str, Any]]:
    """Modes that no output shows, and the decay rate that they leave."""
    limit = decay_limit(plant, K)
    found = [
        finding("detectability", False, mode.sentence, decides=True, eigenvalue=complex_pair(mode.eigenvalue))
        for mode in undetectable(plant, K, rate)
    ] or [finding("detectability", True, f"no hidden mode is slower than {name} = {rate:g}", decides=True)]
    if isfinite(limit):
        said = f"detectability limits {name} to {limit + 0.0:g}"
        found.append(finding("decay", limit > rate, said, decides=True, limit=limit))
    return found


def continuous(spec: Spec) -> list[dict[str, Any]]:
    """Detectability, Condition 1, zeros, arbitrary accuracy and loops."""
    plant, multiplier = spec.plant.doubles, in_floats(spec.multiplier)
    augmented = spec.augmented.doubles
    K = multiplier.member
    alpha = spec.incremental.alpha
    findings = detectability(augmented, K, float(alpha.low if isinstance(alpha, Range) else alpha), "alpha")
    nf = plant.Bf.shape[1]
    findings += [
        finding("condition 1", test.holds, test.sentence, eigenvalue=complex_pair(test.eigenvalue))
        for test in condition1(plant, in_floats(spec.generator.Am))
    ]
    for name, system in (("w to y", linear(plant, K[:nf, : len(plant.Cq)])), ("v to y", linear(augmented, K))):
        zeros = invariant_zeros(system)
        findings.append(
            finding(
                f"zeros, {name}",
                zeros.left_invertible,
                f"{name}: {zeros.sentence}",
                zeros=[complex_pair(z) for z in zeros.values],
                normal_rank=zeros.normal_rank,
            )
        )
    findings += [*steep(spec, alpha.low if isinstance(alpha, Range) else alpha), *attainable(spec)]
    loops = {"plant": augmented.Dqf}
    L2 = spec.incremental.gains["L2"] if spec.incremental.gains else spec.incremental.L2
    if L2 is not None:
        loops["observer"] = augmented.Dqf + in_floats(L2) @ augmented.Df
    for name, D in loops.items():
        verdict = well_posed(D, multiplier)
        findings.append(finding(f"loop of the {name}", verdict.unique, f"{name}: {verdict.sentence}"))
    return findings


def steep(spec: Spec, alpha: fmpq) -> list[dict[str, Any]]:
    """What nonlinearities without an upper slope bound rule out."""
    request = spec.incremental
    gain = request.gains["L2"] if request.gains else request.L2
    family = in_floats(THEOREMS[request.type](spec.augmented, spec.multiplier, spec.H, alpha, None, gain))
    answer = too_stiff(family) or failing_passivity(spec, family)
    return [finding(answer["condition"], False, answer["reason"], decides=True)] if answer else []


def attainable(spec: Spec) -> list[dict[str, Any]]:
    """What any gamma > 0 needs (Theorem 2, Lemma 5), slopes without a bound, and what the reconstruction of w needs."""
    augmented, B = spec.augmented.doubles, spec.plant.doubles.B
    request, found = spec.incremental, []
    gain = request.gains["L2"] if request.gains else request.L2
    if augmented.B.shape[1]:
        tests = accuracy(augmented, None if gain is None else in_floats(gain), spec.generator)
        found += [finding(f"any accuracy: {t.name}", t.holds, t.sentence, **t.numbers) for t in tests]
        reached = all(test.holds for test in tests)
        said = "the conditions for any gamma > 0 hold" if reached else "Theorem 2 does not give any gamma > 0 here"
        found.append(finding("any accuracy", reached, said))
    if B.shape[1]:
        rank = int(np.linalg.matrix_rank(B))
        said = f"B has rank {rank} of {B.shape[1]}, which `reconstruct: w` needs to be full"
        found.append(finding("rank B", rank == B.shape[1], said, decides=request.reconstruct, rank=rank))
    return found


def finding(name: str, holds: bool, sentence: str, *, decides: bool = False, **numbers: Any) -> dict[str, Any]:
    """One finding."""
    return {"name": name, "holds": holds, "decides": decides, "sentence": sentence, **numbers}


def complex_pair(value: complex) -> list[float]:
    """[real, imaginary]."""
    return [float(value.real), float(value.imag)]
