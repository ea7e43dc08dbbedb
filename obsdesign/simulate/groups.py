"""Groups of slots of an array program: how each is filled from the slots before it, and its derivatives."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from obsdesign.expressions import Expression, vector_function
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass

LOOP_ITERATIONS = 60
LOOP_TOLERANCE = 1e-10  # of the last Newton step; the error left is its square
ROUNDING = 1e-15  # of a residual that is nothing else, where the step is large: at a double root
NO_SOLUTION = "the algebraic loop through q = .. + Dqf f(q) has no solution"


class Group(ABC):
    """Slots that are filled together, from those before them."""

    @abstractmethod
    def fill(self, X: Float) -> None:
        """Fill the slots of X (slots,), or of a table of one column an instant, (slots, N)."""

    def differentiate(self, X: Float, dX: Float) -> None:  # noqa: ARG002
        """Fill the rows of dX (slots, m), given the values X; where the group is linear, as it fills X."""
        self.fill(dX)


@dataclass(frozen=True)
class Rows(Group):
    """Linear signals: M times the slots before."""

    start: int
    stop: int
    M: Float  # (stop - start, start)

    def fill(self, X: Float) -> None:
        """One product."""
        np.dot(self.M, X[: self.start], out=X[self.start : self.stop])


@dataclass(frozen=True)
class Pairs(Group):
    """Sums or differences of two slots."""

    start: int
    stop: int
    first: slice | Array
    second: slice | Array
    sign: int

    def fill(self, X: Float) -> None:
        """By index."""
        combine = np.add if self.sign > 0 else np.subtract
        combine(X[self.first], X[self.second], out=X[self.start : self.stop])


class Terms(Group):
    """Nonlinear terms of the slots before, which have the `names` that stand in the terms; the first is at `start`."""

    def __init__(self, start: int, terms: Sequence[Expression], names: Sequence[str]) -> None:
        self.start, self.stop = start, start + len(terms)
        self.terms, self.names = tuple(terms), tuple(names)
        self.values = vector_function(self.terms, self.names)
        self._slopes = np.zeros((len(terms), start))  # where they were differentiated last

    @cached_property
    def partials(self) -> tuple[Array, Array, Callable[[Sequence[float]], list[float]]]:
        """Row and column of each derivative that is not identically zero, and a function of all of them."""
        place = {name: i for i, name in enumerate(self.names)}
        found = [
            (row, place[name], slope)
            for row, term in enumerate(self.terms)
            for name in sorted(term.names)
            if not is_zero(slope := term.derivative(name))
        ]
        rows, columns = (np.array([entry[k] for entry in found], dtype=int) for k in (0, 1))
        return rows, columns, vector_function([slope for _, _, slope in found], self.names)

    @cached_property
    def rows(self) -> list[Callable[[Array], Array]]:
        """Each term as a function of a table."""
        return [term.rows(self.names) for term in self.terms]

    def fill(self, X: Float) -> None:
        """By closures on floats, or on the rows of a table."""
        if X.ndim == 1:
            X[self.start : self.stop] = self.values(X[: self.start].tolist())
            return
        with np.errstate(all="ignore"):
            for row, term in enumerate(self.rows, start=self.start):
                X[row] = term(X)

    def differentiate(self, X: Float, dX: Float) -> None:
        """Chain rule."""
        self._slopes = self.jacobian(X)
        dX[self.start : self.stop] = self._slopes @ dX[: self.start]

    def jacobian(self, X: Float) -> Float:
        """Derivatives of the terms by the slots before, (terms, start)."""
        rows, columns, slopes = self.partials
        J = np.zeros((len(self.terms), self.start))
        J[rows, columns] = slopes(X[: self.start].tolist())
        return J

    def rounding(self, X: Float) -> float:
        """Size of the terms if nothing cancelled in their arguments, at the X where they were differentiated last."""
        J = self._slopes
        return size(J.ravel()) * size(X[: self.start][J.any(axis=0)])


class Loop(Group):
    """Terms that depend on themselves: phi = T(phi), by Newton's method from the last solution.

    The slots from `start` to `stop` hold phi; the groups after them compute T from it, the last of them in `terms`.
    Steps are halved until the residual falls.
    """

    def __init__(self, start: int, groups: Sequence[Group], terms: Terms) -> None:
        self.start, self.stop = start, start + len(terms.terms)
        self.groups, self.terms = (*groups, terms), terms
        self.result = slice(terms.start, terms.stop)
        self._last = np.zeros(self.stop - start)

    def fill(self, X: Float) -> None:
        """Solve.

        Raises `ArithmeticError` if there is no solution to be found.
        """
        X[self.start : self.stop] = self._last = self._newton(X)
        for group in self.groups:
            group.fill(X)

    def differentiate(self, X: Float, dX: Float) -> None:
        """Implicit function theorem: dphi = (I - T_phi)^-1 T_x dx."""
        dX[self.start : self.stop] = 0
        for group in self.groups:
            group.differentiate(X, dX)
        dX[self.start : self.stop] = np.linalg.solve(self._matrix(X), dX[self.result])
        for group in self.groups:
            group.differentiate(X, dX)

    def _matrix(self, X: Float) -> Float:
        """I - T_phi."""
        count = self.stop - self.start
        dX = np.zeros((len(X), count))
        dX[self.start : self.stop] = np.eye(count)
        for group in self.groups:
            group.differentiate(X, dX)
        return np.asarray(np.eye(count) - dX[self.result])

    def _residual(self, X: Float, phi: Float) -> Float:
        X[self.start : self.stop] = phi
        for group in self.groups:
            group.fill(X)
        return np.asarray(phi - X[self.result])

    def _newton(self, X: Float) -> Float:
        phi = self._last
        residual = self._residual(X, phi)
        for _ in range(LOOP_ITERATIONS):
            if not residual.any():
                return phi
            try:
                step = np.asarray(np.linalg.solve(self._matrix(X), residual), dtype=float)
            except np.linalg.LinAlgError:
                break
            if size(step) <= LOOP_TOLERANCE * (size(phi) + 1e-5 * self.terms.rounding(X)):
                return np.asarray(phi - step)
            if size(residual) <= ROUNDING * size(phi):
                return phi
            phi, residual = self._descend(X, phi, residual, step)
        raise FloatingPointError(NO_SOLUTION)

    def _descend(self, X: Float, phi: Float, residual: Float, step: Float) -> tuple[Float, Float]:
        """Point along the Newton step where the residual is smaller, and its residual."""
        for shrink in 0.5 ** np.arange(30):
            trial = phi - shrink * step
            left = self._residual(X, trial)
            if size(left) < size(residual):
                return trial, left
        raise FloatingPointError(NO_SOLUTION)


def size(v: Float) -> float:
    """|v|, of few numbers at once."""
    return math.sqrt(v @ v)


def span(slots: Array) -> slice | Array:
    """Slots that follow each other as a slice, which is quicker."""
    consecutive = (np.diff(slots) == 1).all()
    return slice(int(slots[0]), int(slots[-1]) + 1) if consecutive else slots


def is_zero(expression: Expression) -> bool:
    """Whether an expression is the constant zero."""
    return not expression.names and expression.scalar([])() == 0
