"""What the structure of a problem decides before any matrix inequality: detectability and Condition 1.

Corless and Chakrabarty (2019), section 4. All functions read plants in doubles, `in_floats(plant)`.
"""

from dataclasses import dataclass
from math import inf

import numpy as np

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import Array
from obsdesign.model.pencil import TOLERANCE, System, output_nulling, scaled, spectrum, split, text
from obsdesign.model.plant import Plant


@dataclass(frozen=True)
class Mode:
    """A mode that no output sees: A v = lambda v and C v = 0. A complex one stands for its conjugate too."""

    eigenvalue: complex
    along: tuple[tuple[str, complex], ...]  # states and entries of v, norm(v) = 1, the largest first and positive

    @property
    def sentence(self) -> str:
        """Mode in words, without the entries below 1 %."""
        value = self.eigenvalue
        entries = [(name, abs(entry) if value.imag else entry.real) for name, entry in self.along]
        direction = ", ".join(f"{name} ({size:.2f})" for name, size in entries if abs(size) >= 0.01)
        number = f"{value.real:.6g} +- {value.imag:.6g}j" if value.imag else text(value)
        return f"the mode lambda = {number} along {direction} is not seen by any output"


def modes(A: Array, C: Array, states: tuple[str, ...], decay: float = inf) -> tuple[Mode, ...]:
    """Unobservable modes of (A, C) with real part >= -decay, the least stable first.

    These are the eigenvalues at which [A - lambda I; C] has a rank below n (the test of Popov, Belevitch and
    Hautus). The unobservable subspace comes first, from a staircase of singular value decompositions, and
    then the eigenvalues of A on it: so a chain of integrators, whose eigenvalues a rounding error scatters,
    is judged by ranks.

    Parameters
    ----------
    A, C, states
        (n, n) and (ny, n) matrices, and the names of the n states.
    decay
        Modes that decay faster are left out.
    """
    scaling = scaled(System(A, np.zeros((len(A), 0)), C, np.zeros((len(C), 0))))
    V, hidden = output_nulling(scaling.system)
    found = [
        mode(scaling.rate * value, scaling.states * vector, states)
        for value, _ in spectrum(hidden.A, 1.0)
        if value.imag >= 0 and scaling.rate * (value.real + TOLERANCE) >= -decay
        for vector in eigenvectors(V, hidden.A, value)
    ]
    return tuple(sorted(found, key=lambda m: -m.eigenvalue.real))


def eigenvectors(V: Array, S: Array, value: complex) -> Array:
    """Eigenvectors V x, S x = value x, as rows; each has an entry that is zero in all the others."""
    from scipy.linalg import qr

    decomposition = np.linalg.svd(S - value * np.eye(len(S)))
    count = max(1, int((decomposition.S <= TOLERANCE).sum()))
    X = V @ decomposition.Vh[-count:].conj().T
    pivots = qr(X.T, mode="r", pivoting=True)[1][:count]
    return np.asarray(np.linalg.solve(X[pivots].T, X.T))


def mode(eigenvalue: complex, vector: Array, states: tuple[str, ...]) -> Mode:
    """Mode of an eigenvector of any length and phase."""
    v = vector / np.linalg.norm(vector)
    order = np.argsort(-np.abs(v).round(9), kind="stable")  # equal entries in the order of the states
    v = v * np.abs(v[order[0]]) / v[order[0]]
    return Mode(eigenvalue, tuple((states[i], complex(v[i])) for i in order if abs(v[i]) > TOLERANCE))


def linear(plant: Plant, K: Array) -> System:
    """Linear plant, from w (or v) to y, that f = K q makes of a plant.

    q = Cq x + Dqf f + Dq w gives f = (I - K Dqf)^-1 K (Cq x + Dq w).

    Parameters
    ----------
    plant, K
        The plant, and the (nf, nq) matrix of a linear map.

    Raises
    ------
    UsageError
        I - K Dqf is singular.
    """
    loop = np.eye(len(K)) - K @ plant.Dqf
    if np.linalg.matrix_rank(loop) < len(loop):
        raise UsageError("Dqf: q = Cq x + Dqf f has no unique solution for the linear f = K q that the types allow")
    F = np.linalg.solve(loop, K)
    return System(
        plant.A + plant.Bf @ F @ plant.Cq,
        plant.B + plant.Bf @ F @ plant.Dq,
        plant.C + plant.Df @ F @ plant.Cq,
        plant.D + plant.Df @ F @ plant.Dq,
    )


def undetectable(plant: Plant, K: Array, decay: float = 0.0) -> tuple[Mode, ...]:
    """Modes that no observer makes decay faster than exp(-decay t), whatever its gains.

    The plant with f = K q is one of those that the observer must serve. If v is an unobservable eigenvector
    of it, then e = v exp(lambda t), df = K dq and dy = 0 satisfy the error equations: no gain acts on this
    error.

    Parameters
    ----------
    plant, K
        The plant, as a rule augmented, and the (nf, nq) matrix of a linear map in the class of f.
    decay
        Rate of decay to be reached.
    """
    system = linear(plant, K)
    return modes(system.A, system.C, plant.states, decay)


def decay_limit(plant: Plant, K: Array) -> float:
    """Supremum of the rates of decay that detectability allows: infinite if no mode is hidden."""
    return min((-m.eigenvalue.real for m in undetectable(plant, K, inf)), default=inf)


@dataclass(frozen=True)
class RankTest:
    """Rank of [A - lambda I, B; C, D] at one eigenvalue of Am."""

    eigenvalue: complex
    rank: int
    columns: int

    @property
    def holds(self) -> bool:
        """Whether the matrix has full column rank."""
        return self.rank == self.columns

    @property
    def sentence(self) -> str:
        """Test in words."""
        verdict = "holds" if self.holds else "fails"
        rank = f"[A - lambda I, B; C, D] has rank {self.rank} of {self.columns}"
        return f"Condition 1 {verdict} at lambda = {text(self.eigenvalue)}: {rank}"


def condition1(plant: Plant, Am: Array) -> tuple[RankTest, ...]:
    """Condition 1 at each eigenvalue of Am with Re lambda >= 0; a complex one stands for its conjugate.

    With (A, C) and (Am, Cm) detectable it is sufficient for the augmented plant to be detectable (Lemma 3),
    but not necessary: it fails wherever w has more channels than y. So it explains, and `undetectable`
    decides.

    Parameters
    ----------
    plant, Am
        The plant before augmentation, and the (nm, nm) matrix of its disturbance model.
    """
    scaling = scaled(System(plant.A, plant.B, plant.C, plant.D))
    columns = plant.n + plant.B.shape[1]
    return tuple(
        RankTest(value, split(scaling.system.pencil(value / scaling.rate))[1].shape[1], columns)
        for value, _ in spectrum(Am, float(np.linalg.norm(Am)))
        if value.real >= 0 and value.imag >= 0
    )
