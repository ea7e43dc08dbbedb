"""What the structure of a spec allows, before any matrix inequality."""

from math import isfinite
from typing import Any

from obsdesign.lmi.formula import in_floats
from obsdesign.model.loop import well_posed
from obsdesign.model.pencil import invariant_zeros
from obsdesign.model.structure import condition1, decay_limit, linear, undetectable
from obsdesign.observers.request import Range
from obsdesign.spec.model import Spec


def examine(spec: Spec) -> dict[str, Any]:
    """Detectability, Condition 1, zeros and loops, each with a sentence.

    Returns
    -------
    dict
        `possible`: nothing that decides fails; `findings`: each with `name`, `holds`, `decides` (a failure rules every
        gain out), `sentence`, and its numbers.
    """
    plant, multiplier = in_floats(spec.plant), in_floats(spec.multiplier)
    augmented = in_floats(spec.augmented)
    K = multiplier.member
    alpha = spec.observer.alpha
    lowest = float(alpha.low if isinstance(alpha, Range) else alpha)
    hidden = undetectable(augmented, K, lowest)
    limit = decay_limit(augmented, K)
    findings = [
        finding("detectability", False, mode.sentence, decides=True, eigenvalue=complex_pair(mode.eigenvalue))
        for mode in hidden
    ] or [finding("detectability", True, f"no hidden mode is slower than alpha = {lowest:g}", decides=True)]
    if isfinite(limit):
        findings.append(
            finding(
                "decay", limit > lowest, f"detectability limits alpha to {limit + 0.0:g}", decides=True, limit=limit
            )
        )
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
    loops = {"plant": augmented.Dqf}
    if spec.observer.L2 is not None or spec.observer.gains:
        L2 = in_floats(spec.observer.gains["L2"] if spec.observer.gains else spec.observer.L2)
        loops["observer"] = augmented.Dqf + L2 @ augmented.Df
    for name, D in loops.items():
        verdict = well_posed(D, multiplier)
        findings.append(finding(f"loop of the {name}", verdict.unique, f"{name}: {verdict.sentence}"))
    return {
        "name": spec.name,
        "possible": all(f["holds"] for f in findings if f["decides"]),
        "findings": findings,
        "notes": list(spec.notes),
    }


def finding(name: str, holds: bool, sentence: str, *, decides: bool = False, **numbers: Any) -> dict[str, Any]:
    """One finding."""
    return {"name": name, "holds": holds, "decides": decides, "sentence": sentence, **numbers}


def complex_pair(value: complex) -> list[float]:
    """[real, imaginary]."""
    return [float(value.real), float(value.imag)]
