"""Stacks of expressions over one vector of arguments, their derivatives, and algebraic loops through them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array

LOOP_ITERATIONS = 60
LOOP_TOLERANCE = 1e-10  # of the last Newton step; the error left is its square
ROUNDING = 1e-15  # of a residual that is nothing else, where the step is large: at a double root

Entry = Callable[[Sequence[float]], float]


@dataclass(frozen=True)
class Term:
    """An expression, and where each of its names stands in the vector of arguments."""

    expression: Expression
    places: Mapping[str, int]

    def entry(self) -> Entry:
        """Value as a function of the vector of arguments."""
        names = sorted(self.expression.names)
        function = self.expression.scalar(names)
        places = [self.places[name] for name in names]
        if not places:
            return lambda _: function()
        if len(places) == 1:
            (only,) = places
            return lambda arguments: function(arguments[only])
        pick = itemgetter(*places)
        return lambda arguments: function(*pick(arguments))

    def derivatives(self) -> list[tuple[int, Entry]]:
        """Place and value of each partial derivative that is not identically zero."""
        partials = [
            (self.places[name], Term(self.expression.derivative(name), self.places))
            for name in sorted(self.expression.names)
        ]
        return [(place, partial.entry()) for place, partial in partials if not partial.is_zero()]

    def is_zero(self) -> bool:
        """Whether the expression is the constant zero."""
        return not self.expression.names and self.expression.scalar([])() == 0


class Stack:
    """phi(a): terms one under the other, over one vector of arguments.

    Parameters
    ----------
    terms
        The components of phi.
    width
        Length of the vector of arguments.
    """

    def __init__(self, terms: Sequence[Term], width: int) -> None:
        self.terms = tuple(terms)
        self.width = width
        self._entries = [term.entry() for term in terms]
        self._partials = [(i, *d) for i, term in enumerate(terms) for d in term.derivatives()]

    def values(self, arguments: Sequence[float]) -> Array:
        """phi, (len(terms),)."""
        return np.array([entry(arguments) for entry in self._entries])

    def table(self, arguments: Array) -> Array:
        """phi, (N, len(terms)), of each row of arguments (N, width)."""
        table = np.empty((len(arguments), len(self.terms)))
        for column, term in enumerate(self.terms):
            names = sorted(term.expression.names)
            table[:, column] = term.expression.function(names)(*(arguments[:, term.places[name]] for name in names))
        return table

    def jacobian(self, arguments: Sequence[float]) -> Array:
        """Jacobian d phi / d a, (len(terms), width)."""
        matrix = np.zeros((len(self.terms), self.width))
        for row, column, partial in self._partials:
            matrix[row, column] = partial(arguments)
        return matrix

    def structure(self) -> Array:
        """Which argument enters which component, (len(terms), width)."""
        pattern = np.zeros((len(self.terms), self.width), dtype=bool)
        for row, term in enumerate(self.terms):
            pattern[row, [term.places[name] for name in term.expression.names]] = True
        return pattern


class Loop:
    """The equation phi = phi(known, a + K phi).

    Where phi depends on itself along no cycle, a few substitutions solve it exactly (one if K phi does not
    enter); else Newton's method does, from the last solution, with steps halved until the residual falls.

    Parameters
    ----------
    stack
        phi of the arguments (known, a).
    K
        (na, nphi).
    """

    def __init__(self, stack: Stack, K: Array) -> None:
        self.stack = stack
        self.K = K
        self._enters = bool(K.any())
        self._last = np.zeros(K.shape[1])
        self._substitutions = substitutions(stack.structure()[:, stack.width - len(K) :], K)

    def solve(self, known: list[float], a: Array) -> Array:
        """phi, (nphi,).

        Raises
        ------
        ArithmeticError
            If there is no solution to be found.
        """
        if self._substitutions is None:
            self._last = self._newton(known, a)
            return self._last
        phi = self.stack.values(known + a.tolist())
        for _ in range(self._substitutions - 1):
            phi = self._values(known, a, phi)
        return phi

    def argument(self, a: Array, phi: Array) -> Array:
        """Return a + K phi."""
        return a + self.K @ phi if self._enters else a

    def sensitivity(self, known: list[float], a: Array, u: Array, right: Array) -> Array:
        """Differentiate the solution, (nphi, m), at the argument a that it has.

        With the derivatives of u, (nu, m), and of the right side, (na, m),
        phi' = (I - phi_a K)^-1 (phi_u u' + phi_a right').
        """
        of_u, of_a = np.split(self.stack.jacobian(known + a.tolist())[:, 1:], [len(u)], axis=1)
        rate = of_u @ u + of_a @ right
        return np.linalg.solve(np.eye(len(rate)) - of_a @ self.K, rate) if self._enters else rate

    def _values(self, known: list[float], a: Array, phi: Array) -> Array:
        return self.stack.values(known + (a + self.K @ phi).tolist())

    def _newton(self, known: list[float], a: Array) -> Array:
        phi = self._last
        residual = phi - self._values(known, a, phi)
        for _ in range(LOOP_ITERATIONS):
            slope = self.stack.jacobian(known + (a + self.K @ phi).tolist())[:, len(known) :]
            try:
                step = np.linalg.solve(np.eye(len(phi)) - slope @ self.K, residual)
            except np.linalg.LinAlgError:
                break
            rounding = 1e-5 * np.linalg.norm(slope) * np.linalg.norm(a)
            if np.linalg.norm(step) <= LOOP_TOLERANCE * (np.linalg.norm(phi) + rounding):
                return phi - step
            if np.linalg.norm(residual) <= ROUNDING * np.linalg.norm(phi):
                return phi
            phi, residual = self._descend(known, a, phi, residual, step)
            if not residual.any():
                return phi
        raise FloatingPointError("the algebraic loop through q = .. + Dqf f(q) has no solution")

    def _descend(self, known: list[float], a: Array, phi: Array, residual: Array, step: Array) -> tuple[Array, Array]:
        """Point along the Newton step where the residual is smaller, and its residual."""
        for shrink in 0.5 ** np.arange(30):
            trial = phi - shrink * step
            left = trial - self._values(known, a, trial)
            if np.linalg.norm(left) < np.linalg.norm(residual):
                return trial, left
        raise FloatingPointError("the algebraic loop through q = .. + Dqf f(q) has no solution")


def substitutions(pattern: Array, K: Array) -> int | None:
    """Count the substitutions that solve phi = phi(a + K phi) exactly; None if phi depends on itself."""
    edges = pattern.astype(int) @ (K != 0).astype(int) > 0
    reach = np.eye(len(edges), dtype=bool)
    for count in range(len(edges) + 1):
        if not reach.any():
            return max(count, 1)
        reach = reach @ edges
    return None if reach.any() else len(edges) + 1
