"""Central gains: those of the largest P, with small noises beside v that make the inequality strict in every direction.

For P = X^-1 the gain L = -[X C' + (B + X S) W^-1 D'] (D W^-1 D')^-1, W = -Q_uu and S = Q_eu of the form, minimises the
Schur complement of the inequality. It is not the smallest gain that reaches a mu.
"""

from collections.abc import Callable, Iterator

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass
from obsdesign.riccati.equation import Equation
from obsdesign.riccati.form import Eliminated, Form, UnclearError, without_exact_outputs

FASTER = 0.01  # of the decay rate: room
ON_STATES = (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)  # noise on every state, of the size of v in balanced units
FOR_GIVEN = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)  # .. where the gain is given
FIRST = (1e-3, 1e-4, 1e-5)  # .. with which that on the outputs is chosen: the first that has a solution
ON_OUTPUTS = tuple(10 ** (k / 2) for k in range(-8, 9))  # of the noise of an output, or of the size of v in it
LARGE, SPARSE = 64, 3  # order from which one of so many of these is tried
COSTLY = 1.03  # factor of |L| that a noise on the states may cost
DEFINITE = 1e-13  # of X with a unit diagonal


@dataclass(frozen=True)
class Central:
    """A gain with the P that proves it."""

    L: Float  # (n, p)
    P: Float  # (n, n)

    @property
    def size(self) -> float:
        """Spectral norm of the gain."""
        return float(np.linalg.norm(self.L, 2))


Fits = Callable[[Float], bool]  # whether an X will do
Solve = Callable[[Form, float, Fits], Central | None]


def central(form: Form, rate: float, mu: float, fits: Fits, solve: Solve | None = None) -> Iterator[Central]:
    """Gains for a mu above the least, the small ones first and then those with more room.

    `rate`: the decay rate that is in the form already; `fits`: whether an X will do; `solve`: what finds the gain of a
    form with noise on every output; None: `solution`.
    """
    balanced, s = form.balanced()
    fast, on_states, on_outputs = balanced.faster(FASTER * rate), *sizes(balanced)

    def at(states: float, outputs: float) -> Central | None:
        noisy = fast.noisy(np.full(form.n, states * on_states), outputs * on_outputs)
        made = (solve or solution)(noisy, mu, lambda X: fits(X * np.outer(s, s)))
        return made and Central(s[:, None] * made.L, made.P / np.outer(s, s))

    tried = ON_OUTPUTS[:: SPARSE if form.n >= LARGE else 1]
    for first in FIRST:
        found = {outputs: made for outputs in (0.0, *tried) if (made := at(first, outputs))}
        if found:
            break
    else:
        return
    best = min(found, key=lambda outputs: found[outputs].size)
    gains = [one for states in sorted({*ON_STATES, first})[::-1] if (one := at(states, best))]
    least = min(one.size for one in gains)
    chosen = next(i for i, one in enumerate(gains) if one.size <= COSTLY * least)
    yield from gains[chosen::-1]


def sizes(form: Form) -> tuple[float, Float]:
    """Size of v in the states of a balanced form and in every output."""
    acts = float(np.linalg.norm(form.B, 2)) or 1.0
    noise = np.linalg.norm(form.D, axis=1)
    slowness = max(float(np.linalg.norm(form.A, 2)), np.finfo(float).tiny) ** -0.5
    return acts, np.where(noise > 0, noise, np.linalg.norm(form.C, axis=1) * acts * slowness)


def solution(form: Form, mu: float, fits: Fits) -> Central | None:
    """Central gain and P of a form with noise on every output; None where there is none that fits."""
    try:
        if np.linalg.matrix_rank(form.D) < len(form.D):
            return None
        found = stored(form, mu, fits)
        if found is None:
            return None
        X, P = found
        L = best_gain(form, mu, X)
    except (np.linalg.LinAlgError, UnclearError):
        return None
    return Central(L, P) if np.isfinite(L).all() else None


def best_gain(form: Form, mu: float, X: Float) -> Float:
    """Gain (n, p) that minimises the Schur complement for P = X^-1; raises `LinAlgError` where there is none."""
    n, Q = form.n, form.at(mu)
    W, S = -Q[n:, n:], Q[:n, n:]
    back = np.linalg.solve(W, form.D.T)
    return np.asarray(-np.linalg.solve(form.D @ back, (X @ form.C.T + (form.B + X @ S) @ back).T).T)


def stored(form: Form, mu: float, fits: Fits) -> tuple[Float, Float] | None:
    """X and P = X^-1 of a form; None where there is none that fits."""
    space = Equation.of(Eliminated.of(form), mu).subspace()
    X = None if space is None else space.X
    if X is None or not np.isfinite(X).all() or not (np.diag(X) > 0).all():
        return None
    d = np.sqrt(np.diag(X))
    values, vectors = np.linalg.eigh(X / np.outer(d, d))
    if values[0] <= DEFINITE or not fits(X):
        return None
    inner = vectors / np.sqrt(values) / d[:, None]
    return X, np.asarray(inner @ inner.T)


def storage(form: Form, mu: float) -> Float | None:
    """Largest P of a form for a mu, balanced and without the outputs that have no noise; None where it is singular."""
    reduced, _ = without_exact_outputs(form)
    if not reduced.n:
        return None
    found = stored(reduced.balanced()[0], mu, lambda _: True)
    return found and found[1]


def storages(form: Form, mu: float, fits: Fits) -> Iterator[Float]:
    """P of a form without outputs for a mu above the least, those with more room first."""
    balanced, s = form.balanced()
    acts, _ = sizes(balanced)
    for share in FOR_GIVEN:
        noisy = balanced.noisy(np.full(form.n, share * acts), np.zeros(0))
        try:
            found = stored(noisy, mu, lambda X: fits(X * np.outer(s, s)))
        except (np.linalg.LinAlgError, UnclearError):
            continue
        if found is not None:
            yield found[1] / np.outer(s, s)
