"""Largest steps with which an observer at a fixed step is stable, for frozen members of the class, f = K q."""

import numpy as np

from obsdesign.dissipation.frequencies import distinct
from obsdesign.dissipation.modes import EXPONENTIALS, INSIDE, LARGE
from obsdesign.lmi.formula import Array

TAYLOR = 1 / np.array([1.0, 1, 2, 6, 24])  # the factor of a step of Runge-Kutta 4 is the sum of these times (s h)^k
SIZES = np.linspace(2, 4, 2001)  # |s h| at which it is looked at: those of the left half plane are stable up to 2
AT_ONCE = 256  # directions of s
STEPS, FEWER_STEPS = 60, 15  # of the exact discretisation that are tried, of small systems and of large ones
HALVINGS, FEWER_HALVINGS = 20, 12
FARTHEST = 1e3  # the largest of them, relative to that of Runge-Kutta
SQUARINGS = 16  # of a matrix, until a norm shows that its powers vanish


def explicit_steps(poles: Array) -> dict[str, float | None]:
    """Largest steps of Euler and Runge-Kutta 4 on the poles that are stable; zero if none is, None without a pole."""
    found = poles[EXPONENTIALS.decay(poles)]
    if not found.size:
        return dict.fromkeys(("euler", "rk4"), 0.0 if poles.size else None)
    euler = -2 * found.real / np.abs(found) ** 2
    found = found[np.abs(found) >= np.abs(found).max() / 2]
    cosines = found.real / np.abs(found)
    towards = distinct(cosines)
    parts = (towards[first : first + AT_ONCE] for first in range(0, len(towards), AT_ONCE))
    limits = np.concatenate([stable_sizes(part) for part in parts])
    rk4 = limits[np.searchsorted(towards, cosines)] / np.abs(found)
    return {"euler": float(euler.min()), "rk4": float(rk4.min())}


def stable_sizes(cosines: Array) -> Array:
    """Largest |s h| up to which Runge-Kutta 4 is stable, for s = |s| exp(i theta), by cos(theta).

    The square of its factor is a polynomial in |s h|, whose coefficients are sums of cos((j - k) theta) / (j! k!).
    """
    angles = np.arccos(cosines)
    squares = np.zeros((len(cosines), 2 * len(TAYLOR) - 1))
    for j, first in enumerate(TAYLOR):
        for k, second in enumerate(TAYLOR):
            squares[:, j + k] += first * second * np.cos((j - k) * angles)
    outside = squares @ SIZES ** np.arange(squares.shape[1])[:, None] > (1 + INSIDE) ** 2
    return np.asarray(SIZES[outside.argmax(axis=1) - 1])


def exact_step(A: Array, G: Array, slopes: Array, unit: float) -> float | None:
    """Largest step h of e' = A e + G f that holds f and is exact otherwise, for f = S e of each S of some slopes.

    A (n, n), G (n, nf), slopes (m, nf, n); `unit`: the largest step of Runge-Kutta 4. None: any, as far as was tried.
    """
    from scipy.linalg import expm

    n = len(A)
    if not np.any(G @ slopes):
        return None
    generator = np.zeros((n + G.shape[1],) * 2)
    generator[:n] = np.hstack([A, G])
    steps, halvings = (STEPS, HALVINGS) if n < LARGE else (FEWER_STEPS, FEWER_HALVINGS)

    def unstable(h: float) -> bool:
        E = expm(h * generator)
        return not vanish(E[:n, :n] + E[:n, n:] @ slopes)

    start = unit / 10
    while unstable(start):
        start /= 10
    low = start
    for high in (start * np.geomspace(1, unit / start * FARTHEST, steps)).tolist():
        if unstable(high):
            break
        low = high
    else:
        return None
    for _ in range(halvings):
        middle = (low + high) / 2
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return low


def vanish(matrices: Array) -> bool:
    """Whether the powers of each of some matrices (m, n, n) vanish, but for what is rounded.

    A power of norm below one shows it; where none does soon, the eigenvalues do.
    """
    powers = matrices
    with np.errstate(all="ignore"):
        for _ in range(SQUARINGS):
            left = ~(np.linalg.norm(powers, axis=(1, 2)) < 1)
            matrices, powers = matrices[left], powers[left] @ powers[left]
            if not len(matrices):
                return True
    return all(np.abs(np.linalg.eigvals(M)).max() <= 1 + INSIDE for M in matrices)
