"""One Riccati equation: whether the form has a solution for a mu, and the largest P there is.

With W = -Q_ww > 0 of the eliminated form, and

    A0 = A + B W^-1 Q_wx,    G = B W^-1 B',    Q0 = Q_xx + Q_xw W^-1 Q_wx,

the form has a solution P > 0 if and only if the Hamiltonian matrix H = [A0' Q0; -G -A0] has no eigenvalue on the
imaginary axis and X >= 0, X = Z2 Z1^-1 for the stable subspace [Z1; Z2] of H: it solves A0 X + X A0' + X Q0 X + G = 0,
and P = X^-1 is the largest solution. (Scherer, The Riccati inequality and state-space H-infinity control, 1990.)
"""

import numpy as np
import numpy.typing as npt

from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass
from obsdesign.riccati.form import Eliminated, UnclearError, quadrants, scales

Complex = npt.NDArray[np.complexfloating]
DINKELBACH = 20  # signals of one frequency
RESIDUAL = 1e-8  # of the terms of the equation
LAGRANGIAN = 1e-6  # of Z1' Z2 - Z2' Z1, which is zero unless eigenvalues on the axis were torn apart


class FastError(UnclearError):
    """The form is not negative for the fastest of signals: there is no solution."""


@dataclass(frozen=True)
class Subspace:
    """Stable subspace of H, for states scaled by `s`: H [Z1; Z2] = [Z1; Z2] T with x = s * Z2 .., costate Z1 / s."""

    Z1: Float  # (n, n)
    Z2: Float
    T: Float  # real Schur form, stable
    s: Float  # (n,), powers of two

    @property
    def X(self) -> Float:
        """Solution X = Z2 Z1^-1, in the states of the form; raises `LinAlgError` where it is infinite."""
        X = np.linalg.solve(self.Z1.T, self.Z2.T).T
        return np.asarray(self.s[:, None] * (X + X.T) / 2 * self.s)


@dataclass(frozen=True)
class Equation:
    """The equation of an eliminated form at one mu."""

    A0: Float
    G: Float
    Q0: Float
    back: Float  # (x, w) = back (x, costate): w = W^-1 (B' costate + Q_wx x)

    @classmethod
    def of(cls, form: Eliminated, mu: float) -> "Equation":
        """Eliminate w. Raises `FastError`: W is not positive."""
        n, Q = len(form.A), form.Qc + mu * form.Qm
        W, across = -Q[n:, n:], Q[n:, :n]
        try:
            L = np.linalg.cholesky(W)
        except np.linalg.LinAlgError:
            raise FastError("the supply of the disturbances is not positive") from None
        inner, cross = np.linalg.solve(L, form.B.T), np.linalg.solve(L, across)
        back = np.linalg.solve(L.T, np.hstack([cross, inner]))
        return cls(
            form.A + inner.T @ cross,
            inner.T @ inner,
            Q[:n, :n] + cross.T @ cross,
            np.vstack([np.hstack([np.eye(n), np.zeros((n, n))]), back]),
        )

    def solved_by(self, X: Float) -> bool:
        """Whether X solves it, as far as rounding allows."""
        one, two = self.A0 @ X, X @ self.Q0 @ X
        left = np.abs(one + one.T + two + self.G)
        s = np.sqrt(np.maximum(np.diag(X), 1e-15 * np.diag(X).max(initial=0.0)))
        sizes = np.abs(self.A0) @ np.abs(X)
        sizes = sizes + sizes.T + np.abs(X) @ np.abs(self.Q0) @ np.abs(X) + np.abs(self.G)
        return bool((left <= RESIDUAL * (sizes + np.outer(s, s) * (sizes / np.outer(s, s)).max(initial=0.0))).all())

    def hamiltonian(self) -> tuple[Float, Float]:
        """H of balanced states, and their scales."""
        s = scales(self.A0, self.G, self.Q0)
        A0, G, Q0 = self.A0 * s / s[:, None], self.G / np.outer(s, s), self.Q0 * np.outer(s, s)
        return quadrants(A0.T, Q0, -G, -A0), s

    def subspace(self) -> Subspace | None:
        """Stable subspace; None where H has eigenvalues on the axis, so that there is no solution."""
        from scipy.linalg import schur

        n, (H, s) = len(self.A0), self.hamiltonian()
        try:
            T, Z, stable = schur(H, sort="lhp")
        except np.linalg.LinAlgError:  # eigenvalues so near the axis that they cross it as they are ordered
            return None
        if stable != n:
            return None
        Z1, Z2 = Z[:n, :n], Z[n:, :n]
        skew = Z1.T @ Z2
        if np.abs(skew - skew.T).max(initial=0.0) > LAGRANGIAN:
            return None
        return Subspace(Z1, Z2, T[:n, :n], s)

    def frequencies(self, tolerance: float = 1e-6) -> Float:
        """Where to look for a signal that no P can do with: eigenvalues on the axis, and between them (rad/s)."""
        values = np.linalg.eigvals(self.hamiltonian()[0])
        near = np.abs(values.real) <= tolerance * np.maximum(np.abs(values), np.abs(values).max(initial=0.0) * 1e-3)
        on = np.unique(np.abs(values.imag[near]))
        return np.concatenate([[0.0], on, (on[1:] + on[:-1]) / 2])


@dataclass(frozen=True)
class Signal:
    """A signal that no P can do with: its part in Qc, what it is supplied with for mu = 1, and how much by some inputs.

    Its part in Qc + mu Qm has to be negative for every solution P, which bounds mu from below.
    """

    cost: float
    supplied: float
    apart: float  # share of what it is supplied with by the inputs that were counted apart
    slopes: Float  # (k,), its parts in the Q_j

    @classmethod
    def of(cls, form: Eliminated, V: Float, apart: int) -> "Signal":
        """Signal whose (x, w)(x, w)' integrate to V V*; the last inputs of u are counted apart."""
        supplied = energy(form.Qm, V)
        u = (form.T @ V)[len(form.T) - apart :]
        extra = float(np.sum(np.abs(u) ** 2)) * form.supply
        slopes = np.array([energy(Q, V) for Q in form.Qs])
        return cls(energy(form.Qc, V), -supplied, extra / supplied if supplied < 0 else 1.0, slopes)

    @property
    def bound(self) -> float:
        """Least mu of any solution; minus infinity if it says nothing."""
        return self.cost / self.supplied if self.supplied > 0 else -np.inf


SILENT = Signal(0.0, 0.0, 1.0, np.zeros(0))


def energy(Q: Float, V: Float) -> float:
    """Trace of V* Q V."""
    return float(np.sum(V.conj() * (Q @ V)).real)


def dying(form: Eliminated, point: Equation, space: Subspace, c: Float, apart: int) -> Signal:
    """Signal that dies out backwards in time.

    Along x = Z2 xi, xi' = -T xi with xi(0) = c the integral of (x, w)' Q (x, w) is at most -x(0)' P x(0) < 0 for every
    P. That of (x, w)(x, w)' is M L M' with T L + L T' = -c c'.
    """
    from scipy.linalg import solve_continuous_lyapunov

    values, vectors = np.linalg.eigh(solve_continuous_lyapunov(space.T, -np.outer(c, c)))
    s = space.s[:, None]
    M = point.back @ np.vstack([s * space.Z2, space.Z1 / s])
    return Signal.of(form, M @ (vectors * np.sqrt(np.maximum(values, 0.0))), apart)


def fast(form: Eliminated, mu: float, apart: int) -> Signal:
    """Signal without a state, the one of the largest bound."""
    return worst(form, np.zeros(form.B.shape, dtype=complex), mu, apart)


def periodic(form: Eliminated, omega: float, mu: float, apart: int) -> Signal:
    """Signal of a frequency (rad/s), the one of the largest bound above mu; a silent one where none has any."""
    try:
        x: Complex = np.linalg.solve(1j * omega * np.eye(len(form.A)) - form.A, form.B.astype(complex))
    except np.linalg.LinAlgError:
        return SILENT
    return worst(form, x, mu, apart)


def worst(form: Eliminated, x: Complex, mu: float, apart: int) -> Signal:
    """Signal of the largest bound above mu among those of w and x times w, z = [x; 1] and z* (Qc + mu Qm) z <= 0.

    The largest eigenvalue of that at a mu gives a signal, whose bound is the next mu, until it is that of mu itself.
    """
    from scipy.linalg import eigh

    found, last = SILENT, x.shape[1] - 1
    if negative(along(form.Qc + mu * form.Qm, x)):
        return found
    z = np.vstack([x, np.eye(x.shape[1])])
    Qc, Qm = (along(Q, x) for Q in (form.Qc, form.Qm))
    for _ in range(DINKELBACH):
        values, vectors = eigh(Qc + mu * Qm, subset_by_index=[last, last])
        if not len(values):  # they did not converge
            break
        signal = Signal.of(form, z @ vectors, apart)
        if not values[0] > 0 or not signal.bound > found.bound:
            break
        found, mu = signal, signal.bound
    return found


def along(Q: Float, x: Complex) -> Complex:
    """z* Q z for z = [x; 1], Q real and symmetric."""
    n = len(x)
    across = Q[:, :n] @ x.real + 1j * (Q[:, :n] @ x.imag)
    return np.asarray(x.conj().T @ (across[:n] + Q[:n, n:]) + across[n:] + Q[n:, n:])


def negative(M: Complex) -> bool:
    """Whether a Hermitian matrix is negative definite."""
    try:
        np.linalg.cholesky(-M)
    except np.linalg.LinAlgError:
        return False
    return True
