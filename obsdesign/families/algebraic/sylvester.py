"""The Sylvester equation T A - Lambda T = B C of a linear plant (Luenberger 1964), exactly."""

from collections.abc import Sequence

import numpy as np
from flint import fmpq, fmpq_mat

from obsdesign.expressions.exact import double
from obsdesign.expressions.tree import Number
from obsdesign.families.algebraic.ansatz import simplified
from obsdesign.families.algebraic.forms import Coordinate
from obsdesign.families.algebraic.rational import beside, independent
from obsdesign.model.equations import Equations, Named
from obsdesign.records import dataclass


def coefficients(sides: Named, states: Sequence[str]) -> fmpq_mat | None:
    """Matrix of right sides that are linear in the states, but for what does not depend on them; None of others."""
    slopes = [simplified(side.derivative(name)).root for side in sides.values() for name in states]
    values = [slope.value for slope in slopes if isinstance(slope, Number)]
    return fmpq_mat(len(sides), len(states), values) if len(values) == len(slopes) else None


def linear(equations: Equations) -> bool:
    """Whether a plant is x' = A x + g(t, u), y = C x + h(t, u) with constant matrices."""
    sides = (equations.dynamics, equations.outputs)
    return all(coefficients(each, equations.states) is not None for each in sides)


@dataclass(frozen=True)
class Sylvester:
    """Rows of T, one a coordinate, and what decides whether they suit."""

    T: fmpq_mat
    rates: tuple[fmpq, ...]  # diagonal of Lambda
    B: fmpq_mat
    condition: float  # ratio of the largest to the smallest singular value of [T; C]
    shared: tuple[fmpq, ...]  # rates that are eigenvalues of A: T is not unique there
    controllable: bool  # (Lambda, B)

    @property
    def sentence(self) -> str:
        """Conditions and condition number."""
        if self.shared:
            spectra = f"lambda = {', '.join(map(str, self.shared))} are eigenvalues of A"
        else:
            spectra = "no lambda is an eigenvalue of A"
        pair = "controllable" if self.controllable else "not controllable"
        return f"T A - Lambda T = B C: {spectra}; (Lambda, B) is {pair}; cond([T; C]) = {self.condition:.3g}"

    @classmethod
    def of(cls, equations: Equations, coordinates: Sequence[Coordinate]) -> "Sylvester | None":
        """Sylvester equation that the coordinates of a linear plant solve; None if it is another one (a cascade)."""
        states = equations.states
        A, C = coefficients(equations.dynamics, states), coefficients(equations.outputs, states)
        T = coefficients({each.name: each.phi for each in coordinates}, states)
        rates = [each.rate.root for each in coordinates]
        values = tuple(rate.value for rate in rates if isinstance(rate, Number))
        if A is None or C is None or T is None or not rates or len(values) < len(rates):
            return None
        rows = independent(C.transpose())
        C = fmpq_mat(len(rows), len(states), [C[i, j] for i in rows for j in range(len(states))])
        left = T * A - diagonal(values) * T
        B = left * C.transpose() * (C * C.transpose()).inv()
        if left != B * C:
            return None
        stacked = np.array([[double(entry) for entry in row] for row in (*T.tolist(), *C.tolist())])
        sizes = np.linalg.svd(stacked, compute_uv=False)
        n = len(states)
        shared = tuple(value for value in values if (A - diagonal((value,) * n)).det() == 0)
        reach, power = B, B
        for _ in values[1:]:
            power = diagonal(values) * power
            reach = beside(reach, power)
        return cls(T, values, B, float(sizes[0] / sizes[-1]), shared, reach.rank() == len(values))


def diagonal(values: Sequence[fmpq]) -> fmpq_mat:
    """Diagonal matrix."""
    n = len(values)
    return fmpq_mat(n, n, [values[i] if i == j else fmpq(0) for i in range(n) for j in range(n)])
