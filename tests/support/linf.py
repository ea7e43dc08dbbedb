"""Problems of the L-infinity family, and what the solver makes of them."""

import math

from obsdesign.dissipation.gain import searchable
from obsdesign.families.incremental.theorems import Linf
from obsdesign.lmi.formula import rational_number
from obsdesign.lmi.solve import Status, minimise
from obsdesign.reading import loads

CUBIC = """
obsdesign: 1
system: {A: [[0, -1, 0], [0, -1, -1], [0, 1, -1]], B: [1, 0, 0], C: [1, 0, 0]}
nonlinearities: [{type: cubic, Bf: [0, 1, 0], Cq: [1, -1, 0]}]
observer: {type: linf, %s}
"""
SCALAR = """
obsdesign: 1
system: {A: [[-%s]], B: [[1]], C: [[0]]}
nonlinearities: [{type: {lipschitz: %s}, Bf: [[1]], Cq: [[1]]}]
observer: {type: linf, %s}
"""
ARM = """
obsdesign: 1
system:
  A: [[0, 1, 0], [-2, -1, 0.5], [0.3, 0, -1.5]]
  B: [[0], [1], [0.4]]
  C: [[1, 0, 0.2]]
  D: [[%s]]
nonlinearities:
  - {type: {slope: [-0.4, 1.1]}, Bf: [0, 0.6, 0], Cq: [1, 0.2, 0], Dqf: [[%s]], Dq: [[%s]], Df: [[%s]]}
disturbance: %s
performance: all
observer: {type: linf, L2: %s, alpha: %s, %s}
"""


def arm(L2="[[0.2]]", alpha="0.2", D=0, Dqf=0, Dq=0, Df=0, disturbance="unknown", **further):
    rest = ", ".join(f"{key}: {value}" for key, value in further.items())
    return loads(ARM % (D, Dqf, Dq, Df, disturbance, L2, alpha, rest))


def family_of(spec, alpha=None):
    """The problem of a spec in rationals, with L1 to be found."""
    alpha = spec.observer.rate if alpha is None else rational_number(repr(float(alpha)))
    return Linf(spec.augmented, spec.multiplier, spec.H, alpha, None, spec.observer.L2)


def least_gamma(family):
    answer = minimise(searchable(family).least_gamma())
    assert answer.status is Status.OPTIMAL, answer.reason
    return math.sqrt(answer.objective)
