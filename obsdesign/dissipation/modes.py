"""What the modes of an error are: exponentials exp(s t) in continuous time, powers z^k of samples.

They decay where s is left of the imaginary axis, or z within the unit circle; a response over frequency is that at
s = i omega, omega in rad/s, or at z = exp(i theta), theta in rad a sample, from 0 to pi.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from math import ceil
from typing import ClassVar

import numpy as np
from flint import fmpq

from obsdesign.dissipation.frequencies import angles, around, distinct, largest, largest_apart
from obsdesign.dissipation.residues import Residues, Spectrum
from obsdesign.lmi.formula import Array, identity

INSIDE = 1e-9  # a pole is stable if it decays at a faster rate, relative to the largest pole; of samples absolute
ROUNDING = 1e-14  # of a pole, relative to the largest
ILL = 1e-12  # inverse of the condition of the modes, below which a response is not believed
LARGE = 24  # order from which what is computed of many frequencies, or instants, is computed in another way
MOST_INSTANTS = 30_000  # of all modes of a system together
AT_ONCE = 2048  # of the instants, so that what is computed of them stays near the processor
SAMPLES = 500  # of an impulse response, for each pole, and more where it oscillates
FORGOTTEN = 20  # time constants after which what is left of a response in samples is told by its sum
LARGEST = 2**22  # numbers of it that are told one by one


class Modes(ABC):
    """One of the two, for matrices A of e' = A e + B v, or of e+ = A e + B v."""

    sampled: ClassVar[bool]

    @abstractmethod
    def rates(self, poles: Array) -> Array:
        """Rates at which modes decay: -Re s in 1/s, or 1 - |z| a sample."""

    @abstractmethod
    def decay(self, poles: Array, slack: float = INSIDE) -> Array:
        """Which modes decay, beyond what is rounded."""

    @abstractmethod
    def near(self, poles: Array) -> Array:
        """Frequencies at which a response can be large: about poles, and zero."""

    def frequencies(self, A: Array) -> Array:
        """The same about the poles of a matrix."""
        return self.near(np.linalg.eigvals(A))

    @abstractmethod
    def place(self, omega: Array) -> Array:
        """The number s or z of a frequency."""

    @abstractmethod
    def impulse(self, A: Array, B: Array, H: Array) -> tuple[Array, Array]:
        """Response of z = H e to an impulse of each v, (nv, nz, nt), and how much of time each instant stands for.

        Not a number where it cannot be told.
        """

    @abstractmethod
    def covariance(self, A: Array, W: Array) -> Array:
        """Covariance of e at rest, driven by white noise of the intensity W, (n, n), or in samples the covariance W."""

    @abstractmethod
    def overlap(self, poles: Array) -> Array:
        """Integral over time, or the sum, of each mode times the conjugate of each, (n, n)."""

    def norms(self, A: Array, N: Array, E: Array, known: Spectrum | None = None, held: float | None = None) -> Array:
        """H2 norm from each n to each row of E e: rms for white noise of density 1, or in samples of rms 1.

        A (n, n) is stable; N (n, m), E (k, n); returns (k, m). In balanced coordinates, where a Lyapunov equation keeps
        its digits although the units of the states differ by orders. `known`: the modes of A, of which it is a sum;
        `held`: time (s) for which noise of rms 1 keeps each value, in place of white noise: the rms over time.
        """
        if known:
            overlap = self.overlap(known.poles)
            if held is not None:
                overlap = overlap * correlated(known.poles[:, None, None], held)[..., 0]
            return known.residues(N, E).norms(overlap)
        from scipy.linalg import matrix_balance

        balanced, (units, _) = matrix_balance(A, permute=False, separate=True)
        E, N = E * units, N / units[:, None]
        left = E if held is None else E @ correlated(balanced, held)
        found = [np.sum((left @ self.covariance(balanced, np.outer(n, n))) * E, axis=1) for n in N.T]
        return np.asarray(np.sqrt(np.maximum(found, 0)).T)

    def stable(self, poles: Array) -> bool:
        """Whether all of some modes decay."""
        return bool(self.decay(poles).all())

    def slowest(self, poles: Array) -> list[float]:
        """The slowest mode, as [real, |imaginary|]."""
        order = np.lexsort((-np.abs(poles.imag), self.rates(poles)))
        worst = complex(poles[order[0]])
        return [worst.real, abs(worst.imag)]

    def response(self, A: Array, B: Array, omega: Array) -> Array:
        """Responses (s I - A)^-1 B, or (z I - A)^-1 B, at some frequencies, (m, n, nu)."""
        s = self.place(omega)[:, None, None]
        return np.asarray(np.linalg.solve(s * identity(len(A), A) - A, np.broadcast_to(B, (len(omega), *B.shape))))

    def responses(self, A: Array, B: Array) -> Callable[[Array], Array]:
        """The same as a function of omega; of a large A by its Schur form, which is found once."""
        if len(A) < LARGE:
            return lambda omega: self.response(A, B, omega)
        from scipy.linalg import schur

        T, U = schur(A, output="complex")
        right = U.conj().T @ B

        def response(omega: Array) -> Array:
            s = self.place(omega)[:, None]
            x = np.empty((len(A), len(omega), B.shape[1]), dtype=complex)
            for i in range(len(A))[::-1]:
                later = np.tensordot(T[i, i + 1 :], x[i + 1 :], 1)
                x[i] = (right[i] + later) / (s - T[i, i])
            return np.asarray(np.tensordot(U, x, 1).transpose(1, 0, 2))

        return response

    def residues(self, A: Array, B: Array, H: Array | None, known: Spectrum | None) -> Residues | None:
        """Response of z = H e, or of e, of a large A as a sum over its modes; None where there is no such."""
        known = known or (Spectrum.of(A) if len(A) >= LARGE else None)
        return known.residues(B, H) if known else None

    def amplitudes(self, A: Array, B: Array, known: Spectrum | None = None) -> Array:
        """Largest amplitude of each entry of e over frequency, for an input that is a sinusoid with |v| = 1."""
        if found := self.residues(A, B, None, known):
            return largest_apart(
                lambda omega: found.amplitudes(self.place(omega)),
                lambda omega: found.own(self.place(omega)),
                self.near(found.poles),
            )
        response = self.responses(A, B)
        return largest(lambda omega: np.linalg.norm(response(omega), axis=2), self.frequencies(A))

    def gain(self, A: Array, B: Array, H: Array, known: Spectrum | None = None) -> float:
        """Largest singular value of the response of z = H e over frequency."""
        if found := self.residues(A, B, H, known):
            return float(largest(lambda omega: found.gains(self.place(omega)), self.near(found.poles)).item())
        response = self.responses(A, B)

        def sizes(omega: Array) -> Array:
            z = H @ response(omega)
            if len(A) < LARGE:
                return np.asarray(np.linalg.norm(z, 2, axis=(1, 2)))[:, None]
            return np.sqrt(np.linalg.eigvalsh(z.conj().transpose(0, 2, 1) @ z)[:, -1:])

        return float(largest(sizes, self.frequencies(A)).item())


class Exponentials(Modes):
    """Exp(s t), of e' = A e."""

    sampled = False

    def rates(self, poles: Array) -> Array:
        """-Re s."""
        return -poles.real

    def decay(self, poles: Array, slack: float = INSIDE) -> Array:
        """Left of the imaginary axis, relative to the largest pole."""
        return np.asarray(poles.real < -slack * np.abs(poles).max(initial=0.0))

    def near(self, poles: Array) -> Array:
        """In rad/s."""
        return around(poles)

    def place(self, omega: Array) -> Array:
        """On the imaginary axis."""
        return np.asarray(1j * omega)

    def overlap(self, poles: Array) -> Array:
        """Of exp(s t)."""
        return np.asarray(-1 / (poles[:, None] + poles.conj()))

    def covariance(self, A: Array, W: Array) -> Array:
        """X of A X + X A' + W = 0."""
        from scipy.linalg import solve_continuous_lyapunov

        return np.asarray(solve_continuous_lyapunov(A, -W))

    def impulse(
        self, A: Array, B: Array, H: Array, every: int = 1, known: Spectrum | None = None
    ) -> tuple[Array, Array]:
        """H exp(A t) B, from its modes, with the widths of the trapezoidal rule; `every`: of how many instants one is.

        Not a number where the modes are too close to each other to be told apart.
        """
        values, V = (known.poles, known.V) if known else np.linalg.eig(A)
        if not known and np.linalg.cond(V) > 1 / ILL:
            return np.full((B.shape[1], len(H), 1), np.nan), np.ones(1)
        ends = 25 / np.abs(values.real)
        counts = np.minimum(SAMPLES * (1 + np.abs(values.imag / values.real)), 40 * SAMPLES).astype(int)
        dense = courses(set(zip(ends.tolist(), counts.tolist(), strict=True)))
        t = distinct(np.concatenate([*dense, ends.max(initial=0.0) * np.geomspace(1e-9, 1, SAMPLES)]))
        t = t[np.append(np.arange(0, len(t) - 1, every), len(t) - 1)]
        residues = (H @ V) * np.linalg.solve(V, B).T[:, None]  # (nv, nz, n)
        residues, values = residues[..., values.imag >= 0], values[values.imag >= 0]  # of a pair, twice the real part
        residues = residues * np.where(values.imag > 0, 2, 1)
        shares = np.concatenate([residues.real, -residues.imag], axis=-1)
        h = np.empty((*shares.shape[:2], len(t)))
        for part in (slice(first, first + AT_ONCE) for first in range(0, len(t), AT_ONCE)):
            decaying, angle = np.exp(values.real[:, None] * t[part]), values.imag[:, None] * t[part]
            h[..., part] = shares @ np.concatenate([decaying * np.cos(angle), decaying * np.sin(angle)])
        return h, widths(t)


def courses(modes: set[tuple[float, int]]) -> list[Array]:
    """Instants at which modes are looked at, each until its end in so many; a small system at those of all its modes.

    In a large one, of which that would take gigabytes, at those of the quickest among the modes that are not yet over.
    """
    if sum(count for _, count in modes) <= MOST_INSTANTS:
        return [np.linspace(0, end, count) for end, count in modes]
    pieces, start, left = [], 0.0, sorted(modes)
    steps = np.array([last / (count - 1) for last, count in left])
    for (end, _), step in zip(left, np.minimum.accumulate(steps[::-1])[::-1].tolist(), strict=True):
        pieces.append(np.linspace(start, end, 1 + ceil((end - start) / step)))
        start = end
    return pieces


class Powers(Modes):
    """Powers z^k, of e+ = A e."""

    sampled = True

    def rates(self, poles: Array) -> Array:
        """1 - |z|."""
        return 1 - np.abs(poles)

    def decay(self, poles: Array, slack: float = INSIDE) -> Array:
        """Within the unit circle."""
        return np.asarray(np.abs(poles) < 1 - slack)

    def near(self, poles: Array) -> Array:
        """In rad a sample."""
        return angles(poles)

    def place(self, omega: Array) -> Array:
        """On the unit circle."""
        return np.asarray(np.exp(1j * omega))

    def overlap(self, poles: Array) -> Array:
        """Of z^k."""
        return np.asarray(1 / (1 - poles[:, None] * poles.conj()))

    def covariance(self, A: Array, W: Array) -> Array:
        """X of A X A' - X + W = 0."""
        from scipy.linalg import solve_discrete_lyapunov

        return np.asarray(solve_discrete_lyapunov(A, W))

    def impulse(self, A: Array, B: Array, H: Array) -> tuple[Array, Array]:
        """H A^k B, k = 0, 1, .., and last the sum of those that are not told one by one.

        Of the latter the sum of the norms is at least the norm of the sum, and equal to it where only a real mode that
        does not change its sign is left: what is made of it is never too much.
        """
        slow = float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
        lasting = FORGOTTEN / -np.log(slow) if 0 < slow < 1 else 0.0
        count = 1 + int(min(len(A) + lasting, LARGEST / max(B.size, 1)))
        e = powers(A, count, B)
        rest = np.linalg.solve(identity(len(A), A) - A, A @ e[-1])
        return (H @ np.concatenate([e, rest[None]])).transpose(2, 1, 0), np.ones(count + 1)


EXPONENTIALS, POWERS = Exponentials(), Powers()


def modes(period: fmpq | None) -> Modes:
    """Modes of an error in samples a period apart; None: in continuous time."""
    return EXPONENTIALS if period is None else POWERS


def correlated(A: Array, held: float) -> Array:
    """M = 2 h phi(A h), (.., n, n), with phi(X) the integral of (1 - s) exp(X s) over s from 0 to 1.

    Values that are held for h are correlated by 1 - |tau| / h over a time tau, so that the mean square of H e over time
    is H M P H' for a rms of 1 where it is H P H' for white noise of density 1: h times that where e is slow against h.
    """
    from scipy.linalg import expm

    n = A.shape[-1]
    integrals = np.zeros((*A.shape[:-2], 3 * n, 3 * n), A.dtype)
    integrals[..., :n, :n] = A * held
    integrals[..., : 2 * n, n:] += np.eye(2 * n)
    return np.asarray(2 * held * expm(integrals)[..., :n, 2 * n :])


def widths(t: Array) -> Array:
    """How much of time each instant stands for, by the trapezoidal rule."""
    return np.asarray(np.diff(t, prepend=t[0]) / 2 + np.diff(t, append=t[-1]) / 2)


def powers(M: Array, count: int, right: Array | None = None) -> Array:
    """I, M, M^2, .., so many, or the same times a matrix on their right, by doubling."""
    found = (np.eye(len(M)) if right is None else right)[None]
    while len(found) < count:
        found, M = np.concatenate([found, M @ found]), M @ M
    return found[:count]
