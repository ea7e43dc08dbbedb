"""Files written whole or not at all."""

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from obsdesign.errors import UsageError


def write_whole(path: str | Path, content: bytes) -> None:
    """Write one file, whole or not at all.

    Raises `UsageError` if the folder does not exist or may not be written.
    """
    write_all({str(path): content})


def write_all(files: Mapping[str, bytes]) -> None:
    """Write files under temporary names beside them, and rename these when all are complete.

    Raises `UsageError` if a folder does not exist or may not be written; then none of the files is.
    """
    staged: dict[str, Path] = {}
    path = ""
    try:
        for path, content in files.items():
            if Path(path).is_dir():
                raise IsADirectoryError(0, "it is a folder")
            with tempfile.NamedTemporaryFile(dir=Path(path).parent, prefix=".obsdesign.", delete=False) as file:
                staged[path] = Path(file.name)
                file.write(content)
            staged[path].chmod(0o666 & ~umask())
        for path, temporary in staged.items():
            temporary.replace(path)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from None
    finally:
        for temporary in staged.values():
            temporary.unlink(missing_ok=True)


def require_writable(*paths: str) -> None:
    """Refuse paths that could not be written, before anything is computed.

    Raises `UsageError` if a folder does not exist or may not be written, or a path is a folder.
    """
    for path in paths:
        folder = Path(path).parent
        if Path(path).is_dir():
            raise UsageError(f"{path}: cannot be written: it is a folder")
        if not folder.is_dir():
            raise UsageError(f"{path}: cannot be written: there is no folder {folder}")
        if not os.access(folder, os.W_OK):
            raise UsageError(f"{path}: cannot be written: the folder {folder} may not be written")


def umask() -> int:
    """Permissions that the user withholds from new files."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
