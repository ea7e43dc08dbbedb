"""Matrices of expressions, and the plant written out, from which the equations of a filter are made."""

from collections.abc import Mapping, Sequence
from functools import reduce

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, printed
from obsdesign.model.equations import Equations, Named, free
from obsdesign.records import dataclass, field

ZERO = Expression.number(0)


@dataclass
class Signals:
    """Algebraic signals of an observer, under names that are free."""

    taken: set[str]
    sides: dict[str, Expression] = field(default_factory=dict)
    gains: dict[str, tuple[str, ...]] = field(default_factory=dict)  # names of the gains of an output, by its own

    def matrix(self, letter: str, rows: Sequence[str], columns: Sequence[str], entries: Array) -> Array:
        """Matrix of expressions, each that is no number by a name."""
        return np.array(
            [
                [self.named(f"{letter}_{i}_{j}", entries[a, b]) for b, j in enumerate(columns)]
                for a, i in enumerate(rows)
            ],
            dtype=object,
        ).reshape(len(rows), len(columns))

    def named(self, name: str, side: Expression) -> Expression:
        """Variable of an expression; a number is itself."""
        if not side.names:
            return side
        name = free(name, self.taken)
        self.sides[name] = side
        return Expression.variable(name)

    def gain(self, output: str, name: str, side: Expression) -> Expression:
        """Variable of a gain, which is none where its output is not known."""
        made = self.named(name, side)
        self.gains[output] = (*self.gains.get(output, ()), *made.names)
        return made


def jacobian(of: Named, by: Sequence[str], at: Named) -> Array:
    """Derivatives of right sides by some signals, at estimates of these."""
    slopes = [side.derivative(name).substituted(at) for side in of.values() for name in by]
    return np.array(slopes, dtype=object).reshape(len(of), len(by))


def split(sides: Named, count: int) -> tuple[dict[str, Expression], dict[str, Expression]]:
    """The first so many entries, and the rest."""
    pairs = list(sides.items())
    return dict(pairs[:count]), dict(pairs[count:])


def written_out(plant: Equations, outputs: Sequence[str]) -> tuple[Mapping[str, Expression], Mapping[str, Expression]]:
    """Rates in terms of states, inputs, w and measured outputs, and outputs in terms of states, inputs and w.

    Raises `UsageError`: an algebraic signal depends on itself.
    """
    inner = dict(plant.algebraic)
    for _ in inner:
        inner = {name: side.substituted({k: e for k, e in inner.items() if k != name}) for name, side in inner.items()}
    if any(not side.names.isdisjoint(inner) for side in inner.values()):
        raise UsageError(
            Problem("this filter takes no plant with an algebraic loop (Dqf)", key="observer.type", id="OBS406")
        )
    f = {name: side.substituted(inner) for name, side in plant.dynamics.items()}
    h = {name: plant.outputs[name].substituted(inner) for name in outputs}
    for _ in h:
        h = {name: side.substituted({k: e for k, e in h.items() if k != name}) for name, side in h.items()}
    return f, h


def numbers(M: Array) -> Array:
    """Matrix of doubles as expressions."""
    entries = [Expression.number(entry) for entry in printed(M).ravel()]
    return np.array(entries, dtype=object).reshape(M.shape)


def times(*matrices: Array) -> Array:
    """Product of matrices of expressions."""

    def pair(M: Array, N: Array) -> Array:
        entries = [sum(map(Expression.__mul__, row, column), ZERO) for row in M for column in N.T]
        return np.array(entries, dtype=object).reshape(len(M), N.shape[1])

    return reduce(pair, matrices)
