"""What a run says of its bounds: which exist, how accurately they are met, where a guarantee ends, a broken one."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from support.commands import files, run

from obsdesign.design import Design
from obsdesign.families.guarantee import bound
from obsdesign.tables.run import bound_text

PLANT = "A: [[0, 1], [-1, -1]], B: [[0], [1]], C: [[1, 0]]"
FAMILIES = {
    "l2": "{type: l2, alpha: 0.1, bounds: {L1: 100}}",
    "linf": "{type: linf, alpha: 0.1, bounds: {L1: 100}}",
    "lipschitz": "{type: lipschitz, objective: min-gamma, decay: 0.1, bounds: {L: 100}}",
    "sporadic": "{type: sporadic, T1: 0.1, T2: 0.2, decay: 0.05, bounds: {L: 2}}",
}
LOCAL = """obsdesign: 1
name: local
system: {%s}
nonlinearities: [{f: q**3, type: {lipschitz: auto, region: {q: [-0.3, 0.3]}}, Bf: [0, 0.5], Cq: [1, 0]}]
observer: %s
simulation: {horizon: 5, x0: [%s, 0], w: ["0"]}
"""
SQUARE = """obsdesign: 1
name: x(t) = 1/(2 - t)
system:
  disturbances: [d]
  dynamics: {x: x**2}
  outputs: {y: x + d/1000}
  domain: {x: [-1, 1]}
observer: {type: l2, alpha: 0.5, bounds: {L1: 50}}
simulation: {horizon: 3, x0: {x: 0.5}, xhat0: {x: 0.4}, w: {d: sin(t)}}
"""
DROPPED = """obsdesign: 1
name: dropped
system: {%s}
observer: {type: sporadic, T1: 0.1, T2: 0.2, relaxation: proposition-2%s}
simulation: {horizon: 2, x0: [1, 0], w: ["sin(t)"], noise: {type: uniform, amplitude: [0.01]}}
"""


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def write(tmp_path, text):
    (tmp_path / "case.yaml").write_text(text)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_local_guarantee_says_so_in_the_table_the_statement_and_the_proof(tmp_path, family):
    write(tmp_path, LOCAL % (PLANT, FAMILIES[family], 0.2))
    region = "as long as q and its estimate stay in [-0.3, 0.3]"
    (row,) = [line for line in run("solve", "case.yaml").stdout.splitlines() if line.startswith("local ")]
    assert region in row
    assert region in json.loads((tmp_path / "case.gains.json").read_text())["guarantee"]["statement"]
    assert region in run("verify", "case.gains.json").stdout.splitlines()[-1]


@pytest.mark.usefixtures("sketched")
@pytest.mark.parametrize("family", FAMILIES)
def test_a_run_in_the_region_of_a_local_guarantee_names_it(tmp_path, family):
    write(tmp_path, LOCAL % (PLANT, FAMILIES[family], 0.2))
    outcome = run("simulate", "case.yaml")
    assert outcome.exit_code == 0
    assert "the run stays in the region of the declared types, q1 of nonlinearities[0] in [-0.3, 0.3]" in outcome.stdout
    assert "bound  " in outcome.stdout


@pytest.mark.parametrize("family", FAMILIES)
def test_a_run_that_leaves_the_region_says_when_and_violates_nothing(tmp_path, family):
    write(tmp_path, LOCAL % (PLANT, FAMILIES[family], 3))
    outcome = run("simulate", "case.yaml", "--json")
    assert outcome.exit_code == 0
    summary = json.loads(outcome.stdout)
    assert summary["status"] == "escape"
    assert summary["bounds"] == []
    assert "the run left its region at t = 0" in summary["bounds_omitted"]
    note = summary["validity"]["note"]
    assert "region of the declared types, q1 of nonlinearities[0] in [-0.3, 0.3]: " in note
    assert "q1 of nonlinearities[0] of the plant is 3, outside [-0.3, 0.3], at t = 0; the guarantee is local" in note


def test_a_bound_that_does_not_exist_is_left_out_and_said_so_without_a_warning(tmp_path):
    write(tmp_path, DROPPED % (PLANT, ""))
    command = [sys.executable, "-m", "obsdesign", "simulate", "case.yaml", "--json"]
    outcome = subprocess.run(command, capture_output=True, text=True, check=True)
    assert outcome.stderr == ""
    summary = json.loads(outcome.stdout)
    assert len(summary["bounds"]) == 2
    assert all(entry["holds"] for entry in summary["bounds"])
    assert "left out, for it has no finite limit: |(e, d)(t)| <= " in summary["bounds_omitted"]
    write(tmp_path, DROPPED % (PLANT, ", decay: 0.05"))
    summary = json.loads(run("simulate", "case.yaml", "--json").stdout)
    assert len(summary["bounds"]) == 3
    assert summary["bounds_omitted"] is None


def test_a_bound_that_is_met_by_the_accuracy_of_the_run_says_so():
    resolved = bound("|e(t)| <= ..", 3.55263e-16, 9.17981e-43, 1e-9)
    assert resolved["holds"]
    assert resolved["accuracy"] == 1e-9
    text = "holds: 3.55263e-16 <= 9.17981e-43 + 1e-09, the accuracy of the run   |e(t)| <= .."
    assert bound_text(resolved) == text
    assert bound_text(bound("b", 2.0, 1.0, 1e-9)).startswith("VIOLATED: 2 <= 1 + 1.1e-06, the accuracy of the run")
    assert bound_text(bound("b", 1.0, 2.0, 1e-9)) == "holds: 1 <= 2   b"


@pytest.mark.usefixtures("sketched")
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("command", [["simulate", "case.yaml"], ["solve", "case.yaml", "--simulate"]])
def test_a_proved_bound_that_a_run_breaks_is_a_defect_to_report(tmp_path, monkeypatch, family, command):
    honest = Design.guarantee.fget
    write(tmp_path, (LOCAL % (PLANT, FAMILIES[family], 0)).replace('"0"', '"0.01*sin(t)"'))

    def overstated(design):
        true = honest(design)
        return replace(true, gamma=true.gamma / 1e3, **({} if family == "sporadic" else {"mu2": true.mu2 / 1e6}))

    monkeypatch.setattr(Design, "guarantee", property(overstated))
    outcome = run(*command)
    assert outcome.exit_code == 1
    (line,) = outcome.stderr.splitlines()
    assert line.startswith("case.run.csv: the run breaks ")
    assert "is a defect of obsdesign: please report it with the spec and the gains file" in line
    assert "VIOLATED" in outcome.stdout
    assert {"case.run.csv", "case.run.png"} <= set(files())


def test_a_w_that_jumps_at_once_is_told_so_and_no_norm_is_told_of_its_v():
    Path("jump.yaml").write_text(
        "obsdesign: 1\nname: jump\nsystem: {A: [[0, 1], [-2, -1]], B: [0, 1], C: [1, 0]}\ndisturbance: integrator\n"
        "performance: w\nobserver: {type: l2, L2: 0, alpha: 0.1, bounds: {L1: 20}}\n"
        'simulation: {horizon: 5, x0: [1, 0], w: "sign(sin(t))"}\n'
    )
    outcome = run("simulate", "jump.yaml")
    assert outcome.exit_code == 0, outcome.output
    assert "w jumps at t = 0, so that the v that generates it is not square integrable" in outcome.stdout
    assert "over the run" in next(line for line in outcome.stdout.splitlines() if line.startswith("z norm2"))
    assert not [line for line in outcome.stdout.splitlines() if line.startswith(("v norm2", "v sup", "ratio"))]


@pytest.mark.usefixtures("sketched")
def test_the_instant_at_which_a_run_leaves_its_region_does_not_depend_on_the_samples(tmp_path):
    write(tmp_path, SQUARE)
    assert run("solve", "case.yaml", "-q").exit_code == 0
    for change in ("points=7", "points=2000", "horizon=1.7", "x0={x: 0.4}"):
        outcome = run("simulate", "case.gains.json", "--json", "--set", f"simulation.{change}")
        left = {one["of"]: one for one in json.loads(outcome.stdout)["validity"]["left"]}["plant"]
        assert left["time"] == pytest.approx(1.5 if "0.4" in change else 1, rel=1e-4)
        assert left["value"] == 1


@pytest.mark.usefixtures("sketched")
def test_gamma_says_nothing_of_the_ratio_of_a_run_that_leaves_its_region(tmp_path):
    write(tmp_path, SQUARE)
    assert run("solve", "case.yaml", "-q").exit_code == 0
    stays = run("simulate", "case.gains.json", "--set", "simulation.horizon=0.9").stdout
    assert "; at most gamma from zero error" in stays
    assert "holds until" not in stays
    leaves = run("simulate", "case.gains.json").stdout
    summary = json.loads(run("simulate", "case.gains.json", "--json").stdout)
    assert [bound["until"] for bound in summary["bounds"]] == [summary["validity"]["left"][0]["time"]] * 4
    assert f"holds until t = {summary['bounds'][0]['until']:.4g} s: " in leaves
    assert "ratio  " in leaves
    assert "at most gamma" not in leaves
    assert "escape at t = 2 s: computed until then" in leaves
    assert " leaves [-1, 1] at t = " in leaves
