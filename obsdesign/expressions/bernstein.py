"""Piecewise polynomials of one variable in Bernstein form, as expressions."""

from collections.abc import Sequence
from itertools import pairwise
from math import comb

from flint import fmpq

from obsdesign.expressions.expression import Expression, parse


def bernstein(name: str, knots: Sequence[fmpq], degree: int) -> list[Expression]:
    """Weights of the control values of a piecewise polynomial in its value at a variable, (N (d + 1),).

    On the segment from s_i to s_i + h they are binomial(d, k) x^k (1 - x)^(d - k), k = 0 .. d, with x = (s - s_i) / h;
    those of the other segments are zero there. Before the first knot and beyond the last the value is that of the knot.
    """
    within, found, last = f"min(max({name}, {knots[0]}), {knots[-1]})", [], len(knots) - 2
    for i, (a, b) in enumerate(pairwise(knots)):
        x, rest = f"(({within} - ({a}))/({b - a}))", f"((({b}) - {within})/({b - a}))"
        for k in range(degree + 1):
            value = f"{comb(degree, k)}*{x}**{k}*{rest}**{degree - k}"
            value = value if i == last else f"where({name} < {b}, {value}, 0)"
            found.append(parse(value if i == 0 else f"where({name} < {a}, 0, {value})", [name]))
    return found
