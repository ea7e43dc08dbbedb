"""The page: entries of one file or of a folder, set by the templates of this package."""

import base64
import datetime
import hashlib
import os
from collections.abc import Callable, Mapping
from functools import cache, cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from obsdesign import __version__
from obsdesign.batches.find import SUMMARY
from obsdesign.batches.record import RECORD, WITH_GAINS
from obsdesign.batches.summary import opened as summary
from obsdesign.design import Design
from obsdesign.disk import below, write_whole
from obsdesign.errors import NOT_ONE_LINE, ObsdesignError, Problem, UndecidedError, UsageError
from obsdesign.files import ResultFile
from obsdesign.records import dataclass
from obsdesign.reports.entry import Entry, Missing, opened, unread
from obsdesign.reports.expected import told_of
from obsdesign.reports.papers import DRAWING, PAPERS, Paper, paper_of
from obsdesign.tables.text import at_least, at_most

GAINS = ".gains.json"  # ends the names of result files
UNREADABLE = "�"  # stands for what cannot be printed


@dataclass(frozen=True)
class Item:
    """A figure or a table of a paper, and the entries that make it again."""

    name: str
    shows: str
    entries: tuple[Entry, ...]

    @property
    def drawing(self) -> bool:
        """Whether there is nothing to compute."""
        return self.shows == DRAWING


@dataclass(frozen=True)
class Report:
    """A page on result files; `html` is all of it."""

    source: str
    entries: tuple[Entry, ...]
    missing: tuple[Missing, ...] = ()
    single: bool = False

    @cached_property
    def html(self) -> str:
        """The page, with all that it needs."""
        style, script = (
            Markup(files(__package__).joinpath("templates", n).read_text()) for n in ("page.css", "page.js")
        )
        return (
            environment()
            .get_template("page.html")
            .render(
                report=self,
                style=style,
                script=script,
                hashes={"style": fingerprint(style), "script": fingerprint(script)},
                made=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
                version=__version__,
            )
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the page, whole or not at all. Raises `UsageError`: the folder does not exist or may not be written."""
        write_whole(os.fspath(path), self.html.encode())

    @property
    def failure(self) -> ObsdesignError | None:
        """What is wrong with the files that it shows: some are not valid, or claim what is not proved."""
        invalid = [problem for one in self.missing for problem in one.problems]
        broken = ((entry.broken, entry.file.path) for entry in self.entries if entry.broken)
        unproved = [Problem(f"the claim is {said}", path, id="OBS708") for said, path in broken]
        if invalid:
            return UsageError(*invalid, *unproved)
        return UndecidedError(*unproved) if unproved else None

    @property
    def counts(self) -> dict[str, int]:
        """How many there are of each status."""
        found = [*(entry.status for entry in self.entries), *(one.status for one in self.missing)]
        return {status: found.count(status) for status in dict.fromkeys(found)}

    @property
    def families(self) -> list[str]:
        """Types of observers that occur."""
        return sorted({entry.family for entry in self.entries})

    @cached_property
    def papers(self) -> list[tuple[Paper, list[Item]]]:
        """Every paper that an entry makes something of again, with all of its items."""
        makers = [(paper_of(e.design.spec.source), e) for e in self.entries if e.design.spec.reproduces]
        found = []
        for paper in PAPERS:
            own = [entry for cited, entry in makers if cited is paper]
            named = dict.fromkeys([*paper.items, *(name for entry in own for name in entry.design.spec.reproduces)])
            made = {n: tuple(e for e in own if n in e.design.spec.reproduces) for n in named}
            items = [Item(name, paper.items.get(name, "not in the list of this tool"), made[name]) for name in named]
            found += [(paper, items)] if own else []
        return found

    @property
    def without(self) -> list[str]:
        """Items of these papers that no entry makes again."""
        listed = ((paper, item) for paper, items in self.papers for item in items)
        return [f"{paper.name}, {item.name}" for paper, item in listed if not item.entries and not item.drawing]


def report(
    source: Design | str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    progress: Callable[[float, str], None] = lambda *_: None,
) -> Report:
    """Make a page of a result file, of a design, or of every `*.gains.json` below a folder.

    Every claim is proved anew, and the simulation of its spec is run; of a folder, the `NAME.run.csv` that a batch
    recorded with a file is read instead, as long as neither was changed since, and what `summary.json` of a batch tells
    of specs without a result is shown.

    `output`: where the page is written; `progress`: called with the fraction that is done, and with what is being done.
    Raises `UsageError`: the file is malformed, the folder holds no result, or the page cannot be written.
    """
    if isinstance(source, Design):
        made = Report("this design", (Entry.of(ResultFile("this design", source.text()), "r1", False),), single=True)
    elif os.path.isdir(source):
        made = of_folder(Path(source), progress)
    else:
        made = Report(os.fspath(source), (Entry.of(ResultFile.open(os.fspath(source)), "r1", False),), single=True)
    if output is not None:
        made.save(output)
    return made


def of_folder(folder: Path, progress: Callable[[float, str], None]) -> Report:
    """Page on a folder; hidden folders are left out."""
    paths = sorted(path for path in map(Path, below(str(folder), (GAINS,))) if not path.name.startswith("."))
    told, listed = of_batch(folder / SUMMARY)
    gone = [path for path in paths if listed is not None and path not in listed and of_earlier(path)]
    paths = [path for path in paths if path not in gone]
    told += [Missing(str(path), "left over", "no spec of the last batch, see summary.json, gave it") for path in gone]
    if not paths and not told:
        said = f"holds no result: no *{GAINS} in it or below; `obsdesign solve` writes one"
        raise UsageError(Problem(said, str(folder), id="OBS903"))
    read = []
    for i, path in enumerate(paths, start=1):
        progress((i - 1) / len(paths), path.name)
        read.append(opened(str(path), f"r{i}", samples=True))
    entries = tuple(one for one in read if isinstance(one, Entry))
    return Report(str(folder), entries, (*(one for one in read if isinstance(one, Missing)), *told))


def of_batch(path: Path) -> tuple[list[Missing], set[Path] | None]:
    """Specs that gave no result file, of a summary, and the files of the others; None: there is none, or it is none."""
    try:
        specs = summary(str(path))["specs"] if os.path.isfile(path) else None
    except UsageError as error:
        return [unread(str(path), error)], None
    told = [without_result(spec) for spec in specs or () if "gains" not in spec["files"]]
    return told, None if specs is None else {path.parent / spec["files"].get("gains", "") for spec in specs}


def without_result(spec: Mapping[str, Any]) -> Missing:
    """What a summary says of a spec that gave no result file; a status that holds only with one is none."""
    if spec["status"] in WITH_GAINS:
        said = f"{SUMMARY} says {spec['status']}, but names no result file: nothing of it is proved"
        return Missing(spec["path"], "no result", said)
    said = "; ".join(problem["message"] for problem in spec["problems"])
    return Missing(spec["path"], f"no result: {spec['status']}", f"{SUMMARY} says: {said or 'nothing'}")


def of_earlier(path: Path) -> bool:
    """Whether a batch made a result file: its record stands beside it."""
    return path.with_name(path.name.removesuffix(GAINS) + RECORD).is_file()


@cache
def environment() -> Environment:
    """Templates of this package, compiled once: everything is escaped, and a name that is not known is an error."""
    made = Environment(
        loader=PackageLoader("obsdesign.reports"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=readable,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {"at_most": at_most, "at_least": at_least, "told": told_of}
    return made


def readable(value: Any) -> Any:
    """Text of others without the characters that turn a line around or cannot be printed."""
    if type(value) is not str:
        return value
    return "\n".join(NOT_ONE_LINE.sub(UNREADABLE, line) for line in value.split("\n"))


def fingerprint(text: str) -> str:
    """Hash by which the content security policy of the page knows its own style and script."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
