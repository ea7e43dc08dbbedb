"""Limits and gains by Riccati equations: right where a formula, the matrix inequalities or other units tell as much."""

import math

import numpy as np
import pytest
import scipy.linalg
from support.rods import RODS, almost_exact, family, random_plant, rod, rod_spec

import obsdesign as od
from obsdesign.dissipation import gain
from obsdesign.dissipation.bounds import NO_BOUNDS
from obsdesign.dissipation.elimination import central_gains, form_of, least_gamma
from obsdesign.dissipation.engine import Engine
from obsdesign.families.incremental import design
from obsdesign.families.incremental.request import posed
from obsdesign.lmi.formula import in_floats
from obsdesign.lmi.solve import Answer, Status
from obsdesign.model.structure import undetectable
from obsdesign.riccati.equation import Equation
from obsdesign.riccati.form import Eliminated, UnclearError, without_exact_outputs
from obsdesign.riccati.least import least
from obsdesign.riccati.peak import least_peak


def limit(problem):
    """Least gamma."""
    form = form_of(problem)
    found = least_peak(form, problem.H) if problem.about.peak else least(form)
    return math.sqrt(found.mu)


SCALAR = [
    # a, alpha, b, c, d: the frequency 0 decides where a + alpha < 0, and P -> 0 elsewhere
    (-2.0, 0.5, 3.0, 1.0, 0.2),
    (-2.0, 0.5, 3.0, 0.0, 0.2),
    (-1e-3, 1e-4, 1e3, 1e-2, 5.0),
    (1.0, 0.5, 3.0, 1.0, 0.2),
    (0.0, 1e-6, 1e-4, 7.0, 1e-3),
]


@pytest.mark.parametrize(("a", "alpha", "b", "c", "d"), SCALAR)
def test_the_least_energy_gain_of_one_state_is_its_formula(a, alpha, b, c, d):
    """2 a p + 1 + p^2 b^2 / mu - mu c^2 / d^2 <= 0 for some p > 0, a with alpha added."""
    a += alpha
    mu = d**2 / c**2 if a >= 0 else 1 / (a**2 / b**2 + c**2 / d**2)
    assert limit(family("l2", a - alpha, [[b, 0]], c, [[0, d]], alpha)) == pytest.approx(math.sqrt(mu), rel=1e-6)


@pytest.mark.parametrize(("a", "alpha", "b", "c", "d"), [row for row in SCALAR if row[3]])
def test_the_least_peak_gain_of_one_state_is_its_formula(a, alpha, b, c, d):
    """2 a X + b^2 / (2 alpha) = 2 alpha (c / d)^2 X^2, a with alpha added."""
    a += alpha
    r = 2 * alpha * (c / d) ** 2
    mu = (a + math.sqrt(a**2 + r * b**2 / (2 * alpha))) / r
    assert limit(family("linf", a - alpha, [[b, 0]], c, [[0, d]], alpha)) == pytest.approx(math.sqrt(mu), rel=1e-6)


@pytest.mark.parametrize("n", [12, pytest.param(20, marks=pytest.mark.slow), pytest.param(40, marks=pytest.mark.slow)])
def test_a_rod_has_its_limit_and_gains_that_are_proved(n):
    limits = {12: 0.330675, 20: 0.573813, 40: 1.243201}
    made = od.solve(od.load(rod_spec(n)))
    assert made.limit["gamma"] == pytest.approx(limits[n], rel=2e-6)
    assert made.limit["gap"] < 1e-5
    assert made.proved
    assert made.verify().holds
    assert made.result["guarantee"]["gamma"] <= 1.05 * limits[n] * (1 + 1e-5)
    assert made.result["solver"]["engine"] == "riccati"
    assert made.result["solver"]["solves"] == 0
    assert sum("by descent from the central one" in note for note in made.notes) == 1


def compared(seeds):
    """Rows (seed, family, limit by Riccati equations, its lower bound, by inequalities) where both decide."""
    for seed in seeds:
        A, B, C, D, H, alpha = random_plant(seed)
        for name in ("l2", "linf"):
            problem = family(name, A, B, C, D, alpha, H)
            if undetectable(problem.plant, problem.multiplier.member, problem.edge):
                continue
            try:
                form = form_of(problem)
                found = least_peak(form, H) if name == "linf" else least(form)
            except UnclearError:
                continue
            answer = Engine().minimise(problem.least_gamma())
            if answer.status is Status.OPTIMAL and found.mu:
                lower = math.sqrt(found.mu) / (1 + found.gap)
                yield seed, name, math.sqrt(found.mu), lower, math.sqrt(answer.objective)


@pytest.mark.parametrize(("seeds", "least"), [(range(7), 8), pytest.param(range(100, 125), 25, marks=pytest.mark.slow)])
def test_random_plants_have_the_limits_of_the_inequalities(seeds, least):
    rows = list(compared(seeds))
    assert len(rows) >= least
    assert [row for row in rows if not row[3] * (1 - 1e-4) <= row[4] <= row[2] * (1 + 1e-4)] == []


@pytest.mark.parametrize("name", ["l2", "linf"])
@pytest.mark.parametrize("seed", [0, 1, 4, 5, 8])
def test_a_limit_does_not_depend_on_coordinates_units_and_time(name, seed):
    A, B, C, D, H, alpha = random_plant(seed)
    n, rng = len(A), np.random.default_rng(seed + 1000)
    known = limit(family(name, A, B, C, D, alpha, H))
    T, R = rng.normal(size=(n, n)) + 3 * np.eye(n), np.diag(10.0 ** rng.integers(-3, 4, len(C)))
    back = np.linalg.inv(T)
    assert limit(family(name, T @ A @ back, T @ B, R @ C @ back, R @ D, alpha, H @ back)) == pytest.approx(known, 1e-5)
    S = np.diag(10.0 ** rng.integers(-4, 5, n))
    back = np.linalg.inv(S)
    assert limit(family(name, S @ A @ back, S @ B, C @ back, D, alpha, H @ back)) == pytest.approx(known, rel=1e-5)
    assert limit(family(name, A, 1e3 * B, C, 1e3 * D, alpha, H)) == pytest.approx(1e3 * known, rel=1e-5)
    if name == "linf":  # t' = 1000 t: V' + 2 alpha V <= 2 alpha |v|^2 holds as before
        assert limit(family(name, 1e3 * A, 1e3 * B, C, D, 1e3 * alpha, H)) == pytest.approx(known, rel=1e-5)


def test_a_small_gamma_far_below_the_limit_is_not_called_feasible():
    """X changes its sign through infinity there and comes back to zero from below as mu falls."""
    form = form_of(family("l2", *rod(12, *RODS[12]), 1e-4))
    found = least(form)
    reduced = Eliminated.of(without_exact_outputs(form)[0])
    seen = set()
    for factor in (0.99, 0.5, 0.1, 1e-2, 1e-4):
        space = Equation.of(reduced, factor * found.mu).subspace()
        seen.add("axis" if space is None else np.linalg.eigvalsh(space.X)[0] < 0)
    assert seen == {"axis", True}
    assert Equation.of(reduced, 1.001 * found.mu).subspace() is not None


def test_outputs_without_noise_lower_the_order_and_a_small_noise_comes_near_from_above():
    A, B, _, D, H, alpha = random_plant(4)
    n = len(A)
    C = np.eye(n)[:1]
    exact = family("l2", A, B, C, 0 * D[:1], alpha, H)
    reduced, N = without_exact_outputs(form_of(exact))
    assert reduced.n < n == len(N)
    assert np.abs(C @ N).max() < 1e-12
    known = limit(exact)
    wide, none = np.hstack([B, np.zeros((n, 1))]), np.zeros((1, B.shape[1]))
    noisy = [limit(family("l2", A, wide, C, np.hstack([none, [[noise]]]), alpha, H)) for noise in (0.1, 1e-2, 1e-3)]
    assert sorted(noisy, reverse=True) == noisy
    assert known < noisy[-1] < known * 1.05


@pytest.mark.parametrize("name", ["l2", "linf"])
def test_no_order_is_left_where_every_state_is_known_at_last(name):
    problem = family(name, [[0, 1], [0, 0]], [[0], [1]], [[1, 0]], [[0]])
    form = form_of(problem)
    assert without_exact_outputs(form)[0].n == 0
    assert limit(problem) == 0
    answer = least_gamma(Engine(), problem)
    assert (answer.status, answer.objective, answer.gap) == (Status.OPTIMAL, 0.0, 0.0)


def test_a_limit_of_zero_is_refused_with_the_table_of_gains():
    text = "obsdesign: 1\nname: n\nsystem: {A: [[0, 1], [0, 0]], B: [[0], [1]], C: [[1, 0]]}\nobserver: {type: l2}\n"
    with pytest.raises(od.UsageError, match="with a gain that grows without bound") as refused:
        od.solve(od.load(text))
    assert refused.value.problems[0].id == "OBS502"
    assert len(refused.value.problems[0].rows) > 3


@pytest.mark.parametrize(("pole", "alpha"), [(0.3, 0.01), (0.3, 0.1), (0.0, 0.01), (-0.05, 0.1)])
def test_modes_that_no_disturbance_reaches_are_no_obstacle(pole, alpha):
    """One mode is too slow and has to be seen through the noise of its output: gamma is its size, and P -> 0."""
    problem = family("l2", [[pole, 0], [0, -0.2]], np.zeros((2, 1)), [[1, 1]], [[0.1]], alpha)
    assert limit(problem) == pytest.approx(0.1, rel=1e-6)


def test_a_rank_that_doubles_do_not_tell_is_left_to_the_inequalities():
    D = [[1, 1, 0], [1, 1, 1e-10]]
    problem = family("l2", [[-1, 0], [1, -2]], np.ones((2, 3)), np.eye(2), D)
    with pytest.raises(UnclearError, match="rank"):
        least(form_of(problem))
    assert least_gamma(Engine(), problem) is None
    assert gain.within(Engine(), problem).status is Status.OPTIMAL


def test_a_heat_flux_through_a_strip_is_estimated_in_samples():
    """A sinusoid in one of 40 cells, which nothing else disturbs: X is all but singular."""
    n, rho, period, omega = 40, 0.9995, 0.1, 0.05
    A = np.zeros((n + 2, n + 2))
    A[:n, :n] = 0.2 * (np.eye(n, k=1) + np.eye(n, k=-1)) + np.diag([0.798, *[0.598] * (n - 2), 0.798])
    A[n:, n:] = scipy.linalg.expm(period * np.array([[0, 1], [-(omega**2), 0]]))
    A[12, n] = 0.1
    B, D = np.zeros((n + 2, 3)), np.hstack([np.zeros((2, 1)), 0.05 * np.eye(2)])
    B[n + 1, 0] = 0.1
    C, H = np.eye(n + 2)[[7, 29]], np.eye(n + 2)[[n]]
    problem = family("l2", A, B, C, D, rate=1 - rho, H=H, sampled=True)
    answer = least_gamma(Engine(), problem)
    assert answer is not None
    gamma = math.sqrt(answer.objective)
    L = next(central_gains(problem, 1.05 * gamma, np.zeros(0))).L
    z = np.exp(1j * np.concatenate([[0.0], np.geomspace(1e-5, np.pi, 4000)]))
    gains = [H @ np.linalg.solve(rho * one * np.eye(n + 2) - A - L @ C, B + L @ D) for one in z]
    assert gamma * (1 - 1e-3) <= max(np.linalg.norm(gain, 2) for gain in gains) <= 1.05 * gamma


def test_another_solver_is_a_check_of_the_equations():
    assert least_gamma(Engine("cvxopt"), family("l2", -1, [[1, 0]], 1, [[0, 1]])) is None


@pytest.mark.parametrize("name", ["l2", "linf"])
def test_central_gains_reach_their_gamma_in_doubles(name):
    problem = family(name, *rod(12, *RODS[12]), 0.1)
    gamma = 1.05 * limit(problem)
    found = list(central_gains(problem, gamma, np.zeros(0)))
    assert found
    A, B, C, D = (getattr(problem.plant, part) for part in "ABCD")
    for one in found:
        N = A + one.L @ C
        assert np.linalg.eigvals(N).real.max() < -0.1
        supply, weight = (0.2, 0.0) if name == "linf" else (gamma**2, 1.0)
        PB = one.P @ (B + one.L @ D)
        left = one.P @ N + N.T @ one.P + 0.2 * one.P + weight * np.eye(12) + PB @ PB.T / supply
        assert np.linalg.eigvalsh(left).max() < 0
        if name == "linf":
            assert np.linalg.eigvalsh(one.P - np.eye(12) / gamma**2).min() > 0


def test_a_range_of_alpha_takes_one_equation_a_point():
    told = "{type: linf, alpha: {min: 0.05, max: 1, points: 4}}"
    made = od.solve(od.load(rod_spec(12, told)))
    assert made.proved
    assert made.result["solver"]["solves"] == 0
    points = {point["alpha"]: point["gamma"] for point in made.result["search"]["points"]}
    assert made.limit["gamma"] == min(points.values())
    for alpha, gamma in points.items():
        assert limit(family("linf", *rod(12, *RODS[12]), alpha)) == pytest.approx(gamma, rel=1e-5)


def test_bounds_on_the_gain_are_left_to_the_inequalities():
    text = "obsdesign: 1\nname: n\nsystem: {A: [[0, 1], [0, 0]], B: [[0, 0], [1, 0]], C: [[1, 0]], D: [[0, 0.1]]}\n"
    made = od.solve(od.load(text + "observer: {type: l2, alpha: 0.1, bounds: {L1: 4}}\n"))
    assert made.proved
    assert np.linalg.norm(made.gains["L1"], 2) <= 4
    assert made.limit_bounded["gamma"] > made.limit["gamma"]
    assert "gap" not in made.limit_bounded


def test_a_limit_that_no_gain_comes_near_is_not_believed(monkeypatch):
    """As a wrong sign in the equations would have it: the inequalities decide anew."""
    text = "obsdesign: 1\nname: n\nsystem: {A: [[0, 1], [0, 0]], B: [[0, 0], [1, 0]], C: [[1, 0]], D: [[0, 0.1]]}\n"
    spec = od.load(text + "observer: {type: l2, alpha: 0.1}\n")
    right = od.solve(spec)

    def wrong(engine, *_):
        if not engine.eliminates:
            return None
        engine.eliminated = True
        return Answer(Status.OPTIMAL, right.limit["gamma"] ** 2 / 4, gap=0.0)

    monkeypatch.setattr(gain, "least_gamma", wrong)
    made = od.solve(spec)
    assert made.proved
    assert made.limit["gamma"] == pytest.approx(right.limit["gamma"], rel=1e-4)
    assert made.result["solver"]["engine"] == "lmi"


def test_where_no_central_gain_is_proved_the_smallest_is_searched(monkeypatch):
    text = "obsdesign: 1\nname: n\nsystem: {A: [[0, 1], [0, 0]], B: [[0, 0], [1, 0]], C: [[1, 0]], D: [[0, 0.1]]}\n"
    spec = od.load(text + "observer: {type: l2, alpha: 0.1}\n")
    monkeypatch.setattr(design, "LARGE", 2)
    central = od.solve(spec)
    assert central.proved
    assert any("central" in note for note in central.notes)
    monkeypatch.setattr(design, "proved_small", lambda *_: None)
    made = od.solve(spec)
    assert made.proved
    assert np.linalg.norm(made.gains["L1"], 2) < np.linalg.norm(central.gains["L1"], 2) * 1.1
    assert made.result["solver"]["solves"] > 0
    assert not any("central" in note for note in made.notes)


def test_a_central_gain_is_the_last_resort_of_a_small_plant(monkeypatch):
    monkeypatch.setattr(design, "small_gains", lambda *_: iter(()))
    text = "obsdesign: 1\nname: n\nsystem: {A: [[0, 1], [0, 0]], B: [[0, 0], [1, 0]], C: [[1, 0]], D: [[0, 0.1]]}\n"
    made = od.solve(od.load(text + "observer: {type: l2, alpha: 0.1}\n"))
    assert made.proved
    note = next(note for note in made.notes if "the central one of a Riccati equation" in note)
    assert "no smaller one was proved; bounds.L1" in note


@pytest.mark.parametrize("told", ["alpha: 0.1, objective: feasibility", "alpha: 0.1, objective: {gamma: 1}"])
def test_other_objectives_of_a_large_plant_need_no_inequalities(told):
    made = od.solve(od.load(rod_spec(12, f"{{type: l2, {told}}}")))
    assert made.proved
    assert made.result["solver"]["solves"] == 0
    assert made.limit["gamma"] < made.result["guarantee"]["gamma"] <= 1


ILL = (  # A, B, C, D, alpha: of a form whose solution doubles do not resolve, and the least gamma by its own bound
    ([-2, -1, -2, 0], [1000, 1000, 2000, 0], [2, 2, 1, 2], 1e-3, 0.1, 2500.0),
    ([-2, 2, 3, 1], [200, 0, -200, 0], [2, -2, 1, -2], 1e-3, 1.0, 2214.423),
    ([1, 2, 0], [10, -20, 0], [-2, 2, 1], 1e-2, 1.0, 146.87675),
)


@pytest.mark.parametrize(("A", "B", "C", "D", "alpha", "gamma"), ILL)
def test_nothing_is_told_of_a_form_whose_limit_depends_on_its_coordinates(A, B, C, D, alpha, gamma):
    system = {"A": np.diag(A), "B": [[b, 0] for b in B], "C": [C], "D": [[0, D]]}
    spec = od.Spec(system=system, observer={"type": "l2", "alpha": alpha})
    found = least_gamma(Engine("clarabel"), in_floats(posed(spec)))
    assert found is None or found.objective == pytest.approx(gamma**2, rel=1e-4)


@pytest.mark.parametrize(
    ("seed", "gamma"),
    [(23, 8.458575831e-6), (53, 5.151314026e-6), (86, 1.045695472e-6), (105, 2.885955192e-6), (181, 1.052490861e-7)],
)
def test_a_limit_is_not_that_of_the_noise_that_is_added_to_the_states(seed, gamma):
    """By the same equation in 80 digits; outputs have so little noise that a noise of 1e-6 on the states sets it."""
    found = least_gamma(Engine(), almost_exact(seed))
    assert found is None or math.sqrt(found.objective) == pytest.approx(gamma, rel=1e-4)


@pytest.mark.parametrize(("seed", "gamma"), [(12, 1.494459225e-3), (50, 3.525444126e-4), (122, 9.552321963e-4)])
def test_a_peak_through_almost_exact_outputs_is_right(seed, gamma):
    """By the same equation in 80 digits; the inequalities are 1e-4 and more above it."""
    found = least_gamma(Engine(), almost_exact(seed))
    assert math.sqrt(found.objective) == pytest.approx(gamma, rel=1e-7)


@pytest.mark.slow
@pytest.mark.sweep
def test_limits_through_almost_exact_outputs_are_those_of_the_inequalities():
    for seed in range(200):
        problem = almost_exact(seed)
        found = least_gamma(Engine(), problem)
        answer = None if found is None else Engine().minimise(problem.least_gamma())
        if answer and answer.status is Status.OPTIMAL:
            assert math.sqrt(found.objective) == pytest.approx(math.sqrt(answer.objective), rel=5e-4), seed


WEAK = {  # a mode grows that the outputs see by 3e-6 only, and the noise is as small: no search finds the limit
    "system": {
        "A": [[0.579735, 2.58081e-06], [-0.18709, 0.312703]],
        "B": [[1.58436, -0.201345, 0.000401596, -0.000908728], [-1.72463, -0.844701, -0.000346526, 0.00155981]],
        "C": [[-1.93696, 0], [-0.394306, 0]],
        "D": [[0, 0, 0.000835043, 0.000288588], [0, 0, 0.00115917, -0.000990644]],
    },
    "performance": {"H": [[-2.04903, 0.0754439]]},
}


@pytest.mark.parametrize("objective", ["min-gamma", {"gamma": 2e5}])
def test_where_no_search_finds_the_limit_a_central_gain_is_proved(objective, monkeypatch):
    undecided = Answer(Status.UNDECIDED)
    monkeypatch.setattr("obsdesign.dissipation.engine.minimise", lambda *_, **__: undecided)
    monkeypatch.setattr("obsdesign.dissipation.engine.widest", lambda *_, **__: undecided)
    monkeypatch.setattr("obsdesign.dissipation.gain.least_gamma", lambda *_, **__: None)
    made = od.solve(od.Spec(**WEAK, observer={"type": "linf", "alpha": 0.044, "objective": objective}))
    assert made.status == "certified"
    assert made.verify().holds
    assert "the limit is not known" in made.notes[-1]
    gamma = made.guarantee.gamma
    if objective == "min-gamma":
        limit = made.limit
        assert limit["kind"] == "best-found"
        assert limit["gamma"] < gamma < 1.06 * limit["gamma"]
    else:
        assert gamma == objective["gamma"]


def test_with_f_too_a_word_is_not_believed_where_an_equation_has_scales_with_a_solution(monkeypatch):
    infeasible = Answer(Status.INFEASIBLE)
    monkeypatch.setattr("obsdesign.dissipation.engine.minimise", lambda *_, **__: infeasible)
    monkeypatch.setattr("obsdesign.dissipation.gain.least_gamma", lambda *_, **__: None)
    plant = {"system": {"A": [[0, 1], [-2, -1]], "B": [[0, 0], [1, 0]], "C": [[1, 0]], "D": [[0, 0.2]]}}
    wide, narrow = ([{"type": {"slope": [0, k]}, "Bf": [[0], [1]], "Cq": [[0, 1]]}] for k in (300, 0.5))
    hard, easy = (
        od.Spec(**plant, nonlinearities=f, observer={"type": "l2", "alpha": 0.2, "L2": 0}) for f in (wide, narrow)
    )
    made = od.solve(easy)
    assert made.status == "certified"
    assert made.claim.holds
    answer = gain.believed(Engine(), in_floats(posed(hard)), infeasible, NO_BOUNDS)
    assert answer.status is Status.INFEASIBLE
