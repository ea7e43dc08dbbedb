"""Summary of a batch: one entry a spec, how many ended how, and the exit code of all."""

import datetime
import json
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import IO, Any

from obsdesign.batches.find import SUMMARY, Task, is_shard
from obsdesign.batches.form import CODES, STATUSES, Entry, is_number, parsed, sound
from obsdesign.batches.record import FORMAT
from obsdesign.disk import STAGED, content_of, umask
from obsdesign.errors import EXIT, Problem, UsageError
from obsdesign.records import dataclass

WORST = (1, 2, 4, 3)  # exit codes, the worst first
LARGEST = 2**30  # bytes that are read
INTERRUPTED = 130  # exit code


@dataclass(frozen=True)
class Summary:
    """What `summary.json` says; its entries are read from it one by one."""

    path: str
    exit_code: int
    counts: Mapping[str, int]
    time_s: float

    @property
    def specs(self) -> Iterator[Entry]:
        """Entry of every spec, sorted by path; of a file that `write` wrote."""
        with Path(self.path).open(encoding="utf-8") as lines:
            yield from (json.loads(line.strip().rstrip(",")) for line in lines if line.startswith('    {"path": '))

    @property
    def report(self) -> dict[str, Any]:
        """All of it."""
        return opened(self.path)

    def __str__(self) -> str:
        from obsdesign.batches.table import rows

        return "\n".join(rows(self))


class Tally:
    """Counts and exit code of the entries of tasks, as they come; of one that comes again the last counts."""

    def __init__(self) -> None:
        self.ends = dict[Task, tuple[str, bool]]()  # status, and whether it is as expected
        self.codes: set[int] = set()

    def add(self, task: Task, entry: Mapping[str, Any]) -> None:
        """Count one entry."""
        self.ends[task] = entry["status"], bool(entry["as_expected"])
        if entry["as_expected"] is False:
            self.codes.add(own_code(entry))

    @property
    def exit_code(self) -> int:
        """0 where all are as expected, else the worst of the others."""
        return next((code for code in WORST if code in self.codes), 0)

    def written(self) -> dict[str, int]:
        """Entry `counts`."""
        statuses = Counter(status for status, _ in self.ends.values())
        fine = sum(as_expected for _, as_expected in self.ends.values())
        return {"total": len(self.ends), "as_expected": fine, **{name: statuses[name] for name in STATUSES}}


def own_code(entry: Mapping[str, Any]) -> int:
    """Exit code that a spec which is not as expected counts with: its own, 4 where its own would be right."""
    wanted = next((one["expected"] for one in entry["expected"] if one["key"] == "status"), "certified")
    return 4 if entry["exit_code"] in (0, EXIT.get(str(wanted))) else int(entry["exit_code"])


def write(out: Path, tally: Tally, head: Mapping[str, Any], entries: Iterable[Entry], exit_code: int) -> Summary:
    """Write `summary.json` entry by entry, whole or not at all. Raises `UsageError`: it cannot be written."""
    created = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    told = {"created": created, "time_s": head["time_s"], "exit_code": exit_code, "counts": tally.written()}
    asked = {key: head[key] for key in ("tool", "options", "list_sha256")}
    whole = {"obsdesign": FORMAT, **asked, **told}
    path = out / SUMMARY
    with whole_or_not(path) as file:
        file.write("{\n")
        for key, value in whole.items():
            file.write(f'  "{key}": {text(value)},\n')
        file.write('  "specs": [')
        for i, entry in enumerate(entries):
            file.write(f"{',' if i else ''}\n    {text(entry)}")
        file.write("\n  ]\n}\n")
    return Summary(str(path), exit_code, told["counts"], head["time_s"])


@contextmanager
def whole_or_not(path: Path) -> Iterator[IO[str]]:
    """Text file that takes its name once it is complete. Raises `UsageError`: it cannot be written."""
    try:
        with NamedTemporaryFile(
            "w", dir=path.parent, prefix=STAGED, delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            temporary = Path(file.name)
            try:
                yield file
                file.flush()
                temporary.chmod(0o666 & ~umask())
                temporary.replace(path)
            finally:
                temporary.unlink(missing_ok=True)
    except OSError as error:
        raise UsageError(Problem(f"cannot be written: {error.strerror}", str(path), id="OBS902")) from None


def text(value: Any) -> str:
    """JSON of one line."""
    return json.dumps(value, allow_nan=False)


def opened(source: str) -> dict[str, Any]:
    """Content of a summary, given by its path or its folder.

    Raises `UsageError`: there is none, or it is no summary of this format.
    """
    path = str(Path(source, SUMMARY)) if os.path.isdir(source) else source
    if os.path.exists(path) and not os.path.isfile(path):  # a pipe, of which nothing might ever come
        raise UsageError(Problem("is no file; give the summary of a batch, or its folder", path, id="OBS911"))
    try:
        content: dict[str, Any] = parsed(content_of(path, LARGEST))
    except ValueError as error:
        raise UsageError(Problem(f"not JSON: {error}", path, id="OBS911")) from None
    content = content if isinstance(content, dict) else {}
    entries = [sound(entry) for entry in specs] if isinstance(specs := content.get("specs"), list) else [None]
    whole = all(isinstance(content.get(part), dict) for part in ("tool", "options", "counts"))
    shard = content["options"].get("shard") if whole else None
    whole = whole and is_number(content.get("time_s")) and (shard is None or is_shard(shard))
    whole = whole and content.get("exit_code") in (*CODES, INTERRUPTED)
    if not whole or None in entries or content.get("obsdesign") != FORMAT:
        said = "is no summary of a batch; `obsdesign batch` writes one, summary.json"
        raise UsageError(Problem(said, path, id="OBS911"))
    return {**content, "specs": entries}
