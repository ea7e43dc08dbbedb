"""The pencil [A - lambda I, B; C, D] in doubles: ranks, multiple eigenvalues, output nulling, zeros.

Every rank decision is taken on a scaled system, where it is relative to 1, against `TOLERANCE`. A system that
lies this close to one of lower rank cannot be told from it by anything that computes in doubles.
"""

import numpy as np

from obsdesign.lmi.equilibrate import factors
from obsdesign.lmi.formula import Array
from obsdesign.records import dataclass

TOLERANCE = 1e-12
MULTIPLE = 4  # multiplicity from which a small change of the data moves a zero far


@dataclass(frozen=True)
class System:
    """x' = A x + B u, y = C x + D u, in doubles."""

    A: Array  # (n, n)
    B: Array  # (n, m)
    C: Array  # (p, n)
    D: Array  # (p, m)

    def dual(self) -> "System":
        """System of the transposed pencil."""
        return System(self.A.T, self.C.T, self.B.T, self.D.T)

    def pencil(self, value: complex) -> Array:
        """Matrix [A - value I, B; C, D]."""
        return np.block([[self.A - value * np.eye(len(self.A)), self.B], [self.C, self.D]])


@dataclass(frozen=True)
class Scaling:
    """A system in units in which its blocks have norms near 1, and the way back."""

    system: System
    states: Array  # (n,), powers of two: x = states * x_scaled
    rate: float  # an eigenvalue is `rate` times one of the scaled system


def scaled(system: System) -> Scaling:
    """Balance the states and normalise time, outputs and inputs; ranks and zeros are invariant to that."""
    states = units(system)
    balanced = system.A * (states / states[:, None])
    largest = float(np.abs(balanced).max(initial=0.0)) or 1.0  # whose square may be beyond doubles
    rate = largest * float(np.linalg.norm(balanced / largest)) or 1.0
    B, C = system.B / states[:, None] / rate, system.C * states
    outputs = nonzero(np.linalg.norm(np.hstack([C, system.D]), axis=1))[:, None]
    C, D = C / outputs, system.D / outputs
    inputs = nonzero(np.linalg.norm(np.vstack([B, D]), axis=0))
    return Scaling(System(balanced / rate, B / inputs, C, D / inputs), states, rate)


def units(system: System) -> Array:
    """Sizes (n,) of the states by the data, with those of inputs, outputs and time: A_ij x_j / x_i near the rate, .."""
    n, m, p = len(system.A), system.B.shape[1], len(system.C)
    rows, columns = np.nonzero(matrix := np.block([[system.A, system.B], [system.C, system.D]]))
    below, across = np.where(rows < n, rows, rows + m), columns  # x, u, y, rate
    sizes = np.abs(matrix[rows, columns])
    return factors(
        sizes, [(across, 1.0), (below, -1.0), (np.full(len(rows), n + m + p), -1.0 * (rows < n))], n + m + p + 1
    )[:n]


def nonzero(norms: Array) -> Array:
    """Norms to divide by: 1 for a vector that is zero."""
    return np.where(norms > 0, norms, 1.0)


def split(matrix: Array) -> tuple[Array, Array]:
    """Orthonormal bases, as columns, of the null space of a scaled matrix and of its complement."""
    _, values, rows = np.linalg.svd(matrix)
    rank = int((values > TOLERANCE).sum())
    return rows[rank:].conj().T, rows[:rank].conj().T


def output_nulling(system: System) -> tuple[Array, System]:
    """Restrict a scaled system to the largest subspace on which some input keeps the output at zero.

    The outputs without a direct input, C2 x = 0, confine x to the null space K of C2. That x stays there is a
    new output, R'(A x + B u) = 0 with R the complement of K; and so on. Without inputs what is left is the
    unobservable subspace. Source: Emami-Naeini and Van Dooren, Automatica 18(4), 1982.

    Returns an orthonormal basis V of the subspace, and the system in these coordinates, whose D has full row rank.
    """
    V = np.eye(len(system.A))
    while True:
        indirect, direct = split(system.D.T)
        A, B, C, D = system.A, system.B, direct.T @ system.C, direct.T @ system.D
        K, R = split(indirect.T @ system.C)
        if not R.shape[1]:
            return V, System(A, B, C, D)
        system = System(K.T @ A @ K, K.T @ B, np.vstack([C @ K, R.T @ A @ K]), np.vstack([D, R.T @ B]))
        V = V @ K


def spectrum(S: Array, size: float) -> list[tuple[complex, int]]:
    """Distinct eigenvalues of S with their multiplicities.

    A defective eigenvalue of multiplicity k is computed as k values at distances eps^(1/k), whose mean is
    exact to eps. Two computed values are taken for one if they differ by less than the uncertainty of both,
    TOLERANCE size / |left' right| for unit eigenvectors, so that well-conditioned neighbors stay apart; and
    k values that close are not more than TOLERANCE^(1/k) size apart.

    `S`, `size`: square matrix, and the norm of the matrices that it was computed from.
    """
    if not len(S):
        return []
    from scipy.linalg import eig
    from scipy.sparse.csgraph import connected_components

    values, left, right = eig(S, left=True, right=True)  # type: ignore[misc]
    distance = np.abs(values[:, None] - values)
    cosine = np.maximum(np.abs((left.conj() * right).sum(axis=0)), np.finfo(float).eps)
    neighbors = np.full(len(S), len(S))
    for _ in values:
        uncertainty = size * np.minimum(TOLERANCE / cosine, TOLERANCE ** (1 / neighbors))
        neighbors = (distance <= 2 * uncertainty[:, None]).sum(axis=1)
    count, label = connected_components(distance <= np.minimum(uncertainty[:, None], uncertainty), directed=False)
    clusters = [values[label == i] for i in range(count)]
    return [(without_noise(complex(c.mean()), TOLERANCE * size), len(c)) for c in clusters]


def without_noise(value: complex, noise: float) -> complex:
    """Set a real or imaginary part that is within the noise to zero."""
    return complex(*(part if abs(part) > noise else 0.0 for part in (value.real, value.imag)))


@dataclass(frozen=True)
class Zeros:
    """Invariant zeros and normal rank of a system.

    Left invertible means that y and the initial state determine the input. A zero with non-negative real part
    is an input that does not decay and that y need not show.
    """

    values: tuple[complex, ...]  # each as often as its multiplicity, the real parts in decreasing order
    normal_rank: int  # of C (s I - A)^-1 B + D
    inputs: int

    @property
    def left_invertible(self) -> bool:
        """Whether the transfer matrix has full column rank."""
        return self.normal_rank == self.inputs

    @property
    def sentence(self) -> str:
        """Zeros in words."""
        found = f"invariant zeros {', '.join(map(text, self.values))}" if self.values else "no invariant zeros"
        if any(self.values.count(value) >= MULTIPLE for value in self.values):
            found += f", of which those that occur {MULTIPLE} times and more are uncertain: doubles hardly tell them"
        if self.left_invertible:
            return found
        return f"{found}; not left invertible: normal rank {self.normal_rank} with {self.inputs} inputs"


def invariant_zeros(system: System) -> Zeros:
    """Values lambda at which [A - lambda I, B; C, D] has less than its normal rank.

    Output nulling of the system and then of its dual leave a square D of full rank, with any numbers of
    inputs and outputs, and the zeros are the eigenvalues of A - B D^-1 C.
    """
    scaling = scaled(system)
    _, wide = output_nulling(scaling.system)
    _, core = output_nulling(wide.dual())
    dynamics = core.A - core.B @ np.linalg.solve(core.D, core.C)
    distinct = spectrum(dynamics, max(1.0, float(np.linalg.norm(dynamics))))
    zeros = [scaling.rate * value for value, count in distinct for _ in range(count)]
    ordered = sorted(zeros, key=lambda s: (-s.real, abs(s.imag), -s.imag))
    return Zeros(tuple(ordered), len(core.D), system.B.shape[1])


def text(value: complex) -> str:
    """Write an eigenvalue."""
    if not value.imag:
        return f"{value.real:.6g}"
    return f"{value.real:.6g} {'+' if value.imag > 0 else '-'} {abs(value.imag):.6g}j"
