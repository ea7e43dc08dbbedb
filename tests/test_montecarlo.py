"""Many runs of one observer, their worst cases, drawn starts and parameters, and gains on another plant."""

import json
import os
import signal
import sys
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.commands import begin, files, run

import obsdesign as od
from obsdesign.errors import ViolatedError
from obsdesign.plot.envelope import envelope_sheet
from obsdesign.simulate.drawing import drawn, tried
from obsdesign.simulate.member import instants, mean, packed, unpacked
from obsdesign.simulate.montecarlo import Subject
from obsdesign.simulate.processes import shared_out
from obsdesign.simulate.tally import require_all_kept, share
from obsdesign.tables.montecarlo import montecarlo_table
from obsdesign.work import trial

PENDULUM = """obsdesign: 1
name: Pendulum
parameters: {m: 1, l: 0.5, c: 0.1, idle: 0, rate: 0.5}
system:
  disturbances: [torque]
  dynamics: {angle: speed, speed: -9.81/l*sin(angle) - (c + idle)/(m*l**2)*speed + torque/(m*l**2)}
  outputs: {encoder: angle}
disturbance: integrator
observer: {type: l2, alpha: rate, bounds: {L1: 50}}
simulation:
  horizon: 3
  x0: {angle: 0.3}
  x0_width: {angle: 0.2, speed: 1}
  w: {torque: "0.1*sin(t)"}
  seed: 3
  points: 101
"""
UNCERTAIN = PENDULUM + '  uncertainty: {m: 0.1, c: "50 %"}\n'
PLANT = """
system:
  inputs: [u]
  states: [angle, rate]
  dynamics: {angle: rate, rate: -sin(angle) - d*rate + u}
  outputs: {y: angle}
  domain: {angle: [-2, 2], rate: [-3, 3], u: [-1, 1]}
simulation: {horizon: 3, x0: [0.5, 0.2], x0_width: [0.2, 0.1], u: 0.3*sin(t), uncertainty: {d: 0.2}, points: 51}
"""
KKL = """{type: kkl,
  coordinates: [{name: xi, phi: rate - 4*angle, lambda: -4.1, B: -sin(y) - 16.4*y + u}],
  left_inverse: {rate: xi + 4*y}}"""
HIGH_GAIN = "{type: high-gain, copy: estimates, injection: {angle: {y: 4}, rate: {y: 8}}}"
SCALAR = "obsdesign: 1\nparameters: {a: 1}\nsystem: {%sA: [[%s]], B: [[1]], C: [[1]]}\nobserver: %s\n%s"
NOISE = "simulation: {horizon: 2, x0: [1], noise: {amplitude: 0.01%s}, uncertainty: {a: 0.1}, points: 51%s}"
KINDS = {  # of observers, each with a plant whose parameter is drawn
    "l2": UNCERTAIN,
    "kkl": f"obsdesign: 1\nparameters: {{d: 0.1}}\nobserver: {KKL}{PLANT}",
    "high-gain": f"obsdesign: 1\nparameters: {{d: 0.1}}\nobserver: {HIGH_GAIN}{PLANT}",
    "ekf": f"obsdesign: 1\nparameters: {{d: 0.1}}\nobserver: {{type: ekf, R: 1.0e-4}}{PLANT}",
    "discrete": SCALAR % ("time: discrete, period: 0.1, ", "0.9*a", "{type: l2, rho: 0.95}", NOISE % ("", "")),
    "sporadic": SCALAR
    % ("", "-a", "{type: sporadic, T1: 0.1, T2: 0.2}", NOISE % ("", ", sampling: random, dropout: 0.1")),
    "implementation": SCALAR
    % (
        "",
        "-a",
        "{type: l2, alpha: 0.1, bounds: {L1: 10}}\nimplementation: {period: 0.05}",
        NOISE % (", period: 0.05", ", observer: implementation"),
    ),
}


@cache
def made(text):
    """Design of a spec, solved once."""
    return trial(od.load(text))


@pytest.fixture
def here(tmp_path, monkeypatch, designed_once):  # noqa: ARG001
    monkeypatch.chdir(tmp_path)
    Path("pendulum.yaml").write_text(PENDULUM)
    Path("uncertain.yaml").write_text(UNCERTAIN)
    made(PENDULUM).save("pendulum.gains.json")


def summary(*arguments):
    """Summary that a command prints."""
    outcome = run("simulate", *arguments, "--json", "-q")
    assert outcome.exit_code == 0, outcome.output
    return json.loads(outcome.stdout)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_observer_runs_many_times_and_each_run_again_by_its_seed(kind):
    design = made(KINDS[kind])
    found = design.montecarlo(3, seed=7)
    report = found.report
    assert (report["runs"], report["seed"], len(report["drawn"]["parameters"])) == (3, 7, 2 if kind == "l2" else 1)
    for name, errors in report["errors"].items():
        single = design.simulate(seed=errors["seed"]).summary
        assert single["settling"][name]["peak"] == errors["peak"]
        assert single["no_guarantee"] == report["no_guarantee"]
        assert single["bounds"] == []
        assert 0 <= errors["rms"] <= errors["worst_rms"] <= errors["peak"]
    assert len({one.sizes.tobytes() for one in found.members}) == 3
    assert not any(bound["proved"] for bound in report["bounds"])
    assert [one.sizes.tobytes() for one in found.members] == [
        one.sizes.tobytes() for one in design.montecarlo(3, 2, seed=7).members
    ]


def test_runs_that_start_elsewhere_keep_every_bound_and_the_worst_is_the_run_of_its_seed():
    design = made(PENDULUM)
    found = design.montecarlo(20)
    assert "no_guarantee" not in found.report
    for number, bound in enumerate(found.report["bounds"]):
        single = design.simulate(seed=bound["seed"]).summary["bounds"][number]
        assert (bound["name"], bound["value"], bound["bound"]) == (single["name"], single["value"], single["bound"])
        assert (bound["kept"], bound["checked"], bound["holds"], bound["proved"]) == (20, 20, True, True)
        assert bound["worst"] == bound["value"] / bound["bound"]
    assert design.montecarlo(20, 2).report == found.report


def test_runs_in_common_steps_are_those_that_go_by_themselves():
    design = made(PENDULUM)
    noise = {"noise": {"type": "normal", "amplitude": 0.01, "period": 0.05}}
    for changes in ({}, noise):
        spec = tried(design, changes)
        subject = Subject(design, spec, design.observer, design.guarantee, instants(spec))
        assert subject.common
        together = dict(subject.together(range(4)))
        assert set(together) == {0, 1, 2, 3}
        for seed, one in together.items():
            alone = subject.alone(seed)[0]
            assert one.rms == pytest.approx(alone.rms, rel=2e-3)
            assert one.peak == pytest.approx(alone.peak, rel=2e-3)
            assert np.abs(one.sizes - alone.sizes).max(axis=0) == pytest.approx(0, abs=0.03 * max(alone.peak))


def test_what_is_drawn_lies_within_its_widths_and_depends_on_the_seed_alone():
    spec = made(UNCERTAIN).spec
    draws = [drawn(replace(spec, simulation=replace(spec.simulation, seed=seed))) for seed in range(80)]
    starts = np.array([[one.x0["angle"], one.x0["speed"]] for one in draws])
    values = np.array([[one.parameters["m"], one.parameters["c"]] for one in draws])
    for found, low, high in ((starts, [0.1, -1], [0.5, 1]), (values, [0.9, 0.05], [1.1, 0.15])):
        width = np.subtract(high, low)
        assert (found >= low).all()
        assert (found <= high).all()
        assert (found.min(axis=0) < low + 0.1 * width).all()
        assert (found.max(axis=0) > high - 0.1 * width).all()
    assert abs(np.corrcoef(starts.T)[0, 1]) < 0.3
    assert abs(np.corrcoef(starts[:, 0], values[:, 0])[0, 1]) < 0.3
    alone = drawn(made(PENDULUM).spec)
    assert alone.x0 == drawn(spec).x0  # parameters do not move what is drawn of the start
    assert alone.parameters == {}


def test_the_plant_has_the_drawn_parameters_and_the_observer_the_nominal_ones():
    text = SCALAR % ("", "-a", "{type: l2, gains: {L1: [[0]]}, alpha: 0.1}", NOISE % (", period: 1", ""))
    design = trial(od.load(text))
    result = design.simulate(noise=None, x0=[1], xhat0=[1], horizon=1)
    a = result.summary["drawn_parameters"]["a"]
    assert a != 1
    assert result["x1"][-1] == pytest.approx(np.exp(-a), rel=1e-6)
    assert result["hat_x1"][-1] == pytest.approx(np.exp(-1), rel=1e-6)


def test_parameters_without_a_share_leave_the_guarantee():
    report = made(PENDULUM).montecarlo(2, uncertainty={"m": 0}).report
    assert "no_guarantee" not in report
    assert all(bound["proved"] for bound in report["bounds"])


def test_runs_that_are_all_the_same_are_said_to_be():
    found = made(PENDULUM).montecarlo(5, x0_width=None)
    assert len({one.sizes.tobytes() for one in found.members}) == 1
    assert [one.seed for one in found.members] == [3, 4, 5, 6, 7]
    assert found.report["notes"] == [
        "nothing is drawn, so that every run is the same: give simulation.x0_width, noise or uncertainty"
    ]


def test_runs_that_escape_are_listed_and_in_no_error():
    text = """obsdesign: 1
system: {states: [x], dynamics: {x: x**3 - x}, outputs: {y: x}, domain: {x: [-1.5, 1.5]}}
observer: {type: l2, alpha: 0.1, bounds: {L1: 10}}
simulation: {horizon: 3, x0: [0.9], x0_width: [0.3], points: 51}
"""
    found = made(text).montecarlo(6)
    report = found.report
    escapes = [seed for seed in range(6) if made(text).simulate(seed=seed).status == "escape"]
    assert 0 < len(escapes) < 6
    assert report["escaped"] == escapes
    assert report["left_region"] == escapes
    assert f"errors and envelope are of the {6 - len(escapes)} runs that went on" in report["notes"][0]
    assert report["errors"]["x"]["seed"] not in escapes
    assert (found.table()[1][:, -1] == 6 - len(escapes)).all()
    assert all(bound["holds"] for bound in report["bounds"])
    times = {seed: made(text).simulate(seed=seed).summary["validity"]["left"][0]["time"] for seed in escapes}
    for bound in report["bounds"]:
        assert (bound["until"], bound["cut"]) == (min(times.values()), len(escapes))
        assert bound["cut_by"] == ["left the region"]
    until = (
        f"in {len(escapes)} of these only until they left the region (earliest t = {min(times.values()):.4g} s), worst"
    )
    assert until in str(found)
    assert until.removesuffix(", worst") in " ".join(envelope_sheet(found).get_suptitle().split())
    (reason,) = [one for one in report["bounds_omitted"] if one["runs"] == len(escapes)]
    assert reason["reason"].endswith(f"left its region at t = {min(times.values()):.4g} at the earliest")
    assert f"{len(escapes)} of 6" in str(found)
    observed = made(text.replace("x**3 - x", "a*x**3 - x").replace("system", "parameters: {a: 1}\nsystem"))
    gone = observed.montecarlo(2, x0=[1.3], x0_width=None, uncertainty={"a": 0.01})
    assert gone.report["escaped"] == [0, 1]
    said = "kept in 2 of 2 runs, each until it left the region (earliest t = "
    assert said in str(gone)
    gone = made(text).montecarlo(2, x0=[3])
    assert gone.report["escaped"] == [0, 1]
    assert gone.report["errors"]["x"]["rms"] is None
    assert gone.table()[1].shape[0] == 0
    assert "no run came to its end" in str(gone)
    assert envelope_sheet(gone).axes
    json.dumps(gone.report, allow_nan=False)


def test_the_envelope_holds_the_quantiles_of_the_runs():
    found = made(PENDULUM).montecarlo(21)
    header, rows = found.table()
    assert header[:5] == ["t", "median_angle", "p5_angle", "p95_angle", "worst_angle"]
    assert header[-1] == "runs"
    sizes = np.sort([one.sizes[:, 0] for one in found.members], axis=0)
    assert np.allclose(rows[:, 1:4].T, sizes[[10, 1, 19]])
    worst = max(found.members, key=lambda one: one.rms[0])
    assert worst.seed == found.report["errors"]["angle"]["worst_rms_seed"]
    assert (rows[:, 4] == worst.sizes[:, 0]).all()
    figure = envelope_sheet(found)
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        f"worst: seed {found.report['errors'][name]['worst_rms_seed']}" for name in found.names
    ]
    assert "proved bounds hold in every run" in figure.get_suptitle()
    assert "until" not in figure.get_suptitle() + str(found)
    assert {bound["until"] for bound in found.report["bounds"]} == {None}


def test_a_run_that_breaks_a_proved_bound_is_a_defect_and_one_that_is_observed_is_not():
    found = made(PENDULUM).montecarlo(4)
    bad = {**found.members[2].bounds[0], "value": 9.0, "bound": 3.0, "holds": False}
    broken = replace(found.members[2], bounds=[bad, *found.members[2].bounds[1:]])
    every = replace(found, members=(*found.members[:2], broken, found.members[3]))
    assert every.report["bounds"][0] | {"seed": 5, "worst": 3.0, "kept": 3, "holds": False} == every.report["bounds"][0]
    with pytest.raises(ViolatedError, match="the run of seed 5 breaks a bound"):
        require_all_kept(every, "x.csv")
    assert "VIOLATED, holds in 3 of 4 runs, worst 9 > 3 (seed 5)" in montecarlo_table(every.report)
    assert "1 of 4 bounds VIOLATED" in envelope_sheet(every).get_suptitle()
    observed = replace(every, why="no guarantee: another plant")
    require_all_kept(observed, "x.csv")
    assert "kept in 3 of 4 runs, worst 9 > 3 (seed 5)" in montecarlo_table(observed.report)
    assert "VIOLATED" not in montecarlo_table(observed.report) + envelope_sheet(observed).get_suptitle()


def test_a_single_run_has_one_seed_in_the_table_and_in_the_figure():
    found = made(PENDULUM).montecarlo(1)
    assert str(found).splitlines()[0].split() == ["runs", "1,", "seed", "3"]
    assert "1 run, seed 3;" in envelope_sheet(found).get_suptitle()


def test_a_filter_has_one_line_that_says_that_nothing_is_proved():
    found = made(KINDS["ekf"]).montecarlo(2, uncertainty=None)
    why = "no guarantee: nothing is proved of these gains with this plant"
    assert (found.report["no_guarantee"], found.report["bounds_omitted"]) == (why, [])
    assert str(found).count(why) == 1
    assert "no guarantee" in envelope_sheet(found).get_suptitle()


def test_a_bound_that_is_stated_of_some_runs_says_so_and_why():
    text = SCALAR % ("", "-1", "{type: sporadic, T1: 0.1, T2: 0.2}", NOISE % ("", ", dropout: 0.5"))
    found = made(text.replace("uncertainty: {a: 0.1}, ", "")).montecarlo(8)
    some = [bound for bound in found.report["bounds"] if bound["checked"] < 8]
    assert some
    for bound in some:
        assert (
            f"holds in {bound['kept']} of {bound['checked']} runs, not stated of the other {8 - bound['checked']}"
            in str(found)
        )
        assert bound["cut_by"] == ["left the intervals between measurements"]
    assert any("some are stated of a part of the runs" in note for note in found.report["notes"])
    assert (
        f"{len(found.report['bounds'])} proved bounds hold in every run of which they are stated, each until it left"
        in (" ".join(envelope_sheet(found).get_suptitle().split()))
    )
    assert any("overdue at t = 0.2 at the earliest" in one["reason"] for one in found.report["bounds_omitted"])


def test_the_part_of_a_bound_that_is_zero():
    assert share({"value": 0.0, "bound": 0.0, "holds": True}) == 0
    assert share({"value": 1.0, "bound": 0.0, "holds": False}) == np.inf


def test_a_run_is_the_same_after_it_went_between_processes():
    members = made(PENDULUM).montecarlo(2).members
    for one, other in zip(members, unpacked(packed(members)), strict=True):
        assert replace(one, sizes=0) == replace(other, sizes=0)
        assert one.sizes.tobytes() == other.sizes.tobytes()


def test_means_are_over_time_or_over_samples():
    t, values = np.array([0.0, 1.0, 1.0, 3.0]), np.array([[0.0], [2.0], [4.0], [4.0]])
    assert mean(values, t, in_samples=False) == pytest.approx((1 + 8) / 3)
    assert mean(values, t, in_samples=True) == 2.5


def test_parts_of_work_come_from_any_number_of_processes_and_tell_what_is_wrong():
    expected = {(k, bytes([k])) for k in range(5)}
    for jobs in (1, 2, 9):
        assert set(shared_out(5, lambda k: bytes([k]), jobs)) == expected

    def wrong(k):
        raise od.UsageError(f"part {k}", id="OBS933")

    with pytest.raises(od.UsageError, match="part ") as refused:
        list(shared_out(3, wrong, 2))
    assert refused.value.problems[0].id == "OBS933"
    with pytest.raises(RuntimeError, match="ended with code -9"):
        list(shared_out(2, lambda _: os.kill(os.getpid(), signal.SIGKILL), 2))


@pytest.mark.usefixtures("here", "sketched")
def test_the_command_writes_envelope_and_figure_and_the_same_for_any_number_of_processes():
    first = summary("pendulum.gains.json", "--runs", 130, "--jobs", 1)
    envelope = Path("pendulum.runs.csv").read_bytes()
    assert envelope.startswith(b"t,median_angle,p5_angle,p95_angle,worst_angle,")
    assert Path("pendulum.runs.png").exists()
    assert summary("pendulum.gains.json", "--runs", 130, "--jobs", 2) == first
    assert Path("pendulum.runs.csv").read_bytes() == envelope
    assert {"runs", "seed", "bounds", "errors", "escaped"} <= first.keys()
    assert all({"name", "worst", "holds", "seed"} <= bound.keys() for bound in first["bounds"])
    assert all({"rms", "peak", "seed"} <= errors.keys() for errors in first["errors"].values())
    worst = first["errors"]["torque"]
    again = summary("pendulum.gains.json", "--set", f"simulation.seed={worst['seed']}")
    assert again["settling"]["torque"]["peak"] == worst["peak"]
    outcome = run("simulate", "pendulum.yaml", "--runs", 2, "-o", "-", "--plot", "x.png")
    assert outcome.stdout.startswith("t,median_angle")


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--runs", 0], "invalid value for '--runs'"),
        (["--runs", 10_001], "invalid value for '--runs'"),
        (["--jobs", 2], "--jobs goes with --runs N"),
        (["--runs", 2, "--plot-all"], "--plot-all is of one run"),
        (["--runs", 2, "--plot", "-"], "a figure is not printed"),
        (["--labelled"], "--labelled goes with --gains"),
        (["--runs", 2, "--set", f"simulation.seed={2**63 - 1}"], "would have a seed above"),
    ],
)
def test_what_goes_with_many_runs_or_with_one_is_told(options, said):
    outcome = run("simulate", "pendulum.gains.json", *options)
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert said in outcome.stderr
    assert outcome.stderr.count("\n") == 1
    assert files() == ["pendulum.gains.json", "pendulum.yaml", "uncertain.yaml"]


@pytest.mark.parametrize("runs", [0, -1, 2.5, True, "3", 10_001])
def test_a_number_of_runs_that_is_none_is_refused(runs):
    with pytest.raises(od.UsageError, match="give a whole number of runs from 1 to 10,000"):
        made(PENDULUM).montecarlo(runs)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"uncertainty": {"mass": 0.1}}, "unknown parameter mass"),
        ({"uncertainty": {"idel": 0.1}}, "did you mean idle?"),
        ({"uncertainty": {"rate": 0.1}}, "no number and no expression of the plant uses parameters.rate"),
        ({"uncertainty": {"idle": 0.1}}, "which is 0"),
        ({"uncertainty": {"m": -0.1}}, "-0.1 is not allowed; give a share of the parameter from 0 to 1"),
        ({"uncertainty": {"m": "101 %"}}, "101 % is not allowed; give a share of the parameter from 0 to 1"),
        ({"uncertainty": {"m": "nan"}}, "nan"),
        ({"uncertainty": {"m": "5 %%"}}, "5 %%"),
        ({"x0_width": {"angle": -1}}, "-1 is not allowed; give a number >= 0"),
        ({"x0_width": [0.1, -0.1]}, "-0.1 is not allowed; a half-width is a number >= 0"),
        ({"x0_width": {"angel": 1}}, "did you mean angle?"),
        ({"x0_width": [1]}, "expected 2 numbers"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_line(changes, said):
    with pytest.raises(od.UsageError) as refused:
        made(PENDULUM).simulate(**changes)
    (problem,) = refused.value.problems
    assert said in str(problem)
    assert "\n" not in str(problem)


def test_a_share_is_a_number_or_a_percentage():
    tolerances = od.load(UNCERTAIN, ["simulation.uncertainty={m: 0.25, c: 25%, l: 1/4}"]).simulation.uncertainty
    assert {float(one.share) for one in tolerances.values()} == {0.25}


def test_a_type_that_is_declared_is_not_judged_of_a_plant_that_is_only_run():
    text = """obsdesign: 1
parameters: {k: 1}
system: {A: [[-2]], B: [[1]], C: [[1]]}
nonlinearities: [{f: k*sin(q), type: {slope: [-1, 1]}, Bf: 1, Cq: 1}]
observer: {type: l2, alpha: 0.1, bounds: {L1: 10}}
simulation: {horizon: 1, x0: [1], uncertainty: {k: 1}, seed: 2, points: 11}
"""
    summary = made(text).simulate().summary
    assert summary["drawn_parameters"]["k"] > 1  # a slope that the type excludes
    assert summary["status"] == "done"


@pytest.mark.usefixtures("here", "sketched")
def test_gains_run_on_another_plant_where_that_is_asked_for_and_nothing_is_guaranteed():
    Path("heavy.yaml").write_text(PENDULUM.replace("m: 1,", "m: 1.5,").replace("*speed +", "*speed - 0.1*speed**3 +"))
    refused = run("simulate", "--gains", "pendulum.gains.json", "heavy.yaml")
    assert refused.exit_code == 2
    assert "these gains belong to another spec than heavy.yaml" in refused.stderr
    assert "`simulate --labelled` runs them with this plant, with no guarantee" in refused.stderr
    arguments = ["--gains", "pendulum.gains.json", "heavy.yaml", "--labelled"]
    outcome = run("simulate", *arguments)
    assert outcome.exit_code == 0, outcome.output
    said = "the plant is that of heavy.yaml, and what is proved of the gains in pendulum.gains.json is of their own"
    assert f"no guarantee: {said} plant" in outcome.stdout
    assert "\nbound " not in outcome.stdout
    told = summary(*arguments)
    assert told["bounds"] == []
    assert told["gamma"] is None
    assert len(told["observed"]) == 4
    many = summary(*arguments, "--runs", 3)
    assert many["no_guarantee"] == told["no_guarantee"]
    assert [bound["proved"] for bound in many["bounds"]] == [False] * 4
    own = summary("--gains", "pendulum.gains.json", "pendulum.yaml", "--labelled")
    assert ("observed" in own, len(own["bounds"])) == (False, 4)  # its own plant
    Path("same.yaml").write_text(
        PENDULUM.replace("alpha: rate", "alpha: 1").replace("name: Pendulum", "name: Other\nperformance: [speed]")
    )
    assert summary("--gains", "pendulum.gains.json", "same.yaml", "--labelled")["bounds"] == own["bounds"]
    many = summary("--gains", "pendulum.gains.json", "same.yaml", "--labelled", "--runs", 2)
    assert (many.get("no_guarantee"), [bound["proved"] for bound in many["bounds"]]) == (None, [True] * 4)
    changed = summary("--gains", "pendulum.gains.json", "pendulum.yaml", "--labelled", "--set", "parameters.m=1.5")
    assert "the plant is that of pendulum.yaml with parameters.m=1.5" in changed["no_guarantee"]


@pytest.mark.usefixtures("here")
def test_another_plant_has_the_signals_of_the_first():
    Path("other.yaml").write_text(
        PENDULUM.replace("[torque]", "[push]")
        .replace("torque", "push")
        .replace("{encoder: angle}", "{encoder: angle, y2: speed}")
    )
    outcome = run("simulate", "--gains", "pendulum.gains.json", "other.yaml", "--labelled")
    lines = outcome.stderr.splitlines()
    assert (outcome.exit_code, len(lines)) == (2, 2)
    assert (
        "system.outputs: 2 (encoder, y2) here, and 1 (encoder) in pendulum.gains.json: the gains do not fit"
        in lines[0] + lines[1]
    )
    assert "system.disturbances: 1 (push) here, and 1 (torque) in pendulum.gains.json" in lines[0] + lines[1]
    assert files() == ["other.yaml", "pendulum.gains.json", "pendulum.yaml", "uncertain.yaml"]


@pytest.mark.slow
@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("end", "code"), [("interrupt", 130), ("timeout", 4)])
def test_many_runs_that_are_ended_write_nothing_and_leave_no_process(end, code):
    Path("uncertain.yaml").write_text(UNCERTAIN)
    limit = ["--timeout", "5"] if end == "timeout" else []
    command = [sys.executable, "-m", "obsdesign", "simulate", "uncertain.yaml", "--runs", "9000", "--jobs", "2"]
    process = begin([*command, *limit], stderr=-1, stdout=-1)
    time.sleep(5)
    if end == "interrupt":
        process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == code
    assert files() == ["pendulum.gains.json", "pendulum.yaml", "uncertain.yaml"]
    left = [Path(folder, "cmdline") for folder in Path("/proc").glob("[0-9]*")]
    assert not any(b"uncertain.yaml" in one.read_bytes() for one in left if one.exists())
