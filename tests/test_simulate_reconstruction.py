"""The reconstruction of w by pinv(B) L1 (yhat - y): reference values, closed forms, and when its bound is void."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support.running import simulate
from support.sweep import examples

from obsdesign.families.incremental.guarantee import PeakGuarantee, Reconstruction
from obsdesign.plot.panels import number
from obsdesign.plot.run import run_sheet
from obsdesign.reading import loads
from obsdesign.spec import Spec

HEAD = "obsdesign: 1\nname: Reconstruction\nobserver: {type: l2, L2: 0, alpha: 0.1}\n"
CUBIC = """
system: {A: [[0, -1, 0], [0, -1, -1], [0, 1, -1]], B: [[1], [0], [0]], C: [[1, 0, 0]]}
nonlinearities: [{f: q**3, type: monotone, Bf: [0, 1, 0], Cq: [1, -1, 0]}]
simulation: {horizon: 16, x0: [426.39, -372.81, -236.45], w: [2*sin(2*t)]}
"""
LINEAR = """
system: {A: [[0, -1, 0], [0, -1, -1], [0, 1, -1]], B: [[1], [0], [0]], C: [[1, 0, 0]]}
simulation: {horizon: 20, x0: [1, -1, 2], w: [2*sin(2*t)]}
"""
SCALAR = """
system: {A: [[-1]], B: [[2]], C: [[1]], D: [[0.5]]}
simulation: {horizon: 12, x0: [0], w: ["%s"], points: 1201}
"""


def reconstructing(text: str) -> Spec:
    spec = loads(HEAD + text)
    return replace(spec, observer=replace(spec.observer, reconstruct=True))


def gains(*L1: float, L2: float | None = None) -> dict[str, np.ndarray]:
    return {"L1": np.array([L1], dtype=float).T, "L2": np.zeros((0, 1)) if L2 is None else np.array([[L2]])}


@pytest.fixture(scope="module")
def paper():
    """The cubic example with the gains of the paper, and its run."""
    spec = reconstructing(CUBIC)
    return spec, simulate(spec, gains(-4.3e4, -0.1076, 0.9771, L2=-1), None)


def own():
    """The cubic example with smaller gains, and its run."""
    spec = reconstructing(CUBIC)
    return spec, simulate(spec, gains(-42.7, 0.18, -0.016, L2=-1), None)


def test_the_cubic_example_gives_the_reference_values(paper):
    for (_, run), limsup, peak in ((paper, 1.0e-4, 1.833e7), (own(), 9.3e-2, 1.82e4)):
        found = run.summary["reconstruction"]
        assert found["limsup"] == pytest.approx(limsup, rel=0.02)
        assert found["peak"] == pytest.approx(peak, rel=2e-3)
        assert "no bound" in found["note"]
        size = np.linalg.norm(run.e, axis=1)
        assert run.t[size > 0.01 * size[0]].max() == pytest.approx(3.56, abs=0.02)


def test_the_table_has_a_column_for_the_reconstruction(paper):
    _, run = paper
    header, rows = run.table()
    assert rows[0, header.index("hat_w1")] == pytest.approx(run.what[0, 0])
    assert run.what - run.w == pytest.approx(run.w_error)
    json.dumps(run.summary, allow_nan=False)


@examples(6)
@given(st.sampled_from([-5.68, -50.7, -5000.7]), st.floats(-3, 1), st.floats(-3, 1))
def test_the_reconstruction_of_a_sinusoid_has_the_accuracy_of_its_transfer_function(first, second, third):
    spec = reconstructing(LINEAR)
    A, B, C = (np.array(m.tolist(), dtype=float) for m in (spec.plant.A, spec.plant.B, spec.plant.C))
    L1 = np.array([[first], [second], [third]])
    F = A + L1 @ C
    assume(np.linalg.eigvals(F).real.max() < -0.6)  # else not over after 16 s
    error = -(B.T @ L1 @ C @ np.linalg.solve(2j * np.eye(3) - F, B)).item() - 1
    run = simulate(spec, {"L1": L1, "L2": np.zeros((0, 1))}, None)
    assert run.summary["reconstruction"]["limsup"] == pytest.approx(2 * abs(error), rel=1e-3)


RATE = 4.0  # e' = -4 e - (2 + L1 / 2) w


def proved(scale: float = 1.0) -> tuple[dict[str, np.ndarray], PeakGuarantee]:
    """Gain of the scalar example and what Theorem 2 gives for it, made smaller by a scale."""
    L1, alpha = 1 - RATE, RATE / 2
    b = 2 + 0.5 * L1
    P = 4 * alpha * (RATE - alpha) / b**2
    size = scale * 0.5 / P**0.5  # of pinv(B) A = -1/2 and of pinv(B) = 1/2 against sqrt(P)
    bound = Reconstruction(size, size, 0.0, alpha, np.array([[P]]))
    guarantee = PeakGuarantee(P**-0.5, alpha, 1.0, 1 / P, np.array([[P]]), bound)
    return gains(L1), guarantee


def scalar(w: str, scale: float = 1.0):
    given, guarantee = proved(scale)
    return simulate(reconstructing(SCALAR % w), given, guarantee)


def test_a_constant_w_attains_the_bound_and_a_smaller_one_is_violated():
    summary = scalar("3").summary
    found = summary["reconstruction"]
    assert found["limsup"] == pytest.approx(found["bound"], rel=1e-6)  # pinv(B) A e = 3 (2 + L1 / 2) / 8
    assert found["holds"]
    assert "what - w" in summary["bounds"][-1]["name"]
    assert summary["bounds"][-1]["holds"]
    assert not scalar("3", scale=0.98).summary["bounds"][-1]["holds"]


@pytest.mark.parametrize("w", ["2*sin(2*t)", "t*exp(-t)", "abs(sin(t))", "3*cos(20*t)"])
def test_the_bound_holds_with_the_largest_rate_of_w(w):
    found = scalar(w).summary["reconstruction"]
    t = np.linspace(0, 12, 1_000_001)
    signal = np.broadcast_to(reconstructing(SCALAR % w).simulation.w[0].function(["t"])(t), t.shape)
    assert found["w_rate_sup"] == pytest.approx(np.abs(np.diff(signal) / np.diff(t)).max(), rel=1e-4)
    assert found["w_sup"] == pytest.approx(np.abs(signal).max(), rel=1e-6)
    assert found["holds"]


@pytest.mark.parametrize(
    ("w", "reason"),
    [
        ("where(t < 1.5, 1, 2)", "jumps at t = 1.5"),
        ("sqrt(t)", "not bounded"),
        ("-x1", "nothing is proved"),
    ],
)
def test_the_bound_is_not_claimed_where_w_has_no_bounded_rate_of_time(w, reason):
    summary = scalar(w).summary
    assert reason in summary["reconstruction"]["note"]
    assert not any("what - w" in b["name"] for b in summary["bounds"])


def test_the_rate_of_a_w_of_the_states_is_taken_from_the_samples():
    run = scalar("cos(3*t) - x1")
    exact = np.gradient(run.w[:, 0], run.t)
    assert run.summary["reconstruction"]["w_rate_sup"] == pytest.approx(np.abs(exact).max(), rel=1e-2)


def test_the_rate_of_the_states_enters_the_bound():
    given, guarantee = proved()
    with_states = replace(guarantee, reconstruction=replace(guarantee.reconstruction, x_rate=0.5))
    run = simulate(reconstructing(SCALAR % "sin(t)"), given, with_states)
    found = run.summary["reconstruction"]
    rate = np.abs(np.gradient(run.xi[:, 0], run.t)).max()
    assert found["x_rate_sup"] == pytest.approx(rate, rel=1e-2)
    size = guarantee.reconstruction.w
    assert found["bound"] == pytest.approx(size * found["w_sup"] + size + 0.5 * found["x_rate_sup"])


def test_noise_voids_the_bound_and_is_seen_in_what():
    given, guarantee = proved()
    noisy = (SCALAR % "sin(t)").replace(
        "points", "noise: {type: uniform, amplitude: [0.1], period: 0.1}, seed: 2, points"
    )
    run = simulate(reconstructing(noisy), given, guarantee)
    assert "noise" in run.summary["reconstruction"]["note"]
    assert run.what == pytest.approx(-1.5 * (run.xi + run.e - run.y[:, :1]), abs=1e-9)  # pinv(B) L1 = -3/2


def test_a_run_that_reconstructs_w_shows_w_and_its_error(paper):
    _spec, run = paper
    signal, error = run_sheet(run).axes[:2]
    assert signal.get_ylabel() == "w1"
    assert max(map(abs, signal.get_ylim())) < 7
    assert "reaches 1.83 × 10⁷" in signal.get_title(loc="left")
    assert (error.get_ylabel(), error.get_yscale()) == ("|error| of w1", "log")
    assert error.get_ylim()[1] > 1.8e7
    line = error.get_lines()[0]
    seen = np.isin(run.steps.t, line.get_xdata())
    assert np.isin(line.get_ydata(), np.abs(run.steps.w_error[seen, 0])).all()
    more = [axes.get_ylabel() for axes in run_sheet(run, every=True).axes]
    assert {"x1", "x2", "x3"} <= set(more)


def test_what_is_proved_of_a_reconstruction_is_drawn_for_the_last_fifth_only():
    given, guarantee = proved()
    run = simulate(reconstructing(SCALAR % "sin(t)"), given, guarantee)
    lines = run_sheet(run).axes[1].get_lines()
    found = run.summary["reconstruction"]
    limits = [line for line in lines if line.get_linestyle() == "--" and len(line.get_xdata())]
    assert limits
    for line in limits:
        assert list(line.get_xdata()) == [0.8 * run.t[-1], run.t[-1]]
        assert set(np.abs(line.get_ydata())) == {found["bound"] + found["transient_left"]}
    fed = simulate(reconstructing(SCALAR % "sin(t) + 0.01*x1"), given, guarantee)
    assert "nothing is proved" in fed.summary["reconstruction"]["note"]
    assert not [line for line in run_sheet(fed).axes[1].get_lines() if line.get_linestyle() == "--"]


def test_the_note_of_what_an_axis_cuts_off_is_the_peak_at_the_steps(paper):
    _spec, run = paper
    signal, error = run_sheet(run).axes[:2]
    top = max(run.steps.what[:, 0], key=abs)
    assert f"an estimate reaches {number(top)}" in signal.get_title(loc="left")
    assert f"peak {number(abs(run.steps.w_error[:, 0]).max())} at" in error.get_legend().get_texts()[0].get_text()
