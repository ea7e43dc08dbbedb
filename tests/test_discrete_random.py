"""Random designs in discrete time: no member of a class, frozen or changing, contradicts what is proved."""

import numpy as np
from scipy.linalg import block_diag
from support.random_specs import in_samples
from support.sweep import rng, seeds

from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families.incremental.design import design
from obsdesign.families.outcome import Verdict
from obsdesign.lmi.formula import in_floats
from obsdesign.spec import Spec

MEMBERS, STEPS = 12, 60
ROUNDING = 1e-9


@seeds(28)
def test_no_member_of_a_class_contradicts_a_claim(seed):
    random = rng(seed)
    family = ["l2", "linf"][seed % 2]
    drawn = in_samples(random, family)
    spec = Spec(**drawn.sections)
    try:
        outcome = design(spec, Engine())
    except (UndecidedError, UsageError):
        return
    if outcome.status is not Verdict.CERTIFIED:
        return
    assert outcome.claim.holds
    errors = Errors(spec, outcome, drawn.kinds)
    for _ in range(MEMBERS):
        errors.judge_frozen(errors.member(random))
    errors.judge_changing(random)


class Errors:
    """Error equations of a design, by hand, and what is claimed of them."""

    def __init__(self, spec, outcome, kinds):
        certificate = outcome.claim.certificate
        self.p, self.H, self.kinds = in_floats(spec.posed), in_floats(spec.H), kinds
        self.L1, self.L2 = outcome.gains["L1"], outcome.gains["L2"]
        self.rho, self.gamma = 1 - float(certificate.rate), float(certificate.gamma)
        self.mu1, self.mu2 = float(certificate.mu1), float(certificate.mu2)
        self.P, self.peaks = certificate.P.astype(float), spec.observer.type == "linf"

    def member(self, random):
        """A member of the class, f = K q."""
        return block_diag(*(kind.member(random) for kind in self.kinds)) if self.kinds else np.zeros((0, 0))

    def closed(self, K):
        """A and B of e+ = A e + B v."""
        p, G = self.p, self.p.Bf + self.L1 @ self.p.Df
        F = np.linalg.solve(np.eye(len(K)) - K @ (p.Dqf + self.L2 @ p.Df), K)
        A = p.A + self.L1 @ p.C + G @ F @ (p.Cq + self.L2 @ p.C)
        return A, -(p.B + self.L1 @ p.D + G @ F @ (p.Dq + self.L2 @ p.D))

    def judge_frozen(self, K):
        """Poles within rho; norms on |z| = rho below gamma, or the exact peak gain of each direction of z."""
        A, B = self.closed(K)
        assert np.abs(np.linalg.eigvals(A)).max() <= self.rho * (1 + 1e-7)
        if not self.peaks:
            for z in self.rho * np.exp(1j * np.linspace(0, np.pi, 100)):
                response = self.H @ np.linalg.solve(z * np.eye(len(A)) - A, B)
                assert np.linalg.norm(response, 2) <= self.gamma * (1 + ROUNDING)
            return
        impulses, X = [], B
        for _ in range(400):
            impulses.append(self.H @ X)
            X = A @ X
        for h in np.vstack([np.eye(len(self.H)), np.linalg.svd(impulses[0])[0].T]):
            assert sum(np.linalg.norm(h @ each) for each in impulses) <= self.gamma * (1 + ROUNDING)

    def judge_changing(self, random):
        """V+ - rho^2 V + .. <= 0 at every step of a run in which the member and v change."""
        e = random.normal(size=len(self.P))
        for _ in range(STEPS):
            A, B = self.closed(self.member(random))
            v = random.normal(size=B.shape[1]) * random.choice([0, 1, 10])
            following = A @ e + B @ v
            V, after, z = e @ self.P @ e, following @ self.P @ following, self.H @ e
            supply = (1 - self.rho**2) * self.mu1 * v @ v if self.peaks else self.mu2 * v @ v - self.mu1 * z @ z
            assert after <= self.rho**2 * V + supply + ROUNDING * (V + abs(supply))
            assert not self.peaks or z @ z <= self.mu2 * V * (1 + ROUNDING)
            e = following
