"""Values of a YAML text with their places; rows of decimals, [0, -1.5, 2e-3], are read in one go.

A plant with 256 states has 66,000 entries. A node of the tree for each, and each read as an expression, would take ten
times as long as the parser takes. So a row is the texts of its numbers and the place of its bracket: where one of them
stands is found in the text of the row, which only a message asks for.
"""

import re
from typing import Any, NamedTuple

from obsdesign.sections.scalars import Number

DECIMAL = r"-?(?:0|[1-9][0-9]{0,24})(?:\.[0-9]{0,24})?(?:[eE][-+]?[0-9]{1,2})?"  # in the range of a double
ROW = re.compile(rf"\[[ \n]*{DECIMAL}[ \n]*(?:,[ \n]*{DECIMAL}[ \n]*)*\]")
ENTRY = re.compile(DECIMAL)


class Row(list[Number]):
    """Numbers of a row, each as its text, with the text of the row itself."""

    __slots__ = ("source",)

    def __init__(self, source: str) -> None:
        super().__init__(map(Number, ENTRY.findall(source)))
        self.source = source

    def places(self) -> list[int]:
        """Where in the text of the row each of them begins."""
        return [found.start() for found in ENTRY.finditer(self.source)]


class Node(NamedTuple):
    """A value and where it begins: line and column are counted from 1."""

    value: Any  # None, bool, Number, str, list[Node], Row, or dict[str, tuple[Node, Node]] of keys and values
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
        if isinstance(self.value, list) and not isinstance(self.value, Row):
            return [node.plain() for node in self.value]
        return self.value

    @property
    def entries(self) -> list["Node"]:
        """Nodes of a list; those of a row are found in its text."""
        if not isinstance(self.value, Row):
            return list(self.value)
        return [self.within(*found) for found in zip(self.value, self.value.places(), strict=True)]

    def within(self, value: Any, index: int) -> "Node":
        """Node in a row, from where it begins in the text of the row."""
        before = self.value.source[:index]
        line, (*_, last) = before.count("\n"), before.split("\n")
        column = len(last) + (1 if line else self.column)
        return Node(value, self.line + line, column, self.begins + index, origin=self.origin)


def row_of(source: str) -> Row | None:
    """Row of a text from bracket to bracket; None if anything else than decimals stands in it, such as a comment."""
    return Row(source) if ROW.fullmatch(source) else None
