"""Matrices in the notation of MATLAB or numpy, as the rows that a spec has for them."""

import re
from collections.abc import Collection, Sequence
from typing import Any

from obsdesign.sections.nodes import Row
from obsdesign.sections.units import misread

LONGEST = 2000  # characters of a text that may be a matrix
ARRAY = re.compile(r"(?:(?:np|numpy)\.)?(?:array|matrix|asarray|mat)\s*\((.*)\)", re.DOTALL)
FILLED = re.compile(r"(?:(?:np|numpy)\.)?(zeros|ones|eye|identity)\s*\(+\s*([1-9])\s*(?:,\s*([1-9])\s*)?\)+")
DIAGONAL = re.compile(r"(?:(?:np|numpy)\.)?diag\s*\([\[(]?([^\[\]()]*)[\])]?\)")
OUTER = re.compile(r"\[(.*)\]|\(((?:\s*\([^()]*\)\s*,?)+|[^()]*,[^()]*)\)", re.DOTALL)  # parentheses: tuples only
ROW = re.compile(r"[\[(]([^\[\]()]*)[\])]")
ENTRY = re.compile(r"[-+]?[\w.]+(\s*[-+*/]+\s*[\w.]+)*")
VALUE = re.compile(r"[-+]?[\w.]+")

Rows = list[list[str]]


def meant(value: str | Sequence[Any], names: Collection[str]) -> Rows | None:
    """Rows of a matrix that is written in another notation; None if it is not.

    A text such as "[0 1; -2 -3]", np.array([[0, 1]]) or eye(2), or a list such as [0 1; 0 -0.5] or [[0 1], [2 3]].
    `names`: those that entries may have; a number before another name has a unit, which is another mistake.
    """
    if isinstance(value, str):
        return of_text(value.strip(), names)
    if isinstance(value, Row) or all(isinstance(row, Row) for row in value):
        return None
    nested = any(isinstance(row, list) for row in value)
    rows: list[Any] = [row if isinstance(row, list) else [row] for row in value] if nested else [value]
    if not all(isinstance(entry, str) for row in rows for entry in row):
        return None
    if not any(";" in entry or spaced(entry, names) for row in rows for entry in row):
        return None
    return [split(row, r"[\s,]+") for text in map(",".join, rows) for row in text.split(";")]


def spaced(entry: str, names: Collection[str]) -> bool:
    """Whether a text is several entries of a row, without commas: 0 1 is, and 0 -1 may be a difference."""
    parts = entry.split() if " " in entry else []
    entries = any(part[0] not in "+-" for part in parts[1:]) and all(map(VALUE.fullmatch, parts))
    return entries and not misread(entry, names)


def of_text(text: str, names: Collection[str]) -> Rows | None:
    """Rows of a matrix that is written as a text."""
    if len(text) > LONGEST:
        return None
    if found := FILLED.fullmatch(text):
        height, width = int(found[2]), int(found[3] or found[2])
        other, diagonal = {"zeros": ("0", "0"), "ones": ("1", "1")}.get(found[1], ("0", "1"))
        return [[diagonal if i == j else other for j in range(width)] for i in range(height)]
    if found := DIAGONAL.fullmatch(text):
        entries = split(found[1], r"[\s,;]+")
        return [[entry if i == j else "0" for j in range(len(entries))] for i, entry in enumerate(entries)]
    array = ARRAY.fullmatch(text)
    text = array[1].strip() if array else text
    outer = OUTER.fullmatch(text)
    inner = (outer[1] or outer[2] or "") if outer else text
    lines = (ROW.findall(inner) if outer else []) or re.split(r"[;\n]", inner)
    if outer is None and ";" not in text and not ("\n" in text and any(spaced(line, names) for line in lines)):
        return None
    rows = [split(line, r"\s*,\s*" if "," in line else r"\s+") for line in lines if line.strip()]
    return rows if rows and all(row and all(map(ENTRY.fullmatch, row)) for row in rows) else None


def split(row: str, separator: str) -> list[str]:
    """Entries of a row."""
    return [entry for entry in re.split(separator, row.strip()) if entry]


def as_lists(rows: Rows) -> str:
    """Rows as YAML has them."""
    return f"[[{'], ['.join(map(', '.join, rows))}]]"
