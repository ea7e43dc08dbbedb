"""Identities between expressions, decided exactly.

An expression becomes a fraction of two polynomials over the rationals, in its variables and in symbols for what is not
rational in them. Symbols of a kind are told apart by their arguments in this form, and what holds between them is used:
exp(a + b) = exp(a) exp(b), log(exp(a)) = a = exp(log(a)), sin^2 = 1 - cos^2 with the sums of angles, (a^(1/k))^k = a,
|a|^2 = a^2. Where a numerator reduces to 0 two expressions are equal wherever both are defined: that is a proof. Where
it does not, nothing is said, since not every relation is known.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial, reduce
from math import comb, lcm

from flint import Ordering, fmpq, fmpq_mpoly, fmpq_mpoly_ctx

from obsdesign.expressions.exact import ExpressionError
from obsdesign.expressions.expression import Expression
from obsdesign.expressions.functions import apply
from obsdesign.expressions.tree import Call, Number, fold, number, product, quotient
from obsdesign.records import dataclass, field

MAX_SIZE = 4_000_000  # exponents in a polynomial: its terms times the symbols
MOST = 4  # symbols that one function may need: of a sum of angles
MOST_TURNS = 8  # multiples of an angle that are written in its sine and cosine
ROUNDS = 5  # in which the common parts of exponents are found
MAX_EXPONENT = 64  # of a power that is multiplied out


@dataclass(frozen=True)
class Fraction:
    """Numerator and denominator."""

    above: fmpq_mpoly
    below: fmpq_mpoly

    def __add__(self, other: "Fraction") -> "Fraction":
        if self.below == other.below:
            return Fraction(self.above + other.above, self.below)
        above = times(self.above, other.below) + times(other.above, self.below)
        return Fraction(above, times(self.below, other.below))

    def __mul__(self, other: "Fraction") -> "Fraction":
        return Fraction(times(self.above, other.above), times(self.below, other.below))

    def __truediv__(self, other: "Fraction") -> "Fraction":
        if other.above == 0:
            raise ExpressionError("divides by zero", id="OBS304")
        return Fraction(times(self.above, other.below), times(self.below, other.above))

    def __pow__(self, n: int) -> "Fraction":
        if n < 0:
            return (Fraction(self.below, self.below) / self) ** -n
        for side in (self.above, self.below):
            require_room(comb(max(len(side), 1) + n - 1, n), side)
        return Fraction(self.above**n, self.below**n)


def times(a: fmpq_mpoly, b: fmpq_mpoly) -> fmpq_mpoly:
    """Product; `ExpressionError` where it may be too large."""
    require_room(len(a) * len(b), a)
    return a * b


def require_room(terms: int, p: fmpq_mpoly) -> None:
    """Refuse what may have so many terms, before there are any."""
    if terms * p.context().nvars() > MAX_SIZE:
        raise ExpressionError("is too large to be multiplied out", id="OBS303")


@cache
def ring(size: int) -> fmpq_mpoly_ctx:
    """Polynomials in so many symbols."""
    return fmpq_mpoly_ctx.get([("s", size)], Ordering.lex)


@dataclass
class Symbols:
    """Symbols of some expressions, and the relations that hold between them."""

    size: int
    numbers: dict[str, int] = field(default_factory=dict)  # by key
    terms: dict[int, Expression] = field(default_factory=dict)  # what each symbol stands for
    relations: dict[int, tuple[int, Fraction]] = field(default_factory=dict)  # symbol^k = fraction
    exponents: dict[int, Fraction] = field(default_factory=dict)  # of the symbols that are exponentials
    logarithms: dict[str, Fraction] = field(default_factory=dict)  # what they are of, by their key as an exponent
    parts: dict[str, int] = field(default_factory=dict)  # of an exponent or an angle: 1/k of it is an integer multiple

    @classmethod
    def of(cls, expressions: Sequence[Expression]) -> "Symbols":
        """Room for everything in these expressions, with the parts that their exponents and angles have in common."""
        names = set().union(*(expression.names for expression in expressions))
        nodes = [node for expression in expressions for node in expression.order]
        calls = [node for node in nodes if isinstance(node, Call) and node.operation not in {"+", "*", "/"}]
        size = 2 + len(names) + MOST * len(calls)
        found: dict[str, int] = {}
        for _ in range(ROUNDS):
            symbols = cls(size, parts=dict(found))
            for expression in expressions:
                symbols.fraction(expression)
            if symbols.parts == found:
                return cls(size, parts=found)
            found = symbols.parts
        raise ExpressionError("has exponents or angles without a common part", id="OBS303")

    def constant(self, value: fmpq | int) -> Fraction:
        """A number."""
        return Fraction(ring(self.size).constant(fmpq(value)), ring(self.size).constant(1))

    def symbol(self, key: str, meaning: Callable[[], Expression]) -> Fraction:
        """The symbol of a key, which stands for an expression."""
        index = self.numbers.setdefault(key, len(self.numbers))
        if index >= self.size:
            raise ExpressionError("has more functions than can be told apart", id="OBS303")
        if index not in self.terms:
            self.terms[index] = meaning()
        return Fraction(ring(self.size).gen(index), ring(self.size).constant(1))

    def variable(self, name: str) -> Fraction:
        """The symbol of a variable."""
        return self.symbol(name, lambda: Expression.variable(name))

    def power_of(self, key: str, k: int, value: Fraction, meaning: Callable[[], Expression]) -> Fraction:
        """The symbol of a key whose k-th power is known."""
        found = self.symbol(key, meaning)
        self.relations.setdefault(self.numbers[key], (k, value))
        return found

    def expression(self, value: Fraction) -> Expression:
        """Expression of a fraction, in lowest terms."""
        lowest = self.reduced(value)
        above, below = self.polynomial(lowest.above), self.polynomial(lowest.below)
        return Expression(quotient(above.root, below.root))

    def polynomial(self, p: fmpq_mpoly) -> Expression:
        """Expression of a polynomial."""
        products, weights = [], []
        for powers, c in p.to_dict().items():
            used = [(self.terms[i].root, int(n)) for i, n in enumerate(powers) if n]
            products.append(Expression(product([base ** number(n) for base, n in used])))
            weights.append(c)
        return Expression.combination(weights, products)

    def fraction(self, expression: Expression) -> Fraction:
        """The expression in its symbols; raises `ExpressionError` if it is too large, or divides by zero."""
        return fold(expression.order, self.constant, self.variable, self.of_call)

    def reduced(self, value: Fraction) -> Fraction:
        """Same fraction with no higher power of a symbol above than its relation leaves, and no common factor."""
        degrees = value.above.degrees()
        for index in sorted(self.relations, reverse=True):  # arguments have lower numbers than what is made of them
            k, power = self.relations[index]
            if degrees[index] < k:
                continue
            parts: dict[int, dict[tuple[int, ...], fmpq]] = {}
            for powers, c in value.above.to_dict().items():
                times, rest = divmod(powers[index], k)
                parts.setdefault(times, {})[(*powers[:index], rest, *powers[index + 1 :])] = c
            total = self.constant(0)
            for times, terms in parts.items():
                total += Fraction(ring(self.size).from_dict(terms), ring(self.size).constant(1)) * power**times
            value = Fraction(total.above, total.below * value.below)
            degrees = value.above.degrees()
        above, below = value.above, value.below
        if not below.is_constant():
            common = above.gcd(below)
            above, below = above / common, below / common
        lead = below.leading_coefficient()
        return Fraction(above / lead, below / lead)

    def equal(self, a: Fraction, b: Fraction) -> bool:
        """Whether two fractions are proved to be the same."""
        return bool(self.reduced(a + self.constant(-1) * b).above == 0)

    def of_call(self, node: Call, values: list[Fraction]) -> Fraction:
        """An operation on fractions."""
        rule = RULES.get(node.operation)
        return rule(self, node, values) if rule else self.named(node.operation, values)

    def named(self, operation: str, values: Sequence[Fraction]) -> Fraction:
        """The symbol of a function that nothing more is known of."""
        key = f"{operation}({', '.join(map(self.key, values))})"
        return self.symbol(
            key, lambda: Expression(Call(operation, tuple(self.expression(value).root for value in values)))
        )

    def key(self, value: Fraction) -> str:
        """Text that only equal fractions have in common."""
        lowest = self.reduced(value)
        return f"({lowest.above})/({lowest.below})"

    def power(self, node: Call, values: Sequence[Fraction]) -> Fraction:
        """Power with a rational exponent, or a symbol."""
        base, exponent = values
        if isinstance(node.arguments[1], Number):
            n, k = int(node.arguments[1].value.p), int(node.arguments[1].value.q)
            if abs(n) <= MAX_EXPONENT:
                return (self.root(base, k) if k > 1 else base) ** n
        return self.named("**", (base, exponent))

    def applied(self, operation: str, value: Fraction) -> Expression:
        """A function of a fraction."""
        return Expression(apply(operation, self.expression(value).root))

    def magnitude(self, value: Fraction) -> Fraction:
        """|a|, whose square is known."""
        return self.power_of(f"abs({self.key(value)})", 2, value**2, partial(self.applied, "abs", value))

    def root(self, base: Fraction, k: int) -> Fraction:
        """Root of a fraction: a symbol with a known power."""

        def meaning() -> Expression:
            return Expression(self.expression(base).root ** number(fmpq(1, k)))

        return self.power_of(f"{self.key(base)}**(1/{k})", k, base, meaning)

    def multiples(self, kind: str, value: Fraction) -> Iterator[tuple[str, Fraction, int]]:
        """A fraction as a sum of integer multiples: the key of each part, the part, and how often it is taken."""
        lowest = self.reduced(value)
        for powers, c in lowest.above.to_dict().items():
            part = Fraction(ring(self.size).from_dict({powers: fmpq(1)}), lowest.below)
            key = f"{kind} {self.key(part)}"
            k = self.parts[key] = lcm(self.parts.get(key, 1), int(c.q))
            yield f"{key}/{k}", self.constant(fmpq(1, k)) * part, int((c * k).p)

    def exponential(self, value: Fraction) -> Fraction:
        """Product of powers of exponentials of the parts of an exponent."""
        product = self.constant(1)
        for key, part, n in self.multiples("exp", value):
            if key in self.logarithms:
                product = product * self.logarithms[key] ** n
                continue
            one = self.symbol(key, partial(self.applied, "exp", part))
            self.exponents[self.numbers[key]] = part
            product = product * one**n
        return product

    def exponent(self, value: Fraction) -> Fraction | None:
        """A of exp(a); None of what is no product of powers of exponentials."""
        lowest = self.reduced(value)
        total = self.constant(0)
        for sign, side in ((1, lowest.above), (-1, lowest.below)):
            if len(side) != 1 or side.leading_coefficient() != 1:
                return None
            for index, times in enumerate(side.monoms()[0]):
                if times and index not in self.exponents:
                    return None
                if times:
                    total += self.constant(sign * int(times)) * self.exponents[index]
        return total

    def angle(self, value: Fraction) -> tuple[Fraction, Fraction]:
        """Sine and cosine of a sum of multiples of angles."""
        sine, cosine = self.constant(0), self.constant(1)
        parts = [*self.multiples("angle", value)]
        if any(abs(turns) > MOST_TURNS for _, _, turns in parts):
            parts = [(f"whole angle {self.key(value)}", value, 1)]
        for key, part, turns in parts:
            c = self.symbol(f"cos {key}", partial(self.applied, "cos", part))
            square = self.constant(1) + self.constant(-1) * c * c
            s = self.power_of(f"sin {key}", 2, square, partial(self.applied, "sin", part))
            turn = s if turns > 0 else self.constant(-1) * s
            for _ in range(abs(turns)):
                sine, cosine = sine * c + cosine * turn, cosine * c + self.constant(-1) * sine * turn
        return sine, cosine


def added(_: Symbols, __: Call, values: Sequence[Fraction]) -> Fraction:
    """Sum."""
    return reduce(Fraction.__add__, values)


def multiplied(_: Symbols, __: Call, values: Sequence[Fraction]) -> Fraction:
    """Product."""
    return reduce(Fraction.__mul__, values)


def logarithm(symbols: Symbols, _: Call, values: Sequence[Fraction]) -> Fraction:
    """Logarithm: of an exponential its exponent, else a symbol whose exponential is known."""
    if (inside := symbols.exponent(values[0])) is not None:
        return inside
    found = symbols.named("log", values)
    symbols.logarithms[f"exp {symbols.key(found)}/1"] = values[0]
    return found


def wave(symbols: Symbols, node: Call, values: Sequence[Fraction]) -> Fraction:
    """Sine, cosine or tangent."""
    sine, cosine = symbols.angle(values[0])
    return {"sin": sine, "cos": cosine}[node.operation] if node.operation != "tan" else sine / cosine


def hyperbolic(symbols: Symbols, node: Call, values: Sequence[Fraction]) -> Fraction:
    """(e^x - e^-x) / 2, (e^x + e^-x) / 2, or their quotient."""
    up, down = (symbols.exponential(symbols.constant(sign) * values[0]) for sign in (1, -1))
    sine, cosine = up + symbols.constant(-1) * down, up + down
    return (
        sine / cosine
        if node.operation == "tanh"
        else (sine if node.operation == "sinh" else cosine) / symbols.constant(2)
    )


RULES: dict[str, Callable[[Symbols, Call, list[Fraction]], Fraction]] = {
    "+": added,
    "*": multiplied,
    "/": lambda _, __, values: values[0] / values[1],
    "**": Symbols.power,
    "sqrt": lambda symbols, _, values: symbols.root(values[0], 2),
    "abs": lambda symbols, _, values: symbols.magnitude(values[0]),
    "exp": lambda symbols, _, values: symbols.exponential(values[0]),
    "log": logarithm,
    **dict.fromkeys(("sin", "cos", "tan"), wave),
    **dict.fromkeys(("sinh", "cosh", "tanh"), hyperbolic),
}


def identical(a: Expression, b: Expression) -> bool:
    """Whether two expressions are proved to be equal wherever both are defined.

    Raises `ExpressionError`: they are too large to be multiplied out.
    """
    symbols = Symbols.of((a, b))
    return symbols.equal(symbols.fraction(a), symbols.fraction(b))


def simplified(expression: Expression) -> Expression:
    """Same expression as a fraction in lowest terms; as it is, where that is too large."""
    try:
        symbols = Symbols.of([expression])
        return symbols.expression(symbols.fraction(expression))
    except ExpressionError:
        return expression
