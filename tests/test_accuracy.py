"""Arbitrary accuracy in closed form: the conditions of Theorem 2, their gains, and plants that do not admit it."""

import numpy as np
import pytest
from flint import fmpq
from support.shipped import shipped

from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import searchable
from obsdesign.families.incremental import accuracy
from obsdesign.families.incremental.accuracy import accurate, conditions
from obsdesign.families.incremental.theorems import THEOREMS
from obsdesign.lmi.formula import in_floats, rational_number
from obsdesign.reading import loads
from obsdesign.work import solve

PENDULUM = """
system: {A: [[0, 1], [0, -1]], B: [0, 1], C: [[1, 0], [0, 1]], D: [0, 0.5]}
nonlinearities: [{type: {lipschitz: 1}, Bf: [0, -1], Cq: [1, 0]}]
disturbance: integrator
"""
FRICTION = """
system: {A: [[-1, 1], [0, -1]], B: [1, 0], C: [1, 0], D: 1}
nonlinearities: [{type: monotone, Bf: [0, -1], Cq: [0, 1]}]
disturbance: integrator
"""
CLASSICAL = "system: {A: [[0, 1], [-2, -3]], B: [0, 1], C: [[1, 0], [1, 1]]}\n"
FEEDTHROUGH = "system: {A: [[1, 1], [-2, -3]], B: [0, 1], C: [1, 0], D: %s}\ndisturbance: integrator\n"
PLANTS = {  # the plant, alpha, slopes of f, and the true H-infinity norms at gamma = 0.1 and 0.01
    "pendulum": (PENDULUM, "0.15", (-1, -0.5, 0, 0.5, 1), (0.003136, 3.2e-5)),
    "friction": (FRICTION, "0.2", (0, 1, 10, 1000), (0.011542, 1.16e-4)),
    "classical": (CLASSICAL, "0.2", (0,), (0.013598, 1.42e-4)),
    "feedthrough": (FEEDTHROUGH % "0.2", "0.1", (0,), (0.003314, 3.3e-5)),
}
WITH_L2 = [*((plant, "0") for plant in PLANTS), ("pendulum", "free"), ("friction", "free")]


def asked(plant, family="l2", gamma="0.1", L2="0", **further):
    text, alpha, *_ = PLANTS[plant]
    lines = {"type": family, "alpha": alpha, "objective": f"{{gamma: {gamma}}}", "L2": L2, **further}
    observer = ", ".join(f"{key}: {value}" for key, value in lines.items())
    return loads(f"obsdesign: 1\n{text}performance: all\nobserver: {{{observer}}}\n")


def family_of(spec, alpha=None):
    request = spec.observer
    alpha = request.rate if alpha is None else alpha
    return THEOREMS[request.type](spec.augmented, spec.multiplier, spec.H, alpha, None, request.L2)


def closed_form(made):
    return any("closed form" in note for note in made.notes)


def error_system(spec, gains, slope):
    """A and B of e' = A e + B v for f = slope q."""
    p, L1, L2 = in_floats(spec.augmented), gains["L1"], gains["L2"]
    A, B = p.A + L1 @ p.C, -(p.B + L1 @ p.D)
    return A + slope * p.Bf @ (p.Cq + L2 @ p.C), B - slope * p.Bf @ (p.Dq + L2 @ p.D)


def norm_infinity(A, B):
    """Peak over frequency of |(s I - A)^-1 B|."""
    omega = np.concatenate([[0.0], np.geomspace(1e-4, 1e6, 600)])
    inputs = np.broadcast_to(B, (len(omega), *B.shape))
    return np.linalg.norm(np.linalg.solve(1j * omega[:, None, None] * np.eye(len(A)) - A, inputs), 2, axis=(1, 2)).max()


# What the closed form reaches


@pytest.mark.parametrize("family", ["l2", "linf"])
@pytest.mark.parametrize(("plant", "L2"), WITH_L2)
def test_any_gamma_is_certified_and_the_gain_grows_as_its_inverse_square(plant, family, L2):
    sizes = []
    for gamma in ("0.1", "0.01"):
        spec = asked(plant, family, gamma, L2)
        made = solve(spec)
        assert made.status == "certified"
        assert closed_form(made)
        assert made.claim.certificate.gamma == rational_number(gamma)
        assert made.limit == {"gamma": 0.0, "attained": False}
        sizes.append(np.linalg.norm(made.gains["L1"], 2))
        for slope in PLANTS[plant][2]:
            A, B = error_system(spec, made.gains, slope)
            assert np.linalg.eigvals(A).real.max() < -float(spec.observer.rate)
            assert norm_infinity(A, B) <= float(gamma)
    assert sizes[1] == pytest.approx(100 * sizes[0], rel=0.02)


@pytest.mark.parametrize("plant", PLANTS)
def test_the_true_norms_are_those_of_the_reference(plant):
    _, _, slopes, norms = PLANTS[plant]
    for gamma, norm in zip(("0.1", "0.01"), norms, strict=True):
        spec = asked(plant, gamma=gamma)
        made = solve(spec)
        found = norm_infinity(*error_system(spec, made.gains, 0))
        assert found == pytest.approx(norm, rel=0.03)
        assert max(norm_infinity(*error_system(spec, made.gains, s)) for s in slopes) < 0.15 * float(gamma)


def test_the_storage_function_of_least_trace_of_the_pendulum():
    least = Engine().minimise(conditions(in_floats(family_of(asked("pendulum"))), 0.3))
    assert least.values["P"] == pytest.approx(np.array([[1, 0, 0], [0, 17.05, 3.7886], [0, 3.7886, 1.8943]]), abs=0.005)
    assert least.values["F"] == pytest.approx(np.array([[0, 3.7886]]), abs=0.005)


@pytest.mark.parametrize("family", ["l2", "linf"])
@pytest.mark.parametrize(("plant", "L2"), WITH_L2)
def test_the_conditions_of_the_theorem_hold_for_its_solution(plant, family, L2):
    """Written out by hand: (20) at the faster rate, (25a), (25b), and (25c) in its linear and its printed form."""
    spec = asked(plant, family, L2=L2)
    solution = accurate(Engine(), family_of(spec))
    p, alpha = in_floats(solution.family.plant), float(spec.observer.rate)
    P, Y, F = (solution.values[name] for name in ("P", "Y", "F"))
    L2_ = in_floats(solution.family.L2)
    size = np.abs(P).max()
    assert np.abs(P @ p.B + Y @ p.D - p.C.T @ F.T).max() <= 1e-7 * size
    assert np.abs(F @ p.D).max() <= 1e-7 * size
    assert np.abs(p.C.T @ F.T @ F @ p.D).max() <= 1e-7 * size**2
    assert np.abs(p.Dq + L2_ @ p.D).max(initial=0) <= 1e-9
    faster = {"l2": alpha + solution.spare, "linf": 1.01 * alpha}[family]
    M11, M12, M22 = in_floats(solution.family.multiplier).matrix(solution.values)
    Ce, n = p.Cq + L2_ @ p.C, p.n
    top = P @ p.A + Y @ p.C
    cross = P @ p.Bf + Y @ p.Df + Ce.T @ M12
    form = np.block([[top + top.T + 2 * faster * P + Ce.T @ M11 @ Ce, cross], [cross.T, M22]])
    assert np.linalg.eigvalsh(form).max() <= 1e-6 * size
    assert np.linalg.eigvalsh(P).min() >= 1 - 1e-6
    assert solution.spare == pytest.approx({"l2": faster - alpha, "linf": alpha}[family])
    assert solution.weight(np.eye(n)) == pytest.approx(1 / np.linalg.eigvalsh(P).min())


def test_a_range_of_alpha_takes_the_one_of_the_smallest_gain():
    alone = [
        np.linalg.norm(solve(asked("friction", "linf", alpha=alpha)).gains["L1"], 2)
        for alpha in ("0.05", "0.2", "0.35")
    ]
    made = solve(asked("friction", "linf", alpha="{min: 0.05, max: 0.35, points: 3}"))
    assert np.linalg.norm(made.gains["L1"], 2) == pytest.approx(min(alone), rel=1e-6)


# Where it is not used


@pytest.mark.parametrize("family", ["l2", "linf"])
def test_a_zero_in_the_right_half_plane_is_a_floor(family, monkeypatch):
    monkeypatch.setitem(PLANTS, "unstable", (FEEDTHROUGH % "-0.2", "0.1"))
    spec = asked("unstable", family)
    assert accurate(Engine(), family_of(spec)) is None
    made = solve(spec)
    assert (made.status, made.gains) == ("infeasible", {})
    assert made.limit["gamma"] > 0.62
    assert "1.64575" in made.diagnosis["reason"]


def test_the_bearing_and_other_plants_without_a_matching_output_do_not_admit_it():
    bearing = shipped("corless2019-magnetic-bearing")
    for alpha in (fmpq(1, 100), bearing.observer.rate, fmpq(5)):
        assert accurate(Engine(), family_of(bearing, alpha)) is None


@pytest.mark.parametrize(("plant", "family"), [("pendulum", "l2"), ("friction", "linf"), ("feedthrough", "l2")])
def test_within_a_bound_a_smaller_gain_is_searched(plant, family):
    free = solve(asked(plant, family))
    size = np.linalg.norm(free.gains["L1"], 2)
    made = solve(asked(plant, family, bounds=f"{{L1: {0.99 * size}}}"))
    assert made.status == "certified"
    assert not closed_form(made)
    assert made.claim.certificate.gamma == fmpq(1, 10)
    assert np.linalg.norm(made.gains["L1"], 2) < 0.99 * size


def test_an_argument_that_the_disturbance_enters_needs_an_injection_that_cancels_it():
    """(25b), Dq + L2 D = 0: with L2 = 0 there is no closed form, with L2 = [0, -0.4] or a free one there is."""
    text = (
        "obsdesign: 1\nsystem: {A: [[-1, 1], [0, -1]], B: [1, 0], C: [[1, 0], [0, 1]], D: [0, 1]}\n"
        "nonlinearities: [{type: {lipschitz: 0.3}, Bf: [0, 1], Cq: [0, 1], Dq: 0.4}]\n"
        "observer: {type: linf, alpha: 0.1, objective: {gamma: 0.05}, L2: %s}\n"
    )
    made = {}
    for L2 in ("0", "[[0, -0.4]]", "[[0, 0.4]]", "free"):
        spec = loads(text % L2)
        made[L2] = accurate(Engine(), family_of(spec)) is not None and closed_form(solve(spec))
    assert made == {"0": False, "[[0, -0.4]]": True, "[[0, 0.4]]": False, "free": True}


def test_an_output_with_f_needs_a_combination_that_is_free_of_it():
    """F Df = 0: two outputs have one, a single output has none."""
    text = (
        "obsdesign: 1\nsystem: {A: [[-1, 1], [0, -1]], B: [1, 0], C: %s}\n"
        "nonlinearities: [{type: {lipschitz: 0.3}, Bf: [0, 1], Cq: [0, 1], Df: %s}]\n"
        "observer: {type: linf, alpha: 0.1, objective: {gamma: 0.01}}\n"
    )
    assert accurate(Engine(), family_of(loads(text % ("[1, 0]", "0.5")))) is None
    two = loads(text % ("[[1, 0], [1, 1]]", "[0, 0.5]"))
    solution = accurate(Engine(), family_of(two))
    assert solution.values["F"][0, 1] == pytest.approx(0, abs=1e-9)
    assert closed_form(solve(two))


def test_gains_that_are_not_proved_are_left_to_the_search_and_not_spoken_of(monkeypatch):
    """A zeta that is far too small."""
    right = accuracy.Accurate.L1
    monkeypatch.setattr(accuracy.Accurate, "L1", lambda self, gamma, outputs: right(self, 1e4 * gamma, outputs))
    made = solve(asked("classical"))
    assert not closed_form(made)
    assert made.status == "certified"
    assert made.claim.certificate.gamma == fmpq(1, 10)


def test_the_plant_of_the_search_is_the_one_before_the_loop_shift():
    """A free L2 for a slope that is never zero comes back from f - K q."""
    spec = loads(
        "obsdesign: 1\nsystem: {A: [[-1, 1], [0, -1]], B: [1, 0], C: [1, 0]}\n"
        "nonlinearities: [{type: {slope: [0.2, 0.6]}, Bf: [0, 1], Cq: [1, 1], Dqf: 0.3}]\n"
        "observer: {type: linf, L2: free, alpha: 0.1, objective: {gamma: 0.01}}\n"
    )
    assert searchable(family_of(spec)).plant.A[1, 0] != 0
    made = solve(spec)
    assert made.status == "certified"
    assert closed_form(made)
