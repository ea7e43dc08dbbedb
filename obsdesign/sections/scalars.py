"""Plain scalars of a YAML text in the core schema of YAML 1.2, and how messages name values."""

import re
from typing import Any

MAX_QUOTED = 60  # characters of a value in a message
DECIMAL = re.compile(r"([-+]?)(0+(?=[0-9]))?((\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?)")
OTHER_BASE = re.compile(r"0o[0-7]{1,20}|0x[0-9a-fA-F]{1,16}")
NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
DATE = re.compile(r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}([Tt \t].*)?|[-+]?[0-9]+(:[0-5]?[0-9])+(\.[0-9]*)?")
CONSTANTS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
AS_DOUBLE = "is read as the double"  # in a note on an irrational number


class Number(str):
    """A scalar that YAML 1.2 reads as a number, as its text: a decimal, or `.inf`, `-.inf`, `.nan`."""

    __slots__ = ()


def scalar(text: str) -> bool | str | None:
    """Value of a plain scalar in the core schema of YAML 1.2."""
    if text in CONSTANTS:
        return CONSTANTS[text]
    if text[0] not in "+-.0123456789":
        return text
    if decimal := DECIMAL.fullmatch(text):
        return Number(decimal[1] + decimal[3])
    if OTHER_BASE.fullmatch(text):
        return Number(int(text, 0))
    return Number(text) if NOT_FINITE.fullmatch(text) else text


def described(value: Any) -> str:
    """Name a plain value as a message does."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "a list" if value else "an empty list"
    if isinstance(value, dict):
        return "a mapping"
    line = " ".join(value.split())
    return f"{line[:MAX_QUOTED]}.." if len(line) > MAX_QUOTED else line or "an empty text"
