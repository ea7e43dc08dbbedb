"""YAML text to a tree of nodes that know their line and column: the only YAML code.

Scalars are read as YAML 1.2 (core schema) says, not 1.1: `1e-3` is a number, `010` is ten, `no` is text.
A number keeps its text, so that a decimal is exact. Hostile files (alias bombs, towers of brackets) are
refused while their events arrive, before there is a tree.
"""

import re
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import yaml

from obsdesign.errors import NOT_ONE_LINE, Problem, UsageError
from obsdesign.files import content_of
from obsdesign.sections.scalars import Number, described, scalar

MAX_BYTES = 4 * 2**20
TOO_LARGE = "is larger than 4 MiB; a spec may not be"
TOO_DEEP = "nested deeper than 32 levels; a spec needs no more"
MAX_DEPTH = 32  # lists and mappings inside each other
MAX_NODES = 180_000  # a dense A with 400 states has 160,000
MAX_SEPARATORS = 250_000  # commas and lines: many more values than that are not worth parsing
TOO_MANY = f"more than {MAX_SEPARATORS:,} commas and lines; a spec may not have so many values"
MAX_PROBLEMS = 100
MAX_SHOWN = 4  # parts of a key in a message about YAML
MAX_ALIASED = 100_000  # nodes that all aliases together stand for

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
OPERATOR = re.compile(r"[*/()+<>]")
NOT_TEXT = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]")

Loc = tuple[str | int, ...]
Mark = Any  # of PyYAML, or of libyaml


class Node(NamedTuple):
    """A value and where it begins: line and column are counted from 1."""

    value: Any  # None, bool, Number, str, list[Node], or dict[str, tuple[Node, Node]] of keys and values
    line: int
    column: int
    begins: int  # index in the text
    size: int = 1  # nodes in it, each alias counted as what it stands for
    height: int = 0  # lists and mappings inside each other
    origin: str = ""  # what put it there, if it stands in no line of the text

    def plain(self) -> Any:
        """Return the values without their places."""
        if isinstance(self.value, dict):
            return {name: node.plain() for name, (_, node) in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain() for node in self.value]
        return self.value


class Document(NamedTuple):
    """One YAML document, and what is wrong in it as YAML where the rest could still be read."""

    path: str
    text: str
    root: Node
    problems: tuple[Problem, ...]

    def problem(self, loc: Loc, message: str, *, at_key: bool = False, column: int = 0) -> Problem:
        """Return what is wrong at `loc`, placed at its value or its key.

        `column`: where in a text, from 0. It moves the place only if the text is written out in one line.
        """
        key, value = self.find(loc)
        node = key if at_key else value
        if node.origin:
            return Problem(message, node.origin, key=dotted(loc))
        if column and isinstance(node.value, str):
            quote = int(self.text[node.begins] in "'\"")
            column = quote + column if self.text.startswith(node.value, node.begins + quote) else 0
        return Problem(message, self.path, node.line, node.column + column, dotted(loc))

    def find(self, loc: Loc) -> tuple[Node, Node]:
        """Key and value at `loc`, or of the part of `loc` that there is."""
        key = node = self.root
        for name in loc:
            if isinstance(node.value, dict) and name in node.value:
                key, node = node.value[name]
            elif isinstance(node.value, list) and isinstance(name, int) and name < len(node.value):
                key = node = node.value[name]
            else:
                return key, key
        return key, node


def dotted(loc: Loc) -> str:
    """`loc` as a user reads it, such as system.A[0][1]."""
    parts = (f"[{name}]" if isinstance(name, int) else f".{described(name)}" for name in loc)
    return "".join(parts).removeprefix(".")


def read(path: str) -> str:
    """Text of a file.

    Raises `UsageError`: it cannot be read, is larger than 4 MiB, or is not UTF-8 text.
    """
    if Path(path).is_dir():
        raise UsageError(Problem("is a folder; give a spec file", path))
    data = content_of(path, MAX_BYTES)
    if len(data) > MAX_BYTES:
        raise UsageError(Problem(TOO_LARGE, path))
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise UsageError(Problem(f"is not UTF-8 text (byte {error.start}); a spec is a YAML file", path)) from None


def compose(text: str, path: str) -> Document:
    """Read one YAML document.

    Raises `UsageError`: it is not YAML, is empty, too large, too deep, or holds more than one document.
    """
    if len(text) > MAX_BYTES:
        raise UsageError(Problem(TOO_LARGE, path))
    if text.count(",") + text.count("\n") > MAX_SEPARATORS:
        raise UsageError(Problem(TOO_MANY, path, 1, 1))
    text = text.removeprefix("\ufeff")
    if found := NOT_TEXT.search(text):
        line = text.count("\n", 0, found.start()) + 1
        column = found.start() - text.rfind("\n", 0, found.start())
        message = f"the character U+{ord(found[0]):04X} does not belong in a text file; a spec is a YAML file"
        raise UsageError(Problem(message, path, line, column))
    composer = Composer(path)
    try:
        for event in yaml.parse(text, LOADER):
            composer.take(event)
    except yaml.MarkedYAMLError as error:
        mark = transpose(error, text) or error.problem_mark or error.context_mark
        place = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        raise UsageError(*composer.problems, Problem(explained(error, text), path, *place)) from None
    if composer.root is None or composer.root.value is None:
        raise UsageError(Problem("is empty; a spec begins with `obsdesign: 1`", path))
    return Document(path, text, composer.root, tuple(composer.problems))


def explained(error: yaml.MarkedYAMLError, text: str) -> str:
    """One line for a syntax error."""
    mark = error.problem_mark
    if mark is not None and text[mark.index : mark.index + 1] == "\t":
        return "a tab cannot indent YAML; use spaces"
    if transpose(error, text):
        return "a ' after a list is no transpose; write the rows of the transposed matrix out: [[0], [1]]"
    message = f"not valid YAML: {error.problem}"
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

    def __init__(self, path: str) -> None:
        self.path = path
        self.root: Node | None = None
        self.problems: list[Problem] = []
        self.stack: list[Open] = []
        self.anchors: dict[str, Node | None] = {}  # None: still open
        self.nodes = 0
        self.aliased = 0

    def stop(self, mark: Mark, message: str) -> NoReturn:
        """Give up reading, with all that was found wrong so far."""
        raise UsageError(*self.problems, self.problem(mark, message))

    def problem(self, mark: Mark, message: str) -> Problem:
        """Return what is wrong at the mark, with the key under which it stands."""
        return Problem(message, self.path, mark.line + 1, mark.column + 1, dotted(self.here()[:MAX_SHOWN]))

    def here(self) -> Loc:
        """Where the next node will stand."""
        keys = [(level.key and level.key.value) if level.mapping else len(level.values) for level in self.stack]
        return tuple(key for key in keys if key is not None)

    def take(self, event: yaml.Event) -> None:
        """Add one event of the parser."""
        if len(self.problems) > MAX_PROBLEMS:
            self.stop(event.start_mark, "too much is wrong to read on")
        if isinstance(event, yaml.ScalarEvent):
            self.check(event)
            if found := NOT_TEXT.search(event.value):  # by an escape
                message = f"holds the character U+{ord(found[0]):04X}, which does not belong in a text"
                self.problems.append(self.problem(event.start_mark, message))
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
            self.stop(event.start_mark, "a second document begins here; a spec is one document")

    def check(self, event: yaml.ScalarEvent | yaml.CollectionStartEvent) -> None:
        """Refuse tags, and more nodes than a spec can have."""
        self.nodes += 1
        if self.nodes > MAX_NODES:
            self.stop(event.start_mark, f"more than {MAX_NODES:,} values; a spec may not have so many")
        if event.tag is not None:
            message = f"the tag {described(event.tag)} is not read; write plain numbers, text, lists and mappings"
            self.problems.append(self.problem(event.start_mark, message))

    def begin(self, event: yaml.CollectionStartEvent) -> None:
        """Open a list or a mapping."""
        if len(self.stack) == MAX_DEPTH:
            self.stop(event.start_mark, TOO_DEEP)
        if self.stack and self.stack[-1].mapping and self.stack[-1].key is None:
            self.stop(event.start_mark, "a key must be text, found a list or a mapping")
        if event.anchor:
            self.anchors[event.anchor] = None
        mapping = isinstance(event, yaml.MappingStartEvent)
        self.stack.append(Open(event.start_mark, event.anchor, mapping=mapping))

    def target(self, event: yaml.AliasEvent) -> Node:
        """Node that an alias stands for."""
        name, mark = event.anchor, event.start_mark
        if name not in self.anchors:
            self.stop(mark, f"the alias *{described(name)} has no anchor; quote an expression that begins with *")
        found = self.anchors[name]
        if found is None:
            self.stop(mark, f"the alias *{described(name)} stands inside what it stands for")
        self.aliased += found.size
        if self.aliased > MAX_ALIASED:
            self.stop(mark, f"aliases expand to more than {MAX_ALIASED:,} values")
        if len(self.stack) + found.height > MAX_DEPTH:
            self.stop(mark, TOO_DEEP)
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
        return Problem(message, self.path, node.line, node.column, where)

    def key(self, node: Node, others: dict[str, tuple[Node, Node]]) -> Node:
        """Check a key. One that is wrong becomes None, and its value is dropped."""
        name = node.value
        if not isinstance(name, str) or isinstance(name, Number):
            message = f"a key must be text, found {described(name)}"
            if ends_decimal(node, others):
                message += "; a decimal point is written as a point, such as 9.81"
        elif found := NOT_ONE_LINE.search(name):
            message = f"a key is one line of text; this one holds the character U+{ord(found[0]):04X}"
            name = None
        elif name == "<<":
            message = "merge keys (<<) are not read; write the keys out"
        elif name in others:
            message = f"duplicate key {described(name)}; it is given in line {others[name][0].line} already"
        else:
            return node
        loc = self.here() if name is None else (*self.here(), str(name))
        self.problems.append(Problem(message, self.path, node.line, node.column, dotted(loc)))
        return node._replace(value=None)


def ends_decimal(node: Node, others: dict[str, tuple[Node, Node]]) -> bool:
    """Whether a key may be the decimals of the number directly before it, such as 81 in {g: 9,81}."""
    last = next(reversed(others.values()), (node, node))[1]
    digits = all(isinstance(one.value, Number) and one.value.lstrip("+-").isdigit() for one in (last, node))
    return digits and last.line == node.line and last.begins + len(last.value) + 1 == node.begins


def placed(value: Any, mark: Mark, size: int = 1, height: int = 0) -> Node:
    """Node that begins at the mark."""
    return Node(value, mark.line + 1, mark.column + 1, mark.index, size, height)
