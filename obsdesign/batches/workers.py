"""Processes of this machine that design specs in parallel, kept warm: one that breaks is replaced by another."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import asdict
from math import inf
from multiprocessing import Pipe
from multiprocessing.connection import wait
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from obsdesign.batches.find import Task
from obsdesign.batches.form import Entry
from obsdesign.batches.record import Options, Result, entry_of, keep, printable, sha256, to_bytes, written
from obsdesign.errors import Problem, UsageError

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from obsdesign.batches.worker import main; main(int(sys.argv[2]), int(sys.argv[3]))"
)
OUT_OF_MEMORY = re.compile(r"MemoryError|memory allocation|allocate memory|bad_alloc|out of memory", re.IGNORECASE)
IDS = {"timeout": "OBS905", "memory": "OBS908", "crashed": "OBS909"}
REFUSED = (signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS)  # how a library may end that is refused memory
TAIL = 4000  # characters of what a process said last


class Worker:
    """One process, the task that it has, and when it is late."""

    def __init__(self, options: Options, out: Path) -> None:
        self.options, self.out = options, out
        self.task: Task | None = None
        self.ready = False  # its imports are done
        self.begun, self.late = 0.0, inf
        self.said = TemporaryFile()  # noqa: SIM115 -- closed with the worker
        self.connection, theirs = Pipe()
        with theirs:
            fd = theirs.fileno()
            self.process = subprocess.Popen(
                [sys.executable, "-c", START, json.dumps(sys.path), str(fd), str(os.getpid())],
                pass_fds=[fd],
                stdin=subprocess.DEVNULL,
                stdout=self.said,
                stderr=self.said,
                env=os.environ | dict.fromkeys(THREADS, "1"),
            )

    def begin(self, task: Task) -> None:
        """Give it a task."""
        self.task, self.begun = task, time.monotonic()
        self.late = self.begun + self.options.timeout
        asked = {"task": asdict(task), "options": asdict(self.options), "out": str(self.out)}
        try:
            self.connection.send_bytes(to_bytes(asked))
        except OSError:
            return  # it is dead, as is heard in a moment

    def heard(self) -> dict[str, Any] | None:
        """What it answers; None if it died."""
        try:
            answer: dict[str, Any] = json.loads(self.connection.recv_bytes())
        except (EOFError, OSError):
            return None
        return answer

    def leave(self) -> None:
        """Let it end, at once if it is at work."""
        if self.task or not self.ready:
            self.process.kill()
        self.connection.close()

    def end(self) -> None:
        """Wait for its end."""
        self.process.wait()
        self.said.close()

    def failed(self, task: Task, *, late: bool) -> Entry:
        """Entry of a spec whose process is late, or died; with a record that says so, unless it has a result."""
        if late:
            status, said = "timeout", f"not finished after {self.options.timeout:g} s; --timeout allows more"
        else:
            status, said = self.why()
        taken = round(time.monotonic() - self.begun, 4)
        code = 1 if status == "crashed" else 4
        id = IDS[status]
        problem = Problem(said, task.path, id=id)
        made = entry_of(task, status, code, problem, sha256=sha256(task), time_s=taken)
        if task.kept:  # its files stay: another try may prove them
            return made
        try:
            return keep(Result(made), task, self.options, self.out)
        except UsageError as error:
            return {**made, "problems": made["problems"] + [written(one) for one in error.problems]}

    def why(self) -> tuple[str, str]:
        """Status and reason of a process that died."""
        code = self.process.wait()
        self.said.seek(0)
        tail = self.said.read().decode(errors="replace")[-TAIL:]
        if OUT_OF_MEMORY.search(tail):
            if self.options.memory:
                return "memory", f"needs more than {self.options.memory:g} MiB; --memory allows more"
            return "memory", "needs more memory than there is; ask for less: fewer states, fewer points"
        if self.options.memory and -code in REFUSED:
            said = f"ended with {signal.Signals(-code).name} under a limit of {self.options.memory:g} MiB"
            return "memory", f"{said}, as libraries do that are refused memory; --memory allows more"
        ending = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        last = next((line for line in reversed(tail.splitlines()) if line.strip()), "it said nothing")
        return "crashed", f"its process ended with {ending}: {printable(last)}; this is a defect of obsdesign"


def run(
    tasks: Iterable[Task],
    options: Options,
    out: Path,
    jobs: int,
    begun: Callable[[Task], None] = lambda _: None,
) -> Generator[tuple[Task, Entry]]:
    """Tasks as they end, with their entries, of at most so many at once; the processes end with the iterator.

    `begun`: called with each task that begins.
    """
    waiting, workers = deque(tasks), list[Worker]()
    try:
        while waiting or any(worker.task for worker in workers):
            for worker in workers:
                if waiting and worker.ready and not worker.task:
                    begun(waiting[0])
                    worker.begin(waiting.popleft())
            free = sum(not worker.task for worker in workers)
            if len(workers) < jobs and free < len(waiting):
                workers.append(Worker(options, out))
                continue
            yield from ended(workers)
    finally:
        for worker in workers:
            worker.leave()
        for worker in workers:
            worker.end()


def ended(workers: list[Worker]) -> Iterator[tuple[Task, Entry]]:
    """What ends next, of workers one of which is at work or begins; those that broke leave the list."""
    seconds = min(worker.late for worker in workers) - time.monotonic()
    connections: list[Any] = [worker.connection for worker in workers]
    heard: list[Any] = wait(connections, None if seconds == inf else max(seconds, 0.0))
    for worker in list(workers):
        late = time.monotonic() >= worker.late
        if worker.connection not in heard and not late:
            continue
        answer = worker.heard() if worker.connection in heard else None
        task, worker.task, worker.late = worker.task, None, inf
        if answer is not None:
            worker.ready = True
            if task:
                yield task, answer
            continue
        workers.remove(worker)
        try:
            if task is None:
                raise RuntimeError(f"a process of the batch does not start: {worker.why()[1]}")
            if late:
                worker.process.kill()
            yield task, worker.failed(task, late=late)
        finally:
            worker.leave()
            worker.end()
