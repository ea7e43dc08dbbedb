"""Changes of a batch: `observer.alpha=0.1,0.5` is a sweep of two values, and several sweeps give every combination."""

import re
from collections.abc import Iterable, Iterator
from itertools import product

from obsdesign.sections.changes import read_change, require_distinct

TOKEN = re.compile(r""""(?:\\.|[^"\\])*"|'[^']*'|.""", re.DOTALL)  # a quoted text, or one character
OPENING, CLOSING = "([{", ")]}"


def combinations(changes: Iterable[str]) -> list[tuple[str, ...]]:
    """Every combination of the values of changes, each as changes of one value; without changes one that is empty.

    Raises `UsageError`: one is not KEY=VALUE, its value is not YAML, or two are of the same key or of a part of it.
    """
    asked = list(changes)
    require_distinct(asked)
    return list(dict.fromkeys(product(*map(singles, asked))))


def singles(change: str) -> list[str]:
    """Changes to the single values of one. Raises as `combinations`."""
    key, sign, values = change.partition("=")
    found = [f"{key.strip()}={value.strip()}" for value in split(values)] if sign else [change]
    for single in found:
        read_change(single)
    return found


def split(values: str) -> Iterator[str]:
    """Parts between commas that are outside brackets, braces, parentheses and quotes."""
    part, depth = "", 0
    for token in TOKEN.findall(values):
        if token == "," and depth <= 0:
            yield part
            part = ""
            continue
        depth += (token in OPENING) - (token in CLOSING)
        part += token
    yield part
