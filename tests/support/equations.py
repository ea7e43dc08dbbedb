"""Other views of a plant as equations: explicit right sides, and the matrices that the equations make."""

from collections.abc import Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

import numpy as np
from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Exact
from obsdesign.model.equations import Equations
from obsdesign.model.plant import Plant


def order(equations: Equations) -> tuple[str, ...] | None:
    """Algebraic signals and outputs, each after those that it needs; None where some depend on themselves."""
    definitions = {**equations.algebraic, **equations.outputs}
    needed = {name: side.names & definitions.keys() for name, side in definitions.items()}
    try:
        return tuple(TopologicalSorter(needed).static_order())
    except CycleError:
        return None


def explicit(equations: Equations) -> Equations:
    """Same plant with right sides in t, x, u and w alone, and no algebraic signals.

    Raises
    ------
    UsageError
        If the equations are implicit.
    """
    found = order(equations)
    if found is None:
        raise UsageError("the plant has an algebraic loop: no right side in the states alone is known", id="OBS305")
    definitions = {**equations.algebraic, **equations.outputs}
    known: dict[str, Expression] = {}
    for name in found:
        known[name] = definitions[name].substituted(known)
    outputs = {name: known[name] for name in equations.outputs}
    dynamics = {name: side.substituted(known) for name, side in equations.dynamics.items()}
    return Equations(dynamics, outputs, {}, equations.inputs, equations.exogenous, equations.time)


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
        raise UsageError(
            "no plant in matrices: an algebraic signal or an output stands in a right side by itself", id="OBS406"
        )
    known = {"t", *equations.inputs, *equations.outputs}
    if stray := [term for term in parts.terms if not term.names <= known | equations.algebraic.keys()]:
        raise UsageError(f"no plant in matrices: {stray[0]} is not linear in states and unknown inputs", id="OBS406")
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
