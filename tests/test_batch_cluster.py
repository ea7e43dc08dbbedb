"""The same batch on a Dask cluster: two workers in processes of their own, one of which dies."""

import os
import socket
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest
from support.commands import run
from test_batch import GOOD, HIDDEN, WRONG, entries, lasting, put
from test_batch_trouble import SAFE, endless, records, started, until

from obsdesign.batches import cluster
from obsdesign.batches.find import Task
from obsdesign.batches.record import Options, tool


def specs():
    """A folder of specs of every kind."""
    for i in range(6):
        put(f"specs/s{i}.yaml")
    put("specs/x.yaml", HIDDEN)
    put("specs/y.yaml", WRONG)


class Cluster:
    """A scheduler and two workers of one thread each."""

    def __init__(self, stack, folder):
        pytest.importorskip("distributed", reason="Dask is not installed")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        self.stack, self.folder = stack, folder
        self.started("scheduler", "--host", self.address, "--no-dashboard")
        worker = "worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard"
        self.workers = [self.started(*worker, "--name", name) for name in "ab"]

    def started(self, kind, *arguments):
        """A process of the cluster, which ends with it."""
        code = f"import sys; from distributed.cli.dask_{kind} import main; main()"
        environment = os.environ | SAFE | {"DASK_TEMPORARY_DIRECTORY": str(self.folder)}
        command = [sys.executable, "-W", "ignore", "-c", code, *arguments]
        process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.stack.callback(process.wait)
        self.stack.callback(process.kill)
        return process


@pytest.fixture
def dask(tmp_path_factory):
    """A cluster."""
    with ExitStack() as stack:
        yield Cluster(stack, tmp_path_factory.mktemp("dask"))


@pytest.mark.usefixtures("here")
def test_a_cluster_gives_what_one_machine_gives_though_a_worker_dies(dask):
    specs()
    assert run("batch", "specs", "--out", "undisturbed", "-q").exit_code == 2
    process = started("specs", "--scheduler", dask.address, "--timeout", 60)
    try:
        until(lambda: len(records()) >= 2)
        dask.workers[0].kill()
        _, said = process.communicate(timeout=100)
    finally:
        process.kill()
    assert process.returncode == 2, said
    assert "Traceback" not in said
    content = lasting()
    assert content["options"].pop("timeout") == 60
    undisturbed = lasting("undisturbed")
    del undisturbed["options"]["timeout"]
    assert content == undisturbed
    for record in records():
        name = record.name.replace(".record.json", ".gains.json")
        same = Path("undisturbed", record.relative_to("results").parent, name)
        assert record.with_name(name).exists() == same.exists()
    assert run("batch", "specs", "-q").exit_code == 2
    assert all(entry["up_to_date"] for entry in entries().values())


@pytest.mark.usefixtures("here")
def test_a_task_of_a_cluster_has_its_limits_and_carries_its_files():
    put("a.yaml")
    task = {"path": "a.yaml", "changes": ["observer.alpha=0.2"], "text": GOOD}
    Path("a.yaml").unlink()
    made = cluster.performed(task, {"simulate": True})
    assert list(made) == ["gains", "csv", "png", "record"]
    assert b'"alpha":' in made["gains"]
    late = cluster.performed({**task, "changes": [], "text": endless()}, {"timeout": 0.5})
    assert list(late) == ["record"]
    assert b'"status": "timeout"' in late["record"]


class Failed:
    """What Dask has of a task whose workers died."""

    status = "error"

    def exception(self):
        return RuntimeError("the worker died")


class Finished:
    """What Dask has of a task that was done."""

    status = "finished"

    def result(self):
        return cluster.performed({"path": "a.yaml", "changes": [], "text": GOOD}, {})


@pytest.mark.usefixtures("here")
def test_what_a_cluster_does_not_do_is_told(monkeypatch):
    put("a.yaml")
    result = cluster.result_of(Failed(), Task("a.yaml"), "tcp://x")
    assert (result.entry["status"], result.entry["exit_code"]) == ("crashed", 1)
    assert result.entry["problems"][0]["message"] == "the cluster did not do it: RuntimeError('the worker died')"
    assert cluster.result_of(Finished(), Task("a.yaml"), "tcp://x").entry["status"] == "certified"
    with monkeypatch.context() as full:
        full.setattr(cluster, "performed", lambda *_: {})  # as where a disk there is full
        result = cluster.result_of(Finished(), Task("a.yaml"), "tcp://x")
        assert (result.entry["status"], result.entry["exit_code"]) == ("crashed", 1)
    monkeypatch.setattr(cluster, "tool", lambda: {**tool(), "version": "9"})
    with pytest.raises(cluster.UsageError, match=r"^--scheduler tcp://x: version of the tool differs there"):
        cluster.result_of(Finished(), Task("a.yaml"), "tcp://x")
    assert list(cluster.run("tcp://x", [], Options(), Path())) == []


@pytest.mark.usefixtures("here")
def test_a_cluster_that_is_not_there_is_told_in_one_line(monkeypatch):
    put("a.yaml")
    monkeypatch.setitem(sys.modules, "distributed", None)
    outcome = run("batch", "a.yaml", "--scheduler", "tcp://127.0.0.1:1")
    assert outcome.exit_code == 2
    assert outcome.stderr == "--scheduler: Dask is not installed; pip install 'obsdesign[dask]' [OBS910]\n"


@pytest.mark.usefixtures("here")
def test_a_scheduler_that_does_not_answer_is_told_in_one_line():
    pytest.importorskip("distributed", reason="Dask is not installed")
    put("a.yaml")
    process = started("a.yaml", "--scheduler", "tcp://127.0.0.1:1")
    _, said = process.communicate(timeout=60)
    assert process.returncode == 2
    assert said == "--scheduler tcp://127.0.0.1:1: no Dask scheduler answers there within 5 s [OBS910]\n"
    outcome = run("batch", "a.yaml", "--scheduler", "127.0.0.1:1")
    assert outcome.exit_code == 2
    assert (
        outcome.stderr
        == "--scheduler 127.0.0.1:1: expected tcp://HOST:8786, the address of a Dask scheduler [OBS901]\n"
    )
