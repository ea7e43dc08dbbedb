"""Analysis: the constant that given gains tolerate, and the gamma that they have."""

import math
from dataclasses import replace
from typing import Any

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.bounds import NO_BOUNDS
from obsdesign.dissipation.claim import BACKOFFS
from obsdesign.dissipation.decimals import round_down, round_up
from obsdesign.dissipation.elimination import least_gamma
from obsdesign.dissipation.gain import within
from obsdesign.dissipation.scan import edge, strides
from obsdesign.dissipation.zero import reached, settled
from obsdesign.families.lipschitz.claim import Claim
from obsdesign.families.lipschitz.reasons import useless
from obsdesign.families.lipschitz.study import Study
from obsdesign.families.lipschitz.suprema import largest_constant
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.families.poles import missed
from obsdesign.lmi.formula import Array, in_floats, printed
from obsdesign.lmi.solve import Status

STRIDE, STRIDES, EDGE = 2.0, 10, 1e-3  # between constants, and the relative accuracy of the largest
BEYOND = 1e3  # times the declared constant, or 1: what is proved of gains that tolerate any
ANY = "the gains tolerate any Lipschitz constant; the one stated is an example"


def tolerated(study: Study, L: Array) -> tuple[float, Claim | None]:
    """Largest constant of the relaxation for gains, in rationals, and a proof of nearly that; (0, None) if none."""
    if study.centered and len(study.unit.multiplier.blocks) > 1:
        limit = searched(study, L)
    else:
        stretch = study.stretch(L)
        answer = stretch.least(study.request.placed)
        limit = stretch.constant(answer) if answer.status is Status.OPTIMAL else 0.0
    if not limit:
        return 0.0, None
    most = BEYOND * max(float(study.declared), 1.0) if limit == math.inf else limit
    constants = [printed(round_down(most * (1 - backoff), 6)) for backoff in BACKOFFS]
    if study.centered and study.disturbed:  # of a large plant no inequalities for what is told beside a claim
        families = {c: study.attenuation(float(c), L=L) for c in constants}
        constants = [c for c, family in families.items() if least_gamma(study.engine, family) is not None]
    tried = (study.proved(L, constant) for constant in constants)
    return limit, next((proved for proved in tried if proved), None)


def searched(study: Study, L: Array) -> float:
    """Constant up to which Riccati equations have scales of several blocks for gains, about the largest; 0 if none."""

    def holds(constant: float) -> bool:
        return least_gamma(study.engine, study.attenuation(constant, L=L)) is not None

    low, high = strides(holds, float(study.declared) or 1.0, STRIDE, STRIDES)
    return 0.0 if low is None else low if high is None else edge(holds, low, high, EDGE)


def largest_of(study: Study, L: Array) -> Outcome:
    """Certify nearly the largest constant that gains tolerate."""
    found, proved = tolerated(study, L)
    if not found:
        return refused(study, L, None)
    best = largest_constant(study.engine, study.unit, study.relaxation)
    limit = {"lipschitz": best.value, "attained": best.attained}
    notes = (ANY,) if found == math.inf else ()
    return study.outcome(L, proved, limit=limit, notes=notes)


def gamma_of(study: Study, L: Array) -> Outcome:
    """Certify nearly the least gamma that gains have, in the relaxation, at the declared constant."""
    constant = study.declared
    family, placed = study.attenuation(float(constant), L=L), study.request.placed
    answer = within(study.engine, family, placed)
    if answer.status is not Status.OPTIMAL:
        _, known = tolerated(study, L)
        return refused(study, L, float(known.lipschitz) if known else None)
    root = math.sqrt(max(answer.objective, 0.0)) or 1e-9
    tried = (study.proved(L, constant, round_up(root * (1 + backoff), 6)) for backoff in BACKOFFS)
    proved = next((proof for proof in tried if proof), None)
    family = study.attenuation(float(constant))
    limit = settled(study.engine, family, within(study.engine, family))
    limits: dict[str, Any] = {"attained": False}
    if limit.status is Status.OPTIMAL:
        gamma = math.sqrt(max(limit.objective, 0.0))
        limits = {"gamma": gamma, "attained": not gamma or reached(study.engine, family, gamma, NO_BOUNDS)}
        limits |= {} if limit.gap is None else {"gap": round_up(limit.gap, 2)}
    return study.outcome(L, tolerating(study, L, proved), limit=limits)


def tolerating(study: Study, L: Array, proved: Claim | None) -> Claim | None:
    """Claim with the largest constant above its own that the s-procedure proves of gains, with a gamma of its own."""
    if proved is None:
        return None
    _, found = tolerated(replace(study, request=replace(study.request, relaxation="s-procedure", bounds=NO_BOUNDS)), L)
    return replace(proved, admissible=found) if found and found.lipschitz > proved.lipschitz else proved


def refused(study: Study, L: Array, known: float | None) -> Outcome:
    """Answer that gains achieve nothing."""
    family, region = replace(study.unit, L1=-L).stretched(study.declared), study.bounds.poles
    diagnosis = useless(family, float(study.declared), known)
    if region is not None:
        fixed = in_floats(family)
        poles = Errors.of(fixed.plant, family.multiplier, fixed.H, fixed.L1, fixed.L2).poles
        within = "" if fixed.edge.slow(fixed.slowest_pole()) else f", within {' and '.join(region.words())}"
        diagnosis |= {"reason": missed(poles, region) or f"{diagnosis['reason']}{within}"}
    return Outcome(Verdict.INFEASIBLE, {"L": in_floats(L)}, diagnosis=diagnosis)
