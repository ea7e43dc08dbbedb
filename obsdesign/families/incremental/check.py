"""What a spec allows an observer with the gains L1 and L2."""

from typing import Any

import numpy as np

from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.inequality import Incremental
from obsdesign.families import poles
from obsdesign.families.finding import Finding, complex_pair, detectability, finding, frozen_at
from obsdesign.families.incremental.absence import structural
from obsdesign.families.incremental.request import posed, request_of
from obsdesign.families.incremental.samples import floor
from obsdesign.lmi.formula import in_floats
from obsdesign.model.edge import Edge
from obsdesign.model.loop import well_posed
from obsdesign.model.pencil import invariant_zeros
from obsdesign.model.structure import accuracy, condition1, linear
from obsdesign.spec import Spec

LOOPS = {
    "plant": "declare a smaller slope of f, or solve the loop for q by hand",
    "observer": "give another L2, or L2: 0",
}
LATE = "y shows some of v too late"  # of the rank that Theorem 2 needs
UNMET = "Theorem 2 does not promise any gamma > 0, its conditions being sufficient only"
MORE = "`solve` tells the limit of gamma, which may be 0 all the same; where it is too large, measure another signal"


def check(spec: Spec, _: Engine) -> list[Finding]:
    """Detectability, Condition 1, zeros, loops; arbitrary accuracy, or in discrete time what gamma has for a floor."""
    plant, multiplier = spec.plant.doubles, in_floats(spec.multiplier)
    augmented, posed_plant = spec.augmented.doubles, spec.posed.doubles
    K = multiplier.member
    request = request_of(spec)
    family = posed(spec)
    findings = detectability(posed_plant, K, in_floats(family).edge, request.pace)
    nf = plant.Bf.shape[1]
    tests = condition1(plant, in_floats(spec.generator.Am), Edge(0, request.pace.sampled))
    findings += [finding(test.name, test.holds, test.sentence, **test.numbers, id="OBS614") for test in tests]
    for name, system in (("w to y", linear(plant, K[:nf, : len(plant.Cq)])), ("v to y", linear(augmented, K))):
        if not system.B.shape[1]:  # nothing drives the plant
            continue
        zeros = invariant_zeros(system)
        numbers: dict[str, Any] = {"zeros": [complex_pair(z) for z in zeros.values], "normal_rank": zeros.normal_rank}
        said = f"{name}{frozen_at(K)}: {zeros.sentence}"
        findings.append(finding(f"zeros, {name}", zeros.left_invertible, said, **numbers, id="OBS614"))
    findings += [*slopes(spec, family), *poles.findings(family, request.bounds.poles)]
    findings += floor(spec, request, in_floats(family)) if request.pace.sampled else attainable(spec)
    loops = {"plant": augmented.Dqf}
    if (L2 := request.feedback) is not None:
        loops["observer"] = posed_plant.Dqf + in_floats(L2) @ posed_plant.Df
    for name, D in loops.items():
        verdict = well_posed(D, multiplier)
        said = f"{name}: {verdict.sentence}"
        findings.append(finding(f"loop of the {name}", verdict.unique, said, advice=LOOPS[name], id="OBS305"))
    return findings


def slopes(spec: Spec, family: Incremental) -> list[Finding]:
    """What nonlinearities that are too steep rule out."""
    answer = structural(spec, in_floats(family))
    if not answer:
        return []
    return [
        finding(
            answer["condition"], False, answer["reason"], decides=True, advice=answer["suggestion"], id=answer["id"]
        )
    ]


def attainable(spec: Spec) -> list[Finding]:
    """What any gamma > 0 needs (Theorem 2, Lemma 5), slopes without a bound, and what the reconstruction of w needs."""
    augmented, B = spec.augmented.doubles, spec.plant.doubles.B
    request, found = request_of(spec), []
    gain = request.feedback
    if augmented.B.shape[1]:
        tests = accuracy(augmented, None if gain is None else in_floats(gain), spec.generator)
        found += [finding(f"any accuracy: {t.name}", t.holds, t.sentence, **t.numbers, id="OBS614") for t in tests]
        missing = "; ".join(LATE if test.name == "rank C B" else test.sentence for test in tests if not test.holds)
        said = f"{UNMET}: {missing}" if missing else "the conditions for any gamma > 0 hold"
        found.append(finding("any accuracy", not missing, said, advice=MORE, id="OBS614"))
    if B.shape[1]:
        rank = int(np.linalg.matrix_rank(B))
        said = f"B has rank {rank} of {B.shape[1]}, which `reconstruct: w` needs to be full"
        found.append(finding("rank B", rank == B.shape[1], said, decides=request.reconstruct, rank=rank, id="OBS503"))
    return found
