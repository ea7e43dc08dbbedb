"""A nonlinearity on the region where its type must hold."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from math import inf

import numpy as np
from flint import fmpq

from obsdesign.expressions import Expression, Interval
from obsdesign.expressions.interval import point
from obsdesign.expressions.tree import Call, Node, Number, Variable, fold
from obsdesign.records import dataclass

Range = tuple[float, float]
Ends = tuple[fmpq | None, fmpq | None]  # None: no limit
EVERYWHERE: Ends = (None, None)
SINCE_ZERO: Ends = (fmpq(0), None)  # t, of which a run begins at 0


def outward(ends: Ends) -> Range:
    """Tightest doubles around exact limits."""
    low, high = ends
    return -inf if low is None else float(point(low).low), inf if high is None else float(point(high).high)


@dataclass(frozen=True)
class Restriction:
    """f(t, y, q) for q = (q1, .., q_nq) and every other variable in a box."""

    f: tuple[Expression, ...]
    nq: int
    region: Mapping[str, Ends]  # of q1, .. and of every other variable of f

    @classmethod
    def of(cls, f: Sequence[Expression], nq: int, region: Mapping[str, Ends]) -> "Restriction":
        """Restriction to a region; what it does not name ranges over all reals, and a single q is q1."""
        renamed = tuple(with_name(component, "q", "q1") for component in f)
        arguments = tuple(f"q{i + 1}" for i in range(nq))
        given = {"q1" if name == "q" else name: limits for name, limits in region.items()}
        others = sorted(set().union(*(component.names for component in renamed)).difference(arguments))
        return cls(renamed, nq, {name: given.get(name, EVERYWHERE) for name in (*arguments, *others)})

    @cached_property
    def box(self) -> Mapping[str, Range]:
        """Region in doubles, rounded outward."""
        return {name: outward(ends) for name, ends in self.region.items()}

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of the components of q."""
        return tuple(self.region)[: self.nq]

    @property
    def others(self) -> tuple[str, ...]:
        """Names of the other variables."""
        return tuple(self.region)[self.nq :]

    @cached_property
    def jacobian(self) -> tuple[tuple[Expression, ...], ...]:
        """Entries df_i/dq_j, (nf, nq).

        Raises `ExpressionError`: a derivative is too large to be written down.
        """
        return tuple(tuple(component.derivative(q) for q in self.arguments) for component in self.f)

    @property
    def decoupled(self) -> bool:
        """Whether each f_i depends on its own q_i only."""
        if len(self.f) != self.nq:
            return False
        own = zip(self.f, self.arguments, strict=True)
        return all(component.names.intersection(self.arguments) <= {q} for component, q in own)

    def intervals(self) -> dict[str, Interval]:
        """Box as intervals."""
        return {name: Interval(np.array(low), np.array(high)) for name, (low, high) in self.box.items()}

    def shown(self, name: str) -> str:
        """Name of a variable as a message has it: a single component of q is q."""
        return "q" if self.nq == 1 and name == "q1" else name


def order_free(expression: Expression) -> str:
    """Key of an expression that is the same for another order of its terms and factors."""

    def call(node: Call, operands: list[str]) -> str:
        return f"{node.operation}({', '.join(sorted(operands) if node.operation in '+*' else operands)})"

    return fold(expression.order, str, str, call)


def with_name(expression: Expression, old: str, new: str) -> Expression:
    """Same expression with another name of a variable."""
    if old not in expression.names:
        return expression

    def variable(name: str) -> Node:
        return Variable(new if name == old else name)

    def call(node: Call, operands: list[Node]) -> Node:
        return Call(node.operation, tuple(operands))

    return Expression(fold(expression.order, Number, variable, call))
