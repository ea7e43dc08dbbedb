"""Observers of Lipschitz systems in discrete time, against limits that were computed apart from this code."""

import copy
import json
import math
import re

import numpy as np
import pytest
from support.commands import run
from support.forging import claiming, put, with_spec
from support.samples import text

from obsdesign.dissipation.certificate import rate_of
from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UsageError
from obsdesign.families.lipschitz.coordinates import scaling
from obsdesign.families.lipschitz.design import design
from obsdesign.families.lipschitz.relaxations import DiscreteLipschitz, proportions
from obsdesign.families.lipschitz.suprema import ceiling, largest_constant
from obsdesign.families.outcome import Verdict
from obsdesign.lmi.formula import printed
from obsdesign.plot import search_figure
from obsdesign.plot.front import Front
from obsdesign.plot.surface import Grid
from obsdesign.reading import loads
from obsdesign.work import check


def made(plant, observer, **values):
    """Outcome of a design."""
    return design(loads(text(plant, f"type: lipschitz, {observer}", **values)), Engine())


def supremum(spec):
    """Largest constant over all gains, and the ceiling of linear f."""
    request = spec.observer
    unit = DiscreteLipschitz.of(spec.posed, spec.multiplier, proportions(request.lipschitz), spec.H, request.rates[0])
    return largest_constant(Engine(), unit, "s-procedure").value, ceiling(unit)


def small(system, f, observer=""):
    """Spec of a small plant."""
    return loads(
        f"obsdesign: 1\nsystem: {{time: discrete, {system}}}\nnonlinearities: [{{{f}}}]\n"
        f"observer: {{type: lipschitz{observer}}}\n"
    )


# Limits


@pytest.mark.parametrize(
    ("constant", "rho", "estimate", "gamma", "rtol"),
    [
        (0.8, 1, "predicted", 0.599741130, 1e-6),
        (0.5, 0.95, "predicted", 0.730880428, 1e-6),
        (0.8, 0.95, "predicted", 0.801892757, 1e-6),
        (2, 0.95, "predicted", 1.533999592, 1e-6),
        (0.8, 0.95, "filtered", 0.774784286, 1e-6),
        (0.5, 0.95, "filtered", 0.731455, 2e-6),
    ],
)
def test_the_least_gamma_is_that_of_the_reference_and_gains_near_it_are_proved(constant, rho, estimate, gamma, rtol):
    outcome = made("R3", f"objective: min-gamma, slack: .01, rho: {rho}, estimate: {estimate}", L=constant)
    assert outcome.status is Verdict.CERTIFIED
    assert outcome.limit["gamma"] == pytest.approx(gamma, rel=rtol)
    assert outcome.limit["attained"] == (rho < 1)  # the inequality is strict at rho = 1
    assert float(outcome.claim.certificate.gamma) <= gamma * (1.01 + rtol)
    assert (outcome.gains["L"] == np.vectorize(lambda x: float(f"{x:.6g}"))(outcome.gains["L"])).all()


@pytest.mark.parametrize(
    ("plant", "rho", "most", "rtol"),
    [("R3", 1, 23.569461, 1e-6), ("R3", 0.95, 20.578090, 1e-6), ("K7", 1, (math.sqrt(2) - 1) / 0.01**2, 1e-6)],
)
def test_the_largest_constant_is_that_of_the_reference_and_gains_near_it_are_proved(plant, rho, most, rtol):
    outcome = made(plant, f"slack: .01, rho: {rho}", L=0.5)
    assert outcome.status is Verdict.CERTIFIED
    assert outcome.limit["lipschitz"] == pytest.approx(most, rel=rtol)
    assert most / 1.0101 <= float(outcome.claim.lipschitz) < most


@pytest.mark.parametrize(
    ("plant", "rho", "most"), [("R3", 1, 0.160074901), ("R3", 0.95, 0.144716723), ("K7", 1, 0.00998776)]
)
def test_without_structure_the_largest_constant_is_far_smaller(plant, rho, most):
    structured = text(plant, f"type: lipschitz, rho: {rho}", L=0.001)
    anything = re.sub("nonlinearities: .*", "nonlinearities: [{type: {lipschitz: .001}}]", structured)
    found, linear = supremum(loads(anything))
    assert found == pytest.approx(most, rel=1e-6)
    assert found <= linear * (1 + 1e-6)


@pytest.mark.parametrize("rho", [1, 0.95, 0.5])
@pytest.mark.parametrize("a", [0.5, -1.3])
def test_of_one_state_the_largest_constant_is_rho(a, rho):
    spec = small(f"A: {a}, C: 1", "type: {lipschitz: .1}, Bf: 1, Cq: 1", f", rho: {rho}")
    assert supremum(spec)[0] == pytest.approx(rho, rel=1e-9)


@pytest.mark.parametrize("estimate", ["predicted", "filtered"])
@pytest.mark.parametrize("rho", [1, 0.95])
@pytest.mark.parametrize(
    ("A", "Bf", "Cq"),
    [
        ("[[.5, 0], [.3, .4]]", "[0, 1]", "[1, 0]"),  # f never reaches its argument
        ("[[.5, 0, 0], [1, .3, 0], [0, 1, .2]]", "[1, 0, 0]", "[0, 0, 1]"),  # y shows it a sample before
    ],
)
def test_every_constant_will_do_where_f_can_be_kept_from_its_argument(A, Bf, Cq, rho, estimate):
    C = "[1, 0]" if len(A) < 30 else "[1, 0, 0]"
    spec = small(
        f"A: {A}, C: {C}", f"type: {{lipschitz: .1}}, Bf: {Bf}, Cq: {Cq}", f", rho: {rho}, estimate: {estimate}"
    )
    assert supremum(spec)[0] == math.inf


def test_filtered_estimates_have_no_limit_where_y_shows_all_states():
    spec = small("A: [[.5, .1], [.2, .3]], C: [[1, 0], [0, 1]]", "type: {lipschitz: .1}", ", estimate: filtered")
    assert supremum(spec) == (math.inf, None)
    predicted = small("A: [[.5, .1], [.2, .3]], C: [[1, 0], [0, 1]]", "type: {lipschitz: .1}")
    assert supremum(predicted)[0] == pytest.approx(1, rel=1e-9)


def test_several_blocks_grow_in_proportion():
    """Two plants side by side: each alone, in the proportion of the declared constants, and the lesser of both."""

    def most(first, second):
        A, C = "[[.9, .1, 0, 0], [0, .8, 0, 0], [0, 0, .9, .1], [0, 0, 0, .5]]", "[[1, 0, 0, 0], [0, 0, 1, 0]]"
        blocks = [("[0, 1, 0, 0]", first), ("[0, 0, 0, 1]", second)]
        f = "}, {".join(f"type: {{lipschitz: {k}}}, Bf: {B}, Cq: {B}" for B, k in blocks if k)
        return supremum(small(f"A: {A}, C: {C}", f))[0]

    alone = most(1, 0), most(0, 1)
    assert most(1, 1) == pytest.approx(min(alone), rel=2e-6)
    assert most(1, 0.1) == pytest.approx(min(alone[0], 10 * alone[1]), rel=2e-6)
    assert most(0.1, 1) == pytest.approx(min(10 * alone[0], alone[1]), rel=2e-6)


@pytest.mark.parametrize(
    ("weight", "lipschitz", "gamma", "objective"),
    [(0.5, 1.077075, 0.913588, 0.881541807), (0.2, 0.735246, 0.781573, 0.760702344)],
)
def test_pareto(weight, lipschitz, gamma, objective):
    outcome = made("R3", f"objective: pareto, rho: .95, weight: {weight}", L=0.5)
    assert outcome.status is Verdict.CERTIFIED
    assert outcome.limit["objective"] == pytest.approx(objective, rel=1e-6)
    assert outcome.limit["lipschitz"] == pytest.approx(lipschitz, rel=2e-5)
    assert outcome.limit["gamma"] == pytest.approx(gamma, rel=2e-5)
    claim = outcome.claim
    reached = weight / float(claim.lipschitz) + (1 - weight) * float(claim.certificate.gamma) ** 2
    assert objective <= reached <= objective * 1.05 * (1 + 1e-6)


def test_a_surface_over_weight_and_rho():
    ranges = "rho: {min: .95, max: 1, points: 2}, weight: {min: .2, max: .5, points: 2}"
    spec = loads(text("R3", f"type: lipschitz, objective: pareto, {ranges}", L=0.5))
    outcome = design(spec, Engine())
    assert outcome.search.parameters == ("weight", "rho")
    points = [(p["weight"], p["rho"], p["status"]) for p in outcome.search.points]
    assert points == [(w, r, "certified") for r in (1, 0.95) for w in (0.2, 0.5)]
    assert outcome.limit["at"]["rho"] == 1
    grid = Grid.of(outcome.search.points)
    assert grid.decays.tolist() == [0.95, 1]
    assert np.isfinite(grid.table(np.array([p["gamma"] for p in outcome.search.points]))).all()
    found = {
        "name": "R3",
        "search": outcome.search.written(),
        "guarantee": outcome.claim.written(spec, {})["guarantee"],
    }
    assert search_figure(found, spec).startswith(b"\x89PNG")
    line = [p for p in found["search"]["points"] if p["weight"] == 0.2]
    assert Front.of(line).parameter == "rho"


# What a ceiling says


def test_the_ceiling_of_a_linear_f_is_of_a_mode_outside_the_circle_on_either_side():
    for a, rho in ((0.5, 0.9), (-0.5, 0.9), (0.2, 1)):
        spec = small(f"A: [[.1, 0], [0, {a}]], C: [1, 0]", "type: {lipschitz: .1}", f", rho: {rho}")
        assert supremum(spec)[1] == pytest.approx(rho - abs(a), rel=1e-9)
        filtered = small(
            f"A: [[.1, 0], [0, {a}]], C: [1, 0]", "type: {lipschitz: .1}", f", rho: {rho}, estimate: filtered"
        )
        assert supremum(filtered)[1] == pytest.approx(rho - abs(a), rel=1e-9)


# Invariances


def transformed(T, y):
    """R3 with the states T x and the output y times itself."""
    A, C = np.array([[0.9, 0.2, 0], [-0.1, 1.05, 0.1], [0, 0.1, 0.6]]), np.array([[1.0, 0, 0]])
    B, Bf, Cq, D = np.array([[0.1, 0], [0, 0], [0.2, 0]]), np.array([0, 0, 0.2]), np.array([0, 1.0, 0]), [[0, 0.3 * y]]
    back = np.linalg.inv(T)
    system = f"A: {(T @ A @ back).tolist()}, C: {(y * C @ back).tolist()}, B: {(T @ B).tolist()}, D: {D}"
    f = f"type: {{lipschitz: .8}}, Bf: {(T @ Bf).tolist()}, Cq: {(Cq @ back).tolist()}"
    return system, f, back.tolist()


@pytest.mark.parametrize("estimate", ["predicted", "filtered"])
@pytest.mark.parametrize(
    "T", [np.diag([1e3, 1, 1e-2]), np.array([[1.0, 2, 0], [0, 1, -1], [1, 0, 1]]), np.diag([1e-3, 1e-3, 1e-3])]
)
def test_units_and_coordinates_change_no_limit(T, estimate):
    system, f, H = transformed(T, 50.0)
    for objective, plain in (("min-gamma", {"predicted": 0.801892757, "filtered": 0.774784286}[estimate]), ("", None)):
        asked = f", rho: .95, estimate: {estimate}" + (f", objective: {objective}" if objective else "")
        spec = loads(
            f"obsdesign: 1\nsystem: {{time: discrete, {system}}}\nnonlinearities: [{{{f}}}]\n"
            f"performance: {{H: {H}}}\nobserver: {{type: lipschitz{asked}}}\n"
        )
        outcome = design(spec, Engine())
        assert outcome.status is Verdict.CERTIFIED
        if plain:
            assert outcome.limit["gamma"] == pytest.approx(plain, rel=1e-6)
        else:
            most = {"predicted": 20.578090, "filtered": 50 * 0.95**2}[estimate]
            assert outcome.limit["lipschitz"] == pytest.approx(most, rel=1e-6)


# What is claimed, held against frozen members and runs


def matrices(spec, L):
    """Ne, Nf and Nv of predicted estimates and of filtered ones, e = x - xhat, from the equations of the observer."""
    p = spec.augmented.doubles
    if not spec.observer.filtered:
        return p.A - L @ p.C, p.Bf, p.B - L @ p.D, np.zeros_like(L @ p.D)
    cut = np.eye(p.n) - L @ p.C
    return cut @ p.A, cut @ p.Bf, cut @ p.B, -L @ p.D  # the last one for v at the next sample


@pytest.mark.parametrize("estimate", ["predicted", "filtered"])
@pytest.mark.parametrize("rho", [1, 0.95])
def test_no_linear_f_has_a_larger_gain_on_the_circle_or_is_slower(rho, estimate):
    spec = loads(text("R3", f"type: lipschitz, objective: min-gamma, rho: {rho}, estimate: {estimate}", L=0.8))
    outcome = design(spec, Engine())
    Ne, Nf, Nv, later = matrices(spec, outcome.gains["L"])
    Cq, gamma, worst = spec.augmented.doubles.Cq, float(outcome.claim.certificate.gamma), 0.0
    z = rho * np.exp(1j * np.linspace(0, np.pi, 400))[:, None, None]
    for k in np.linspace(-0.8, 0.8, 17):
        frozen = Ne + k * Nf @ Cq
        assert np.abs(np.linalg.eigvals(frozen)).max() < rho
        drive = np.broadcast_to(Nv + 0 * z, (len(z), *Nv.shape))
        drive = np.concatenate([drive, np.broadcast_to(later, drive.shape)], axis=-1)
        gains = np.linalg.norm(np.linalg.solve(z * np.eye(3) - frozen, drive), 2, axis=(1, 2))
        worst = max(worst, gains.max() / gamma)
    assert 0.5 < worst <= 1


@pytest.mark.parametrize("estimate", ["predicted", "filtered"])
def test_runs_of_plant_and_observer_keep_to_what_is_stated(estimate):
    spec = loads(text("R3", f"type: lipschitz, objective: min-gamma, rho: .95, estimate: {estimate}", L=0.8))
    outcome = design(spec, Engine())
    claim, L, p = outcome.claim, outcome.gains["L"], spec.augmented.doubles
    gamma, P = claim.gamma(spec), claim.certificate.P.astype(float)
    f, rng, closest = lambda q: 0.8 * np.sin(q), np.random.default_rng(1), 0.0
    for _ in range(20):
        x, xhat = rng.normal(size=(2, 3))
        stored, z2, w2, w = (x - xhat) @ P @ (x - xhat), 0.0, 0.0, rng.normal(size=2)
        for k in range(60):  # w of the same sample is known of a filtered estimate
            z2, w2 = z2 + (x - xhat) @ (x - xhat), w2 + w @ w
            assert z2 <= stored + gamma**2 * (w2 + 1e-9)
            after, copied = (p.A @ s + p.Bf @ f(p.Cq @ s) for s in (x, xhat))
            y, x = p.C @ x + p.D @ w, after + p.B @ w
            w = rng.normal(size=2) * 0.9**k
            if spec.observer.filtered:
                xhat = copied + L @ (p.C @ x + p.D @ w - p.C @ copied)
            else:
                xhat = copied + L @ (y - p.C @ xhat)
        closest = max(closest, z2 / (stored + gamma**2 * w2))
    assert closest > 0.05


# Files


@pytest.fixture(scope="module", params=["predicted", "filtered"])
def result(request, tmp_path_factory):
    """A result file of the command, as Python values."""
    folder = tmp_path_factory.mktemp("lipschitz")
    observer = f"type: lipschitz, objective: min-gamma, decay: .5, estimate: {request.param}"
    (folder / "r3.yaml").write_text(text("R3", observer, L=0.8).replace("time: discrete", "time: discrete, period: .1"))
    outcome = run("solve", folder / "r3.yaml", "-o", folder / "r3.json", "-q")
    assert outcome.exit_code == 0, outcome.output
    return json.loads((folder / "r3.json").read_text())


@pytest.fixture
def content(result):
    """The same, to be forged."""
    return copy.deepcopy(result)


def test_a_file_holds_rho_and_alpha_and_is_proved(content, outcome_of):
    guarantee, observer = content["guarantee"], content["observer"]
    assert guarantee["rho"] == 0.9512294  # exp(-.05) = .951229424..; 1 - rho in 6 digits
    assert 0.5 <= guarantee["alpha"] <= -math.log(0.9512294) / 0.1
    assert "decay" not in guarantee
    assert observer["period"] == 0.1
    assert ("gamma_v" in guarantee) == (observer["estimate"] == "filtered")
    said = guarantee["statement"]
    assert "|e_k| <= sqrt(cond(P)) 0.9512294^k |e0| where w = 0" in said
    assert ("xhat+ = xbar + L (y+ - C xbar)" in said) == (observer["estimate"] == "filtered")
    assert ("xhat+ = A xhat + Bf f(Cq xhat) + g + L (y - C xhat)" in said) == (observer["estimate"] == "predicted")
    outcome = outcome_of(content)
    assert outcome.exit_code == 0
    assert "rho 0.95123;" in outcome.stdout.splitlines()[-1]


@pytest.mark.parametrize(("key", "value"), [("rho", 0.95), ("rho", 0.9999), ("alpha", 2.0), ("gamma", 0.1)])
def test_one_changed_number_is_refused(content, outcome_of, key, value):
    content["guarantee"][key] = value
    assert outcome_of(content).exit_code in {2, 4}


def test_a_smaller_rho_of_spec_and_file_is_not_proved(content, outcome_of):
    """Rho, alpha and the statement agree with the changed spec; the storage function does not."""
    with_spec(content, "decay: .5", "rho: .7")
    alpha = rate_of(0.7, printed(0.1))
    outcome = outcome_of(claiming(content, "0.9512294^k", "0.7^k", rho=0.7, alpha=alpha))
    assert outcome.exit_code == 4
    assert "rho^2 V" in outcome.stdout


def test_a_smaller_gamma_is_not_proved(content, outcome_of):
    """Mu2 and the statement agree with it."""
    gamma = float(f"{0.9 * content['guarantee']['gamma']:.6g}")
    mu2 = float(printed(gamma) * printed(gamma))
    said = repr(content["guarantee"].get("gamma_v", content["guarantee"]["gamma"]))
    more = {"gamma_v": gamma} if "gamma_v" in content["guarantee"] else {}
    forged = claiming(content, f"{said}^2", f"{gamma!r}^2", gamma=gamma, mu2=mu2, **more)
    forged["guarantee"]["limit"] = {"attained": False, "kind": "not-computed"}
    outcome = outcome_of(forged)
    assert outcome.exit_code == 4, outcome.output
    assert "rho^2 V" in outcome.stdout


def test_a_larger_constant_is_not_proved(content, outcome_of):
    """Tolerated is ten times what the witness proves."""
    largest = content["guarantee"]["admissible"] * 10
    put(content, ("certificate", "admissible", "lipschitz"), largest)
    margin = float(printed(largest) - printed(0.8))
    old = content["guarantee"]["margin"]
    outcome = outcome_of(claiming(content, f"{old!r} |dq|", f"{margin!r} |dq|", admissible=largest, margin=margin))
    assert outcome.exit_code == 4, outcome.output


@pytest.mark.parametrize(("key", "value"), [("estimate", "other"), ("period", 0.2)])
def test_another_estimate_or_period_is_refused(content, outcome_of, key, value):
    content["observer"][key] = value
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert f"observer.{key}" in outcome.stderr


def test_a_table_tells_rho(tmp_path):
    (tmp_path / "r3.yaml").write_text(text("R3", "type: lipschitz", L=0.8))
    outcome = run("solve", tmp_path / "r3.yaml", "-o", tmp_path / "r3.json")
    assert re.search("rho +1 a sample: e_k -> 0 without a disturbance", outcome.stdout)
    assert run("verify", tmp_path / "r3.json").exit_code == 0


# Given gains and bounds


def test_gains_are_analysed_as_they_are():
    best = made("R3", "objective: min-gamma, rho: .95, slack: .01", L=0.8)
    gain = best.gains["L"].ravel().tolist()
    given = made("R3", f"objective: min-gamma, rho: .95, gains: {{L: {gain}}}", L=0.8)
    assert given.status is Verdict.CERTIFIED
    assert given.limit == pytest.approx(best.limit, rel=1e-7)
    assert float(given.claim.certificate.gamma) <= float(best.claim.certificate.gamma)
    most = made("R3", f"rho: .95, gains: {{L: {gain}}}", L=0.8)
    assert 0.8 < float(most.claim.lipschitz) < most.limit["lipschitz"]


def test_gains_that_are_too_slow_are_refused_in_rho():
    outcome = made("R3", "objective: min-gamma, rho: .5, gains: {L: [.76, .69, .3]}", L=0.1)
    assert outcome.status is Verdict.INFEASIBLE
    assert "too slow for rho = 0.5" in outcome.diagnosis["reason"]
    pole = math.hypot(*outcome.diagnosis["pole"])
    assert outcome.diagnosis["feasible"] == {"rho_above": pytest.approx(pole)}
    unstable = made("R3", "objective: min-gamma, gains: {L: [-5, 0, 0]}", L=0.1)
    assert "does not decay" in unstable.diagnosis["reason"]


def test_a_bound_on_the_gain_costs_gamma_and_what_is_out_of_reach_is_answered_in_rho():
    free = made("R3", "objective: min-gamma, rho: .95", L=0.8)
    size = 0.8 * np.linalg.norm(free.gains["L"])
    bounded = made("R3", f"objective: min-gamma, rho: .95, bounds: {{L: {size:.4g}}}", L=0.8)
    assert bounded.status is Verdict.CERTIFIED
    assert np.linalg.norm(bounded.gains["L"]) <= size * (1 + 1e-3)
    assert bounded.limit_bounded["gamma"] > bounded.limit["gamma"]
    low = made("R3", "objective: min-gamma, rho: .95, bounds: {gamma: .7}", L=0.8)
    assert low.status is Verdict.INFEASIBLE
    assert "ask for rho at least 0.9" in low.diagnosis["suggestion"]
    slower = low.diagnosis["suggestion"].split("rho at least ")[1]
    assert made("R3", f"objective: min-gamma, rho: {slower}, bounds: {{gamma: .7}}", L=0.8).status is Verdict.CERTIFIED


def test_a_disturbance_model():
    spec = loads(text("K3", "type: lipschitz, objective: min-gamma, rho: .98"))
    outcome = design(spec, Engine())
    assert outcome.status is Verdict.CERTIFIED
    assert outcome.limit["gamma"] == pytest.approx(0.701821081, rel=1e-6)  # that of l2: sin has the constant 1
    assert "sum |v|^2" in outcome.claim.statement(spec)


# Answers


def test_no_constant_above_rho_of_one_state():
    spec = small("A: .5, B: 1, C: 1", "type: {lipschitz: 1.01}", ", objective: min-gamma")
    outcome = design(spec, Engine())
    assert outcome.status is Verdict.INFEASIBLE
    assert outcome.diagnosis["lipschitz"] == {"asked": 1.01, "supremum": 1.0}
    assert "rho / |Cq Bf|" in outcome.diagnosis["reason"]
    found = {f.name: f for f in check(spec)}
    assert not found["feedback"].holds
    assert found["feedback"].decides
    assert found["feedback"].numbers["supremum"] == pytest.approx(1)
    assert not found["supremum, s-procedure"].holds
    assert "supremum, norm-bound" not in found
    assert "sigma(H)" not in found


def test_a_larger_rho_or_another_measurement_is_suggested():
    plant = "A: [[.5, .1, 0], [0, .7, 1], [0, 0, .3]], C: [1, 0, 0], B: [1, 1, 0]"
    f = "type: {lipschitz: .5}, Bf: [0, 0, 1], Cq: [0, 0, 1]"
    outcome = design(small(plant, f, ", objective: min-gamma, rho: .6"), Engine())
    assert outcome.status is Verdict.INFEASIBLE
    assert "look at a larger rho (for 1 the supremum is" in outcome.diagnosis["suggestion"]
    assert "look at x3 as another measurement, with which the supremum is 0.6" in outcome.diagnosis["suggestion"]
    assert design(small(plant, f, ", objective: min-gamma, rho: 1"), Engine()).status is Verdict.CERTIFIED


@pytest.mark.parametrize(("mode", "rho"), [(1.1, 1), (1, 1), (0.96, 0.95), (0.95, 0.95)])
def test_a_hidden_mode_has_no_gain(mode, rho):
    plant = f"A: [[.9, 0], [0, {mode}]], C: [1, 0]"
    f = "type: {lipschitz: .01}, Bf: [1, 0], Cq: [1, 0]"
    outcome = design(small(plant, f, f", rho: {rho}"), Engine())
    assert outcome.status is Verdict.INFEASIBLE
    assert outcome.diagnosis["condition"] == "detectability"
    assert outcome.diagnosis["feasible"] == ({"rho_above": pytest.approx(mode)} if mode < 1 else {})


def test_scaled_coordinates_are_those_of_samples():
    system = "period: .1, A: [[1, .1], [-.1, .9]], C: [[1, 0]]"
    f = "f: 0.3*sin(q), type: {lipschitz: .3}, Bf: [0, .1], Cq: [1, 0]"
    found = scaling(small(system, f, ", rho: .98"), Engine(), ("1", "0.1"))
    assert found["rho"] == 0.98
    assert found["relaxation"] == "s-procedure"
    least = math.hypot(0.1, 0.9 - 0.98)  # of a linear f that hides a mode at rho
    assert found["identity"]["admissible"] <= least * (1 + 1e-6)
    assert found["scaled"]["upper"] == pytest.approx(0.003, rel=1e-6)
    filtered = scaling(small(system, f, ", rho: .98, estimate: filtered"), Engine(), ("1", "0.1"))
    assert filtered["scaled"]["admissible"] >= found["scaled"]["admissible"] * (1 - 1e-6)


# Requests

WRONG = [
    ("rho: .9, decay: .1", "time: discrete, period: 1", "observer.rho: stands beside observer.decay", "OBS206"),
    ("rho: 1.1", "time: discrete", "observer.rho: 1.1 is not allowed; give a number in (0, 1]", "OBS208"),
    ("rho: 0", "time: discrete", "observer.rho: 0 is not allowed; give a number in (0, 1]", "OBS208"),
    ("rho: .9", "", "observer.rho: is the decay a sample, of a plant with time: discrete", "OBS213"),
    ("estimate: filtered", "", "observer.estimate: is of a plant with time: discrete", "OBS213"),
    ("rho: {min: .8, max: .9}", "time: discrete", "observer.rho: objective max-lipschitz needs a number", "OBS215"),
    ("decay: .1", "time: discrete", "system: period is missing, and observer.decay is in 1/s", "OBS205"),
    (
        "relaxation: norm-bound", "time: discrete",
        "norm-bound is a theorem of continuous time; in discrete time the s-procedure takes its place",
        "OBS406",
    ),
    ("relaxation: abbaszadeh", "time: discrete", "abbaszadeh is a theorem of continuous time", "OBS406"),
    ("relaxation: compare", "time: discrete", "the s-procedure takes their place", "OBS406"),
]  # fmt: skip


@pytest.mark.parametrize(("observer", "time", "said", "id"), WRONG)
def test_what_is_wrong_is_said_in_one_line(observer, time, said, id):
    plant = text("R3", f"type: lipschitz, {observer}", L=0.8).replace("time: discrete,", f"{time}," if time else "")
    with pytest.raises(UsageError) as error:
        loads(plant)
    assert [problem.id for problem in error.value.problems] == [id]
    assert said in str(error.value.problems[0])


def test_without_a_decay_the_error_vanishes_and_a_period_is_not_needed():
    request = loads(text("R3", "type: lipschitz", L=0.8)).observer
    assert request.rate == 0
    assert request.pace.key == "rho"
