"""Specs: from a YAML text to one estimation problem, or to everything that is wrong with it.

schema.py     the sections of the format (structure only), and its JSON Schema
resolve.py    the sections to the types of the design: exact values, derived sizes, names
build.py      the same from Python values
"""

import os

from obsdesign.errors import UsageError
from obsdesign.reading.build import build, with_simulation
from obsdesign.reading.resolve import resolve
from obsdesign.reading.schema import json_schema
from obsdesign.sections.document import compose, read
from obsdesign.spec import Noise, Nonlinearity, Simulation, Spec

__all__ = [
    "Noise",
    "Nonlinearity",
    "Simulation",
    "Spec",
    "build",
    "json_schema",
    "load",
    "loads",
    "with_simulation",
]


def load(source: str | os.PathLike[str]) -> Spec:
    """Read a spec from a file, or from its text, which has more than one line.

    Raises
    ------
    UsageError
        One problem for everything that is wrong, with file, line, column and key.
    """
    path = os.fspath(source)
    if "\n" in path:
        return loads(path)
    try:
        path.encode()
    except UnicodeEncodeError:
        shown = path.encode(errors="backslashreplace").decode()
        raise UsageError(f"{shown}: the name of the file is not valid UTF-8; rename it") from None
    return loads(read(path), path)


def loads(text: str, path: str = "<text>") -> Spec:
    """Read a spec from its text.

    Parameters
    ----------
    text
        YAML, at most 4 MiB.
    path
        What messages call it.

    Raises
    ------
    UsageError
        One problem for everything that is wrong, with file, line, column and key.
    """
    return resolve(compose(text, path))
