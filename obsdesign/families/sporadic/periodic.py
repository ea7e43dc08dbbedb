"""What is computed of an observer in doubles where measurements are periodic, over frozen members f = K q of the class.

With measurements T apart and their noise eta, the error just before one is that before the last by

    e+ = E (J e + Jn eta),    E: the first rows of exp(F T),

where the flow is (e, theta)' = [A + Bf K Cq, -L; 0, H] (e, theta) from J = [I; C], Jn = [0; I] on, or with a reset that
of e' = (A + Bf K Cq) e from J = I - K C, Jn = -K on. T is T1 or T2, so that what is said to be the worst is so of
these; other sequences of intervals may be worse, and only what is proved holds of them.
"""

from typing import Any

import numpy as np

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.areas import largest_area
from obsdesign.dissipation.modes import INSIDE, POWERS, powers, widths
from obsdesign.lmi.formula import Array
from obsdesign.records import dataclass

HALVINGS = 4  # of an interval, in which w is followed
FORGOTTEN = 1e-6  # what is left of an error after as many intervals as are followed
MOST = 500  # intervals


@dataclass(frozen=True)
class Periodic(Errors):
    """Error systems between two measurements, in (e, theta) or e, with the intervals T1 and T2 of these."""

    J: Array  # (m, n), of what is left of e at a measurement, or those after T1 and after T2, (2, m, n)
    Jn: Array  # (m, ny), of its noise, or (2, m, ny)
    T1: float  # s; 0: any positive interval
    T2: float  # s

    @property
    def gap(self) -> float:
        """Longest time between measurements, s."""
        return self.T2

    @property
    def sampled(self) -> bool:
        """Whether the noise of y enters at instants: it does, whatever the modes are in between."""
        return True

    @property
    def n(self) -> int:
        """Order of e."""
        return int(self.J.shape[-1])

    @property
    def intervals(self) -> dict[str, float]:
        """T1, where it is not zero, and T2."""
        return {name: T for name, T in (("T1", self.T1), ("T2", self.T2)) if T}

    def figures(self) -> dict[str, Any]:
        """What a result file holds of an observer: per interval its multipliers and contraction, and noise gains."""
        return {
            "multipliers": {name: self.multipliers(T) for name, T in self.intervals.items()},
            "contraction": {name: self.contraction(T) for name, T in self.intervals.items()},
            "noise_gain": self.noise_gain(),
        }

    def step(self, A: Array, T: float) -> tuple[Array, Array]:
        """Matrices of e and of eta for a matrix of the flow."""
        from scipy.linalg import expm

        E, at = expm(A * T)[: self.n], int(self.T1 != T)
        J, Jn = (M if M.ndim == 2 else M[at] for M in (self.J, self.Jn))
        return E @ J, E @ Jn

    def multipliers(self, T: float) -> list[list[float]]:
        """Eigenvalues [re, im] of one step of the linear part, without f, the largest first."""
        values = np.linalg.eigvals(self.step(self.plant.A, T)[0]).tolist()
        return [[z.real, z.imag] for z in sorted(map(complex, values), key=lambda z: (-abs(z), z.imag))]

    def contraction(self, T: float) -> float | None:
        """Largest modulus of an eigenvalue of one step, of the worst member; None where slopes are not bounded."""
        return max(radius(self.step(A, T)[0]) for A, _, _ in self.systems) if self.bounded else None

    @property
    def steps(self) -> list[tuple[Array, Array]]:
        """Matrices of e and of eta of each member and each interval."""
        return [self.step(A, T) for A, _, _ in self.systems for T in self.intervals.values()]

    def noise_gain(self) -> dict[str, float]:
        """Largest gain over frequency from eta to each error, both at the measurements; empty where one is unstable."""
        steps = self.steps
        largest = np.max([POWERS.amplitudes(*step) for step in steps], axis=0).tolist()
        return dict(zip(self.plant.states, largest, strict=False)) if all(stable(Phi) for Phi, _ in steps) else {}

    def noise_norms(self, E: Array, held: float | None = None) -> Array | None:  # noqa: ARG002 - one value each
        """H2 norm of samples from eta to E e at the measurements; None where a step is unstable or no slope bound."""
        steps = self.steps
        if not self.bounded or not all(stable(Phi) for Phi, _ in steps):
            return None
        return np.asarray(np.max([POWERS.norms(*step, E) for step in steps], axis=0))

    def least_peak(self) -> float | None:
        """Largest |z| at a measurement for |w| <= 1 from zero error, of the members that were tried and are stable."""
        tried = [(A, B, T) for A, B, _ in self.systems for T in self.intervals.values()]
        return max((self.peak(*each) for each in tried if stable(self.step(each[0], each[2])[0])), default=None)

    def peak(self, A: Array, B: Array, T: float) -> float:
        """The same of one member: the sum over intervals of the areas of |u' H Phi^k E11(s) B|, over directions u."""
        from scipy.linalg import expm

        n, H, (Phi, _) = self.n, self.H[:, : self.n], self.step(A, T)
        count = int(min(MOST, 1 + np.log(FORGOTTEN) / np.log(max(radius(Phi), FORGOTTEN))))
        within = powers(expm(A * (T / 2**HALVINGS)), 2**HALVINGS + 1)[:, :n, :n] @ B[:n]
        h = np.einsum("kzn,snv->vzks", H @ powers(Phi, count), within)
        t = T * (np.arange(count)[:, None] + np.linspace(0, 1, len(within)))
        return largest_area(h.reshape(B.shape[1], len(H), t.size), widths(t.ravel()))


def radius(Phi: Array) -> float:
    """Largest modulus of an eigenvalue."""
    return float(np.abs(np.linalg.eigvals(Phi)).max(initial=0.0))


def stable(Phi: Array) -> bool:
    """Whether an error contracts."""
    return radius(Phi) <= 1 - INSIDE
