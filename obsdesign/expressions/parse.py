"""From text to a tree: a precedence parser over a whitelist of characters, names and operations.

comparison < sum < product < unary minus < power (right associative), as in Python. Chained comparisons,
attributes, subscripts, strings, keyword arguments and whatever else Python knows are no part of the language.
"""

import re
import unicodedata
from collections.abc import Callable, Collection, Mapping
from difflib import get_close_matches
from functools import partial
from typing import ClassVar

from flint import fmpq, fmpz

from obsdesign.expressions.constant import ball
from obsdesign.expressions.exact import MAX_EXPONENT, ExpressionError, double
from obsdesign.expressions.functions import COMPARISONS, FUNCTIONS, apply
from obsdesign.expressions.tree import (
    Call,
    Node,
    Number,
    Variable,
    depth_of,
    number,
    postorder,
    product,
    quotient,
    total,
)
from obsdesign.records import dataclass

MAX_LENGTH = 10_000
MAX_NESTING = 100
ALLOWED_SHOWN = 12

TOKEN = re.compile(
    r"(?P<space>[ \t\r\n]+)"
    r"|(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<operator>\*\*|<=|>=|==|!=|[-+*/<>(),])"
)
HINTS = {
    "^": "a power is written **",
    "=": "equality is written ==; keyword arguments are not allowed",
    "'": "a derivative or a transpose is written out",
    '"': "text in quotes is not allowed",
    ".": "attributes are not allowed",
    "[": "subscripts are not allowed; each component has its own name, such as x1",
    ";": "rows of a matrix are lists, separated by commas: [[0, 1], [2, 3]]",
    "%": "the remainder is not available",
    "&": "combine comparisons by *",
    "|": "combine comparisons by + or max",
    "!": "the opposite of c is 1 - c",
}
WORDS = {
    "and": "combine comparisons by *",
    "or": "combine comparisons by + or max",
    "not": "the opposite of c is 1 - c",
    "if": "a choice is written where(condition, a, b)",
    "e": "write exp(1)",
    "ln": "the natural logarithm is log",
    "pow": "a power is written **",
    **dict.fromkeys(("step", "heaviside", "Heaviside", "unitstep"), "a step at t = 1 is written (t >= 1)"),
    **dict.fromkeys(("pulse", "rect"), "a pulse is written (t >= 1)*(t < 2)"),
    "square": "a square wave is written sign(sin(..))",
    **dict.fromkeys(("eye", "zeros", "ones", "diag", "blkdiag", "kron"), "a matrix is written out: [[1, 0], [0, 1]]"),
    **dict.fromkeys(("mod", "fmod", "rem"), "the remainder is not available"),
    **dict.fromkeys(("inf", "Inf", "nan", "NaN", "None", "null"), "every number is finite; write one, or leave it out"),
}

MODULE = re.compile(r"\b(np|numpy|math|sp|sympy|scipy|torch|jnp|casadi|ca)$")


@dataclass(frozen=True)
class Token:
    """A word of the text."""

    kind: str  # number, name, operator, end
    text: str
    column: int


def tokens(text: str) -> list[Token]:
    """Words of a text; raises `ExpressionError` at the first character that has no place in one."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            f"the expression has {len(text)} characters; at most {MAX_LENGTH} are allowed",
            MAX_LENGTH,
            id="OBS303",
        )
    words, column = [], 0
    while column < len(text):
        match = TOKEN.match(text, column)
        if match is None:
            raise ExpressionError(stray(text[column], text[:column], text[column + 1 :]), column, id="OBS301")
        if match.lastgroup != "space":
            words.append(Token(str(match.lastgroup), match.group(), column))
        column = match.end()
    return [*words, Token("end", "the end", len(text))]


def stray(character: str, before: str, after: str) -> str:
    """Message for a character that is not allowed, from what stands before and after it."""
    operation = re.match(r"\*\*?|/|\^|\\", after)
    if character == "." and operation:
        return f"'.{operation[0]}' is not allowed here: values are single numbers; write *, / or **"
    if character == "." and (module := MODULE.search(before)) and (function := re.match(r"\w+", after)):
        name = next(iter(get_close_matches(function[0].lower(), FUNCTIONS, n=1)), function[0])
        return f"'{module[0]}.' is not allowed here: a function has no module before it; write {name}(..)"
    if character in "'[" and not re.search(r"[\w)]\s*$", before):
        return f"{character!r} is not allowed here: a text or a list stands without quotes, in {'[..]'}"
    if character in HINTS:
        return f"{character!r} is not allowed here: {HINTS[character]}"
    if character.isascii():
        return f"the character {character!r} is not allowed"
    described = f"{character!a} ({unicodedata.name(character, 'unnamed')})"
    return f"the character {described} is not allowed: use plain ASCII"


def tree(text: str, names: Collection[str], parameters: Mapping[str, fmpq]) -> Node:
    """Tree of a text; raises `ExpressionError` with the column of what is wrong."""
    parser = Parser(tokens(text), frozenset(names), parameters)
    root = parser.expression(COMPARE)
    if parser.next.kind != "end":
        raise parser.unexpected("an operator")
    for node in postorder(root):
        if isinstance(node, Number) and not representable(node.value):
            raise ExpressionError(
                "a number is out of the range of a double", parser.columns.get(id(node), 0), id="OBS304"
            )
    return root


def representable(value: fmpq) -> bool:
    """Whether a number is finite as a double and does not vanish there."""
    nearest = double(value)
    return abs(nearest) < float("inf") and (nearest != 0 or value == 0)


COMPARE, SUM, PRODUCT, POWER = range(4)
LEVELS = {"+": SUM, "-": SUM, "*": PRODUCT, "/": PRODUCT, "**": POWER} | dict.fromkeys(COMPARISONS, COMPARE)


class Parser:
    """One reading of the words of an expression, from left to right."""

    def __init__(self, words: list[Token], names: frozenset[str], parameters: Mapping[str, fmpq]) -> None:
        self.words = words
        self.names = names
        self.parameters = parameters
        self.position = 0
        self.nesting = 0
        self.columns: dict[int, int] = {}  # of the nodes built so far, for messages

    @property
    def next(self) -> Token:
        """The word that comes."""
        return self.words[self.position]

    def take(self) -> Token:
        """Read a word."""
        token = self.next
        self.position += 1
        return token

    def expect(self, text: str) -> None:
        """Read this word or raise."""
        if self.next.text != text:
            raise self.unexpected(f"'{text}'")
        self.take()

    def unexpected(self, wanted: str) -> ExpressionError:
        """Error at the word that comes."""
        token = self.next
        found = token.text if token.kind == "end" else repr(token.text)
        hint = f"; {WORDS[token.text]}" if token.text in WORDS else ""
        return ExpressionError(f"expected {wanted} but found {found}{hint}", token.column, id="OBS301")

    def build(self, token: Token, make: Callable[[], Node]) -> Node:
        """Node that a word makes; what is wrong with it is wrong at that word."""
        try:
            node = make()
        except ExpressionError as error:
            raise ExpressionError(error.message, token.column, id=error.id) from None
        if depth_of(node) > MAX_NESTING:
            raise ExpressionError(f"nested deeper than {MAX_NESTING} levels", token.column, id="OBS303")
        self.columns[id(node)] = token.column
        return node

    def nested(self, token: Token, level: int) -> Node:
        """Expression one level further in."""
        self.nesting += 1
        if self.nesting > MAX_NESTING:
            raise ExpressionError(f"nested deeper than {MAX_NESTING} levels", token.column, id="OBS303")
        node = self.expression(level)
        self.nesting -= 1
        return node

    def expression(self, level: int) -> Node:
        """Longest expression from here whose operators bind at least as tightly as the level."""
        node = self.operand()
        while (found := LEVELS.get(self.next.text, -1)) >= level:
            node = self.infix[found](self, node)
        return node

    def operand(self) -> Node:
        """Read a number, a name, a call, or an expression with a sign or in parentheses."""
        token = self.take()
        if token.text == "(":
            node = self.nested(token, COMPARE)
            self.expect(")")
            return node
        if token.text in ("-", "+"):
            node = self.nested(token, POWER)
            return self.build(token, lambda: -node) if token.text == "-" else node
        if token.kind == "number":
            return self.build(token, lambda: literal(token.text))
        if token.kind == "name":
            return self.call(token) if self.next.text == "(" else self.name(token)
        self.position -= 1
        raise self.unexpected("a number, a name or '('")

    def name(self, token: Token) -> Node:
        """Read a variable, a parameter or pi."""
        name = token.text
        if name in self.names:
            return Variable(name)
        if name in self.parameters:
            return self.build(token, lambda: number(self.parameters[name]))
        if name == "pi":
            return Call("pi", ())
        if name in FUNCTIONS:
            raise ExpressionError(f"{name} is a function: write {name}(..)", token.column, id="OBS301")
        raise ExpressionError(unknown("name", name, {*self.names, *self.parameters, "pi"}), token.column, id="OBS302")

    def call(self, token: Token) -> Node:
        """Read the arguments of a function."""
        name = token.text
        if name in self.names or name in self.parameters or name == "pi":
            raise ExpressionError(f"'{name}' is no function; a product is written *", token.column, id="OBS301")
        if name not in FUNCTIONS:
            raise ExpressionError(unknown("function", name, FUNCTIONS), token.column, id="OBS302")
        arguments = []
        separator = self.take()
        while separator.text != ")":
            arguments.append(self.nested(separator, COMPARE))
            if self.next.text not in (",", ")"):
                raise self.unexpected("an operator, ',' or ')'")
            separator = self.take()
        least, most = FUNCTIONS[name].arity
        if not least <= len(arguments) <= most:
            count = str(least) if least == most else f"{least} to {most}"
            raise ExpressionError(f"{name} takes {count} argument(s), not {len(arguments)}", token.column, id="OBS301")
        return self.build(token, lambda: apply(name, *arguments))

    def sum(self, first: Node) -> Node:
        """Sum and difference of terms."""
        terms = [first]
        start = self.next
        while self.next.text in ("+", "-"):
            sign = self.take()
            term = self.expression(PRODUCT)
            terms.append(term if sign.text == "+" else -term)
        return self.build(start, lambda: total(terms))

    def product(self, first: Node) -> Node:
        """Product and quotient of factors."""
        factors = [first]
        start = self.next
        while self.next.text in ("*", "/"):
            sign = self.take()
            factor = self.expression(POWER)
            if sign.text == "*":
                factors.append(factor)
                continue
            if isinstance(factor, Number) and factor.value == 0:
                raise ExpressionError("division by zero", sign.column, id="OBS304")
            numerator = product(factors)
            factors = [self.build(sign, partial(quotient, numerator, factor))]
        return self.build(start, lambda: product(factors))

    def power(self, base: Node) -> Node:
        """Power: the exponent may have a sign and a power of its own."""
        token = self.take()
        exponent = self.nested(token, POWER)
        limit_exponent(exponent, token)
        return self.build(token, lambda: base**exponent)

    def comparison(self, left: Node) -> Node:
        """One comparison."""
        token = self.take()
        right = self.expression(SUM)
        if LEVELS.get(self.next.text) == COMPARE:
            raise ExpressionError("comparisons do not chain: write (a < b)*(b < c)", self.next.column, id="OBS301")
        return self.build(token, lambda: apply(token.text, left, right))

    infix: ClassVar = {COMPARE: comparison, SUM: sum, PRODUCT: product, POWER: power}


def literal(text: str) -> Number:
    """Exact number of a decimal text."""
    mantissa, _, exponent = text.lower().partition("e")
    whole, _, decimals = mantissa.partition(".")
    shift = int(exponent or 0) if len(exponent) < 8 else MAX_LENGTH + 1
    if abs(shift) > MAX_LENGTH:
        raise ExpressionError("a number is out of the range of a double", id="OBS304")
    value = number(fmpq(fmpz(whole + decimals)) * fmpq(10) ** (shift - len(decimals)))
    if exponent and not representable(value.value):
        raise ExpressionError("a number is out of the range of a double", id="OBS304")
    return value


def limit_exponent(exponent: Node, token: Token) -> None:
    """Refuse a large exponent that is a constant, be it irrational."""
    order = postorder(exponent)
    if any(isinstance(node, Variable) for node in order):
        return
    if not abs(ball(order, {}, 64)) <= MAX_EXPONENT:
        raise ExpressionError(f"an exponent may be at most {MAX_EXPONENT} in magnitude", token.column, id="OBS303")


def unknown(kind: str, name: str, allowed: Collection[str]) -> str:
    """Message for a word that is not known, with the nearest that is."""
    message = f"unknown {kind} '{name}'"
    if name in WORDS:
        return f"{message}: {WORDS[name]}"
    folded = {word.lower(): word for word in sorted(allowed)}
    if near := get_close_matches(name.lower(), folded, n=1):
        message += f"; did you mean '{folded[near[0]]}'?"
    elif kind == "function":
        message += "; a product is written *"
    if len(allowed) <= ALLOWED_SHOWN:
        message += f"; allowed: {', '.join(sorted(allowed))}"
    return message
