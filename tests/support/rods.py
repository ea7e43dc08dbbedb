"""Linear plants of any order, and random small ones, for the Riccati equations."""

import numpy as np

from obsdesign.families.incremental.theorems import theorem
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant


def family(name, A, B, C, D, alpha=0.1, H=None):
    """Inequality of a family (l2, linf) in doubles, for a plant without f and L1 to be found."""
    A, B, C, D = (np.atleast_2d(np.asarray(X, dtype=float)) for X in (A, B, C, D))
    n, nw, ny = len(A), B.shape[1], len(C)
    none = np.zeros
    names = (tuple(f"x{i}" for i in range(n)), tuple(f"w{i}" for i in range(nw)), tuple(f"y{i}" for i in range(ny)))
    plant = Plant(A, none((n, 0)), B, none((0, n)), none((0, 0)), none((0, nw)), C, none((ny, 0)), D, *names)
    L2 = none((0, ny))
    return theorem(name, sampled=False)(plant, Multiplier(()), np.eye(n) if H is None else H, alpha, None, L2)


def rod(n, heaters, thermometers, noise=0.1):
    """Matrices of a rod of n cells, insulated at one end and at 0 at the other, with conductance / capacity 4 (1/s)."""
    A = 4 * (np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1) - 2 * np.eye(n))
    A[0, 0] = -4
    B, C = np.zeros((n, len(heaters) + len(thermometers))), np.zeros((len(thermometers), n))
    B[heaters, range(len(heaters))] = 1
    C[range(len(thermometers)), thermometers] = 1
    D = np.hstack([np.zeros((len(thermometers), len(heaters))), noise * np.eye(len(thermometers))])
    return A, B, C, D


RODS = {12: ([1, 9], [0, 5, 11]), 20: ([2, 15], [0, 9, 19]), 40: ([5, 30], [0, 19, 39])}


def rod_spec(n, observer="{type: l2, alpha: 1.0e-4}"):
    """Spec of a rod."""
    A, B, C, D = (X.tolist() for X in rod(n, *RODS[n]))
    return f"obsdesign: 1\nname: rod\nsystem:\n  A: {A}\n  B: {B}\n  C: {C}\n  D: {D}\nobserver: {observer}\n"


def random_plant(seed):
    """Matrices A, B, C, D and H of a small plant; some have unreached modes, no noise in some outputs, or no B."""
    rng = np.random.default_rng(seed)
    n, nw = int(rng.integers(1, 9)), int(rng.integers(1, 4))
    ny = int(rng.integers(1, min(n, 3) + 1))
    A, B, C = rng.normal(size=(n, n)), rng.normal(size=(n, nw)), rng.normal(size=(ny, n))
    kind, noisy = rng.integers(0, 6), rng.random() < 0.6
    if kind == 0:
        B = 0 * B
    elif kind == 1:
        A[-1, :-1], B[-1] = 0, 0
    elif kind == 2:
        A = A - A.T
    elif kind == 3:
        A = np.diag(-10 * rng.random(n))
    rank = ny if noisy else int(rng.integers(0, ny))
    D = np.hstack([np.zeros((ny, nw)), rng.normal(size=(ny, rank)) * 10 ** rng.uniform(-2, 0)])
    if noisy and rng.random() < 0.3:
        D[:, :nw] += 0.3 * rng.normal(size=(ny, nw))
    H = np.eye(n) if rng.random() < 0.5 else rng.normal(size=(1, n))
    return A, np.hstack([B, np.zeros((n, rank))]), C, D, H, 10 ** rng.uniform(-2, 0.3)
