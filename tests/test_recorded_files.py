"""Files of signals that drive a run: where they may be, what may stand in them, and what is said of others."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from support.commands import run as command
from support.recorded import ARM, CART, HEAD, L2, SINE, rows, simulated

import obsdesign as od
from obsdesign.errors import UsageError
from obsdesign.files import table
from obsdesign.simulate import recorded


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch, designed_once):  # noqa: ARG001
    monkeypatch.chdir(tmp_path)


def wrong(key="u: {u: {file: drive.csv}}", plant=CART + SINE + L2, horizon=2):
    """What is said of a run: one line."""
    Path("case.yaml").write_text(f"{HEAD}{plant}simulation: {{horizon: {horizon}, x0: [1, 0], {key}}}\n")
    with pytest.raises(UsageError) as caught:
        od.solve(od.load("case.yaml")).simulate()
    said = str(caught.value)
    assert "\n" not in said
    return said


OUTSIDE = {
    "/etc/hosts.csv": "is no relative path",
    "../drive.csv": "leads out of the folder of the spec",
    "a/../../drive.csv": "leads out of the folder of the spec",
    "a\\..\\..\\drive.csv": "leads out of the folder of the spec",
    "C:drive.csv": "is no relative path",
    "C:\\drive.csv": "is no relative path",
    "\\\\server\\drive.csv": "is no relative path",
    "~/drive.csv": "is not there: looked for ~/drive.csv",
    "case.yaml": "its name must end with .csv",
    "": "its name must end with .csv",
    ".ssh/id_rsa": "its name must end with .csv",
}


@pytest.mark.parametrize("path", OUTSIDE)
def test_a_path_that_leads_out_of_the_folder_of_the_spec_is_refused(path):
    said = wrong(f"u: {{u: {{file: '{path}'}}}}")
    assert OUTSIDE[path] in said
    assert said.startswith("case.yaml:6:52: ") or "looked for" in said
    assert "simulation.u.u" in said


def test_a_link_that_leads_out_is_refused_and_one_that_does_not_is_followed(tmp_path):
    rows("in/real.csv", [0, 2], [1, 1])
    Path("drive.csv").symlink_to("in/real.csv")
    assert simulated("continuous", "{u: {file: drive.csv}}")["u"] == pytest.approx(1)
    Path("spec").mkdir()
    text = Path("case.yaml").read_text()
    for link, target in (("drive.csv", tmp_path / "in/real.csv"), ("folder", tmp_path / "in")):
        Path("spec", link).symlink_to(target)
        Path("spec/case.yaml").write_text(
            text.replace("drive.csv", "drive.csv" if link != "folder" else "folder/real.csv")
        )
        with pytest.raises(UsageError, match=r"leads out of the folder spec.* \[OBS216\]"):
            od.solve(od.load("spec/case.yaml")).simulate()


def test_what_is_no_regular_file_is_refused_at_once(monkeypatch):
    os.mkfifo("drive.csv")
    assert "is no regular file" in wrong()
    os.unlink("drive.csv")
    os.mkdir("drive.csv")
    assert "is no regular file" in wrong()
    os.rmdir("drive.csv")
    Path("drive.csv").symlink_to("nowhere.csv")
    assert "cannot be read: No such file" in wrong()
    os.unlink("drive.csv")
    assert "drive.csv is not there: looked for drive.csv [OBS101]" in wrong()
    rows("drive.csv", [0, 1, 2], [1, 1, 1])
    monkeypatch.setattr(recorded, "MOST", 2)
    assert "more than 2 rows within the horizon [OBS210]" in wrong()
    monkeypatch.setattr(recorded, "LARGEST", 10)
    assert "at most 10 are read: cut it to the horizon [OBS210]" in wrong()


WRONG = {
    "t,u\n0.1,1\n2,1\n": "drive.csv begins at t = 0.1 s, and the run at t = 0; give it a row there [OBS814]",
    "t,u\n0,1\n1,1\n1.5,2\n": "drive.csv ends at t = 2 s",
    "t,u\n0,1\n1,1\n1.4,2\n": "ends at t = 1.8 s, before the horizon, 2 s; give more rows, or a shorter horizon",
    "t,u\n0,1\n": "ends at t = 0 s, before the horizon",
    "t,u\n": "has no rows",
    "t,force\n0,1\n2,1\n": "has no column u; it has t, force [OBS811]",
    "time,u\n0,1\n2,1\n": "has no column t",
    "t,u,u\n0,1,1\n2,1,1\n": "two columns have the head u",
    "t,u [mV]\n0,1\n2,1\n": "column u [mV] is in mV, and u in V; write it in this unit",
    "t [ms],u\n0,1\n2,1\n": "column t [ms] is in ms, and time in s",
    "t,u\n0,1\n1,2\n1,3\n2,1\n": "drive.csv:4:0: t = 1 is that of the row before",
    "t,u\n0,1\n1,2\n0.5,3\n2,1\n": "is before that of the row before, 1; sort the rows",
    "t,u\n0,1\n,2\n2,1\n": "drive.csv:3:0: the time is missing",
    "t,u\n0,\n1,2\n2,1\n": "u: the first value is missing; begin where it is known",
    "t,u\n0,1\n1,inf\n2,1\n": "u: infinite; leave it empty where it is missing",
    "t,u\n0,1\n1,one\n2,1\n": "u: 'one' is no number",
    "t,u\n0,1\n1\n2,1\n": "has 1 values and 2 columns have a name",
    "0,1\n1,2\n": "begins with numbers",
    "t,u\n0,1\n1,\xff\n": "no number",
    "": "begins with no line of column names",
}


@pytest.mark.parametrize("text", [text for text in WRONG if "t = 2 s" not in WRONG[text]])
def test_a_file_that_is_wrong_is_told_in_one_line(text):
    Path("drive.csv").write_text(text)
    plant = CART.replace("gx:", "units: {u: V}, gx:") + SINE + L2
    assert WRONG[text] in wrong(plant=plant)


def test_the_last_value_holds_as_long_as_the_row_before_it_and_what_is_missing_is_as_before():
    Path("drive.csv").write_text("t [s];u [V];y\n0;1;x\n0.5;;\n1;2;nan\n1.5;NaN;\n".replace("x", "1"))
    run = simulated("continuous", "{u: {file: drive.csv}}")
    assert run["u"] == pytest.approx(np.where(run.t < 1, 1, 2))
    Path("drive.csv").write_text("t,u\n-3,9\n-1,1\n0.5,2\n1.5,0\n700,1\n")
    run = simulated("continuous", "{u: {file: drive.csv, hold: first}}")
    assert run["u"] == pytest.approx(np.interp(run.t, [-1, 0.5, 1.5, 700], [1, 2, 0, 1]))


SIGNALS = {
    "u: {file: drive.csv}": "a file goes with a signal: write u: {u: {file: .., column: ..}}",
    "u: drive.csv": "a file goes with a signal: write u: {NAME: {file: drive.csv, column: ..}}",
    "u: [drive.csv]": "a file goes with a signal",
    "u: {u: drive.csv}": "a file is written {file: drive.csv, column: ..}, with the column of u",
    "u: {u: {column: u}}": "simulation.u.u.file: is required",
    "u: {u: {file: drive.csv, hold: cubic}}": "unknown hold cubic; allowed: zero, first",
    "u: {u: {file: drive.csv, unit: V}}": "unknown key unit",
    "u: {speed: {file: drive.csv}}": "unknown input speed",
    "u: [{file: drive.csv}]": "expected a number or arithmetic; found a mapping",
    "x0: {angle: {file: drive.csv}}": "simulation.x0",
}


@pytest.mark.parametrize("key", SIGNALS)
def test_what_is_written_otherwise_is_refused_with_what_to_write(key):
    Path("case.yaml").write_text(f"{HEAD}{CART}{SINE}{L2}simulation: {{horizon: 2, {key}}}\n")
    with pytest.raises(UsageError) as caught:
        od.load("case.yaml")
    assert SIGNALS[key] in str(caught.value)


def test_a_w_that_a_model_generates_is_given_by_its_v():
    plant = CART.replace(", gx: [0, u]", "").replace(", inputs: [u]", ", disturbances: [push]")
    said = wrong(
        "w: {push: {file: drive.csv}}", f"{plant}{SINE}{L2}disturbance: integrator\n".replace("-3]", "-3, -1]")
    )
    assert "simulation.w.push: a disturbance model generates push, whose v is no column of a file" in said


def test_gains_find_the_files_of_their_spec_or_those_beside_them():
    """What a result says of the path of its spec counts only where that spec still stands: it may come from anyone."""
    rows("spec/drive.csv", [0, 2], [1, 1])
    text = f"{HEAD}{CART}{SINE}{L2}simulation: {{horizon: 2, points: 5, u: {{u: {{file: drive.csv}}}}}}\n"
    Path("spec/case.yaml").write_text(text)
    Path("away").mkdir()
    od.solve(od.load("spec/case.yaml")).save("away/case.gains.json")
    assert od.read("away/case.gains.json").simulate()["u"] == pytest.approx(1)
    assert od.read("away/case.gains.json").simulate(horizon=1)["u"] == pytest.approx(1)
    assert od.read("away/case.gains.json", od.load("spec/case.yaml")).simulate()["u"] == pytest.approx(1)
    Path("spec/case.yaml").write_text(text + "# changed\n")
    with pytest.raises(UsageError) as caught:
        od.read("away/case.gains.json").simulate()
    looked = (
        "drive.csv is not there: looked for away/drive.csv; the spec of these gains, spec/case.yaml, is not there as"
    )
    assert looked in str(caught.value)
    rows("away/drive.csv", [0, 2], [3, 3])
    assert od.read("away/case.gains.json").simulate()["u"] == pytest.approx(3)
    Path("spec/case.yaml").write_text(text)
    Path("spec/drive.csv").unlink()
    assert od.read("away/case.gains.json").simulate()["u"] == pytest.approx(3)
    Path("away/drive.csv").unlink()
    with pytest.raises(UsageError, match=r"looked for spec/drive.csv and away/drive.csv \["):
        od.read("away/case.gains.json").simulate()


def test_a_spec_is_loaded_solved_and_verified_without_its_files():
    text = f"{HEAD}{CART}{SINE}{L2}simulation: {{horizon: 2, u: {{u: {{file: none.csv}}}}}}\n"
    Path("case.yaml").write_text(text)
    od.solve(od.load("case.yaml")).save("case.gains.json")
    assert od.verify("case.gains.json").holds
    outcome = command("simulate", "case.gains.json")
    assert outcome.exit_code == 2
    assert re.fullmatch(r"case.*none.csv is not there: looked for none.csv \[OBS101\]\n", outcome.stderr)
    assert command("check", "case.yaml").exit_code == 0


def compared(*paths):
    outcome = command("compare", *paths, "--json", "--seeds", 2)
    return json.loads(outcome.stdout) if outcome.exit_code == 0 else outcome.stderr


def test_observers_are_compared_along_one_file():
    t = np.linspace(0, 2, 41)
    kinds = {"l2": "{type: l2, alpha: 0.1, bounds: {L1: 20}}", "ekf": "{type: ekf, Q: {push: 0.1}, R: 1.0e-2}"}
    trial = "horizon: 2, x0: [0.5, 0], w: [0], noise: {amplitude: 0.01, period: 0.02}, u: {u: {file: drive.csv}}"
    for name, kind in kinds.items():
        rows(f"{name}/drive.csv", t, np.sin(t))
        Path(f"{name}/case.yaml").write_text(f"{HEAD}{ARM}observer: {kind}\nsimulation: {{{trial}}}\n")
    report = compared("l2/case.yaml", "ekf/case.yaml")
    assert [one["run"] for one in report["observers"]] == ["done", "done"]
    assert all(one["states"]["rate"]["noise_rms"] > 0 for one in report["observers"])
    text = Path("ekf/case.yaml").read_text()
    Path("ekf/case.yaml").write_text(text.partition("simulation")[0])  # takes the trial of the other, and its file
    Path("ekf/drive.csv").unlink()
    adopted = compared("l2/case.yaml", "ekf/case.yaml")
    assert adopted["observers"][1]["states"]["rate"]["t5"] == report["observers"][1]["states"]["rate"]["t5"]
    Path("ekf/case.yaml").write_text(text)
    rows("ekf/drive.csv", t, np.cos(t))
    assert "OBS805" in compared("l2/case.yaml", "ekf/case.yaml")


def test_fields_of_a_file_beyond_the_horizon_are_not_read(monkeypatch):
    monkeypatch.setattr(table, "BLOCK", 64)
    Path("drive.csv").write_text("t,u\n" + "".join(f"{k / 10},{k}\n" for k in range(60)) + "never,ending\n")
    run = simulated("continuous", "{u: {file: drive.csv}}")
    assert run["u"] == pytest.approx(np.floor(run.t * 10 + 1e-6))


def test_a_batch_runs_a_spec_again_whose_file_has_changed():
    text = f"{HEAD}{CART}{SINE}{L2}simulation: {{horizon: 2, points: 5, u: {{u: {{file: in/drive.csv}}}}}}\n"
    rows("specs/in/drive.csv", [0, 2], [1, 1])
    Path("specs/case.yaml").write_text(text)

    def batch():
        outcome = command("batch", "specs", "--simulate", "--out", "out", "--jobs", 1)
        assert outcome.exit_code == 0, outcome.output
        (entry,) = json.loads(Path("out/summary.json").read_text())["specs"]
        return entry["up_to_date"], entry["why"]

    assert batch() == (False, "never run")
    assert batch() == (True, None)
    rows("specs/in/drive.csv", [0, 2], [1, 2])
    assert batch() == (False, "in/drive.csv was changed")
    Path("specs/in/drive.csv").unlink()
    outcome = command("batch", "specs", "--simulate", "--out", "out", "--jobs", 1)
    assert outcome.exit_code == 2
    assert "in/drive.csv is not there: looked for specs/in/drive.csv [OBS101]" in outcome.output


def test_a_run_does_not_take_the_place_of_a_file_that_it_follows():
    text = f"{HEAD}{CART}{SINE}{L2}simulation: {{horizon: 2, points: 5, x0: [1, 0]}}\n"
    Path("case.yaml").write_text(text)
    assert command("solve", "case.yaml", "--simulate", "-q").exit_code == 0
    before = Path("case.run.csv").read_bytes()
    along = "simulation.w={w1: {file: case.run.csv, hold: first}}"
    for arguments in (("simulate", "case.gains.json"), ("simulate", "case.yaml"), ("solve", "case.yaml", "--simulate")):
        outcome = command(*arguments, "--set", along)
        assert outcome.exit_code == 2
        assert "case.run.csv: is read here, and would be overwritten; name another [OBS904]" in outcome.output
        assert Path("case.run.csv").read_bytes() == before
    assert command("simulate", "case.gains.json", "--set", along, "-o", "again.csv").exit_code == 0
