"""The limit of gamma by a Riccati equation in place of the inequality, where there is one.

For no f, or one Lipschitz block whose scale lambda is fixed (B <- [sqrt(mu / lambda) Bf, -B], D <- [0, -D],
H <- [H; sqrt(lambda) l Cq]), L2 = 0 and Df = 0: with Ab = A / rho, Db = rho D, Ct = [C; H / rho],

    S = Ab S Ab' - (Ab S Ct' + [B Db', 0]) (blkdiag(Db Db', -mu I) + Ct S Ct')^-1 (.)' + B B',    P = mu S^-1,

and gamma^2 = mu is above the limit iff S > 0 is stabilising and mu I - H S H' / rho^2 > 0.
"""

import math

import numpy as np
import pytest
from scipy.linalg import block_diag, expm, ordqz
from scipy.optimize import minimize_scalar
from support.rods import RODS, family, random_plant, rod, rod_spec, written
from support.samples import text

import obsdesign as od
from obsdesign.dissipation.elimination import form_of, least_gamma, least_of, least_over_scale_of
from obsdesign.dissipation.engine import Engine
from obsdesign.families.incremental.design import design
from obsdesign.families.incremental.theorems import DiscreteL2
from obsdesign.lmi.formula import in_floats
from obsdesign.lmi.solve import Status
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
    problem = in_floats(DiscreteL2(spec.posed, spec.multiplier, spec.H, spec.observer.rate, None, spec.observer.L2))
    told, _ = least_over_scale_of(form_of(problem), problem)
    assert math.sqrt(told.mu) == pytest.approx(found.fun, rel=1e-7)
    assert told.gap < 1e-6


def error_of(name, A, B, C, D, rate, H=None):
    """Inequality of a family for samples without f, L1 to be found, in doubles."""
    return family(name, A, B, C, D, rate, H, sampled=True)


CLOSED = [
    # a, b, c, d, rho, gamma
    (0.9, 1, 1, 0.5, 1, 1.096585610),
    (0.5, 0.2, 1, 2, 1, 0.392232270),
    (1.2, 0.3, 2, 1, 1, 0.670820393),
    (0.9, 1, 1, 0.5, 0.95, 1.154300642),
]


@pytest.mark.parametrize(("a", "b", "c", "d", "rho", "gamma"), CLOSED)
def test_one_state_has_the_limit_of_its_formula(a, b, c, d, rho, gamma):
    problem = error_of("l2", a, [[b, 0]], c, [[0, d]], 1 - rho)
    found, _ = least_of(form_of(problem), problem)
    assert math.sqrt(found.mu) == pytest.approx(gamma, rel=1e-8)
    assert found.gap < 1e-8


def test_random_samples_have_the_limits_of_the_inequalities():
    rows = 0
    for seed in range(7):
        A, B, C, D, H, alpha = random_plant(seed)
        step = (1, 0.1, 0.01)[seed % 3]
        for name in ("l2", "linf"):
            problem = error_of(name, expm(A * step), B * step, C, D, -math.expm1(-alpha * step), H)
            told, answer = least_gamma(Engine(), problem), Engine().minimise(problem.least_gamma())
            if told and answer.status is Status.OPTIMAL:
                assert told.objective == pytest.approx(answer.objective, rel=2e-5)
                rows += 1
    assert rows >= 6


@pytest.mark.parametrize("name", ["l2", "linf"])
def test_the_limit_does_not_depend_on_coordinates_and_units(name):
    A, B, C, D, H, _ = random_plant(5)
    A, T, rng = expm(A / 10), np.diag([1e3, 1, 1e-3, 10, 1, 1, 1, 1][: len(A)]), np.random.default_rng(3)
    T = T @ (rng.normal(size=A.shape) + 3 * np.eye(len(A)))
    back, R = np.linalg.inv(T), np.diag(10.0 ** rng.integers(-3, 4, len(C)))
    here = error_of(name, A, B, C, D, 0.03, H)
    there = error_of(name, T @ A @ back, 1e3 * T @ B, R @ C @ back, 1e3 * R @ D, 0.03, H @ back)
    known, found = (least_gamma(Engine(), problem).objective for problem in (here, there))
    assert found == pytest.approx(1e6 * known, rel=1e-5)


def test_an_output_without_noise_is_left_to_the_inequality():
    assert least_gamma(Engine(), error_of("l2", [[0.9, 0.1], [0, 0.8]], [[0], [1]], [[1, 0]], [[0]], 0.0)) is None


def first_missed(p, H, rho, mu):
    """Sample at which no estimate keeps the level any more, from S = 0 on; None if it is kept for good."""
    S, Ab, Ct = 0 * p.A, p.A / rho, np.vstack([p.C, H / rho])
    R = block_diag(rho**2 * p.D @ p.D.T, -mu * np.eye(len(H)))
    for k in range(400):
        inner = R + Ct @ S @ Ct.T
        if np.linalg.eigvalsh(mu * np.eye(len(H)) - H @ S @ H.T / rho**2)[0] <= 0:
            return k
        G = Ab @ S @ Ct.T
        S = Ab @ S @ Ab.T - G @ np.linalg.solve(inner, G.T) + p.B @ p.B.T
    return None


def test_a_rod_of_20_cells_in_samples_has_its_limit_and_gains_that_are_proved():
    spec = od.load(rod_spec(20, "{type: l2, alpha: 1.0e-4}").replace("system:", "system:\n  discretise: {period: 0.1}"))
    made = od.solve(spec)
    assert made.proved
    assert made.result["solver"]["engine"] == "riccati"
    assert made.result["solver"]["solves"] == 0
    assert made.limit["attained"]
    p, H, gamma = in_floats(spec.posed), in_floats(spec.H), made.limit["gamma"]
    rho = float(1 - spec.observer.rate)
    assert first_missed(p, H, rho, (gamma * 0.999) ** 2) is not None
    assert first_missed(p, H, rho, (gamma * 1.001) ** 2) is None
    assert made.result["guarantee"]["gamma"] <= 1.05 * gamma * (1 + 1e-5)


def test_a_large_plant_with_one_nonlinearity_is_searched_over_its_scale():
    A, B, C, D = rod(12, *RODS[12])
    spring = [(-np.eye(12)[3], np.eye(12)[3], (0, 1.5))]
    spec = written(A, B, C, D, spring, 0.01).replace("system:", "system:\n  discretise: {period: 0.1}")
    made = od.solve(od.load(spec))
    assert made.proved
    assert made.result["solver"]["engine"] == "riccati"
    assert made.limit["gap"] < 1e-5


def test_the_peak_of_a_large_plant_has_central_gains_as_well():
    spec = rod_spec(12, "{type: linf, rho: .95}").replace("system:", "system:\n  discretise: {period: 0.1}")
    made = od.solve(od.load(spec))
    assert made.proved
    assert made.result["solver"]["engine"] == "riccati"


def test_a_limit_of_one_state_with_little_noise_is_its_closed_form():
    """With y known, e+ = w: sup|e| of e+ = rho e + .. is 1 / sqrt(1 - rho^2) times that of w."""
    system = {"time": "discrete", "period": 0.1, "A": 0.5, "B": [[1, 0]], "C": 1, "D": [[0, 1e-7]]}
    limit = od.solve(od.Spec(system=system, observer={"type": "linf", "rho": 0.5})).limit
    assert limit["gamma"] == pytest.approx(1 / math.sqrt(0.75), rel=1e-6)


@pytest.mark.parametrize("unit", [1.0, 1e7])
def test_a_stable_plant_is_not_called_infeasible_where_its_outputs_are_almost_exact(unit):
    """With rho = 1 the gain 0 would do, in every unit of y; B w of the last step is in the error whatever the gain."""
    C, D = np.array([[1, 0], [0.3, 1]]) * unit, np.array([[0, 1e-8, 0], [0, 0, 1e-8]]) * unit
    system = {"time": "discrete", "period": 0.1, "A": [[0.5, 0], [0, 0.3]], "B": [[1, 0, 0], [0.5, 0, 0]]}
    spec = od.Spec(system=system | {"C": C, "D": D}, observer={"type": "l2", "rho": 1})
    design = od.solve(spec)
    assert design.status == "certified"
    assert design.limit["kind"] == "best-found"
    assert math.hypot(1, 0.5) < design.limit["gamma"] < design.guarantee.gamma < 1.2
