"""Poles, steps and gains over the frozen members of a class, and what a file says of itself to be no proof."""

import itertools
import json
import re
from math import factorial
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from support.commands import run
from support.rods import chain

import obsdesign as od
from obsdesign.dissipation import areas, modes, residues, steps
from obsdesign.dissipation.analysis import members
from obsdesign.dissipation.decimals import round_down
from obsdesign.families.guarantee import outputs
from obsdesign.files import to_json
from obsdesign.lmi.formula import rational
from obsdesign.lmi.spectrum import extremes, near_largest_ratio
from obsdesign.tables.text import at_least, at_most

pytestmark = pytest.mark.usefixtures("here")

MOTOR = """
obsdesign: 1
name: Motor with friction
system:
  A: [[0, 1, 0], [0, -1, 500], [0, -50, -1000]]
  B: [[0, 0], [-10000, 0], [0, 0]]
  C: [[1, 0, 0], [0, 0, 1]]
  D: [[0, 1.0e-3], [0, 0.02]]
nonlinearities:
  - {type: tanh, f: tanh(q), Bf: [0, -200, 0], Cq: [0, 50, 0]}
disturbance: [integrator, unknown]
performance: [w1]
observer: %s
"""
CELL = """
obsdesign: 1
name: Cell, its voltage a function of the charge
system: {A: [[0, 0], [0, -0.0333]], B: [[1.4e-4, 0], [0, 0]], C: [0, -1], D: [0, 0.005]}
nonlinearities:
  - {type: {slope: [0.5, 2.5]}, Bf: [0, 0], Cq: [1, 0], Df: 1}
observer: {type: l2, L2: 0, alpha: 0.001}
"""
LOOP = """
obsdesign: 1
name: f acts on its own argument, and on y
system: {A: [[-1, 2], [-1, -2]], B: [[1, 0], [0, 1]], C: [1, 0], D: [0, 0.1]}
nonlinearities:
  - {type: {slope: [-0.5, 0.5]}, Bf: [1, 0.5], Cq: [0, 1], Dqf: 0.6, Df: 0.2}
observer: {type: linf, L2: -0.3, alpha: 0.3}
"""
ANY = """
obsdesign: 1
name: one of every kind
system: {A: [[0, 1], [-1, -1]], B: [0, 1], C: [1, 0]}
nonlinearities:
  - {type: %s, f: 0.2*sin(q), Bf: [0, 0.5], Cq: [1, 0]}
observer: %s
"""
FAMILIES = {
    "l2": "{type: l2, L2: 0, alpha: 0.1, bounds: {L1: 20}}",
    "l2, given gains": "{type: l2, alpha: 0.1, gains: {L1: [-3, -2], L2: 0}}",
    "linf": "{type: linf, L2: 0, alpha: 0.1, bounds: {L1: 20}}",
    "lipschitz": "{type: lipschitz, objective: min-gamma, decay: 0.1, bounds: {L: 20}}",
    "lipschitz, given gains": "{type: lipschitz, objective: min-gamma, gains: {L: [3, 2]}}",
    "sporadic": "{type: sporadic, T1: 0.1, T2: 0.2, decay: 0.05, bounds: {L: 20}}",
    "sporadic, given gains": "{type: sporadic, T1: 0.1, T2: 0.2, gains: {L: [2, 1], H: 0}}",
}
PROVED = {  # entries of a guarantee that may stand there and not be numerical
    "gamma", "alpha", "decay", "mu1", "mu2", "mu", "statement", "lipschitz", "margin", "admissible", "T1", "T2",
    "T2_max", "local", "assumed", "rate", "overshoot", "initial", "disturbance", "noise", "jitter", "kind", "outage",
}  # fmt: skip


def solved(text):
    Path("spec.yaml").write_text(text)
    outcome = run("solve", "spec.yaml")
    assert outcome.exit_code == 0, outcome.output
    return json.loads(Path("spec.gains.json").read_text()), outcome.stdout


def matrices(content, slope):
    """A of the error with f = slope q, from the text of the equations; the parts that are held beside it."""
    from obsdesign.reading import loads

    p = loads(content["spec"]["text"]).augmented.doubles
    L1, L2 = (np.array(content["observer"][name]) for name in ("L1", "L2"))
    inner = slope / (1 - slope * (p.Dqf + L2 @ p.Df).item())
    forced = (p.Bf + L1 @ p.Df) * inner @ (p.Cq + L2 @ p.C)
    return p.A + L1 @ p.C, forced


def radius(content, method, slopes, h):
    """Largest modulus of an eigenvalue of one step, over slopes."""
    found = []
    for slope in slopes:
        linear, forced = matrices(content, slope)
        n, A = len(linear), linear + forced
        M = np.eye(n)
        if method == "exact":
            E = expm(h * np.block([[linear, np.eye(n)], [np.zeros((n, 2 * n))]]))
            M = E[:n, :n] + E[:n, n:] @ forced
        else:
            for k in range({"euler": 1, "rk4": 4}[method], 0, -1):
                M = np.eye(n) + h * A / k @ M
        found.append(np.abs(np.linalg.eigvals(M)).max())
    return max(found)


@pytest.mark.parametrize(
    ("text", "slopes"),
    [
        (MOTOR % "{type: l2, L2: 0, alpha: 10, bounds: {L1: 1.0e+5}}", (0, 1)),
        (CELL, (0.5, 2.5)),
        (CELL.replace("l2", "linf"), (0.5, 2.5)),
        (LOOP, (-0.5, 0.5)),
    ],
)
def test_the_worst_pole_and_the_steps_are_those_of_the_worst_slope(text, slopes):
    content, table = solved(text)
    found, grid = content["analysis"], np.linspace(*slopes, 5)
    poles = np.concatenate([np.linalg.eigvals(sum(matrices(content, slope))) for slope in grid])
    assert found["worst_pole"][0] == pytest.approx(poles.real.max(), rel=1e-6)
    steps = found["largest_step"]
    assert content["observer"]["largest_step"] == steps["rk4"]
    for method, step in steps.items():
        if step is None:
            assert radius(content, method, grid, 100 * steps["rk4"]) <= 1
            continue
        assert radius(content, method, grid, 0.99 * step) <= 1 + 1e-9
        assert radius(content, method, grid, 1.02 * step) > 1
    assert "of the linear part, without f" in table
    assert "the slowest that was found of f = K q of the types" in table
    assert f"{round_down(steps['rk4'], 3):g} s (Runge-Kutta 4)" in table


def test_a_linear_plant_may_be_discretised_exactly_with_any_step():
    content, _ = solved(CELL.replace("{slope: [0.5, 2.5]}, Bf: [0, 0]", "tanh, Bf: [0, 0]").replace("Df: 1", "Df: 0")
                        .replace("[[0, 0], [0, -0.0333]]", "[[-1, 0], [0, -2]]"))  # fmt: skip
    steps = content["analysis"]["largest_step"]
    assert steps["exact"] is None
    assert steps["euler"] == pytest.approx(2 / content["observer"]["fastest"])


def test_slopes_without_a_bound_leave_no_step_and_the_table_says_so():
    text = ANY % ("monotone", "{type: l2, L2: -2, alpha: 0.1}")
    for old, new in (("0.2*sin(q)", "q**3"), ("[0, 0.5], Cq: [1, 0]", "[0, -0.5], Cq: [0, 1]")):
        text = text.replace(old, new)
    content, table = solved(text)
    assert content["analysis"]["worst_pole"] is None
    assert set(content["analysis"]["largest_step"].values()) == {None}
    assert content["observer"]["largest_step"] is None
    assert table.count("not told: slopes of f are not bounded") == 2


def test_a_plant_without_f_whose_observer_has_no_stable_pole_is_not_said_to_have_slopes():
    plant = "obsdesign: 1\nsystem: {A: [[1]], B: [1], C: [1]}\n"
    content, table = solved(f"{plant}observer: {{type: sporadic, T1: 0.1, T2: 0.1, decay: 0.1, injection: hold}}\n")
    assert content["analysis"]["largest_step"] == {"euler": 0.0, "rk4": 0.0, "exact": None}
    assert "largest step  not told: there is no stable pole to bound it" in table
    assert "slopes" not in table


@pytest.mark.parametrize("observer", FAMILIES.values(), ids=FAMILIES)
def test_every_design_has_its_analysis_and_says_what_of_its_file_is_not_proved(observer):
    content, table = solved(ANY % ("{lipschitz: 0.2}", observer))
    found = content["analysis"]
    assert set(found["largest_step"]) == {"euler", "rk4", "exact"}
    assert found["largest_step"]["rk4"] > 0
    assert set(found["no_observer"]) == {"zero", "open_loop"}
    assert ("worst_pole" in found) != ("sporadic" in observer)
    assert "largest step" in table
    for path in content["numerical"]:
        value = content
        for key in path.split("."):
            value = value[0][key] if isinstance(value, list) else value[key]
    assert {"analysis", "guarantee.limit"} <= set(content["numerical"])
    assert {key for key in content["guarantee"] if f"guarantee.{key}" not in content["numerical"]} <= PROVED
    assert run("verify", "spec.gains.json", "-q").exit_code == 0
    assert json.loads(to_json(content)) == content


def test_the_gain_of_no_observer_is_that_of_the_plant_and_a_design_that_is_no_better_says_so():
    text = (
        "obsdesign: 1\nname: y says nothing of x1\n"
        "system: {A: [[-2, 0], [0, -3]], B: [1, 0], C: [0, 1]%s}\nperformance: [x1]\n"
        "observer: {type: l2, alpha: 0.1}\n"
    )
    content, table = solved(text % "")
    assert content["analysis"]["no_observer"] == {"zero": pytest.approx(0.5), "open_loop": pytest.approx(0.5)}
    assert (
        "does not prove that this is better than no observer at all: with z estimated by 0 the gain is 0.5"
        in content["notes"][-1]
    )
    assert "0.5 with z estimated by 0, 0.5 with a copy of the plant that uses no y" in table
    moved, _ = solved(text % ', gx: ["sin(t)", 0]')
    assert moved["analysis"]["no_observer"] == {"zero": None, "open_loop": pytest.approx(0.5)}
    shown = (text % "").replace("C: [0, 1]", "C: [1, 1]").replace("alpha: 0.1", "alpha: 0.1, bounds: {L1: 9}")
    better, _ = solved(shown)
    assert not any("no better" in note for note in better.get("notes", []))


@pytest.mark.parametrize("observer", FAMILIES.values(), ids=FAMILIES)
def test_a_claim_is_shown_on_the_safe_side(observer):
    rates = {"alpha: 0.1,": "alpha: 0.0123456789,", "decay: 0.1,": "decay: 0.0123456789,", "0.05": "0.0123456789"}
    for old, new in rates.items():
        observer = observer.replace(old, new)
    content, table = solved(ANY % ("{lipschitz: 0.2}", observer))
    claimed = content["guarantee"]
    decay = claimed.get("alpha", claimed.get("decay"))
    for said in (table, run("verify", "spec.gains.json").stdout.splitlines()[-1]):
        gamma, rate = (re.search(rf"{name} +([^ ,;]+)", said)[1] for name in ("gamma", "decay rate"))
        assert claimed["gamma"] <= float(gamma) <= claimed["gamma"] * (1 + 2e-5)
        assert decay * (1 - 2e-5) <= float(rate) <= decay


def test_the_peak_gain_is_told_from_both_sides():
    content, table = solved(
        "obsdesign: 1\nname: first order\nsystem: {A: -1, B: [[1, 0]], C: 1, D: [[0, 1]]}\n"
        "observer: {type: linf, alpha: 0.5, gains: {L1: -1, L2: []}}\n"
    )
    peak = content["analysis"]["peak_gain"]  # e' = -2 e - [1, -1] v
    assert peak["least"] == pytest.approx(np.sqrt(2) / 2, rel=1e-4)
    assert peak["least"] <= peak["most"] <= content["guarantee"]["gamma"] * (1 + 1e-9)
    ends = f"at least {at_least(peak['least'], 4)}, at most {at_most(peak['most'], 4)} by V of the certificate"
    assert ends in table
    assert "Of `linf` gamma bounds the same quantity" in run("explain", "peak gain").stdout


def test_the_peak_gain_has_a_lower_bound_beside_a_pole_that_is_much_faster():
    system = {"A": [[-1, 1e8], [0, -2]], "B": [[0], [1]], "C": [[0, 1]], "D": [[1]]}
    observer = {"type": "linf", "alpha": 0.1, "objective": "feasibility", "gains": {"L1": [[-3e7], [-1.5e9]], "L2": []}}
    peak = od.solve(od.Spec(system=system, observer=observer)).analysis["peak_gain"]
    assert peak["least"] == pytest.approx(1e8, rel=1e-3)  # 3e7 at once, and 7e7 by way of the fast state
    assert peak["least"] <= peak["most"]


@pytest.mark.parametrize("kind", ["l2", "linf"])
def test_the_peak_gain_of_slopes_without_a_bound_is_at_least_that_of_the_member_without_slope(kind):
    system = {"A": [[-1, 0], [0, -2]], "B": [[1], [0]], "C": [[0, 1]]}
    blocks = [{"type": "monotone", "Bf": [[-1], [0]], "Cq": [[1, 0]]}]
    observer = {"type": kind, "alpha": 0.5, "L2": 0}
    peak = od.solve(od.Spec(system=system, nonlinearities=blocks, observer=observer)).analysis["peak_gain"]
    assert peak["least"] == pytest.approx(1, rel=1e-3)  # e1' = -e1 - k e1 - v, k >= 0
    assert peak["least"] <= peak["most"]


RESONANT = """
obsdesign: 1
name: Flexible joint, an encoder at the motor
system: {A: [[0, 1, 0, 0], [-4000, -2.5, 4000, 0], [0, 0, 0, 1], [800, 0, -800, 0]], B: [0, 0, 0, 1], C: [1, 0, 0, 0]}
observer: {type: l2, alpha: 0.1, gains: {L1: [-2, 0, 0, 0]}}
"""


def test_the_noise_gain_at_a_light_resonance_is_its_peak():
    content, _ = solved(RESONANT)
    A, L = np.array([[0, 1, 0, 0], [-4000, -2.5, 4000, 0], [0, 0, 0, 1], [800, 0, -800, 0]]), np.array([2, 0, 0, 0])
    omega = np.concatenate([np.linspace(0, 100, 20001), np.geomspace(100, 1e4, 5001)])
    error = A - np.outer(L, [1, 0, 0, 0])
    sizes = np.abs(np.linalg.solve(1j * omega[:, None, None] * np.eye(4) - error, L[:, None] + 0j))[..., 0]
    assert -3 < np.linalg.eigvals(error).real.max() < 0
    assert [*content["observer"]["noise_gain"].values()] == pytest.approx(sizes.max(axis=0), rel=1e-4)


def test_the_contraction_from_one_measurement_to_the_next_is_that_of_the_worst_slope():
    content, table = solved(ANY % ("{slope: [-0.4, 0.2]}", FAMILIES["sporadic"]))
    made = content["observer"]
    L, H, C = np.array(made["L"]), np.array(made["H"]), np.array([[1, 0]])
    for name in ("T1", "T2"):
        sizes = []
        for slope in (-0.4, -0.2, 0, 0.2):
            A = np.array([[0, 1], [-1 + 0.5 * slope, -1]])
            E = expm(made[name] * np.block([[A, -L], [np.zeros((1, 2)), H]]))
            sizes.append(np.abs(np.linalg.eigvals(E[:2, :2] + E[:2, 2:] @ C)).max())
        assert abs(complex(*made["multipliers"][name][0])) == pytest.approx(sizes[2])
        assert made["contraction"][name] == pytest.approx(max(sizes))
    assert "the slowest that was found of f = K q of the types" in table


def test_the_worst_member_of_a_ball_of_matrices_is_found():
    """A = -I and K = 0.55 u v' with u = Bf / |Bf|: the poles lie between -1 - 0.55 |Bf| and -1 + 0.55 |Bf|."""
    Bf = np.array([[1], [0.5], [-1]])
    system = {"A": -np.eye(3), "B": [[1], [0], [0]], "C": [[1, 0, 0]]}
    blocks = [{"type": {"lipschitz": 0.55}, "Bf": Bf, "Cq": np.eye(3)}]
    observer = {"type": "lipschitz", "objective": "min-gamma", "gains": {"L": [[0], [0], [0]]}}
    found = od.solve(od.Spec(system=system, nonlinearities=blocks, observer=observer)).analysis
    reach = 0.55 * np.linalg.norm(Bf)
    assert found["worst_pole"] == pytest.approx([-1 + reach, 0], abs=1e-6)
    assert found["largest_step"]["euler"] == pytest.approx(2 / (1 + reach), rel=1e-6)


def test_the_peak_gain_of_a_vector_is_no_more_than_what_is_proved():
    """For f = 0 the largest integral of |u' h| over unit vectors u is 12.94, that of |h| 20.0."""
    system = {"A": [[-0.05, 1], [-1, -0.05]], "B": [[0], [1]], "C": [[1, 0]]}
    blocks = [{"type": {"lipschitz": 1e-4}, "Bf": [[0], [1]], "Cq": [[0, 1]]}]
    observer = {"type": "linf", "alpha": 0.02, "L2": 0, "gains": {"L1": [[-1e-5], [0]], "L2": [[0]]}}
    design = od.solve(od.Spec(system=system, nonlinearities=blocks, observer=observer))
    peak = design.analysis["peak_gain"]
    assert peak["least"] == pytest.approx(12.94, rel=2e-3)
    assert peak["least"] <= peak["most"]


SAMPLED = ANY.replace("B: [0, 1]", "B: [[0], [1]]") % ("{slope: [-0.4, 0.2]}", FAMILIES["sporadic"])


def steps_of(content, name, slope):
    """Step of (e, d) of the whole, and of e from one measurement to the next, for a slope."""
    made, C = content["observer"], np.array([[1, 0]])
    A = np.array([[0, 1], [-1 + 0.5 * slope, -1]])
    flow = np.block([[A, -np.array(made["L"])], [np.zeros((1, 2)), np.array(made["H"])]])
    E = expm(made[name] * flow)
    return flow, E[:2, :2] + E[:2, 2:] @ C, E[:2, 2:]


def test_the_noise_gain_of_sporadic_measurements_is_that_of_a_sinusoid_at_the_samples():
    content, table = solved(SAMPLED)
    found = content["observer"]["noise_gain"]
    largest = np.zeros(2)
    for name, slope in itertools.product(("T1", "T2"), (-0.4, -0.1, 0.2)):
        _, Phi, Gamma = steps_of(content, name, slope)
        for angle in np.linspace(0, np.pi, 40):
            e, sizes = np.zeros(2, complex), []
            for k in range(600):  # eta = exp(i k angle)
                e = Phi @ e + Gamma[:, 0] * np.exp(1j * k * angle)
                sizes.append(np.abs(e))
            largest = np.maximum(largest, sizes[-1])
    assert list(found) == ["x1", "x2"]
    assert [*found.values()] == pytest.approx(largest, rel=0.02)
    assert (np.array([*found.values()]) >= largest * (1 - 1e-3)).all()
    assert "observer.noise_gain" in content["numerical"]
    assert re.search("^noise gain +x1 .*at the measurements, T1 or T2 apart$", table, re.M)


def test_the_peak_gain_of_sporadic_measurements_is_reached_by_the_worst_input_and_no_more_than_what_is_proved():
    content, table = solved(SAMPLED)
    peak, H = content["analysis"]["peak_gain"], np.eye(2)
    reached = []
    for name, slope in itertools.product(("T1", "T2"), (-0.4, -0.1, 0.2)):
        flow, Phi, _ = steps_of(content, name, slope)
        T = content["observer"][name]
        area = np.zeros(2)
        inside = [expm(flow * T * (i + 0.5) / 100)[:2, :2] @ [0, 1] * T / 100 for i in range(100)]
        for k in range(400):
            area += np.abs([H @ np.linalg.matrix_power(Phi, k) @ column for column in inside]).sum(axis=0)
        reached.append(area.max())  # w = +-1 that drives one state
    assert peak["most"] >= peak["least"] >= max(reached) * (1 - 1e-3)
    assert peak["least"] <= np.sqrt(2) * max(reached)  # |z|^2 = z1^2 + z2^2
    assert "sup|z| for sup|v| = 1" in table


def test_a_peak_of_many_modes_is_the_same_with_fewer_instants(monkeypatch):
    W, rng = np.diag(np.arange(1, 9) ** 2.0), np.random.default_rng(0)
    A = np.block([[np.zeros((8, 8)), W], [-W, -0.05 * (W + np.eye(8))]])
    system = A, rng.normal(size=(16, 2)), np.eye(16)
    few, widths = modes.EXPONENTIALS.impulse(*system)
    monkeypatch.setattr(modes, "MOST_INSTANTS", np.inf)
    many, finer = modes.EXPONENTIALS.impulse(*system)
    assert len(widths) < 0.6 * len(finer)
    assert areas.largest_area(few, widths) == pytest.approx(areas.largest_area(many, finer), rel=1e-6)


def test_a_large_system_has_the_gains_that_a_small_one_would_be_computed_to_have(monkeypatch):
    W, rng = np.diag(np.arange(1, 13) ** 1.5), np.random.default_rng(0)
    A = np.block([[np.zeros((12, 12)), W], [-W, -0.05 * (W + np.eye(12))]])
    systems = [(A - k * np.eye(24), rng.normal(size=(24, 2))) for k in (0, 0.5)]
    H, of = rng.normal(size=(3, 24)), modes.EXPONENTIALS
    exact = max(areas.largest_area(*of.impulse(*system, H)) for system in systems)
    assert areas.worst_area(of.impulse, systems, H) == pytest.approx(exact, rel=1e-3)
    chained = np.diag(np.full(23, 3.0), 1) - np.diag(np.linspace(5, 5.1, 24)), systems[0][1]  # modes near each other
    assert [residues.Spectrum.of(A) is None for A, _ in (*systems, chained)] == [False, False, True]
    systems.append(chained)
    large = [[*of.amplitudes(*system), of.gain(*system, H)] for system in systems]
    monkeypatch.setattr(modes, "LARGE", 25)
    small = [[*of.amplitudes(*system), of.gain(*system, H)] for system in systems]
    assert np.array(large) == pytest.approx(np.array(small), rel=1e-5)


def test_white_noise_is_the_same_as_a_sum_over_modes():
    rng = np.random.default_rng(0)
    A, N, E = rng.normal(size=(8, 8)), rng.normal(size=(8, 2)), rng.normal(size=(3, 8))
    for of, stable in ((modes.EXPONENTIALS, A - 5 * np.eye(8)), (modes.POWERS, A / 5)):
        assert of.norms(stable, N, E, residues.Spectrum.of(stable)) == pytest.approx(of.norms(stable, N, E), rel=1e-9)


def test_the_largest_areas_are_those_of_all_directions():
    rng = np.random.default_rng(0)
    h, widths = rng.normal(size=(2, 5, 300)) * np.exp(-np.arange(300) / 40), rng.uniform(size=300)
    tried = areas.directions(h, widths)
    every = areas.areas(h, widths, tried)
    sizes, places = areas.largest_areas(h, widths, tried, 4)
    assert len(tried) > 100
    assert sizes == pytest.approx(np.sort(every)[-4:], rel=1e-12)
    assert every[places] == pytest.approx(sizes, rel=1e-12)


def test_explicit_steps_are_the_largest_that_keep_each_mode_within_the_unit_circle():
    rng = np.random.default_rng(0)
    for _ in range(20):
        poles = -(10.0 ** rng.uniform(-3, 1, 6)) + 1j * rng.normal(size=6)
        for name, order in (("euler", 1), ("rk4", 4)):
            h = steps.explicit_steps(poles)[name]
            for factor, held in ((0.998, True), (1.002, False)):
                grown = np.polynomial.Polynomial([1 / factorial(k) for k in range(order + 1)])(poles * h * factor)
                assert (np.abs(grown) <= 1).all() == held


def test_powers_vanish_where_every_eigenvalue_is_within_the_unit_circle():
    rng = np.random.default_rng(0)
    M = rng.normal(size=(9, 6, 6))
    M /= np.abs(np.linalg.eigvals(M)).max(axis=1)[:, None, None]
    assert steps.vanish(0.99 * M)
    assert steps.vanish((1 - 1e-8) * M)
    assert not steps.vanish(np.concatenate([0.5 * M, 1.001 * M[:1]]))


def test_the_largest_ratio_of_two_forms_is_proved_and_near():
    rng = np.random.default_rng(0)
    M, units = rng.normal(size=(24, 24)), 10.0 ** rng.integers(-3, 4, 24)
    P, H = rational((M @ M.T + 1e-6 * np.eye(24)) * np.outer(units, units)), rational(rng.normal(size=(3, 24)))
    exact, near = extremes(outputs(P, H))[1], near_largest_ratio(P, H)
    assert exact < near < exact * (1 + 1e-6)


@pytest.mark.parametrize("count", [5, 10])
def test_of_many_blocks_the_ends_of_all_slopes_are_tried(count):
    """Of a few blocks all vertices are tried."""
    multiplier = od.load(chain(2 * count, springs=tuple(range(count)))).multiplier
    tried = {tuple(np.diag(K)) for K in members(multiplier)}
    ends = [sorted(float(K.item()) for K in block.vertices) for block in multiplier.blocks]
    low, high = (tuple(each[k] for each in ends) for k in (0, -1))
    wanted = set(itertools.product(*zip(low, high, strict=True))) if count == 5 else {low, high}
    assert wanted <= tried
