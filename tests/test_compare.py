"""The command compare: several observers on one plant, of any families, and what it refuses."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from support.commands import PNG, run

import obsdesign as od
from obsdesign.plot.comparison import comparison_sheet, peaks

PLANT = """obsdesign: 1
name: {name}
system:
  inputs: [u]
  disturbances: [push]
  states: [angle, rate]
  dynamics: {{angle: rate, rate: -sin(angle) - {damping}*rate + u + push}}
  outputs: {{y: angle}}
  domain: {{angle: [-2, 2], rate: [-3, 3], u: [-1, 1]}}
  units: {{angle: rad, rate: rad/s}}
observer: {observer}
"""
SIMULATION = """simulation:
  horizon: 6
  x0: [0.5, 0.2]
  u: 0.3*sin(t)
  w: ["0.1*cos(t)"]
  noise: {type: uniform, amplitude: 0.01, period: 0.02}
  seed: 3
"""
L2 = "{type: l2, alpha: 0.3, bounds: {L1: 20}}"
EKF = "{type: ekf, Q: {push: 0.1}, R: 1.0e-4}"
KKL = """
  type: kkl
  coordinates: [{name: xi, phi: rate - 4*angle, lambda: -4.1, B: -sin(y) - 16.4*y + u}]
  left_inverse: {rate: xi + 4*y}"""
KKL_PLANT = PLANT.replace("  disturbances: [push]\n", "").replace(" + push", "")
STATE = {"t5", "t1", "peak", "noise_rms", "noise_rms_std", "floor"}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch, designed_once):  # noqa: ARG001
    monkeypatch.chdir(tmp_path)


def spec(name, observer, simulation=SIMULATION, plant=PLANT, damping="0.1"):
    """Write a spec; its path."""
    Path(f"{name}.yaml").write_text(plant.format(name=name, observer=observer, damping=damping) + simulation)
    return f"{name}.yaml"


def compared(*sources, seeds=3):
    """Report of a comparison."""
    outcome = run("compare", *sources, "--seeds", seeds, "--json", "-q")
    assert outcome.exit_code == 0, outcome.output
    return json.loads(outcome.stdout)


def test_observers_with_and_without_an_lmi_are_compared_on_one_plant():
    still = SIMULATION.replace("0.1*cos(t)", "0")
    bare = still.replace('  w: ["0"]\n', "")
    sources = [spec("l2", L2, still), spec("kkl", KKL, bare, KKL_PLANT), spec("filter", EKF, still)]
    report = compared(*sources)
    assert report["plant"] == {"name": "l2", "x0": [0.5, 0.2], "horizon": 6.0}
    assert report["seeds"] == [3, 4, 5]
    assert report["window"] == [1.0, 6.0]
    assert [o["file"] for o in report["observers"]] == sources
    assert [o["type"] for o in report["observers"]] == ["l2", "kkl", "ekf"]
    assert [o["status"] for o in report["observers"]] == ["certified", "certified", "no guarantee"]
    assert [o["order"] for o in report["observers"]] == [2, 1, 5]
    assert [o["statement"] is None for o in report["observers"]] == [False, False, True]
    for observer in report["observers"]:
        assert set(observer["states"]) == {"angle", "rate"}
        assert all(set(state) == STATE for state in observer["states"].values())
    assert report["observers"][1]["fastest"] == pytest.approx(4.1)
    assert report["observers"][1]["states"]["rate"]["t5"] == pytest.approx(np.log(20) / 4.1, rel=1e-4)
    assert Path("compare.png").read_bytes().startswith(PNG)


def test_a_spec_without_gains_is_solved_and_gains_are_taken_as_they_are():
    source = spec("l2", L2)
    assert run("solve", source, "-q").exit_code == 0
    one, other = compared(source, "l2.gains.json")["observers"]
    assert other["file"] == "l2.gains.json"
    assert {**one, "file": "", "label": ""} == {**other, "file": "", "label": ""}


def test_the_noise_is_that_of_single_runs():
    source = spec("l2", L2)
    report = compared(source, seeds=2)["observers"][0]["states"]["rate"]
    design = od.solve(od.load(source))
    quiet = design.simulate(noise=None, points=6001)
    rms = []
    for seed in (3, 4):
        noisy = design.simulate(seed=seed, points=6001)
        added = (noisy["hat_rate"] - quiet["hat_rate"])[noisy.t >= 1]
        rms.append(np.sqrt(np.mean(added**2)))
    assert report["noise_rms"] == pytest.approx(np.mean(rms), rel=2e-3)
    assert report["noise_rms_std"] == pytest.approx(np.std(rms, ddof=1), rel=0.2)
    assert report["floor"] == pytest.approx(np.sqrt(np.mean(quiet.e[quiet.t >= 1, 1] ** 2)), rel=2e-3)


def test_a_run_without_noise_has_none():
    report = compared(spec("l2", L2, SIMULATION.replace("0.01,", "0,")))["observers"][0]
    assert {state["noise_rms"] for state in report["states"].values()} == {0.0}


def test_a_table_without_noise_has_no_column_for_it():
    text = run("compare", spec("l2", L2, SIMULATION.replace("0.01,", "0,"))).stdout
    assert "noise rms" not in text
    assert "no noise: the spec of the plant has no simulation.noise" in text
    assert "noise rms" in run("compare", spec("l2", L2)).stdout.splitlines()[0]


def test_a_spec_without_a_trial_takes_that_of_the_others():
    first, other = compared(spec("l2", L2), spec("filter", EKF, ""))["observers"]
    assert other["states"]["angle"]["noise_rms"] > 0
    again = compared(spec("l2", L2), spec("filter", EKF))["observers"][1]
    assert other["states"] == again["states"]
    assert first["states"] != other["states"]


def test_the_table_says_who_is_proved():
    outcome = run("compare", spec("l2", L2), spec("filter", EKF), "--seeds", 1, "-o", "here.png")
    assert outcome.exit_code == 0
    lines = outcome.stdout.splitlines()
    assert lines[0].split()[:2] == ["observer", "type"]
    assert "filter: no guarantee" in lines
    assert "no guarantee" in next(line for line in lines if line.startswith("filter "))
    assert lines[-1] == "figure  here.png"
    assert Path("here.png").exists()


def test_python_has_it_too():
    found = od.compare([spec("l2", L2), od.load(spec("filter", EKF))], seeds=1)
    assert [o["type"] for o in found.report["observers"]] == ["l2", "ekf"]
    assert found.plot("other.png") == Path("other.png").read_bytes()
    with pytest.raises(od.UsageError, match="nothing to compare"):
        od.compare([])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"damping": "0.2"}, "b.yaml:4:3: system: rate' is"),
        ({"simulation": SIMULATION.replace("horizon: 6", "horizon: 7")}, "simulation.horizon: the horizon is 7, but 6"),
        ({"simulation": SIMULATION.replace("0.5, 0.2", "0.5, 0")}, "simulation.x0: rate(0) is 0, but 0.2 in a.yaml"),
        ({"simulation": SIMULATION.replace("0.3*sin", "0.2*sin")}, "simulation.u: u is"),
        ({"simulation": SIMULATION.replace("0.1*cos", "0.2*cos")}, "rate' is"),
        ({"simulation": SIMULATION.replace("0.01,", "0.02,")}, "simulation.noise: noise of y is uniform 0.02, but"),
        ({"simulation": SIMULATION.replace("0.02}", "0.03}")}, "simulation.noise.period: the period of the noise is"),
        ({"plant": PLANT.replace("{{y:", "{{z:")}, "system.outputs: the list of outputs is z, but y in a.yaml"),
    ],
)
def test_what_is_another_problem_is_refused_in_one_line(change, said):
    outcome = run("compare", spec("a", EKF), spec("b", EKF, **change))
    assert outcome.exit_code == 2
    assert said in outcome.stderr
    assert outcome.stderr.count("\n") == 1
    assert outcome.stderr.strip().endswith("a comparison needs one plant [OBS805]")
    assert not Path("compare.png").exists()


def test_the_same_plant_may_be_written_in_another_way():
    other = PLANT.replace("-sin(angle) - {damping}*rate + u", "u - ({damping}*rate + 2*sin(angle/2)*cos(angle/2))")
    assert len(compared(spec("a", EKF), spec("b", EKF, plant=other), seeds=1)["observers"]) == 2


def test_no_trial_at_all_and_no_solution_are_told_apart():
    outcome = run("compare", spec("a", EKF, ""), spec("b", EKF, ""))
    assert (outcome.exit_code, "simulation: is missing in every spec" in outcome.stderr) == (2, True)
    blind = PLANT.replace("{{y: angle}}", "{{y: 0*angle + t}}")
    outcome = run("compare", spec("a", L2, plant=blind))
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (3, 1)


def test_an_estimate_without_an_initial_error_has_no_time_in_the_table_but_its_peak():
    source = spec("l2", L2, SIMULATION.replace("  u:", "  xhat0: [0.5, 0]\n  u:"))
    state = compared(source)["observers"][0]["states"]["angle"]
    assert (state["t5"], state["t1"]) == (0, 0)
    assert state["peak"] > 0.01
    shown = run("compare", source, "--seeds", 2).stdout
    assert re.search(rf"angle +from 0 +peak {state['peak']:.4g} ", shown)
    assert "from 0: there is no initial error; peak of the error without noise instead" in shown
    run("solve", source, "-q")
    quiet = run("simulate", source, "--gains", "l2.gains.json").stdout
    assert re.search(r"settling +angle: starts at 0, \|error\| at most 0\.\d+\n", quiet)
    assert re.search(
        r"settling +rate: \|error\| stays below 5 % (never|after \S+ s), below 1 % .*   of \|error\(0\)\|\n", quiet
    )


def test_an_error_that_still_falls_over_the_window_is_no_floor():
    short = SIMULATION.replace("0.1*cos(t)", "0").replace("horizon: 6", "horizon: 2")
    settled = SIMULATION.replace("horizon: 6", "horizon: 40")  # at what the disturbance leaves
    for simulation, falling in ((short, ["angle", "rate"]), (settled, [])):
        source = spec("l2", L2, simulation)
        assert compared(source, seeds=1)["observers"][0]["transient"] == falling
        table = run("compare", source, "--seeds", 1).stdout
        assert ("* no floor: the error still falls over the window" in table) == bool(falling)
        assert any(line.endswith("*") for line in table.splitlines()) == bool(falling)


def test_a_window_that_a_run_does_not_reach_has_no_floor():
    ended = SIMULATION.replace("  seed: 3\n", "  events: {high: t > 0.5}\n")
    (observer,) = compared(spec("l2", L2, ended), seeds=1)["observers"]
    assert (observer["states"]["angle"]["floor"], observer["transient"]) == (None, [])


def test_a_level_that_only_the_end_of_the_run_keeps_is_not_held():
    """The error without a disturbance falls below 5 % of the first one in the last twentieth of the run."""
    still = SIMULATION.replace("0.1*cos(t)", "0").replace("noise:", "points: 100\n  noise:")
    source = spec("l2", L2, still)
    t5 = compared(source, seeds=1)["observers"][0]["states"]["angle"]["t5"]
    for part, said in ((0.99, "not held"), (0.9, f"{t5:.4g}")):
        source = spec("l2", L2, still.replace("horizon: 6", f"horizon: {t5 / part}"))
        shown = run("compare", source, "--seeds", 1).stdout
        assert re.search(rf"angle +{said} ", shown)
        assert ("not held: it is above that level as late as in the last twentieth" in shown) == (said == "not held")
        assert ("stays below 5 % not held before the end, below 1 % " in run("simulate", source).stdout) == (
            said == "not held"
        )


def figure_of(*sources, seeds=1):
    """Figure of a comparison, its panels by their labels, and the cells of its table."""
    figure = comparison_sheet(od.compare(list(sources), seeds=seeds))
    cells = [text.get_text() for text in figure.axes[-1].texts]
    return {axes.get_ylabel(): axes for axes in figure.axes}, cells


INTEGRATED = "{type: l2, alpha: 0.3, bounds: {L1: 200}}\ndisturbance: integrator\nperformance: all"


def test_the_figure_has_every_signal_with_its_estimates_the_errors_and_what_is_proved():
    sources = [spec("drift", INTEGRATED), spec("l2", L2), spec("filter", EKF)]
    panels, cells = figure_of(*sources)
    signals = ["angle [rad]", "rate [rad/s]", "push"]
    assert list(panels) == [*signals, *(f"|e| of {name}" for name in signals), ""]
    true, drift, *others = panels["push"].get_lines()
    assert not others  # of the three only the first estimates it
    assert true.get_ydata() == pytest.approx(0.1 * np.cos(true.get_xdata()))
    assert [true.get_label(), drift.get_linestyle()] == ["true", "--"]
    assert len(panels["angle [rad]"].get_lines()) == 1 + len(sources)
    assert cells[0] == "observer"
    assert {"γ", "decay rate [1/s]", "5 % of angle [s]"} <= set(cells)
    gammas = cells[cells.index("γ") + 1 :][: len(sources)]
    claimed = [od.solve(od.load(source)).guarantee.gamma for source in sources[:2]]
    assert gammas[2] == "–"
    assert all(g <= float(text) <= 1.001 * g for g, text in zip(claimed, gammas, strict=False))
    assert cells[cells.index("proved") + 1 :][: len(sources)] == ["yes, local", "yes, local", "no guarantee"]
    assert "The γ are of different kinds" in cells[-1]


def test_the_figure_shows_no_input_that_is_zero_and_no_column_without_a_number():
    still = SIMULATION.replace("0.1*cos(t)", "0")
    bare = still.replace('  w: ["0"]\n', "")
    panels, cells = figure_of(spec("kkl", KKL, bare, KKL_PLANT), spec("filter", EKF, still))
    assert "push" not in panels
    assert "γ" not in cells
    assert "different kinds" not in cells[-1]
    assert cells[cells.index("proved") + 1] == "yes, no bound"


def test_a_name_that_is_longer_than_a_panel_is_high_stands_above_it():
    name = "angle_of_the_lower_part"
    panels, _ = figure_of(spec("l2", L2, plant=PLANT.replace("angle", name)))
    first, second = panels[""].figure.axes[:2]
    assert (first.get_title("right"), first.get_ylabel()) == (f"{name} [rad]", "")
    assert (second.get_title("right"), second.get_ylabel()) == ("", "rate [rad/s]")


def test_an_oscillating_error_is_a_line_and_a_fall_stays_where_it_is():
    t = np.linspace(0, 60, 5001)
    at, size = peaks(t, np.cos(3 * t), early=False)
    inner = (at > 1) & (at < 59)
    assert size[inner] == pytest.approx(1, abs=1e-2)
    at, size = peaks(t, np.exp(-t), early=False)
    assert size == pytest.approx(np.exp(-at), rel=0.1)
    at, size = peaks(t, np.where(t < 20, 1.0, 1e-3), early=False)
    assert at[size < 0.5][0] == pytest.approx(20, abs=0.2)
    assert peaks(np.zeros(0), np.zeros(0), early=True)[0].size == 0


def test_of_many_signals_those_are_drawn_that_the_spec_asks_for():
    rows = [[-1 if i == j else 0 for j in range(8)] for i in range(8)]
    text = "obsdesign: 1\nname: many\n" + f"system: {{A: {rows}, B: {[[1]] * 8}, C: {rows[:1]}}}\n"
    text += "performance: [x7, x2]\nobserver: {type: l2, alpha: 0.1, bounds: {L1: 9}}\n"
    Path("many.yaml").write_text(f"{text}simulation: {{horizon: 1, x0: {[1] * 8}, w: [0]}}\n")
    panels, _ = figure_of("many.yaml")
    assert list(panels) == ["x2", "x7", "|e| of x2", "|e| of x7", ""]


SPORADIC = "{type: sporadic, T1: 0.1, T2: 0.2, relaxation: proposition-2, decay: 0.05, bounds: {L: 2}}"
PAIR = """obsdesign: 1
name: Pair, %s
system: {A: [[0, 1], [-1, -1]], B: [[0], [1]], C: [[1, 0]]}
observer: %s
simulation: {horizon: 2, x0: [1, 0], w: ["sin(t)"], noise: {type: uniform, amplitude: [0.01]%s}}
"""


def test_noise_that_is_held_and_noise_of_single_measurements_are_told_apart():
    Path("held.yaml").write_text(PAIR % ("held", L2, ", period: 0.1"))
    Path("single.yaml").write_text(PAIR % ("single", SPORADIC, ""))
    comparison = od.compare(["held.yaml", "single.yaml"], seeds=1)
    said = "held for 0.1 s for held, drawn at each measurement for single; noise rms are not of the same noise"
    assert said in str(comparison)
    figure = comparison_sheet(comparison)
    assert said in figure.axes[-1].texts[-1].get_text().replace("\n", " ")
    assert figure.get_suptitle() == "Pair: 2 observers, estimates without noise, errors with it"
    assert od.compare(["held.yaml"], seeds=1).report["notes"] == []


def test_the_table_and_the_figure_say_when_a_run_leaves_its_region():
    Path("square.yaml").write_text("""obsdesign: 1
name: x(t) = 1/(2 - t)
system: {disturbances: [d], dynamics: {x: x**2}, outputs: {y: x + d/1000}, domain: {x: [-1, 1]}}
observer: {type: l2, alpha: 0.5, bounds: {L1: 50}}
simulation: {horizon: 1.5, x0: {x: 0.5}, xhat0: {x: 0.5}}
""")
    comparison = od.compare(["square.yaml"], seeds=1)
    assert "x of the plant leaves [-1, 1] at t = 1;" in str(comparison)
    figure = comparison_sheet(comparison)
    assert "x(t) = 1/(2 - t) leaves its region at t = 1 s" in [
        text.get_text() for text in figure.legends[0].get_texts()
    ]
    assert "yes, local until t = 1" in [text.get_text() for text in figure.axes[-1].texts]
