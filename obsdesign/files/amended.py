"""A result file with one entry more, every number in it as it was written."""

import re
from typing import Any

from obsdesign.files.result import ResultFile, as_read, render


def amended(file: ResultFile, key: str, entry: dict[str, Any] | None) -> bytes:
    """Text of a result with an entry of texts and numbers at its end, or without it, in the place of an earlier one.

    Raises `UsageError`: the file was not written by `solve`, so that its text has no place for it.
    """
    text = file.raw.decode().rstrip()
    text = re.sub(rf',\n  "{key}": \{{[^{{}}\n]*\}}(?=\n\}}$)', "", text)
    added = "" if entry is None else f',\n  "{key}": {render(entry, "  ")}'
    made = f"{text.removesuffix('}').rstrip()}{added}\n}}\n".encode()
    others = {name: value for name, value in file.content.items() if name != key}
    if ResultFile(file.path, made).content != others | ({} if entry is None else {key: as_read(entry)}):
        raise file.wrong("", f"has no place for `{key}`; solve it again", id="OBS702")
    return made
