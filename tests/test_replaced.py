"""An earlier output of a command is replaced, and that is said; a file that no command wrote stays as it is."""

from pathlib import Path

import pytest
from support.commands import files, run

from obsdesign.disk import KINDS

pytestmark = pytest.mark.usefixtures("sketched", "designed_once")
SPEC = """
obsdesign: 1
name: Short
system: {A: [[-1]], B: [[1]], C: [[1]]}
observer: {type: l2, alpha: {min: 0.1, max: 0.5, points: 3}, objective: pareto, bounds: {L1: 5}}
simulation: {horizon: 1, x0: [1], points: 5}
"""
FORMS = {"junit": "JUnit XML", "github": "annotations", "sarif": "SARIF", "json": "summaries"}
COMMANDS = {  # with the files that each writes, and what is in them
    ("solve", "short.yaml", "--simulate", "--plot"): {
        "short.gains.json": "results",
        "short.run.csv": "samples",
        "short.run.png": "figures",
        "short.curve.png": "figures",
    },
    ("simulate", "kept.gains.json", "-o", "run.csv", "--plot", "run.svg"): {"run.csv": "samples", "run.svg": "figures"},
    ("simulate", "kept.gains.json", "--runs", "2", "--jobs", "1"): {
        "kept.runs.csv": "envelopes",
        "kept.runs.png": "figures",
    },
    ("compare", "kept.gains.json", "--seeds", "1", "-o", "both.svg"): {"both.svg": "figures"},
    ("compare", "kept.gains.json", "--data", "log.csv", "-o", "on.png"): {"on.png": "figures"},
    ("report", "kept.gains.json"): {"report.html": "pages"},
    ("estimate", "kept.gains.json", "log.csv"): {"kept.estimate.csv": "estimates", "kept.estimate.png": "figures"},
    ("tune", "kept.gains.json", "long.csv"): {"kept.tuned.yaml": "tuned specs"},
    ("verify", "kept.gains.json", "--theorem", "coq"): {"kept.theorem.v": "theorems"},
    **{
        ("batch", "short.yaml", "wrong.yaml", "--jobs", "1", "--format", form, "--output-file", f"out.{form}"): {
            f"out.{form}": kind
        }
        for form, kind in FORMS.items()
    },
}
FOREIGN = [
    "obsdesign: 1\nname: a spec\n",
    '{"obsdesign": 1, "name": "a spec", "system": {}}',
    "t,y\n0,1\n",
    "\x89PNG",
]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("short.yaml").write_text(SPEC)
    Path("wrong.yaml").write_text("obsdesign: 1\n")
    assert run("solve", "short.yaml", "-o", "kept.gains.json", "-q").exit_code == 0
    Path("log.csv").write_text("t,y1\n0,1\n0.5,1\n1,0\n")
    rows = "".join(f"{k / 100},{k * 7 % 13}\n" for k in range(200))
    Path("long.csv").write_text(f"t,y1\n{rows}")


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_an_earlier_output_is_replaced_and_that_is_said(command):
    first, second = run(*command), run(*command)
    code = 2 if "wrong.yaml" in command else 0
    assert (first.exit_code, second.exit_code) == (code, code), second.output
    for file in COMMANDS[command]:
        assert f"  {file}\n" in first.output
        assert f"  {file}   replaced\n" in second.output
        Path(file).write_text("")  # an empty file holds nothing that could be lost
    assert run(*command).exit_code == code


def refused(command, file, kind, content):
    """A command where a file is already."""
    Path(file).write_bytes(content)
    before = files()
    outcome = run(*command)
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    said = f"is there already, and holds no {kind} of obsdesign; name another file, or remove this one"
    assert outcome.stderr == f"{file}: {said} [OBS914]\n"
    assert (Path(file).read_bytes(), files()) == (content, before)
    Path(file).unlink()


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
@pytest.mark.parametrize("content", FOREIGN, ids=["spec", "JSON", "data", "figure"])
def test_a_file_that_no_command_wrote_is_refused_before_anything_is_computed(command, content):
    for file, kind in COMMANDS[command].items():
        refused(command, file, kind, content.encode("latin-1"))


def test_what_a_command_wrote_gives_way_to_its_kind_only():
    for command in COMMANDS:
        run(*command)
    wrote = {kind: Path(file).read_bytes() for written in COMMANDS.values() for file, kind in written.items()}
    wrote["records"] = Path("results/short/short.record.json").read_bytes()
    assert len(wrote) == len(KINDS)
    for command, written in COMMANDS.items():
        (file, kind), *_ = written.items()
        for other, content in wrote.items():
            if other != kind:
                refused(command, file, kind, content)


def test_a_link_that_leads_nowhere_is_followed_and_one_to_a_file_of_the_user_is_not():
    Path("nowhere.json").symlink_to("absent.json")
    Path("mine.json").symlink_to("short.yaml")
    assert run("solve", "short.yaml", "-o", "nowhere.json", "-q").exit_code == 0
    outcome = run("simulate", "kept.gains.json", "-o", "mine.json")
    assert (outcome.exit_code, Path("short.yaml").read_text()) == (2, SPEC)
