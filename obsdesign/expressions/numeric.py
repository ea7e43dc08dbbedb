"""Closures on plain floats, or on rows of numbers, for the right-hand sides of differential equations.

While a tree is compiled, an operand is a float (a constant), an int (the index of an argument), or a closure
over the sequence of arguments; the forms below avoid a call for the first two.
"""

import operator
from collections.abc import Callable, Sequence
from functools import partial
from math import pow
from operator import itemgetter
from typing import Any

from obsdesign.expressions.exact import double
from obsdesign.expressions.functions import OPERATIONS
from obsdesign.expressions.tree import Call, Node, fold

Closure = Callable[[Any], Any]  # from the sequence of arguments to the value: floats, or rows of them
Operand = float | int | Closure


def compiled(order: Sequence[Node], arguments: Sequence[str], *, rows: bool = False) -> Closure:
    """Closure of a tree; raises ArithmeticError or ValueError where math does.

    `rows`: of arguments that are rows of numbers; then it raises nothing, and is NaN or infinite where math raises.
    """
    place = {name: i for i, name in enumerate(arguments)}
    operand: Operand = fold(order, double, place.__getitem__, partial(operation, rows=rows))
    return closure(operand)


def operation(node: Call, operands: list[Operand], rows: bool) -> Operand:
    """Operand of an operation."""
    integer = node.operation == "**" and isinstance(operands[1], float) and operands[1] in (2.0, 3.0)
    if node.operation in FORMS and (not rows or node.operation in ARITHMETIC or integer):
        return FORMS[node.operation](*operands)
    rule = OPERATIONS[node.operation]
    function = rule.array if rows else rule.scalar
    assert function is not None
    match operands:
        case []:
            return function()
        case [int(i)]:
            return lambda a: function(a[i])
        case [operand]:
            f = closure(operand)
            return lambda a: function(f(a))
        case [left, right]:
            f, g = closure(left), closure(right)
            return lambda a: function(f(a), g(a))
    functions = [closure(operand) for operand in operands]
    return lambda a: function(*[f(a) for f in functions])


def closure(operand: Operand) -> Closure:
    """Operand as a closure."""
    if isinstance(operand, int):
        return itemgetter(operand)
    if isinstance(operand, float):
        constant = operand
        return lambda _: constant
    return operand


def plus(first: Operand, second: Operand, *others: Operand) -> Closure:
    """Sum."""
    if others:
        return gathered(plus, operator.add, plus(first, second), others)
    match first, second:
        case (int(i), int(j)):
            return lambda a: a[i] + a[j]
        case (float(c), int(i)) | (int(i), float(c)):
            return lambda a: c + a[i]
    f, g = closure(first), closure(second)
    if isinstance(first, float):
        return lambda a: first + g(a)
    if isinstance(first, int):
        return lambda a: a[first] + g(a)
    return lambda a: f(a) + g(a)


def times(first: Operand, second: Operand, *others: Operand) -> Closure:
    """Product; its number, if any, comes first."""
    if others:
        return gathered(times, operator.mul, times(first, second), others)
    match first, second:
        case (int(i), int(j)):
            return lambda a: a[i] * a[j]
        case (float(c), int(i)):
            return lambda a: c * a[i]
    f, g = closure(first), closure(second)
    if isinstance(first, float):
        return lambda a: first * g(a)
    if isinstance(first, int):
        return lambda a: a[first] * g(a)
    return lambda a: f(a) * g(a)


def gathered(
    pair: Callable[..., Closure],
    step: Callable[[float, float], float],
    head: Closure,
    others: Sequence[Operand],
) -> Closure:
    """More than two operands, from the left; a loop for many of them, so that they are not a deep call."""
    if len(others) == 1:
        return pair(head, *others)
    functions = [closure(operand) for operand in others]

    def value(a: Any) -> Any:
        result = head(a)
        for f in functions:
            result = step(result, f(a))
        return result

    return value


def over(first: Operand, second: Operand) -> Closure:
    """Quotient."""
    f, g = closure(first), closure(second)
    if isinstance(second, float):
        return lambda a: f(a) / second
    if isinstance(first, float):
        return lambda a: first / g(a)
    return lambda a: f(a) / g(a)


def raised(base: Operand, exponent: Operand) -> Closure:
    """Power: small integers by multiplication. An exponent that is an int is the index of an argument."""
    f, g = closure(base), closure(exponent)
    if not isinstance(exponent, float):
        return lambda a: pow(f(a), g(a))
    if exponent == 2.0:
        return (lambda a: a[base] * a[base]) if isinstance(base, int) else lambda a: (x := f(a)) * x
    if exponent == 3.0:
        return (lambda a: a[base] * a[base] * a[base]) if isinstance(base, int) else lambda a: (x := f(a)) * x * x
    return lambda a: pow(f(a), exponent)


def choice(condition: Operand, first: Operand, second: Operand) -> Closure:
    """where(c, a, b): the branch that is not chosen is not evaluated."""
    c, f, g = closure(condition), closure(first), closure(second)
    return lambda a: f(a) if c(a) != 0 else g(a)


ARITHMETIC = ("+", "*", "/")  # which are the same for numbers and rows
FORMS: dict[str, Callable[..., Closure]] = {"+": plus, "*": times, "/": over, "**": raised, "where": choice}
