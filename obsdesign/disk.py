"""Files on a disk: read up to a size, written whole or not at all; imports nothing that takes long."""

import errno
import json
import os
import re
import stat
import sys
import tempfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path

from obsdesign.errors import Problem, UsageError

STAGED = f".obsdesign-staged-{os.getpid()}-"  # how the names of files begin that are not complete yet
HEAD = 2**16  # bytes of a file that tell who wrote it
OWN = re.compile(  # how the files begin that a command writes; of one that is empty nothing is lost
    rb"""\Z
    | \{\s*"obsdesign":\ 1,\s*(?:"tool"|"name":\ "(?:\\.|[^"\\])*",\s*"spec")   # a result, a summary
    | \{.*"name":\ "obsdesign"                                                   # SARIF
    | <.*(?:name="obsdesign"|content="obsdesign\ |<dc:title>obsdesign<)          # JUnit, HTML, SVG
    | \x89PNG.*Software\x00obsdesign
    | ::.*title=obsdesign\                                                        # annotations of GitHub
    | t,(?:[^\n]*,)?hat_                                                         # CSV
    """,
    re.VERBOSE | re.DOTALL,
)
STRAY = re.compile(r"\.obsdesign-staged-(\d{1,10})-\w+")


def content_of(path: str, most: int) -> bytes:
    """Bytes of a file, or of standard input for `-`; not more than one beyond so many. Raises `UsageError`."""
    try:
        if path == "-":
            return b"" if sys.stdin is None else sys.stdin.buffer.read(most + 1)
        with Path(path).open("rb") as file:
            return file.read(most + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        near = alike(path) if isinstance(error, FileNotFoundError) else None
        said = f"cannot be read: {reason}{f'; did you mean {near}?' if near else ''}"
        raise UsageError(Problem(said, path, id="OBS101")) from None


def alike(path: str) -> str | None:
    """File in the same folder whose name is closest to that of a path, if any is."""
    folder, name = os.path.split(path)
    close = get_close_matches(name, [entry.name for entry in entries(folder or ".")], n=1)
    return os.path.join(folder, close[0]) if close else None


def below(folder: str, endings: tuple[str, ...]) -> Iterator[str]:
    """Files below a folder whose names end so, however deep they are and whoever made the folder.

    Hidden folders, those that cannot be read and links to folders are left out, and what might never end, such as
    pipes. A link that leads nowhere is a file.
    """
    waiting = [folder]
    while waiting:
        for entry in entries(waiting.pop()):
            if entry.is_dir(follow_symlinks=False):
                waiting += [] if entry.name.startswith(".") else [entry.path]
            elif entry.name.endswith(endings) and is_file(entry.path):
                yield entry.path


def entries(folder: str) -> "list[os.DirEntry[str]]":
    """What is in a folder; nothing where it cannot be read."""
    with suppress(OSError), os.scandir(folder) as found:
        return list(found)
    return []


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
        for path, temporary in staged.items():
            temporary.replace(Path(path).resolve())
        for path in files.keys() - staged:
            Path(path).write_bytes(files[path])
    except OSError as error:
        raise UsageError(Problem(f"cannot be written: {error.strerror}", path, id="OBS902")) from None
    finally:
        for temporary in staged.values():
            temporary.unlink(missing_ok=True)


def remove_strays(folder: Path) -> None:
    """Remove what a process that is no more left half-written in a folder. Raises `OSError`."""
    for path in folder.iterdir():
        if (found := STRAY.fullmatch(path.name)) and not Path("/proc", found[1]).exists():
            path.unlink(missing_ok=True)


def require_writable(*paths: str, read: Collection[str] = ()) -> dict[str, str]:
    """Refuse paths that could not be written, or hold what no command has written, before anything is computed.

    A file that an earlier command wrote is replaced, unless it is one of those that are `read`. Returns what is to be
    said of each path: whether it is replaced. Raises `UsageError` if a folder does not exist or may not be written, or
    a path is a folder or that of a file of the user.
    """
    for path in paths:
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
        if not folder.is_dir():
            raise UsageError(
                Problem(f"cannot be written: there is no folder {shown}; make it first", path, id="OBS902")
            )
        if not os.access(folder, os.W_OK):
            raise UsageError(Problem(f"cannot be written: the folder {shown} may not be written", path, id="OBS902"))
        if os.path.lexists(path) and not is_own(path):
            said = "is there already, and is no output of obsdesign; name another file, or remove this one"
            raise UsageError(Problem(said, path, id="OBS914"))
    return {path: f"{path}   replaced" if Path(path).is_file() else path for path in paths}


def is_own(path: str) -> bool:
    """Whether a regular file is what a command wrote, is empty, or is not there, as where a link leads nowhere."""
    try:
        with Path(path).open("rb") as file:
            return bool(OWN.match(file.read(HEAD)))
    except OSError as error:
        return isinstance(error, FileNotFoundError)


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
            if json.loads(path.read_bytes()).get("status") == "certified":
                return str(path)
        except (OSError, ValueError, AttributeError, RecursionError):
            continue
    raise UsageError("no certified *.gains.json in this folder; name a spec or a gains file", id="OBS903")
