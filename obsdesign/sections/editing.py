"""The text of a spec with other values of some keys, in which comments and layout stay where they can."""

from collections.abc import Sequence
from typing import Any

from obsdesign.errors import UsageError
from obsdesign.sections.changes import opened, parted
from obsdesign.sections.document import compose
from obsdesign.sections.nodes import Node
from obsdesign.sections.writing import written

QUOTES, OPENING, CLOSING = "'\"", "[{", "]}"


def edited(text: str, path: str, changes: Sequence[str], without: Sequence[str] = ()) -> tuple[str, bool]:
    """Text in which each change `key=value` stands in place of the value before, and whether its comments are kept.

    `without`: sections that are left out. Where a value cannot be replaced as it stands, such as one in several lines,
    or a key that is not there yet, the whole is written anew, without comments. Raises `UsageError`: as `opened`.
    """
    wanted = opened(text, path, changes).root.plain()
    wanted = {name: value for name, value in wanted.items() if name not in without}
    made = text
    for change in changes:
        made = replaced(made, change)
    for name in without:
        made = left_out(made, name)
    return (made, True) if reads(made) == wanted else (written(wanted, path), False)


def reads(text: str) -> Any:
    """Values of a text; None where it is no YAML any more."""
    try:
        document = compose(text, "")
    except UsageError:
        return None
    return None if document.problems else document.root.plain()


def replaced(text: str, change: str) -> str:
    """Text with the value of one key replaced, where that has a value in one line; one that is no YAML stays."""
    loc, _, value = parted(change)
    if reads(text) is None:  # what another value took away, such as an anchor
        return text
    document = compose(text, "")
    node = document.root
    for name in loc:
        if isinstance(name, str) and isinstance(node.value, dict) and name in node.value:
            node = node.value[name][1]
        elif isinstance(name, int) and isinstance(node.value, list) and name < len(node.value):
            node = node.entries[name]
        else:
            return text
    end = end_of(document.text, node)
    return text if end is None else f"{document.text[: node.begins]}{value.strip()}{document.text[end:]}"


def end_of(text: str, node: Node) -> int | None:
    """Where a value ends that is a scalar, or a list or mapping in brackets; None of any other."""
    first = text[node.begins : node.begins + 1]
    if isinstance(node.value, dict | list):
        return closed(text, node.begins) if first and first in OPENING else None
    if first and first in QUOTES:
        end = text.find(first, node.begins + 1)
        return None if end < 0 else end + 1
    if isinstance(node.value, str) and text.startswith(node.value, node.begins):
        return node.begins + len(node.value)
    return None


def closed(text: str, begin: int) -> int | None:
    """Where a bracket is closed again; what is between quotes does not count."""
    depth, quote = 0, ""
    for i in range(begin, len(text)):
        letter = text[i]
        if quote:
            quote = "" if letter == quote else quote
        elif letter in QUOTES:
            quote = letter
        else:
            depth += (letter in OPENING) - (letter in CLOSING)
            if not depth:
                return i + 1
    return None


def left_out(text: str, name: str) -> str:
    """Text without the lines of a section, up to the key after it; one that is no YAML stays."""
    if reads(text) is None:
        return text
    sections = compose(text, "").root.value
    if not isinstance(sections, dict) or name not in sections:
        return text
    begin = sections[name][0].begins
    later = [key.begins for key, _ in sections.values() if key.begins > begin]
    if text[max(begin - 1, 0) : begin] not in ("", "\n"):
        return text
    end = min(later, default=len(text))
    return text[:begin] + text[end:] if later else f"{text[:begin].rstrip()}\n"
