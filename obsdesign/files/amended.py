"""A result file with one entry more, every number in it as it was written."""

import re
from typing import Any

from obsdesign.files.result import ResultFile, as_read, render


def amended(file: ResultFile, key: str, entry: dict[str, Any]) -> bytes:
    """Text of a result with an entry of texts and numbers at its end, in the place of an earlier one.

    Raises `UsageError`: the file was not written by `solve`, so that its text has no place for it.
    """
    text = file.raw.decode().rstrip()
    text = re.sub(rf',\n  "{key}": \{{[^{{}}\n]*\}}(?=\n\}}$)', "", text)
    made = f'{text.removesuffix("}").rstrip()},\n  "{key}": {render(entry, "  ")}\n}}\n'.encode()
    content = ResultFile(file.path, made).content
    if content != {**file.content, key: as_read(entry)}:
        raise file.wrong("", f"has no place for `{key}`; solve it again", id="OBS702")
    return made
