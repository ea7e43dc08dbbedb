"""Results of Lipschitz systems made by hand, of gains that are given, so that nothing is searched."""

import json
from dataclasses import replace

import numpy as np

from obsdesign.design import Design, Solver
from obsdesign.dissipation.claim import claim
from obsdesign.dissipation.engine import Engine
from obsdesign.families.lipschitz.claim import Claim
from obsdesign.families.lipschitz.relaxations import Lipschitz, lipschitz_multiplier, proportions
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.files import to_json
from obsdesign.lmi.formula import printed, rational
from obsdesign.reading import loads

PAIR = """
obsdesign: 1
name: Pair
system: {A: [[0, 1], [-1, -1]], B: [[1, 0], [1, 0]], C: [1, 0], D: [[0, 0.2]]}
nonlinearities:
  - {type: {lipschitz: 0.3}, Bf: [0, 1], Cq: [1, 0]}
  - {type: {lipschitz: 0.1}, Bf: [0, 1], Cq: [0, 1]}
performance: {H: [[0.5, 0], [0, 0.5]]}
observer: {type: lipschitz, objective: min-gamma, decay: 0.05}
"""
QUIET = """
obsdesign: 1
name: Quiet
system: {A: [[0, 1], [-1, -1]], C: [1, 0]}
nonlinearities: [{type: {lipschitz: 0.4}}]
observer: {type: lipschitz, decay: 0.05}
"""
FRONT = """
obsdesign: 1
name: Front
system: {A: [[0, 1], [-1, -1]], B: [1, 1], C: [1, 0], D: [0.2]}
nonlinearities: [{type: {lipschitz: 0.4}}]
performance: {H: [[0.5, 0], [0, 0.5]]}
observer: {type: lipschitz, objective: pareto, weight: 0.9, decay: {min: 0.01, max: 0.1}}
"""
L = np.array([[1.0], [0.5]])
QUIET_L = np.array([[4.0], [4.0]])


def proof(spec, lipschitz, gamma, gain, decay):
    """A constant that a gain is proved to tolerate, with gamma."""
    plant, request = spec.augmented, spec.observer
    constants = [lipschitz * share for share in proportions(request.lipschitz)]
    multiplier = lipschitz_multiplier(constants, [(block.nq, block.nf) for block in spec.multiplier.blocks])
    L2 = rational(np.zeros((len(plant.Cq), len(plant.C))))
    family = Lipschitz(plant, multiplier, spec.H, printed(decay), -printed(gain), L2)
    certificate = claim(Engine(), family, gamma)
    assert certificate is not None
    assert certificate.holds
    return Claim(lipschitz, certificate)


def designed(text, lipschitz, gamma=1.0, gain=L, admissible=None, decay=0.05):
    """A spec and a gain, with the constant and gamma that are claimed of it."""
    spec = loads(text, "by-hand.yaml")
    larger = proof(spec, *admissible, gain, decay) if admissible else None
    proved = proof(spec, lipschitz, gamma, gain, decay)
    limit = {"lipschitz": float("inf"), "attained": False}
    return spec, Outcome(Verdict.CERTIFIED, {"L": gain}, replace(proved, admissible=larger), limit)


def written(spec, outcome):
    """Result of an outcome."""
    return json.loads(to_json(Design.of(spec, outcome, solver=Solver("clarabel", 0, 0.0)).result))


def made(*arguments, **options):
    """Result of such a gain."""
    return written(*designed(*arguments, **options))
