"""The certified bound on the reconstruction error of given gains: the levels and slopes that it is made of."""

import math
from dataclasses import replace

import numpy as np

from obsdesign.dissipation.bounds import Range
from obsdesign.dissipation.certificate import Certificate
from obsdesign.dissipation.claim import DIGITS, best_claim
from obsdesign.dissipation.decimals import round_up
from obsdesign.dissipation.engine import Engine
from obsdesign.families.incremental.decay import Decay
from obsdesign.families.incremental.reconstruction import (
    SLOPE,
    Reconstructed,
    Slope,
    SlopeProof,
    constants,
    inapplicable,
    levels,
    prove_slope,
    reconstructed,
    slopes,
)
from obsdesign.families.incremental.theorems import Linf
from obsdesign.lmi.formula import Problem, Unknown, in_floats, printed, rational_number
from obsdesign.lmi.proof import rounded
from obsdesign.lmi.solve import Status
from obsdesign.spec import Spec

ROOM = 1e-6  # relative, above the least slope bound
FLOOR = 5e-5  # .. and the least one that is tried: a bound of zero leaves no room to prove it
ALPHAS = 12  # of the curve on which the best alpha of a level is found
ROUNDING = 1e-12
DIGITS_OF_CONSTANTS = 9
SLOWEST = 1e-3  # of these alphas, relative to the slowest pole


def reconstruct(engine: Engine, spec: Spec, family: Linf) -> Reconstructed | str:
    """Bound on |what - w| for gains in rationals, or why none is proved."""
    needed = slopes(family.multiplier) if family.plant.Bf.shape[1] else {}
    proofs = {name: proof for name, slope in needed.items() if (proof := slope_proof(engine, slope))}
    reason = inapplicable(spec, proofs[SLOPE].bound if proofs and len(proofs) == len(needed) else None)
    if reason:
        return reason
    certificates: dict[str, Certificate] = {}
    for name, level in levels(family).items():
        certificate = best_level(engine, level)
        if certificate is None or not certificate.holds:
            return f"no level of {name} was found for these gains"
        certificates[name] = certificate
    gammas = {name: certificate.gamma for name, certificate in certificates.items()}
    least = constants(family, gammas, {name: proof.bound for name, proof in proofs.items()})
    c_w, c_w_rate, c_x_rate = (printed(round_up(float(c) * (1 + ROUNDING), DIGITS_OF_CONSTANTS)) for c in least)
    return reconstructed(family, certificates, proofs, (c_w, c_w_rate, c_x_rate))


def best_level(engine: Engine, level: Linf) -> Certificate | None:
    """Certificate of nearly the least gamma of one output, over alpha."""
    slowest = -in_floats(level).slowest_pole().real
    if slowest <= 0:
        return None
    low, high = (rational_number(f"{slowest * share:.6g}") for share in (SLOWEST, 1))
    grid = Range(low, high, ALPHAS, log=True).grid()
    decay = Decay(engine, level)
    points = list(decay.curve(grid))
    best = min([*points, *decay.lowest(points)], key=lambda point: point.get("gamma", math.inf))
    if "gamma" not in best:
        return None
    return best_claim(engine, replace(level, rate=rational_number(repr(best["rate"]))))[1]


def slope_proof(engine: Engine, slope: Slope) -> SlopeProof | None:
    """Least bound on the slope, or on its variation, proved; None if there is none."""
    theorem = in_floats(slope).theorem
    least = engine.minimise(Problem((*slope.unknowns, Unknown("square", (1, 1))), theorem, lambda v: v["square"]))
    if least.status is not Status.OPTIMAL:
        return None
    bound = round_up(max(math.sqrt(max(least.objective, 0.0)) * (1 + ROOM), FLOOR), 9)
    square = np.full((1, 1), bound**2)
    wide = engine.widest(Problem(slope.unknowns, lambda v: theorem({**v, "square": square})))
    exact = rational_number(repr(bound))
    tried = (prove_slope(slope, exact, rounded(wide.values, digits)) for digits in DIGITS)
    return next((proof for proof in tried if proof.holds), None)
