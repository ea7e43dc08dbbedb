"""Specs below paths, and where the results of each go: found in the same order, wherever the search begins."""

import glob
import os
import re
from codecs import getincrementaldecoder
from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from hashlib import sha256
from itertools import product
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote

from obsdesign import disk
from obsdesign.errors import Problem, UsageError
from obsdesign.records import dataclass, field

ENDINGS = (".yaml", ".yml")
SPEC = re.compile(rb"""(?:^|[\r{,])[ \t]*["']?(?:obsdesign|observer)["']?\s*:""", re.MULTILINE)
MOST = 4 * 2**20 + 1  # bytes that are looked at: a larger file is no spec
SUMMARY = "summary.json"  # of a batch, beside the results
NUMBER = re.compile(r"((?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)", re.ASCII)
LONGEST, KEPT = 120, 80  # characters of the folder of changes, and of one that is longer


@dataclass(frozen=True)
class Task:
    """One spec of a batch, with other values of single keys; in the order of paths, then of values as numbers."""

    path: str  # relative to the current folder where it is below it, else absolute; without `..`
    changes: tuple[str, ...] = ()  # such as observer.alpha=0.5
    text: str | None = None  # of the spec, where the file is not at hand to who designs
    kept: bool = field(default=False, compare=False)  # its result is there, and is only to be proved anew

    def __lt__(self, other: "Task") -> bool:
        return (self.path, self.values, self.changes) < (other.path, other.values, other.changes)

    @property
    def values(self) -> list[list[str | float]]:
        """Changes in texts and numbers by turns: alpha=2 comes before alpha=10."""
        parts = [NUMBER.split(change) for change in self.changes]
        return [[float(part) if i % 2 else part for i, part in enumerate(each)] for each in parts]

    @property
    def place(self) -> str:
        """Folder of its results below that of all: a/b/c of a/b/c.yaml, with changes a/b/c/observer.alpha=0.5."""
        path = PurePath(self.path)
        return str(path.relative_to(path.anchor).with_suffix("") / folder(self.changes))

    @property
    def title(self) -> str:
        """Path and changes."""
        return titled(self.path, self.changes)

    @property
    def name(self) -> str:
        """Name of the spec, without folder and ending, with which the files of its results begin."""
        return PurePath(self.path).stem


def titled(path: str, changes: Iterable[str]) -> str:
    """Name of a spec with changes."""
    return " ".join((path, *changes))


def folder(changes: Iterable[str]) -> str:
    """Name of a folder for changes, another one for others; without changes it is empty."""
    name = ",".join(quote(change, safe="=[]{}()+*", errors="surrogateescape") for change in changes)
    return name if len(name) <= LONGEST else f"{name[:KEPT]}..{sha256(name.encode()).hexdigest()[:16]}"


def find(
    paths: Iterable[str | os.PathLike[str]],
    exclude: Iterable[str] = (),
    changes: Iterable[tuple[str, ...]] = ((),),
) -> list[Task]:
    """Specs at and below paths, sorted by their paths, each once with each combination of changes.

    `paths`: folders, of which every *.yaml and *.yml that has a key `obsdesign` or `observer` is taken, and every one
    that is empty, no text or a link to nowhere (hidden folders are left out, links to folders not followed); files,
    which are taken as they are; globs of these, ** too. `exclude`: globs, each of a whole path, of a folder of it, or
    of one name in it.

    Raises `UsageError`: there is nothing at a path.
    """
    patterns = tuple(exclude)
    kept = {one for path in paths for one in below(os.fspath(path)) if not excluded(one, patterns)}
    return sorted(Task(path, combination) for path, combination in product(kept, changes))


def unmatched(paths: Iterable[str | os.PathLike[str]], exclude: Iterable[str]) -> list[str]:
    """Globs that leave no spec at or below the paths out."""
    found = [one for path in paths for one in below(os.fspath(path))]
    return [pattern for pattern in exclude if not any(excluded(one, (pattern,)) for one in found)]


def below(path: str) -> Iterator[str]:
    """Paths of the specs at one path, as a task has them."""
    for match in matches(path):
        if os.path.isdir(match):
            yield from (shortened(found) for found in disk.below(match, ENDINGS) if is_spec(found))
        elif os.path.isfile(match) or not os.path.exists(match):  # what cannot be opened says so as a spec
            yield shortened(match)
        else:
            said = "is no file and no folder; a batch takes spec files and folders of them"
            raise UsageError(Problem(said, match, id="OBS101"))


def matches(path: str) -> list[str]:
    """What is at a path, or what a glob means, with the folders on its way that cannot be read."""
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise UsageError(Problem(f"cannot be read: {reason}", path, id="OBS101")) from None
    else:
        return [path]
    parts = {found for parent in PurePath(path).parents for found in glob.glob(f"{parent}/", recursive=True)}
    found = {*glob.glob(path, recursive=True), *(part.rstrip("/") for part in parts if disk.entries(part) is None)}
    if not found:
        said = "there is no such file or folder; give spec files, folders of them, or globs"
        raise UsageError(Problem(said, path, id="OBS101"))
    return sorted(found)


def shortened(path: str) -> str:
    """Path without `..`, for which links are followed: relative to the current folder where it is below it."""
    parts = Path(path).absolute().parts
    ups = len(parts) - parts[::-1].index("..") if ".." in parts else 0
    whole = Path(os.path.realpath(Path(*parts[:ups])), *parts[ups:]) if ups else Path(*parts)
    return str(whole.relative_to(Path.cwd()) if whole.is_relative_to(Path.cwd()) else whole)


def is_spec(path: str) -> bool:
    """Whether a YAML file means to be a spec, valid or not: by its keys, or since it has none that can be read.

    That is one which is empty, is no text in UTF-8 or cannot be opened: a spec may have been there. A hidden link to
    nowhere is the lock of an editor.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(MOST)
    except FileNotFoundError:
        return not os.path.basename(path).startswith(".")
    except OSError:
        return True
    return bool(SPEC.search(content)) or not content.strip() or not is_text(content)


def is_text(content: bytes) -> bool:
    """Whether the beginning of a file is text in UTF-8."""
    try:
        return "\0" not in getincrementaldecoder("utf-8")().decode(content)
    except UnicodeDecodeError:
        return False


def excluded(path: str, patterns: Iterable[str]) -> bool:
    """Whether a glob is that of a path, of a folder of it, or of one name in it."""
    candidates = {path, *map(str, PurePath(path).parents), *PurePath(path).parts}
    return any(fnmatchcase(one, pattern.rstrip("/")) for pattern in patterns for one in candidates)


def share(tasks: list[Task], shard: str | None) -> list[Task]:
    """Tasks of one shard of N, "I/N" with I from 1: every N-th, so that each task is in exactly one.

    Raises `UsageError`: it is not of that form.
    """
    if not shard:
        return tasks
    index, count = parted(shard)
    return tasks[index - 1 :: count]


def parted(shard: str) -> tuple[int, int]:
    """I and N of "I/N". Raises `UsageError`."""
    if not is_shard(shard):
        raise UsageError(f"--shard {shard}: expected I/N with 1 <= I <= N, such as 3/40", id="OBS901")
    index, count = map(int, shard.split("/"))
    return index, count


def is_shard(text: Any) -> bool:
    """Whether it is "I/N" with I from 1 to N."""
    found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text, re.ASCII) if isinstance(text, str) else None
    return found is not None and 1 <= int(found[1]) <= int(found[2])
