"""Nonlinearities that are known to be monotone only: (f, f) of the form vanishes, and so must the whole row of f.

With P Bf = T(lambda) = -Q_ef, K = Bf' T symmetric and positive, U = null(T'), V' Bf = 0 and V' U = I,

    P = T K^-1 T' + V Pt V',    e = U s2 + Bf s1,    e' P e = s2' Pt s2 + s1' K s1,

so that the same form is left for Pt, of an order that is lower by the size of f: with the state s2, and s1 an input in
the place of f. T is linear in lambda, and he(s1' T' [A e + B u]) joins Q. The gain is free: f has no noise in y, so
that no L enters its row, and the best one for P = X^-1, X = U Pt^-1 U' + Bf K^-1 Bf', is that of the form without f.
"""

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass, replace
from obsdesign.riccati.central import (
    FASTER,
    FIRST,
    FOR_GIVEN,
    LARGE,
    ON_OUTPUTS,
    ON_STATES,
    SPARSE,
    Central,
    Fits,
    best_gain,
    central,
    sizes,
    stored,
)
from obsdesign.riccati.form import CERTAIN, ZERO, Form, UnclearError, ranked

EVALUATIONS = 180  # of gains, in the search for a small one
STEP = 0.5  # the first, of the logarithms of scales and noises
ENOUGH = 0.01  # .. and of |L| between the last


@dataclass(frozen=True)
class Passive:
    """What is left of a form, and its inputs that P does not move: s1 first, then the others."""

    form: Form
    U: Float  # (n, n - k)
    V: Float  # (n, n - k)
    silent: Array  # (m,), whether an input is an f that is left out
    ties: Float  # (k, g): the scales are ties @ those of `form`, for which K is symmetric

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
    Bf, ties = form.B[:, silent], tied(form, silent)
    if ties is None:
        return None
    form = replace(form, Qs=np.tensordot(ties.T, form.Qs, 1))
    T = [-Q[:n, n:][:, silent] for Q in form.Qs]
    if not all(positive(Bf, part) for part in T) or not sum(np.abs(part).sum(axis=0) for part in T).all():
        return None
    whole = np.sum(T, axis=0)
    _, _, Vt = np.linalg.svd((whole / np.linalg.norm(whole, axis=0)).T)
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
    left = Form(moved[:, :order], moved[:, order:], C[:, :order], C[:, order:], Qc, Qm, np.array(Qs))
    return Passive(left, U, V, silent, ties)


def tied(form: Form, silent: Array) -> Float | None:
    """Scales for which K is symmetric: (k, g), positive ratios to g of them; None where there are none.

    f_i that drives q_j as well as f_j does q_i ties their scales: lambda_j b_i' t_j = lambda_i b_j' t_i.
    """
    n, Bf = form.n, form.B[:, silent]
    T = [-Q[:n, n:][:, silent] for Q in form.Qs]
    lengths = np.linalg.norm(Bf, axis=0)
    sizes = np.array([(lengths * np.linalg.norm(part, axis=0)).max() or 1.0 for part in T])
    skew = np.array([(Bf.T @ part - part.T @ Bf)[np.triu_indices(len(lengths), 1)] for part in T]).T / sizes
    rows = skew[np.abs(skew).max(axis=1, initial=0.0) > ZERO]
    rows = rows / np.abs(rows).max(axis=1, initial=1.0, keepdims=True)
    _, singular, Vt = np.linalg.svd(np.vstack([rows, np.zeros((1, len(T)))]))
    free = Vt[ranked(singular, len(rows)) :]
    onto = free.T @ free
    if (np.diag(onto) < CERTAIN).any():
        return None
    ratios = onto / np.diag(onto)
    ratios[np.abs(ratios) < CERTAIN] = 0.0
    first = [j for j in range(len(T)) if not ratios[:j, j].any()]
    found = ratios[:, first] / sizes[:, None] * sizes[first]
    return None if (found < 0).any() or ((found > 0).sum(axis=1) != 1).any() else found


def positive(Bf: Float, T: Float) -> bool:
    """Whether Bf' T of one multiplier is symmetric and positive in its own f, and zero in the others."""
    own = T.any(axis=0)
    if not own.any():
        return True
    lengths = np.linalg.norm(Bf, axis=0), np.linalg.norm(T[:, own], axis=0)
    K = Bf.T @ T[:, own]
    if (np.abs(K[~own]) > ZERO * np.outer(lengths[0][~own], lengths[1])).any():
        return False
    unit = np.sqrt(lengths[0][own] * lengths[1])
    inner = K[own] / np.outer(unit, unit)
    return not np.abs(inner - inner.T).max() > ZERO and bool(np.linalg.eigvalsh(inner)[0] > CERTAIN)


def gains(form: Form, nf: int, scales: Float, rate: float, mu: float) -> Iterator[tuple[Central, Float]]:
    """Central gains for a mu above the least, with V Pt V' of the P and the scales that prove each.

    First one that is small, for scales of its own; then those for the given scales, which are tied to each other as
    they must be. `rate`: the decay rate that is in the form already.
    """
    yield from small(form, nf, scales, rate, mu)
    for found in central(at_scales(form, scales), rate, mu, lambda _: True, partial(solution, nf=nf)):
        yield found, scales


def small(form: Form, nf: int, scales: Float, rate: float, mu: float) -> Iterator[tuple[Central, Float]]:
    """A small gain by a search over the scales and the noise of each output, and gains with more room beside it."""
    from scipy.optimize import minimize

    balanced, s = form.balanced()
    left = reduced(balanced, nf)
    if left is None:
        return
    fast, (acts, on_outputs) = balanced.faster(FASTER * rate), sizes(balanced)
    group, free = left.ties.argmax(axis=1), left.ties.shape[1]

    def at(x: Float, states: float) -> Central | None:
        noisy = fast.noisy(np.full(form.n, states * acts), np.exp(x[free:]) * on_outputs)
        made = solution(at_scales(noisy, scales * np.exp(x[group])), mu, lambda _: True, nf)
        return made and Central(s[:, None] * made.L, made.P / np.outer(s, s))

    def size(x: Float, states: float) -> float:
        made = at(x, states)
        return float(np.log(made.size)) if made else math.inf

    tried = np.log(ON_OUTPUTS[:: SPARSE if form.n >= LARGE else 1])
    starts = [np.concatenate([np.zeros(free), np.full(len(form.C), noise)]) for noise in tried]
    for states in FIRST:
        values = [size(x, states) for x in starts]
        if np.isfinite(min(values)):
            break
    else:
        return
    start: Float = starts[int(np.argmin(values))]
    simplex: Float = np.vstack([start, start + STEP * np.eye(len(start))])
    most = EVALUATIONS // (SPARSE if form.n >= LARGE else 1)
    found = minimize(
        partial(size, states=states),
        start,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": most, "xatol": ENOUGH, "fatol": ENOUGH},
    )
    best = np.asarray(found.x)
    for noise in (states, *(more for more in ON_STATES[::-1] if more > states)):
        if made := at(best, noise):
            yield made, scales * np.exp(best[group])


def solution(form: Form, mu: float, fits: Fits, nf: int) -> Central | None:
    """Central gain and V Pt V' of a form with one scale, which is 1; None where there is none that fits."""
    n, unit = form.n, np.ones(1)
    try:
        left = reduced(form, nf) if np.linalg.matrix_rank(form.D) == len(form.D) else None
        found = left and stored(left.form.scaled(unit), mu, lambda _: True)
        if not left or not found:
            return None
        Bf, T = form.B[:, left.silent], -form.Qs[0][:n, n:][:, left.silent]
        X = left.U @ found[0] @ left.U.T + Bf @ np.linalg.solve(T.T @ Bf, Bf.T)
        L = best_gain(without(form.scaled(unit), left.silent), mu, (X + X.T) / 2)
    except (np.linalg.LinAlgError, UnclearError):
        return None
    return Central(L, left.V @ found[1] @ left.V.T) if np.isfinite(L).all() and fits(X) else None


def storages(form: Form, nf: int, scales: Float, mu: float) -> Iterator[Float]:
    """V Pt V' of a form without outputs for given scales and a mu above the least, those with more room first."""
    balanced, s = form.balanced()
    acts, _ = sizes(balanced)
    for share in FOR_GIVEN:
        noisy = at_scales(balanced.noisy(np.full(form.n, share * acts), np.zeros(0)), scales)
        try:
            left = reduced(noisy, nf)
            found = left and stored(left.form.scaled(np.ones(1)), mu, lambda _: True)
        except (np.linalg.LinAlgError, UnclearError):
            continue
        if left and found:
            yield left.V @ found[1] @ left.V.T / np.outer(s, s)


def at_scales(form: Form, scales: Float) -> Form:
    """Same with one scale, which is 1."""
    return replace(form, Qs=np.tensordot(scales, form.Qs, 1)[None])


def without(form: Form, silent: Array) -> Form:
    """Same without some inputs."""
    kept = np.concatenate([np.ones(form.n, bool), ~silent])
    Qc, Qm, Qs = (Q[..., kept, :][..., kept] for Q in (form.Qc, form.Qm, form.Qs))
    return Form(form.A, form.B[:, ~silent], form.C, form.D[:, ~silent], Qc, Qm, Qs)
