"""The limit of gamma by a Riccati equation in place of the inequality, where there is one.

For no f, or one Lipschitz block whose scale lambda is fixed (B <- [sqrt(mu / lambda) Bf, -B], D <- [0, -D],
H <- [H; sqrt(lambda) l Cq]), L2 = 0 and Df = 0: with Ab = A / rho, Db = rho D, Ct = [C; H / rho],

    S = Ab S Ab' - (Ab S Ct' + [B Db', 0]) (blkdiag(Db Db', -mu I) + Ct S Ct')^-1 (.)' + B B',    P = mu S^-1,

and gamma^2 = mu is above the limit iff S > 0 is stabilising and mu I - H S H' / rho^2 > 0.
"""

import numpy as np
import pytest
from scipy.linalg import block_diag, ordqz
from scipy.optimize import minimize_scalar
from support.samples import text

from obsdesign.dissipation.engine import Engine
from obsdesign.families.incremental.design import design
from obsdesign.lmi.formula import in_floats
from obsdesign.reading import loads


def stabilising(A, B, C, D, H, rho, mu):
    """Stabilising S of the equation and its gain by the doubling of structure; None if there is none.

    `scipy.linalg.solve_discrete_are` answers wrongly below the limit, and without an error, so that what is found is
    held against the equation.
    """
    n, ny = len(A), len(C)
    Ab, Ct = A / rho, np.vstack([C, H / rho])
    R = block_diag(rho**2 * D @ D.T, -mu * np.eye(len(H)))
    cross = np.hstack([rho * B @ D.T, np.zeros((n, len(H)))])
    m = len(Ct)
    zero = np.zeros
    left = np.block([[Ab.T, zero((n, n)), Ct.T], [-B @ B.T, np.eye(n), -cross], [cross.T, zero((m, n)), R]])
    right = np.block(
        [[np.eye(n), zero((n, n)), zero((n, m))], [zero((n, n)), Ab, zero((n, m))], [zero((m, n)), -Ct, zero((m, m))]]
    )
    _, _, alpha, beta, _, Z = ordqz(left, right, sort="iuc", output="complex")
    if (np.abs(alpha) < np.abs(beta)).sum() < n:
        return None
    X = Z[:, :n]
    try:
        S = np.real(X[n : 2 * n] @ np.linalg.inv(X[:n]))
    except np.linalg.LinAlgError:
        return None
    S = (S + S.T) / 2
    inner = R + Ct @ S @ Ct.T
    K = np.linalg.solve(inner, (Ab @ S @ Ct.T + cross).T).T
    residual = Ab @ S @ Ab.T - K @ inner @ K.T + B @ B.T - S
    good = (
        np.abs(residual).max() < 1e-9 * max(1.0, np.abs(S).max())
        and np.abs(np.linalg.eigvals(Ab - K @ Ct)).max() < 1
        and (np.linalg.eigvalsh(inner) > 0).sum() == ny
    )
    return S if good else None


def reachable(A, B, C, D, H, rho, mu):
    """Whether gamma^2 = mu is above the limit of predicted estimates."""
    S = stabilising(A, B, C, D, H, rho, mu)
    if S is None or np.linalg.eigvalsh(S).min() <= 0:
        return False
    return bool(np.linalg.eigvalsh(mu * np.eye(len(H)) - H @ S @ H.T / rho**2).min() > 0)


def limit(test, low, high):
    """Least gamma by halves."""
    assert test(high**2)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if test(middle**2) else (middle, high)
    return high


@pytest.mark.parametrize(("plant", "rho"), [("R1", 1), ("R1", 0.97), ("R2", 1)])
def test_without_f_the_limit_is_that_of_the_riccati_equation(plant, rho):
    spec = loads(text(plant, f"type: l2, rho: {rho}"))
    p, H = in_floats(spec.posed), in_floats(spec.H)
    found = limit(lambda mu: reachable(p.A, -p.B, p.C, -p.D, H, rho, mu), 1e-3, 10)
    assert design(spec, Engine()).limit["gamma"] == pytest.approx(found, rel=1e-7)


@pytest.mark.parametrize(("constant", "rho"), [(0.8, 1), (0.5, 0.95), (2, 0.95)])
def test_with_a_lipschitz_block_it_is_the_least_over_its_scale(constant, rho):
    spec = loads(text("R3", f"type: l2, rho: {rho}", L=constant))
    p, H = in_floats(spec.posed), in_floats(spec.H)

    def at(logarithm):
        scale = np.exp(logarithm)

        def test(mu):
            B = np.hstack([np.sqrt(mu / scale) * p.Bf, -p.B])
            D = np.hstack([np.zeros((len(p.C), 1)), -p.D])
            return reachable(p.A, B, p.C, D, np.vstack([H, np.sqrt(scale) * constant * p.Cq]), rho, mu)

        return limit(test, 1e-3, 100) if test(1e4) else 100.0

    found = minimize_scalar(at, bounds=(-8, 4), method="bounded", options={"xatol": 1e-6})
    assert design(spec, Engine()).limit["gamma"] == pytest.approx(found.fun, rel=1e-6)
