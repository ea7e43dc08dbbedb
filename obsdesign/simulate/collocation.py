"""Exponential collocation at the three Gauss points of a step: exact for linear flows with held inputs, however stiff.

    d' = J d + N(t, d),    d(c_i h) = exp(c_i h J) d(0) + h sum_j a_ij(h J) N(c_j h, d(c_j h)),
    a_ij(Z) = integral over [0, c_i] of exp((c_i - s) Z) l_j(s) ds

with l_j the Lagrange polynomials of the c_j; J = 0 gives the Gauss method of order 6 (Hochbruck and Ostermann, 2005).
"""

from collections.abc import Callable
from math import factorial

import numpy as np

from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass
from obsdesign.simulate.sizes import balanced

NODES = 0.5 + np.sqrt(0.15) * np.array([-1, 0, 1])  # c
WEIGHTS = np.array([5, 8, 5]) / 18  # of the quadrature
LAGRANGE = np.linalg.inv(np.vander(NODES, increasing=True)).T  # row j: coefficients of l_j, from the constant on
SMALL = 1e-8  # of a change between two iterates, against the size of d
ITERATIONS, SLOW = 30, 5  # at most; from so many on, J is renewed
KEPT = 64  # lengths whose matrices are kept


@dataclass(frozen=True)
class Step:
    """The matrices of a step of length h, for a given J (m, m)."""

    J: Float
    unit: Float  # (m,) of each state, in which J is balanced
    free: Float  # (3 m, m): exp(c_i h J); rows run over states first, then nodes
    driven: Float  # (3 m, 3 m): h a_ij(h J)
    free_end: Float  # (m, m), the same at the end of the step
    driven_end: Float  # (m, 3 m)

    @classmethod
    def of(cls, J: Float, h: float, unit: Float | None = None) -> "Step":
        """Matrices of a step, computed in balanced units."""
        m, unit = len(J), balanced(J) if unit is None else unit
        free, driven = propagators(J, h, unit, np.append(NODES, 1.0))
        inner = free[:, :3].reshape(3 * m, m), driven[:, :3].reshape(3 * m, 3 * m)
        return cls(J, unit, *inner, free[:, 3], driven[:, 3].reshape(m, 3 * m))

    def advance(self, d: Float, rates: Callable[[Float], Float], size: Array) -> tuple[Float, Float, Float, int]:
        """Return what follows d (m, S), of S runs at once, d and N at the nodes, and the number of iterations.

        `rates`: of d (m, 3, S) at the nodes; `size` (m,) of each component. Raises `ArithmeticError` if the iteration
        does not converge.
        """
        m, S = d.shape
        free, limit = self.free @ d, SMALL * size
        at = np.repeat(d[:, None], 3, axis=1)
        for k in range(1, ITERATIONS + 1):
            N = rates(at) - (self.J @ at.reshape(m, 3 * S)).reshape(at.shape)
            N = N.reshape(3 * m, S)
            new = (free + self.driven @ N).reshape(at.shape)
            change = np.abs(new - at).reshape(m, 3 * S).max(axis=1)
            at = new
            if (change <= limit + SMALL * np.abs(new).reshape(m, 3 * S).max(axis=1)).all():
                return np.asarray(self.free_end @ d + self.driven_end @ N), at, N.reshape(at.shape), k
            if not np.isfinite(change).all():
                break
        raise FloatingPointError("the iteration does not converge")

    def between(self, d: Float, N: Float, h: float, part: float) -> Float:
        """Return d (m, S) after a part of a step of length h, with N (m, 3, S) at its nodes."""
        free, driven = propagators(self.J, h, self.unit, np.array([part]))
        return np.asarray(free[:, 0] @ d + driven.reshape(len(d), -1) @ N.reshape(-1, d.shape[1]))


class Steps:
    """Steps of several lengths with one J (m, m), zero at first, in units that balance the first other J."""

    def __init__(self, m: int) -> None:
        self.J, self.unit = np.zeros((m, m)), np.ones(m)
        self._made: dict[float, Step] = {}

    def renew(self, J: Float) -> None:
        """Take another J; raises `FloatingPointError` if it is not finite."""
        if not np.isfinite(J).all():
            raise FloatingPointError("the model has no finite value")
        if not self.J.any():
            self.unit = balanced(J)
        self.J, self._made = J, {}

    def of(self, h: float) -> Step:
        """Step of a length, as far as doubles of its ends tell it."""
        length = float(f"{h:.9g}")
        if length not in self._made:
            if len(self._made) >= KEPT:
                self._made.clear()
            self._made[length] = Step.of(self.J, h, self.unit)
        return self._made[length]


def propagators(J: Float, h: float, unit: Float, ends: Float) -> tuple[Float, Float]:
    """Return exp(c h J), (m, ends, m), and h a_j(h J), (m, ends, m, 3), for parts c of a step."""
    from scipy.linalg import expm

    m, ratio = len(J), unit[:, None] / unit
    Z = np.zeros((len(ends), 4 * m, 4 * m))  # exp of [Z 1 0 0; 0 0 1 0; ..] has the phi_k(Z) in its first row
    Z[:, :m, :m] = ends[:, None, None] * h * J / ratio
    for k in range(3):
        Z[:, k * m : (k + 1) * m, (k + 1) * m : (k + 2) * m] = np.eye(m)
    phi = expm(Z)[:, :m].reshape(len(ends), m, 4, m) * ratio[:, None]
    # integral of exp((c - s) Z) s^k ds = k! c^(k+1) phi_(k+1)(c Z)
    powers = np.array([[factorial(k) * c ** (k + 1) for k in range(3)] for c in ends])
    driven = h * np.einsum("jk,ik,iakb->aibj", LAGRANGE, powers, phi[:, :, 1:])
    return phi[:, :, 0].transpose(1, 0, 2), driven
