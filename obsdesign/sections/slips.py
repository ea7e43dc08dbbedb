"""Lines that a user writes otherwise than YAML has them, and what to write instead."""

import re
from typing import Any

import yaml

LONGEST = 200  # characters of a line that are looked at
KEY = r"\s*(?:- )?(?P<key>[A-Za-z_][\w+-]*)"
SLIPS = (  # lines that are no YAML, what to write instead, and whether the parser takes them for a list
    (re.compile(KEY + r"\s+(?P<value>[\[{].*)"), "a colon stands after a key: write {key}: {value}", False),
    (re.compile(KEY + r":(?P<value>[^\s:].*)"), "a space parts a key from its value: write {key}: {value}", False),
    (
        re.compile(KEY + r"'?\s*=\s*(?P<value>\S.*)"),
        "a value stands after a colon, a derivative too: write {key}: {value}",
        False,
    ),
    (
        re.compile(KEY + r":\s+(?P<value>[^\s'\"\[{&*|>#][^'#]*:\s.*)"),
        "a text that holds ': ' is quoted: write {key}: '{value}'",
        False,
    ),
    (
        re.compile(r"\s*- " + KEY + r":\s+(?P<value>.*)"),
        "a key of a mapping has no - before it: write {key}: {value}",
        True,
    ),
)


def slip(error: yaml.MarkedYAMLError, text: str) -> tuple[int, int, int, str] | None:
    """Line, column and index of a key that a syntax error is about, as it is no YAML, and what to write.

    The parser meets such an error in this line, in the next one, or in the one after a list that is no list.
    """
    for mark in (error.context_mark, error.problem_mark):
        begin = text.rfind("\n", 0, mark.index) + 1 if mark else 0
        for first in (begin, text.rfind("\n", 0, max(begin - 1, 0)) + 1) if mark else ():
            end = text.find("\n", first, first + LONGEST)
            line = text[first : end if end >= 0 else first + LONGEST].rstrip("\r")
            for pattern, said, about_lists in SLIPS:
                found = pattern.fullmatch(line)
                if found and ("'-'" in str(error.problem)) is about_lists:
                    begins, row = first + found.start("key"), text.count("\n", 0, first) + 1
                    return row, begins - first + 1, begins, said.format(**found.groupdict())
    return None


def rewritten(value: Any) -> str:
    """How a mapping is written, as an addition to what is expected, where its entries are written otherwise."""
    if isinstance(value, list) and any(isinstance(entry, dict) for entry in value):
        return ", each without a - before it"
    found = re.match(r"(\w+)'?\s*=\s*([^\s=]+)", str(value))
    return f", such as {found[1]}: {found[2]}" if found else ""
