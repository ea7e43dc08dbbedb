"""Files on a disk: read up to a size, written whole or not at all; imports nothing that takes long."""

import errno
import json
import os
import re
import stat
import sys
import tempfile
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from difflib import get_close_matches
from pathlib import Path
from typing import IO, NamedTuple, cast

from obsdesign.errors import Problem, UsageError

STAGED = f".obsdesign-staged-{os.getpid()}-"  # how the names of files begin that are not complete yet
LARGEST = 64 * 2**20  # bytes of a result file
PART = 2**20  # bytes that are read at once
HEAD = 2**16  # bytes of a file that tell who wrote it


class Kind(NamedTuple):
    """What commands write: how the names of such files end, and how their contents begin."""

    endings: tuple[str, ...]
    mark: re.Pattern[bytes]


def marked(pattern: bytes) -> re.Pattern[bytes]:
    """Beginning of a file."""
    return re.compile(pattern, re.VERBOSE | re.DOTALL)


KINDS = {
    "specs": Kind((".yaml", ".yml"), marked(rb"(?!)")),  # which people write, and no command replaces
    "tuned specs": Kind((".yaml", ".yml"), marked(rb"\#\ obsdesign\ tune:")),
    "results": Kind((".json",), marked(rb'\{\s*"obsdesign":\ 1,\s*"name":\ "(?:\\.|[^"\\])*",\s*"spec"')),
    "samples": Kind((".csv",), marked(rb"t,(?!hat_)[^\n]*,hat_")),
    "estimates": Kind((".csv",), marked(rb"t,hat_")),
    "envelopes": Kind((".csv",), marked(rb"t,median_")),
    "figures": Kind((".png", ".svg"), marked(rb"\x89PNG.*Software\x00obsdesign | <.*<dc:title>obsdesign<")),
    "theorems": Kind((".v",), marked(rb"\(\*\ obsdesign:\ | -Q\ \.\ Obs")),
    "pages": Kind((".html", ".htm"), marked(rb'\s*<!DOCTYPE\ html>.*<meta\ name="generator"\ content="obsdesign\ ')),
    "summaries": Kind((".json",), marked(rb'\{\s*"obsdesign":\ 1,\s*"tool":.*"list_sha256":')),
    "JUnit XML": Kind((), marked(rb'<\?xml[^>]*>\s*<testsuites\ name="obsdesign"')),
    "SARIF": Kind((".json",), marked(rb'\{.*"driver":\s*\{\s*"name":\ "obsdesign"')),
    "annotations": Kind((), marked(rb"::(?:error|notice)\ [^\n]*title=obsdesign\ ")),
}
ENDINGS = {*(end for kind in KINDS.values() for end in kind.endings), ".pdf", ".jpg", ".jpeg", ".eps"}
QUIET = 600.0  # s: what was not written to for so long, nobody completes, be it on another machine
SHIFT = 60.0  # s, by which a clock may have been set
STRAY = re.compile(r"\.obsdesign-staged-(\d{1,10})-\w+")


def content_of(path: str, most: int) -> bytes:
    """Bytes of a file, or of standard input for `-`; not more than one beyond so many. Raises `UsageError`."""
    try:
        if path == "-":
            return b"" if sys.stdin is None else taken(sys.stdin.buffer, most + 1)
        with Path(path).open("rb") as file:
            return taken(file, most + 1)
    except IsADirectoryError:
        raise UsageError(Problem("is a folder; give a file", path, id="OBS101")) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        near = alike(path) if isinstance(error, FileNotFoundError) and not os.path.islink(path) else None
        said = f"cannot be read: {reason}{f'; did you mean {near}?' if near else ''}"
        raise UsageError(Problem(said, path, id="OBS101")) from None


def taken(file: IO[bytes], most: int) -> bytes:
    """Bytes of a file, not more than so many; no memory is asked for but for what there is."""
    parts = [file.read(min(most, PART))]
    while len(parts[-1]) == PART and (left := most - PART * len(parts)) > 0:
        parts.append(file.read(min(left, PART)))
    return b"".join(parts)


def alike(path: str) -> str | None:
    """File in the same folder whose name is closest to that of a path, if any is."""
    folder, name = os.path.split(path)
    close = get_close_matches(name, [entry.name for entry in entries(folder or ".") or ()], n=1)
    return os.path.join(folder, close[0]) if close else None


def below(folder: str, endings: tuple[str, ...]) -> Iterator[str]:
    """Files below a folder whose names end so, however deep they are and whoever made the folder.

    Capital letters make no other ending. A folder that cannot be read stands for what is in it: who opens it as a file
    is told why. Hidden folders and links to folders are left out, and what might never end, such as pipes. A link that
    leads nowhere is a file.
    """
    waiting = [folder]
    while waiting:
        if (found := entries(one := waiting.pop())) is None:
            yield one
        for entry in found or ():
            if entry.is_dir(follow_symlinks=False):
                waiting += [] if entry.name.startswith(".") else [entry.path]
            elif entry.name.lower().endswith(endings) and is_file(entry.path):
                yield entry.path


def entries(folder: str) -> "list[os.DirEntry[str]] | None":
    """What is in a folder; None where it cannot be read."""
    with suppress(OSError), os.scandir(folder) as found:
        return list(found)
    return None


def is_file(path: str) -> bool:
    """Whether what can be read at a path ends, or there is nothing to be read."""
    try:
        return stat.S_ISREG(os.stat(path).st_mode)
    except OSError:
        return True


def write_whole(path: str | Path, content: bytes) -> None:
    """Write one file, whole or not at all.

    Raises `UsageError` if the folder does not exist or may not be written.
    """
    write_all({str(path): content})


def write_all(files: Mapping[str, bytes]) -> None:
    """Write files under temporary names beside them, and rename these when all are complete.

    A link is followed; what is no regular file, such as a device or a pipe, is written through, after the others.
    Raises `UsageError` if a folder does not exist or may not be written; then none of the files is.
    """
    staged: dict[str, Path] = {}
    path = ""
    try:
        for path, content in files.items():
            if is_regular(path):
                with tempfile.NamedTemporaryFile(dir=Path(path).resolve().parent, prefix=STAGED, delete=False) as file:
                    staged[path] = Path(file.name)
                    file.write(content)
                staged[path].chmod(0o666 & ~umask())
        for folder in {temporary.parent for temporary in staged.values()}:
            with suppress(OSError):
                remove_strays(folder, QUIET)
        for path, temporary in staged.items():
            temporary.replace(Path(path).resolve())
        for path in files.keys() - staged:
            Path(path).write_bytes(files[path])
    except OSError as error:
        raise UsageError(Problem(f"cannot be written: {error.strerror}", path, id="OBS902")) from None
    finally:
        for temporary in staged.values():
            temporary.unlink(missing_ok=True)


@contextmanager
def whole(path: str) -> Iterator[IO[bytes]]:
    """File to be written part by part, which is there when all of it is, or not at all.

    Raises `UsageError` if its folder does not exist or may not be written.
    """
    if not is_regular(path):
        with Path(path).open("wb") as through:
            yield through
        return
    place = Path(path).resolve()
    try:
        remove_strays(place.parent)
        with tempfile.NamedTemporaryFile(dir=place.parent, prefix=STAGED, delete=False) as file:
            staged = Path(file.name)
            try:
                yield cast("IO[bytes]", file)
            except BaseException:
                staged.unlink(missing_ok=True)
                raise
        staged.chmod(0o666 & ~umask())
        staged.replace(place)
    except OSError as error:
        raise UsageError(Problem(f"cannot be written: {error.strerror}", path, id="OBS902")) from None


def remove_earlier(path: str) -> None:
    """Remove the regular file at a path, if there is one: what will be written there may never be."""
    if os.path.isfile(path):
        os.unlink(os.path.realpath(path))


def remove_strays(folder: Path, quiet: float = 0.0) -> None:
    """Remove what a process that is no more left half-written in a folder, and untouched for a time in s.

    Raises `OSError`.
    """
    for path in folder.iterdir():
        found = STRAY.fullmatch(path.name)
        if not found or not path.is_file() or path.is_symlink():
            continue
        changed = path.stat().st_mtime
        if time.time() - changed >= quiet and not is_running(found[1], changed):
            path.unlink(missing_ok=True)


def is_running(process: str, since: float) -> bool:
    """Whether the process of a number runs, and did so at a time: later ones get the numbers of earlier ones."""
    try:
        ticks = int(Path("/proc", process, "stat").read_bytes().rpartition(b")")[2].split()[19])
    except (OSError, ValueError, IndexError):
        return Path("/proc", process).exists()
    age = time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    return time.time() - age <= since + SHIFT


def require_ending(path: str, kind: str) -> None:
    """Refuse a path for files of one kind that ends as those of another; raises `UsageError`."""
    if not ends_as(path, kind):
        said = f"{kind} are written here, whose names end with {' or '.join(KINDS[kind].endings)}"
        raise UsageError(Problem(said, path, id="OBS904"))


def require_two(first: str, second: str, what: str) -> None:
    """Refuse one file for two outputs, by whatever paths, for one of them would be lost; raises `UsageError`."""
    if os.path.realpath(first) == os.path.realpath(second) and is_regular(first):
        raise UsageError(Problem(f"{what} cannot be one file; name another for one of them", second, id="OBS904"))


def require_writable(paths: Mapping[str, str], read: Collection[str] = ()) -> dict[str, str]:
    """Refuse paths that could not be written, or where something would be lost, before anything is computed.

    `paths`: each with the kind of what would be written there, of `KINDS`; `-` is standard output. A file of this kind
    that an earlier command wrote is replaced, unless it is one of those that are `read`; links are followed.

    Returns what is to be said of each path: whether it is replaced. Raises `UsageError` if a folder does not exist or
    may not be written, or a path is a folder or that of any other file.
    """
    paths = {path: kind for path, kind in paths.items() if path != "-"}
    for path, kind in paths.items():
        if any(os.path.exists(path) and os.path.exists(one) and os.path.samefile(path, one) for one in read):
            raise UsageError(Problem("is read here, and would be overwritten; name another", path, id="OBS904"))
        try:
            if not is_regular(path):
                if not os.access(path, os.W_OK):
                    raise UsageError(Problem(f"cannot be written: {os.strerror(errno.EACCES)}", path, id="OBS902"))
                continue
            folder = Path(path).resolve().parent
        except OSError as error:
            raise UsageError(Problem(f"cannot be written: {error.strerror}", path, id="OBS902")) from None
        shown = Path(path).parent
        if not os.path.isdir(folder):
            raise UsageError(
                Problem(f"cannot be written: there is no folder {shown}; make it first", path, id="OBS902")
            )
        if not os.access(folder, os.W_OK):
            raise UsageError(Problem(f"cannot be written: the folder {shown} may not be written", path, id="OBS902"))
        if os.path.exists(path) and not is_own(path, kind):
            said = f"is there already, and holds no {kind} of obsdesign; name another file, or remove this one"
            raise UsageError(Problem(said, path, id="OBS914"))
    return {"-": "-"} | {path: f"{path}   replaced" if os.path.isfile(path) else path for path in paths}


def is_own(path: str, kind: str) -> bool:
    """Whether a command wrote a file, and of this kind; one that is empty is, unless it is named as another kind is."""
    try:
        with Path(path).open("rb") as file:
            content = file.read(HEAD)
    except OSError:
        return False
    return bool(KINDS[kind].mark.match(content)) if content else ends_as(os.path.realpath(path), kind)


def ends_as(path: str, kind: str) -> bool:
    """Whether a file of this kind may have such a name: it does not end as those of the others."""
    return Path(path).suffix.lower() not in ENDINGS.difference(KINDS[kind].endings)


def is_regular(path: str) -> bool:
    """Whether a path is that of a regular file, be it through a link or not there yet. Raises `OSError`."""
    try:
        mode = Path(path).stat().st_mode
    except FileNotFoundError:
        return True
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(0, "it is a folder")
    return stat.S_ISREG(mode)


def umask() -> int:
    """Permissions that the user withholds from new files."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def newest() -> str:
    """Newest certified gains file in the current folder; raises `UsageError` if there is none."""
    files = (path for path in Path().glob("*.gains.json") if path.is_file())
    for path in sorted(files, key=lambda p: p.stat().st_mtime, reverse=True):
        try:
            if json.loads(content_of(str(path), LARGEST)).get("status") == "certified":
                return str(path)
        except (UsageError, ValueError, AttributeError, RecursionError):
            continue
    raise UsageError("no certified *.gains.json in this folder; name a spec or a gains file", id="OBS903")
