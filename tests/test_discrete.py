"""Designs in discrete time against limits that were derived and computed apart from this project."""

import numpy as np
import pytest
from support.samples import text

from obsdesign.dissipation.engine import Engine
from obsdesign.families.incremental.design import design
from obsdesign.families.outcome import Verdict
from obsdesign.reading import loads

LIMITS = [
    ("K1", "type: l2, rho: .95", 2.008692342),
    ("K1", "type: l2, rho: 1", 0.872782550),
    ("K1", "type: l2, rho: .95, L2: free", 2.003251790),
    ("K1", "type: l2, rho: .95, estimate: filtered", 2.005462984),
    ("K2", "type: l2, rho: .9", 0.221054315),
    ("K2", "type: l2, rho: .9, L2: [[-1, 0], [0, 0]]", 0.166662373),
    ("K3", "type: l2, rho: .98", 0.701821081),
    ("K3", "type: l2, rho: .98, L2: free", 0.687767877),
    ("K4", "type: l2, rho: .98", 0.543574688),
    ("K4", "type: l2, rho: .98, L2: free", 0.476257807),
    ("K5", "type: l2, rho: .95", 0.179365727),
    ("K5", "type: l2, rho: .95, L2: [[.5]]", 0.189775833),
    ("K5", "type: l2, rho: .95, L2: free", 0.172195330),
    ("K6", "type: l2, rho: .95", 0.264565569),
    ("K7", "type: l2, rho: .999", 0.203161001),
    ("K7", "type: l2, rho: .999, estimate: filtered", 0.201092212),
    ("K8", "type: l2, rho: .95, estimate: filtered, L2: [[0, -10]]", 0.169951022),
    ("K8", "type: l2, rho: .95, estimate: filtered, L2: [[0, -3]]", 0.252174895),
    ("K8", "type: l2, rho: .95, estimate: filtered, L2: free", 0.159138778),
    ("R1", "type: l2, rho: 1", 0.499230177),
    ("R1", "type: l2, rho: .97", 0.641726348),
    ("R2", "type: l2, rho: 1", 0.600188650),
]


@pytest.mark.parametrize(("plant", "observer", "limit"), LIMITS)
def test_the_limit_is_that_of_the_reference_and_gains_near_it_are_proved(plant, observer, limit):
    made = design(loads(text(plant, f"{observer}, slack: .01")), Engine())
    assert made.status is Verdict.CERTIFIED
    assert made.limit["gamma"] == pytest.approx(limit, rel=1e-6)
    assert float(made.claim.certificate.gamma) <= limit * (1 + 0.01 + 1e-6)
    assert np.linalg.norm(made.gains["L1"]) < 1e4
