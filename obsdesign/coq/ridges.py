"""An f as a sum of functions of one variable, whose difference quotients are known to the library in Coq.

f(q) = sum of column_i * phi_i(row_i . q + shift_i): a ridge is one term of it. phi_i is one of KNOWN, or an odd power.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import reduce

from flint import fmpq

from obsdesign.coq.functions import (
    CONSTANT,
    IDENTITY,
    KNOWN,
    LAW,
    MAX_POWER,
    ONE,
    RELU,
    ZERO,
    Function,
    Limits,
    added,
    odd_power,
)
from obsdesign.coq.regions import root
from obsdesign.expressions.expression import Expression
from obsdesign.expressions.tree import Call, Node, Number, Variable
from obsdesign.records import dataclass

Box = Mapping[int, Limits]  # limits of components of q


class UnknownFunctionError(Exception):
    """A part of f that is no function of one variable that the library knows, in words."""


@dataclass(frozen=True)
class Affine:
    """Coefficients of the components of q, counted from 0, and a number."""

    coefficients: tuple[tuple[int, fmpq], ...]  # of those that are not zero, in order
    shift: fmpq = ZERO

    @classmethod
    def of(cls, coefficients: Mapping[int, fmpq], shift: fmpq = ZERO) -> "Affine":
        """Form of a mapping."""
        return cls(tuple(sorted((k, c) for k, c in coefficients.items() if c != 0)), shift)

    def __add__(self, other: "Affine") -> "Affine":
        own = dict(self.coefficients)
        joined = own | {k: own.get(k, ZERO) + c for k, c in other.coefficients}
        return Affine.of(joined, self.shift + other.shift)

    def __mul__(self, factor: fmpq) -> "Affine":
        return Affine.of({k: factor * c for k, c in self.coefficients}, factor * self.shift)

    @property
    def row(self) -> dict[int, fmpq]:
        """Coefficients by component."""
        return dict(self.coefficients)

    def limits(self, box: Box) -> Limits | None:
        """Range over a box; None if it is not limited."""
        if any(k not in box for k, _ in self.coefficients):
            return None
        ends = [(c * box[k][c < 0], c * box[k][c > 0]) for k, c in self.coefficients]
        return sum((low for low, _ in ends), self.shift), sum((high for _, high in ends), self.shift)

    def text(self, first: int) -> str:
        """Text in Coq, over the names of the components from a first one on."""
        terms = [(c, f"q{first + k + 1}") for k, c in self.coefficients]
        return added([*terms, (self.shift, "1")] if self.shift != 0 or not terms else terms)


@dataclass(frozen=True)
class Ridge:
    """phi of an affine function, times a column: the coefficients of the components of f, counted from 0."""

    function: Function
    argument: Affine
    column: Mapping[int, fmpq]


def ridges(f: Sequence[Expression], names: Mapping[str, int], box: Box) -> list[Ridge]:
    """Sum of which f is; equal functions of equal arguments in several components are one ridge.

    `names`: component of q that each name stands for; `box`: limits of some components.

    Raises `UnknownFunctionError`: f has another part.
    """
    columns: dict[tuple[Function, Affine], dict[int, fmpq]] = {}
    for i, component in enumerate(f):
        linear = Affine(())
        for coefficient, summand in component.summands():
            for c, function, argument in parts(summand.root, names, box):
                if function is IDENTITY:
                    linear += argument * (c * coefficient)
                else:
                    column = columns.setdefault((function, argument), {})
                    column[i] = column.get(i, ZERO) + c * coefficient
        for c, function, argument in split(linear):
            columns.setdefault((function, argument), {})[i] = c
    return [Ridge(*key, {i: c for i, c in column.items() if c != 0}) for key, column in columns.items()]


def split(linear: Affine) -> Iterator[tuple[fmpq, Function, Affine]]:
    """Parts of an affine component: each component of q by itself, and the number."""
    for k, c in linear.coefficients:
        yield c, IDENTITY, Affine.of({k: ONE})
    if linear.shift != 0:
        yield linear.shift, CONSTANT, Affine(())


def parts(node: Node, names: Mapping[str, int], box: Box) -> list[tuple[fmpq, Function, Affine]]:
    """Coefficient, function and argument of the ridges that a term of f is a sum of."""
    if (linear := affine(node, names)) is not None:
        return [(ONE, IDENTITY, linear)]
    if isinstance(node, Call):
        match node.operation, node.arguments:
            case name, (x,) if (inner := affine(x, names)) and (function := known(name, inner.limits(box))):
                return [(ONE, function, inner)]
            case ("max" | "min") as name, (x, Number(c)) | (Number(c), x) if (inner := affine(x, names)) is not None:
                sign = ONE if name == "max" else -ONE  # max(x, c) = c + relu(x - c), min(x, c) = c - relu(c - x)
                corner = (inner + Affine((), -c)) * sign
                return [(ONE, IDENTITY, Affine((), c)), (sign, RELU, corner)]
        if (found := product(node, names)) is not None:
            return [found]
    raise UnknownFunctionError(f"the library has no lemma on {Expression(node)}")


def known(name: str, limits: Limits | None) -> Function | None:
    """Function of a name, if the library has a lemma on it, for arguments between limits."""
    return root(limits) if name == "sqrt" and limits is not None else KNOWN.get(name)


def product(node: Call, names: Mapping[str, int]) -> tuple[fmpq, Function, Affine] | None:
    """A number times an odd power of an affine function, or times its product with its own magnitude."""
    coefficient, inner = ONE, Affine(())
    power = magnitudes = 0
    for factor in reversed(node.arguments if node.operation == "*" else (node,)):
        base, exponent, magnitude = factor, 1, False
        match factor:
            case Call("**", (one, Number(e))) if e.q == 1 and e > 0:
                base, exponent = one, int(e.p)
            case Call("abs", (one,)):
                base, magnitude = one, True
        if (found := affine(base, names)) is None:
            return None
        if not found.coefficients:
            ratio = found.shift
        else:
            inner = inner if inner.coefficients else found
            ratio = found.coefficients[0][1] / inner.coefficients[0][1]
            if found != inner * ratio:
                return None
            magnitudes += magnitude
            power += exponent * (not magnitude)
        coefficient *= abs(ratio) if magnitude else ratio**exponent
    if (power, magnitudes) == (1, 1):
        return coefficient, LAW, inner
    return (coefficient, odd_power(power), inner) if power % 2 and not magnitudes and power <= MAX_POWER else None


def affine(node: Node, names: Mapping[str, int]) -> Affine | None:
    """Affine function of q that a node is; None if it is none."""
    match node:
        case Number(value):
            return Affine((), value)
        case Variable(name):
            return Affine.of({names[name]: ONE}) if name in names else None
        case Call("+", terms):
            found = [affine(term, names) for term in terms]
            return None if None in found else reduce(Affine.__add__, [one for one in found if one is not None])
        case Call("*", (Number(c), x)):
            inner = affine(x, names)
            return None if inner is None else inner * c
        case Call("/", (x, Number(c))) if c != 0:
            inner = affine(x, names)
            return None if inner is None else inner * (1 / c)
    return None
