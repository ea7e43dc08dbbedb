"""Expressions as code: what C, Python and MATLAB have in common, and where they differ."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.expressions.exact import double
from obsdesign.expressions.functions import COMPARISONS
from obsdesign.expressions.tree import Call, Number, equals, fold
from obsdesign.records import dataclass, field

LONGEST = 60  # characters of an identifier: C tells 63 apart, and MATLAB takes no more
CONDITION, SUM, PRODUCT, UNARY, ATOM = range(5)  # how tightly code binds


class Code(NamedTuple):
    """Code of a value; `truth`: the same as a condition, where it is one."""

    text: str
    binding: int
    truth: str = ""

    def within(self, least: int) -> str:
        """Text, in parentheses if it binds less tightly than its place needs."""
        return self.text if self.binding >= least else f"({self.text})"


@dataclass
class Language:
    """How a language writes numbers, functions and choices; `used`: functions that were written so far."""

    number: Callable[[float], str]
    functions: Mapping[str, str]  # names of the functions of the trade, and of `square` and `cube`
    choice: str  # of condition {c}, and values {a} and {b}
    unequal: str = "!="
    used: set[str] = field(default_factory=set)

    def code(self, side: Expression, names: Mapping[str, str]) -> str:
        """Code of an expression whose variables have these names."""
        return self.written(side, names).text

    def written(self, side: Expression, names: Mapping[str, str]) -> Code:
        """The same, with how it binds."""
        return fold(side.order, self.constant, lambda name: Code(names[name], ATOM), self.operation)

    def constant(self, value: fmpq) -> Code:
        """A number, rounded to a double."""
        found = double(value)
        return Code(self.number(found), ATOM if found >= 0 else UNARY)

    def operation(self, node: Call, arguments: list[Code]) -> Code:
        """An operation of the table, from the codes of its arguments."""
        made = {"+": self.sum, "*": self.product, "/": self.quotient, "**": self.power, "where": self.where}
        if node.operation in made:
            return made[node.operation](node, arguments)
        return (self.comparison if node.operation in COMPARISONS else self.call)(node.operation, arguments)

    def sum(self, _: Call, arguments: list[Code]) -> Code:
        """A sum, from the left."""
        terms = [one.within(PRODUCT) for one in arguments]
        return Code(terms[0] + "".join(f" - {t[1:]}" if t[0] == "-" else f" + {t}" for t in terms[1:]), SUM)

    def product(self, node: Call, arguments: list[Code]) -> Code:
        """A product, from the left."""
        first, *others = arguments
        tail = [one.within(ATOM) for one in others]
        if equals(node.arguments[0], -1):
            return Code("-" + "*".join(tail), PRODUCT)
        return Code("*".join([first.within(PRODUCT), *tail]), PRODUCT)

    def quotient(self, _: Call, arguments: list[Code]) -> Code:
        """A quotient."""
        return Code(f"{arguments[0].within(PRODUCT)}/{arguments[1].within(ATOM)}", PRODUCT)

    def where(self, _: Call, arguments: list[Code]) -> Code:
        """A choice by a condition."""
        condition = arguments[0].truth or f"{arguments[0].within(SUM)} {self.unequal} {self.number(0.0)}"
        return Code(self.choice.format(c=condition, a=arguments[1].text, b=arguments[2].text), ATOM)

    def power(self, node: Call, arguments: list[Code]) -> Code:
        """Power: squares and cubes by multiplication."""
        base, exponent = node.arguments[0], node.arguments[1]
        times = {2: "square", 3: "cube"}
        if isinstance(exponent, Number) and exponent.value in (2, 3):
            count = int(exponent.value.p)
            if isinstance(base, Call):
                return self.call(times[count], arguments[:1])
            return Code("*".join([arguments[0].within(ATOM)] * count), PRODUCT)
        return self.call("**", arguments)

    def comparison(self, name: str, arguments: list[Code]) -> Code:
        """A comparison, which is 1 or 0."""
        sign = self.unequal if name == "!=" else name
        truth = f"{arguments[0].within(SUM)} {sign} {arguments[1].within(SUM)}"
        return Code(self.choice.format(c=truth, a=self.number(1.0), b=self.number(0.0)), ATOM, truth)

    def call(self, name: str, arguments: list[Code]) -> Code:
        """A function; of more than two arguments, as min and max have, one after the other."""
        self.used.add(name)
        if name == "pi":
            return Code(self.functions[name], ATOM)
        text = arguments[0].text
        for k, other in enumerate(arguments[1:]):
            text = f"{self.functions[name]}({text}, {other.text})" if k else self.pair(name, text, other.text)
        return Code(text if arguments[1:] else f"{self.functions[name]}({text})", ATOM)

    def pair(self, name: str, first: str, second: str) -> str:
        """A function of two arguments."""
        return f"{self.functions[name]}({first}, {second})"


def identifiers(names: tuple[str, ...], reserved: frozenset[str]) -> dict[str, str]:
    """Identifiers for signals: letters, digits and _, none of them reserved, each its own; long ones are cut."""
    found: dict[str, str] = {}
    taken = set(reserved)
    for name in names:
        made = "".join(c if c.isascii() and (c.isalnum() or c == "_") else "_next" if c == "+" else "_" for c in name)
        made = made if made and made[0].isalpha() else f"x_{made}"
        made = made if len(made) <= LONGEST else f"{made[: LONGEST // 2]}_{made[1 - LONGEST // 2 :]}"
        while made in taken:
            made += "_"
        taken.add(made)
        found[name] = made
    return found
