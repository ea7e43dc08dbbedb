"""Observers side by side on one log: innovations, errors against its truth, and what is refused."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from support.commands import PNG, run

import obsdesign as od
from obsdesign.plot.recorded import recorded_sheet

pytestmark = pytest.mark.usefixtures("designed_once")
PLANT = """obsdesign: 1
name: Pendulum, %(name)s
system:
  states: [angle, speed]
  outputs: [encoder]
  inputs: [u]
  disturbances: [torque]
  units: {angle: rad, speed: rad/s, encoder: rad}
  A: [[0, 1], [0, -0.5]]
  B: [0, 1]
  C: [1, 0]
  gx: [0, u]
nonlinearities: [{type: sin, Bf: [0, -9.81], Cq: [1, 0]}]
disturbance: integrator
observer: %(observer)s
implementation: {period: 1.0e-3, method: rk4}
simulation: {horizon: 2, x0: [0.3, 0], u: 0.5*sin(3*t), w: ["1 - exp(-t)"], points: 2001, NOISE}
"""
NOISE = "noise: {type: gaussian, amplitude: 1.0e-3, period: 1.0e-3}, observer: implementation"
OBSERVERS = {
    "l2": "{type: l2, alpha: 0.5, bounds: {L1: 200}}",
    "ekf": "{type: ekf, Q: 1.0e-3, R: 1.0e-9}",
    "ukf": "{type: ukf, Q: 1.0e-3, R: 1.0e-9}",
    "lqe": "{type: lqe, Q: 1.0e-3, R: 1.0e-9}",
}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, observer in OBSERVERS.items():
        Path(f"{name}.yaml").write_text(PLANT.replace("NOISE", NOISE) % {"name": name, "observer": observer})


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Log of a run, as text."""
    path = tmp_path_factory.mktemp("log")
    text = PLANT.replace("NOISE", NOISE) % {"name": "log", "observer": OBSERVERS["lqe"]}
    Path(path, "log.yaml").write_text(text)
    with pytest.MonkeyPatch.context() as there:
        there.chdir(path)
        assert run("simulate", "log.yaml", "-o", "log.csv", "-q").exit_code == 0
    return Path(path, "log.csv").read_text()


def columns(log, *names, head=None):
    """The log with some of its columns, under a head."""
    rows = [line.split(",") for line in log.splitlines()]
    at = [rows[0].index(name) for name in names]
    lines = [",".join(row[i] for i in at) for row in rows]
    return "\n".join([head or lines[0], *lines[1:]]) + "\n"


def compared(*options):
    outcome = run("compare", *options, "--json", "-q")
    assert outcome.exit_code == 0, outcome.output
    return json.loads(outcome.stdout)


def test_all_observers_run_on_one_log_and_are_held_against_its_truth(log):
    Path("log.csv").write_text(log)
    report = compared(*(f"{name}.yaml" for name in OBSERVERS), "--data", "log.csv", "-o", "on.png")
    assert report["data"] == {"file": "log.csv", "rows": 2001, "span": [0, 2], "truth": ["angle", "speed", "torque"]}
    assert report["window"] == [pytest.approx(2 / 6), 2]
    assert [one["status"] for one in report["observers"]] == ["certified", *["no guarantee"] * 3]
    table = dict(
        zip(log.splitlines()[0].split(","), np.loadtxt(log.splitlines(), delimiter=",", skiprows=1).T, strict=True)
    )
    inside = table["t"] >= 2 / 6
    for one in report["observers"]:
        assert one["run"] == "done"
        estimates = od.estimate(f"{one['type']}.yaml", "log.csv")
        e = estimates["hat_speed"] - table["speed"]
        assert one["states"]["speed"]["error_rms"] == pytest.approx(np.sqrt(np.mean(e[inside] ** 2)), rel=1e-9)
        innovation = estimates["innov_encoder"][inside]
        assert one["innovation_rms"]["encoder"] == pytest.approx(np.sqrt(np.mean(innovation**2)), rel=1e-9)
        angle = np.abs(estimates["hat_angle"] - table["angle"])
        assert one["states"]["angle"]["t5"] == table["t"][np.flatnonzero(angle > 0.05 * angle[0])[-1] + 1]
        assert one["states"]["speed"]["t5"] == 0
        assert 0 < one["time_s"] < 1e-3
        assert one["steps_a_row"] == 1
        assert one["row_s"] == pytest.approx(one["time_s"])
    found = {one["type"]: one["states"]["torque"]["error_rms"] for one in report["observers"]}
    assert max(found.values()) < 30 * min(found.values())
    assert Path("on.png").read_bytes().startswith(PNG)


def test_an_observer_of_many_cheap_steps_is_told_by_the_row(log):
    """In steps of the spec, in four times as many, or in such as are found by halving."""
    Path("log.csv").write_text(log)
    text = Path("lqe.yaml").read_text()
    Path("fine.yaml").write_text(text.replace("period: 1.0e-3, method", "period: 2.5e-4, method"))
    Path("found.yaml").write_text(
        text.replace("implementation: {period: 1.0e-3, method: rk4}\n", "").replace(", observer: implementation", "")
    )
    report = compared("lqe.yaml", "fine.yaml", "found.yaml", "--data", "log.csv")
    one, fine, found = report["observers"]
    assert [one["steps_a_row"], fine["steps_a_row"]] == [1, 4]
    assert found["steps_a_row"] == pytest.approx(1e-3 / found["step"])
    for entry in (one, fine, found):
        assert entry["row_s"] == pytest.approx(entry["steps_a_row"] * entry["time_s"], rel=1e-12)
    assert fine["row_s"] > one["row_s"]


def test_what_rounding_leaves_of_an_output_that_is_known_is_not_held_to_be_white():
    """The plant in other arithmetic than in the spec, from where the observer begins, without noise in the last y."""
    Path("known.yaml").write_text("""obsdesign: 1
system:
  time: discrete
  inputs: [u]
  disturbances: [w]
  dynamics: {a: 0.9*a + 0.3*u + 0.1*w, b: 0.7*b + u}
  outputs: {y: a, z: b}
observer: {type: ekf, Q: 1, R: 1}
simulation: {horizon: 3, x0: [1, 1], xhat0: [1, 1], u: sin(t), w: [0]}
""")
    rng, a, b, lines = np.random.default_rng(0), 1.0, 1.0, ["t,u,y,z"]
    for k in range(400):
        u = np.sin(0.1 * k)
        lines.append(f"{k},{u:.17g},{a + 0.1 * rng.normal():.17g},{b:.17g}")
        a, b = (9 * a + 3 * u) / 10, (7 * b + 10 * u) / 10
    Path("known.csv").write_text("\n".join(lines) + "\n")
    found = od.compare(["known.yaml"], data="known.csv")
    (one,) = found.report["observers"]
    assert one["zero_to_rounding"] == ["z"]
    assert 0 < one["innovation_rms"]["z"] < 1e-14
    assert one["white"]["z"] is None
    assert one["white"]["y"] is not None
    assert re.search(r" z +\S+e-1\d +zero to rounding", str(found))
    told = run("estimate", "known.yaml", "known.csv")
    assert re.search(r"z: mean \S+, rms \S+e-1\d, zero to rounding\n", told.stdout)


@pytest.mark.slow
def test_two_runs_differ_in_the_times_of_a_step_and_a_row_only(log):
    Path("log.csv").write_text(log)
    reports, figures = [], []
    for _ in range(2):
        reports.append(compared("ekf.yaml", "lqe.yaml", "--data", "log.csv"))
        figures.append(Path("compare.png").read_bytes())
        for one in reports[-1]["observers"]:
            del one["time_s"], one["row_s"]
    assert reports[0] == reports[1]
    assert figures[0] == figures[1]


def test_the_truth_is_what_is_called_so_or_what_a_map_or_the_spec_names(log):
    Path("bare.csv").write_text(columns(log, "t", "u", "encoder"))
    found = od.compare(["lqe.yaml"], data="bare.csv")
    assert found.report["data"]["truth"] == []
    assert found.report["observers"][0]["states"] == {}
    assert "no truth: no column is called as a state" in str(found)
    Path("named.csv").write_text(columns(log, "t", "u", "encoder", "speed", head="t,u,encoder,Tacho [rad/s]"))
    said = ("lqe.yaml", "--data", "named.csv", "--map")
    mapped = compared(*said, "speed=Tacho")
    assert mapped["data"]["truth"] == ["speed"]
    Path("lqe.yaml").write_text(Path("lqe.yaml").read_text() + "data: {columns: {speed: Tacho}}\n")
    assert compared("lqe.yaml", "--data", "named.csv")["observers"][0]["states"] == mapped["observers"][0]["states"]
    assert run("estimate", "lqe.yaml", "bare.csv", "-q").exit_code == 0  # which asks for no truth


@pytest.mark.slow
def test_a_value_of_the_truth_that_is_missing_does_not_count(log):
    lines = columns(log, "t", "u", "encoder", "speed").splitlines()
    kept = [lines[0], *(line if k % 2 else line.rpartition(",")[0] + "," for k, line in enumerate(lines[1:]))]
    Path("half.csv").write_text("\n".join(kept) + "\n")
    Path("log.csv").write_text(log)
    half, whole = (compared("lqe.yaml", "--data", f"{name}.csv")["observers"][0] for name in ("half", "log"))
    assert half["missing"] == 0
    assert half["states"]["speed"]["error_rms"] == pytest.approx(whole["states"]["speed"]["error_rms"], rel=0.1)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--map", "speed=Tacho"], "bare.csv:1:0: has no column Tacho; it has t, u, encoder"),
        (
            ["--map", "spin=Tacho"],
            "--map spin: spin is no signal; allowed: t, arrival, encoder, u, angle, speed, torque",
        ),
        (["--map", "encoder"], "--map encoder: write SIGNAL=COLUMN"),
        (["--seeds", "3"], "--seeds: a log has the noise that it has"),
        (["--hold", "second"], "--hold: 'second' is not known"),
    ],
)
def test_what_cannot_be_compared_is_one_line(log, options, said):
    Path("bare.csv").write_text(columns(log, "t", "u", "encoder"))
    outcome = run("compare", "lqe.yaml", "--data", "bare.csv", *options)
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1), outcome.output
    assert said in outcome.stderr
    assert not Path("compare.png").exists()


def test_options_of_a_log_need_one():
    for option in (["--map", "speed=Tacho"], ["--hold", "first"], ["--repair"]):
        outcome = run("compare", "lqe.yaml", *option)
        assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
        assert "are of a log; name it: --data LOG.csv" in outcome.stderr


def test_observers_of_other_signals_are_refused(log):
    Path("log.csv").write_text(log)
    Path("other.yaml").write_text(Path("lqe.yaml").read_text().replace("encoder", "sensor"))
    outcome = run("compare", "lqe.yaml", "other.yaml", "--data", "log.csv")
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
    assert (
        "the list of outputs is sensor, but encoder in lqe.yaml; observers on one log take the same" in outcome.stderr
    )


def test_an_observer_that_escapes_says_so_beside_the_others(log):
    Path("log.csv").write_text(log)
    text = Path("lqe.yaml").read_text().replace("Q: 1.0e-3", "Q: 1.0e+13").replace("lqe", "wild", 1)
    Path("wild.yaml").write_text(text)
    found = od.compare(["wild.yaml", "lqe.yaml"], data="log.csv")
    wild, lqe = found.report["observers"]
    assert "the observer has no finite value after this row" in wild["run"]
    assert wild["time_s"] is wild["row_s"] is wild["steps_a_row"] is None
    assert lqe["run"] == "done"
    assert "it ended early" in str(found)


def figure(log, *names):
    Path("log.csv").write_text(log)
    found = recorded_sheet(od.compare([f"{name}.yaml" for name in names], data="log.csv"))
    labels = [axes.get_ylabel() or axes.get_title("right") for axes in found.axes]
    return dict(zip(labels, found.axes, strict=True)), [text.get_text() for text in found.axes[-1].texts]


def test_the_figure_has_estimates_errors_and_sizes(log):
    panels, cells = figure(log, "l2", "ekf")
    signals = ["angle [rad]", "speed [rad/s]", "torque"]
    assert list(panels) == [*signals, *(f"|e| of {name}" for name in signals), ""]
    assert next(line.get_label() for line in panels["torque"].get_lines()) == "true"
    assert len(panels["torque"].get_lines()) == 3
    assert {"not of its steps", "no guarantee", "rms of y - ŷ, encoder", "rms of e, torque"} <= set(cells)
    panels, cells = figure(columns(log, "t", "u", "encoder"), "ekf", "lqe")
    assert "|innovation| of encoder [rad]" in panels
    assert not any(cell.startswith("rms of e,") for cell in cells)


def test_python_and_the_table(log):
    Path("log.csv").write_text(log)
    found = od.compare(["ekf.yaml", od.load("lqe.yaml")], data="log.csv")
    lines = str(found).splitlines()
    assert lines[0].startswith("observer")
    assert re.search(
        "step us +steps a row +row us  output +innovation +white  estimate +error rms +5 % s +1 % s$", lines[0]
    )
    assert re.search(r"^ekf +ekf +no guarantee +9 +[\d.]+ +1 +[\d.]+ +encoder +0\.00\d+ ", lines[1])
    assert "from 0" in lines[2]
    assert "ekf: no guarantee" in lines
    with pytest.raises(od.UsageError, match="nothing to compare"):
        od.compare([], data="log.csv")


def test_a_filter_that_escapes_in_a_run_ends_no_comparison():
    """The gain of a motor that stands, with the slope of its friction there, along one that turns."""
    Path("motor.yaml").write_text(
        """obsdesign: 1
system:
  inputs: [u]
  disturbances: [load]
  dynamics: {omega: -200*tanh(50*omega) + 500*i - 1.0e+4*load, i: 1000*(u - i - 0.05*omega)}
  outputs: {cur: i}
observer: {type: lqe, Q: 1.0e-4, R: 4.0e-9, AT}
simulation: {horizon: 0.2, x0: [0, 0], u: 12*sin(10*t), noise: {amplitude: 0.02, period: 1.0e-3}}
""".replace(", AT", "")
    )
    outcome = run("compare", "motor.yaml", "--seeds", 1)
    assert outcome.exit_code == 0, outcome.output


KNEE = PLANT.replace("  inputs: [u]\n", "").replace("  gx: [0, u]\n", "")
KNEE = (
    KNEE.replace("u: 0.5*sin(3*t), ", "")
    .replace('"1 - exp(-t)"', '"2*(1 - exp(-t/2))"')
    .replace("horizon: 2, x0: [0.3, 0]", "horizon: 5, x0: [0.3, 0], xhat0: [0.3, 0]")
)
KNEE = KNEE.replace(
    "disturbance: integrator", "noise: {encoder: {rms: 1.0e-3, period: 1.0e-3}}\ndisturbance: integrator"
)


@pytest.mark.slow
def test_the_design_at_the_knee_has_about_the_noise_of_filters_that_follow_as_closely():
    """Q is such that the lag of the torque is that of the design; R that of the encoder."""
    knee = {
        "l2": "{type: l2, alpha: 0.5, bounds: auto}\nperformance: w",
        "ekf": "{type: ekf, Q: 1.9e-4, R: 1.0e-9}",
        "lqe": "{type: lqe, Q: 1.9e-4, R: 1.0e-9}",
    }
    for name, observer in knee.items():
        text = KNEE.replace(", NOISE", "") % {"name": name, "observer": observer}
        Path(f"{name}.yaml").write_text(text.replace("implementation: {period: 1.0e-3, method: rk4}\n", ""))
    report = compared(*(f"{name}.yaml" for name in knee), "--seeds", "3")
    ours, *others = (one["states"] for one in report["observers"])
    for name in ours:
        best = min(one[name]["noise_rms"] for one in others)
        assert 0 < ours[name]["noise_rms"] < 1.3 * best, name
    assert ours["torque"]["floor"] < 1.3 * min(one["torque"]["floor"] for one in others)


@pytest.mark.slow
def test_models_in_samples_and_in_continuous_time_are_compared_on_one_log(log):
    Path("log.csv").write_text(log)
    Path("samples.yaml").write_text("""obsdesign: 1
name: In samples
system:
  time: discrete
  period: 1.0e-3
  inputs: [u]
  disturbances: [v]
  dynamics:
    angle: angle + 1.0e-3*speed
    speed: speed + 1.0e-3*(torque - 9.81*sin(angle) - 0.5*speed + u)
    torque: torque + v
  outputs: {encoder: angle}
observer: {type: ekf, Q: 1.0e-6, R: 1.0e-6}
""")
    samples, flow = compared("samples.yaml", "ekf.yaml", "--data", "log.csv")["observers"]
    for name in ("angle", "speed", "torque"):
        assert samples["states"][name]["error_rms"] == pytest.approx(flow["states"][name]["error_rms"], rel=0.2)
