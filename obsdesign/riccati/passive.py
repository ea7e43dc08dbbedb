"""Nonlinearities that are known to be monotone only: (f, f) of the form vanishes, and so must the whole row of f.

With P Bf = T(lambda) = -Q_ef, K = Bf' T symmetric and positive, U = null(T'), V' Bf = 0 and V' U = I,

    P = T K^-1 T' + V Pt V',    e = U s2 + Bf s1,    e' P e = s2' Pt s2 + s1' K s1,

so that the same form is left for Pt, of an order that is lower by the size of f: with the state s2, and s1 an input in
the place of f. T is linear in lambda, and he(s1' T' [A e + B u]) joins Q.
"""

from dataclasses import dataclass

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.riccati.form import CERTAIN, ZERO, Form, UnclearError


@dataclass(frozen=True)
class Passive:
    """What is left of a form, and its inputs that P does not move: s1 first, then the others."""

    form: Form

    def negative(self, scales: Float, mu: float) -> bool:
        """Whether the form is negative for s2 = 0 and no output, which outputs without noise do not imply."""
        n, D = self.form.n, self.form.D
        noisy = np.linalg.norm(D, axis=1) > 0
        kernel = np.linalg.svd(D[noisy])[2][noisy.sum() :].T if noisy.any() else np.eye(D.shape[1])
        Q = kernel.T @ self.form.scaled(scales).at(mu)[n:, n:] @ kernel
        return bool(np.linalg.eigvalsh(Q).max(initial=-1.0) < 0)


def reduced(form: Form, nf: int) -> Passive | None:
    """Form without the f that have no (f, f), of the nf first inputs; None where it is no such form.

    Raises `UnclearError`: K is too near to a singular matrix.
    """
    n, m = form.B.shape
    inputs = [Q[n:, n:] for Q in (form.Qc, form.Qm, *form.Qs)]
    silent = np.array([i < nf and not any(Q[i].any() for Q in inputs) for i in range(m)])
    if not silent.any() or form.D[:, silent].any() or form.Qc[:n, n:][:, silent].any():
        return None
    Bf, T = form.B[:, silent], [-Q[:n, n:][:, silent] for Q in form.Qs]
    if not all(positive(Bf, part) for part in T) or not sum(np.abs(part).sum(axis=0) for part in T).all():
        return None
    whole = sum(T)
    _, _, Vt = np.linalg.svd(whole.T)
    U = Vt[Bf.shape[1] :].T
    basis = np.hstack([U, Bf / np.linalg.norm(Bf, axis=0)])
    if np.linalg.cond(basis) > 1 / CERTAIN:
        raise UnclearError("whether f moves its own argument is not clear in double precision")
    V = np.linalg.inv(np.hstack([U, Bf]))[: U.shape[1]].T
    kept = ~silent
    M = np.zeros((n + m, n + kept.sum()))
    M[:n, :n] = np.hstack([U, Bf])
    M[n:, n:] = np.eye(m)[:, kept]
    flow = np.hstack([form.A @ U, form.A @ Bf, form.B[:, kept]])
    Qs = []
    for Q, part in zip(form.Qs, T, strict=True):
        rise = np.zeros((M.shape[1],) * 2)
        rise[U.shape[1] : n] = part.T @ flow
        Qs.append(M.T @ Q @ M + rise + rise.T)
    Qc, Qm = (M.T @ Q @ M for Q in (form.Qc, form.Qm))
    order = U.shape[1]
    C = np.hstack([form.C @ U, form.C @ Bf, form.D[:, kept]])
    small = np.abs(C) <= ZERO * np.linalg.norm(form.C)
    C = np.where(small, 0.0, C)
    moved = V.T @ flow
    return Passive(Form(moved[:, :order], moved[:, order:], C[:, :order], C[:, order:], Qc, Qm, np.array(Qs)))


def positive(Bf: Float, T: Float) -> bool:
    """Whether Bf' T of one multiplier is symmetric and positive in its own f, and zero in the others."""
    K, own = Bf.T @ T, T.any(axis=0)
    if not own.any():
        return True
    sizes = np.outer(np.linalg.norm(Bf, axis=0), np.linalg.norm(T, axis=0)).max()
    inner = K[np.ix_(own, own)]
    apart = np.abs(K[~own]).max(initial=0.0) > ZERO * sizes or np.abs(inner - inner.T).max() > ZERO * sizes
    return not apart and bool(np.linalg.eigvalsh(inner)[0] > CERTAIN * sizes)
