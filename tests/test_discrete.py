"""Designs in discrete time against limits that were derived and computed apart from this project."""

import math

import numpy as np
import pytest
from flint import arb, fmpq
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from support.samples import text

from obsdesign.dissipation.analysis import members
from obsdesign.dissipation.engine import Engine
from obsdesign.families.incremental.design import design
from obsdesign.families.outcome import Verdict
from obsdesign.families.rates import step
from obsdesign.lmi.formula import in_floats
from obsdesign.model.edge import Edge, schur
from obsdesign.reading import loads

LIMITS = [
    ("K1", "type: l2, rho: .95", 2.008692342),
    ("K1", "type: l2, rho: 1", 0.872782550),
    ("K1", "type: l2, rho: .95, L2: free", 2.003251790),
    ("K1", "type: l2, rho: .95, estimate: filtered", 2.005462984),
    ("K2", "type: l2, rho: .9", 0.221054315),
    ("K2", "type: l2, rho: .9, L2: [[-1, 0], [0, 0]]", 0.166662373),
    ("K3", "type: l2, rho: .98", 0.701821081),
    ("K3", "type: l2, rho: .98, L2: free", 0.687767877),
    ("K4", "type: l2, rho: .98", 0.543574688),
    ("K4", "type: l2, rho: .98, L2: free", 0.476257807),
    ("K5", "type: l2, rho: .95", 0.179365727),
    ("K5", "type: l2, rho: .95, L2: [[.5]]", 0.189775833),
    ("K5", "type: l2, rho: .95, L2: free", 0.172195330),
    ("K6", "type: l2, rho: .95", 0.264565569),
    ("K7", "type: l2, rho: .999", 0.203161001),
    ("K7", "type: l2, rho: .999, estimate: filtered", 0.201092212),
    ("K8", "type: l2, rho: .95, estimate: filtered, L2: [[0, -10]]", 0.169951022),
    ("K8", "type: l2, rho: .95, estimate: filtered, L2: [[0, -3]]", 0.252174895),
    ("K8", "type: l2, rho: .95, estimate: filtered, L2: free", 0.159138778),
    ("R1", "type: l2, rho: 1", 0.499230177),
    ("R1", "type: l2, rho: .97", 0.641726348),
    ("R2", "type: l2, rho: 1", 0.600188650),
]


@pytest.mark.parametrize(("plant", "observer", "limit"), LIMITS)
def test_the_limit_is_that_of_the_reference_and_gains_near_it_are_proved(plant, observer, limit):
    made = design(loads(text(plant, f"{observer}, slack: .01")), Engine())
    assert made.status is Verdict.CERTIFIED
    assert made.limit["gamma"] == pytest.approx(limit, rel=1e-6)
    assert float(made.claim.certificate.gamma) <= limit * (1 + 0.01 + 1e-6)
    assert np.linalg.norm(made.gains["L1"]) < 1e4


PEAKS = [
    ("type: linf, rho: {min: .6, max: .95, points: 9}", 0.410986081),
    ("type: linf, estimate: filtered", 0.367306703),
]


def made(plant, observer, **values):
    """Outcome of a design, its spec, and the plant of its errors in doubles."""
    spec = loads(text(plant, observer, **values))
    return design(spec, Engine()), spec


@pytest.mark.parametrize(("observer", "limit"), PEAKS)
def test_the_best_decay_of_a_peak_is_found(observer, limit):
    outcome, _ = made("Q1", observer)
    assert outcome.status is Verdict.CERTIFIED
    assert outcome.limit["gamma"] == pytest.approx(limit, rel=1e-5)
    assert outcome.limit["at"]["rho"] == pytest.approx(0.80, abs=0.01)
    assert outcome.search.parameter == "rho"


def test_a_free_L2_gains_nothing_at_the_peak_of_a_saturation():
    outcome, _ = made("Q1", "type: linf, rho: .80309, L2: free")
    assert outcome.limit["gamma"] == pytest.approx(0.410986081, rel=1e-5)


@pytest.mark.parametrize(
    ("rho", "gamma"), [(0.9987, 3.41), (0.97, 0.744), (0.916, 0.490), (0.767, 0.416), (0.353, 1.16)]
)
def test_the_curve_of_peaks(rho, gamma):
    outcome, _ = made("Q1", f"type: linf, rho: {rho}")
    assert outcome.limit["gamma"] == pytest.approx(gamma, rel=5e-3)


@pytest.mark.parametrize(
    ("constant", "rho", "estimate", "gamma"),
    [
        (0.8, 1, "predicted", 0.599741130),
        (0.5, 0.95, "predicted", 0.730880428),
        (0.8, 0.95, "predicted", 0.801892757),
        (2, 0.95, "predicted", 1.533999592),
        (0.8, 0.95, "filtered", 0.774784286),
        (0.5, 0.95, "filtered", 0.731455),
    ],
)
def test_lipschitz_blocks(constant, rho, estimate, gamma):
    outcome, _ = made("R3", f"type: l2, rho: {rho}, estimate: {estimate}", L=constant)
    assert outcome.limit["gamma"] == pytest.approx(gamma, rel=1e-6)


def test_filtered_estimates_may_be_worse_than_predicted_ones():
    """With rho < 1 the next sample weighs 1 / rho more."""
    gammas = [
        made("R3", f"type: l2, rho: .95, estimate: {e}", L=0.5)[0].limit["gamma"] for e in ("predicted", "filtered")
    ]
    assert gammas[1] > gammas[0]


def scalar(a, b, c, d, observer):
    plant = f"system: {{time: discrete, A: {a}, B: [[{b}, 0]], C: {c}, D: [[0, {d}]]}}"
    return design(loads(f"obsdesign: 1\n{plant}\nobserver: {{{observer}}}\n"), Engine())


def closed_form(a, b, c, d, rho, *, filtered):
    if filtered:
        return abs(b * d) / math.hypot(rho * b * c, d * (rho - a)) if a <= rho else abs(d) / (abs(c) * rho)
    if a * d * d * (rho - a) <= b * b * c * c:
        return math.hypot(b, a * d / c) / rho
    return abs(b * d) / math.hypot(b * c, d * (rho - a))


@pytest.mark.parametrize(
    ("a", "b", "c", "d", "rho", "predicted", "filtered"),
    [
        (0.9, 1, 1, 0.5, 1, 1.096585610, 0.499376169),
        (0.5, 0.2, 1, 2, 1, 0.392232270, None),
        (1.2, 0.3, 2, 1, 1, 0.670820393, 0.5),
        (0.9, 1, 1, 0.5, 0.95, 1.154300642, 0.526133742),
        (0.5, 0.2, 1, 2, 0.9, 0.485071, 0.487805),
    ],
)
def test_scalar_plants_have_a_closed_form(a, b, c, d, rho, predicted, filtered):
    for estimate, known in (("predicted", predicted), ("filtered", filtered)):
        exact = closed_form(a, b, c, d, rho, filtered=estimate == "filtered")
        assert known is None or exact == pytest.approx(known, rel=1e-6)
        outcome = scalar(a, b, c, d, f"type: l2, rho: {rho}, estimate: {estimate}")
        assert outcome.limit["gamma"] == pytest.approx(exact, rel=1e-7)


@given(
    a=st.floats(0.05, 1.3), b=st.floats(0.1, 3), c=st.floats(0.2, 2), d=st.floats(0.1, 3), rho=st.floats(0.7, 1),
    estimate=st.sampled_from(["predicted", "filtered"]),
)  # fmt: skip
def test_any_scalar_plant_meets_its_closed_form(a, b, c, d, rho, estimate):
    a, b, c, d, rho = (round(x, 3) for x in (a, b, c, d, rho))
    outcome = scalar(a, b, c, d, f"type: l2, rho: {rho}, estimate: {estimate}")
    exact = closed_form(a, b, c, d, rho, filtered=estimate == "filtered")
    assert outcome.limit["gamma"] == pytest.approx(exact, rel=2e-6)


SLOPES = """
obsdesign: 1
system: {{time: discrete, A: .5, B: {b}, C: {c}}}
nonlinearities: [{{type: {{slope: {slope}}}, Bf: 1, Cq: 1}}]
observer: {{type: l2, rho: {rho}, L2: {L2}}}
"""


@pytest.mark.parametrize(
    ("slope", "rho", "c", "L2", "gamma"),
    [("[-.2, .3]", 0.95, 0, 0, 4 / 3), ("[0, .6]", 0.9, 1, 0, 1 / 3), ("[0, .6]", 0.9, 1, -1, 0.2 / 0.9)],
)
def test_scalar_slopes_have_a_closed_form(slope, rho, c, L2, gamma):
    outcome = design(loads(SLOPES.format(b=0.2, slope=slope, rho=rho, c=c, L2=L2)), Engine())
    assert outcome.limit["gamma"] == pytest.approx(gamma, rel=1e-7)


def test_a_free_L2_may_take_a_measured_argument_out_of_the_error():
    """L2 = -1; its scale lambda would be infinite there, and is bounded."""
    outcome = design(loads(SLOPES.format(b=0.2, slope="[0, .6]", rho=0.9, c=1, L2="free")), Engine())
    assert outcome.limit["gamma"] == pytest.approx(0.2 / 0.9, rel=1e-5)


def test_the_peak_of_a_scalar_plant_is_least_at_dead_beat():
    outcome = scalar(0.8, 1, 1, 0.5, "type: linf, rho: 0")
    assert outcome.limit["gamma"] == pytest.approx(math.sqrt(1.16), rel=1e-6)
    assert outcome.status is Verdict.CERTIFIED
    assert scalar(0.8, 1, 1, 0.5, "type: linf, rho: .05").limit["gamma"] == pytest.approx(1.078341741, rel=1e-6)
    assert scalar(0.8, 1, 1, 0.5, "type: linf").limit["gamma"] == pytest.approx(math.sqrt(1.16), rel=1e-5)


@pytest.mark.parametrize(("constant", "least"), [(0.8, 0.300926), (2, 0.411902)])
def test_the_least_rho(constant, least):
    outcome, _ = made("R3", "type: l2, objective: max-alpha, rho: {min: .05, max: .99}", L=constant)
    assert outcome.limit["rho"] == pytest.approx(least, rel=1e-5)
    assert outcome.limit["alpha"] == pytest.approx(-math.log(least), rel=1e-5)
    rho = 1 - float(outcome.claim.certificate.rate)
    assert least < rho <= least * 1.05 * (1 + 1e-5)


FAST = """
obsdesign: 1
system: {{time: discrete, period: {Ts}, A: {A}, B: {B}, C: [[1, 0]], D: [[0, .1]]}}
nonlinearities: [{{type: {{lipschitz: .5}}, Bf: {Bf}, Cq: [1, 0]}}]
observer: {{type: l2, alpha: .2, estimate: {estimate}}}
"""


@pytest.mark.parametrize(
    ("Ts", "estimate", "gamma"),
    [
        (0.1, "predicted", 0.371904085),
        (0.01, "predicted", 0.324232269),
        (1e-3, "predicted", 0.320076580),
        (1e-4, "predicted", 0.319667511),
        (1e-5, "predicted", 0.319622132 + (0.319667511 - 0.319622132) / 10),
        (0.1, "filtered", 0.326572202),
        (0.01, "filtered", 0.320141448),
    ],
)
def test_with_fast_samples_the_limits_are_those_of_continuous_time(Ts, estimate, gamma):
    """By a hold; the limit in continuous time is .319622132, to which these tend."""
    whole = expm(np.block([[np.array([[0, 1, 0, 0], [-1, -0.5, -1, 1]])], [np.zeros((2, 4))]]) * Ts)
    A, Bf, B = whole[:2, :2], whole[:2, 2], np.column_stack([whole[:2, 3], [0, 0]])
    spec = loads(FAST.format(Ts=Ts, A=A.tolist(), B=B.tolist(), Bf=Bf.tolist(), estimate=estimate))
    outcome = design(spec, Engine())
    assert outcome.status is Verdict.CERTIFIED
    assert outcome.limit["gamma"] == pytest.approx(gamma, rel=2e-6)


def errors(spec, gains, K):
    """A, B of e+ = A e + B v for f = K q, by hand."""
    p, L1, L2 = in_floats(spec.posed), gains["L1"], gains["L2"]
    G = p.Bf + L1 @ p.Df
    F = np.linalg.solve(np.eye(len(K)) - K @ (p.Dqf + L2 @ p.Df), K)
    return p.A + L1 @ p.C + G @ F @ (p.Cq + L2 @ p.C), -(p.B + L1 @ p.D + G @ F @ (p.Dq + L2 @ p.D))


@pytest.mark.parametrize(("plant", "observer"), [case[:2] for case in LIMITS])
def test_no_frozen_member_exceeds_gamma_on_the_circle_of_radius_rho(plant, observer):
    outcome, spec = made(plant, observer)
    rho, gamma = 1 - float(outcome.claim.certificate.rate), float(outcome.claim.certificate.gamma)
    H, n = in_floats(spec.H), spec.posed.n
    for K in members(spec.multiplier)[:20]:
        A, B = errors(spec, outcome.gains, K)
        assert np.abs(np.linalg.eigvals(A)).max() <= rho * (1 + 1e-9)
        for z in rho * np.exp(1j * np.linspace(0, np.pi, 200)):
            assert np.linalg.norm(H @ np.linalg.solve(z * np.eye(n) - A, B), 2) <= gamma * (1 + 1e-9)


@given(alpha=st.fractions("1/1000", 50, max_denominator=1000), period=st.fractions("1/1000", 2, max_denominator=1000))
def test_rho_of_alpha_proves_alpha(alpha, period):
    rate = step(fmpq(alpha.numerator, alpha.denominator), fmpq(period.numerator, period.denominator))
    exact = (-arb(fmpq(alpha.numerator, alpha.denominator) * fmpq(period.numerator, period.denominator))).exp()
    assert 0 < rate <= 1
    assert arb(1 - rate) <= exact
    near = rate / (1 - exact) if exact > 0.5 else exact / (1 - rate) if rate < 1 else arb(1)
    assert near < 1 + 1e-5


@given(
    roots=st.lists(st.fractions(-2, 2, max_denominator=20), min_size=1, max_size=5),
    radius=st.fractions("1/10", 2, max_denominator=20),
)
def test_the_test_of_schur_is_exact(roots, radius):
    from flint import fmpq_poly

    p = fmpq_poly([1])
    for root in roots:
        p *= fmpq_poly([-fmpq(root.numerator, root.denominator), 1])
    inside = all(abs(root) < radius for root in roots)
    assert schur(p, fmpq(radius.numerator, radius.denominator)) is inside


def test_a_complex_pair_is_judged_by_its_absolute_value():
    S = np.array([[fmpq(3, 5), fmpq(-4, 5)], [fmpq(4, 5), fmpq(3, 5)]], dtype=object)
    assert not Edge(fmpq(0), sampled=True).kept(S)
    assert Edge(fmpq(0), sampled=True).kept(S * fmpq(99, 100))
    assert not Edge(fmpq(1, 50), sampled=True).kept(S * fmpq(99, 100))
    assert Edge(fmpq(0), sampled=True, weak=True).kept(S)
