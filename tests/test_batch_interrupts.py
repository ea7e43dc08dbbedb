"""An interrupt at any moment of a batch loses nothing that was done, and its summary says what is on disk."""

import os
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path
from shutil import copytree, rmtree

import pytest
from support.commands import begin, interrupted, run
from test_batch import GOOD, HIDDEN, WRONG, entries, put, summary
from test_batch_trouble import SAFE, endless, records, started, until

from obsdesign import batches
from obsdesign.batches import workers
from obsdesign.batches.find import Task
from obsdesign.batches.form import STATUSES
from obsdesign.batches.perform import perform
from obsdesign.batches.record import Options, keep

TRACED = {batches.__file__, batches.summary.__file__}
SPECS = {"a.yaml": GOOD, "b.yaml": HIDDEN, "c.yaml": WRONG, "d.yaml": GOOD}


@pytest.fixture
def quick(here, monkeypatch):
    """Four specs whose results are there at once: of the last no record can be kept."""
    for name, text in SPECS.items():
        put(name, text)
    results = {name: perform(Task(name), Options()) for name in SPECS}

    def run(tasks, options, out, jobs, begun):  # noqa: ARG001
        for task in tasks:
            begun(task)
            result = results[task.path]
            yield task, result.entry if task.path == "d.yaml" else keep(result, task, options, out)

    monkeypatch.setattr(workers, "run", run)
    return here


def interrupted_at(moment, out, **options):
    """Whether a batch has that many moments, the last of which raises what an interrupt does; a moment is a line."""
    left, before = moment, sys.gettrace()

    def line(_frame, event, _):
        nonlocal left
        if event == "line":
            left -= 1
            if left == 0:
                raise KeyboardInterrupt
        return line

    sys.settrace(lambda frame, *_: line if frame.f_code.co_filename in TRACED else None)
    try:
        batches.batch(SPECS, out=out, **options)
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(before)
    return False


@pytest.mark.parametrize("options", [{"force": True}, {"fail_fast": True, "changed_since": "other"}, {}], ids=str)
@pytest.mark.usefixtures("quick")
def test_an_interrupt_at_any_moment_leaves_a_summary_of_what_is_on_disk(options):
    batches.batch(SPECS, out="other")
    batches.batch(["b.yaml", "c.yaml"], out="earlier")
    put("b.yaml", HIDDEN + "name: changed\n")
    earlier, kept, codes = summary("earlier"), {path.name for path in records("earlier")}, Counter()
    for moment in range(1, 10_000):
        out = f"{moment}"
        copytree("earlier", out)
        if not interrupted_at(moment, out, **options):
            break
        assert {path.name for path in records(out)} >= kept
        if (found := summary(out)) == earlier:
            codes["earlier"] += 1
            continue
        codes[found["exit_code"]] += 1
        if found["exit_code"] != 130:  # the interrupt came when all was done
            assert not found["counts"]["skipped"] or options.get("fail_fast")
        assert found["counts"]["total"] == len(found["specs"]) == len(SPECS)
        for status in STATUSES:
            assert found["counts"][status] == sum(entry["status"] == status for entry in found["specs"])
        assert found["counts"]["as_expected"] == sum(bool(entry["as_expected"]) for entry in found["specs"])
    assert {"earlier", 130} <= codes.keys() <= {"earlier", 130, found["exit_code"]}
    assert codes[130] > 20 > codes[found["exit_code"]]


@pytest.mark.usefixtures("quick")
def test_a_spec_whose_record_is_there_before_its_answer_is_not_called_skipped(monkeypatch):
    real = workers.run

    def run(*given):
        list(real(*given))
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(workers, "run", run)
    with pytest.raises(KeyboardInterrupt):
        batches.batch(["."])
    found = {path: (entry["status"], entry["why"]) for path, entry in entries().items()}
    assert found == {
        "a.yaml": ("certified", "never run"),
        "b.yaml": ("infeasible", "never run"),
        "c.yaml": ("invalid", "never run"),
        "d.yaml": ("skipped", "interrupted"),
    }


SLOW = """import sys, time
from obsdesign import watch
from obsdesign.batches import Run
watch.LATE, real = 0.2, Run.summarise
def summarise(*given):
    print("begun", flush=True)
    time.sleep({})
    return real(*given)
Run.summarise = summarise
from obsdesign.__main__ import command
sys.argv[1:] = ["batch", ".", "--jobs", "1", "-q"]
raise SystemExit(watch.watched(command))
"""


@pytest.mark.parametrize(("seconds", "interrupts"), [(0.7, 1), (60, 2)])
@pytest.mark.usefixtures("here")
def test_a_batch_may_write_its_summary_on_a_busy_machine_unless_it_is_interrupted_again(seconds, interrupts):
    put("a.yaml")
    put("b.yaml", endless())
    command, pipe = [sys.executable, "-c", SLOW.format(seconds)], subprocess.PIPE
    process = begin(command, env=os.environ | SAFE, stdout=pipe, stderr=pipe, text=True)
    until(records)
    process.send_signal(signal.SIGINT)
    assert process.stdout.readline() == "begun\n"
    if interrupts == 2:
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.3)
        process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=20)
    assert process.returncode == 130
    kept = "1 of 2 specs are done and kept, as results/summary.json says; the same command goes on with the others"
    assert said == (f"interrupted; {kept}\n" if interrupts == 1 else "interrupted\n")
    assert Path("results/summary.json").exists() == (interrupts == 1)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], ids=lambda number: number.name)
@pytest.mark.parametrize("form", ["junit", "sarif"])
@pytest.mark.usefixtures("here")
def test_a_batch_that_is_stopped_leaves_no_output_of_an_earlier_one(number, form):
    put("a.yaml")
    arguments = (".", "--jobs", 1, "--format", form, "--output-file", "told")
    assert run("batch", *arguments).exit_code == 0
    assert Path("told").exists()
    put("b.yaml", endless())
    put("c.yaml")
    process = started(*arguments, "--force")
    until(lambda: not Path("told").exists())
    process.send_signal(number)
    _, said = process.communicate(timeout=20)
    assert not Path("told").exists()
    if number == signal.SIGKILL:
        assert not Path("results/summary.json").exists()
        return
    done = summary()["counts"]["certified"]
    kept = f"{done} of 3 specs are done and kept, as results/summary.json says"
    last = f"interrupted; {kept}; the same command without --force goes on with the others"
    assert (process.returncode, said.splitlines()[-1]) == (130, last)
    assert summary()["exit_code"] == 130
    assert entries()["c.yaml"]["why"] == "interrupted"


@pytest.mark.usefixtures("here")
def test_an_interrupt_before_a_batch_begins_leaves_no_output_of_an_earlier_one(monkeypatch):
    put("a.yaml")
    assert run("batch", ".", "--format", "junit", "--output-file", "told", "-q", "--jobs", 1).exit_code == 0
    monkeypatch.setattr(batches, "find", interrupted)
    assert run("batch", ".", "--format", "junit", "--output-file", "told").exit_code == 130
    assert not Path("told").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
@pytest.mark.usefixtures("here")
def test_an_interrupt_that_the_parent_ignores_is_none(number):
    """As a shell has it for what runs in the background, and nohup."""
    put("a.yaml")
    process = started(".", "--jobs", 1, preexec_fn=lambda: signal.signal(number, signal.SIG_IGN))
    until(lambda: Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text())
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, summary()["exit_code"]) == (0, 0), said


@pytest.mark.usefixtures("here")
def test_a_batch_whose_children_nobody_waits_for_ends_with_its_own_code():
    put("a.yaml")
    process = started(".", "--jobs", 1, preexec_fn=lambda: signal.signal(signal.SIGCHLD, signal.SIG_IGN))
    assert process.wait(60) == 0
    process.stderr.close()


@pytest.mark.parametrize("lost", ["record", "results"])
@pytest.mark.usefixtures("here", "at_once")
def test_results_that_are_removed_while_a_batch_runs_are_in_its_summary(monkeypatch, lost):
    real = workers.run

    def run_then_remove(*given):
        yield from real(*given)
        for path in records():
            path.unlink() if lost == "record" else rmtree(path.parent)

    monkeypatch.setattr(workers, "run", run_then_remove)
    put("a.yaml")
    put("b.yaml", WRONG)
    outcome = run("batch", ".", "-q", "--jobs", 1, "--format", "junit")
    assert outcome.exit_code == 2
    assert [entry["status"] for entry in entries().values()] == ["certified", "invalid"]
    assert 'tests="2"' in outcome.stdout
