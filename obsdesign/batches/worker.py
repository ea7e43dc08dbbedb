"""A process that designs one spec after another: what is imported once stays, and what breaks it breaks one spec.

It reads tasks from a pipe and answers each by its entry, once its files and its record are written. It ends with the
pipe, and with the process that began it.
"""

import json
import os
import resource
import warnings
from functools import cache
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from obsdesign.batches.find import Task
from obsdesign.batches.form import Entry
from obsdesign.batches.perform import perform
from obsdesign.batches.record import Options, kept, to_bytes
from obsdesign.batches.renew import renewed
from obsdesign.watch import deaf, with_parent

MIB = 2**20
READY = b"{}"  # first answer


def main(pipe: int, parent: int) -> None:
    """Answer tasks until there are no more."""
    deaf()  # the parent hears it
    with_parent()
    if os.getppid() != parent:
        return
    warnings.simplefilter("ignore")
    with Connection(pipe) as connection:
        connection.send_bytes(READY)
        while True:
            try:
                asked = json.loads(connection.recv_bytes())
            except EOFError:
                return
            connection.send_bytes(to_bytes(answer(asked)))


def answer(asked: dict[str, Any]) -> Entry:
    """Entry of a task: of a result that is kept, or whose files are written now; no record where they cannot be."""
    task, options, out = asked_for(**asked["task"]), Options(**asked["options"]), Path(asked["out"])
    with_memory(options.memory)
    try:
        if task.kept and (known := renewed(task, out)):
            return known
        result = perform(task, options)
    finally:
        with_memory(None)
    return kept(result, task, options, out)


def asked_for(path: str, changes: list[str], text: str | None, kept: bool) -> Task:
    """Task, of its JSON."""
    return Task(path, tuple(changes), text, kept)


def with_memory(limit: float | None) -> None:
    """Let this process have so many MiB more than it has, or any number; beyond, Python raises MemoryError."""
    if limit is not None:
        with_buffers()
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    soft = hard if limit is None else data() + int(limit * MIB)
    resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


@cache
def with_buffers() -> None:
    """Let the linear algebra of numpy and of scipy take its buffers: OpenBLAS asks for one that it lacks for ever."""
    import numpy as np
    from scipy.linalg import cholesky

    np.linalg.cholesky(np.eye(2))
    cholesky(np.eye(2))


def data() -> int:
    """Bytes of this process that RLIMIT_DATA counts (Linux)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmData:")) * 1024
