"""An earlier output of a command is replaced, and that is said; a file that no command wrote stays as it is."""

from pathlib import Path

import pytest
from support.commands import files, run

pytestmark = pytest.mark.usefixtures("sketched")
SPEC = """
obsdesign: 1
name: Short
system: {A: [[-1]], B: [[1]], C: [[1]]}
observer: {type: l2, alpha: {min: 0.1, max: 0.5, points: 3}, objective: pareto, bounds: {L1: 5}}
simulation: {horizon: 1, x0: [1], points: 5}
"""
COMMANDS = {  # with the files that each writes
    ("solve", "short.yaml", "--simulate"): ("short.gains.json", "short.run.csv", "short.run.png"),
    ("solve", "short.yaml", "--plot", "-q"): ("short.gains.json", "short.curve.png"),
    ("simulate", "kept.gains.json", "-o", "run.csv", "--plot", "run.svg"): ("run.csv", "run.svg"),
    ("compare", "kept.gains.json", "--seeds", "1", "-o", "both.svg"): ("both.svg",),
    ("report", "kept.gains.json"): ("report.html",),
    **{
        ("batch", "short.yaml", "--format", form, "--output-file", f"out.{form}", "-q"): (f"out.{form}",)
        for form in ("junit", "github", "sarif", "json")
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
    assert run("solve", "short.yaml", "-o", "kept.gains.json", "-q").exit_code == 0


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_an_earlier_output_is_replaced_and_that_is_said(command):
    first, second = run(*command), run(*command)
    assert (first.exit_code, second.exit_code) == (0, 0), second.output
    for file in COMMANDS[command]:
        if "-q" not in command:
            assert f"  {file}\n" in first.stdout
            assert f"  {file}   replaced\n" in second.stdout
        Path(file).write_text("")  # an empty file holds nothing that could be lost
    assert run(*command).exit_code == 0


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
@pytest.mark.parametrize("content", FOREIGN, ids=["spec", "JSON", "data", "figure"])
def test_a_file_that_no_command_wrote_is_refused_before_anything_is_computed(command, content):
    for file in COMMANDS[command]:
        Path(file).write_text(content)
        before = files()
        outcome = run(*command)
        assert (outcome.exit_code, outcome.stdout) == (2, "")
        assert outcome.stderr == (
            f"{file}: is there already, and is no output of obsdesign; name another file, or remove this one [OBS914]\n"
        )
        assert (Path(file).read_text(), files()) == (content, before)
        Path(file).unlink()


def test_a_link_that_leads_nowhere_is_followed_and_one_to_a_file_of_the_user_is_not():
    Path("nowhere.json").symlink_to("absent.json")
    Path("mine.json").symlink_to("short.yaml")
    assert run("solve", "short.yaml", "-o", "nowhere.json", "-q").exit_code == 0
    outcome = run("simulate", "kept.gains.json", "-o", "mine.json")
    assert (outcome.exit_code, Path("short.yaml").read_text()) == (2, SPEC)
