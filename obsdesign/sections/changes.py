"""Changes of single keys of a spec, `observer.alpha=0.5`, which are read as if they stood in its text."""

import re
from collections.abc import Sequence
from itertools import combinations

from obsdesign.errors import NOT_ONE_LINE, Problem, UsageError
from obsdesign.sections.document import Document, Loc, compose, dotted
from obsdesign.sections.nodes import Node
from obsdesign.sections.scalars import CONSTANTS, described

CHANGE = re.compile(r"\s*([A-Za-z_][\w-]*(?:\.[A-Za-z_][\w-]*|\[\d{1,6}\])*)\s*=(.*)", re.DOTALL)
OPTION = "--set"


def opened(text: str, path: str, changes: Sequence[str] = ()) -> Document:
    """Read a YAML document, and put values in it: each `key=value`, a dotted key and what YAML has after it.

    Raises `UsageError`: the text is wrong as YAML, or a change is no change of a key that can stand there.
    """
    document = compose(text, path)
    for change in changes:
        loc, node = read_change(change)
        document = document._replace(root=put(document.root, loc, node, change))
    return document._replace(changes=tuple(changes))


def require_distinct(changes: Sequence[str]) -> None:
    """Refuse changes of one key, or of a key and of a part of it; raises `UsageError`, as for one that is no change."""
    for one, other in combinations(changes, 2):
        shorter, longer = sorted((parted(change)[0] for change in (one, other)), key=len)
        if longer[: len(shorter)] == shorter:
            said = f"{described(one)} and {described(other)} both set {dotted(longer)}; leave one of them out"
            raise UsageError(Problem(said, OPTION, id="OBS110"))


def claimed(changes: Sequence[str]) -> list[str]:
    """Changes that make a claim one of another problem: how it is tried, a log, and what is expected make none."""
    return [change for change in changes if not re.match(r"\s*(simulation|data|expect)\b", change)]


def parted(change: str) -> tuple[Loc, str, str]:
    """Place, key and value of a change, as texts. Raises `UsageError`: it is not KEY=VALUE."""
    found = CHANGE.fullmatch(change)
    if not found:
        said = f"expected KEY=VALUE with a dotted key, such as observer.alpha=0.5; found {described(change)}"
        raise UsageError(Problem(said, OPTION, id="OBS110"))
    if broken := NOT_ONE_LINE.search(change):
        said = f"{described(change)} holds the character U+{ord(broken[0]):04X}; write it in one line, without tabs"
        raise UsageError(Problem(said, OPTION, id="OBS110"))
    loc = tuple(int(part[1:-1]) if part[0] == "[" else part for part in re.findall(r"[\w-]+|\[\d+\]", found[1]))
    return loc, found[1], found[2]


def read_change(change: str) -> tuple[Loc, Node]:
    """Place of a change and the value that it has there, which knows where it came from."""
    loc, key, value = parted(change)
    origin = f"{OPTION} {described(change)}"
    given = value.strip()
    if CONSTANTS.get(given, True) is None:
        unset = f"{given} is no value; give one, or take the key out of the spec"
        said = unset if given else "the value is empty; give one, or leave the option out"
        raise UsageError(Problem(said, origin, id="OBS110"))
    try:
        document = compose(value, origin)
    except UsageError:
        said = "the value is not YAML; a shell needs quotes around a space: --set 'observer.bounds={L1: 400}'"
        raise UsageError(Problem(said, origin, id="OBS110")) from None
    if document.problems:
        raise UsageError(*(Problem(one.message, origin, key=key, id=one.id) for one in document.problems))
    return loc, of_origin(document.root, origin)


def of_origin(node: Node, origin: str) -> Node:
    """Tree whose nodes stand in no line of the text."""
    value = node.value
    if isinstance(value, dict):
        value = {name: (of_origin(key, origin), of_origin(entry, origin)) for name, (key, entry) in value.items()}
    elif isinstance(value, list):
        value = [of_origin(entry, origin) for entry in node.entries]
    return node._replace(value=value, line=0, column=0, origin=origin)


def whole(change: str, left: int) -> str:
    """Change that sets the whole value of which the last so many keys of another change are parts."""
    loc, _, value = parted(change)
    for name in reversed(loc[-left:]):
        value = f"{{{name}: {value.strip()}}}"
    return f"--set '{dotted(loc[:-left])}={value}'"


def put(node: Node, loc: Loc, new: Node, change: str) -> Node:
    """Tree with another node at a place; sections on the way that are not there yet are made."""
    if not loc:
        return new
    name, rest = loc[0], loc[1:]
    if isinstance(name, str) and isinstance(node.value, dict):
        key, entry = node.value.get(name, (new._replace(value=name), new._replace(value={})))
        return node._replace(value={**node.value, name: (key, put(entry, rest, new, change))})
    if isinstance(name, int) and isinstance(node.value, list) and name < len(node.value):
        entries = node.entries
        entries[name] = put(entries[name], rest, new, change)
        return node._replace(value=entries)
    kind = "a list of more entries" if isinstance(name, int) else "a mapping"
    said = f"{dotted((name,))} needs {kind} where the spec has {described(node.value)}; set the whole value instead"
    if isinstance(name, str):
        said += f": {whole(change, len(loc))}"
    raise UsageError(Problem(said, f"{OPTION} {described(change)}", id="OBS110"))
