"""Results of the shards of one batch, made one as if there had been no shards."""

import os
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path, PurePath
from typing import Any

from obsdesign.batches.find import SUMMARY, Task, parted
from obsdesign.batches.form import Entry, agrees
from obsdesign.batches.record import (
    ENDINGS,
    RECORD,
    VOLATILE,
    cleared,
    differing,
    digest_of_list,
    paths_of,
    read,
    spoiled,
)
from obsdesign.batches.summary import INTERRUPTED, Summary, Tally, opened, write
from obsdesign.disk import write_all
from obsdesign.errors import EXIT, Problem, UsageError

SHOWN = 10  # shards that are missing, in a message


def merge(sources: Iterable[str | os.PathLike[str]], out: Path) -> Summary:
    """Copy the results of shards, given by their folders or summaries, to one folder, and write its summary.

    Raises `UsageError`: one is no summary, they are not of one batch, a shard or an entry is missing, two say different
    things of a spec, or the results of one that was solved are not whole.
    """
    paths = [os.fspath(source) for source in sources]
    contents = {path: opened(path) for path in paths}
    require_one_batch(contents)
    found: dict[Task, tuple[str, Entry]] = {}
    for source, content in contents.items():
        for entry in content["specs"]:
            require_new(entry, source, found)
            found[task_of(entry)] = source, entry
    require_whole_list(contents, found)
    tally, first = Tally(), contents[paths[0]]
    for task, (_, entry) in found.items():
        tally.add(task, entry)
    entries = (copied(*found[task], out) for task in sorted(found))
    head: dict[str, Any] = {"tool": first["tool"], "options": {**first["options"], "shard": None}}
    head["list_sha256"] = digest_of_list(found)
    head["time_s"] = max(content["time_s"] for content in contents.values())
    if os.path.realpath(out) not in {os.path.realpath(folder(path)) for path in paths}:
        (out / SUMMARY).unlink(missing_ok=True)  # of an earlier batch, which whatever ends this one would leave
    code = INTERRUPTED if any(content["exit_code"] == INTERRUPTED for content in contents.values()) else tally.exit_code
    return write(out, tally, head, entries, code)


def folder(source: str) -> Path:
    """Folder of a summary, given by its path or its folder."""
    return Path(source) if os.path.isdir(source) else Path(source).parent


def task_of(entry: Entry) -> Task:
    """Task whose entry this is."""
    return Task(str(entry["path"]), tuple(map(str, entry.get("set", ()))))


def require_one_batch(contents: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse what was not made by one tool with the same options, and shards one of which is missing."""
    (path, first), *others = contents.items()
    for other, content in others:
        before, now = ({**one["options"], **one["tool"], "shard": None} for one in (first, content))
        if changed := differing(before, now):
            said = f"differs from {path} in {changed}; shards are of one batch"
            raise UsageError(Problem(said, other, id="OBS911"))
    parts = {path: content for path, content in contents.items() if content["options"].get("shard")}
    require_one_list(parts)
    shards = [parted(content["options"]["shard"]) for content in parts.values()]
    for count in {count for _, count in shards}:
        missing = sorted(set(range(1, count + 1)) - {index for index, of in shards if of == count})
        if missing:
            more = [f"and {len(missing) - SHOWN} more"] if len(missing) > SHOWN else []
            shown = ", ".join([*(f"{index}/{count}" for index in missing[:SHOWN]), *more])
            raise UsageError(f"--merge: of the shards, {shown} missing", id="OBS911")


def require_one_list(shards: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse shards of different specs: one of them might be in none. A summary of old says nothing of its list."""
    lists = [(path, content["list_sha256"]) for path, content in shards.items() if "list_sha256" in content]
    for other, digest in lists[1:]:
        if digest != lists[0][1]:
            said = f"is a shard of other specs than {lists[0][0]}; run both with the same paths, --set and --exclude"
            raise UsageError(Problem(said, other, id="OBS911"))


def require_whole_list(contents: Mapping[str, Mapping[str, Any]], found: Mapping[Task, tuple[str, Entry]]) -> None:
    """Refuse summaries that lack an entry of the list of specs whose hash they carry, or have one that it lacks."""
    for source, content in contents.items():
        if content["counts"].get("total") != (number := len(content["specs"])):
            said = f"says that there are {content['counts'].get('total')} specs, and holds {number}; run it again"
            raise UsageError(Problem(said, source, id="OBS911"))
        listed = found if content["options"].get("shard") else map(task_of, content["specs"])
        if "list_sha256" not in content or content["list_sha256"] == digest_of_list(listed):
            continue
        lost = [path for path in {*contents} for path in unnamed(path, found)]
        near = f"; no summary names what is in {', '.join(sorted(lost)[:SHOWN])}" if lost else ""
        said = f"its list_sha256 is not that of the specs in these summaries: one is missing, or was changed{near}"
        raise UsageError(Problem(f"{said}; run the shards again", source, id="OBS911"))


def unnamed(source: str, found: Iterable[Task]) -> Iterator[str]:
    """Records beside a summary that are of no spec in any."""
    place = folder(source)
    named = {paths_of(task, place / task.place)["record"] for task in found}
    yield from (str(path) for path in place.rglob(f"*{RECORD}") if path not in named)


def require_new(entry: Entry, source: str, found: Mapping[Task, tuple[str, Entry]]) -> None:
    """Refuse an entry whose path would leave the folder of results, or that contradicts itself or another."""
    task = task_of(entry)
    if ".." in PurePath(task.path).parts or not PurePath(task.path).name or not all("=" in one for one in task.changes):
        said = f"{task.title} is no path of a spec: it has no name, or leaves its folder"
        raise UsageError(Problem(said, source, id="OBS912"))
    if not agrees(entry):
        said = f"what it says of {task.title} contradicts itself; run its shard again"
        raise UsageError(Problem(said, source, id="OBS911"))
    other, known = found.get(task, ("", entry))
    if changed := differing({**known, **VOLATILE}, {**entry, **VOLATILE}):
        raise UsageError(Problem(f"differs from {other} in {changed} of {task.title}", source, id="OBS911"))


def copied(source: str, entry: Entry, out: Path) -> Entry:
    """Entry whose files are copied; none of an earlier run is left beside them."""
    task = task_of(entry)
    files = results(source, entry)
    paths = cleared(task, files, out) if files or os.path.isdir(out / task.place) else {}
    write_all({str(paths[kind]): content for kind, content in files.items()})
    names = {kind: str(Path(task.place, paths[kind].name)) for kind in ENDINGS if kind in files}
    return {**entry, "set": list(task.changes), "files": names}


def results(source: str, entry: Entry) -> dict[str, bytes]:
    """Files of a spec and its record, by their kinds; none where it ended without a record.

    Raises `UsageError`: it was solved, and one of them is missing or was changed.
    """
    task, place = task_of(entry), folder(source)
    record = read(place, task)
    if record is None:
        if entry["status"] in EXIT:
            raise UsageError(
                Problem(f"the record of {task.title} is missing; give its folder too", source, id="OBS911")
            )
        return {}
    if changed := differing({**record["entry"], **VOLATILE}, {**entry, **VOLATILE}):
        said = f"differs from the record of {task.title} in {changed}"
        raise UsageError(Problem(said, source, id="OBS911"))
    proved = entry["verified"] is not None  # of what is in the gains file
    lost = [f"the gains file of {task.title} is missing"] if proved and "gains" not in entry["files"] else []
    if wrong := next(chain(lost, spoiled(record, task, place)), None):
        raise UsageError(Problem(f"{wrong}; run its shard again", source, id="OBS911"))
    paths = paths_of(task, place / task.place)
    return {kind: paths[kind].read_bytes() for kind in (*record["hashes"], "record")}
