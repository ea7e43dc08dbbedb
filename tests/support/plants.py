"""Plants of Lipschitz systems, from their matrices."""

import numpy as np

from obsdesign.lmi.formula import rational
from obsdesign.model.plant import Plant


def zeros(*shape):
    """Exact zeros."""
    return rational(np.zeros(shape))


def plant(A, C, B=None, D=None, Bf=None, Cq=None):
    """x' = A x + Bf f(Cq x) + B w, y = C x + D w; without B there is no w, and f is any function of x by default."""
    n, ny = len(A), len(C)
    B = zeros(n, 0) if B is None else rational(B)
    D = zeros(ny, B.shape[1]) if D is None else rational(D)
    Bf, Cq = (rational(np.eye(n) if X is None else X) for X in (Bf, Cq))
    nq, nf, nw = len(Cq), Bf.shape[1], B.shape[1]
    names = (tuple(f"x{i + 1}" for i in range(n)), ("w",) * nw, ("y",) * ny)
    return Plant(rational(A), Bf, B, Cq, zeros(nq, nf), zeros(nq, nw), rational(C), zeros(ny, nf), D, *names)
