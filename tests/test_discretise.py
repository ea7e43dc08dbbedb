"""Plants in samples that stand for continuous ones, and what is claimed of those."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from support.commands import run

from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UsageError
from obsdesign.families.incremental.design import design
from obsdesign.families.outcome import Verdict
from obsdesign.lmi.formula import in_floats, rational
from obsdesign.lmi.spectrum import upper
from obsdesign.model.discretise import kappa
from obsdesign.reading import loads

PENDULUM = """
obsdesign: 1
name: Pendulum in samples
system:
  states: [angle, speed]
  disturbances: [torque, noise]
  dynamics: {{angle: speed, speed: -sin(angle) - 0.5*speed + 2*torque}}
  outputs: {{encoder: angle + 0.05*noise}}
  {more}
observer: {{type: linf, rho: {rho}}}
"""
DEFECT = "discretise: {{period: {Ts}, defect: {{q_rate: {q_rate}, w_rate: 2}}}}"


def moved(Ts):
    """Continuous pendulum at its samples, with w = 2 sin 2t: x (M, 2), delta (M - 1,), and sup|q'|."""
    t = np.arange(0, 60 + Ts / 2, Ts)

    def flow(time, x):
        return [x[1], -math.sin(x[0]) - 0.5 * x[1] + 2 * math.sin(2 * time)]

    fine = solve_ivp(flow, (0, 60), [1, 0], t_eval=np.linspace(0, 60, 60001), rtol=1e-11, atol=1e-12).y.T
    x = solve_ivp(flow, (0, 60), [1, 0], t_eval=t, rtol=1e-11, atol=1e-12).y.T
    A = np.array([[0, 1], [0, -0.5]])
    E = expm(A * Ts)
    Phi = expm(np.block([[A, np.eye(2)], [np.zeros((2, 4))]]) * Ts)[:2, 2:]
    acting = -np.sin(x[:-1, 0]) + 2 * np.sin(2 * t[:-1])
    delta = x[1:] - x[:-1] @ E.T - np.outer(acting, Phi[:, 1])
    return t, x, np.linalg.norm(delta, axis=1), np.abs(fine[:, 1]).max()


@pytest.mark.parametrize(
    ("Ts", "largest", "bound", "certified", "rho"),
    [
        (0.2, 0.1138, 0.1167, 1.993, 0.698),
        (0.1, 0.0289, 0.0296, 1.282, 0.754),
        (0.05, 0.00731, 0.00745, 1.062, 0.861),
        (0.01, 2.94e-4, 3.00e-4, 0.967, 0.969),
    ],
)
def test_the_defect_and_the_error_of_a_pendulum_are_within_what_is_certified(Ts, largest, bound, certified, rho):
    t, x, delta, q_rate = moved(Ts)
    spec = loads(PENDULUM.format(rho=rho, more=DEFECT.format(Ts=Ts, q_rate=f"{q_rate + 1e-6:.6f}")))
    assert delta.max() == pytest.approx(largest, rel=3e-3)
    assert delta.max() <= float(spec.continuous.defect) == pytest.approx(bound, rel=2e-3)
    outcome = design(spec, Engine())
    assert outcome.status is Verdict.CERTIFIED
    assert math.sqrt(3) * outcome.limit["gamma"] == pytest.approx(certified, rel=1e-3)
    said = outcome.claim.written(spec, {})["guarantee"]["at_samples"]
    assert said["error"] == pytest.approx(math.sqrt(3) * float(outcome.claim.certificate.gamma), rel=1e-12)
    assert observed(spec, outcome.gains, t, x).max() <= said["error"]


def observed(spec, gains, t, x):
    """Errors at the samples of the observer of the hold, beside the continuous plant, from zero error."""
    p, noise = in_floats(spec.plant), 0.05 * np.sign(np.sin(3 * t + 0.3))
    xhat, found = x[0].copy(), []
    for k in range(len(t)):
        found.append(np.linalg.norm(xhat - x[k]))
        residual = xhat[0] - (x[k, 0] + noise[k])
        inside = xhat[0] + gains["L2"][0, 0] * residual
        xhat = p.A @ xhat + p.Bf[:, 0] * math.sin(inside) + gains["L1"][:, 0] * residual
    return np.array(found)


@given(
    A=st.lists(st.integers(-30, 30), min_size=4, max_size=4),
    b=st.lists(st.integers(-10, 10), min_size=2, max_size=2),
    Ts=st.fractions("1/100", "1/2", max_denominator=100),
)
def test_kappa_is_a_tight_bound_on_its_integral(A, b, Ts):
    A, b, T = np.array(A).reshape(2, 2) / 10, np.array(b)[:, None], float(Ts)
    bound = upper(kappa(rational(np.round(A, 1).astype(str)), rational(b), fmpq(Ts.numerator, Ts.denominator)))
    exact = quad(lambda s: np.linalg.norm(expm(A * (T - s)) @ b) * s, 0, T, epsabs=0, epsrel=1e-10)[0]
    assert exact * (1 - 1e-9) <= bound <= exact * 1.05 + 1e-300


def test_implicit_euler_puts_f_into_its_own_argument():
    text = """
obsdesign: 1
system: {A: [[0, 1], [-1, -.1]], B: [[0, 0], [1, 0]], C: [1, 0], D: [0, .1], inputs: [u], gx: [0, u],
         discretise: {period: .1, method: implicit-euler}}
nonlinearities: [{type: monotone, Bf: [0, -1], Cq: [0, 1]}]
observer: {type: l2, rho: .98}
"""
    spec = loads(text)
    S = np.linalg.inv(np.eye(2) - 0.1 * np.array([[0, 1], [-1, -0.1]]))
    p = in_floats(spec.plant)
    for found, expected in ((p.A, S), (p.Bf[:, 0], -0.1 * S[:, 1]), (p.B[:, 0], 0.1 * S[:, 1]), (p.Cq[0], S[1])):
        assert found == pytest.approx(expected, rel=1e-14)
    assert (p.Dqf.item(), p.Dq[0, 0]) == pytest.approx((-0.1 * S[1, 1], 0.1 * S[1, 1]), rel=1e-14)
    assert spec.gq[0].scalar(["u"])(1.0) == pytest.approx(0.1 * S[1, 1], rel=1e-14)
    assert design(spec, Engine()).limit["gamma"] == pytest.approx(0.543574688, rel=1e-6)
    assert float(spec.continuous.plant.A[1, 1]) == -0.1


def test_the_result_keeps_both_plants_and_says_what_is_claimed_of_the_continuous_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("pendulum.yaml").write_text(PENDULUM.format(rho=0.75, more="discretise: {period: 0.1}"))
    assert run("solve", "pendulum.yaml", "-q").exit_code == 0
    result = json.loads(Path("pendulum.gains.json").read_text())
    assert result["discretised"]["statement"].startswith("a model: nothing that is proved of it is proved of the cont")
    assert (result["discretised"]["period"], result["discretised"]["method"]) == (0.1, "hold")
    assert result["split"]["A"] == [[0, 1], [0, -0.5]]
    assert "at_samples" not in result["guarantee"]
    assert run("verify", "pendulum.gains.json").exit_code == 0
    result["discretised"]["statement"] = "proved of the plant"
    Path("pendulum.gains.json").write_text(json.dumps(result))
    outcome = run("verify", "pendulum.gains.json")
    assert outcome.exit_code == 2
    assert "discretised: is not the plant in samples that the spec asks for" in outcome.stderr


@pytest.mark.parametrize("forged", [{"error": 0.5}, {"defect": 1e-9}, {"statement": "exact"}])
def test_a_forged_claim_about_the_samples_is_refused(forged, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("pendulum.yaml").write_text(PENDULUM.format(rho=0.75, more=DEFECT.format(Ts=0.1, q_rate=2)))
    assert run("solve", "pendulum.yaml", "-q").exit_code == 0
    result = json.loads(Path("pendulum.gains.json").read_text())
    assert run("verify", "pendulum.gains.json").exit_code == 0
    result["guarantee"]["at_samples"] |= forged
    Path("pendulum.gains.json").write_text(json.dumps(result))
    assert run("verify", "pendulum.gains.json").exit_code == 2


def test_the_rate_of_an_argument_is_found_on_the_domain():
    more = "domain: {speed: [-3, 2]}\n  discretise: {period: .1, defect: {q_rate: auto, w_rate: 2}}"
    spec = loads(PENDULUM.format(rho=0.75, more=more))
    assert float(spec.continuous.rates[0]) == 3
    assert any("|q_i'| is at most 3 on system.domain" in note for note in spec.notes)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("discretise: {period: 0}", "system.discretise.period: 0 is not allowed; give a number > 0"),
        ("discretise: {period: .1, method: euler}", "system.discretise.method: euler is not there"),
        ("time: discrete\n  discretise: {period: .1}", "leave time and period out"),
        ("discretise: {period: .1, defect: {q_rate: 2}}", "w_rate is required"),
        ("discretise: {period: .1, defect: {q_rate: auto, w_rate: 1}}", "give a number"),
        ("discretise: {period: .1, method: implicit-euler, defect: {q_rate: 2, w_rate: 1}}", "is for method: hold"),
    ],
)
def test_what_cannot_be_discretised_is_refused_in_one_line(more, said):
    with pytest.raises(UsageError) as refused:
        loads(PENDULUM.format(rho=0.75, more=more))
    assert len(refused.value.problems) == 1
    assert said in str(refused.value)


def test_a_defect_is_for_peaks():
    text = PENDULUM.format(rho=0.75, more=DEFECT.format(Ts=0.1, q_rate=2)).replace("type: linf", "type: l2")
    with pytest.raises(UsageError, match="is for type linf"):
        loads(text)


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (
            "[{model: {Am: [[0]], Bm: [[1]], Cm: [[1]]}}, unknown]",
            "which discretise does not turn into samples",
        ),
        ("[{sinusoid: {omega: 6}}, unknown]", "whose v at a sample is the mean over a period"),
        ("[{bias+sinusoid: {omega: 6}}, unknown]", "whose v at a sample is the mean over a period"),
        ("[double-integrator, unknown]", "whose v at a sample is the mean over a period"),
    ],
)
def test_the_defect_is_claimed_only_where_v_of_samples_is_no_larger_than_that_of_the_plant(model, said):
    """Of a sinusoid v_k reaches tan(X)/X times |v|, X = omega period / 2; a model in matrices is one of samples."""
    text = PENDULUM.format(rho=0.9, more=DEFECT.format(Ts=0.1, q_rate=2)) + f"disturbance: {model}\n"
    with pytest.raises(UsageError) as refused:
        loads(text)
    assert said in str(refused.value)


def test_a_drift_beside_the_defect_is_certified():
    text = PENDULUM.format(rho=0.9, more=DEFECT.format(Ts=0.1, q_rate=2)) + "disturbance: [integrator, unknown]\n"
    outcome = design(loads(text), Engine())
    assert outcome.status is Verdict.CERTIFIED
    assert "every channel of v" in outcome.claim.written(loads(text), {})["guarantee"]["at_samples"]["statement"]
