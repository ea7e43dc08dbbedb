"""Batches that are stopped, and specs that hang, eat memory or break their process: nothing that was done is lost."""

import errno
import json
import os
import pty
import random
import re
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path

import pytest
from support.commands import begin, run
from support.sweep import SWEEP
from test_batch import GOOD, HIDDEN, WRONG, entries, lasting, put, summary

import obsdesign as od
from obsdesign.batches import workers
from obsdesign.batches.find import Task
from obsdesign.batches.record import Options

COMMAND = [sys.executable, "-m", "obsdesign", "batch"]
SAFE = {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(Path(od.__file__).parent.parent)}
EATER = GOOD.replace("points: 5", "points: 1000000") + "expect: {simulation.status: done}\n"


def endless(n=20):
    """A spec whose search takes minutes."""
    A = [[-1 if i == j else int(j == i + 1) for j in range(n)] for i in range(n)]
    one, all_ = [[1] + [0] * (n - 1)], [[1]] * n
    block = f"nonlinearities:\n  - {{type: {{lipschitz: 0.1}}, Bf: {all_}, Cq: {one}}}\n"
    observer = "observer: {type: linf, alpha: {min: 0.01, max: 1, points: 100}, L2: free}\n"
    return f"obsdesign: 1\nsystem: {{A: {A}, B: {all_}, C: {one}}}\n{block}{observer}"


def started(*arguments, **options):
    """A batch in a process of its own."""
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True} | options
    return begin([*COMMAND, *map(str, arguments)], env=os.environ | SAFE, **streams)


def records(out="results"):
    """Paths of the records of a folder."""
    return sorted(Path(out).rglob("*.record.json"))


def until(holds, seconds=60.0):
    """Wait until something holds."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def below(pid):
    """Numbers of the processes that a process began, and these."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return {*children, *(found for child in children for found in below(child))}


@pytest.mark.usefixtures("here")
def test_a_spec_that_hangs_eats_memory_or_breaks_its_process_takes_no_other_down():
    put("a-hangs.yaml", endless())
    put("b-eats.yaml", EATER)
    for name in "cde":
        put(f"{name}.yaml")
    limits = "--timeout", 6, "--memory", 50  # 6 s are many times what the others need, beside what else runs
    outcome = run("batch", ".", "--jobs", 2, *limits)
    assert outcome.exit_code == 4
    found = entries()
    assert [(e["status"], e["exit_code"], e["as_expected"]) for e in found.values()] == [
        ("timeout", 4, False),
        ("memory", 4, False),
        *[("certified", 0, True)] * 3,
    ]
    assert found["a-hangs.yaml"]["problems"] == [
        {"id": "OBS905", "message": "not finished after 6 s; --timeout allows more", "file": "a-hangs.yaml"}
    ]
    assert "needs more than 50 MiB; --memory allows more" in outcome.stderr
    assert run("batch", ".", "-q", "--jobs", 2, "--timeout", 2, "--memory", 50).exit_code == 4
    assert [entry["why"] for entry in entries().values()] == ["it was late", "it lacked memory", None, None, None]


@pytest.mark.usefixtures("here")
def test_a_small_spec_is_designed_within_a_small_limit_of_memory():
    put("a.yaml")  # once there is no memory left, OpenBLAS would ask for its buffers again and again
    assert run("batch", ".", "-q", "--memory", 20, "--timeout", 20).exit_code == 0


BREAKING = """import os, obsdesign.batches.worker as worker
real = worker.perform
def perform(task, options):
    if task.name == "a": {}
    return real(task, options)
worker.perform = perform
"""


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("raise KeyError('x')", "exit code 1: KeyError: 'x'; this is a defect of obsdesign"),
        ("os.kill(os.getpid(), 11)", "signal SIGSEGV: it said nothing; this is a defect of obsdesign"),
    ],
)
@pytest.mark.usefixtures("here")
def test_a_crash_is_told_and_tried_once_more(monkeypatch, how, said):
    put("a.yaml")
    put("b.yaml")
    path, end = workers.START.split("; from ")
    with monkeypatch.context() as broken:
        broken.setattr(workers, "START", f"{path}\n{BREAKING.format(how)}from {end}")
        outcome = run("batch", ".", "--jobs", 1)
    assert outcome.exit_code == 1
    assert [entry["status"] for entry in entries().values()] == ["crashed", "certified"]
    assert entries()["a.yaml"]["problems"][0]["message"] == f"its process ended with {said}"
    assert run("batch", ".", "-q").exit_code == 0
    assert [entry["why"] for entry in entries().values()] == ["it crashed", None]


def test_processes_that_do_not_start_end_the_batch(here, monkeypatch):
    put("a.yaml")
    monkeypatch.setattr(workers, "START", "raise SystemExit('no such package')")
    running = workers.run([Task("a.yaml")], Options(), here, 1)
    with pytest.raises(RuntimeError, match="does not start: its process ended with exit code 1: no such package"):
        next(running)


@pytest.mark.usefixtures("here")
def test_a_batch_that_was_killed_goes_on_where_it_was():
    for i in range(6):
        put(f"specs/s{i}.yaml")
    put("specs/x.yaml", HIDDEN)
    put("specs/y.yaml", WRONG)
    assert run("batch", "specs", "--out", "undisturbed", "-q").exit_code == 2
    process = started("specs", "--jobs", 2)
    until(lambda: len(records()) >= 2)
    begun = below(process.pid)
    process.kill()
    process.communicate()
    assert len(begun) >= 2
    until(lambda: not any(Path("/proc", pid).exists() for pid in begun), 10)
    done = {json.loads(path.read_bytes())["entry"]["path"] for path in records()}
    assert 2 <= len(done) < 8
    run("batch", "specs", "-q")
    assert lasting() == lasting("undisturbed")
    assert {path for path, entry in entries().items() if entry["up_to_date"]} == done
    assert list(Path("results").rglob(".obsdesign.*")) == []


@pytest.mark.usefixtures("here")
def test_two_batches_do_not_write_into_one_folder():
    put("a.yaml")
    put("long.yaml", endless())
    process = started(".", "--jobs", 2)
    until(records)
    for arguments in (("a.yaml",), ("--merge", "results"), ("a.yaml", "--out", "./results/")):
        outcome = run("batch", *arguments)
        assert (outcome.exit_code, outcome.stdout) == (2, "")
        said = "results: another batch is writing its results here; wait for its end, or give another --out [OBS912]\n"
        assert outcome.stderr == said
    assert run("batch", "a.yaml", "--out", "others", "-q", "--jobs", 1).exit_code == 0
    process.kill()  # SIGKILL
    process.communicate()
    assert run("batch", "a.yaml", "-q").exit_code == 0
    assert sorted(path.name for path in Path("results").iterdir()) == ["a", "summary.json"]


@pytest.mark.usefixtures("here")
def test_two_batches_do_not_write_into_folders_one_of_which_holds_the_other():
    put("a.yaml")
    put("long.yaml", endless())
    process = started(".", "--jobs", 2, "--out", "all/one")
    until(lambda: records("all"))
    for out, code in (("all", 2), (".", 2), ("all/one/a", 2), ("all/two", 0)):
        assert run("batch", "a.yaml", "-q", "--out", out, "--jobs", 1).exit_code == code, out
    process.kill()
    process.communicate()
    assert run("batch", "a.yaml", "-q", "--out", "all", "--jobs", 1).exit_code == 0


@pytest.mark.usefixtures("here")
def test_a_folder_without_locks_is_written_all_the_same(monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    put("a.yaml")
    monkeypatch.setattr("fcntl.flock", refuse)
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_batches_killed_at_any_moment_lose_nothing():
    for i in range(30):
        put(f"specs/s{i}.yaml")
    put("specs/x.yaml", HIDDEN)
    run("batch", "specs", "--simulate", "--out", "undisturbed", "-q")
    draw, done = random.Random(1), set()
    for _ in range(SWEEP.size(20)):
        process = started("specs", "--simulate", "--jobs", 2, "--out", "results")
        time.sleep(draw.uniform(0.2, 4.0))
        process.kill()
        process.communicate()
        kept = {path: path.read_bytes() for path in records()}
        assert done <= kept.items()  # nothing is redone that was done
        done = set(kept.items())
        assert all(json.loads(content)["entry"]["status"] for content in kept.values())
    run("batch", "specs", "--simulate", "-q")
    assert lasting() == lasting("undisturbed")
    assert done <= {(path, path.read_bytes()) for path in records()}


@pytest.mark.usefixtures("here")
def test_an_interrupt_keeps_what_is_done():
    put("a.yaml")
    put("b.yaml", endless())
    process = started(".", "--jobs", 1)
    until(records)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=20)
    assert process.returncode == 130
    assert said.splitlines()[-1].startswith("interrupted; 1 of 2 specs are done and kept, as results/summary.json says")
    assert [entry["status"] for entry in entries().values()] == ["certified", "skipped"]
    assert (summary()["exit_code"], entries()["b.yaml"]["why"]) == (130, "interrupted")


@pytest.mark.usefixtures("here")
def test_a_terminal_shows_what_is_under_way_above_a_bar():
    put("a.yaml")
    put("b.yaml", WRONG.replace("alpa", "':alarm_clock:'"))  # no picture
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 80))
    process = started(".", "--jobs", 2, stderr=theirs)
    os.close(theirs)
    shown = b"".join(iter(lambda: read(ours), b""))
    os.close(ours)
    assert process.wait() == 2
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode())
    assert re.search(r"\d\.\d s +a\.yaml", text)
    assert "━" in text
    assert "0/2" in text
    (complaint,) = run("batch", ".", "-q").stderr.splitlines()
    assert len(complaint) > 80
    assert complaint in text  # whole, and the terminal breaks the line


def read(terminal):
    """What a terminal is sent; nothing once no one has it open."""
    try:
        return os.read(terminal, 65536)
    except OSError:
        return b""


# Shards


@pytest.mark.usefixtures("here", "at_once")
def test_shards_are_made_one_as_if_there_had_been_none():
    for i in range(3):
        put(f"specs/s{i}.yaml")
    put("specs/x.yaml", HIDDEN)
    assert run("batch", "specs", "--out", "whole", "-q").exit_code == 3
    assert run("batch", "specs", "--out", "one", "--shard", "1/2", "-q").exit_code == 0
    assert run("batch", "specs", "--out", "two", "--shard", "2/2", "-q").exit_code == 3
    outcome = run("batch", "--merge", "one", "two/summary.json", "--out", "all")
    assert outcome.exit_code == 3
    assert outcome.stdout.splitlines()[-1].startswith("specs 4: 3 certified, 1 infeasible; 1 not as expected")
    assert lasting("all") == lasting("whole")
    assert run("batch", "specs", "--out", "all", "-q").exit_code == 3
    assert all(entry["up_to_date"] for entry in entries("all").values())


@pytest.mark.usefixtures("here", "at_once")
def test_what_is_no_whole_batch_is_not_merged():
    put("specs/a.yaml")
    put("specs/b.yaml")
    for i in (1, 2):
        assert run("batch", "specs", "--out", f"{i}", "--shard", f"{i}/3", "-q").exit_code == 0

    def refusal(*sources):
        outcome = run("batch", "--merge", *sources, "--out", "all")
        assert outcome.exit_code == 2
        return outcome.stderr

    assert refusal("1", "2") == "--merge: of the shards, 3/3 missing [OBS911]\n"
    assert refusal("1", "absent").startswith("absent: cannot be read")
    content = summary("1")
    content["options"]["shard"] = None
    put("same/summary.json", json.dumps(content))
    put("other/summary.json", json.dumps({**content, "options": {**content["options"], "simulate": True}}))
    assert "differs from same in simulate; shards are of one batch" in refusal("same", "other")
    altered = {**content["specs"][0], "sha256": "0"}
    put("altered/summary.json", json.dumps({**content, "specs": [altered]}))
    assert "altered: differs from same in sha256 of specs/a.yaml" in refusal("same", "altered")
    put("up/summary.json", json.dumps({**content, "specs": [{**altered, "path": "../../etc/x.yaml"}]}))
    assert "is no path of a spec" in refusal("up")
    put("change/summary.json", json.dumps({**content, "specs": [{**altered, "set": [".."]}]}))
    assert "is no path of a spec" in refusal("change")
    assert "same: its list_sha256 is not that of the specs in these summaries" in refusal("same")
    put("same/summary.json", json.dumps({key: value for key, value in content.items() if key != "list_sha256"}))
    assert "same: the record of specs/a.yaml is missing; give its folder too" in refusal("same")


@pytest.mark.usefixtures("here", "at_once")
def test_shards_of_different_specs_are_not_merged():
    put("specs/a.yaml")
    put("specs/b.yaml")
    assert run("batch", "specs", "--out", "one", "--shard", "1/2", "-q").exit_code == 0
    put("specs/0.yaml")  # now b.yaml would be in neither shard
    assert run("batch", "specs", "--out", "two", "--shard", "2/2", "-q").exit_code == 0
    outcome = run("batch", "--merge", "one", "two", "--out", "all")
    assert (outcome.exit_code, Path("all/summary.json").exists()) == (2, False)
    said = "two: is a shard of other specs than one; run both with the same paths, --set and --exclude [OBS911]\n"
    assert outcome.stderr == said
    old = summary("one")
    del old["list_sha256"]  # by a version that did not write it
    put("one/summary.json", json.dumps(old))
    outcome = run("batch", "--merge", "one", "two", "--out", "all")
    assert (outcome.exit_code, Path("all/summary.json").exists()) == (2, False)
    assert outcome.stderr.startswith("two: its list_sha256 is not that of the specs in these summaries: one is missing")
    assert run("batch", "specs", "--out", "one", "--shard", "1/2", "-q").exit_code == 0
    assert run("batch", "specs", "--out", "two", "--shard", "2/2", "-q").exit_code == 0
    assert run("batch", "--merge", "two", "one", "--out", "all", "-q").exit_code == 0
    assert run("batch", "specs", "--out", "whole", "-q").exit_code == 0
    assert lasting("all") == lasting("whole")
