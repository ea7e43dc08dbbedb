"""Folders of specs: each solved, verified and held against what it expects, in parallel, and only where it is due.

find.py       specs below paths, and where their results go; sweep.py: with which changes; clash.py: which cannot be
perform.py    one spec, from its text to its entry and its files
record.py     that entry on disk, and whether it is up to date; renew.py: which is proved anew then
workers.py    warm processes, which may hang, crash or eat memory; worker.py: one of them; cluster.py: others, by Dask
summary.py    all entries, counts, exit code; table.py: in lines; formats.py: for other programs; merge.py: of shards
"""

import fcntl
import json
import os
import time
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Protocol

from obsdesign.batches import cluster, workers
from obsdesign.batches.clash import clashes
from obsdesign.batches.find import SUMMARY, Task, find, share, titled
from obsdesign.batches.form import Entry, agrees
from obsdesign.batches.merge import merge
from obsdesign.batches.record import (
    Options,
    digest_of_list,
    entry_of,
    moved,
    printable,
    read,
    reason,
    sha256,
    to_bytes,
    tool,
)
from obsdesign.batches.summary import INTERRUPTED, Summary, Tally, opened, write
from obsdesign.batches.sweep import combinations
from obsdesign.disk import remove_strays
from obsdesign.errors import Problem, UsageError

__all__ = ["Follower", "Summary", "batch", "held", "merge"]


class Follower(Protocol):
    """Who wants to know how a batch goes on."""

    def found(self, total: int) -> None:
        """So many specs are to be run or are up to date."""

    def begun(self, title: str) -> None:
        """One is under way, of which this is path and changes."""

    def ended(self, entry: Entry) -> None:
        """One has ended, or is up to date."""


class Nobody:
    """Follower that wants to know nothing."""

    def found(self, total: int) -> None:
        """Nothing."""

    def begun(self, title: str) -> None:
        """Nothing."""

    def ended(self, entry: Entry) -> None:
        """Nothing."""


def batch(
    paths: Iterable[str | os.PathLike[str]],
    *,
    changes: Iterable[str] = (),
    out: str | os.PathLike[str] = "results",
    jobs: int | None = None,
    simulate: bool = False,
    exclude: Iterable[str] = (),
    force: bool = False,
    fail_fast: bool = False,
    shard: str | None = None,
    changed_since: str | os.PathLike[str] | None = None,
    timeout: float = 600,
    memory: float | None = None,
    solver: str = "clarabel",
    scheduler: str | None = None,
    follower: Follower | None = None,
) -> Summary:
    """Solve, verify and (`simulate`) run every spec at and below some paths, in so many `jobs`; write `summary.json`.

    `paths`, `exclude`: see `find.find`. `changes`: other values of single keys, such as `observer.alpha=0.5`; several,
    `observer.alpha=0.1,0.5`, are all tried, in every combination, with results in folders of their own.

    `out`: folder of all results. `force`: redo what is up to date. `fail_fast`: end with the first that is not as
    expected. `shard`: "I/N", every N-th spec. `changed_since`: summary or its folder; what has the same text, changes,
    tool and options there is skipped. `timeout` (s) and `memory` (MiB) of each spec. `scheduler`: of a Dask
    cluster, tcp://HOST:8786, whose workers take the place of the `jobs`.

    Returns the summary: `exit_code`, `counts`, and `specs`, an entry each. Raises `UsageError`: there are no specs, an
    option is wrong, `out` cannot be written or another batch writes there, or no scheduler answers.
    """
    options = Options(solver, simulate, timeout, memory)
    asked = list(changes)
    found = find(paths, exclude, combinations(asked))
    if not found:
        said = "no specs found: no *.yaml or *.yml with a key `obsdesign` or `observer` that is not excluded"
        raise UsageError(said, id="OBS903")
    tasks = share(found, shard)
    told = {**asdict(options), "set": [*map(printable, asked)], "shard": shard}
    head = {"tool": tool(), "options": told, "list_sha256": digest_of_list(found)}
    with held(out) as folder:
        run = Run(tasks, options, folder, head, follower or Nobody(), clashes(found), force=force)
        if changed_since is not None:
            run.leave_out(os.fspath(changed_since))
        try:
            (folder / SUMMARY).unlink(missing_ok=True)  # of an earlier batch, which whatever ends this one would leave
            run.through(jobs or len(os.sched_getaffinity(0)), scheduler, fail_fast=fail_fast)
            return run.summarise("--fail-fast")
        except KeyboardInterrupt as stopped:
            summary = run.summarise("interrupted", INTERRUPTED)
            done = summary.counts["total"] - summary.counts["skipped"]
            said = f"{done} of {summary.counts['total']} specs are done and kept, as {summary.path} says"
            stopped.add_note(f"{said}; the same command{' without --force' * force} goes on with the others")
            raise


@contextmanager
def held(out: str | os.PathLike[str]) -> Iterator[Path]:
    """Folder of all results, without what a killed run left half-written, and kept from other batches.

    It is free again when the process ends, however that is. Raises `UsageError`: it cannot be made, or another has it.
    """
    folder = Path(out)
    with ExitStack() as locks:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            whole = folder.resolve()
            for part in (whole, *whole.parents):
                lock(part, locks, shared=part != whole)
            remove_strays(folder)
        except BlockingIOError:
            said = "another batch is writing its results here; wait for its end, or give another --out"
            raise UsageError(Problem(said, str(folder), id="OBS912")) from None
        except OSError as error:
            raise unwritable(folder, error) from None
        yield folder


def lock(folder: Path, locks: ExitStack, *, shared: bool) -> None:
    """Keep a folder from other batches, or, where it is above that of a batch, let them share it.

    Raises `BlockingIOError`: another batch has it; `OSError`: it cannot be read, unless it is shared.
    """
    try:
        number = os.open(folder, os.O_RDONLY)
    except PermissionError:
        if shared:
            return
        raise
    locks.callback(os.close, number)
    try:
        fcntl.flock(number, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except OSError as error:
        if isinstance(error, BlockingIOError):  # else a file system without locks
            raise


def unwritable(folder: Path, error: OSError) -> UsageError:
    """Error about a folder of results."""
    return UsageError(Problem(f"cannot be made or written: {error.strerror}", str(folder), id="OBS902"))


class Run:
    """One batch, as far as it is."""

    def __init__(
        self,
        tasks: list[Task],
        options: Options,
        out: Path,
        head: dict[str, Any],
        follower: Follower,
        refused: Mapping[Task, Problem],
        *,
        force: bool,
    ) -> None:
        self.tasks, self.options, self.out, self.head, self.follower = tasks, options, out, head, follower
        self.refused, self.force = refused, force
        self.due = dict[Task, str]()  # what is to be run, and why; first what is only to be proved anew
        self.why = dict[Task, str | None]()  # each that ended was run; None: it is up to date
        self.told = dict[Task, bytes]()  # entries of these and of what is skipped, as JSON, which takes little memory
        self.tally = Tally()
        self.started = time.perf_counter()

    def leave_out(self, source: str) -> None:
        """Skip what is the same in another summary, and was as expected there."""
        other = opened(source)
        wanted = {**self.options.lasting, "tool": tool()}
        if {**{key: other["options"].get(key) for key in self.options.lasting}, "tool": other["tool"]} != wanted:
            return
        done = [one for one in other["specs"] if one["as_expected"] is True and agrees(one)]
        known = {titled(one["path"], one.get("set", ())): one.get("sha256") for one in done}
        beside = Path(source) if os.path.isdir(source) else Path(source).parent
        for task in self.tasks:
            digest, record = sha256(task), read(beside, task)
            stale = record is not None and (record["entry"]["as_expected"] is not True or any(moved(record, task)))
            if digest is not None and known.get(printable(task.title)) == digest and not stale:
                self.skip(task, f"unchanged since {source}, which says that it was as expected", digest)

    def skip(self, task: Task, why: str, digest: str | None = None) -> None:
        """Leave a task out."""
        entry = entry_of(task, "skipped", None, why=printable(why), sha256=digest)
        self.told[task] = to_bytes(entry)
        self.tally.add(task, entry)

    def through(self, jobs: int, scheduler: str | None, *, fail_fast: bool) -> None:
        """Run what is not up to date."""
        asked = [task for task in self.tasks if task not in self.told]
        self.follower.found(len(asked))
        due = dict[Task, str]()
        for task in asked:
            if task in self.refused:
                entry = entry_of(task, "invalid", 2, self.refused[task], sha256=sha256(task))
                self.ended(task, entry, "it cannot be run")
                continue
            record = read(self.out, task)
            why = "--force" if self.force else reason(record, task, self.options, self.out)
            if why is not None or record is None:
                due[task] = why or ""
            else:
                self.due[replace(task, kept=True)] = "its result does not prove what its record says"
        if fail_fast and self.tally.codes:
            return
        self.due |= due
        running = self.running(jobs, scheduler)
        for task, entry in running:
            self.ended(task, entry, None if entry["up_to_date"] else self.due[task])
            if fail_fast and self.tally.codes:
                running.close()

    def running(self, jobs: int, scheduler: str | None) -> Generator[tuple[Task, Entry]]:
        """Tasks as they end, here or on a cluster; what is only to be proved anew is here."""

        def begun(task: Task) -> None:
            self.follower.begun(printable(task.title))

        here = [task for task in self.due if task.kept or scheduler is None]
        yield from workers.run(here, self.options, self.out, jobs, begun)
        if scheduler is not None:
            there = [task for task in self.due if not task.kept]
            yield from cluster.run(scheduler, there, self.options, self.out, begun)

    def ended(self, task: Task, entry: Entry, why: str | None) -> None:
        """Count what ended; its entry is kept, for someone may remove its record."""
        self.told[task] = to_bytes(entry)
        self.tally.add(task, entry)
        self.why[task] = why  # at last, so that after an interrupt nothing in it lacks anything
        self.follower.ended({**entry, "up_to_date": why is None, "why": why})

    def summarise(self, skipped: str, exit_code: int | None = None) -> Summary:
        """Write the summary; what did not end is skipped, unless its record is there before its answer."""
        unheard = {task for task in self.due if not task.kept}
        for task in self.tasks:
            if task in self.why:
                continue
            record = None if self.force else read(self.out, task)
            if task in self.told:
                self.tally.add(task, json.loads(self.told[task]))
            elif task in unheard and record and reason(record, task, self.options, self.out) is None:
                self.ended(task, record["entry"], self.due[task])
            else:
                self.skip(task, skipped)
        head = {**self.head, "time_s": round(time.perf_counter() - self.started, 3)}
        code = self.tally.exit_code if exit_code is None else exit_code
        return write(self.out, self.tally, head, self.entries(), code)

    def entries(self) -> Iterator[Entry]:
        """Entry of every task."""
        for task in self.tasks:
            entry = json.loads(self.told[task])
            why = self.why.get(task, entry["why"])
            yield {**entry, "up_to_date": task in self.why and why is None, "why": why}
