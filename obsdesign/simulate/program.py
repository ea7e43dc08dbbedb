"""Definitions of named signals as one array program: a value, a table over many instants, and exact derivatives.

A program fills an array, one slot a signal, group by group: linear signals by one product with a matrix, nonlinear
terms by closures, sums and differences by index, algebraic loops by Newton's method. Derivatives go forward through
the same groups, with the symbolic derivatives of the terms.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, Float, approximate
from obsdesign.records import dataclass
from obsdesign.simulate.groups import Group, Loop, Pairs, Rows, Terms, span

UNIT = "1"  # slot of the number 1

Weights = Mapping[str, fmpq]


@dataclass(frozen=True)
class Pair:
    """The sum, or the difference, of two signals: of an estimate and its error, of a term of both."""

    first: str
    second: str
    sign: int


Definition = Weights | Expression | Pair


def needs(definition: Definition) -> Iterable[str]:
    """Names that a definition takes."""
    if isinstance(definition, Pair):
        return (definition.first, definition.second)
    return definition.names if isinstance(definition, Expression) else definition


class Program:
    """Signals computed from inputs by definitions, which may stand in any order.

    Parameters
    ----------
    inputs
        Names of what is given; the first slot is the number 1.
    definitions
        By name: weights of other signals, a nonlinear term, or a pair.
    outputs
        Names that are wanted. They may be linear; then they are computed last.
    """

    def __init__(self, inputs: Sequence[str], definitions: Mapping[str, Definition], outputs: Sequence[str]) -> None:
        self.inputs = (UNIT, *inputs)
        self.definitions = resolved(definitions)
        self.slots: dict[str, int] = {name: i for i, name in enumerate(self.inputs)}
        self.groups = self._scheduled(self._wanted(outputs))
        self.loops = any(isinstance(group, Loop) for group in self.groups)
        self._X = np.zeros(len(self.slots))
        self._X[0] = 1.0

    def places(self, names: Iterable[str]) -> Array:
        """Slots of some signals."""
        return np.array([self.slots[name] for name in names], dtype=int)

    def run(self, t: float, s: Float, held: Float) -> Float:
        """Return all slots (slots,), which the next run overwrites, for inputs t, s and held signals in their order."""
        X, last = self._X, 2 + len(s)
        X[1], X[2:last] = t, s
        if len(held):
            X[last : last + len(held)] = held
        for group in self.groups:
            group.fill(X)
        return X

    def derivatives(self, X: Float, names: Sequence[str]) -> Float:
        """Derivatives of all slots by some inputs, (slots, names), at values X that `run` has found."""
        dX = np.zeros((len(X), len(names)))
        dX[self.places(names), np.arange(len(names))] = 1.0
        for group in self.groups:
            group.differentiate(X, dX)
        return dX

    def table(self, inputs: Float) -> Float:
        """All slots, one column an instant, for inputs (inputs, N); NaN where there is no value."""
        X = np.full((len(self.slots), inputs.shape[1]), np.nan)
        X[: len(self.inputs)] = np.vstack([np.ones(inputs.shape[1]), inputs])
        if not self.loops:
            for group in self.groups:
                group.fill(X)
            return X
        for column in X.T:
            try:
                column[:] = self.run(column[1], column[2 : len(self.inputs)], column[:0])
            except ArithmeticError:
                column[len(self.inputs) :] = np.nan
        return X

    def _wanted(self, outputs: Sequence[str]) -> list[str]:
        """Names that have to be computed, outputs and what they need."""
        found = reach(outputs, lambda name: () if name in self.inputs else needs(self.definitions[name]))
        return [name for name in found if name not in self.inputs]

    def _scheduled(self, waiting: list[str]) -> list[Group]:
        """Groups in an order in which each needs what is before it only."""
        groups: list[Group] = []
        while waiting:
            names = self._ready(waiting) or loop(waiting, self.definitions)
            if all(self.slots.keys() >= set(needs(self.definitions[name])) for name in names):
                groups.append(self._group(names))
            else:
                groups.append(self._loop(names))
            waiting = [name for name in waiting if name not in self.slots]
        return groups

    def _ready(self, waiting: Sequence[str]) -> list[str]:
        """Signals of one kind that can be computed now: linear ones last, when most are together."""
        ready = [name for name in waiting if self.slots.keys() >= set(needs(self.definitions[name]))]
        kinds = {name: kind(self.definitions[name]) for name in ready}
        return [name for name in ready if kinds[name] == min(kinds.values())]

    def _group(self, names: Sequence[str]) -> Group:
        """Give the next slots to signals of one kind."""
        start, before = len(self.slots), list(self.slots)
        made = [self.definitions[name] for name in names]
        self.slots |= {name: start + i for i, name in enumerate(names)}
        if isinstance(made[0], Expression):
            return Terms(start, [term for term in made if isinstance(term, Expression)], before)
        if isinstance(made[0], Pair):
            pairs = [pair for pair in made if isinstance(pair, Pair)]
            first, second = self.places(p.first for p in pairs), self.places(p.second for p in pairs)
            return Pairs(start, len(self.slots), span(first), span(second), made[0].sign)
        M = np.zeros((len(names), start))
        for row, weights in enumerate(made):
            if isinstance(weights, Mapping):
                for name, weight in weights.items():
                    M[row, self.slots[name]] = approximate(weight)
        return Rows(start, len(self.slots), M)

    def _loop(self, names: Sequence[str]) -> Loop:
        """Give the next slots to the terms of a loop, and then to what computes them anew."""
        terms = [name for name in names if isinstance(self.definitions[name], Expression)]
        start = len(self.slots)
        self.slots |= {name: start + i for i, name in enumerate(terms)}
        groups = self._scheduled([name for name in names if name not in terms])
        first, before = len(self.slots), list(self.slots)
        again = [term for name in terms if isinstance(term := self.definitions[name], Expression)]
        self.slots |= {f"{name} again": first + i for i, name in enumerate(terms)}
        return Loop(start, groups, Terms(first, again, before))


def kind(definition: Definition) -> int:
    """Order in which the kinds of signals that are ready are computed: each kind is one group."""
    if isinstance(definition, Pair):
        return 1 - definition.sign
    return 1 if isinstance(definition, Expression) else 3


def resolved(definitions: Mapping[str, Definition]) -> dict[str, Definition]:
    """Definitions with linear signals in terms of inputs, terms and differences alone.

    A linear signal that depends on itself through linear ones stands as a term, to be found as in any other loop.
    """
    linear = {name: made for name, made in definitions.items() if isinstance(made, Mapping)}
    sums = {name: made for name, made in definitions.items() if isinstance(made, Pair) and made.sign > 0}
    edges = {name: [n for n in needs(definitions[name]) if n in linear or n in sums] for name in (*linear, *sums)}
    cyclic = {name for name in edges if name in reach(edges[name], edges.__getitem__)}
    made: dict[str, Definition] = dict(definitions)

    def expand(name: str, factor: fmpq, into: defaultdict[str, fmpq]) -> None:
        if name in cyclic:
            made[f"({name})"] = Expression.variable(name)
            into[f"({name})"] += factor
        elif name in sums:
            for part in needs(sums[name]):
                expand(part, factor, into)
        elif name in linear:
            for other, weight in linear[name].items():
                expand(other, factor * weight, into)
        else:
            into[name] += factor

    for name, given in linear.items():
        weights: defaultdict[str, fmpq] = defaultdict(fmpq)
        for other, weight in given.items():
            expand(other, weight, weights)
        made[name] = {other: weight for other, weight in weights.items() if weight != 0}
    return made


def reach(names: Iterable[str], following: Callable[[str], Iterable[str]]) -> dict[str, None]:
    """Names that can be reached from some, in the order in which they are."""
    found: dict[str, None] = {}
    waiting = list(names)
    while waiting:
        if (name := waiting.pop()) not in found:
            found[name] = None
            waiting += following(name)
    return found


def loop(waiting: Sequence[str], definitions: Mapping[str, Definition]) -> list[str]:
    """Signals, none of which is ready, that need each other and nothing else that is waiting."""
    edges = {name: [n for n in needs(definitions[name]) if n in waiting] for name in waiting}
    reached = {name: reach(edges[name], edges.__getitem__) for name in waiting}
    first = min((name for name in waiting if name in reached[name]), key=lambda name: len(reached[name]))
    return [name for name in waiting if name in reached[first]]
