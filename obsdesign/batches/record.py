"""What came of a spec, on disk: written after its results, so that it is there only where these are complete.

A record is one entry of the summary, with what it rests on: the tool, the options, and the hashes of its files.
"""

import hashlib
import json
import os
import platform
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import asdict
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from obsdesign import __version__
from obsdesign.batches.find import MOST, SUMMARY, Task, titled
from obsdesign.batches.form import Entry, agrees, parsed, sound
from obsdesign.disk import content_of, remove_strays, write_all
from obsdesign.errors import EXIT, ObsdesignError, Problem, UsageError
from obsdesign.records import dataclass, field, replace

FORMAT = 1
ENDINGS = {"gains": ".gains.json", "csv": ".run.csv", "png": ".run.png"}  # of the files of a spec
RECORD = ".record.json"
installed = cache(version)  # of a package, whose files are read for it
LARGEST = 2**30  # bytes of a file that is read back
WITH_GAINS = EXIT.keys() - {"uncertified"}  # statuses that hold only with a result file: an undecided spec has none
LIMITS = ("timeout", "memory")  # options that end a spec, and the statuses that it ends with
VOLATILE: Entry = {"time_s": 0.0, "up_to_date": False, "why": None, "recorded": []}  # may differ between two runs
BROKEN = {"crashed": "it crashed", "timeout": "it was late", "memory": "it lacked memory"}  # what another try may give


@dataclass(frozen=True)
class Options:
    """What a result depends on besides its spec and the tool; not on the limits, for what they end has no result."""

    solver: str = "clarabel"
    simulate: bool = False
    timeout: float = 600  # s a spec
    memory: float | None = None  # MiB a spec

    @property
    def lasting(self) -> dict[str, Any]:
        """Options that matter to a result."""
        return {k: v for k, v in asdict(self).items() if k not in LIMITS}


@dataclass
class Result:
    """What came of a spec: its entry, and its files by the names that the entry has for them."""

    entry: Entry
    files: Mapping[str, bytes] = field(default_factory=dict)
    read: Mapping[str, str | None] = field(default_factory=dict)  # hashes of the files of signals that its run followed


def printable(text: str) -> str:
    """Text that has a UTF-8 form; what stood for bytes of the name of a file is written out."""
    return text.encode(errors="backslashreplace").decode()


def entry_of(task: Task, status: str, exit_code: int | None, *problems: Problem, **more: Any) -> Entry:
    """Entry of a spec, to be filled."""
    return {
        "path": printable(task.path),
        "set": [printable(change) for change in task.changes],
        "sha256": None,
        "status": status,
        "exit_code": exit_code,
        "as_expected": False if status != "skipped" else None,
        "verified": None,
        "up_to_date": False,
        "why": None,
        "expected": [],
        "recorded": [],
        "guarantee": {},
        "problems": [written(problem) for problem in problems],
        "files": {},
        "time_s": 0.0,
        **more,
    }


def written(problem: Problem) -> dict[str, Any]:
    """Problem as JSON has it: what is known of it."""
    known = {key: value for key, value in problem.written().items() if value}
    return {key: printable(value) if isinstance(value, str) else value for key, value in known.items()}


def tool() -> dict[str, str]:
    """What designs."""
    return {"version": __version__, "python": platform.python_version(), "cvxpy": installed("cvxpy")}


def digest_of(content: bytes) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(content).hexdigest()


def digest_of_list(tasks: Iterable[Task]) -> str:
    """SHA-256 of the paths and changes of specs, whatever their order."""
    names = sorted([printable(task.path), *map(printable, task.changes)] for task in tasks)
    return digest_of(json.dumps(names).encode())


def folder_of(out: Path, task: Task) -> Path:
    """Folder of the results of a spec, made where there is none, without what a killed run left half-written.

    Raises `UsageError`: it cannot be made, or a link in it leads out of `out`.
    """
    folder = out / task.place
    try:
        if not folder.resolve().is_relative_to(out.resolve()):
            said = f"its results would leave {out}: a link leads to {folder.resolve()}"
            raise UsageError(Problem(said, task.path, id="OBS912"))
        folder.mkdir(parents=True, exist_ok=True)
        remove_strays(folder)
    except OSError as error:
        said = f"{folder}: cannot be made or written: {error.strerror}"
        raise UsageError(Problem(said, task.path, id="OBS902")) from None
    return folder


def cleared(task: Task, kinds: Collection[str], out: Path) -> dict[str, Path]:
    """Paths of the results of a spec, in a folder that holds none of an earlier run but of these kinds, as files.

    A link or a pipe is no result: what it leads to is not written. Raises `UsageError`: they cannot be written.
    """
    folder = folder_of(out, task)
    paths = paths_of(task, folder)
    try:
        for kind, path in paths.items():
            if os.path.lexists(path) and (kind not in kinds or os.path.islink(path) or not os.path.isfile(path)):
                path.unlink()
    except OSError as error:
        raise UsageError(Problem(f"its results cannot be written: {error.strerror}", task.path, id="OBS902")) from None
    return paths


def paths_of(task: Task, folder: Path) -> dict[str, Path]:
    """Paths in a folder of all that may come of a spec, by their kinds; at last the record."""
    return {kind: folder / f"{task.name}{ending}" for kind, ending in {**ENDINGS, "record": RECORD}.items()}


def is_result(path: str, folders: Iterable[str]) -> bool:
    """Whether a path has the name of a result of a spec, or is that of a summary below one of some folders."""
    file = Path(os.path.realpath(path))
    inside = any(file.is_relative_to(os.path.realpath(folder)) for folder in folders)
    return file.name.endswith((RECORD, *ENDINGS.values())) or (inside and file.name == SUMMARY)


def keep(result: Result, task: Task, options: Options, out: Path) -> Entry:
    """Write the files of a spec, then its record; each whole or not at all. Returns the entry.

    Raises `UsageError`: they cannot be written.
    """
    paths = cleared(task, {*result.files, "record"}, out)
    names = {kind: f"{task.name}{ENDINGS[kind]}" for kind in result.files}
    write_all({str(paths[kind]): content for kind, content in result.files.items()})
    entry = {**result.entry, "files": {kind: str(Path(task.place, name)) for kind, name in names.items()}}
    record = {
        "obsdesign": FORMAT,
        "tool": tool(),
        "options": options.lasting,
        "hashes": {kind: digest_of(content) for kind, content in result.files.items()},
        "read": dict(result.read),
        "entry": entry,
    }
    write_all({str(paths["record"]): to_bytes(record)})
    return entry


def kept(result: Result, task: Task, options: Options, out: Path) -> Entry:
    """Entry of a result that is written; where it cannot be, it says so, and there is no record."""
    try:
        return keep(result, task, options, out)
    except UsageError as error:
        problems = [written(replace(one, file=one.file or task.path)) for one in error.problems]
        return {**entry_of(task, "invalid", error.exit_code), "problems": problems}


def to_bytes(value: Any) -> bytes:
    """JSON of one line."""
    return json.dumps(value, allow_nan=False).encode() + b"\n"


def read(out: Path, task: Task) -> dict[str, Any] | None:
    """Record of a spec; None where there is none that can be read."""
    return opened(out / task.place / f"{task.name}{RECORD}")


def opened(path: Path) -> dict[str, Any] | None:
    """Record at a path; None where there is none that can be read."""
    try:
        record = parsed(content_of(str(path), LARGEST)) if os.path.isfile(path) else None
    except (ValueError, UsageError):
        return None
    if not isinstance(record, dict) or record.get("obsdesign") != FORMAT:
        return None
    entry = sound(record.get("entry"))
    whole = all(isinstance(record.get(part), dict) for part in ("tool", "options", "hashes"))
    if entry is None or not agrees(entry) or not whole or entry["files"].keys() != record["hashes"].keys():
        return None
    return {**record, "entry": entry}


def reason(record: Mapping[str, Any] | None, task: Task, options: Options, out: Path) -> str | None:
    """Why a spec is to be run; None where its record is up to date."""
    return "never run" if record is None else next(reasons(record, task, options, out), None)


def reasons(record: Mapping[str, Any], task: Task, options: Options, out: Path) -> Iterator[str]:
    """What speaks against a record, the plainest first."""
    entry = record["entry"]
    if (title := titled(entry["path"], entry["set"])) != printable(task.title):
        yield f"these are the results of {title}"
    if entry["sha256"] != sha256(task):
        yield "the spec changed"
    if entry["status"] in BROKEN:
        yield BROKEN[entry["status"]]
    if changed := differing(record["tool"], tool()):
        yield f"{changed} of the tool changed"
    asked = options.lasting
    asked |= {"simulate": True} if record["options"].get("simulate") is True else {}  # a run is more than is asked
    if changed := differing(record["options"], asked):
        yield f"{changed} changed"
    if (entry["status"] in WITH_GAINS or entry["verified"] is not None) and "gains" not in entry["files"]:
        yield "its gains file is missing"
    yield from (f"{name} was changed" for name in moved(record, task))
    yield from spoiled(record, task, out)


def moved(record: Mapping[str, Any], task: Task) -> Iterator[str]:
    """Files of signals that the run of a record followed, and that are others by now."""
    read, folder = record.get("read"), Path(task.path).parent
    for name, digest in read.items() if isinstance(read, dict) else ():
        if digest_at(Path(os.path.realpath(folder / name))) != digest:
            yield printable(name)


def spoiled(record: Mapping[str, Any], task: Task, out: Path) -> Iterator[str]:
    """Which files of a record are missing or were changed since."""
    for kind in record["entry"]["files"]:
        path = Path(task.place, f"{task.name}{ENDINGS[kind]}")
        found = digest_at(out / path)
        if found is None:
            yield f"{path} is missing"
        elif found != record["hashes"][kind]:
            yield f"{path} was changed"


def digest_at(path: Path) -> str | None:
    """SHA-256 of the file at a path; None where there is none that can be read, or a link."""
    try:
        whole = os.path.isfile(path) and not os.path.islink(path)
        return digest_of(content_of(str(path), LARGEST)) if whole else None
    except UsageError:
        return None


def samples_of(gains: Path) -> Path | None:
    """Samples of the run that a batch made with a result file, beside it.

    None where its record has none, or where either of the two files is not the one that was recorded: then it is not
    known of which gains, and of which run, the samples are.
    """
    name = gains.name.removesuffix(ENDINGS["gains"])
    record = opened(gains.with_name(f"{name}{RECORD}"))
    if record is None or "csv" not in record["hashes"]:
        return None
    paths = {kind: gains.with_name(f"{name}{ENDINGS[kind]}") for kind in ("gains", "csv")}
    whole = all(digest_at(path) == record["hashes"].get(kind) for kind, path in paths.items())
    return paths["csv"] if whole else None


def differing(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Keys whose values differ."""
    return ", ".join(key for key in {**before, **now} if before.get(key) != now.get(key))


def sha256(task: Task) -> str | None:
    """Hash of a spec; None where it cannot be read."""
    try:
        return digest_of(content_of(task.path, MOST) if task.text is None else task.text.encode())
    except UsageError:
        return None


def failure(error: ObsdesignError) -> str:
    """Status of a spec that ended with an error."""
    return {2: "invalid", 3: "infeasible", 4: "uncertified"}.get(error.exit_code, "crashed")
