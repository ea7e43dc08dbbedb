"""What is refused in a line before it could mislead: texts that no result could hold, other plants, too much memory."""

import json
from pathlib import Path

import pytest
from support.commands import files, run

from obsdesign.batches import workers

pytestmark = pytest.mark.usefixtures("here")

PLAIN = "obsdesign: 1\nsystem: {A: [[-1]], B: [[1]], C: [[1]]}\nobserver: {type: l2, alpha: 0.3, bounds: {L1: 10}}\n"


@pytest.mark.parametrize("change", ["observer.alpha=\n0.4", "observer.alpha=0.4\n", "name=a\tb", "name='a\x1b'"])
def test_a_change_of_more_than_a_line_is_refused(change):
    Path("s.yaml").write_text(PLAIN)
    for command in ("solve", "check"):  # a batch takes blanks around a value off
        outcome = run(command, "s.yaml", "--set", change)
        assert (outcome.exit_code, outcome.stdout, files()) == (2, "", ["s.yaml"])
        assert "; write it in one line, without tabs [OBS110]" in outcome.stderr


@pytest.mark.parametrize("name", ["t\tl.yaml", "e\x1bl.yaml"])
def test_a_spec_whose_name_no_result_could_hold_is_refused(name):
    Path(name).write_text(PLAIN)
    outcome = run("solve", name, "-o", "s.gains.json")
    assert (outcome.exit_code, outcome.stdout, files()) == (2, "", [name])
    assert "rename it [OBS102]" in outcome.stderr


def test_gains_of_a_changed_plant_are_not_those_of_the_spec_that_they_name():
    Path("s.yaml").write_text(PLAIN)
    for change, code in (
        ("system.A=[[-1000]]", 2),
        ("observer.alpha=0.1", 2),
        ("expect={status: certified}", 0),
        ("simulation={horizon: 1, x0: [1], w: [0]}", 0),
    ):
        assert run("solve", "s.yaml", "-q", "--set", change, "-o", "s.gains.json").exit_code == 0
        assert run("verify", "-q", "s.gains.json").exit_code == 0
        outcome = run("verify", "--quiet", "--specs", "s.gains.json")
        assert (outcome.exit_code, outcome.stdout) == (code, "")
        assert outcome.stderr.startswith("s.gains.json: spec.set: these gains are of s.yaml with" if code else "")
        assert outcome.stderr.count("\n") == bool(code)


def states(n):
    """Spec of n states that no closed form answers."""
    A = [[-1 if i == j else 0 for j in range(n)] for i in range(n)]
    return f"obsdesign: 1\nsystem: {{A: {A}, C: {[[1] + [0] * (n - 1)]}}}\nobserver: {{type: l2, alpha: 0.3}}\n"


def test_a_problem_that_no_memory_would_hold_is_undecided(monkeypatch):
    monkeypatch.setattr("obsdesign.lmi.probe.MOST", 20)
    monkeypatch.setattr("obsdesign.lmi.faces.MOST", 20)
    Path("s.yaml").write_text(states(6).replace("0.3}", "0.3, bounds: {L1: 10}}"))
    outcome = run("solve", "s.yaml")
    said = "s.yaml: the inequality has 28 scalar unknowns, and at most 20 fit in memory: take fewer states [OBS908]\n"
    assert (outcome.exit_code, outcome.stderr, files()) == (4, said, ["s.yaml"])


def without_memory(*_args, **_options):
    """What ends for lack of memory."""
    raise MemoryError("Unable to allocate 48 GiB")


@pytest.mark.parametrize("command", ["solve", "simulate", "verify"])
def test_a_command_that_lacks_memory_says_so_and_goes_on_with_the_next(monkeypatch, command):
    names = [f"{name}.{'gains.json' if command == 'verify' else 'yaml'}" for name in "ab"]
    for name in names:
        Path(name).write_text(PLAIN + "simulation: {horizon: 1, x0: [1], w: [0]}\n")
    for verb in ("solve", "trial", "verify"):
        monkeypatch.setattr(f"obsdesign.work.{verb}", without_memory)
    said = "there is not enough memory; ask for less, such as fewer states: Unable to allocate 48 GiB [OBS908]\n"
    for sources in (names[:1], names):
        outcome = run(command, *sources)
        assert (outcome.exit_code, outcome.stderr) == (4, said * len(sources))
    problems = json.loads(run(command, *names, "--json").stdout)
    assert [one["problems"][0]["id"] for one in problems] == ["OBS908"] * 2


DYING = """import sys
from multiprocessing.connection import Connection
pipe = Connection(int(sys.argv[2]))
pipe.send_bytes(b"{}")
pipe.recv_bytes()
raise MemoryError("Unable to allocate 48 GiB")
"""


def test_a_spec_of_a_batch_that_lacks_memory_without_a_limit_is_no_defect(monkeypatch):
    monkeypatch.setattr(workers, "START", DYING)
    Path("s.yaml").write_text(PLAIN)
    outcome = run("batch", "s.yaml", "--jobs", 1)
    assert outcome.exit_code == 4
    assert "memory: s.yaml: needs more memory than there is; ask for less: fewer states, fewer points" in outcome.stderr


def test_a_result_stays_that_was_not_proved_anew_in_time(monkeypatch):
    Path("s.yaml").write_text(PLAIN)
    assert run("batch", "s.yaml", "-q", "--jobs", 1).exit_code == 0
    before = {path: path.read_bytes() for path in Path("results/s").iterdir()}
    with monkeypatch.context() as broken:
        broken.setattr(workers, "START", DYING)
        assert run("batch", "s.yaml", "-q", "--jobs", 1).exit_code == 4
    assert {path: path.read_bytes() for path in Path("results/s").iterdir()} == before
    assert run("batch", "s.yaml", "-q", "--jobs", 1).exit_code == 0
    assert json.loads(Path("results/summary.json").read_text())["specs"][0]["up_to_date"] is True
