"""A plant as equations over named signals; its matrices are one view of them (`split`)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from typing import Literal

import numpy as np
from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, Exact
from obsdesign.model.plant import Plant

Named = Mapping[str, Expression]


@dataclass(frozen=True)
class Equations:
    """A plant over named signals, in continuous or in discrete time.

    x' = f(t, x, u, w, a, y)     or, in discrete time,    x+ = f(t, x, u, w, a, y)
    a  = g(t, x, u, w, a, y)
    y  = h(t, x, u, w, a, y)

    The algebraic signals a, such as the arguments q of nonlinearities, and the outputs y may stand in every right
    side; where they depend on themselves, the equations are implicit.

    Raises
    ------
    UsageError
        If two signals share a name, or a right side has one that is no signal.
    """

    dynamics: Named  # by the names of the states
    outputs: Named
    algebraic: Named = field(default_factory=dict)
    inputs: tuple[str, ...] = ()  # known
    exogenous: tuple[str, ...] = ()  # unknown
    time: Literal["continuous", "discrete"] = "continuous"

    def __post_init__(self) -> None:
        names = self.signals
        if len(set(names)) < len(names):
            twice = next(name for i, name in enumerate(names) if name in names[:i])
            raise UsageError(f"{twice}: two signals of the plant have this name")
        for name, side in self.sides():
            if stray := sorted(side.names.difference(names)):
                raise UsageError(f"{name}: {stray[0]} in {side} is no signal of the plant")

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return tuple(self.dynamics)

    @property
    def signals(self) -> tuple[str, ...]:
        """Names that may stand in a right side."""
        return ("t", *self.states, *self.inputs, *self.exogenous, *self.algebraic, *self.outputs)

    def sides(self) -> Iterator[tuple[str, Expression]]:
        """Every name that is defined, with its right side."""
        for part in (self.dynamics, self.algebraic, self.outputs):
            yield from part.items()

    def order(self) -> tuple[str, ...] | None:
        """Algebraic signals and outputs, each after those that it needs; None where some depend on themselves."""
        definitions = {**self.algebraic, **self.outputs}
        needed = {name: side.names & definitions.keys() for name, side in definitions.items()}
        try:
            return tuple(TopologicalSorter(needed).static_order())
        except CycleError:
            return None

    def explicit(self) -> "Equations":
        """Same plant with right sides in t, x, u and w alone, and no algebraic signals.

        Raises
        ------
        UsageError
            If the equations are implicit.
        """
        order = self.order()
        if order is None:
            raise UsageError("the plant has an algebraic loop: no right side in the states alone is known")
        definitions = {**self.algebraic, **self.outputs}
        known: dict[str, Expression] = {}
        for name in order:
            known[name] = definitions[name].substituted(known)
        outputs = {name: known[name] for name in self.outputs}
        dynamics = {name: side.substituted(known) for name, side in self.dynamics.items()}
        return Equations(dynamics, outputs, {}, self.inputs, self.exogenous, self.time)


@dataclass(frozen=True)
class Split:
    """Right sides as M a + N phi(a), exactly: linear in the signals a, and weighted terms phi that are not."""

    signals: tuple[str, ...]
    matrix: Exact  # (rows, signals)
    terms: tuple[Expression, ...]  # each once; a number is the term 1
    weights: Exact  # (rows, terms)

    def part(self, names: Sequence[str]) -> Exact:
        """Columns of M of some signals."""
        return np.asarray(self.matrix[:, [self.signals.index(name) for name in names]])


def split(sides: Sequence[Expression], signals: Sequence[str]) -> Split:
    """Separate what is linear in the named signals from the rest."""
    place = {name: i for i, name in enumerate(signals)}
    terms: dict[Expression, int] = {}
    matrix = np.full((len(sides), len(signals)), fmpq(0), dtype=object)
    weights: list[dict[int, fmpq]] = [{} for _ in sides]
    for row, side in enumerate(sides):
        for c, term in side.summands():
            if term.text in place:
                matrix[row, place[term.text]] += c
            elif c != 0:
                column = terms.setdefault(term, len(terms))
                weights[row][column] = weights[row].get(column, fmpq(0)) + c
    dense = np.full((len(sides), len(terms)), fmpq(0), dtype=object)
    for row, entries in enumerate(weights):
        for column, c in entries.items():
            dense[row, column] = c
    return Split(tuple(signals), matrix, tuple(terms), dense)


def linear(M: Array, signals: Sequence[str]) -> list[Expression]:
    """Rows of M times the named signals, as expressions; M is exact."""
    variables = [Expression.variable(name) for name in signals]
    rows = ([(c, v) for c, v in zip(row, variables, strict=True) if c != 0] for row in M)
    return [Expression.combination([c for c, _ in row], [v for _, v in row]) for row in rows]


def total(*parts: Sequence[Expression]) -> list[Expression]:
    """Sum of lists of expressions, entry by entry."""
    return [Expression.combination([fmpq(1)] * len(column), column) for column in zip(*parts, strict=True)]


@dataclass(frozen=True)
class Terms:
    """What stands beside the matrices of a plant: its nonlinear blocks and known terms."""

    blocks: tuple[tuple[tuple[Expression, ...], int], ...]  # f_i, of t, outputs, inputs and q (or q1, ..); and nq_i
    gx: tuple[Expression, ...]  # as many as states, likewise gq and gy
    gq: tuple[Expression, ...]
    gy: tuple[Expression, ...]
    inputs: tuple[str, ...]


def from_matrices(plant: Plant[Exact], terms: Terms) -> Equations:
    """Equations of a plant in matrices: x' = A x + Bf f + gx + B w, q = .., y = ..; q are algebraic signals."""
    taken = {"t", *plant.states, *terms.inputs, *plant.outputs}
    exogenous = tuple(free(name, taken) for name in plant.exogenous)
    q: list[str] = []
    f: list[Expression] = []
    for i, (block, nq) in enumerate(terms.blocks, start=1):
        own = [free(f"q{i}" if nq == 1 else f"q{i}_{k + 1}", taken) for k in range(nq)]
        local = {f"q{k + 1}": Expression.variable(name) for k, name in enumerate(own)}
        if nq == 1:
            local["q"] = local["q1"]
        q += own
        f += [component.substituted(local) for component in block]

    def sides(on_x: Array, on_f: Array, on_w: Array, g: Sequence[Expression]) -> list[Expression]:
        weighted = [[(c, e) for c, e in zip(row, f, strict=True) if c != 0] for row in on_f]
        combined = [Expression.combination([c for c, _ in row], [e for _, e in row]) for row in weighted]
        return total(linear(on_x, plant.states), combined, g, linear(on_w, exogenous))

    return Equations(
        dynamics=dict(zip(plant.states, sides(plant.A, plant.Bf, plant.B, terms.gx), strict=True)),
        outputs=dict(zip(plant.outputs, sides(plant.C, plant.Df, plant.D, terms.gy), strict=True)),
        algebraic=dict(zip(q, sides(plant.Cq, plant.Dqf, plant.Dq, terms.gq), strict=True)),
        inputs=terms.inputs,
        exogenous=exogenous,
    )


def free(name: str, taken: set[str]) -> str:
    """Name that no signal has yet, which it is given."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def matrices(equations: Equations) -> Plant[Exact]:
    """Matrices of a plant whose right sides are linear in x and w beside terms of the algebraic signals.

    Each term that is no known one (of t, inputs and outputs alone) is a component of f; known terms are left out, as
    from every `Plant`.

    Raises
    ------
    UsageError
        If a right side has a term of states or unknown inputs that is not linear, or an algebraic signal or an output
        by itself.
    """
    states, exogenous, loose = equations.states, equations.exogenous, (*equations.algebraic, *equations.outputs)
    names = [name for name, _ in equations.sides()]
    parts = split([side for _, side in equations.sides()], (*states, *exogenous, *loose))
    if (parts.part(loose) != 0).any():
        raise UsageError("no plant in matrices: an algebraic signal or an output stands in a right side by itself")
    known = {"t", *equations.inputs, *equations.outputs}
    if stray := [term for term in parts.terms if not term.names <= known | equations.algebraic.keys()]:
        raise UsageError(f"no plant in matrices: {stray[0]} is not linear in states and unknown inputs")
    f = [i for i, term in enumerate(parts.terms) if not term.names <= known]
    of_x, of_w, of_f = parts.part(states), parts.part(exogenous), parts.weights[:, f]
    x, q, y = (np.array([name in part for name in names]) for part in
               (equations.dynamics, equations.algebraic, equations.outputs))  # fmt: skip
    return Plant(
        A=of_x[x], Bf=of_f[x], B=of_w[x],
        Cq=of_x[q], Dqf=of_f[q], Dq=of_w[q],
        C=of_x[y], Df=of_f[y], D=of_w[y],
        states=states, exogenous=exogenous, outputs=tuple(equations.outputs),
    )  # fmt: skip
