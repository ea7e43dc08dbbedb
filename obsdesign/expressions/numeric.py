"""Closures on plain floats, for the right-hand sides of differential equations.

While a tree is compiled, an operand is a float (a constant), an int (the index of an argument), or a closure
over the sequence of arguments; the forms below avoid a call for the first two.
"""

import operator
from collections.abc import Callable, Sequence
from math import pow
from operator import itemgetter

from obsdesign.expressions.exact import double
from obsdesign.expressions.functions import OPERATIONS
from obsdesign.expressions.tree import Call, Node, fold

Closure = Callable[[Sequence[float]], float]
Operand = float | int | Closure


def compiled(order: Sequence[Node], arguments: Sequence[str]) -> Closure:
    """Closure of a tree; raises ArithmeticError or ValueError where math does."""
    place = {name: i for i, name in enumerate(arguments)}
    operand: Operand = fold(order, double, place.__getitem__, operation)
    return closure(operand)


def operation(node: Call, operands: list[Operand]) -> Operand:
    """Operand of an operation."""
    if form := FORMS.get(node.operation):
        return form(*operands)
    scalar = OPERATIONS[node.operation].scalar
    assert scalar is not None
    function: Callable[..., float] = scalar
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

    def value(a: Sequence[float]) -> float:
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
    """Power: small integers by multiplication."""
    if isinstance(base, int) and exponent == 2.0:
        return lambda a: a[base] * a[base]
    if isinstance(base, int) and exponent == 3.0:
        return lambda a: a[base] * a[base] * a[base]
    f, g = closure(base), closure(exponent)
    if exponent == 2.0:
        return lambda a: (x := f(a)) * x
    if exponent == 3.0:
        return lambda a: (x := f(a)) * x * x
    if isinstance(exponent, float):
        return lambda a: pow(f(a), exponent)
    return lambda a: pow(f(a), g(a))


def choice(condition: Operand, first: Operand, second: Operand) -> Closure:
    """where(c, a, b): the branch that is not chosen is not evaluated."""
    c, f, g = closure(condition), closure(first), closure(second)
    return lambda a: f(a) if c(a) != 0 else g(a)


FORMS: dict[str, Callable[..., Closure]] = {"+": plus, "*": times, "/": over, "**": raised, "where": choice}
