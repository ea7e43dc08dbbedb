"""Symbols, numbers, matrices and expressions as MathML, which browsers set without any script."""

import re
from collections.abc import Iterable, Sequence

from flint import fmpq
from markupsafe import Markup

from obsdesign.expressions import Expression
from obsdesign.expressions.tree import ATOM, BINDING, COMPARISON, POWER, PRODUCT, SUM, Call, fold, postorder
from obsdesign.lmi.formula import Array
from obsdesign.tables.split import shown

LETTERS = "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi rho sigma tau phi psi omega"
GREEK = dict(zip(LETTERS.split(), "αβγδεζηθκλμνξρστφψω", strict=True))
SIGNS = {"<=": "≤", ">=": "≥", "!=": "≠", "==": "="}
DOT = "˙"  # derivative with respect to time
INVISIBLE, MINUS = Markup("<mo>&#x2062;</mo>"), Markup("<mo>−</mo>")
Written = tuple[Markup, int, bool]  # what is written, how tightly it binds, and whether a minus stands before it


def row(*parts: Markup) -> Markup:
    """Parts side by side."""
    return Markup("<mrow>{}</mrow>").format(Markup("").join(parts))


def operator(sign: str) -> Markup:
    """Sign of an operation or a relation."""
    return Markup("<mo>{}</mo>").format(sign)


def symbol(name: str, accent: str = "") -> Markup:
    """Name of a signal: x1 with an index, theta as a Greek letter, hat_x with a hat, words upright; with an accent."""
    if name.startswith("hat_"):
        return symbol(name.removeprefix("hat_"), "^")
    base, index = re.fullmatch(r"(.*?)_?(\d*)", name, re.DOTALL).groups()  # type: ignore[union-attr]
    return indexed(GREEK.get(base.lower(), base) or name, index if base else "", accent)


def indexed(letter: str, index: str = "", accent: str = "") -> Markup:
    """Letter with an index, such as B_f, and with an accent above it."""
    made = Markup("<mi>{}</mi>" if len(letter) == 1 else '<mi mathvariant="normal">{}</mi>').format(letter)
    if accent:
        made = Markup('<mover accent="true">{}<mo>{}</mo></mover>').format(made, accent)
    lower = Markup("<mn>{}</mn>" if index.isdigit() else "<mi>{}</mi>").format(index)
    return Markup("<msub>{}{}</msub>").format(made, lower) if index else made


def ahead(made: Markup) -> Markup:
    """What is written, at the next sample."""
    return Markup("<msup>{}<mo>+</mo></msup>").format(made)


def number(value: fmpq) -> Markup:
    """Number in full where it is short, else in 6 digits and with dots."""
    text, minus = shown(abs(value)), MINUS if value < 0 else Markup("")
    if "/" in text:
        return row(minus, Markup("<mfrac><mn>{}</mn><mn>{}</mn></mfrac>").format(*text.split("/")))
    digits, _, power = text.removesuffix("..").partition("e")
    dots = Markup("<mo>…</mo>") if text.endswith("..") else Markup("")
    ten = Markup("<mo>·</mo><msup><mn>10</mn><mn>{}</mn></msup>").format(int(power)) if power else Markup("")
    return row(minus, Markup("<mn>{}</mn>").format(digits), dots, ten)


ONE = number(fmpq(1))


def matrix(entries: Array) -> Markup:
    """Exact matrix in brackets; zeros step back."""
    zero = Markup('<mtd class="zero"><mn>0</mn></mtd>')
    lines = [[zero if x == 0 else Markup("<mtd>{}</mtd>").format(number(x)) for x in line] for line in entries]
    return bracketed(lines)


def column(entries: Iterable[Markup]) -> Markup:
    """Column of what is written already."""
    return bracketed([[Markup("<mtd>{}</mtd>").format(entry)] for entry in entries])


def bracketed(lines: Sequence[Sequence[Markup]]) -> Markup:
    """Cells in brackets."""
    rows = Markup("").join(Markup("<mtr>{}</mtr>").format(Markup("").join(line)) for line in lines)
    return Markup('<mrow><mo stretchy="true">[</mo><mtable>{}</mtable><mo stretchy="true">]</mo></mrow>').format(rows)


def total(terms: Sequence[Markup]) -> Markup:
    """Sum, or 0."""
    parts = [part for term in terms for part in (operator("+"), term)]
    return row(*parts[1:]) if parts else Markup("<mn>0</mn>")


def equation(left: Markup, right: Markup) -> Markup:
    """Left side = right side."""
    return row(left, operator("="), right)


def block(content: Markup) -> Markup:
    """Formula on a line of its own."""
    return Markup('<div class="line"><math displaystyle="true">{}</math></div>').format(content)


def inline(content: Markup) -> Markup:
    """Formula within a line."""
    return Markup("<math>{}</math>").format(content)


def expression(e: Expression) -> Markup:
    """Expression as it would be written by hand: fractions, powers, and products without a sign."""
    return whole(
        fold(
            postorder(e.root),
            lambda value: (number(abs(value)), PRODUCT if value.q != 1 else ATOM, bool(value < 0)),
            lambda name: (symbol(name), ATOM, False),
            call,
        )
    )


def whole(written: Written) -> Markup:
    """With its minus."""
    content, binding, negative = written
    return row(MINUS, enclosed((content, binding, False), PRODUCT)) if negative else content


def enclosed(written: Written, least: int) -> Markup:
    """In parentheses where it binds less tightly than its place needs, or begins with a minus."""
    content, binding, negative = written
    if binding >= least and not negative:
        return content
    return parenthesised([whole(written)])


def parenthesised(parts: Sequence[Markup]) -> Markup:
    """Parts between commas, in parentheses as high as a letter where nothing in them is higher."""
    inner = [part for argument in parts for part in (operator(","), argument)][1:]
    tall = any(tag in part for part in parts for tag in ("<mfrac>", "<msup>", "<mtable>", "<msqrt>"))
    left, right = (Markup('<mo stretchy="{}">{}</mo>').format(str(tall).lower(), sign) for sign in "()")
    return row(left, *inner, right)


def call(node: Call, arguments: list[Written]) -> Written:
    """Operation on what is written of its arguments."""
    binding = BINDING.get(node.operation)
    if node.operation == "*":
        return product(arguments)
    if node.operation == "/":
        (above, _, negative), below = arguments[0], arguments[1]
        return Markup("<mfrac>{}{}</mfrac>").format(above, whole(below)), PRODUCT, negative
    if binding == SUM:
        first, *others = arguments
        parts = [whole(first)]
        for content, inner, negative in others:
            parts += [MINUS if negative else operator("+"), enclosed((content, inner, False), PRODUCT)]
        return row(*parts), SUM, False
    if binding == POWER:
        base, exponent = arguments
        return Markup("<msup>{}{}</msup>").format(enclosed(base, ATOM), whole(exponent)), POWER, False
    if binding == COMPARISON:
        left, right = map(whole, arguments)
        return row(left, operator(SIGNS.get(node.operation, node.operation)), right), COMPARISON, False
    return applied(node.operation, [whole(argument) for argument in arguments]), ATOM, False


def product(factors: list[Written]) -> Written:
    """Product; the minus of its first factor stands before it, and a dot between two numbers."""
    (first, binding, negative), *others = factors
    if str(first) == str(ONE) and len(others) == 1:
        content, inner, second = others[0]
        return content, inner, negative != second
    parts = [] if str(first) == str(ONE) else [enclosed((first, binding, False), PRODUCT)]
    parts += [enclosed(factor, PRODUCT) for factor in others]
    return Markup(INVISIBLE).join(parts), PRODUCT, negative


def applied(function: str, arguments: list[Markup]) -> Markup:
    """Function of its arguments."""
    if function == "abs":
        bar = Markup('<mo stretchy="false">|</mo>')
        return row(bar, *arguments, bar)
    if function == "sqrt":
        return Markup("<msqrt>{}</msqrt>").format(*arguments)
    name = indexed({"pi": "π"}.get(function, function))
    if not arguments:
        return name
    return row(name, Markup("<mo>&#x2061;</mo>"), parenthesised(arguments))
