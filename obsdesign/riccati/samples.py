"""The least mu of a form of samples, and central gains, by the same Riccati equation as in continuous time.

In (e, u), with P > 0 and Y = P L to be found, and N = [A B] + L [C D] (both divided by rho, P times rho^2),

    N' P N - [P 0; 0 0] + Q < 0,    Q = Qc + mu Qm,

has a solution L if and only if it has one on ker [C D], with [A B] in place of N, and [P 0; 0 0] > Q: P has a floor
F = Q_ee - Q_eu Q_uu^-1 Q_ue. On the kernel x+ = A x + B w, and V+ - V = (x+ - x)' P (x+ + x): with s = x+ + x as the
state (or x+ - x: the sign for which it determines x better) and s' = x+ - x the inequality is that of continuous time,
with the same P and Q taken twice. So X = P^-1 of the largest P follows, and there is a solution if and only if
X >= 0 and no eigenvalue of F X is above 1.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import product

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.riccati.central import DEFINITE, ON_OUTPUTS, ON_STATES, Central, sizes
from obsdesign.riccati.equation import RESIDUAL, Equation
from obsdesign.riccati.form import CERTAIN, Eliminated, Form, UnclearError, size_of, split
from obsdesign.riccati.least import NEGATIVE, RANGE, STEP, Least, root

CLOSE = 1e-9  # relative, to which the least mu is found
SAME = 1e-5  # .. in other coordinates
ROUNDS = 80
LOGS = range(-24, 25, 3)  # logarithms of a scale that are tried first
NARROW = 1e-6  # .. and to which the best is found
GOLDEN = (3 - 5**0.5) / 2
APART = 1e-6  # smallest singular value of A + 1 or A - 1, relative to 1 + |A|, with which it is inverted


def in_time(form: Form) -> Eliminated:
    """Form on the kernel of [C D] in the state s.

    Raises `UnclearError`: an output has no noise, or both signs are near a mode.
    """
    if not form.n or len(split(form.D, np.zeros(len(form.D)))[1]):
        raise UnclearError("no state, or an output without noise")
    known, eye = Eliminated.of(form), np.eye(form.n)
    apart = {sign: float(np.linalg.svd(known.A + sign * eye, compute_uv=False)[-1]) for sign in (1.0, -1.0)}
    sign = max(apart, key=lambda sign: apart[sign])
    if apart[sign] <= APART * (1 + float(np.linalg.norm(known.A, 2))):
        raise UnclearError("the samples have modes at 1 and at -1")
    back = np.linalg.solve(known.A + sign * eye, np.hstack([eye, -known.B]))
    n, m = known.B.shape
    N = np.vstack([back, np.hstack([np.zeros((m, n)), np.eye(m)])])
    Qc, Qm, Qs = (2 * N.T @ Q @ N for Q in (known.Qc, known.Qm, known.Qs))
    onward = np.hstack([eye, np.zeros((n, m))]) - 2 * sign * back
    return Eliminated(onward[:, :n], onward[:, n:], Qc, Qm, Qs, known.T @ N, known.supply)


def largest(eliminated: Eliminated, mu: float) -> Float | None:
    """X = P^-1 of the largest P on the kernel; None where there is none.

    Where X does not solve its equation to within rounding it is found in the states in which it is about 1. Raises
    `UnclearError`: it does not solve it there either.
    """
    X, exact = solution(eliminated, mu)
    if X is None or exact:
        return X
    R = root(X)
    moved, exact = solution(eliminated.moved(R), mu)
    if moved is None or not exact:
        raise UnclearError("the equation is not solved in double precision")
    return np.asarray(R @ moved @ R.T)


def solution(eliminated: Eliminated, mu: float) -> tuple[Float | None, bool]:
    """X of a mu, None where there is none, and whether it solves its equation to within rounding."""
    try:
        equation = Equation.of(eliminated, mu)
    except UnclearError:  # s = 0 with w alone, V+ = V: no P pays for it
        return None, True
    with np.errstate(invalid="ignore"):  # scipy casts scales to places, and does not use them
        space = equation.subspace()
    try:
        X = None if space is None else space.X
    except np.linalg.LinAlgError:
        return None, True
    if X is None or not np.isfinite(X).all():
        return None, True
    values = np.linalg.eigvalsh(X)
    if values[0] < NEGATIVE * max(values[-1], 0.0):
        return None, True
    return X, values[-1] <= 0 or equation.solved_by(X)


def floor(form: Form, mu: float) -> Float:
    """F of P >= F. Raises `UnclearError`: the supply is not positive."""
    n, Q = form.n, form.at(mu)
    if len(Q) > n and np.linalg.eigvalsh(Q[n:, n:])[-1] >= 0:
        raise UnclearError("the supply of the disturbances is not positive")
    F = Q[:n, :n] - Q[:n, n:] @ np.linalg.solve(Q[n:, n:], Q[n:, :n])
    return np.asarray((F + F.T) / 2)


def above_floor(F: Float, X: Float) -> float:
    """1 - (largest eigenvalue of F X): positive where X^-1 > F."""
    values, vectors = np.linalg.eigh(X)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return 1 - float(np.linalg.eigvalsh(root.T @ F @ root)[-1])


def least_of_samples(form: Form, known: float | None = None, cap: float = math.inf) -> Least:
    """Least mu of a form of samples, with a solution there and none slightly below.

    `known`: what it is in other coordinates: it is only looked at whether that is so in these; `cap`: what it has to be
    below. Raises `UnclearError`: the numbers do not tell, or it is above the cap.
    """
    balanced, _ = form.balanced()
    eliminated = in_time(balanced)

    def level(mu: float) -> float:
        X = largest(eliminated, mu)
        return -math.inf if X is None else above_floor(floor(balanced, mu), X)

    if known is not None:
        inside, outside = known * (1 + SAME), known * (1 - SAME)
        if level(inside) > 0 >= level(outside):
            return Least(inside, outside, 0.0)
        raise UnclearError("the least gamma is another in other coordinates")
    if cap < math.inf and not level(cap) > 0:
        raise UnclearError("the least gamma is above a level")
    inside, outside = bracket(level, cap)
    low, high = level(outside), level(inside)
    for _ in range(ROUNDS):
        if inside <= outside * (1 + CLOSE):
            return Least(inside, outside, 0.0)
        share = min(max(low / (low - high), 0.05), 0.95) if low > -1 else 0.5
        mu = outside * (inside / outside) ** share
        if not outside < mu < inside:
            break
        value = level(mu)
        inside, high, outside, low = (mu, value, outside, low / 2) if value > 0 else (inside, high / 2, mu, value)
    raise UnclearError("the least gamma is not clear in double precision")


def bracket(level: Callable[[float], float], cap: float = math.inf) -> tuple[float, float]:
    """Neighbours of which the first has a solution and the second has none. Raises `UnclearError`: there are none.

    `cap`: one that has a solution, if it is finite.
    """
    mu = cap if cap < math.inf else 1.0
    while mu != cap and not level(mu) > 0:
        mu *= STEP
        if mu > RANGE:
            raise UnclearError("no gamma was found that can be reached")
    while level(mu / STEP) > 0:
        mu /= STEP
        if mu < 1 / RANGE:
            raise UnclearError("the least gamma is zero, or too small to be told from it")
    return mu, mu / STEP


def least_peak_of_samples(form: Form, H: Float) -> Least:
    """Least mu with P >= H'H, where the form is homogeneous in P and mu.

    Raises `UnclearError`, as `least_of_samples`.
    """
    balanced, s = form.balanced()
    X = largest(in_time(balanced), 1.0)
    if X is None or not above_floor(floor(balanced, 1.0), X) > 0:
        raise UnclearError("no P was found")
    output = H * s
    mu = float(np.linalg.eigvalsh(output @ X @ output.T).max(initial=0.0))
    if mu <= CERTAIN * float(np.linalg.norm(output, 2)) ** 2 * float(np.linalg.norm(X, 2)):
        raise UnclearError("the least gamma is zero, or too small to be told from it")
    return Least(mu, mu * (1 - RESIDUAL), 0.0)


def least_over_scale(form: Form, weight: float, at: Callable[[Form, float], Least]) -> tuple[Least, Float]:
    """Least mu over the scale of one multiplier, and that scale, with a bound from below.

    Mu is convex in the scale, so that shares of a range find it, and lines through two of three points bound it.

    `weight`: size of what P is held against; `at`: least mu of a form for a scale, which may raise `UnclearError` where
    it is above a cap. Raises `UnclearError`: no scale was found, or it is at an end of what was looked at.
    """
    n, m = form.n, form.n + int((np.diag(form.Qs[0])[form.n :] < 0).sum())
    Q = form.Qs[0]
    unit = weight / size_of(Q[:n, :n], Q[:n, n:m], Q[n:m, n:m])
    best: Least | None = None

    def value(x: float, cap: float = math.inf) -> Least:
        return at(form.scaled(np.array([unit * math.exp(x)])), cap)

    def improves(x: float) -> bool:
        nonlocal best
        with suppress(UnclearError):
            found = value(x, best.mu if best else math.inf)
            if best is None or found.mu < best.mu:
                best = found
                return True
        return False

    better = [float(x) for x in sorted(LOGS, key=abs) if improves(x)]
    if best is None or abs(better[-1]) == max(LOGS):
        raise UnclearError("no scales with a solution were found")
    middle = better[-1]
    low, high = middle - LOGS.step, middle + LOGS.step
    while high - low > NARROW:
        up = high - middle > middle - low
        x = middle + GOLDEN * ((high if up else low) - middle)
        if improves(x):
            low, middle, high = (middle, x, high) if up else (low, x, middle)
        else:
            low, high = (low, x) if up else (x, high)
    left, right = (value(low).mu - best.mu) / (middle - low), (value(high).mu - best.mu) / (high - middle)
    below = max(left * (high - middle), right * (middle - low), 0.0)
    return Least(best.mu, best.lower - below, 0.0), np.array([unit * math.exp(middle)])


def central_of_samples(form: Form, mu: float, fits: Callable[[Float], bool]) -> Iterator[Central]:
    """Gains for a mu above the least, with noises beside v as room: small ones first, and those with more room."""
    balanced, s = form.balanced()
    on_states, on_outputs = sizes(balanced)
    made: list[Central] = []
    for states, outputs in product(ON_STATES, (0.0, *ON_OUTPUTS[::4])):
        noisy = balanced.noisy(np.full(form.n, states * on_states), outputs * on_outputs)
        with suppress(np.linalg.LinAlgError, UnclearError):
            X = largest(in_time(noisy), mu)
            if X is not None and above_floor(floor(noisy, mu), X) > 0 and fits(X * np.outer(s, s)):
                made.append(Central(s[:, None] * gain(noisy, mu, X), inverse(X) / np.outer(s, s)))
    yield from sorted(made, key=lambda one: float(f"{one.size:.2g}"))


def gain(form: Form, mu: float, X: Float) -> Float:
    """Central gain for P = X^-1, with which N (-S)^-1 N' <= X is least, S = Q - [P 0; 0 0] < 0.

    L = -[A B] T [C D]' ([C D] T [C D]')^-1, and with W = -Q_uu and u = K e, K = W^-1 Q_ue,

        T = (-S)^-1 = [I; K] (P - F)^-1 [I; K]' + [0 0; 0 W^-1],    (P - F)^-1 = R (I - R' F R)^-1 R',    R R' = X.

    Raises `UnclearError`: it is not finite.
    """
    n, Q, values, vectors = form.n, form.at(mu), *np.linalg.eigh(X)
    R, W = vectors * np.sqrt(np.maximum(values, 0.0)), -Q[n:, n:]
    K, back = np.linalg.solve(W, Q[n:, :n]), np.linalg.solve(W, form.D.T)
    inner = np.linalg.solve(np.eye(n) - R.T @ floor(form, mu) @ R, R.T)
    on, off = (form.A + form.B @ K) @ R, (form.C + form.D @ K) @ R
    seen = (form.C + form.D @ K).T
    L = -np.linalg.solve(off @ inner @ seen + form.D @ back, (on @ inner @ seen + form.B @ back).T).T
    if not np.isfinite(L).all():
        raise UnclearError("the gain is not finite")
    return np.asarray(L)


def inverse(X: Float) -> Float:
    """P = X^-1. Raises `UnclearError`: X is not definite in double precision."""
    d = np.sqrt(np.abs(np.diag(X))) + np.finfo(float).tiny
    values, vectors = np.linalg.eigh(X / np.outer(d, d))
    if not values[0] > DEFINITE:
        raise UnclearError("X is not definite")
    inner = vectors / np.sqrt(values) / d[:, None]
    return np.asarray(inner @ inner.T)


def gain_near(form: Form, mu: float) -> Float | None:
    """Central gain for a mu that is little above the least, without any noise beside v; None where it is not found."""
    balanced, s = form.balanced()
    try:
        X = largest(in_time(balanced), mu)
        near = X is not None and above_floor(floor(balanced, mu), X) > 0
        return s[:, None] * gain(balanced, mu, X) if X is not None and near else None
    except (np.linalg.LinAlgError, UnclearError):
        return None
