"""The theorem of the L-infinity family in another modeling language, for every type of nonlinearity."""

import json
import math

import numpy as np
import pytest
from scipy.linalg import null_space
from support.linf import family_of, least_gamma

from obsdesign.reading import loads

EYE, K, W = np.eye(2), np.array([[0.2, 0.3], [-0.1, 0.1]]), np.array([[0.5, 0.1], [0, 0.4]])
VERTICES = [np.array(V) for V in ([[0.5, 0], [0, 0.2]], [[0, 0.5], [-0.5, 0]], [[-0.3, 0.1], [0.2, -0.4]])]
RAYS = [np.diag([1.0, 0.0]), np.diag([0.0, 1.0])]
OWN = np.array([[0.5, 0.1, 0.2, 0], [0.1, 0.4, 0, 0.3], [0.2, 0, -1, 0], [0, 0.3, 0, -1.5]])
SECTOR = np.vstack([-K.T, EYE]) @ np.hstack([K + W, -EYE])
PASSIVE = ("monotone", "cone")


def text(M):
    return json.dumps(np.atleast_2d(M).tolist())


def ray_of(*M11_M12_M22):
    """A template of one scale."""
    M11, M12, M22 = M11_M12_M22
    M = np.block([[M11, M12], [M12.T, M22]])

    def make(cp):
        scale = cp.Variable(nonneg=True)
        return scale * M, []

    return make


def componentwise(cp):
    scales = cp.diag(cp.Variable(2, nonneg=True))
    return cp.bmat([[1.2 * scales, 0.7 * scales], [0.7 * scales, -2 * scales]]), []


def one_sided(cp):
    a, b = cp.Variable(nonneg=True), cp.Variable(nonneg=True)
    return cp.bmat([[(-0.4 * a + b) * EYE, (-a - 0.25 * b) * EYE], [(-a - 0.25 * b) * EYE, -b * EYE]]), []


def polytope(cp):
    M = cp.Variable((4, 4), symmetric=True)
    maps = [np.vstack([EYE, V]) for V in VERTICES]
    return M, [M[2:, 2:] << 0, *(G.T @ M @ G >> 0 for G in maps)]


def conic(cp):
    M11, M12 = cp.Variable((2, 2), symmetric=True), cp.Variable((2, 2))
    forms = [M12 @ ray + (M12 @ ray).T >> 0 for ray in RAYS]
    return cp.bmat([[M11, M12], [M12.T, np.zeros((2, 2))]]), [M11 >> 0, *forms]


KINDS = {
    "lipschitz": ("{lipschitz: 0.8}", ray_of(0.64 * EYE, 0 * EYE, -EYE)),
    "monotone": ("monotone", ray_of(0 * EYE, EYE, 0 * EYE)),
    "slope": ("{slope: [-0.5, 1.2]}", componentwise),
    "sector": (
        f"{{sector: {{K1: {text(K)}, K2: {text(K + W)}}}}}",
        ray_of(SECTOR[:2, :2] + SECTOR[:2, :2].T, SECTOR[:2, 2:] + SECTOR[2:, :2].T, -2 * EYE),
    ),
    "cocoercive": ("{cocoercive: 1.5}", ray_of(0 * EYE, EYE, -2 / 1.5 * EYE)),
    "ball": (f"{{ball: {{K: {text(K)}, W: {text(W)}}}}}", ray_of(W.T @ W - K.T @ K, K.T, -EYE)),
    "one-sided": ("{one-sided-lipschitz: {rho: -0.2, beta: 1, phi: -0.5}}", one_sided),
    "jacobian": (f"{{jacobian: [{', '.join(map(text, VERTICES))}]}}", polytope),
    "cone": (f"{{cone: [{', '.join(map(text, RAYS))}]}}", conic),
    "multiplier": (f"{{multiplier: {text(OWN)}}}", ray_of(OWN[:2, :2], OWN[:2, 2:], OWN[2:, 2:])),
}
SYSTEM = """
obsdesign: 1
system: {{A: {A}, B: {B}, C: {C}, D: {D}}}
nonlinearities: [{{type: {type}, Bf: {Bf}, Cq: {Cq}, Dq: {Dq}, Df: {Df}}}]
performance: {{H: {H}}}
observer: {{type: linf, L2: {L2}, alpha: {alpha}}}
"""


def drawn(kind, seed):
    """A system of three states, and a spec of it; a passive nonlinearity is made to satisfy its equality."""
    rng = np.random.default_rng(seed)

    def entries(*shape):
        return rng.integers(-15, 16, shape) / 10

    s = {"A": entries(3, 3) - 1.5 * EYE3, "B": entries(3, 2), "C": entries(2, 3), "Cq": entries(2, 3)}
    s |= {"L2": 0.3 * entries(2, 2), "H": entries(2, 3)}
    if kind in PASSIVE:
        s |= {"A": s["A"] - EYE3, "Bf": -(s["Cq"] + s["L2"] @ s["C"]).T}
        s |= {name: np.zeros((2, 2)) for name in ("D", "Dq", "Df")}
    else:
        s |= {"Bf": 0.3 * entries(3, 2), "D": entries(2, 2), "Dq": 0.3 * entries(2, 2), "Df": 0.2 * entries(2, 2)}
    s = {name: M.round(6) for name, M in s.items()}
    alpha = [0.1, 0.3, 0.8][seed % 3]
    written = {name: text(M) for name, M in s.items()}
    return s, alpha, loads(SYSTEM.format(**written, type=KINDS[kind][0], alpha=alpha))


EYE3 = np.eye(3)


def printed_theorem(s, kind, alpha):
    """Least mu1 of (13a), (13b) for mu2 = 1, without Y; None where the solver is not sure."""
    import cvxpy as cp

    P, mu = cp.Variable((3, 3), symmetric=True), cp.Variable()
    M, constraints = KINDS[kind][1](cp)
    Ce, Df, D = s["Cq"] + s["L2"] @ s["C"], s["L2"] @ s["Df"], -(s["Dq"] + s["L2"] @ s["D"])
    G = np.block([[Ce, Df, D], [np.zeros((2, 3)), EYE, np.zeros((2, 2))]])
    zero = np.zeros((2, 2))
    PBf, PB = P @ s["Bf"], -P @ s["B"]
    form = cp.bmat([[P @ s["A"] + s["A"].T @ P + 2 * alpha * P, PBf, PB], [PBf.T, zero, zero], [PB.T, zero, zero]])
    form += G.T @ M @ G - 2 * alpha * mu * np.diag([0, 0, 0, 0, 0, 1, 1])
    if kind in PASSIVE:
        constraints.append(PBf + Ce.T @ M[:2, 2:] == 0)
        N = np.zeros((7, 3))
        N[:3, :1], N[5:, 1:] = null_space(s["C"]), EYE
    else:
        N = null_space(np.hstack([s["C"], s["Df"], -s["D"]]))
        constraints.append(symmetrized(form[3:, 3:]) << 0)
    constraints += [symmetrized(N.T @ form @ N) << 0, P >> s["H"].T @ s["H"]]
    problem = cp.Problem(cp.Minimize(mu), constraints)
    try:
        problem.solve(solver="CLARABEL")
    except cp.SolverError:
        return None
    return problem.value if problem.status == "optimal" else None


def symmetrized(X):
    return (X + X.T) / 2


@pytest.mark.filterwarnings("ignore:Solution may be inaccurate")
@pytest.mark.parametrize("kind", KINDS)
def test_the_least_gamma_is_that_of_the_theorem_in_another_modeling_language(kind):
    compared = 0
    for seed in range(3):
        s, alpha, spec = drawn(kind, seed)
        expected = printed_theorem(s, kind, alpha)
        if expected is None or expected < 1e-3:
            continue
        assert least_gamma(family_of(spec)) == pytest.approx(math.sqrt(expected), rel=3e-3)
        compared += 1
    assert compared >= 1
