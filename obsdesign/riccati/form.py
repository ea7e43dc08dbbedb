"""A dissipation inequality whose gain is to be found, and what is left of it once the gain is eliminated.

In (e, u), u all that acts on the error, and with P > 0 and Y to be found,

    he([P; 0] [A B] + [Y; 0] [C D]) + Qc + sum lambda_j Q_j + mu Qm <= 0, lambda_j > 0 scales of multipliers.

Y exists if and only if the (u, u) block of Q is negative and the form is negative on the kernel of [C D] (projection
lemma). Where D has full row rank that kernel is u = -D^+ C e + Z w, Z = null(D).
"""

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass, replace

CERTAIN = 1e-7  # of singular values of normalised rows: above it they count
ZERO = 1e-13  # .. and below it they do not; between the two nothing is said of the rank


class UnclearError(Exception):
    """Doubles do not tell: a rank between `ZERO` and `CERTAIN`, or numbers that break down; the text says which."""


class ZeroError(UnclearError):
    """The least mu is zero, or too small to be told from it."""


@dataclass(frozen=True)
class Form:
    """The coefficients of P and Y, and Q in (e, u); where scales are given, their part is in Qc."""

    A: Float  # (n, n), the shift by the decay rate included
    B: Float  # (n, m)
    C: Float  # (p, n)
    D: Float  # (p, m)
    Qc: Float  # (n + m, n + m)
    Qm: Float  # (n + m, n + m)
    Qs: Float  # (k, n + m, n + m), those of the scales

    def scaled(self, scales: Float) -> "Form":
        """Same for given scales (k,)."""
        return replace(self, Qc=self.Qc + np.tensordot(scales, self.Qs, 1))

    @property
    def n(self) -> int:
        """Order of P."""
        return len(self.A)

    def at(self, mu: float) -> Float:
        """Q for a mu."""
        return self.Qc + mu * self.Qm

    def noisy(self, states: Float, outputs: Float) -> "Form":
        """Same with further inputs on each state and on each output, of the given sizes (n,) and (p,), none for 0.

        They are supplied with mu as v is. What solves this solves the form itself, with room in every direction.
        """
        n, p, m = self.n, len(self.C), len(self.Qc)
        on_states, on_outputs = np.diag(states)[:, states > 0], np.diag(outputs)[:, outputs > 0]
        more = on_states.shape[1] + on_outputs.shape[1]
        Qc, Qm, Qs = (np.zeros((*Q.shape[:-2], m + more, m + more)) for Q in (self.Qc, self.Qm, self.Qs))
        Qc[:m, :m], Qm[:m, :m], Qs[:, :m, :m] = self.Qc, self.Qm, self.Qs
        Qm[m:, m:] = self.supply * np.eye(more)
        B = np.hstack([self.B, on_states, np.zeros((n, on_outputs.shape[1]))])
        D = np.hstack([self.D, np.zeros((p, on_states.shape[1])), on_outputs])
        return Form(self.A, B, self.C, D, Qc, Qm, Qs)

    def balanced(self) -> tuple["Form", Float]:
        """Same in the states e / s, s powers of two (n,) that bring the entries near each other, and s.

        What f is measured in does not matter either.
        """
        n, units = self.n, self.units()
        B = self.B * units
        s = scales(self.A, B @ B.T, self.Qc[:n, :n] + self.C.T @ self.C)
        rows = np.concatenate([s, units])
        Qc, Qm, Qs = (Q * np.outer(rows, rows) for Q in (self.Qc, self.Qm, self.Qs))
        return Form(self.A * s / s[:, None], B / s[:, None], self.C * s, self.D * units, Qc, Qm, Qs), s

    def units(self) -> Float:
        """Powers of two (m,) in which to measure u: 1 of v; f has the size of what bounds it.

        One that nothing bounds moves e by about 1, in states in which the other entries are near each other.
        """
        n = self.n
        sizes, free = np.ones(self.B.shape[1]), np.diag(self.Qm)[self.n :] == 0
        for Q in self.Qs:
            own = -np.diag(Q)[n:]
            bounded = own > 0
            size = size_of(Q[:n, :n], Q[:n, n:][:, bounded], Q[n:, n:][np.ix_(bounded, bounded)])
            sizes[bounded], free = np.sqrt(size / own[bounded]), free & ~bounded
        if free.any():
            B = self.B[:, ~free] * sizes[~free]
            s = scales(self.A, B @ B.T, self.Qc[:n, :n] + self.C.T @ self.C)
            moves = np.linalg.norm(self.B[:, free] / s[:, None], axis=0)
            sizes[free] = 1 / np.where(moves > 0, moves, 1.0)
        return np.asarray(np.exp2(np.rint(np.log2(sizes))))

    def injected(self, L: Float) -> "Form":
        """Same with the gain L given: without outputs."""
        none = slice(0)
        return replace(self, A=self.A + L @ self.C, B=self.B + L @ self.D, C=self.C[none], D=self.D[none])

    def turned(self, R: Float) -> "Form":
        """Same in the states R e, R orthogonal."""
        n, rows = self.n, np.eye(len(self.Qc))
        rows[:n, :n] = R
        Qc, Qm, Qs = (rows @ Q @ rows.T for Q in (self.Qc, self.Qm, self.Qs))
        return Form(R @ self.A @ R.T, R @ self.B, self.C @ R.T, self.D, Qc, Qm, Qs)

    def moved(self, R: Float) -> "Form":
        """Same in the states R^-1 e, R nonsingular (n, n)."""
        rows = np.eye(len(self.Qc))
        rows[: self.n, : self.n] = R
        Qc, Qm, Qs = (rows.T @ Q @ rows for Q in (self.Qc, self.Qm, self.Qs))
        A, B = (np.asarray(np.linalg.solve(R, M)) for M in (self.A @ R, self.B))
        return Form(A, B, self.C @ R, self.D, Qc, Qm, Qs)

    @property
    def supply(self) -> float:
        """Coefficient of mu |v|^2, negative; without v that of 1."""
        return float(np.diag(self.Qm)[self.n :].min(initial=0.0)) or -1.0

    @property
    def weight(self) -> float:
        """Size of the weight of e beside that of the first multiplier."""
        n = self.n
        return float(np.linalg.norm(self.Qc[:n, :n]) / (np.linalg.norm(self.Qs[0]) or 1.0))

    def separate(self, nf: int) -> bool:
        """Whether the multipliers leave v alone and their part in f is negative: then (f, v) is for all scales and mu.

        `nf`: size of f, the first of the inputs.
        """
        ends = self.n, self.n + nf
        parts = self.Qs[:, slice(*ends), slice(*ends)]
        if self.Qs[:, ends[1] :].any() or (nf and not len(parts)):
            return False
        negative = all(np.linalg.eigvalsh(part)[-1] <= 0 for part in parts) if nf else True
        return negative and (not nf or bool(np.linalg.eigvalsh(parts.sum(axis=0))[-1] < 0))

    def faster(self, rate: float) -> "Form":
        """Same for an error that decays faster by a rate (1/s)."""
        return replace(self, A=self.A + rate * np.eye(self.n))


def quadrants(A: Float, B: Float, C: Float, D: Float) -> Float:
    """Matrix [A, B; C, D]; `numpy.block` takes ten times as long for a few numbers."""
    whole = np.empty((len(A) + len(C), A.shape[1] + B.shape[1]))
    whole[: len(A), : A.shape[1]], whole[: len(A), A.shape[1] :] = A, B
    whole[len(A) :, : A.shape[1]], whole[len(A) :, A.shape[1] :] = C, D
    return whole


def size_of(ee: Float, ef: Float, ff: Float) -> float:
    """Size of what a multiplier adds to the weight of e, with its f eliminated."""
    across = float(np.linalg.norm(ef, 2)) ** 2 if ef.size else 0.0
    under = float(np.linalg.norm(ff, 2)) if ff.size else 0.0
    return max(float(np.linalg.norm(ee, 2)), across / under if under else 0.0) or 1.0


def scales(A: Float, G: Float, Q: Float) -> Float:
    """Powers of two s that bring the entries of A s, G / s s and Q s s near each other."""
    from scipy.linalg import matrix_balance

    n = len(A)
    M = np.abs(quadrants(A.T, Q, G, A))
    np.fill_diagonal(M, 0.0)
    with np.errstate(invalid="ignore"):
        _, (scale, _) = matrix_balance(M, separate=True, permute=False)
    if not (np.isfinite(scale).all() and (scale > 0).all()):
        raise UnclearError("numbers of the plant are too far from each other")
    half = np.rint(np.log2(scale[n:] / scale[:n]) / 2)
    return np.asarray(np.exp2(half))


def without_exact_outputs(form: Form) -> tuple[Form, Float]:
    """Form of the same least mu whose outputs all have noise, and N, e = N e1 its error: D has full row rank.

    Outputs y2 = C2 e without noise leave the form on C2 e = 0, e = N1 e1. There N1' P N2, N2 = range(C2'), is a free
    gain on the output N2' A N1 e1 with the noise N2' B u: the order falls by the rank of C2, and may come to zero.
    N2' P N2 is free too: P >= F asks for no more than N1' (P - F) N1 >= 0.

    Raises `UnclearError`: doubles do not tell which outputs have noise.
    """
    N = np.eye(form.n)
    origin = np.zeros(len(form.C))  # sizes of what the rows of D were computed from: nothing, for those of a spec
    while len(form.C):
        noisy, exact = split(form.D, origin)
        if not len(exact):
            return form, N
        C1, C2, D1 = noisy @ form.C, exact @ form.C, noisy @ form.D
        N1, N2 = kernel_and_range(C2, form.C)
        N = N @ N1
        keep = np.zeros((len(form.Qc), N1.shape[1] + form.B.shape[1]))
        keep[: form.n, : N1.shape[1]], keep[form.n :, N1.shape[1] :] = N1, np.eye(form.B.shape[1])
        origin = np.concatenate([np.zeros(len(D1)), np.full(N2.shape[1], np.linalg.norm(form.B))])
        form = Form(
            N1.T @ form.A @ N1,
            N1.T @ form.B,
            np.vstack([C1 @ N1, N2.T @ form.A @ N1]),
            np.vstack([D1, N2.T @ form.B]),
            keep.T @ form.Qc @ keep,
            keep.T @ form.Qm @ keep,
            keep.T @ form.Qs @ keep,
        )
        if not form.n:
            break
    return form, N


def split(D: Float, origin: Float) -> tuple[Float, Float]:
    """Rows T1, T2 with T1 D of full row rank and T2 D = 0; together they are a basis of the outputs.

    `origin`: (p,), size of what each row was computed from, whose rounding is in it.
    """
    norms = np.linalg.norm(D, axis=1)
    none = norms <= ZERO * len(D.T) * origin
    if (~none & (norms <= CERTAIN * origin)).any():
        raise UnclearError("whether an output has noise is not clear in double precision")
    kept = np.flatnonzero(~none)
    exact = np.eye(len(D))[none]
    if not len(kept):
        return np.zeros((0, len(D))), exact
    unit = np.zeros((len(kept), len(D)))
    unit[np.arange(len(kept)), kept] = 1 / norms[kept]
    U, singular, _ = np.linalg.svd(unit @ D)
    rank = ranked(singular, len(kept))
    return U[:, :rank].T @ unit, np.vstack([U[:, rank:].T @ unit, exact])


def kernel_and_range(C: Float, whole: Float) -> tuple[Float, Float]:
    """Orthonormal bases of null(C) and of range(C'), as columns; C has combinations of rows of the whole."""
    norms = np.linalg.norm(C, axis=1)
    some = norms > ZERO * np.linalg.norm(whole)
    rows = C[some] / norms[some, None]
    if not len(rows):
        return np.eye(C.shape[1]), np.zeros((C.shape[1], 0))
    _, singular, Vt = np.linalg.svd(rows)
    rank = ranked(singular, len(rows))
    return Vt[rank:].T, Vt[:rank].T


def ranked(singular: Float, rows: int) -> int:
    """Number of singular values of so many normalised rows that count."""
    s = singular[:rows] / singular.max(initial=0.0)
    if ((s > ZERO) & (s < CERTAIN)).any():
        raise UnclearError("the rank of the outputs is not clear in double precision")
    return int((s >= CERTAIN).sum())


@dataclass(frozen=True)
class Eliminated:
    """The form on the kernel of [C D]: x' = A x + B w with Q = Qc + mu Qm in (x, w), and how (e, u) follows."""

    A: Float  # (n, n)
    B: Float  # (n, m - p)
    Qc: Float
    Qm: Float
    Qs: Float
    T: Float  # (e, u) = T (x, w)
    supply: float  # that of the form

    @classmethod
    def of(cls, form: Form) -> "Eliminated":
        """Eliminate Y; D must have full row rank."""
        n, m = form.B.shape
        unit = 1 / np.linalg.norm(form.D, axis=1)
        back = np.linalg.pinv(unit[:, None] * form.D) * unit
        Z = np.linalg.svd(form.D)[2][len(form.D) :].T if len(form.D) else np.eye(m)
        T = quadrants(np.eye(n), np.zeros((n, Z.shape[1])), -back @ form.C, Z)
        Qc, Qm, Qs = (T.T @ Q @ T for Q in (form.Qc, form.Qm, form.Qs))
        return cls(form.A - form.B @ back @ form.C, form.B @ Z, Qc, Qm, Qs, T, form.supply)

    def moved(self, R: Float) -> "Eliminated":
        """Same in the states R^-1 x, R nonsingular (n, n)."""
        n, rows = len(self.A), np.eye(len(self.Qc))
        rows[:n, :n] = R
        A, B = (np.asarray(np.linalg.solve(R, M)) for M in (self.A @ R, self.B))
        Qc, Qm, Qs = (rows.T @ Q @ rows for Q in (self.Qc, self.Qm, self.Qs))
        return Eliminated(A, B, Qc, Qm, Qs, self.T @ rows, self.supply)
