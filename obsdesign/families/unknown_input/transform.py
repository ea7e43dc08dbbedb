"""The plant that is left of another one when channels of w are cancelled: one transform, no new inequality.

With a left factor E and T = I - E C the observer

    xi' = T (A xhat + Bf f(t, y, qhat) + gx) + L (y - yhat),    xhat = xi + E (y - gy),    in discrete time xi+ = ..

has y in its estimates at once. For eps = xi - T x and e = xhat - x = eps + E D w, where E Df = 0,

    eps' = (T A - L C) eps + (T Bf - L Df) df - (T B - T A E D - L (I - C E) D) w
    dq   = Cq eps + Dqf df - (Dq - Cq E D) w,

and no derivative of w. These are the errors of a copy of the plant with T A, T Bf, T B - T A E D, Dq - Cq E D and
(I - C E) D in place of A, Bf, B, Dq and D, with the injection L1 = -L. A channel with D, Dq and T B zero is gone.

T B = 0 reads E C B = B: it has a solution where C B has the rank of B (Darouach, Zasadzinski and Xu, IEEE Transactions
on Automatic Control 39(3), 1994; Chen, Patton and Zhang, International Journal of Control 63(1), 1996).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from flint import fmpq, fmpq_mat

from obsdesign.lmi.farkas import null_space
from obsdesign.lmi.formula import Exact, identity, zeros
from obsdesign.model.plant import Plant


def projector(plant: Plant[Exact], E: Exact) -> Exact:
    """T = I - E C, (n, n)."""
    return np.asarray(identity(plant.n, plant.A) - E @ plant.C)


def chosen(plant: Plant[Exact], channels: Sequence[int]) -> Exact | None:
    """E = B1 G, (n, ny), with E C B = B for some channels of w and E Df = 0; None where there is none.

    B1 are independent columns of B. Where y leaves a choice, G G_D G' with G_D = D D' is the least, so that as little
    of the other channels as possible is in the estimates at once; where that leaves one, the first outputs are taken.
    Units of y, w and x, and coordinates of x, change E as they change y and x, and no more.
    """
    B = independent(plant.B[:, list(channels)])
    ny, k = len(plant.C), B.shape[1]
    if not k:
        return zeros((plant.n, ny), [plant.A])
    shown = np.hstack([plant.C @ B, plant.Df])
    wanted = np.vstack([identity(k, plant.A), zeros((plant.Df.shape[1], k), [plant.A])])
    others = [j for j in range(plant.B.shape[1]) if j not in channels]
    D = plant.D[:, others]
    size = shown.shape[1]
    S = np.block([[D @ D.T if others else zeros((ny, ny), [D]), shown], [shown.T, zeros((size, size), [D])]])
    found = solution(S, np.vstack([zeros((ny, k), [D]), wanted]))
    return None if found is None else np.asarray(B @ found[:ny].T)


def independent(M: Exact) -> Exact:
    """The first columns that span those of a matrix."""
    return M[:, pivots(M)]


def pivots(M: Exact) -> list[int]:
    """Places of the columns that are no combination of those before them."""
    reduced, rank = fmpq_mat(*M.shape, M.ravel().tolist()).rref()
    return [next(j for j in range(M.shape[1]) if reduced[i, j] != 0) for i in range(rank)]


def solution(M: Exact, right: Exact) -> Exact | None:
    """X of M X = right whose entries beside the first pivots are zero; None where there is none."""
    n = M.shape[1]
    table = np.hstack([M, right])
    reduced, rank = fmpq_mat(*table.shape, table.ravel().tolist()).rref()
    leading = [next(j for j in range(table.shape[1]) if reduced[i, j] != 0) for i in range(rank)]
    if any(j >= n for j in leading):
        return None
    X = zeros((n, right.shape[1]), [M])
    for i, j in enumerate(leading):
        X[j] = [reduced[i, n + k] for k in range(right.shape[1])]
    return X


def obstacle(plant: Plant[Exact], channels: Sequence[int]) -> tuple[Exact, Exact] | None:
    """(w, f) with C B w + Df f = 0 and B w != 0, in rationals; None where there is none, so that E exists.

    Along it every E has T B w = B w - E (C B w + Df f) = B w, if E Df = 0.
    """
    B = plant.B[:, list(channels)]
    for direction in null_space(np.hstack([plant.C @ B, plant.Df])):
        w, f = direction[: len(channels)], direction[len(channels) :]
        if (B @ w != 0).any():
            return w, f
    return None


def hides(plant: Plant[Exact], channels: Sequence[int], w: Exact, f: Exact) -> bool:
    """Whether a direction is such an obstacle."""
    B = plant.B[:, list(channels)]
    return not (plant.C @ B @ w + plant.Df @ f != 0).any() and bool((B @ w != 0).any())


def remaining(plant: Plant[Exact], channels: Sequence[int], E: Exact) -> Plant[Exact]:
    """Plant whose predicted estimates have the errors eps, with the other channels of w; see above."""
    kept = [j for j in range(plant.B.shape[1]) if j not in channels]
    T, D = projector(plant, E), plant.D[:, kept]
    return replace(
        plant,
        A=T @ plant.A,
        Bf=T @ plant.Bf,
        B=T @ plant.B[:, kept] - T @ plant.A @ E @ D,
        Dq=plant.Dq[:, kept] - plant.Cq @ E @ D,
        D=D - plant.C @ E @ D,
        exogenous=tuple(plant.exogenous[j] for j in kept),
    )


def direct(plant: Plant[Exact], channels: Sequence[int], E: Exact) -> Exact:
    """E D, (n, kept): e = eps + E D v for the other channels v."""
    return np.asarray(E @ plant.D[:, [j for j in range(plant.B.shape[1]) if j not in channels]])


def rank(M: Exact) -> int:
    """Rank in rationals."""
    return int(fmpq_mat(*M.shape, M.ravel().tolist()).rank()) if M.size else 0


def exact_zeros(rows: int, columns: int) -> Exact:
    """Zeros in rationals."""
    return np.full((rows, columns), fmpq(0), dtype=object)
