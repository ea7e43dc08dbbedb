"""Tasks on a Dask cluster, each in a process of its own there; what comes of them is written here.

A task carries its text and its result its files, so that the machines share no folder. One whose worker dies is begun
once more elsewhere, by Dask.
"""

import json
import logging
import re
from collections import deque
from collections.abc import Callable, Generator, Iterable
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from obsdesign.batches import workers
from obsdesign.batches.find import Task
from obsdesign.batches.form import Entry
from obsdesign.batches.perform import perform
from obsdesign.batches.record import ENDINGS, RECORD, Options, Result, differing, entry_of, kept, sha256, tool
from obsdesign.errors import Problem, UsageError
from obsdesign.sections.source import text_of

ADDRESS = re.compile(r"(tcp|tls|wss?)://[^\s/]+:\d{1,5}", re.ASCII)
PATIENCE = 5  # s until a scheduler has answered
AHEAD = 2  # tasks that are under way or wait on the cluster, for each of its threads


def run(
    address: str,
    tasks: Iterable[Task],
    options: Options,
    out: Path,
    begun: Callable[[Task], None] = lambda _: None,
) -> Generator[tuple[Task, Entry]]:
    """Tasks as they end, with their entries; what is under way ends with the iterator.

    Raises `UsageError`: Dask is not installed, no scheduler answers, or its workers have another version of the tool.
    """
    waiting = deque(tasks)
    if not waiting:
        return
    client = connected(address)
    from distributed import as_completed

    under_way: dict[Any, Task] = {}
    ended = as_completed(loop=client.loop)
    try:
        while waiting or under_way:
            while waiting and len(under_way) < AHEAD * max(1, sum(client.nthreads().values())):
                task = waiting.popleft()
                begun(task)
                try:
                    carried = replace(task, text=text_of(task.path))
                except UsageError:
                    yield task, kept(perform(task, options), task, options, out)
                    continue
                future = client.submit(performed, asdict(carried), asdict(options), pure=False)
                under_way[future] = task
                ended.add(future)
            if under_way:
                future = next(ended)
                task = under_way.pop(future)
                yield task, kept(result_of(future, task, address), task, options, out)
    finally:
        client.cancel(list(under_way))
        client.close()


def connected(address: str) -> Any:
    """Client of a scheduler. Raises `UsageError`: see `run`."""
    if not ADDRESS.fullmatch(address):
        said = "expected tcp://HOST:8786, the address of a Dask scheduler"
        raise UsageError(Problem(said, f"--scheduler {address}", id="OBS901"))
    try:
        from distributed import Client
    except ImportError:
        raise UsageError("--scheduler: Dask is not installed; pip install 'obsdesign[dask]'", id="OBS910") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what is lost is told by its entry
    try:
        return Client(address, timeout=PATIENCE, set_as_default=False)
    except OSError:
        said = f"no Dask scheduler answers there within {PATIENCE} s"
        raise UsageError(Problem(said, f"--scheduler {address}", id="OBS910")) from None


def performed(task: dict[str, Any], options: dict[str, Any]) -> dict[str, bytes]:
    """Files of a task, its record among them: run on the cluster, with the limits that a batch has on one machine."""
    asked = Task(task["path"], tuple(task["changes"]), task["text"])
    with TemporaryDirectory() as folder:
        list(workers.run([asked], Options(**options), Path(folder), 1))
        endings = {**ENDINGS, "record": RECORD}
        paths = {kind: Path(folder, asked.place, f"{asked.name}{ending}") for kind, ending in endings.items()}
        return {kind: path.read_bytes() for kind, path in paths.items() if path.is_file()}


def result_of(future: Any, task: Task, address: str) -> Result:
    """What came of a task. Raises `UsageError`: another version of the tool made it."""
    if future.status != "finished":
        said = f"the cluster did not do it: {future.exception()!r}"
        return Result(entry_of(task, "crashed", 1, Problem(said, task.path, id="OBS909"), sha256=sha256(task)))
    files = future.result()
    if "record" not in files:
        said = "the cluster did not do it: no results could be written there"
        return Result(entry_of(task, "crashed", 1, Problem(said, task.path, id="OBS909"), sha256=sha256(task)))
    record = json.loads(files.pop("record"))
    if changed := differing(record["tool"], tool()):
        said = f"{changed} of the tool differs there; the workers need what is installed here"
        raise UsageError(Problem(said, f"--scheduler {address}", id="OBS910"))
    return Result({**record["entry"], "sha256": sha256(task)}, files)
