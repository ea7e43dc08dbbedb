"""The L-infinity family: closed forms, its theorem in another modeling language, frozen slopes, searches over alpha."""

import math
from dataclasses import replace

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from support.fractions import fractions, positive
from support.linf import CUBIC, SCALAR, arm, family_of, least_gamma
from support.sweep import examples

from obsdesign.dissipation.certificate import certify
from obsdesign.errors import UsageError
from obsdesign.lmi.formula import in_floats, rational
from obsdesign.reading import loads
from obsdesign.work import solve

# The cubic example (47)


@pytest.mark.parametrize("p", [10, 100, 1000])
def test_with_a_bounded_storage_function_the_limit_of_the_cubic_example_is_its_inverse_root(p):
    made = solve(loads(CUBIC % f"L2: -1, alpha: 0.5, bounds: {{P: {p}}}"))
    assert made.status == "certified"
    assert made.limit["gamma"] == 0
    assert made.limit_bounded["gamma"] == pytest.approx(p**-0.5, rel=1e-3)
    assert made.claim.certificate.guarantee.gamma <= 1.05 * made.limit_bounded["gamma"]


def test_the_cubic_example_is_feasible_up_to_a_decay_of_one():
    made = solve(loads(CUBIC % "L2: -1, alpha: 1.05"))
    assert made.status == "infeasible"
    assert made.diagnosis["feasible"]["alpha"] == pytest.approx(1, rel=1e-4)
    fastest = solve(loads(CUBIC % "L2: -1, alpha: {min: 0.1, max: 5}, objective: max-alpha"))
    assert fastest.status == "certified"
    assert fastest.limit["alpha"] == pytest.approx(1, rel=1e-4)


@pytest.mark.parametrize(("alpha", "L2"), [("1e-6", "0"), ("0.3", "0.5"), ("1", "0")])
def test_the_cubic_example_has_no_solution_as_it_is_printed(alpha, L2):
    made = solve(loads(CUBIC % f"L2: {L2}, alpha: {alpha}"))
    assert (made.status, made.gains, made.claim) == ("infeasible", {}, None)


@pytest.mark.parametrize("L2", [-0.9, -1.0182, -1.1])
@pytest.mark.parametrize("alpha", [0.1, 0.8])
def test_another_injection_limits_the_scale_of_the_cubic(L2, alpha):
    """lambda = P22 <= 4 alpha (-L2 - alpha) / (1 + L2)^2, and gamma^2 >= 1 / P22 for H = I, which is attained."""
    largest = 4 * alpha * (-L2 - alpha) / (1 + L2) ** 2
    found = least_gamma(family_of(loads(CUBIC % f"L2: {L2}, alpha: {alpha}")))
    assert found == pytest.approx(largest**-0.5, rel=1e-5)


def test_the_injection_of_the_cubic_must_exceed_the_decay():
    assert solve(loads(CUBIC % "L2: -0.5, alpha: 0.49")).status == "certified"
    assert solve(loads(CUBIC % "L2: -0.5, alpha: 0.51")).status == "infeasible"


def test_the_limit_of_zero_of_the_cubic_example_is_refused_with_a_table():
    with pytest.raises(UsageError) as caught:
        solve(loads(CUBIC % "L2: -1, alpha: 0.5"))
    rows = [row.split() for row in caught.value.problems[0].rows]
    assert len(rows) > 3
    assert [float(row[-1]) for row in rows] == pytest.approx([(2 * float(row[2])) ** -0.5 for row in rows], rel=0.05)


# Scalar closed forms

sizes = st.floats(0.1, 10).map(lambda x: round(x, 3))


@given(a=sizes, share=st.floats(0.05, 0.95))
@examples(12)
def test_the_least_gamma_of_a_scalar_error(a, share):
    """e' = -a e - w: P = 4 alpha (a - alpha) at most."""
    alpha = round(a * share, 6)
    found = least_gamma(family_of(loads(SCALAR % (a, 0, f"alpha: {alpha}"))))
    assert found == pytest.approx(1 / math.sqrt(4 * alpha * (a - alpha)), rel=1e-4)


@pytest.mark.parametrize(("a", "k"), [(2, 0), (3, 1), (1, 0.9), (0.05, 0.01)])
def test_the_best_decay_of_a_scalar_error_is_half_its_slowest_pole(a, k):
    """Over alpha the limit is the true gain 1 / (a - k) of f = k q."""
    made = solve(loads(SCALAR % (a, k, "alpha: {min: 0.001, max: 10, log: true}")))
    assert made.status == "certified"
    assert made.limit["gamma"] == pytest.approx(1 / (a - k), rel=1e-4)
    assert float(made.claim.certificate.rate) == pytest.approx((a - k) / 2, rel=0.02)
    assert made.claim.certificate.guarantee.gamma <= 1.05 / (a - k) * (1 + 1e-4)


def test_given_gains_are_certified_at_the_least_gamma_that_they_achieve():
    made = solve(loads(SCALAR % (3, 1, "alpha: 0.7, gains: {L1: [[0]], L2: [[0]]}")))
    assert made.status == "certified"
    assert made.claim.certificate.guarantee.gamma == pytest.approx(1 / math.sqrt(4 * 0.7 * 1.3), rel=1e-3)


# Frozen slopes: a linear error system of the class, whose peak gain is the integral of |h|


def error_system(plant, L1, L2, slope):
    loop = slope / (1 - (plant.Dqf + L2 @ plant.Df).item() * slope)
    F, G = plant.Bf + L1 @ plant.Df, plant.B + L1 @ plant.D
    A = plant.A + L1 @ plant.C + loop * F @ (plant.Cq + L2 @ plant.C)
    return A, -G - loop * F @ (plant.Dq + L2 @ plant.D)


def peak_gains(A, B, H):
    """Integral of |H_i exp(A t) B| for one input; a lower bound of the gain from sup|w| to sup|z|."""
    poles = np.linalg.eigvals(A)
    assert poles.real.max() < 0
    step = 0.05 / abs(poles).max()
    advance, x, total = expm(A * step), expm(A * step / 2) @ B, 0.0
    for _ in range(min(int(12 / -poles.real.max() / step), 200_000)):
        total = total + step * abs(H @ x)
        x = advance @ x
    return total


@pytest.mark.parametrize(
    "spec",
    [
        arm(bounds="{L1: 20}"),
        arm(D=0.4, Dqf=0.2, Dq=0.1, Df=0.1, bounds="{L1: 20}"),
        arm(alpha="{min: 0.05, max: 2, points: 8}", L2="free", Dq=0.1, Df=0.1, bounds="{L1: 20}"),
        arm(disturbance="integrator", alpha="0.1", D=0.2, bounds="{L1: 40}"),
        arm(disturbance="{sinusoid: {omega: 2}}", alpha="0.05", D=0.2, bounds="{L1: 200}"),
        arm(objective="max-alpha", alpha="{min: 0.1, max: 0.5}", D=0.3),
        arm(objective="pareto", alpha="{min: 0.1, max: 2, points: 6}", D=0.3, bounds="{L1: 20}"),
        arm(objective="feasibility", D=0.3),
        arm(objective="{gamma: 1.5}", D=0.3, bounds="{L1: 50}"),
    ],
    ids=["plain", "all terms", "free", "integrator", "sinusoid", "max-alpha", "pareto", "feasibility", "gamma"],
)
def test_every_frozen_slope_keeps_the_guarantee(spec):
    made = solve(spec)
    assert made.status == "certified"
    plant, H, proof = in_floats(spec.augmented), in_floats(spec.H), made.claim.certificate.guarantee
    ratios = []
    for slope in (-0.4, 0, 0.35, 1.1):
        A, B = error_system(plant, made.gains["L1"], made.gains["L2"], slope)
        assert np.linalg.eigvals(A).real.max() <= -proof.rate * (1 - 1e-9)
        ratios.append(peak_gains(A, B, H).max() / proof.gamma)
        assert np.linalg.norm(H @ np.linalg.solve(A, B)) <= proof.gamma
    assert 0.01 < max(ratios) <= 1


# Certificates, by a few lines of fractions


def proved_by_fractions(spec, certificate, gains, slope=("-2/5", "11/10")):
    """(13a) and (13b) in the primitive form: V' + 2 alpha V - 2 alpha mu1 |v|^2 plus the multiplier, in (e, f, v)."""
    p = spec.augmented
    A, B, C, D, Bf, Df, Cq, Dqf, Dq, H = map(fractions, (p.A, p.B, p.C, p.D, p.Bf, p.Df, p.Cq, p.Dqf, p.Dq, spec.H))
    L1, L2, P = map(fractions, (gains["L1"], gains["L2"], certificate.P))
    lam, (low, high) = fractions(certificate.multipliers["lambda1"]).item(), fractions(slope)
    alpha, mu1, mu2, gamma = fractions([certificate.rate, certificate.mu1, certificate.mu2, certificate.gamma])
    rate = np.hstack([A + L1 @ C, Bf + L1 @ Df, -(B + L1 @ D)])
    q = np.hstack([Cq + L2 @ C, Dqf + L2 @ Df, -(Dq + L2 @ D)])
    e, f, v = np.split(fractions(np.eye(len(A) + 2, dtype=int)), [len(A), len(A) + 1])
    half = e.T @ P @ (rate + alpha * e) - alpha * mu1 * v.T @ v + lam * (f - low * q).T @ (high * q - f)
    conditions = positive(-(half + half.T)), positive(mu2 * P - H.T @ H)
    return lam >= 0 and mu1 * mu2 <= gamma * gamma and all(conditions)


@pytest.fixture(scope="module")
def arm_made():
    """A design with every term of the plant, certified."""
    spec = arm(D=0.4, Dqf=0.2, Dq=0.1, Df=0.1, bounds="{L1: 20}")
    return spec, solve(spec)


def test_a_certificate_is_proved_again_by_fractions(arm_made):
    spec, made = arm_made
    assert proved_by_fractions(spec, made.claim.certificate, made.gains)


@pytest.mark.parametrize(
    "change",
    [
        {"gamma": fmpq(1, 2)},
        {"mu1": fmpq(1, 2)},
        {"mu2": fmpq(9, 10)},
        {"mu1": fmpq(0)},
        {"mu1": fmpq(-1), "mu2": fmpq(-1)},
        {"gamma": fmpq(-1)},
        {"P": fmpq(-1)},
        {"P": fmpq(2)},
        {"P": fmpq(1, 2)},
        {"lambda1": fmpq(-1)},
        {"lambda1": fmpq(0)},
        {"lambda1": fmpq(3)},
        {"alpha": fmpq(10)},
        {"alpha": fmpq(-1)},
        {"L1": fmpq(3, 2)},
    ],
    ids=str,
)
def test_a_certificate_does_not_survive_a_change(arm_made, change):
    spec, made = arm_made
    proof, exact = made.claim.certificate, {name: rational(np.vectorize(repr)(M)) for name, M in made.gains.items()}

    def scaled(name, value):
        return change.get(name, fmpq(1)) * value

    family = replace(family_of(spec), rate=scaled("alpha", proof.rate), L1=scaled("L1", exact["L1"]), L2=exact["L2"])
    values = {"P": scaled("P", proof.P), "lambda1": scaled("lambda1", proof.multipliers["lambda1"])}
    assert not certify(family, *(scaled(k, getattr(proof, k)) for k in ("gamma", "mu1", "mu2")), values).holds
    same = replace(family_of(spec), L1=exact["L1"], L2=exact["L2"])
    values = {"P": proof.P, **proof.multipliers}
    assert certify(same, proof.gamma, proof.mu1, proof.mu2, values).holds


def test_levels_may_be_shared_otherwise_between_mu1_and_mu2(arm_made):
    """P / s, mu1 s and mu2 s^-1 .. of the same claim: only the product of the levels counts."""
    spec, made = arm_made
    proof, s = made.claim.certificate, fmpq(7, 3)
    exact = {name: rational(np.vectorize(repr)(M)) for name, M in made.gains.items()}
    family = replace(family_of(spec), **exact)
    values = {"P": s * proof.P, "lambda1": s * proof.multipliers["lambda1"]}
    assert certify(family, proof.gamma, s * proof.mu1, proof.mu2 / s, values).holds
    assert not certify(family, proof.gamma, proof.mu1, proof.mu2 / s, values).holds
