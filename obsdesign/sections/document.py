"""YAML text to a tree of nodes that know their line and column: the only YAML code.

Scalars are read as YAML 1.2 (core schema) says, not 1.1: `1e-3` is a number, `010` is ten, `no` is text.
A number keeps its text, so that a decimal is exact. Hostile files (alias bombs, towers of brackets) are
refused while their events arrive, before there is a tree.
"""

import re
from dataclasses import replace
from typing import Any, NamedTuple, NoReturn

import yaml

from obsdesign.errors import NOT_ONE_LINE, Excerpt, Problem, UsageError
from obsdesign.sections.nodes import Node, row_of
from obsdesign.sections.scalars import Number, described, scalar
from obsdesign.sections.slips import slip

MAX_BYTES = 4 * 2**20
TOO_LARGE = "is larger than 4 MiB; a spec may not be"
TOO_DEEP = "nested deeper than 32 levels; a spec needs no more"
MAX_DEPTH = 32  # lists and mappings inside each other
MAX_NODES = 180_000  # a dense A with 400 states has 160,000
MAX_SEPARATORS = 250_000  # commas and lines: many more values than that are not worth parsing
TOO_MANY = f"more than {MAX_SEPARATORS:,} commas and lines; a spec may not have so many values"
MAX_PROBLEMS = 100
MAX_SHOWN = 4  # parts of a key in a message about YAML
LONGEST = 200  # characters of a line that are kept on each side of a place
MAX_ALIASED = 100_000  # nodes that all aliases together stand for

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
LINE_END = re.compile("[\n\r\x85\u2028\u2029]")
OPERATOR = re.compile(r"[*/()+<>]")
PARSER = "not valid YAML"  # what the parser says, where nothing better is known
# what is not allowed; the complement of what is would take 4 ms to compile
NOT_TEXT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\ud800-\udfff\ufeff\ufffe\uffff]")

Loc = tuple[str | int, ...]
Mark = Any  # of PyYAML, or of libyaml


class Document(NamedTuple):
    """One YAML document, and what is wrong in it as YAML where the rest could still be read."""

    path: str
    text: str
    root: Node
    problems: tuple[Problem, ...]
    changes: tuple[str, ...] = ()  # keys that have other values than in the text, such as observer.alpha=0.5

    def problem(self, loc: Loc, message: str, *, id: str, at_key: bool = False, column: int = 0) -> Problem:
        """Return what is wrong at `loc`, placed at its value or its key.

        `column`: where in a text, from 0. It moves the place only if the text is written out in one line.
        """
        key, value = self.find(loc)
        node = key if at_key else value
        if node.origin:
            return Problem(message, node.origin, key=dotted(loc), id=id)
        if column and isinstance(node.value, str):
            quote = int(self.text[node.begins] in "'\"")
            column = quote + column if self.text.startswith(node.value, node.begins + quote) else 0
        place = node._replace(column=node.column + column, begins=node.begins + column)
        return about(place, message, self.path, self.text, dotted(loc), id=id)

    def find(self, loc: Loc) -> tuple[Node, Node]:
        """Key and value at `loc`, or of the part of `loc` that there is."""
        key = node = self.root
        for name in loc:
            if isinstance(node.value, dict) and name in node.value:
                key, node = node.value[name]
            elif isinstance(node.value, list) and isinstance(name, int) and name < len(node.value):
                key = node = node.entries[name]
            else:
                return key, key
        return key, node


def dotted(loc: Loc) -> str:
    """`loc` as a user reads it, such as system.A[0][1]."""
    parts = (f"[{name}]" if isinstance(name, int) else f".{described(name)}" for name in loc)
    return "".join(parts).removeprefix(".")


def compose(text: str, path: str) -> Document:
    """Read one YAML document.

    Raises `UsageError`: it is not YAML, is empty, too large, too deep, or holds more than one document.
    """
    if len(text) > MAX_BYTES:
        raise UsageError(Problem(TOO_LARGE, path, id="OBS103"))
    if text.count(",") + text.count("\n") > MAX_SEPARATORS:
        raise UsageError(Problem(TOO_MANY, path, 1, 1, id="OBS103"))
    text = text.removeprefix("\ufeff")
    if found := NOT_TEXT.search(text):
        line = text.count("\n", 0, found.start()) + 1
        place = Node(None, line, found.start() - text.rfind("\n", 0, found.start()), found.start())
        message = f"the character U+{ord(found[0]):04X} does not belong in a text file; a spec is a YAML file"
        raise UsageError(about(place, message, path, text, id="OBS102"))
    composer = Composer(path, text)
    try:
        for event in yaml.parse(text, LOADER):
            composer.take(event)
    except yaml.MarkedYAMLError as error:
        raise UsageError(*composer.problems, invalid(error, path, text)) from None
    if composer.root is None or composer.root.value is None:
        raise UsageError(Problem("is empty; a spec begins with `obsdesign: 1`", path, id="OBS104"))
    return Document(path, text, composer.root, tuple(composer.problems))


def invalid(error: yaml.MarkedYAMLError, path: str, text: str) -> Problem:
    """Syntax error, with the line in which it is found, or else that in which begins what does not end."""
    said = explained(error, text)
    if (found := slip(error, text)) and said.startswith(PARSER):
        return about(Node(None, *found[:3]), found[3], path, text, id="OBS104")
    mark, began = transpose(error, text) or error.problem_mark or error.context_mark, error.context_mark
    place = placed(None, mark) if mark else Node(None, 1, 1, 0)
    problem = about(place, said, path, text, id="OBS104")
    blank = not "".join(excerpt(place, text)[1:]).strip()
    return replace(problem, excerpt=excerpt(placed(None, began), text)) if began and blank else problem


def about(place: Node, message: str, path: str, text: str, key: str = "", *, id: str) -> Problem:
    """Problem at a place, with its line."""
    return Problem(message, path, place.line, place.column, key, id=id, excerpt=excerpt(place, text))


def excerpt(place: Node, text: str) -> Excerpt:
    """Line of a place, as far as it is near."""
    first, index = place.begins - place.column + 1, place.begins
    end = LINE_END.search(text, index, index + LONGEST)
    after = text[index : end.start() if end else index + LONGEST]
    return Excerpt(place.line, text[max(first, index - LONGEST, 0) : index], after)


def explained(error: yaml.MarkedYAMLError, text: str) -> str:
    """One line for a syntax error."""
    mark = error.problem_mark
    if mark is not None and text[mark.index : mark.index + 1] == "\t":
        return "a tab cannot indent YAML; use spaces"
    if transpose(error, text):
        return "a ' after a list is no transpose; write the rows of the transposed matrix out: [[0], [1]]"
    if mark and str(error.problem).endswith("expected ',' or ']'") and text.startswith(("[", ";"), mark.index):
        return "the entries of a list, rows as well, are separated by commas: [[0, 1], [2, 3]]"
    message = f"{PARSER}: {error.problem}"
    if error.context and error.context_mark:
        message += f" ({error.context} that begins in line {error.context_mark.line + 1})"
    return message


def transpose(error: yaml.MarkedYAMLError, text: str) -> Mark | None:
    """Place of a quote after a list, which transposes it elsewhere, where it is what a syntax error is about."""
    marks = [mark for mark in (error.context_mark, error.problem_mark) if mark and text[mark.index :].startswith("'")]
    return next((mark for mark in marks if text[: mark.index].rstrip(" ").endswith("]")), None)


class Open:
    """A list or mapping that is being read."""

    def __init__(self, mark: Mark, anchor: str | None, *, mapping: bool) -> None:
        self.mark = mark
        self.anchor = anchor
        self.mapping = mapping
        self.values: Any = {} if mapping else []
        self.key: Node | None = None
        self.size = 1
        self.height = 1


class Composer:
    """Builds the tree from the events of the parser, within the limits."""

    def __init__(self, path: str, text: str) -> None:
        self.path = path
        self.text = text
        self.root: Node | None = None
        self.problems: list[Problem] = []
        self.stack: list[Open] = []
        self.row: list[yaml.ScalarEvent] | None = None  # entries of the innermost list, if that is in brackets
        self.anchors: dict[str, Node | None] = {}  # None: still open
        self.nodes = 0
        self.aliased = 0

    def stop(self, mark: Mark, message: str, *, id: str) -> NoReturn:
        """Give up reading, with all that was found wrong so far."""
        raise UsageError(*self.problems, self.problem(mark, message, id=id))

    def problem(self, mark: Mark, message: str, *, id: str) -> Problem:
        """Return what is wrong at the mark, with the key under which it stands."""
        return about(placed(None, mark), message, self.path, self.text, dotted(self.here()[:MAX_SHOWN]), id=id)

    def here(self) -> Loc:
        """Where the next node will stand."""
        keys = [(level.key and level.key.value) if level.mapping else len(level.values) for level in self.stack]
        return tuple(key for key in keys if key is not None)

    def take(self, event: yaml.Event) -> None:
        """Add one event of the parser, or keep it until a row is known to be one of numbers."""
        if self.row is not None:
            if isinstance(event, yaml.ScalarEvent):
                self.row.append(event)
                return
            kept, self.row = self.row, None
            if isinstance(event, yaml.SequenceEndEvent) and self.whole(len(kept), event.end_mark):
                return
            for entry in kept:
                self.put(entry)
        self.put(event)
        if isinstance(event, yaml.SequenceStartEvent) and event.flow_style:
            self.row = []

    def whole(self, count: int, end: Mark) -> bool:
        """Whether the innermost list, which ends here, is a row of so many numbers; it is added then."""
        started = self.stack[-1].mark
        row = row_of(self.text[started.index : end.index]) if self.nodes + count <= MAX_NODES else None
        if row is None or len(row) != count:
            return False
        self.nodes += count
        self.add(placed(row, started, 1 + count, 1), self.stack.pop().anchor)
        return True

    def put(self, event: yaml.Event) -> None:
        """Add one event of the parser."""
        if len(self.problems) > MAX_PROBLEMS:
            self.stop(event.start_mark, "too much is wrong to read on", id="OBS103")
        if isinstance(event, yaml.ScalarEvent):
            self.check(event)
            if found := NOT_TEXT.search(event.value):  # by an escape
                message = f"holds the character U+{ord(found[0]):04X}, which does not belong in a text"
                self.problems.append(self.problem(event.start_mark, message, id="OBS102"))
            plain = event.implicit[0]
            self.add(placed(scalar(event.value) if plain else event.value, event.start_mark), event.anchor)
        elif isinstance(event, yaml.CollectionStartEvent):
            self.check(event)
            self.begin(event)
        elif isinstance(event, yaml.CollectionEndEvent):
            done = self.stack.pop()
            self.add(placed(done.values, done.mark, done.size, done.height), done.anchor)
        elif isinstance(event, yaml.AliasEvent):
            self.add(self.target(event), None)
        elif isinstance(event, yaml.DocumentStartEvent) and self.root is not None:
            self.stop(event.start_mark, "a second document begins here; a spec is one document", id="OBS105")

    def check(self, event: yaml.ScalarEvent | yaml.CollectionStartEvent) -> None:
        """Refuse tags, and more nodes than a spec can have."""
        self.nodes += 1
        if self.nodes > MAX_NODES:
            self.stop(event.start_mark, f"more than {MAX_NODES:,} values; a spec may not have so many", id="OBS103")
        if event.tag is not None:
            message = f"the tag {described(event.tag)} is not read; write plain numbers, text, lists and mappings"
            self.problems.append(self.problem(event.start_mark, message, id="OBS105"))

    def begin(self, event: yaml.CollectionStartEvent) -> None:
        """Open a list or a mapping."""
        if len(self.stack) == MAX_DEPTH:
            self.stop(event.start_mark, TOO_DEEP, id="OBS103")
        if self.stack and self.stack[-1].mapping and self.stack[-1].key is None:
            self.stop(event.start_mark, "a key must be text, found a list or a mapping", id="OBS106")
        if event.anchor:
            self.anchors[event.anchor] = None
        mapping = isinstance(event, yaml.MappingStartEvent)
        self.stack.append(Open(event.start_mark, event.anchor, mapping=mapping))

    def target(self, event: yaml.AliasEvent) -> Node:
        """Node that an alias stands for."""
        name, mark = event.anchor, event.start_mark
        if name not in self.anchors:
            self.stop(
                mark, f"the alias *{described(name)} has no anchor; quote an expression that begins with *", id="OBS105"
            )
        found = self.anchors[name]
        if found is None:
            self.stop(mark, f"the alias *{described(name)} stands inside what it stands for", id="OBS105")
        self.aliased += found.size
        if self.aliased > MAX_ALIASED:
            self.stop(mark, f"aliases expand to more than {MAX_ALIASED:,} values", id="OBS103")
        if len(self.stack) + found.height > MAX_DEPTH:
            self.stop(mark, TOO_DEEP, id="OBS103")
        return found

    def add(self, node: Node, anchor: str | None) -> None:
        """Put a finished node where it belongs."""
        if anchor:
            self.anchors[anchor] = node
        if not self.stack:
            self.root = node
            return
        parent = self.stack[-1]
        if parent.mapping and parent.key is None:
            parent.key = self.key(node, parent.values)
            return
        if node.value is None and not (parent.key and parent.key.value is None):
            problem, last = self.empty(node), self.problems[-1:]
            if problem.message not in [one.message for one in last if one.line == node.line and "cut" in one.message]:
                self.problems.append(problem)
        parent.size += node.size
        parent.height = max(parent.height, node.height + 1)
        if parent.key is None:
            parent.values.append(node)
            return
        if parent.key.value is not None:
            parent.values[parent.key.value] = parent.key, node
        parent.key = None

    def empty(self, node: Node) -> Problem:
        """Return what is wrong with a value that is not there."""
        message, where = "has no value; give one, or leave it out", dotted(self.here())
        if OPERATOR.search(str(self.here()[-1])):
            message = "is a part of a text, cut at a comma: write the whole text in quotes"
        return about(node, message, self.path, self.text, where, id="OBS108")

    def key(self, node: Node, others: dict[str, tuple[Node, Node]]) -> Node:
        """Check a key. One that is wrong becomes None, and its value is dropped."""
        name = node.value
        if not isinstance(name, str) or isinstance(name, Number):
            id, message = "OBS106", f"a key must be text, found {described(name)}"
            if ends_decimal(node, others):
                message += "; a decimal point is written as a point, such as 9.81"
        elif found := NOT_ONE_LINE.search(name):
            id, message = "OBS102", f"a key is one line of text; this one holds the character U+{ord(found[0]):04X}"
            name = None
        elif name == "<<":
            id, message = "OBS105", "merge keys (<<) are not read; write the keys out"
        elif name in others:
            id, message = (
                "OBS107",
                f"duplicate key {described(name)}; it is given in line {others[name][0].line} already",
            )
        else:
            return node
        loc = self.here() if name is None else (*self.here(), str(name))
        self.problems.append(about(node, message, self.path, self.text, dotted(loc), id=id))
        return node._replace(value=None)


def ends_decimal(node: Node, others: dict[str, tuple[Node, Node]]) -> bool:
    """Whether a key may be the decimals of the number directly before it, such as 81 in {g: 9,81}."""
    last = next(reversed(others.values()), (node, node))[1]
    digits = all(isinstance(one.value, Number) and one.value.lstrip("+-").isdigit() for one in (last, node))
    return digits and last.line == node.line and last.begins + len(last.value) + 1 == node.begins


def placed(value: Any, mark: Mark, size: int = 1, height: int = 0) -> Node:
    """Node that begins at the mark."""
    return Node(value, mark.line + 1, mark.column + 1, mark.index, size, height)
