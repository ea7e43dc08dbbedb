"""Where the text of a spec comes from; imports nothing that takes long, so that a typing error is told at once."""

import os
from collections.abc import Sequence

from obsdesign.disk import content_of
from obsdesign.errors import NOT_ONE_LINE, Problem, UsageError
from obsdesign.sections.changes import opened, require_distinct
from obsdesign.sections.document import MAX_BYTES, TOO_LARGE, Document


def read(source: str | os.PathLike[str], changes: Sequence[str] = ()) -> Document:
    """Document of a file, or of a text, which has more than one line, with other values of single keys.

    Raises `UsageError`: it cannot be read, is no YAML document, or a change is none, or of what another changes.
    """
    path = os.fspath(source)
    require_distinct(changes)
    if "\n" in path:
        return opened(path, "<text>", changes)
    try:
        path.encode()
    except UnicodeEncodeError:
        shown = path.encode(errors="backslashreplace").decode()
        raise UsageError(Problem("the name of the file is not valid UTF-8; rename it", shown, id="OBS101")) from None
    require_line(path)
    text = text_of(path)
    if path.lower().endswith(".csv"):
        raise UsageError(Problem("is a table of samples; a spec is expected, a YAML file", path, id="OBS109"))
    return opened(text, path, changes)


def require_line(path: str) -> None:
    """Refuse the name of a file that would forge what is printed; raises `UsageError`."""
    if found := NOT_ONE_LINE.search(path):
        said = f"the name of the file holds the character U+{ord(found[0]):04X}; rename it"
        raise UsageError(Problem(said, path.encode(errors="backslashreplace").decode(), id="OBS102"))


def text_of(path: str) -> str:
    """Text of a file.

    Raises `UsageError`: it cannot be read, is larger than 4 MiB, or is not UTF-8 text.
    """
    data = content_of(path, MAX_BYTES)
    if len(data) > MAX_BYTES:
        raise UsageError(Problem(TOO_LARGE, path, id="OBS103"))
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise UsageError(
            Problem(f"is not UTF-8 text (byte {error.start}); a spec is a YAML file", path, id="OBS102")
        ) from None
