"""Plants in discrete time that stand for continuous ones between two samples.

With x' = A x + Bf f(q) + gx + B w, f, gx and w constant over a period Ts,

    hold             x+ = E x + Phi (Bf f(q) + gx + B w),    E = expm(A Ts), Phi = int_0^Ts expm(A s) ds;

implicit Euler, which puts f into its own argument, with S = (I - Ts A)^-1 in rationals,

    implicit-euler   x+ = S (x + Ts (Bf f(q) + gx + B w)),    q = Cq x+ + Dqf f + gq + Dq w.

Both are models: of the continuous plant nothing follows by itself. What holds of a hold at the samples is

    x+ = E x + Phi (Bf f(q) + gx + B w) + delta,    |delta| <= sum_i l_i kappa(Bf_i) sup|q_i'| + kappa(B) sup|w'|,

kappa(b) = int_0^Ts |expm(A (Ts - s)) b| s ds, for f_i with the constants l_i, an absolutely continuous w, and known
inputs that are constant over each period.
"""

import numpy as np
from flint import arb, arb_mat, ctx, fmpq, fmpq_mat

from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, Exact, identity, in_floats, printed
from obsdesign.lmi.spectrum import upper
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, replace

BITS = 100  # of a ball
PARTS = 256  # of a period, on each of which the matrix exponential is enclosed


@dataclass(frozen=True)
class Discretised:
    """A plant in samples, and how known terms of the continuous one act: gx+ = X gx and gq+ = gq + Q gx."""

    plant: Plant[Exact]
    X: Array  # (n, n)
    Q: Array  # (nq, n)


@dataclass(frozen=True)
class Continuous:
    """A continuous plant that one in samples stands for."""

    plant: Plant[Exact]
    gx: tuple[Expression, ...]
    gy: tuple[Expression, ...]
    gq: tuple[Expression, ...]
    method: str
    defect: fmpq | None = None  # bound on how far the samples are from those of the model
    rates: tuple[fmpq, fmpq] = (fmpq(0), fmpq(0))  # with sup|q_i'| and sup|w'|


def hold(plant: Plant[Exact], period: fmpq) -> Discretised:
    """Plant with f, gx and w held over each period; its matrices are doubles, as the decimals that print them."""
    from scipy.linalg import expm

    n, Ts = plant.n, float(period)
    generator = np.block([[in_floats(plant.A), np.eye(n)], [np.zeros((n, 2 * n))]])
    whole = expm(generator * Ts)
    E, Phi = printed(whole[:n, :n]), printed(whole[:n, n:])
    Bf, B = (printed(in_floats(Phi @ X)) for X in (plant.Bf, plant.B))
    return Discretised(replace(plant, A=E, Bf=Bf, B=B), Phi, 0 * plant.Cq)


def implicit_euler(plant: Plant[Exact], period: fmpq) -> Discretised | None:
    """Plant whose f is that of the next sample, in rationals; None where I - Ts A has no inverse."""
    inner = identity(plant.n, plant.A) - period * plant.A
    M = fmpq_mat(*inner.shape, inner.ravel().tolist())
    if M.det() == 0:
        return None
    S = np.array(M.inv().entries(), dtype=object).reshape(inner.shape)
    Cq, X = plant.Cq @ S, period * S
    Q = period * Cq
    Dqf, Dq = plant.Dqf + Q @ plant.Bf, plant.Dq + Q @ plant.B
    made = replace(plant, A=S, Bf=X @ plant.Bf, B=X @ plant.B, Cq=Cq, Dqf=Dqf, Dq=Dq)
    return Discretised(made, X, Q)


def kappa(A: Array, b: Array, period: fmpq) -> arb:
    """Enclosure of an upper bound on int_0^Ts |expm(A (Ts - s)) b| s ds, with the norm of Frobenius; in rationals.

    On each part of the period expm is enclosed at every instant.
    """
    with ctx.workprec(BITS):
        found, step = arb(0), arb(period) / PARTS
        M, columns = arb_mat(A.tolist()), arb_mat(b.tolist()) if b.size else None
        for k in range(PARTS if columns is not None else 0):
            left = (arb(PARTS - k) - arb(1) / 2) * step
            moving = (M * (left + arb(0, upper(step / 2)))).exp() * columns
            size = sum((x * x for x in moving.entries()), arb(0)).sqrt()
            found += arb(upper(size)) * step * step * (arb(k) + arb(1) / 2)
        return found


def defect(plant: Plant[Exact], sizes: list[tuple[slice, fmpq, fmpq]], w_rate: fmpq, period: fmpq) -> fmpq:
    """Bound on |delta| of a hold, rounded up to a double; the plant is the continuous one.

    `sizes`: of each block of f its columns, its Lipschitz constant, and sup|q_i'|.
    """
    terms = [arb(constant * rate) * kappa(plant.A, plant.Bf[:, columns], period) for columns, constant, rate in sizes]
    whole = sum(terms, arb(w_rate) * kappa(plant.A, plant.B, period))
    bound: fmpq = printed(upper(whole))
    return bound
