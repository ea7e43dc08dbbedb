"""Commands on several sources, and other values of single keys: `--set`."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.commands import begin, endless, files, run

import obsdesign as od
from obsdesign.sections.changes import opened

HIDDEN = """
obsdesign: 1
system: {A: [[1, 0], [0, -1]], B: [[0], [1]], C: [[0, 1]]}
observer: {type: l2, alpha: 0.1}
"""


@pytest.fixture(autouse=True)
def here(made, tmp_path, monkeypatch):
    """A folder with one good spec, one without an observer and one that is no YAML."""
    (tmp_path / "specs" / "deep").mkdir(parents=True)
    shutil.copy(made / "cart.yaml", tmp_path / "specs")
    (tmp_path / "specs" / "deep" / "hidden.yml").write_text(HIDDEN)
    (tmp_path / "specs" / "wrong.yaml").write_text("obsdesign: [1")
    (tmp_path / "specs" / "notes.txt").write_text("no spec")
    monkeypatch.chdir(tmp_path)


def content(path):
    return json.loads(Path(path).read_text())


# Several sources


def test_a_folder_is_every_spec_below_it_and_the_worst_code_counts():
    outcome = run("check", "specs")
    assert outcome.exit_code == 2
    assert [line for line in outcome.stdout.splitlines() if line.startswith("==")] == [
        "== specs/cart.yaml",
        "== specs/deep/hidden.yml",
    ]
    assert "specs/wrong.yaml:2:" in outcome.stderr
    assert run("check", "specs/cart.yaml", "specs/deep").exit_code == 3
    assert run("check", "specs/cart.yaml", "specs/cart.yaml").exit_code == 0


def test_the_json_of_several_is_a_list():
    reports = json.loads(run("check", "specs/cart.yaml", "specs/deep/hidden.yml", "--json").stdout)
    assert [report["possible"] for report in reports] == [True, False]


@pytest.mark.parametrize("command", ["check", "solve", "simulate", "lipschitz"])
def test_the_json_of_several_tells_which_failed_and_why(command):
    Path("specs/deep/hidden.yml").unlink()
    outcome = run(command, "specs", "nonesuch.yaml", "--json")
    reports = {report["source"]: report for report in json.loads(outcome.stdout)}
    assert list(reports) == ["specs/cart.yaml", "specs/wrong.yaml", "nonesuch.yaml"]
    assert outcome.exit_code == 2
    told = {source: [p["id"] for p in report.get("problems", ())] for source, report in reports.items()}
    assert told["specs/wrong.yaml"] == ["OBS104"]
    assert told["nonesuch.yaml"] == ["OBS101"]
    assert reports["nonesuch.yaml"]["problems"][0]["file"] == "nonesuch.yaml"
    assert told["specs/cart.yaml"] == []
    assert [line.rpartition(" [")[2] for line in outcome.stderr.splitlines()[-2:]] == ["OBS104]", "OBS101]"]


def test_what_was_found_of_one_stands_beside_its_problem():
    assert run("solve", "specs/cart.yaml", "-q").exit_code == 0
    forged = content("cart.gains.json")
    forged["guarantee"]["gamma"] /= 2
    Path("forged.gains.json").write_text(json.dumps(forged))
    outcome = run("verify", ".", "--json")
    proved, refused = json.loads(outcome.stdout)
    assert (outcome.exit_code, proved["proved"], "problems" in proved) == (4, True, False)
    assert (refused["source"], refused["proved"]) == ("./forged.gains.json", False)
    assert [problem["id"] for problem in refused["problems"]] == ["OBS708"]


def test_none_is_begun_after_the_limit_of_time(monkeypatch):
    monkeypatch.setattr("obsdesign.work.check", endless)
    outcome = run("check", "specs/cart.yaml", "specs/deep/hidden.yml", "--json", "--timeout", "0.5")
    (report,) = json.loads(outcome.stdout)
    assert (outcome.exit_code, report["source"], report["problems"][0]["id"]) == (4, "specs/cart.yaml", "OBS905")
    assert outcome.stderr.splitlines() == ["not finished after 0.5 s; --timeout allows more [OBS905]"]


def test_findings_that_do_not_hold_and_reasons_name_their_id():
    outcome = run("check", "specs/deep/hidden.yml")
    assert all(("[OBS" in line) == (not line.startswith("ok  ")) for line in outcome.stdout.splitlines())
    assert "[OBS601]" in outcome.stdout
    table = run("solve", "specs/deep/hidden.yml").stdout
    assert re.search(r"^reason .* \[OBS601\]$", table, re.MULTILINE)


@pytest.mark.usefixtures("sketched")
def test_several_are_solved_verified_and_simulated():
    assert run("solve", "specs/cart.yaml", "specs/deep", "-q").exit_code == 3
    assert files() == ["cart.gains.json", "hidden.gains.json", "specs"]
    outcome = run("verify", ".", "--json")
    assert [proof["proved"] for proof in json.loads(outcome.stdout)] == [True, True]
    assert run("verify", "cart.gains.json", "specs/cart.yaml").exit_code == 0
    assert run("verify", "cart.gains.json", "specs/deep/hidden.yml").exit_code == 2
    assert run("simulate", "cart.gains.json", "hidden.gains.json", "-q").exit_code == 2
    assert "cart.run.csv" in files()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["solve", "specs/cart.yaml", "specs/deep", "-o", "x.json"], "go with one source"),
        (["simulate", "specs", "--plot", "x.png"], "go with one source"),
        (["solve", "specs/cart.yaml", "./specs/cart.yaml"], "would both write cart.*"),
        (["verify", "specs"], "no file below this folder ends with .gains.json"),
        (["check", "--watch", "-"], "standard input is read once"),
    ],
)
def test_what_makes_no_sense_of_several_is_refused(arguments, word):
    outcome = run(*arguments)
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert word in outcome.stderr
    assert files() == ["specs"]


def test_a_spec_is_checked_again_when_it_is_saved():
    command = [sys.executable, "-m", "obsdesign", "check", "--watch", "-q", "specs/cart.yaml"]
    with begin(command, stderr=subprocess.PIPE, text=True) as process:
        assert "checked at" in process.stderr.readline()
        Path("saved.yaml").write_text("obsdesign: [1")
        Path("saved.yaml").replace("specs/cart.yaml")
        assert "specs/cart.yaml:2:" in process.stderr.readline()
        assert "checked at" in process.stderr.readline()
        process.send_signal(2)
        assert process.wait(10) == 130


def test_a_folder_that_vanishes_is_told_and_watched_on():
    command = [sys.executable, "-m", "obsdesign", "check", "--watch", "-q", "specs/deep"]
    with begin(command, stderr=subprocess.PIPE, text=True) as process:
        assert "checked at" in process.stderr.readline()
        shutil.rmtree("specs/deep")
        assert process.stderr.readline().startswith("specs/deep: cannot be read: No such file or directory")
        assert "checked at" in process.stderr.readline()
        Path("specs/deep").mkdir()
        Path("specs/deep/wrong.yaml").write_text("obsdesign: [1")
        assert "specs/deep/wrong.yaml:2:" in process.stderr.readline()
        assert "checked at" in process.stderr.readline()
        Path("specs/deep/wrong.yaml").unlink()
        assert process.stderr.readline().startswith("specs/deep: no file below this folder ends with .yaml")
        assert "checked at" in process.stderr.readline()
        process.send_signal(2)
        assert process.wait(10) == 130


def test_the_version_is_told():
    assert run("--version").stdout == f"obsdesign {od.__version__}\n"


# Other values of single keys


def test_another_value_is_solved_for_written_and_held():
    changes = ["observer.alpha=0.05", "observer.bounds={L1: 30}", "simulation.horizon=1"]
    options = [part for change in changes for part in ("--set", change)]
    outcome = run("solve", "specs/cart.yaml", *options)
    assert outcome.exit_code == 0
    result = content("cart.gains.json")
    assert result["spec"]["set"] == changes
    assert result["spec"]["text"] == Path("specs/cart.yaml").read_text()
    assert result["guarantee"]["alpha"] == 0.05
    assert "of the spec with observer.alpha=0.05, observer.bounds={L1: 30}" in result["guarantee"]["statement"]
    for arguments in (["cart.gains.json"], ["cart.gains.json", "specs/cart.yaml"]):
        outcome = run("verify", *arguments)
        assert outcome.exit_code == 0
        assert outcome.stdout.splitlines()[-1].endswith(
            "of the spec with observer.alpha=0.05, observer.bounds={L1: 30}"
        )
    assert od.read("cart.gains.json").simulate().t[-1] == 1


@pytest.mark.parametrize("forged", [["observer.alpha=0.2"], [], "observer.alpha=0.05", [1], ["observer.gamma=1"]])
def test_another_list_of_changes_is_refused(forged):
    assert run("solve", "specs/cart.yaml", "--set", "observer.alpha=0.05", "-q").exit_code == 0
    result = content("cart.gains.json")
    result["spec"]["set"] = forged
    Path("cart.gains.json").write_text(json.dumps(result))
    assert run("verify", "cart.gains.json").exit_code in {2, 4}


def test_a_verdict_of_infeasibility_is_of_the_changed_spec():
    assert run("solve", "specs/deep/hidden.yml", "--set", "observer.alpha=0.3", "-q").exit_code == 3
    outcome = run("verify", "hidden.gains.json")
    assert outcome.exit_code == 0
    assert outcome.stdout.splitlines()[-1].endswith("of the spec with observer.alpha=0.3")


@pytest.mark.usefixtures("sketched")
def test_a_run_of_given_gains_changes_its_trial_only():
    assert run("solve", "specs/cart.yaml", "-q").exit_code == 0
    assert run("simulate", "cart.gains.json", "--set", "simulation.horizon=0.5", "-q").exit_code == 0
    assert Path("cart.run.csv").read_text().splitlines()[-1].startswith("0.5,")
    outcome = run("simulate", "cart.gains.json", "--set", "observer.alpha=1")
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert "only keys of simulation: and data: can be set" in outcome.stderr
    paired = ["specs/cart.yaml", "--gains", "cart.gains.json", "--set", "simulation.horizon=0.25", "-q"]
    assert run("simulate", *paired).exit_code == 0
    assert Path("cart.run.csv").read_text().splitlines()[-1].startswith("0.25,")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("observer.alfa=1", ["--set observer.alfa=1: observer.alfa: ", "alpha"]),
        ("observer.alpha=fast", ["--set observer.alpha=fast: observer.alpha: "]),
        ("observer.alpha", ["expected KEY=VALUE"]),
        ("observer.alpha.min=1", ["needs a mapping where the spec has 0.1", ": --set 'observer.alpha={min: 1}'"]),
        ("system.A[7][0]=1", ["needs a list of more entries where the spec has a list"]),
        ("observer.bounds={L1:", ["the value is not YAML"]),
        ("observer.alpha=", ["the value is empty"]),
        ("observer.bounds={L1: 1, L1: 2}", ["duplicate key L1"]),
    ],
)
def test_a_change_that_cannot_be_is_told_in_one_line(change, words):
    outcome = run("solve", "specs/cart.yaml", "--set", change)
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert len(outcome.stderr.splitlines()) == 1
    for word in words:
        assert word in outcome.stderr


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        (("observer.alpha=1", "observer.alpha=2"), "observer.alpha"),
        (("observer.bounds.L1=3", "observer.bounds={L1: 4}"), "observer.bounds.L1"),
        (("system.A[0]=[0, 1]", "observer.alpha=1", "system.A=[[1]]"), "system.A[0]"),
    ],
)
@pytest.mark.parametrize("command", ["solve", "check", "lipschitz", "simulate", "batch"])
def test_two_changes_of_one_key_are_refused(changes, key, command):
    options = [part for change in changes for part in ("--set", change)]
    outcome = run(command, "specs/cart.yaml", *options)
    said = f"--set: {changes[0]} and {changes[-1]} both set {key}; leave one of them out [OBS110]\n"
    assert (outcome.exit_code, outcome.stdout, outcome.stderr) == (2, "", said)


def test_two_changes_of_one_key_of_a_run_are_refused():
    assert run("solve", "specs/cart.yaml", "--set", "simulation.horizon=0.5", "-q").exit_code == 0
    outcome = run("simulate", "cart.gains.json", *("--set", "simulation.horizon=1") * 2)
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
    assert "simulation.horizon=1 and simulation.horizon=1 both set simulation.horizon" in outcome.stderr
    assert run("simulate", "cart.gains.json", "--set", "simulation.horizon=1", "-q").exit_code == 0


@pytest.mark.parametrize("command", ["solve", "simulate", "compare", "batch"])
def test_a_solver_that_there_is_none_of_is_refused_once(command):
    shutil.copy("specs/cart.yaml", "specs/other.yaml")
    outcome = run(command, "specs/cart.yaml", "specs/other.yaml", "--solver", "nosuch")
    assert (outcome.exit_code, outcome.stdout, outcome.stderr.count("\n")) == (2, "", 1)
    assert outcome.stderr.startswith("--solver nosuch: not installed; available: clarabel")
    assert files() == ["specs"]


def test_a_change_is_read_as_if_it_stood_in_the_text():
    text = "a: {b: 1, c: [1, 2]}\n"
    changed = opened(text, "x.yaml", ["a.b=2", "a.c[1]=three", "a.d.e=[1e-3]", "f=yes"])
    assert changed.root.plain() == {"a": {"b": "2", "c": ["1", "three"], "d": {"e": ["1e-3"]}}, "f": "yes"}
    assert (
        od.load("specs/cart.yaml", ["observer.alpha=0.3"]).observer
        == od.load(Path("specs/cart.yaml").read_text().replace("alpha: 0.1", "alpha: 0.3")).observer
    )
