"""The L2 family: the magnetic bearing against its closed forms, frozen slopes, invariances, certificates."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from flint import fmpq, fmpq_mat
from hypothesis import given
from hypothesis import strategies as st
from support.shipped import SPECS, on, solved
from support.sweep import examples

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.certificate import certify
from obsdesign.dissipation.gain import searchable
from obsdesign.dissipation.shift import shifted_plant, unshifted
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families.incremental.theorems import L2
from obsdesign.lmi.formula import identity, in_floats, rational, rational_number
from obsdesign.lmi.probe import probe
from obsdesign.lmi.reduce import balance, reduce
from obsdesign.lmi.solve import Answer, Status, minimise, widest
from obsdesign.lmi.solvers import Ending, with_clarabel
from obsdesign.reading import load, loads
from obsdesign.work import solve

GOLDEN = (1 + math.sqrt(5)) / 2
BEARING = (SPECS / "corless2019-magnetic-bearing.yaml").read_text().partition("observer:")[0]
TANKS = (SPECS / "noisy-output.yaml").read_text().partition("simulation:")[0]
ANY_SLOPE = (0.0, math.inf)
SLOPES = {
    "corless2019-magnetic-bearing": [ANY_SLOPE],
    "corless2019-magnetic-bearing-bounded": [ANY_SLOPE],
    "corless2019-magnetic-bearing-gains-a": [ANY_SLOPE],
    "corless2019-magnetic-bearing-gains-c": [ANY_SLOPE],
    "pendulum": [(-1.0, 1.0)],
    "saturated-spring": [(0.0, 1.0), ANY_SLOPE],
    "oscillating-disturbance": [(0.0, 1.0)],
    "noisy-output": [(0.2, 1.5)],
}


def bearing(alpha="0.71", L2="[[0, -110]]", **further):
    lines = {"type": "l2", "alpha": alpha, "L2": L2, **further}
    return loads(BEARING + "observer:\n" + "".join(f"  {key}: {value}\n" for key, value in lines.items()))


def tanks(slope="[0.2, 1.5]", **changed):
    """The spec of the two tanks, in which nothing is simulated; f is left out so that any slope may be given."""
    text = TANKS.replace("f: 0.85*q + 0.65*sin(q)\n    type: {slope: [0.2, 1.5]}", f"type: {{slope: {slope}}}")
    assert slope in text
    return loads(text + "".join(f"  {key}: {value}\n" for key, value in changed.items()))


def family_of(spec, alpha=None):
    """The problem of a spec in rationals, with L1 to be found."""
    return L2(
        spec.augmented, spec.multiplier, spec.H, spec.observer.rate if alpha is None else alpha, None, spec.observer.L2
    )


def least_mu2(family):
    answer = minimise(searchable(family).least_gamma())
    assert answer.status is Status.OPTIMAL
    return answer.objective


def proof_of(family, certificate, **changed):
    """Certify the claim of a certificate with something in it changed."""
    values = {"P": certificate.P, **certificate.multipliers, **changed}
    return certify(family, certificate.gamma, certificate.mu1, certificate.mu2, values)


def exactly(gain):
    return rational(np.vectorize(repr, otypes=[object])(gain))


def certified_family(spec, made):
    gains = {name: exactly(gain) for name, gain in made.gains.items()}
    return replace(family_of(spec, made.claim.certificate.rate), **gains)


# The magnetic bearing


@pytest.mark.parametrize(
    ("alpha", "mu2"),
    [
        ("0.1", 2.2989e-4),
        ("0.5", 2.3296e-4),
        ("0.71", 2.3458e-4),
        ("1", 2.3687e-4),
        ("2", 2.4502e-4),
        ("5", 2.7227e-4),
        ("8", 3.0456e-4),
        ("9.9", 3.2821e-4),
        ("10", 1.0e-2),
        ("20", 1.0e-2),
    ],
)
def test_the_least_mu2_of_the_bearing(alpha, mu2):
    """At alpha = 10, the zero of w1 -> y1, the first channel begins to cost 0.1^2."""
    assert least_mu2(family_of(bearing(alpha))) == pytest.approx(mu2, rel=1e-4)


@pytest.mark.parametrize("injection", [10, 110, 1000])
def test_the_least_mu2_of_the_bearing_in_closed_form(injection):
    """As alpha goes to zero: phi^5 / (4 l^2) with the golden ratio phi."""
    found = least_mu2(family_of(bearing("1e-6", f"[[0, -{injection}]]")))
    assert found == pytest.approx(GOLDEN**5 / (4 * injection**2), rel=1e-4)


def test_the_least_gamma_of_the_bearing_never_decreases_with_alpha():
    family = family_of(bearing())
    levels = [least_mu2(replace(family, rate=rational_number(repr(float(a))))) for a in np.geomspace(0.01, 40, 25)]
    assert all(b >= a * (1 - 1e-4) for a, b in pairwise(levels))
    assert levels[-1] > 10 * levels[0]


@pytest.mark.parametrize("injection", ["[[0, 0]]", "[[0, 110]]"])
def test_the_bearing_needs_injection_of_the_right_sign(injection):
    made = solve(bearing(L2=injection))
    assert (made.status, made.claim, made.gains) == ("infeasible", None, {})
    assert made.diagnosis["condition"] == "passivity"
    assert "(Cq + L2 C) Bf < 0" in made.diagnosis["reason"]
    assert made.diagnosis["value"] == in_floats(bearing(L2=injection).observer.L2)[0, 1]


def test_without_the_equalities_the_solver_calls_an_infeasible_problem_solved():
    problem = searchable(family_of(bearing(L2="[[0, 0]]"))).least_gamma()
    assert with_clarabel(balance(probe(problem))[0])[0] is Ending.SOLVED
    assert "P > 0 cannot hold" in reduce(problem).contradiction


def test_too_fast_a_decay_is_infeasible_and_half_of_the_injection_gain_is_the_fastest():
    made = solve(bearing("60"))
    assert made.status == "infeasible"
    assert made.diagnosis["condition"] == "decay"
    assert made.diagnosis["feasible"]["alpha"] == pytest.approx(55, rel=1e-4)
    assert made.diagnosis["feasible"]["alpha"] < 55


def test_the_fastest_decay_of_the_bearing():
    made = solve(bearing("{min: 0.1, max: 200}", objective="max-alpha"))
    assert made.status == "certified"
    assert made.limit == {"alpha": pytest.approx(55, rel=1e-4), "attained": False}
    assert made.limit["alpha"] / 1.05 * (1 - 1e-5) <= float(made.claim.certificate.rate) < 55


def test_a_range_of_alpha_that_is_feasible_throughout_is_attained():
    made = solve(bearing("{min: 0.1, max: 5}", objective="max-alpha", slack=0))
    assert made.status == "certified"
    assert made.limit == {"alpha": 5, "attained": True}
    assert made.claim.certificate.rate == 5


def test_feasibility_is_certified_at_some_gamma():
    made = solve(bearing(objective="feasibility"))
    assert made.status == "certified"
    assert made.claim.certificate.guarantee.gamma >= made.limit["gamma"]


def test_a_gamma_above_the_limit_is_certified_and_one_below_it_is_not():
    made = solve(bearing(objective="{gamma: 0.1}"))
    assert made.status == "certified"
    assert made.claim.certificate.gamma == rational_number("0.1")
    missed = solve(bearing(objective="{gamma: 0.01}"))
    assert (missed.status, missed.gains) == ("infeasible", {})
    assert missed.diagnosis["gamma"] == {"asked": 0.01, "least": pytest.approx(0.0153161, rel=1e-4)}


def test_a_limit_of_zero_needs_a_bound_and_is_answered_with_a_table():
    with pytest.raises(UsageError) as caught:
        solve(bearing(L2="free"))
    first, *table = str(caught.value).splitlines()
    assert "least gamma at alpha = 0.71 is 0" in first
    levels = [float(row.rpartition("=")[2]) for row in table]
    assert len(levels) == 6
    assert all(b < 0.8 * a for a, b in pairwise(levels))


def test_a_bounded_gain_with_free_injection():
    made = solve(bearing("0.1", "free", bounds="{L1: 400}"))
    assert made.status == "certified"
    assert made.claim.certificate.mu2 <= fmpq(1, 10)
    assert np.linalg.norm(made.gains["L1"], 2) <= 400
    assert made.claim.certificate.guarantee.gamma <= 1.05 * made.limit_bounded["gamma"]


@pytest.mark.parametrize(("bound", "order"), [("{L1: 300}", 2), ("{L1: {frobenius: 300}}", "fro")])
def test_the_bound_on_the_gain_holds_in_its_norm(bound, order):
    made = solve(bearing("0.1", "free", bounds=bound))
    assert made.status == "certified"
    assert 200 < np.linalg.norm(made.gains["L1"], order) <= 300


@pytest.mark.parametrize(
    ("name", "mu2"),
    on(
        *(
            (f"corless2019-magnetic-bearing-gains-{case}", mu2)
            for case, mu2 in zip("abc", (0.08, 0.01, 0.001), strict=True)
        )
    ),
)
def test_given_gains_of_the_bearing_are_certified_at_the_level_they_were_made_for(name, mu2):
    spec, made = solved(name)
    assert made.status == "certified"
    assert made.claim.certificate.mu2 <= rational_number(str(mu2))
    assert made.claim.certificate.guarantee.gamma > made.limit["gamma"]
    assert (exactly(made.gains["L1"]) == spec.observer.gains["L1"]).all()


def test_the_limit_is_approached_by_ever_larger_gains():
    """The projected problem, which has no gain, against the full one."""
    family = searchable(family_of(bearing()))
    limit = minimise(family.least_gamma()).objective
    sizes = ("1e4", "1e6", "1e8", "1e10")
    levels = [minimise(family.least_gamma(Bounds(L1=rational_number(s)))).objective for s in sizes]
    assert all(a > b > limit * (1 - 1e-5) for a, b in pairwise(levels))
    assert levels[-1] == pytest.approx(limit, rel=1e-3)
    attained = searchable(family_of(tanks()))
    full = minimise(attained.least_gamma(Bounds(L1=fmpq(10**6)))).objective
    assert full == pytest.approx(minimise(attained.least_gamma()).objective, rel=1e-5)


@pytest.mark.parametrize("bound", ["1e5", "1e7"])
def test_a_bound_of_a_huge_gain_is_no_structural_zero(bound):
    problem = searchable(family_of(bearing())).least_gamma(Bounds(L1=rational_number(bound)))
    without = reduce(searchable(family_of(bearing())).least_gamma(Bounds(P=fmpq(10**9))))
    assert reduce(problem).rows == without.rows
    assert minimise(problem).status is Status.OPTIMAL


# Frozen slopes: a nonlinearity of constant slope belongs to its class, and leaves a linear error system


def error_system(plant, L1, L2, slopes):
    """A and B of e' = A e + B v, from e' = (A + L1 C) e + (Bf + L1 Df) df - (B + L1 D) v and df = K dq."""
    K = np.diag(slopes)
    F, G = plant.Bf + L1 @ plant.Df, plant.B + L1 @ plant.D
    loop = K @ np.linalg.inv(np.eye(len(K)) - (plant.Dqf + L2 @ plant.Df) @ K)
    return plant.A + L1 @ plant.C + F @ loop @ (plant.Cq + L2 @ plant.C), -G - F @ loop @ (plant.Dq + L2 @ plant.D)


def peak_gain(A, B, C):
    """Largest singular value of C (s I - A)^-1 B over a dense grid of frequencies."""
    sizes = np.abs(np.linalg.eigvals(A))
    omega = np.concatenate([[0.0], np.geomspace(1e-4, 10 * sizes.max(), 300), sizes])
    response = C @ np.linalg.solve(
        1j * omega[:, None, None] * np.eye(len(A)) - A, np.broadcast_to(B, (len(omega), *B.shape))
    )
    return np.linalg.norm(response, 2, axis=(1, 2)).max()


def drawn(rng, low, high):
    if high == math.inf:
        return float(rng.choice([0.0, 10 ** rng.uniform(-3, 4)], p=[0.1, 0.9]))
    return float(rng.choice([low, high, rng.uniform(low, high)]))


@pytest.mark.parametrize("name", on(*SLOPES))
def test_every_frozen_slope_keeps_the_guarantee(name):
    """With weights exp(alpha t) on z and v, too: A + alpha I is stable and has a gain of at most gamma."""
    spec, made = solved(name)
    assert made.status == "certified"
    plant, H, proof = in_floats(spec.augmented), in_floats(spec.H), made.claim.certificate.guarantee
    rng = np.random.default_rng(5)
    for _ in range(20):
        slopes = [drawn(rng, *interval) for interval in SLOPES[name]]
        A, B = error_system(plant, made.gains["L1"], made.gains["L2"], slopes)
        faster = A + proof.rate * np.eye(len(A))
        assert np.linalg.eigvals(faster).real.max() <= 1e-6
        assert peak_gain(A, B, H) <= proof.gamma
        assert peak_gain(faster, B, H) <= proof.gamma * (1 + 1e-6)


@pytest.mark.xdist_group("noisy-output")
def test_the_frozen_slopes_of_a_wrong_class_break_the_guarantee():
    spec, made = solved("noisy-output")
    plant, proof = in_floats(spec.augmented), made.claim.certificate.guarantee
    A, B = error_system(plant, made.gains["L1"], made.gains["L2"], [-30.0])
    unstable = np.linalg.eigvals(A).real.max() > -proof.rate
    assert unstable or peak_gain(A, B, in_floats(spec.H)) > proof.gamma


# Invariances


def inverse(T):
    return rational(np.array(fmpq_mat(T.tolist()).inv().tolist(), dtype=object))


def in_coordinates(family, T):
    """The same problem for T x."""
    p, S = family.plant, inverse(T)
    plant = replace(p, A=T @ p.A @ S, Bf=T @ p.Bf, B=T @ p.B, Cq=p.Cq @ S, C=p.C @ S)
    return replace(family, plant=plant, H=family.H @ S)


def other_units(n, rng):
    """Other units and another order of the states."""
    return rational((10.0 ** rng.uniform(-2, 2, n)).round(4) * np.eye(n)[rng.permutation(n)])


def well_conditioned(n, rng):
    rotation = np.linalg.qr(rng.standard_normal((n, n)))[0]
    return rational((rotation * rng.uniform(0.5, 2, n)).round(3))


@pytest.mark.parametrize(
    ("make", "change"),
    [
        (tanks, other_units),
        (bearing, other_units),
        (tanks, well_conditioned),
        (bearing, well_conditioned),
    ],
)
def test_a_change_of_state_coordinates_leaves_the_least_gamma(make, change):
    family = family_of(make())
    expected = pytest.approx(math.sqrt(least_mu2(family)), rel=1e-4)
    for seed in range(5):
        changed = in_coordinates(family, change(family.plant.n, np.random.default_rng(seed)))
        assert math.sqrt(least_mu2(changed)) == expected


@pytest.mark.parametrize("change", [other_units, well_conditioned])
def test_a_change_of_state_coordinates_never_turns_a_verdict(change):
    decided = 0
    for seed in range(5):
        for alpha, wrong in (("50", Status.INFEASIBLE), ("60", Status.OPTIMAL)):
            family = family_of(bearing(alpha))
            changed = in_coordinates(family, change(family.plant.n, np.random.default_rng(seed)))
            status = widest(searchable(changed).feasible()).status
            assert status is not wrong
            decided += status is not Status.UNDECIDED
    assert decided >= 6


@given(st.tuples(*[st.integers(0, 40)] * 4))
@examples(15)
def test_a_wider_slope_interval_never_lowers_the_least_gamma(parts):
    a, b, left, right = (x / 10 for x in parts)
    narrow, wide = (
        minimise(searchable(family_of(tanks(f"[{low:.1f}, {high:.1f}]"))).least_gamma())
        for low, high in ((a - 2, a - 2 + b), (a - 2 - left, a - 2 + b + right))
    )
    if wide.status is Status.OPTIMAL:
        assert narrow.status is Status.OPTIMAL
        assert wide.objective >= narrow.objective * (1 - 1e-4)


# A free L2 for slopes that are never zero


LOOP = """
obsdesign: 1
name: two channels in an algebraic loop
system:
  A: [[-0.5, 1, 0], [-1, -0.3, 0.2], [0, 0.4, -1]]
  B: [[1, 0], [0, 0], [0, 0.5]]
  C: [[1, 0, 0], [0, 1, 0]]
  D: [[0, 0.1], [0.2, 0]]
nonlinearities:
  - {type: {slope: [0.2, 1.5]}, Bf: [-1, 0, 0.5], Cq: [0, 1, 0.3], Dqf: [[-0.3, 0.2]], Df: [0.1, 0]}
  - {type: {slope: [-2, -0.5]}, Bf: [0, 0.7, 0], Cq: [0.2, 0, 1], Dq: [0.1, 0], Df: [0, -0.2]}
disturbance: unknown
performance: x
observer: {type: l2, L2: free, alpha: 0.1, bounds: {L1: 20}}
"""
LOOP_SLOPES = [(0.2, 1.5), (-2.0, -0.5)]


@pytest.mark.parametrize(("spec", "intervals"), [(tanks(L2="free"), [(0.2, 1.5)]), (loads(LOOP), LOOP_SLOPES)])
def test_a_free_injection_is_certified_for_the_nonlinearity_before_the_loop_shift(spec, intervals):
    assert spec.multiplier.member.any()
    made = solve(spec)
    assert made.status == "certified"
    assert made.gains["L2"].any()
    family = certified_family(spec, made)
    assert proof_of(family, made.claim.certificate).holds
    rng, plant, proof = np.random.default_rng(2), in_floats(spec.augmented), made.claim.certificate.guarantee
    for _ in range(20):
        A, B = error_system(plant, made.gains["L1"], made.gains["L2"], [drawn(rng, *i) for i in intervals])
        assert peak_gain(A + proof.rate * np.eye(len(A)), B, in_floats(spec.H)) <= proof.gamma
        assert np.linalg.eigvals(A).real.max() <= -proof.rate


def test_a_free_injection_is_never_worse_than_none():
    free, none = (searchable(family_of(tanks(L2=choice))) for choice in ("free", "0"))
    for size in (1, 10, 100):
        bounds = Bounds(L1=fmpq(size))
        assert minimise(free.least_gamma(bounds)).objective <= minimise(none.least_gamma(bounds)).objective * (1 + 1e-5)


@given(st.integers(0, 2**32 - 1))
@examples(25)
def test_the_loop_shift_and_its_way_back_leave_the_error_system(seed):
    """For X = (I - Dqf K)^-1 L2n: dq = X r + .. and r = (I - Df K X)^-1 r~, r~ the residual after."""
    rng = np.random.default_rng(seed)
    plant = in_floats(loads(LOOP).augmented)
    plant = replace(
        plant, **{k: rng.uniform(-0.5, 0.5, getattr(plant, k).shape) for k in ("A", "Dqf", "Df", "Dq", "D")}
    )
    K, slopes = np.diag(rng.uniform(-0.6, 0.6, 2)), rng.uniform(-0.6, 0.6, 2)
    L1, L2_ = rng.uniform(-1, 1, (3, 2)), rng.uniform(-0.5, 0.5, (2, 2))
    after = shifted_plant(plant, K)
    before = unshifted(L2_, plant, K)
    X = np.linalg.solve(np.eye(2) - plant.Dqf @ K, before)
    corrected = L1 @ (np.eye(2) - plant.Df @ K @ X) - plant.Bf @ K @ X
    expected = error_system(after, L1, L2_, slopes)
    found = error_system(plant, corrected, before, slopes + np.diag(K))
    assert found[0] == pytest.approx(expected[0], rel=1e-8, abs=1e-8)
    assert found[1] == pytest.approx(expected[1], rel=1e-8, abs=1e-8)


# Certificates


@pytest.mark.parametrize(
    ("name", "factor"), on(("corless2019-magnetic-bearing", "1.2"), ("noisy-output", "1.2"), ("saturated-spring", "-1"))
)
def test_a_certificate_does_not_survive_a_change(name, factor):
    spec, made = solved(name)
    family, proof = certified_family(spec, made), made.claim.certificate
    assert proof_of(family, proof).holds
    assert not proof_of(replace(family, L1=rational_number(factor) * family.L1), proof).holds
    assert not proof_of(family, proof, P=-proof.P).holds
    assert not proof_of(replace(family, rate=family.rate * 100), proof).holds
    assert not certify(family, proof.gamma / 2, proof.mu1, proof.mu2, {"P": proof.P, **proof.multipliers}).holds
    for scale in proof.multipliers:
        assert not proof_of(family, proof, **{scale: -proof.multipliers[scale]}).holds


@pytest.mark.xdist_group("corless2019-magnetic-bearing")
def test_an_equality_that_is_off_by_1e_20_is_rejected():
    """The (f, f) block of the bearing is zero, so P12 = -lambda (Cq + L2 C)1 and the like must hold exactly."""
    spec, made = solved("corless2019-magnetic-bearing")
    family, proof = certified_family(spec, made), made.claim.certificate
    for i in range(5):
        P = proof.P.copy()
        P[i, 1] += fmpq(1, 10**20)
        P[1, i] = P[i, 1]
        assert not proof_of(family, proof, P=P).holds
    P = proof.P + identity(5, proof.P) * 0
    P[4, 4] += fmpq(1, 10**20)
    assert proof_of(family, proof, P=P).holds


@pytest.mark.xdist_group("saturated-spring")
def test_the_rows_that_must_vanish_do_so_exactly():
    spec, made = solved("saturated-spring")
    family, proof = certified_family(spec, made), made.claim.certificate
    level = {"mu1": rational([[proof.mu1]]), "mu2": rational([[proof.mu2]])}
    dissipation = family.theorem({"P": proof.P, **proof.multipliers, **level})[0].matrix
    cubic = family.plant.n + 1
    assert not dissipation[cubic].any()
    assert dissipation[cubic - 1].any()


@pytest.mark.parametrize("name", on("corless2019-magnetic-bearing-bounded", "noisy-output"))
def test_two_designs_are_identical(name):
    spec, first = solved(name)
    second = solve(load(spec.path))
    assert all((first.gains[g] == second.gains[g]).all() for g in ("L1", "L2"))
    assert (first.claim.certificate.P == second.claim.certificate.P).all()
    assert first.claim.certificate.multipliers == second.claim.certificate.multipliers
    assert first.claim.certificate.gamma == second.claim.certificate.gamma


def test_given_gains_that_leave_an_error_too_slow_are_infeasible():
    text = (SPECS / "corless2019-magnetic-bearing-gains-a.yaml").read_text()
    made = solve(loads(text.replace("-1.1254407468933028", "1e6")))
    assert made.status == "infeasible"
    assert "grows at the rate 999981" in made.diagnosis["reason"]


def test_a_bound_on_gamma_caps_what_is_shipped_and_below_the_limit_nothing_is():
    capped = solve(bearing(bounds="{gamma: 0.0157}"))
    assert capped.status == "certified"
    assert capped.claim.certificate.gamma <= fmpq(157, 10000)
    refused = solve(bearing(bounds="{gamma: 0.015}"))
    assert refused.status == "infeasible"
    assert refused.diagnosis["gamma"]["asked"] == 0.015


def test_max_alpha_leaves_open_what_no_solve_decided(monkeypatch):
    undecided = Answer(Status.UNDECIDED)
    monkeypatch.setattr("obsdesign.dissipation.engine.minimise", lambda *_, **__: undecided)
    monkeypatch.setattr("obsdesign.dissipation.engine.widest", lambda *_, **__: undecided)
    with pytest.raises(UndecidedError):
        solve(bearing("{min: 0.1, max: 200}", objective="max-alpha"))
