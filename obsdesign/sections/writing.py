"""Python values to the YAML text of a spec that reads back to them."""

import json
import re
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any

import numpy as np
from flint import fmpq, fmpz

from obsdesign.errors import Problem, UsageError
from obsdesign.sections.document import MAX_DEPTH, TOO_DEEP, Loc, dotted
from obsdesign.sections.scalars import CONSTANTS, Number

PLAIN = re.compile(r"[A-Za-z_]([A-Za-z0-9_ ().*+/^|<>=-]*[A-Za-z0-9_().|])?")  # text that needs no quotes


def written(sections: Mapping[str, Any], path: str) -> str:
    """YAML text of sections; a value that is None is left out.

    `sections`: numbers (of Python, numpy, fractions or flint), text, arrays, lists and mappings with text as keys. A
    double is written as the shortest decimal that prints it, and so read as that decimal; `path`: what messages call
    it. Raises `UsageError`: a value is none of these, with the key at which it stands.
    """
    problems: list[Problem] = []
    tree = plain(sections, (), problems, path)
    if problems:
        raise UsageError(*problems)
    return "\n".join(line for name, value in tree.items() for line in lines(name, value, "")) + "\n"


def plain(value: Any, loc: Loc, problems: list[Problem], path: str) -> Any:
    """Return the value in mappings, lists and texts of YAML; what cannot be is a problem."""
    if isinstance(value, np.ndarray):
        value = value.tolist() if value.dtype.kind in "biu" else [*value] if value.ndim else value[()]
    if len(loc) > MAX_DEPTH:
        problems.append(Problem(TOO_DEEP, path, key=dotted(loc[:4]), id="OBS103"))
    elif isinstance(value, Mapping):
        others = [name for name in value if not isinstance(name, str)]
        problems += [
            Problem(f"a key must be text, found {name!r}", path, key=dotted(loc), id="OBS106") for name in others
        ]
        known = {name: item for name, item in value.items() if item is not None and isinstance(name, str)}
        return {name: plain(item, (*loc, name), problems, path) for name, item in known.items()}
    elif isinstance(value, list | tuple):
        return [plain(item, (*loc, i), problems, path) for i, item in enumerate(value)]
    elif (text := scalar(value)) is not None:
        return text
    else:
        expected = "a number, text, an array, a list or a mapping"
        problems.append(
            Problem(f"expected {expected}; found {type(value).__name__}", path, key=dotted(loc), id="OBS204")
        )
    return ""


def scalar(value: Any) -> str | None:
    """A single value as YAML has it; None if it is of another kind."""
    if isinstance(value, bool | np.bool_):
        return str(bool(value)).lower()
    if isinstance(value, float | np.floating):
        number = str(np.float64(value)) if isinstance(value, float) else str(value)
        return {"nan": ".nan", "inf": ".inf", "-inf": "-.inf"}.get(number, number)
    if isinstance(value, int | np.integer | Fraction | fmpz | fmpq):
        return whole(value)
    if not isinstance(value, str):
        return None
    safe = isinstance(value, Number) or (PLAIN.fullmatch(value) and value not in CONSTANTS)
    return str(value) if safe else json.dumps(str(value), ensure_ascii=False)


def whole(value: Any) -> str:
    """Digits of a whole number or of a fraction; raises `UsageError` if there are more than Python converts."""
    try:
        return str(value)
    except ValueError:
        raise UsageError("a whole number has more digits than Python converts; write a decimal", id="OBS212") from None


def lines(name: str, value: Any, indent: str) -> Iterator[str]:
    """Lines of one key: its own for each key of a section and for each entry of a list of sections."""
    key = scalar(name)
    if isinstance(value, dict) and value and len(indent) < 2:
        yield f"{indent}{key}:"
        for inner, item in value.items():
            yield from lines(inner, item, f"{indent}  ")
    elif isinstance(value, list) and not indent and value and all(isinstance(item, dict) for item in value):
        yield f"{key}:"
        yield from (f"  - {flow(item)}" for item in value)
    else:
        yield f"{indent}{key}: {flow(value)}"


def flow(value: Any) -> str:
    """Value in one line."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{scalar(name)}: {flow(item)}' for name, item in value.items())}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(flow, value))}]"
    return str(value)
