"""Functions of signals in Coq: their text at a time t, what they need, and what ring and linear arithmetic prove."""

from collections.abc import Iterator, Mapping, Sequence
from functools import reduce

from flint import fmpq

from obsdesign.coq.functions import real
from obsdesign.expressions import Expression, ExpressionError
from obsdesign.expressions.algebra import Symbols
from obsdesign.expressions.functions import operation
from obsdesign.expressions.needs import Need, further, needs
from obsdesign.expressions.tree import Call, Node, Number, Variable, fold, number, postorder, product, quotient
from obsdesign.records import dataclass

Ends = tuple[fmpq | None, fmpq | None]  # None: no limit
ZERO = fmpq(0)
MAX_POWER = 64
DERIVED = {"exp": "exp", "log": "ln", "sin": "sin", "cos": "cos", "sqrt": "sqrt"}  # by auto_derive of Coquelicot
VALUES = DERIVED | {"abs": "Rabs", "tanh": "tanh", "sinh": "sinh", "cosh": "cosh", "atan": "atan"}
WORDS = """\
as at cofix else end exists exists2 fix for forall fun if IF in is isn let match mod of Prop return Set then Type
using where with _ SProp by R Ropp PI Rabs ln exp sin cos sqrt tanh sinh cosh atan is_derive T run obeys
decays still vanishes below"""
KEYWORDS = frozenset(WORDS.split())  # of Coq, and names of the library that a file has in its statement
FACTS = {"exp": "exp_pos", "sqrt": "sqrt_pos", "sin": "SIN_bound", "cos": "COS_bound"}
RANGES: dict[str, Ends] = {"exp": (ZERO, None), "sqrt": (ZERO, None), "sin": (fmpq(-1), fmpq(1))}
RANGES["cos"] = RANGES["sin"]
SUM, PRODUCT, POWER, ATOM = range(4)


class UnknownTermError(Exception):
    """A part of a function that the library in Coq does not know, in words."""


@dataclass(frozen=True)
class Term:
    """Text of a size and how tightly it binds, and whether it is the negative of this size."""

    size: str
    level: int
    negative: bool = False

    def of_level(self, level: int) -> str:
        """Its size as an operand of an operation that binds as tightly."""
        return self.size if self.level >= level else f"({self.size})"

    def within(self, level: int) -> str:
        """The text as an operand of an operation that binds as tightly."""
        if self.negative:
            return f"({self.text})"
        return self.of_level(level)

    @property
    def text(self) -> str:
        """The text by itself."""
        return f"- {self.of_level(POWER)}" if self.negative else self.size


def literal(c: fmpq) -> Term:
    """A number."""
    size = real(abs(c)).strip("()")
    return Term(size, PRODUCT if "/" in size else ATOM, bool(c < 0))


def text(f: Expression, names: Mapping[str, str]) -> str:
    """Function of signals at the time t, by their names in Coq. Raises `UnknownTermError`."""
    return term(f, names).text


def operand(f: Expression, names: Mapping[str, str]) -> str:
    """The same as an argument of a function in Coq."""
    return argument(term(f, names))


def term(f: Expression, names: Mapping[str, str]) -> Term:
    """Function of signals at the time t, of which t is itself."""

    def variable(name: str) -> Term:
        return Term(name, ATOM) if name == "t" else Term(f"{names[name]} t", ATOM)

    return fold(f.order, literal, variable, called)


def called(node: Call, terms: list[Term]) -> Term:
    """Text of an operation; raises `UnknownTermError`."""
    first, *others = terms or [Term("PI", ATOM)]
    match node.operation, node.arguments:
        case "+", _:
            signs = [f" - {x.of_level(PRODUCT)}" if x.negative else f" + {x.size}" for x in others]
            found = Term(first.text + "".join(signs), SUM)
        case "*", _:
            sizes = [first.of_level(PRODUCT), *(x.of_level(POWER) for x in others)]
            kept = [(size, x.level) for size, x in zip(sizes, terms, strict=True) if size != "1"] or [("1", ATOM)]
            level = PRODUCT if len(kept) > 1 else max(PRODUCT, kept[0][1])
            odd = sum(x.negative for x in terms) % 2 == 1
            found = Term(" * ".join(size for size, _ in kept), level, odd)
        case "/", _:
            (below,) = others
            found = Term(
                f"{first.of_level(PRODUCT)} / {below.of_level(POWER)}", PRODUCT, first.negative != below.negative
            )
        case "**", (_, Number(e)) if e.q == 1 and abs(e) <= MAX_POWER:
            power = f"{first.within(ATOM)} ^ {abs(int(e))}"
            found = Term(power, POWER) if e > 0 else Term(f"/ ({power})", PRODUCT)
        case "**", (_, Number(e)) if e == fmpq(1, 2):
            found = Term(f"sqrt {argument(first)}", POWER)
        case "pi", ():
            found = first
        case name, (_,) if name in VALUES:
            found = Term(f"{VALUES[name]} {argument(first)}", POWER)
        case _:
            raise UnknownTermError(f"{Expression(node)} is no function that the library in Coq knows")
    return found


def argument(one: Term) -> str:
    """Text as the argument of a function."""
    inner = one.within(ATOM)
    return f"({inner})" if " " in inner and one.level == ATOM and not one.negative else inner


def opaque(f: Expression) -> Expression:
    """Function of which ring knows no more than the rational operations, other functions as variables.

    Exponentials of sums are products of those of the terms; exponentials and logarithms undo each other.
    """

    def call(node: Call, arguments: list[Node]) -> Node:
        match node.operation, node.arguments:
            case (("+" | "*" | "/"), _):
                return operation(node, arguments)
            case "**", (_, Number(e)) if e.q == 1:
                return arguments[0] ** number(e)
            case "exp", (inner,):
                terms = inner.arguments if isinstance(inner, Call) and inner.operation == "+" else (inner,)
                return product([exponential(term) for term in terms])
            case "log", (Call("exp", (inner,)),):
                return opaque(Expression(inner)).root
        return Variable(Expression(node).text)

    return Expression(fold(f.order, number, Variable, call))


def exponential(term: Node) -> Node:
    """Exponential of a term, as a variable or its inverse."""
    negative = term
    match term:
        case Number(c) if c < 0:
            negative = number(-c)
        case Call("*", (Number(c), *others)) if c < 0:
            negative = product([number(-c), *others])
        case Call("/", (Number(c), below)) if c < 0:
            negative = quotient(number(-c), below)
    if isinstance(term, Call) and term.operation == "log":
        return opaque(Expression(term.arguments[0])).root
    if negative is term:
        return Variable(f"exp({Expression(term)})")
    return quotient(number(1), Variable(f"exp({Expression(negative)})"))


def vanishes(f: Expression) -> bool:
    """Whether field proves that a function is zero, wherever no divisor is."""
    try:
        shown = opaque(f)
        symbols = Symbols.of([shown])
        return symbols.equal(symbols.fraction(shown), symbols.constant(0))
    except ExpressionError:
        return False


@dataclass(frozen=True)
class Bounds:
    """Range of a function that linear arithmetic proves, from ranges of signals and facts of other terms."""

    low: fmpq | None
    high: fmpq | None
    signals: tuple[str, ...]  # whose ranges it takes
    facts: tuple[tuple[str, Expression | None, int], ...]  # lemma, its argument, half of the power that it is about
    open: bool = False  # whether no bound is attained

    def shows(self, sign: str) -> bool:
        """Whether the function is shown to have a sign, as a `Need` has it."""
        above = self.low is not None and (self.low > 0 or (self.low == 0 and (self.open or sign == ">= 0")))
        below = self.high is not None and (self.high < 0 or (self.high == 0 and self.open))
        return above or (below and sign == "is not 0")


def bounds(f: Expression, ranges: Mapping[str, Ends]) -> Bounds:
    """Range of a function that is a polynomial in signals and other functions."""
    shown = opaque(f)
    inner = {Expression(node).text: node for node in f.order if isinstance(node, Call)}
    try:
        symbols = Symbols.of([shown])
        value = symbols.reduced(symbols.fraction(shown))
    except ExpressionError:
        return Bounds(None, None, (), ())
    if not value.below.is_constant():
        return Bounds(None, None, (), ())
    signals, facts, low, high, strict = set[str](), dict[tuple[str, str, int], Node | None](), ZERO, ZERO, False
    ends: list[Ends] = []
    scale = fmpq(value.below.leading_coefficient())
    for powers, c in value.above.to_dict().items():
        used = [(symbols.terms[i].text, int(n)) for i, n in enumerate(powers) if n]
        if not used:
            ends.append((c / scale, c / scale))
            continue
        name, n = used[0]
        node = inner.get(name)
        one: Ends = (None, None)
        if len(used) == 1 and n == 1 and isinstance(node, Call) and node.operation in RANGES:
            one = RANGES[node.operation]
            strict |= node.operation == "exp"
            facts[(FACTS[node.operation], name, 0)] = node.arguments[0]
        elif len(used) == 1 and n == 1 and node is None:
            one = (ZERO, None) if name == "t" else ranges.get(name, (None, None))
            signals |= {name} - {"t"}
        elif len(used) == 1 and n % 2 == 0:
            one = (ZERO, None)
            facts[("even_power", name, n // 2)] = node or Variable(name)
        ends.append(scaled(one, c / scale))
    for least, most in ends:
        low = None if low is None or least is None else low + least
        high = None if high is None or most is None else high + most
    told = tuple((lemma, Expression(node) if node else None, k) for (lemma, _, k), node in facts.items())
    return Bounds(low, high, tuple(sorted(signals)), told, strict)


def quotient_of(f: Expression) -> tuple[Expression, Expression] | None:
    """Polynomials in signals a and b with f = a / b; None of a polynomial, or where f has other functions."""
    if opaque(f).names != f.names:
        return None
    try:
        symbols = Symbols.of([f])
        value = symbols.reduced(symbols.fraction(f))
    except ExpressionError:
        return None
    return None if value.below.is_constant() else (symbols.polynomial(value.above), symbols.polynomial(value.below))


def scaled(ends: Ends, c: fmpq) -> Ends:
    """Range of a multiple."""
    low, high = (None if end is None else c * end for end in ends)
    return (low, high) if c > 0 else (high, low)


def required(sides: Sequence[Expression], derived: Sequence[Expression]) -> dict[str, Need]:
    """What functions need to have values, some of them derivatives too, divisors factor by factor, by what it says.

    Raises `UnknownTermError`: some of it depends on a branch.
    """
    found: dict[str, Need] = {}
    for one in (*(n for side in sides for n in needs(side)), *(n for side in derived for n in further(side))):
        if one.branch:
            raise UnknownTermError(f"{one.text} is asked on a branch only")
        for factor in factors(one.value.root) if one.sign == "is not 0" else (one.value.root,):
            value, sign = Expression(factor), one.sign
            if isinstance(factor, Call) and factor.operation == "sqrt" and sign == "is not 0":
                value, sign = Expression(factor.arguments[0]), "> 0"
            if value.names:
                found.setdefault(f"{value} {sign}", Need(value, sign, one.text))
    return found


def factors(node: Node) -> Iterator[Node]:
    """Factors of a divisor."""
    match node:
        case Call("*", parts):
            for part in parts:
                yield from factors(part)
        case Call("/", (above, _)):
            yield from factors(above)
        case Call("**", (base, Number(e))) if e > 0:
            yield from factors(base)
        case Call("exp", _):
            return
        case _:
            yield node


def derivable(f: Expression) -> bool:
    """Whether the library in Coq derives a function."""
    return all(derives(node) for node in postorder(f.root) if isinstance(node, Call))


def derives(node: Call) -> bool:
    """Whether it derives an operation."""
    if node.operation != "**":
        return node.operation in {"+", "*", "/", "pi", *DERIVED}
    exponent = node.arguments[1]
    return isinstance(exponent, Number) and (exponent.value.q == 1 or exponent.value == fmpq(1, 2))


def along(f: Expression, rates: Mapping[str, Expression]) -> Expression:
    """Derivative of a function along solutions; `rates`: those of all of its signals, and of t."""
    parts = [f.derivative(name) * rates[name] for name in sorted(f.names)]
    return reduce(Expression.__add__, parts, Expression.number(0))
