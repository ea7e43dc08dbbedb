"""Runs along signals in files, against runs along expressions of the same values."""

import re
from pathlib import Path

import numpy as np
import pytest
from support.recorded import ARM, CART, CASES, DISCRETE, HEAD, L2, SINE, rows, simulated
from support.shipped import SPECS

import obsdesign as od
from obsdesign.simulate import simulation
from obsdesign.work import trial


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch, designed_once):  # noqa: ARG001
    monkeypatch.chdir(tmp_path)


def steps(t, u):
    """Expression that is u_k from t_k on."""
    return " + ".join(
        [
            repr(float(u[0])),
            *(f"({d!r})*(t >= {x!r})" for d, x in zip(np.diff(u).tolist(), t[1:].tolist(), strict=True)),
        ]
    )


def lines(t, u):
    """Expression that is on a line between u_k at t_k and the next."""
    slopes = np.diff(u) / np.diff(t)
    bends = zip(np.diff(slopes).tolist(), t[1:-1].tolist(), strict=True)
    return " + ".join([f"{float(u[0])!r} + {float(slopes[0])!r}*t", *(f"({d!r})*max(t - {x!r}, 0)" for d, x in bends)])


def assert_same(one, other, abs=1e-6):
    assert one.status == other.status == "done"
    for signal in ("t", "xi", "xihat", "u", "y"):
        assert getattr(one, signal) == pytest.approx(getattr(other, signal), abs=abs), signal


@pytest.mark.parametrize("case", CASES)
def test_rows_that_are_held_are_the_same_run_as_an_expression_of_steps(case):
    t = (0.1 * np.arange(21)).round(6) if case in DISCRETE else np.linspace(0, 1.8, 9).round(6)
    u = np.random.default_rng(1).normal(size=len(t)).round(3)
    rows("drive.csv", t, u)
    assert_same(simulated(case, "{u: {file: drive.csv}}"), simulated(case, f'"{steps(t, u)}"'))


@pytest.mark.parametrize("case", CASES)
def test_rows_on_lines_are_the_same_run_as_an_expression_of_lines(case):
    t = np.array([0, *np.sort(np.random.default_rng(2).uniform(0.01, 1.99, 7)).round(4), 2])
    u = np.random.default_rng(3).normal(size=len(t)).round(3)
    rows("drive.csv", t, u)
    assert_same(simulated(case, "{u: {file: drive.csv, hold: first}}"), simulated(case, f'"{lines(t, u)}"'))


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("case", [case for case in CASES if case not in DISCRETE])
def test_many_rows_are_the_same_run_as_one_by_one(case, hold, monkeypatch):
    t = np.array([0, *np.sort(np.random.default_rng(4).uniform(0.01, 1.99, 158)).round(4), 2])
    rows("drive.csv", t, np.sin(3 * t) + np.random.default_rng(5).normal(size=len(t)))
    written = f"{{u: {{file: drive.csv, hold: {hold}}}}}"
    quick = simulated(case, written)
    monkeypatch.setattr(simulation, "MANY", np.inf)
    assert_same(quick, simulated(case, written), abs=1e-5)


def test_many_rows_are_as_accurate_as_they_are_said_to_be():
    t = np.linspace(0, 2, 201)
    rows("drive.csv", t, np.exp(t))
    run = simulated("continuous", "{u: {file: drive.csv, hold: first}}")
    rate = run.steps.xi[:, 1]
    assert (np.diff(run.steps.t) >= 0).all()
    assert run["u"] == pytest.approx(np.interp(run.t, t, np.exp(t)), abs=1e-12)
    assert np.interp(1.0, run.steps.t, rate) == pytest.approx(np.interp(1.0, run.t, run.xi[:, 1]), abs=1e-4)


def test_a_stiff_observer_along_a_file_is_as_quick_as_another(monkeypatch):
    monkeypatch.delattr(simulation, "integrate")  # LSODA is not called
    t = np.linspace(0, 2, 501)
    rows("drive.csv", t, np.sin(40 * t))
    assert simulated("stiff", "{u: {file: drive.csv}}").status == "done"


def test_a_run_along_a_file_that_escapes_says_so():
    t = np.linspace(0, 4, 401)
    rows("drive.csv", t, 1 + t)
    Path("case.yaml").write_text(
        f"{HEAD}{CART.replace('gx: [0, u]', 'gx: [0, u + 60*y1]')}{CASES['linear'][1]}"
        "simulation: {horizon: 4, x0: [1, 0], w: [cos(t)], u: {u: {file: drive.csv}}}\n"
    )
    run = od.solve(od.load("case.yaml")).simulate()
    assert (run.status, "grows beyond" in run.summary["reason"]) == ("escape", True)


def test_w_and_v_in_files_have_the_norms_of_their_rows():
    """|v|^2 of a held signal is a sum, its largest value that of a row, however short."""
    t, v = np.array([0, 0.5, 0.50001, 1.5]), np.array([0.2, 3, -0.1, 0.4])
    rows("push.csv", t, v, head="t,push")
    plant = CART.replace(", gx: [0, u]", "").replace(", inputs: [u]", ", disturbances: [push]")
    plain = f"{HEAD}{plant}{SINE}{L2}"
    driven = f"{plain.replace('[-4, -3]', '[-4, -3, -0.5]')}disturbance: integrator\n"
    for text, key in ((plain, "w: {push"), (driven, "v: {v1"), (plain, "v: {v1")):
        column = ", column: push" if "v1" in key else ""
        Path("case.yaml").write_text(
            f"{text}simulation: {{horizon: 2, x0: [1, 0], {key}: {{file: push.csv{column}}}}}}}\n"
        )
        summary = od.solve(od.load("case.yaml")).simulate().summary
        assert summary["v_sup"] == pytest.approx(3)
        assert summary["v_norm2"] ** 2 == pytest.approx(0.5 * 0.04 + 1e-5 * 9 + 0.99999 * 0.01 + 0.5 * 0.16, rel=1e-6)
        assert summary["v_norm2_infinite"] is None
        assert summary["bounds"]
        assert all(bound["holds"] for bound in summary["bounds"])


def test_a_signal_on_lines_has_its_largest_value_at_a_row():
    t, v = np.array([0, 1, 2]), np.array([-0.1, 2.5, 0])
    rows("push.csv", t, v, head="t,push")
    plant = CART.replace(", gx: [0, u]", "").replace(", inputs: [u]", ", disturbances: [push]")
    text = (
        f"{HEAD}{plant}{SINE}{L2}simulation: {{horizon: 2, points: 3, w: {{push: {{file: push.csv, hold: first}}}}}}\n"
    )
    summary = od.solve(od.load(text)).simulate().summary
    assert summary["v_sup"] == pytest.approx(2.5)
    assert summary["v_norm2"] ** 2 == pytest.approx((0.01 - 0.25 + 6.25) / 3 + 6.25 / 3, rel=1e-6)


def test_a_reconstruction_is_bounded_along_lines_and_not_along_steps():
    """The bound needs w', which is the slope of a line and not finite where w jumps."""
    t, w = np.array([0, 0.7, 2, 4]), np.array([0, 0.7, -0.1, 0.4])
    rows("push.csv", t, w, head="t,w1")
    text = Path(SPECS, "chakrabarty2016-matched-input.yaml").read_text()
    text = re.sub("w: 2.*\n", "w: WHAT\n", text.replace("horizon: 10", "horizon: 4"))
    along = [f"{{w1: {{file: push.csv, hold: {hold}}}}}" for hold in ("zero", "first")]
    zero, first, written = (
        od.solve(od.load(text.replace("WHAT", what))).simulate().summary for what in (*along, f'"{lines(t, w)}"')
    )
    assert "w jumps at t = 0.7" in zero["reconstruction"]["note"]
    assert first["reconstruction"] == pytest.approx(written["reconstruction"], rel=1e-5)
    assert first["bounds"][-1]["holds"]


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_the_rows_of_several_files_and_expressions_act_together(hold):
    t, s = np.array([0, 0.3, 1.1, 2]), np.array([0, 0.25, 0.5, 2.0])
    u, push = np.array([1, -1, 0.5, 0]), np.array([0.3, 0, -0.2, 0.1])
    rows("a/u.csv", t, u, head="time;Torque (Nm)", sep=";")
    rows("a/push.csv", s, push, head="t,push")
    plant = ARM.replace("inputs: [u]", "inputs: [u, k], units: {u: Nm}").replace("+ u +", "+ u*k +")
    kind = "observer: {type: ekf, Q: {push: 0.1}, R: 1.0e-2}\n"
    first = f"{{file: a/u.csv, column: Torque, time: time, hold: {hold}}}"
    recorded = f"{{u: {{u: {first}, k: 1 + t}}, w: {{push: {{file: a/push.csv, hold: {hold}}}}}"
    form = steps if hold == "zero" else lines
    written = f'{{u: ["{form(t, u)}", 1 + t], w: ["{form(s, push)}"]'
    runs = []
    for one in (recorded, written):
        Path("case.yaml").write_text(f"{HEAD}{plant}{kind}simulation: {one}, horizon: 2, x0: [0.5, 0], points: 21}}\n")
        runs.append(trial("case.yaml").simulate())
    assert_same(*runs)


@pytest.mark.parametrize("case", ["samples", "filtered"])
@pytest.mark.parametrize("hold", ["zero", "first"])
def test_what_drives_samples_may_be_in_a_file(case, hold, monkeypatch):
    """Of filtered estimates w of the next sample, too, whose norm the bounds take."""
    t, w = (0.1 * np.arange(21)).round(6), np.random.default_rng(8).normal(size=21).round(3)
    rows("push.csv", t, w, -w, head="t,w1,w2")
    pulse = " + ".join(f"({x!r})*(abs(t - {at!r}) < 0.01)" for at, x in zip(t.tolist(), w.tolist(), strict=True))
    plant, observer, _ = CASES[case]
    runs = []
    for w in (f"{{w1: {{file: push.csv, hold: {hold}}}, w2: {{file: push.csv}}}}", f'["{pulse}", "-({pulse})"]'):
        monkeypatch.setitem(CASES, case, (plant, observer, f"w: {w}"))
        runs.append(simulated(case, "[0]", horizon=1.9))
    for signal in ("xi", "xihat", "y", "w"):
        assert getattr(runs[0], signal) == pytest.approx(getattr(runs[1], signal), abs=1e-9)
    bounds = [[(one["value"], one["bound"]) for one in run.summary["bounds"]] for run in runs]
    assert np.array(bounds[0]) == pytest.approx(np.array(bounds[1]))
    assert len(bounds[0]) > 0


def test_an_event_of_a_recorded_input_ends_a_run_at_its_row(monkeypatch):
    rows("drive.csv", [0, 0.4, 1.1, 1.3], [0, 0.3, 0.8, 0])
    plant, observer, further = CASES["continuous"]
    monkeypatch.setitem(CASES, "continuous", (plant, observer, f"{further}, events: {{much: u > 0.5}}"))
    run = simulated("continuous", "{u: {file: drive.csv, hold: zero}}", horizon=1.4)
    assert (run.status, run.time) == ("stopped", pytest.approx(1.1, abs=1e-9))
