"""From poles to a gain, and to the gamma that is proved of it at half the rate of the poles."""

import numpy as np
from scipy.signal import place_poles

from obsdesign.dissipation.claim import best_claim
from obsdesign.families.incremental.theorems import L2
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.lmi.formula import printed, rational
from support.luenberger.claim import Claim


def design(spec, engine):
    """Gain L1 for poles that are spread by a few percent about the one that is asked for."""
    plant, pole = spec.augmented.doubles, float(spec.observer.poles)
    poles = pole * (1 + 0.05 * np.arange(plant.n))
    L1 = np.round(-place_poles(plant.A.T, plant.C.T, poles).gain_matrix.T, 6)
    none = rational(np.zeros((len(plant.Cq), len(plant.C))))
    family = L2(spec.augmented, spec.multiplier, spec.H, -spec.observer.poles / 2, printed(L1), none)
    _, certificate = best_claim(engine, family)
    if certificate is None or not certificate.holds:
        diagnosis = {"condition": "poles", "reason": f"nothing is proved of poles at {pole:g}"}
        return Outcome(Verdict.INFEASIBLE, diagnosis=diagnosis)
    return Outcome(Verdict.CERTIFIED, {"L1": L1}, Claim(certificate))
