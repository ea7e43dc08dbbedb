"""Regressions for the constants of coordinates with lambda 0, from the derivatives of the outputs.

With x = phiL(xi + theta, y) put into y' = L_f h, a derivative that is known + sum m theta is a regression, and so is
one that is linear in exp(theta).
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import combinations

from obsdesign.expressions import Expression, ExpressionError, parse
from obsdesign.families.algebraic.ansatz import simplified
from obsdesign.families.algebraic.find import Found, explicit
from obsdesign.families.algebraic.forms import Regression
from obsdesign.families.algebraic.scheme import ZERO, added, multiplied
from obsdesign.model.equations import Equations, Named, Typed, free


def regressions(found: Found, typed: Typed) -> tuple[tuple[Regression, ...], frozenset[str]]:
    """Regressions that hold the constants of as many coordinates as can be, and those that they hold as exp(theta)."""
    names = [each.name for each in found.coordinates if each.estimated]
    best: tuple[tuple[Regression, ...], frozenset[str]] = ((), frozenset())
    if found.missing:
        return best
    sides = list(derivatives(found, explicit(typed)))
    for size in range(len(names) + 1):
        for powers in combinations(names, size):
            rows = tuple(row for output, side in sides if (row := regression(output, side, names, powers)))
            if covered(rows) > covered(best[0]):
                best = rows, frozenset(powers)
    return best


def covered(rows: Sequence[Regression]) -> int:
    """How many constants some regressions hold."""
    return len({name for row in rows for name in row.m})


def derivatives(found: Found, equations: Equations) -> Iterator[tuple[str, Expression]]:
    """Derivative of each output without inputs, if it can be multiplied out, in outputs, inputs, t and coordinates."""
    shown = {side.text: Expression.variable(name) for name, side in equations.outputs.items()}
    states: Named = {n: found.left_inverse.get(n) or shown[n] for n in equations.states}
    for output, side in equations.outputs.items():
        if side.names.isdisjoint(equations.inputs):
            parts = [multiplied(side.derivative(name), f) for name, f in equations.dynamics.items()]
            with suppress(ExpressionError):  # one that is too large is no use
                yield output, simplified(added([*parts, side.derivative("t")]).substituted(states))


def regression(output: str, side: Expression, names: Sequence[str], powers: Sequence[str]) -> Regression | None:
    """The derivative of an output as known + sum m theta, with exp(theta) for some; None where it is not."""
    taken = {"t", *side.names}
    theta = {name: free(f"theta_{name}", taken) for name in names if name in side.names}
    shifted = {
        name: parse(f"{name} + log({new})" if name in powers else f"{name} + {new}", (name, new))
        for name, new in theta.items()
    }
    with suppress(ExpressionError):  # one that is too large is no use
        moved = simplified(side.substituted(shifted))
        m = {name: slope for name, new in theta.items() if (slope := simplified(moved.derivative(new))) != ZERO}
        if m and all(slope.names.isdisjoint(theta.values()) for slope in m.values()):
            return Regression(output, simplified(moved.substituted(dict.fromkeys(theta.values(), ZERO))), m)
    return None
