"""Runs of observers of Lipschitz systems: reference values, an escape, and the bounds of the family."""

import math

import numpy as np
import pytest
from support.running import simulate

from obsdesign.families.lipschitz.relaxations import LipschitzGuarantee
from obsdesign.plot.run import run_sheet
from obsdesign.reading import loads

POLYNOMIAL = """\
obsdesign: 1
name: Polynomial
system: {A: [[0, 1], [-1, -1]], B: [1, 1], C: [1, 0], D: 0.2}
nonlinearities:
  - type: {lipschitz: 0.4167}
    region: {q1: [-0.0148, 0.0148], q2: [-2, 2]}
    f: [q1**3, -6*q1**5 - 6*q1**2*q2 - 2*q1**4 - 2*q1**2]
performance: {H: [[0.5, 0], [0, 0.5]]}
observer: {type: lipschitz}
"""
GAIN = {"L": np.array([[23.7025], [13.7272]])}
X0, XHAT0 = [-0.2, -1.45], [0.25, -2]
W = "w: 0.15*exp(-t)*sin(t)"
JOINT = """\
obsdesign: 1
system:
  A: [[0, 1, 0, 0], [-48.6, -1.25, 48.6, 0], [0, 0, 0, 1], [19.5, 0, -19.5, 0]]
  B: [1, 1, 1, 1]
  C: [[1, 0, 0, 0], [0, 1, 0, 0]]
  D: [0.1, 0.25]
nonlinearities:
  - {f: -3.33*sin(q), type: {lipschitz: 3.33}, Bf: [0, 0, 0, 1], Cq: [0, 0, 1, 0]}
performance: {H: [[0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 0.5, 0], [0, 0, 0, 0.5]]}
observer: {type: lipschitz, decay: 0.2}
"""
JOINT_GAIN = {"L": np.array([[33.4865, 38.5694], [129.9249, 282.8603], [59.89713, 102.1561], [108.2134, 171.0910]])}
SCALAR = """\
obsdesign: 1
system: {A: -1, B: 1, C: 1}
nonlinearities:
  - {type: {lipschitz: 0.5}, f: 0.5*q}
observer: {type: lipschitz}
simulation: {horizon: 20, x0: 0, xhat0: %s, w: %s}
"""


def run(text, gain, trial, guarantee=None):
    spec = loads(f"{text}simulation: {{{trial}}}\n")
    return spec, simulate(spec, gain, guarantee)


@pytest.fixture(scope="module")
def escape():
    return run(POLYNOMIAL, GAIN, f"horizon: 4, x0: {X0}, xhat0: {XHAT0}")


def test_the_plant_escapes_shortly_before_its_solution_ends(escape):
    """With u = 1 / x1 and r = (x2 + x1^3) / x1^2, u' = -r and r -> -2/3: u is 0, and x1 infinite, at t = 2.270937.

    The norm of x passes 1e8 at 2.267707; the run stops at 1e8 times its size.
    """
    _, found = escape
    assert found.status == "escape"
    assert found.time == pytest.approx(2.26828, abs=2e-5)
    assert 2.267707 < found.time < 2.270937
    assert "at t = 2.2682" in found.summary["reason"]


def test_a_run_that_escapes_holds_everything_up_to_then(escape):
    _spec, found = escape
    assert found.t[-1] <= found.time < found.t[-1] + 4 / 1999
    before, last = found.steps.t[-2:]
    assert last < found.time <= last + 2 * (last - before)
    assert np.isfinite(found.table()[1]).all()
    assert np.abs(found.steps.xi[-1]).max() > 1e7
    figure = run_sheet(found)
    assert "ESCAPE at t = 2.2683 s" in figure.get_suptitle()


def test_the_estimate_follows_the_plant_into_its_escape(escape):
    _, found = escape
    late = (found.steps.t > 1.5) & (found.steps.t < 2.25)
    assert np.abs(found.steps.e[late]).max() < 1e-4 * np.abs(found.steps.e[0]).max()


def test_with_the_disturbance_it_escapes_a_little_later():
    _, found = run(POLYNOMIAL, GAIN, f"horizon: 4, x0: {X0}, xhat0: {XHAT0}, {W}")
    assert found.status == "escape"
    assert found.time == pytest.approx(2.39079, abs=2e-5)


def test_from_a_quarter_of_that_state_the_plant_stays_bounded():
    x0, xhat0 = ([0.25 * v for v in x] for x in (X0, XHAT0))
    _, found = run(POLYNOMIAL, GAIN, f"horizon: 12, x0: {x0}, xhat0: {xhat0}")
    assert found.status == "done"
    assert np.abs(found.xi).max() < 1


def test_the_published_gain_attenuates_as_the_reference_has_it():
    _, found = run(POLYNOMIAL, GAIN, f"horizon: 40, {W}")
    assert found.summary["ratio"] == pytest.approx(0.17749, abs=1e-5)
    assert found.summary["ratio_of"] == "norm2(z) / norm2(w)"
    assert found.summary["w_norm2_infinite"] == pytest.approx(0.15 / math.sqrt(8), rel=1e-6)


@pytest.mark.parametrize(("start", "ratio"), [("0", 0.18877), ("[0, -1, 0, 2]", 0.19227)])
def test_the_published_gain_of_the_flexible_joint_does_too(start, ratio):
    trial = f"horizon: 30, {W}" if start == "0" else f"horizon: 30, x0: {start}, xhat0: {start}, {W}"
    _, found = run(JOINT, JOINT_GAIN, trial)
    assert found.summary["ratio"] == pytest.approx(ratio, abs=1e-5)


def test_the_gain_multiplies_y_minus_yhat():
    """With f = q / 2 and L = 1 the error obeys e' = -1.5 e - w."""
    found = simulate(loads(SCALAR % ("1", "0")), {"L": np.ones((1, 1))}, None)
    assert found.e[:, 0] == pytest.approx(np.exp(-1.5 * found.t), abs=1e-7)


def claim(decay, mu2):
    """V = e^2 has V' <= (-3 + 2 decay) V - 2 e w: with |z|^2 = e^2, mu2 >= 1 / (2 - 2 decay) will do for L = 1."""
    return LipschitzGuarantee(math.sqrt(mu2), decay, 1.0, mu2, np.eye(1))


@pytest.mark.parametrize("decay", [0.0, 0.25])
@pytest.mark.parametrize(("xhat0", "w"), [("1", "0"), ("0", "exp(-t)*sin(t)"), ("-2", "exp(-0.3*t)")])
def test_a_true_guarantee_is_kept_for_any_decay(decay, xhat0, w):
    spec = loads(SCALAR % (xhat0, w))
    guarantee = claim(decay, 1 / (2 - 2 * decay))
    found = simulate(spec, {"L": np.ones((1, 1))}, guarantee)
    bounds = found.summary["bounds"]
    assert len(bounds) == 4
    assert all(bound["holds"] for bound in bounds)
    names = " ".join(bound["name"] for bound in bounds)
    assert "(w)" in names
    assert "alpha" not in names
    assert ("exp(-decay t)" in names) is bool(decay)
    assert found.V_bound[-1] >= found.V[-1]
    title = run_sheet(found).get_suptitle()
    assert ("decay = 0.25" in title) is bool(decay)
    assert "γ = " in title


def test_a_gain_from_w_that_is_claimed_too_small_is_found_out():
    found = simulate(loads(SCALAR % ("0", "exp(-0.1*t)")), {"L": np.ones((1, 1))}, claim(0.0, 0.3))
    broken = [bound["name"] for bound in found.summary["bounds"] if not bound["holds"]]
    assert "norm2(z) <= sqrt(e(0)' P e(0)) + gamma norm2(w)" in broken


def test_a_decay_that_is_claimed_too_fast_is_found_out():
    found = simulate(loads(SCALAR % ("1", "0")), {"L": np.ones((1, 1))}, claim(2.0, 0.5))
    assert not all(bound["holds"] for bound in found.summary["bounds"])


def test_without_w_nothing_is_said_of_gamma():
    text = (SCALAR % ("1", "0")).replace(", B: 1", "").replace(", w: 0", "")
    spec, guarantee = loads(text), claim(0.25, 1.0)
    found = simulate(spec, {"L": np.ones((1, 1))}, guarantee)
    assert found.summary["gamma"] is None
    assert all(bound["holds"] for bound in found.summary["bounds"])
    assert "γ" not in run_sheet(found).get_suptitle()
