"""Random plants: no claim of a clock-dependent certificate is contradicted by sampled sequences of measurements."""

import functools

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_are
from support.clock import exact
from support.random_specs import contraction, decimals
from support.sweep import SWEEP, rng

import obsdesign as od
from obsdesign.dissipation.engine import Engine
from obsdesign.families.sporadic.clock.analysis import Analysis
from obsdesign.families.sporadic.clock.bernstein import Shape
from obsdesign.families.sporadic.clock.study import fastest
from obsdesign.families.sporadic.clock.theorem import error_system
from obsdesign.families.sporadic.clock.witness import GOALS
from obsdesign.families.sporadic.exponential import design_sporadic
from obsdesign.lmi.formula import in_floats, printed, rational

SEQUENCES, GAPS, PIECES = 50, 12, 2
SIZE = 0.12  # of a block, relative to the plant


def block(random, n):
    """A nonlinearity of a spec, and what draws a linear map of it."""
    kind, size = random.choice(["lipschitz", "slope", "sector", "polytope"]), decimals(random.uniform(0.05, SIZE))
    nq, nf = (1, 1) if kind in {"slope", "sector"} else random.integers(1, 3, 2)
    low = decimals(random.uniform(-SIZE, SIZE))
    corners = np.array(decimals(size * random.normal(size=(3, nf, nq))))
    made = {
        "lipschitz": ({"lipschitz": size}, lambda r: size * contraction(r, nf, nq)),
        "slope": ({"slope": [low, decimals(low + size)]}, lambda r: np.array([[low + size * r.uniform()]])),
        "sector": (
            {"sector": {"K1": low, "K2": decimals(low + size)}},
            lambda r: np.array([[low + size * r.integers(2)]]),
        ),
        "polytope": (
            {"jacobian": corners.tolist()},
            lambda r: np.tensordot(r.dirichlet(np.full(3, 0.3)), corners, axes=1),
        ),
    }[kind]
    section = {
        "type": made[0],
        "Bf": decimals(random.normal(size=(n, nf))),
        "Cq": decimals(random.normal(size=(nq, n))),
    }
    return section, made[1]


class Drawn:
    """A random plant with gains that suit it, and intervals."""

    def __init__(self, seed):
        random = self.random = rng(seed)
        n, self.resets = int(random.integers(1, 7)), bool(random.integers(2))
        ny = int(random.integers(1, min(n, 3) + 1))
        A, B = random.normal(size=(n, n)) / np.sqrt(n), random.normal(size=(n, int(random.integers(1, 3))))
        C = random.normal(size=(ny, n))
        A, B, C = (np.array(decimals(M)) for M in (A, B, C))
        blocks = [block(random, n) for _ in range(random.integers(3))]
        self.members = [member for _, member in blocks]
        L = solve_continuous_are(A.T, C.T, np.eye(n), np.eye(ny)) @ C.T
        T2 = float(f"{random.uniform(0.05, 0.3) / np.linalg.norm(A - L @ C, 2):.3g}")
        T1 = [0.0, T2 / 2, T2][random.integers(3)]
        if self.resets:
            self.gains = {"K": rational(np.round(L * T2 / (1 + np.linalg.norm(C @ L, 2) * T2), 3))}
        else:
            H = -C @ L if random.integers(2) else np.zeros((ny, ny))
            self.gains = {"L": rational(np.round(L, 3)), "H": rational(np.round(H, 3))}
        self.sections = {
            "system": {"A": A.tolist(), "B": B.tolist(), "C": C.tolist()},
            "nonlinearities": [section for section, _ in blocks],
        }
        asked = {"type": "sporadic", "T1": T1, "T2": T2, "decay": 0.01}
        self.spec = od.Spec(name="drawn", **self.sections, observer=asked)
        self.T1, self.T2 = exact(repr(T1)), exact(repr(T2))
        plant = self.spec.augmented
        error = error_system(plant, self.spec.H, self.gains)
        self.analysis = Analysis(Engine(), error, self.spec.multiplier, self.T1, Shape())

    def member(self):
        """A linear map of the class."""
        parts = [member(self.random) for member in self.members]
        whole = np.zeros((sum(len(K) for K in parts), sum(K.shape[1] for K in parts)))
        i = j = 0
        for K in parts:
            whole[i : i + len(K), j : j + K.shape[1]] = K
            i, j = i + len(K), j + K.shape[1]
        return whole

    def run(self, witness, *, switching, noise, disturbed):
        """V(0), V at the end, the energies of z, w and eta, and |x| / |x(0)| exp(rate t) at its largest, of one run."""
        s, random, clock = in_floats(witness.theorem.system), self.random, witness.theorem.clock
        P, rate, m = witness.P[0].astype(float), float(witness.theorem.decay), s.order
        nw = s.Bx.shape[1]
        T1, T2 = max(float(self.T1), float(self.T2) / 50), float(self.T2)
        x, K = random.normal(size=m), self.member()
        gap = random.uniform(0, T2)
        first, energies, largest, t = None, np.zeros(3), 0.0, 0.0
        start = x.copy()
        for _ in range(GAPS):
            for piece in range(PIECES):
                h, tau = gap / PIECES, gap * (1 - piece / PIECES)
                at = clock.at(P, np.array([tau]))[0]
                first = float(x @ at @ x) if first is None else first
                K = self.member() if switching else K
                worst = s.Bx.T @ at @ x / float(witness.numbers["mu"]) if disturbed else np.zeros(nw)
                w = worst * random.choice([0, 1, 1, -2])
                x, z2 = flow(s.F + s.Bfx @ K @ s.Cq, s.Bx @ w, s.Cp, x, h)
                energies += [z2, h * w @ w, 0]
                t += h
                largest = max(largest, np.linalg.norm(x) / np.linalg.norm(start) * np.exp(rate * t))
            eta = noise * random.normal(size=s.Jn.shape[1])
            x, gap = s.J @ x + s.Jn @ eta, random.choice([T1, T2, random.uniform(T1, T2)])
            energies[2] += eta @ eta
            largest = max(largest, np.linalg.norm(x) / np.linalg.norm(start) * np.exp(rate * t))
        return first, float(x @ clock.at(P, np.array([gap]))[0] @ x), energies, largest


def flow(F, b, C, x, h):
    """x(h) of x' = F x + b, and the integral of |C x|^2, by one exponential."""
    m = len(F)
    A = np.zeros((m + 1, m + 1))
    A[:m, :m], A[:m, m] = F, b
    Q = np.zeros_like(A)
    Q[:m, :m] = C.T @ C
    both = expm(np.block([[-A.T, Q], [np.zeros_like(A), A]]) * h)
    step, begin = both[m + 1 :, m + 1 :], np.append(x, 1.0)
    return (step @ begin)[:m], float(begin @ step.T @ both[: m + 1, m + 1 :] @ begin)


@functools.cache
def drawn(seed):
    """A random plant."""
    return Drawn(seed)


def hold(seed):
    """Hold what is proved of a random plant against sampled sequences; return whether something was proved."""
    made = drawn(seed)
    limit = fastest(made.analysis, made.T2, exact("0.01"))
    if limit is None:
        return False
    rate = printed(round(0.5 * limit, 6))
    gamma, overshoot = (
        made.analysis.prove(GOALS[name], made.T2, decay)
        for name, decay in (("gamma", exact("0.01")), ("overshoot", rate))
    )
    if not all(witness and witness.holds for witness in (gamma, overshoot)):
        return False
    bound = float(overshoot.constants()["overshoot"])
    kappa = float(gamma.numbers.get("kappa", 0))
    mu = float(gamma.numbers["mu"])
    for i in range(SEQUENCES):
        switching, noise = bool(i % 2), 0.1 * bool(i % 3) * bool(kappa)
        V0, V1, (z2, w2, eta2), _ = made.run(gamma, switching=switching, noise=noise, disturbed=True)
        gained = V0 + mu * w2 + kappa * eta2
        assert V1 + z2 <= gained * (1 + 1e-9)
        assert -1e-9 * gained <= V1
        *_, largest = made.run(overshoot, switching=switching, noise=0.0, disturbed=False)
        assert largest <= bound * (1 + 1e-9)
    return True


@pytest.mark.sweep
def test_no_claim_is_contradicted_by_sampled_sequences():
    """Of the first of those that the slow test looks at."""
    assert sum(hold(seed) for seed in range(100, 100 + SWEEP.size(6))) >= SWEEP.size(3)


def compared(seed):
    """Least gamma of the clock, and of the propositions, of the same gains; None without such."""
    made = drawn(seed)
    if made.resets or not made.T1:
        return None
    observer = {
        **{"type": "sporadic", "T1": float(made.T1), "T2": float(made.T2), "decay": 0.01, "objective": "min-gamma"},
        "relaxation": "proposition-2",
        "gains": {name: gain.astype(float).tolist() for name, gain in made.gains.items()},
    }
    spec = od.Spec(name="older", **made.sections, observer=observer)
    older = design_sporadic(spec.augmented, spec.multiplier, spec.H, spec.observer, Engine())
    proved = older.claim.guarantee(spec).gamma if older.claim and older.claim.holds else np.inf
    return made.analysis.gamma(made.T2, exact("0.01")), proved


@pytest.mark.slow
@pytest.mark.sweep
def test_no_claim_of_many_plants_is_contradicted():
    """`--sweep 5` looks at 200 plants."""
    assert np.mean([hold(seed) for seed in range(100, 100 + SWEEP.size(40))]) > 0.6


@pytest.mark.slow
@pytest.mark.sweep
def test_nearly_no_gamma_is_worse_than_that_of_the_propositions():
    pairs = [pair for seed in range(100, 100 + SWEEP.size(40)) if (pair := compared(seed))]
    worse = [pair for pair in pairs if pair[0] > pair[1] * (1 + 1e-3)]
    assert len(worse) <= 0.01 * len(pairs), worse
