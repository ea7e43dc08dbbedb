"""Runs against what an L-infinity guarantee promises of them; guarantees that hold on a region only."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_lyapunov
from support.functions import exact
from support.running import simulate
from support.sweep import examples

from obsdesign.dissipation.guarantee import EnergyGuarantee
from obsdesign.families.incremental.guarantee import PeakGuarantee
from obsdesign.reading import loads
from obsdesign.spec import Spec

HEAD = "obsdesign: 1\nobserver: {type: l2, L2: 0, alpha: 0.1}\n"
NO_L2 = np.zeros((0, 1))
SCALAR = """
system: {{A: [[-1]], B: [[1]], C: [[1]]}}
simulation: {{horizon: {horizon}, x0: [{x0}], w: ["{w}"], points: 51}}
"""
RATE = 3.0  # e' = -3 e - w with L1 = -2


def scalar(w: str, x0: float = 0.0, horizon: float = 8.0) -> Spec:
    return loads(HEAD + SCALAR.format(w=w, x0=x0, horizon=horizon))


def certificate(a: float = RATE, alpha: float = RATE / 2, scale: float = 1.0) -> PeakGuarantee:
    """What is exact for e' = -a e - w, z = e, with mu1 = 1: P = 4 alpha (a - alpha), mu2 = 1 / P; false below."""
    P = 4 * alpha * (a - alpha)
    mu2 = scale / P
    return PeakGuarantee(gamma=mu2**0.5, rate=alpha, mu1=1.0, mu2=mu2, P=np.array([[P]]))


def tried(spec: Spec, guarantee: PeakGuarantee | None, L1: float = 1 - RATE):
    return simulate(spec, {"L1": np.array([[L1]]), "L2": NO_L2}, guarantee)


def test_a_constant_w_attains_the_level_and_no_smaller_one_holds():
    run = tried(scalar("1"), certificate())
    summary = run.summary
    assert summary["gamma"] == pytest.approx(1 / RATE)
    assert summary["ratio"] == pytest.approx(1 / RATE, rel=1e-6)
    assert summary["ratio_of"] == "sup|z| / sup|v|"
    assert [b["holds"] for b in summary["bounds"]] == [True] * 5
    assert any("from zero error" in b["name"] for b in summary["bounds"])
    json.dumps(summary, allow_nan=False)
    false = tried(scalar("1"), certificate(scale=0.98)).summary["bounds"]
    assert [b["holds"] for b in false] == [False, False, False, False, True]


def test_the_error_of_an_undisturbed_run_decays_within_its_bound_and_no_faster_than_it_does():
    kept = tried(scalar("0", x0=2), certificate(alpha=RATE - 1e-6)).summary
    assert all(b["holds"] for b in kept["bounds"])
    assert kept["ratio"] is None
    false = replace(certificate(), rate=RATE + 0.1)
    assert not all(b["holds"] for b in tried(scalar("0", x0=2), false).summary["bounds"])


def test_the_largest_w_is_found_between_the_steps_and_at_a_jump():
    smooth = tried(scalar("cos(31*t - 1)", horizon=1.0), None).summary
    assert smooth["v_sup"] == pytest.approx(1, rel=1e-6)
    spike = tried(scalar("where(t < 1.1, 2 + t, 0)", horizon=3.0), None).summary
    assert spike["v_sup"] == pytest.approx(3.1, rel=1e-12)
    of_states = tried(scalar("-x1", x0=-3), None).summary
    assert of_states["v_sup"] == pytest.approx(3)


def test_an_l2_run_reports_suprema_beside_its_norms():
    guarantee = EnergyGuarantee(**vars(certificate()))
    summary = tried(scalar("exp(-t)", x0=1), guarantee).summary
    assert summary["z_sup"] == pytest.approx(1)
    assert summary["v_sup"] == pytest.approx(1)
    assert summary["ratio"] == summary["z_norm2"] / summary["v_norm2"]
    assert "norm2" in summary["ratio_of"]


def test_v_is_drawn_against_what_the_inequality_integrates_to():
    run = tried(scalar("1", x0=-1), certificate())
    P, alpha = 4 * 1.5 * 1.5, 1.5
    assert run.V_bound == pytest.approx(np.exp(-2 * alpha * run.t) * P + 1 - np.exp(-2 * alpha * run.t), rel=1e-6)
    assert (run.V_bound * (1 + 1e-6) >= run.V).all()


NUMBERS = st.floats(-2, 2).map(lambda x: round(x, 3))


@examples(15)
@given(
    F=st.lists(NUMBERS, min_size=4, max_size=4),
    x0=st.tuples(NUMBERS, NUMBERS),
    B=st.tuples(NUMBERS, NUMBERS),
    w=st.sampled_from(["sin(3*t)", "where(t < 1, 1, -1)", "1 + t/(1 + t)", "exp(-t)*cos(t)"]),
)
def test_the_bounds_hold_with_a_certificate_from_a_lyapunov_equation(F, x0, B, w):
    alpha = 0.4
    F = np.array(F).reshape(2, 2)
    F -= (alpha + 0.3 + max(np.linalg.eigvals(F).real.max(), 0)) * np.eye(2)
    C = np.array([[1.0, 0.0]])
    L1 = np.array([[-0.5], [0.25]])
    A = F - L1 @ C
    X = solve_continuous_lyapunov((F + alpha * np.eye(2)).T, -np.eye(2))
    reach = X @ np.array(B)
    P = min(2 * alpha / max(reach @ reach, 1e-3), 1e3) * X  # -s I + s^2 X B B' X / (2 alpha) <= 0
    mu2 = np.linalg.norm(np.linalg.inv(P), 2)
    guarantee = PeakGuarantee(gamma=mu2**0.5, rate=alpha, mu1=1.0, mu2=mu2, P=P)
    text = f"system: {{A: {A.tolist()}, B: [[{B[0]}], [{B[1]}]], C: [[1, 0]]}}\n"
    spec = loads(f'{HEAD}{text}simulation: {{horizon: 4, x0: {list(x0)}, w: ["{w}"], points: 41}}')
    run = simulate(spec, {"L1": L1, "L2": NO_L2}, guarantee)
    assert [b["name"] for b in run.summary["bounds"] if not b["holds"]] == []


LOCAL = """
system: {A: [[-2]], B: [[1]], C: [[1]]}
nonlinearities: [{f: q**3, type: monotone, Bf: [-0.01], Cq: [1]}]
simulation: {horizon: 4, x0: [0], w: [4*t], points: 401}
"""


def local(region: tuple[float, float] | None, **changes: object) -> Spec:
    spec = loads(HEAD + LOCAL)
    blocks = tuple(
        replace(block, region=None if region is None else (exact(*region),)) for block in spec.nonlinearities
    )
    return replace(spec, nonlinearities=blocks, simulation=replace(spec.simulation, **changes))


def ran(spec: Spec, guarantee: PeakGuarantee | None):
    return simulate(spec, {"L1": np.array([[-1.0]]), "L2": np.zeros((1, 1))}, guarantee)


def test_without_a_region_nothing_is_said_of_validity():
    run = ran(local(None), certificate())
    assert "validity" not in run.summary
    assert run.left == ()


def test_a_run_that_stays_in_the_region_says_so():
    summary = ran(local((-0.1, np.inf)), certificate()).summary
    assert summary["validity"]["holds"]
    assert summary["validity"]["left"] == []
    assert summary["bounds_omitted"] is None
    assert summary["bounds"]
    json.dumps(summary, allow_nan=False)


def test_leaving_the_region_ends_what_the_guarantee_says_and_does_not_violate_it():
    false_later = replace(certificate(), mu2=1e-9, gamma=1e-4)  # no bound of this would hold to the end
    run = ran(local((-1.0, 1.0)), certificate())
    left = run.summary["validity"]["left"]
    assert not run.summary["validity"]["holds"]
    assert [(one["of"], one["argument"], one["nonlinearity"]) for one in left] == [
        ("plant", "q1", 1),
        ("estimate", "q1", 1),
    ]
    first = np.searchsorted(run.xi[:, 0], 1.0)
    assert run.t[first - 1] <= left[0]["time"] <= run.t[first]
    assert left[0]["value"] == pytest.approx(1.0, abs=0.02)
    assert left[0]["region"] == (-1.0, 1.0)
    assert left[1]["time"] > left[0]["time"]
    assert "local" in run.summary["bounds_omitted"]
    assert all(b.get("time", 0) < left[0]["time"] for b in run.summary["bounds"])
    begun_outside = ran(local((-1.0, 1.0), x0=np.array([3.0])), false_later).summary
    assert begun_outside["bounds"] == []
    assert begun_outside["validity"]["left"][0]["time"] == 0
    assert not all(b["holds"] for b in ran(local(None), false_later).summary["bounds"])


def test_the_estimate_alone_may_leave():
    run = ran(local((-1.0, np.inf), xhat0=np.array([-2.0])), None)
    (only,) = run.summary["validity"]["left"]
    assert (only["of"], only["time"], only["value"], only["region"]) == ("estimate", 0.0, -2.0, (-1.0, None))


def test_a_region_of_other_arguments_is_watched_too():
    spec = local(None)
    (block,) = spec.nonlinearities
    watched = replace(block, others={"t": exact(0.0, 2.5), "y1": exact(-np.inf, np.inf)})
    summary = ran(replace(spec, nonlinearities=(watched,)), certificate()).summary
    (only,) = summary["validity"]["left"]
    assert (only["argument"], only["of"]) == ("t", "plant")
    assert only["time"] == pytest.approx(2.5, abs=0.02)
