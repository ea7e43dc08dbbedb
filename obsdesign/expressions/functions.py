"""The table of operations: everything that is known of each, in one entry."""

import math
import operator
from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Any

import numpy as np
from flint import arb, fmpq

from obsdesign.expressions import interval
from obsdesign.expressions.exact import at, rational_root, sign
from obsdesign.expressions.interval import Interval, even, monotone, unwidened, wave
from obsdesign.expressions.tree import Call, Node, Number, equals, number, product, text, total
from obsdesign.records import dataclass

Nodes = Sequence[Node]
Relation = Callable[[Any, Any], Any]


@dataclass(frozen=True)
class Operation:
    """What each reading of an expression does with one operation."""

    arity: tuple[int, int]
    derivative: Callable[[Nodes, Nodes], Node]  # from the arguments and their derivatives
    array: Callable[..., Any]  # numpy
    interval: Callable[..., Interval]
    ball: Callable[..., Any]  # flint.arb
    scalar: Callable[..., float] | None = None  # math; None: numeric.py has closures for it
    rational: Callable[..., fmpq | None] | None = None  # None where irrational; None: folded in tree.py
    switches: Callable[..., Nodes] = lambda *_: ()  # g whose zeros are kinks or jumps; none of a smooth one
    decided: Callable[[str, Nodes, Nodes], Node] = lambda name, arguments, _: apply(name, *arguments)  # by signs of g


def apply(name: str, *arguments: Node) -> Node:
    """Node of a function, or of its value where that is rational."""
    if name == "where":
        condition, a, b = arguments
        if isinstance(condition, Number):
            return b if condition.value == 0 else a
        if text(a) == text(b):
            return a
    rational = OPERATIONS[name].rational
    values = [a.value for a in arguments if isinstance(a, Number)]
    if rational is not None and len(values) == len(arguments):
        value = rational(*values)
        if value is not None:
            return number(value)
    return Call(name, arguments)


def operation(node: Call, arguments: list[Node]) -> Node:
    """Same operation on other arguments, simplified as when it is first built."""
    match node.operation:
        case "+":
            return total(arguments)
        case "*":
            return product(arguments)
        case "/":
            return arguments[0] / arguments[1]
        case "**":
            return arguments[0] ** arguments[1]
        case name:
            return apply(name, *arguments)


ZERO, HALF, ONE, TWO = number(0), number(fmpq(1, 2)), number(1), number(2)


def product_rule(factors: Nodes, rates: Nodes) -> Node:
    """Rule (a b c)' = a' b c + a b' c + a b c'; by halves if there are many factors."""
    if len(factors) > 8:
        half = len(factors) // 2
        first, second = product_rule(factors[:half], rates[:half]), product_rule(factors[half:], rates[half:])
        return first * product(factors[half:]) + product(factors[:half]) * second
    return total([product((*factors[:i], rate, *factors[i + 1 :])) for i, rate in enumerate(rates)])


def power_rule(arguments: Nodes, rates: Nodes) -> Node:
    """Rule (a^b)' = b a^(b-1) a' + a^b log(a) b'."""
    (a, b), (da, db) = arguments, rates
    slope = b * a ** (b - ONE) * da
    return slope if equals(db, 0) else slope + a**b * apply("log", a) * db


def quotient_rule(arguments: Nodes, rates: Nodes) -> Node:
    """Rule (a / b)' = a' / b - a b' / b^2."""
    (a, b), (da, db) = arguments, rates
    return da / b - a * db / b**TWO


def angle_rule(arguments: Nodes, rates: Nodes) -> Node:
    """Rule atan2(y, x)' = (x y' - y x') / (x^2 + y^2)."""
    (y, x), (dy, dx) = arguments, rates
    return (x * dy - y * dx) / (x**TWO + y**TWO)


def extreme_rule(name: str, comparison: str, arguments: Nodes, rates: Nodes) -> Node:
    """Take the derivative of the argument that is the smallest or largest."""
    if len(arguments) == 1:
        return rates[0]
    rest = arguments[1:]
    other = apply(name, *rest) if len(rest) > 1 else rest[0]
    chosen = apply(comparison, arguments[0], other)
    return apply("where", chosen, rates[0], extreme_rule(name, comparison, rest, rates[1:]))


def arc_slope(x: Node) -> Node:
    """1 / sqrt(1 - x^2), the slope of asin."""
    return ONE / apply("sqrt", ONE - x**TWO)


def differences(*arguments: Node) -> Nodes:
    """Return a - b for every pair."""
    return [a - b for i, a in enumerate(arguments) for b in arguments[i + 1 :]]


def decided_extreme(name: str, arguments: Nodes, signs: Nodes) -> Node:
    """Argument that the signs of `differences` make the smallest or largest."""
    if len(arguments) == 1:
        return arguments[0]
    rest = len(arguments) - 1
    first = product([apply("<=" if name == "min" else ">=", sign, ZERO) for sign in signs[:rest]])
    return apply("where", first, arguments[0], decided_extreme(name, arguments[1:], signs[rest:]))


def logical(node: Node) -> bool:
    """Whether a node is a sum or product of comparisons and numbers."""
    if isinstance(node, Call):
        return node.operation in COMPARISONS or (
            node.operation in ("+", "*") and all(logical(a) for a in node.arguments)
        )
    return isinstance(node, Number)


def larger(x: float, y: float, *others: float) -> float:
    """Maximum that keeps NaN, as numpy does."""
    chosen = x if x >= y or math.isnan(x) else y
    return larger(chosen, *others) if others else chosen


def smaller(x: float, y: float, *others: float) -> float:
    """Minimum that keeps NaN, as numpy does."""
    chosen = x if x <= y or math.isnan(x) else y
    return smaller(chosen, *others) if others else chosen


def signum(x: float) -> float:
    """Sign that keeps NaN, as numpy does."""
    return 1.0 if x > 0 else -1.0 if x < 0 else x


def clipped(x: float) -> float:
    """Saturation to [-1, 1]."""
    return -1.0 if x < -1.0 else 1.0 if x > 1.0 else x


def folded(function: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    """Associative function of two arguments, extended to more."""
    return lambda *arguments: reduce(function, arguments)


def truth_ball(relation: Relation, opposite: Relation, a: arb, b: arb) -> arb:
    """Ball of a comparison: 1, 0 or, undecided, [0, 1]."""
    return arb(1) if relation(a, b) else arb(0) if opposite(a, b) else arb(0.5, 0.5)


def choice_ball(condition: arb, a: arb, b: arb) -> arb:
    """Ball of where(condition, a, b)."""
    if condition.is_nan():
        return condition
    if condition.is_zero():
        return b
    return a.union(b) if condition.contains(0) else a


def comparison(relation: Callable[[Any, Any], Any], opposite: Callable[[Any, Any], Any], rule: Any) -> Operation:
    """Entry of a comparison, whose value is 1 or 0."""
    return Operation(
        arity=(2, 2),
        derivative=lambda *_: number(0),
        array=lambda a, b: np.where(relation(a, b), 1.0, 0.0),
        interval=rule,
        ball=partial(truth_ball, relation, opposite),
        scalar=lambda a, b: 1.0 if relation(a, b) else 0.0,
        rational=lambda a, b: fmpq(int(relation(a, b))),
        switches=differences,
        decided=lambda name, _, signs: apply(name, signs[0], ZERO),
    )


COMPARISONS = {
    "<": comparison(operator.lt, operator.ge, interval.less),
    ">": comparison(operator.gt, operator.le, lambda a, b: interval.less(b, a)),
    "<=": comparison(operator.le, operator.gt, lambda a, b: interval.negation(interval.less(b, a))),
    ">=": comparison(operator.ge, operator.lt, lambda a, b: interval.negation(interval.less(a, b))),
    "==": comparison(operator.eq, operator.ne, interval.equal),
    "!=": comparison(operator.ne, operator.eq, lambda a, b: interval.negation(interval.equal(a, b))),
}


def function(
    scalar: Callable[[float], float],
    array: Callable[..., Any],
    slope: Callable[[Node], Node],
    rule: Callable[[Interval], Interval],
    ball: Callable[[arb], arb],
    rational: Callable[[fmpq], fmpq | None],
    **switching: Any,
) -> Operation:
    """Entry of a function of one argument from its slope, by the chain rule, with `switches` and `decided` if any."""

    def chain(x: Nodes, rates: Nodes) -> Node:
        return product((slope(*x), *rates))

    return Operation((1, 1), chain, array, rule, ball, scalar, rational, **switching)


def extreme(name: str, scalar: Callable[[float, float], float], array: Any, ball: Any, rational: Any) -> Operation:
    """Entry of min or max."""
    return Operation(
        arity=(2, 100),
        derivative=partial(extreme_rule, name, "<=" if name == "min" else ">="),
        array=folded(array),
        interval=unwidened(folded(array)),
        ball=folded(ball),
        scalar=scalar,
        rational=rational,
        switches=differences,
        decided=decided_extreme,
    )


add, times = folded(operator.add), folded(operator.mul)
OPERATORS = {
    "+": Operation((2, 0), lambda _, rates: total(rates), add, add, add),
    "*": Operation((2, 0), product_rule, times, times, times),
    "/": Operation((2, 2), quotient_rule, operator.truediv, operator.truediv, operator.truediv),
    "**": Operation((2, 2), power_rule, np.power, interval.power, operator.pow),
}

sin, cos, tan, tanh, sinh, cosh, exp, sqrt, sgn, where = (
    partial(apply, name) for name in ("sin", "cos", "tan", "tanh", "sinh", "cosh", "exp", "sqrt", "sign", "where")
)
clip = partial(np.clip, a_min=-1.0, a_max=1.0)
UNIT, POSITIVE, CREST = (-1.0, 1.0), (0.0, math.inf), math.pi / 2
FUNCTIONS = {
    "sin": function(math.sin, np.sin, cos, wave(np.sin, CREST, 0.0), arb.sin, at(0, 0)),
    "cos": function(math.cos, np.cos, lambda x: -sin(x), wave(np.cos, 0.0, 0.0), arb.cos, at(0, 1)),
    "tan": function(math.tan, np.tan, lambda x: ONE + tan(x) ** TWO, interval.tan, arb.tan, at(0, 0)),
    "asin": function(math.asin, np.arcsin, arc_slope, monotone(np.arcsin, 0.0, UNIT), arb.asin, at(0, 0)),
    "acos": function(math.acos, np.arccos, lambda x: -arc_slope(x), monotone(np.arccos, 1.0, UNIT), arb.acos, at(1, 0)),
    "atan": function(
        math.atan, np.arctan, lambda x: ONE / (ONE + x**TWO), monotone(np.arctan, 0.0), arb.atan, at(0, 0)
    ),
    "sinh": function(math.sinh, np.sinh, cosh, monotone(np.sinh, 0.0), arb.sinh, at(0, 0)),
    "cosh": function(math.cosh, np.cosh, sinh, even(monotone(np.cosh, 0.0)), arb.cosh, at(0, 1)),
    "tanh": function(
        math.tanh, np.tanh, lambda x: ONE - tanh(x) ** TWO, monotone(np.tanh, 0.0, image=UNIT), arb.tanh, at(0, 0)
    ),
    "exp": function(math.exp, np.exp, exp, monotone(np.exp, 0.0, image=POSITIVE), arb.exp, at(0, 1)),
    "log": function(math.log, np.log, lambda x: ONE / x, monotone(np.log, 1.0, POSITIVE), arb.log, at(1, 0)),
    "sqrt": function(
        math.sqrt, np.sqrt, lambda x: HALF / sqrt(x), interval.sqrt, arb.sqrt, partial(rational_root, root=2)
    ),
    "abs": function(
        abs, np.abs, sgn, abs, abs, abs, switches=lambda x: (x,), decided=lambda _, x, signs: signs[0] * x[0]
    ),
    "sign": function(
        signum,
        np.sign,
        lambda _: ZERO,
        unwidened(np.sign),
        arb.sgn,
        sign,
        switches=lambda x: (x,),
        decided=lambda _, __, signs: signs[0],
    ),
    "sat": function(
        clipped,
        clip,
        lambda x: apply("where", apply("<", apply("abs", x), ONE), ONE, number(0)),  # 1 inside [-1, 1]
        unwidened(clip),
        lambda x: x.min(arb(1)).max(arb(-1)),
        lambda x: max(fmpq(-1), min(fmpq(1), x)),
        switches=lambda x: (x - ONE, x + ONE),
        decided=lambda _, x, signs: where(
            apply(">", signs[0], ZERO), ONE, where(apply("<", signs[1], ZERO), -ONE, x[0])
        ),
    ),
    "min": extreme("min", smaller, np.minimum, arb.min, min),
    "max": extreme("max", larger, np.maximum, arb.max, max),
    "atan2": Operation(
        arity=(2, 2),
        derivative=angle_rule,
        array=np.arctan2,
        interval=interval.atan2,
        ball=arb.atan2,
        scalar=math.atan2,
        rational=lambda y, x: fmpq(0) if y == 0 and x > 0 else None,
    ),
    "where": Operation(
        arity=(3, 3),
        derivative=lambda arguments, rates: apply("where", arguments[0], *rates[1:]),
        array=lambda c, a, b: np.where(c != 0, a, b),
        interval=interval.where,
        ball=choice_ball,
        switches=lambda c, *_: () if logical(c) else (c,),  # comparisons have switches of their own
        decided=lambda name, arguments, signs: apply(name, *(signs or arguments[:1]), *arguments[1:]),
    ),
}

PI = Operation(
    arity=(0, 0),
    derivative=lambda *_: number(0),
    array=lambda: np.float64(math.pi),
    interval=lambda: Interval(np.array(math.pi), np.array(interval.PI_ABOVE)),
    ball=arb.pi,
    scalar=lambda: math.pi,
)

OPERATIONS = {**OPERATORS, **COMPARISONS, **FUNCTIONS, "pi": PI}


def is_condition(node: Node) -> bool:
    """Whether a node is true or false: a comparison, or a product, the least or the largest of conditions."""
    if not isinstance(node, Call):
        return False
    combined = node.operation in ("*", "min", "max") and all(map(is_condition, node.arguments))
    return node.operation in COMPARISONS or combined
