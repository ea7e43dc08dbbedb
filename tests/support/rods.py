"""Plants of any order, and random small ones, for the Riccati equations."""

import numpy as np

from obsdesign.families.incremental.theorems import theorem
from obsdesign.model.multiplier import Multiplier, Scaled
from obsdesign.model.plant import Plant


def family(name, A, B, C, D, rate=0.1, H=None, *, sampled=False):
    """Inequality of a family (l2, linf) in doubles for a plant without f, L1 to be found; `rate`: alpha, or 1 - rho."""
    A, B, C, D = (np.atleast_2d(np.asarray(X, dtype=float)) for X in (A, B, C, D))
    n, nw, ny = len(A), B.shape[1], len(C)
    none = np.zeros
    names = (tuple(f"x{i}" for i in range(n)), tuple(f"w{i}" for i in range(nw)), tuple(f"y{i}" for i in range(ny)))
    plant = Plant(A, none((n, 0)), B, none((0, n)), none((0, 0)), none((0, nw)), C, none((ny, 0)), D, *names)
    L2 = none((0, ny))
    return theorem(name, sampled=sampled)(plant, Multiplier(()), np.eye(n) if H is None else H, rate, None, L2)


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


def written(A, B, C, D, blocks, alpha, H=None, type="l2"):
    """Spec with nonlinearities Bf f(Cq x), f of a slope between two numbers, or of a type."""
    types = [ends if isinstance(ends, str) else f"{{slope: {list(ends)}}}" for _, _, ends in blocks]
    lines = [
        f"  - {{Bf: {b.tolist()}, Cq: {[q.tolist()]}, type: {type_}}}"
        for (b, q, _), type_ in zip(blocks, types, strict=True)
    ]
    matrices = "\n".join(f"  {name}: {X.tolist()}" for name, X in zip("ABCD", (A, B, C, D), strict=True))
    weight = "" if H is None else f"performance: {{H: {H.tolist()}}}\n"
    parts = f"system:\n{matrices}\nnonlinearities:\n" + "\n".join(lines)
    return f"obsdesign: 1\nname: large\n{parts}\n{weight}observer: {{type: {type}, alpha: {alpha}}}\n"


def noises(n, enters, noise, ny=2):
    """B of one disturbance, and D of outputs with noise of their own."""
    return np.hstack([enters[:, None], np.zeros((n, ny))]), np.hstack([np.zeros((ny, 1)), noise * np.eye(ny)])


def chain(n, springs=(0,), dampers=(), joints=(), measured=None, **told):
    """Spec of n / 2 masses between two walls, some tied to the ground by springs or dampers of an unknown law.

    `joints`: pairs (i, c) of a damper c f between masses i and i + 1; `measured`: positions, or those of the ends.
    """
    m, E = n // 2, np.eye(n)
    measured = [0, m - 1] if measured is None else list(measured)
    K = 2 * np.eye(m) - np.diag(np.ones(m - 1), 1) - np.diag(np.ones(m - 1), -1)
    A = np.block([[np.zeros((m, m)), np.eye(m)], [-K, -0.2 * np.eye(m)]])
    B, D = noises(n, E[m], 0.05, len(measured))
    blocks = [(-0.5 * E[m + i], E[i], (-1, 1)) for i in springs]
    blocks += [(-0.5 * E[m + i], E[m + i], "monotone") for i in dampers]
    blocks += [(-c * (E[m + i] - E[m + i + 1]), E[m + i] - E[m + i + 1], "monotone") for i, c in joints]
    return written(A, B, E[measured], D, blocks, **{"alpha": 0.02, **told})


def heat(n):
    """Spec of a rod of n cells that loses heat at two places by an unknown law; its error is weighted by length."""
    h = 1 / (n + 1)
    x = h * np.arange(1, n + 1)
    A = 0.05 / h**2 * (np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1) - 2 * np.eye(n))
    near = {c: np.exp(-(((x - c) / 0.06) ** 2)) for c in (0.25, 0.3, 0.5, 0.7, 0.8)}
    mean = {c: g / g.sum() for c, g in near.items()}
    B, D = noises(n, near[0.5], 0.02)
    blocks = [(-near[c], mean[c], (0, 1.5)) for c in (0.3, 0.7)]
    return written(A, B, np.array([mean[0.25], mean[0.8]]), D, blocks, 0.05, np.sqrt(h) * np.eye(n))


def beam(n):
    """Spec of n / 2 modes of a beam with three springs of an unknown law."""
    m = n // 2
    k = np.arange(1, m + 1)
    W, none = np.diag(k**2.0), np.zeros(m)
    A = np.block([[np.zeros((m, m)), W], [-W, -(0.02 * np.eye(m) + 0.02 * W)]])
    shape = {c: np.sqrt(2) * np.sin(k * np.pi * c) for c in (0.15, 0.21, 0.37, 0.5, 0.66, 0.85)}
    bent = {c: np.concatenate([phi / k**2, none]) for c, phi in shape.items()}
    B, D = noises(n, np.concatenate([none, shape[0.37]]), 0.01)
    blocks = [(-np.concatenate([none, shape[c]]), bent[c], (0, 1)) for c in (0.15, 0.5, 0.85)]
    return written(A, B, np.array([bent[0.21], bent[0.66]]), D, blocks, 0.01)


def random_family(seed):
    """Random plant of order 3 to 8 with one to three nonlinearities of three types, in l2."""
    rng = np.random.default_rng(seed)
    n, k, ny = int(rng.integers(3, 9)), int(rng.integers(1, 4)), int(rng.integers(1, 3))
    A, Bf, Cq = rng.normal(size=(n, n)) - np.eye(n), rng.normal(size=(n, k)) / 2, rng.normal(size=(k, n)) / 2
    B = np.hstack([rng.normal(size=(n, 2)), np.zeros((n, ny))])
    D = np.hstack([np.zeros((ny, 2)), (0.1 if rng.random() < 0.7 else 0) * np.eye(ny)])
    blocks = []
    for _ in range(k):
        b = float(rng.uniform(0.2, 1))
        lipschitz, slope, cocoercive = [[b * b, 0], [0, -1]], [[0, b], [b, -2]], [[0, 1], [1, -1 / b]]
        blocks.append(Scaled.of(np.array((lipschitz, slope, cocoercive)[rng.integers(0, 3)]), 1))
    C, none, nw = rng.normal(size=(ny, n)), np.zeros, B.shape[1]
    names = (("x",) * n, ("w",) * nw, ("y",) * ny)
    plant = Plant(A, Bf, B, Cq, none((k, k)), none((k, nw)), C, none((ny, k)), D, *names)
    return theorem("l2", sampled=False)(plant, Multiplier(tuple(blocks)), np.eye(n), 0.05, None, none((k, ny)))


def almost_exact(seed):
    """Family of a plant without f, in units far apart, whose outputs have a noise of 1e-8 to 1e-4 of v."""
    rng = np.random.default_rng(5000 + seed)
    n, ny = int(rng.integers(2, 6)), int(rng.integers(1, 3))
    A, enters = rng.normal(size=(n, n)), rng.normal(size=(n, 1))
    B, C = np.hstack([enters, np.zeros((n, ny))]), rng.normal(size=(ny, n))
    D = np.hstack([np.zeros((ny, 1)), 10 ** rng.uniform(-8, -4) * np.linalg.norm(B) * np.eye(ny)])
    S = np.diag(1e3 ** rng.integers(-1, 2, n).astype(float))
    back = np.linalg.inv(S)
    return family("l2" if rng.random() < 0.5 else "linf", S @ A @ back, S @ B, C @ back, D, 0.1, back)
