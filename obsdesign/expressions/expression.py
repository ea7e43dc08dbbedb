"""Expressions as the rest of the package sees them."""

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType

import numpy as np
import numpy.typing as npt
from flint import fmpq

from obsdesign.expressions.constant import rounded
from obsdesign.expressions.exact import double
from obsdesign.expressions.functions import OPERATIONS, operation
from obsdesign.expressions.interval import Interval, point
from obsdesign.expressions.numeric import Closure, compiled
from obsdesign.expressions.parse import tree
from obsdesign.expressions.tree import (
    Call,
    Node,
    Number,
    Variable,
    equals,
    fold,
    number,
    postorder,
    product,
    summands,
    text,
    total,
)
from obsdesign.records import dataclass

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Expression:
    """A real expression of named variables; immutable, equal to another one of the same structure."""

    root: Node

    @staticmethod
    def number(value: int | fmpq) -> "Expression":
        """Return the constant expression of an exact number."""
        return Expression(number(value))

    @staticmethod
    def combination(coefficients: Sequence[fmpq], expressions: Sequence["Expression"]) -> "Expression":
        """Linear combination c_1 e_1 + c_2 e_2 + .. of as many expressions as coefficients."""
        pairs = zip(coefficients, expressions, strict=True)
        return Expression(total([product((number(c), e.root)) for c, e in pairs]))

    @staticmethod
    def variable(name: str) -> "Expression":
        """Return the expression of a variable."""
        return Expression(Variable(name))

    @staticmethod
    def squares(names: Sequence[str]) -> "Expression":
        """Sum of the squares of variables."""
        return Expression(total([Variable(name) ** number(2) for name in names]))

    @cached_property
    def text(self) -> str:
        """Text that parses back to an equal expression."""
        return text(self.root)

    def __str__(self) -> str:
        return self.text

    def __add__(self, other: "Expression") -> "Expression":
        return Expression(self.root + other.root)

    def __sub__(self, other: "Expression") -> "Expression":
        return Expression(self.root - other.root)

    def __mul__(self, other: "Expression") -> "Expression":
        return Expression(self.root * other.root)

    def __truediv__(self, other: "Expression") -> "Expression":
        return Expression(self.root / other.root)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Expression) and self.text == other.text

    def __hash__(self) -> int:
        return hash(self.text)

    @cached_property
    def order(self) -> tuple[Node, ...]:
        """Nodes of the tree, arguments before operations."""
        return postorder(self.root)

    @cached_property
    def names(self) -> frozenset[str]:
        """Variables that occur."""
        return frozenset(node.name for node in self.order if isinstance(node, Variable))

    def derivative(self, name: str) -> "Expression":
        """Partial derivative, lightly simplified; that of a jump or a kink is the one beside it.

        sign' = 0, |x|' = sign(x), sat(x)' = where(|x| < 1, 1, 0); comparisons have derivative 0.
        """

        def of_call(node: Call, rates: list[Node]) -> Node:
            if all(equals(rate, 0) for rate in rates):
                return number(0)
            return OPERATIONS[node.operation].derivative(node.arguments, rates)

        return Expression(
            fold(self.order, lambda _: number(0), lambda variable: number(int(variable == name)), of_call)
        )

    @property
    def smooth(self) -> bool:
        """Whether it has neither kinks nor jumps, so that its derivatives say how it moves."""
        calls = (node for node in self.order if isinstance(node, Call))
        return not any(OPERATIONS[node.operation].switches(*node.arguments) for node in calls)

    def summands(self) -> list[tuple[fmpq, "Expression"]]:
        """Terms c e of a sum, with c a number and e no sum; the e of a number is 1."""
        return [(c, Expression(node)) for c, node in summands(self.root, fmpq(1))]

    def substituted(self, replacements: Mapping[str, "Expression"]) -> "Expression":
        """Same expression with others in place of some of its variables."""
        if self.names.isdisjoint(replacements):
            return self

        def of_variable(name: str) -> Node:
            return replacements[name].root if name in replacements else Variable(name)

        return Expression(fold(self.order, number, of_variable, operation))

    def function(self, arguments: Sequence[str]) -> Callable[..., Array]:
        """Vectorized function of the named arguments, which broadcast; NaN or infinite outside the domain."""

        def value(*values: npt.ArrayLike) -> Array:
            arrays = [np.asarray(v, dtype=float) for v in values]
            given = dict(zip(arguments, arrays, strict=True))
            with np.errstate(all="ignore"):
                result = fold(
                    self.order,
                    lambda v: np.float64(double(v)),
                    given.__getitem__,
                    lambda node, operands: OPERATIONS[node.operation].array(*operands),
                )
            return np.array(np.broadcast_to(result, np.broadcast_shapes(*(a.shape for a in arrays))))

        return value

    def rows(self, arguments: Sequence[str]) -> Callable[[Array], Array]:
        """Fast function of a table with one row for each argument, to a row (or a number, if it is constant).

        It is NaN or infinite outside the domain, of which numpy warns.
        """
        return compiled(self.order, arguments, rows=True)

    def scalar(self, arguments: Sequence[str]) -> Callable[..., float]:
        """Fast function of plain floats; where math raises it answers as `function` does, NaN or infinite."""
        fast, careful = compiled(self.order, arguments), self.function(arguments)

        def value(*values: float) -> float:
            try:
                found: float = fast(values)
            except (ArithmeticError, ValueError):
                found = float(careful(*values))
            return found

        return value

    def enclose(self, box: Mapping[str, Interval]) -> Interval:
        """Rigorous enclosure of the values over boxes.

        An entry is empty where the expression is defined nowhere in its box; where it is defined in a part,
        the values there are enclosed.
        """

        def of_call(node: Call, operands: list[Interval]) -> Interval:
            result = OPERATIONS[node.operation].interval(*operands)
            if node.operation == "where":  # it ignores what its other branch is
                return result
            for operand in operands:
                if operand.empty.any():
                    result = result.emptied(operand.empty)
            return result

        with np.errstate(all="ignore"):
            return fold(self.order, point, box.__getitem__, of_call)

    def decided(self, sign: Callable[["Expression", "Expression"], "Expression"]) -> "Expression":
        """Same expression without jumps and kinks: each is decided by the sign of a function that vanishes there.

        Parameters
        ----------
        sign
            Called with this function, and with the same without jumps and kinks of its own: the sign, a variable say.
        """

        def of_call(node: Call, arguments: list[Node]) -> Node:
            rule = OPERATIONS[node.operation]
            before, after = rule.switches(*node.arguments), rule.switches(*arguments)
            if not before:
                return operation(node, arguments)
            signs = [sign(Expression(g), Expression(h)).root for g, h in zip(before, after, strict=True)]
            return rule.decided(node.operation, arguments, signs)

        return Expression(fold(self.order, number, Variable, of_call))


def parse(text: str, names: Collection[str], parameters: Mapping[str, fmpq] = MappingProxyType({})) -> Expression:
    """Read an expression; see `parse.py` for the language.

    `text`: at most 10,000 characters, 100 levels, constant exponents up to 1e4 in magnitude; `names`: variables that
    may occur; `parameters`: names that stand for exact numbers. Raises `ExpressionError`: what is wrong, in one line,
    and the column of it.
    """
    return Expression(tree(text, names, parameters))


def constant(text: str, parameters: Mapping[str, fmpq] = MappingProxyType({})) -> tuple[fmpq, bool]:
    """Exact value of an expression without variables, and whether it had to be rounded to a double.

    Rational arithmetic is exact; an irrational value is replaced by its correctly rounded double.

    Raises `ExpressionError`: as `parse`, and for a value that is undefined or not finite as a double.
    """
    expression = parse(text, (), parameters)
    if isinstance(expression.root, Number):
        return expression.root.value, False
    return fmpq(*rounded(expression.order).as_integer_ratio()), True


def vector_function(
    expressions: Sequence[Expression], arguments: Sequence[str]
) -> Callable[[Sequence[float]], list[float]]:
    """Fast function from the values of the arguments (a list of floats) to the values of all expressions."""
    fast: list[Closure] = [compiled(e.order, arguments) for e in expressions]
    careful = [e.scalar(arguments) for e in expressions]

    def values(point: Sequence[float]) -> list[float]:
        try:
            return [f(point) for f in fast]
        except (ArithmeticError, ValueError):
            return [f(*point) for f in careful]

    return values
