"""Unknown-input observers: exact cancellation, what noise in the estimates adds, refusals, invariance, forgeries."""

import copy
import json
from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq
from support.commands import run
from support.forging import put, scaled
from support.shipped import on, shipped, solved

import obsdesign as od
from obsdesign.families.unknown_input import transform
from obsdesign.families.unknown_input.observer import errors
from obsdesign.families.unknown_input.request import factor, reduced
from obsdesign.lmi.formula import in_floats, rational
from obsdesign.model.plant import Plant

PLANT = {"A": [[-1, 1, 0], [-1, 0, 0], [0, -1, -1]], "B": [-1, 0, 0], "C": [[1, 0, 0], [0, 0, 1]]}
KNOWN = {  # known terms everywhere, noise in every output, f of y and of another disturbance
    "system": {
        "states": ["a", "b", "c"],
        "inputs": ["u"],
        "disturbances": ["w", "d", "n"],
        "A": [[-1, 1, 0.5], [-1, -0.2, 0.3], [0, -1, -1]],
        "B": [[3, 0, 0], [1, 0, 0], [0, 0.5, 0]],
        "C": [[1, 2, 0], [0, 1, 1], [1, 0, 1]],
        "D": [[0, 0, 0.1], [0, 0.3, 0.2], [0, 0, 0.05]],
        "gx": ["y1*u", "sin(y2)", "u"],
        "gy": ["u", "2*u + sin(t)", 0],
    },
    "nonlinearities": [
        {"f": "0.3*sin(q)*cos(y1)", "type": {"lipschitz": 0.3}, "Bf": [1, 0, 1], "Cq": [0, 1, 1], "Dq": [0, 0.1, 0]},
        {"f": "tanh(q)", "type": {"slope": [0, 1]}, "Bf": [0, -1, 0], "Cq": [0, 1, 0], "gq": ["u"]},
    ],
    "observer": {"type": "unknown-input", "cancel": ["w"], "alpha": 0.2, "bounds": {"L": 50}},
    "simulation": {
        **{"horizon": 5, "x0": [1, 2, -1], "xhat0": [0.5, 0, 0], "u": "cos(t)", "points": 101},
        "w": ["20*sin(7*t)", "sin(2*t)", "cos(9*t)"],
    },
}
ORDERS = 1e-6  # of the size of the state: what the integration leaves of the cancelled input in the error


def spec_of(observer=None, **sections):
    observer = {"type": "unknown-input", "alpha": 1} | (observer or {})
    return od.Spec(**({"system": PLANT, "observer": observer} | sections))


@pytest.fixture(scope="module")
def known():
    return od.solve(od.Spec(**KNOWN))


# Cancellation


@pytest.mark.parametrize("name", on("unknown-input-three-state"))
def test_the_error_does_not_depend_on_the_input_and_needs_a_small_gain(name):
    _, design = solved(name)
    assert np.linalg.norm(design.gains["L"], 2) < 10
    assert "gamma" not in design.result["guarantee"]
    runs = [design.simulate(w=w, horizon=6) for w in (["0"], ["10"], ["1000*sin(50*t)"])]
    for one in runs[1:]:
        assert np.abs(one.xi).max() > 120
        assert np.abs(one.e - runs[0].e).max() < ORDERS
        assert one.summary["bounds"]


def test_the_input_is_in_no_equation_of_the_error():
    from obsdesign.simulate.program import needs, reach
    from obsdesign.simulate.simulation import system_of

    design = od.solve(spec_of(simulation={"horizon": 1, "x0": [1, 1, 1], "w": "sin(t)"}))
    system = system_of(design.spec, design.spec.simulation, design.observer)
    definitions = system.program.definitions
    rates = [f"{name} rate" for name in system.followed]
    found = reach(rates, lambda name: needs(definitions[name]) if name in definitions else ())
    assert {"w1", "x1", "x2", "x3"}.isdisjoint(found)


def test_known_terms_other_disturbances_and_noise_leave_the_cancellation_exact():
    design = od.solve(od.Spec(**{name: part for name, part in KNOWN.items() if name != "nonlinearities"}))
    assert "the error does not depend on w" in design.verify().claim
    first = design.simulate()
    other = design.simulate(w=["500*cos(3*t)", "sin(2*t)", "cos(9*t)"])
    assert np.abs(first.xi - other.xi).max() > 10
    assert np.abs(first.e - other.e).max() < ORDERS * np.abs(other.xi).max()
    assert all(bound["holds"] for one in (first, other) for bound in one.summary["bounds"])


def test_with_f_the_bounds_hold_whatever_the_input_is(known):
    """The error is another one then, since f is taken at another state, and that is not denied."""
    assert "does not depend" not in known.verify().claim
    runs = [known.simulate(w=[w, "sin(2*t)", "cos(9*t)"], horizon=1) for w in ("0", "500*cos(3*t)", "a*b")]
    assert np.abs(runs[0].e - runs[1].e).max() > 0.1
    assert all(len(one.summary["bounds"]) == 4 for one in runs)
    assert all(bound["holds"] for one in runs for bound in one.summary["bounds"])


def test_an_E_without_decimals_is_written_as_fractions(tmp_path):
    design = od.solve(
        spec_of(system={"A": [[-1, 1], [0, -2]], "B": [[1], [0.5]], "C": [[3, 0]]}, observer={"alpha": 0.5})
    )
    assert design.result["observer"]["E"] == [["1/3"], ["1/6"]]
    design.save(tmp_path / "gains.json")
    assert od.verify(tmp_path / "gains.json").holds
    assert od.read(tmp_path / "gains.json").observer.follows == design.observer.follows


def test_among_outputs_that_all_show_the_input_those_without_noise_are_taken():
    system = {"A": [[-1]], "B": [[1, 0]], "C": [[1], [1], [2]], "D": [[0, 1], [0, 0], [0, 0]]}
    assert in_floats(factor(od.Spec(system=system, observer={"type": "unknown-input", "alpha": 1}))).tolist() == [
        [0, 1, 0]
    ]


# The inequality, against plant and observer side by side


@pytest.mark.parametrize("member", [0.0, 1.0])
def test_the_gain_from_the_others_is_that_of_plant_and_observer_together(member):
    """From (w, d, n) to e of the whole system of order 2 n, with tanh q = member q: no use is made of eps."""
    sections = copy.deepcopy(KNOWN)
    sections["nonlinearities"] = [{**KNOWN["nonlinearities"][1], "gq": [0]}]
    sections["system"] |= {"gx": [0, 0, 0], "gy": [0, 0, 0]}
    design = od.solve(od.Spec(**sections))
    p, (E, L) = design.spec.augmented.doubles, (design.gains[name] for name in ("E", "L"))
    T, K = np.eye(3) - E @ p.C, np.array([[member]])
    A = p.A + p.Bf @ K @ p.Cq
    hat = T @ A - L @ p.C  # of xhat = xi + E y
    whole = np.block([[A, np.zeros((3, 3))], [(hat @ E + L) @ p.C, hat]])
    B = np.vstack([p.B, (hat @ E + L) @ p.D])
    out, through = np.hstack([E @ p.C - np.eye(3), np.eye(3)]), E @ p.D
    grid = 1j * np.concatenate([[0], np.geomspace(1e-3, 1e6, 2000)])
    response = np.array([out @ np.linalg.solve(s * np.eye(6) - whole, B) + through for s in grid])
    assert np.abs(response[:, :, 0]).max() < 1e-9
    gain = np.linalg.norm(response[:, :, 1:], 2, axis=(1, 2)).max()
    assert gain <= design.guarantee.gamma * (1 + 1e-6)
    found = errors(design.spec, design.gains)
    k = next(i for i, F in enumerate(found.distinct) if F.item() == member)
    A_of, B_of, N_of = found.systems[k]
    assert found.gain(A_of, B_of, peaks=False) == pytest.approx(gain, rel=1e-4)
    noise = np.array([np.linalg.solve(s * np.eye(3) - A_of, N_of) + E for s in grid])
    direct = np.block([[np.zeros((3, 3))], [hat @ E + L]])  # noise of y alone
    seen = np.array([out @ np.linalg.solve(s * np.eye(6) - whole, direct) + E for s in grid])
    assert np.abs(noise - seen).max() < 1e-9 * np.abs(seen).max()


def test_no_gain_has_a_gamma_below_what_is_in_the_estimates_at_once():
    system = {"A": [[-1, 0], [0, -2]], "B": [[1, 0], [1, 0]], "C": [[1, 0]], "D": [[0, 0.5]]}
    design = od.solve(od.Spec(system=system, observer={"type": "unknown-input", "alpha": 0.1}))
    assert design.limit["gamma"] >= 0.5 * np.sqrt(2) * (1 - 1e-6)
    assert design.guarantee.peak(design.spec.H) >= 0.5 * np.sqrt(2)
    assert np.isinf(design.guarantee.reach(design.spec.H)).all()


def test_of_an_undisturbed_rest_the_transform_is_the_textbook_one():
    random = np.random.default_rng(3)
    for _ in range(20):
        n, ny, m = 4, 3, random.integers(1, 3)
        A, B, C = (rational(random.integers(-3, 4, size)) for size in ((n, n), (n, m), (ny, n)))
        none = {"Bf": (n, 0), "Cq": (0, n), "Dqf": (0, 0), "Dq": (0, m), "Df": (ny, 0)}
        empty = {name: transform.exact_zeros(*size) for name, size in none.items()}
        plant = Plant(A=A, B=B, C=C, D=transform.exact_zeros(ny, m), **empty, states=(), exogenous=(), outputs=())
        E = transform.chosen(plant, range(m))
        solvable = transform.rank(C @ B) == transform.rank(B)
        assert (E is not None) == solvable == (transform.obstacle(plant, range(m)) is None)
        if E is not None:
            assert not (transform.projector(plant, E) @ B != 0).any()
            assert transform.rank(E) == transform.rank(B)


# What there is none of


@pytest.mark.parametrize("name", on("infeasible/unknown-input-late"))
def test_a_rank_that_is_missing_is_proved_and_a_forged_direction_proves_nothing(name, tmp_path):
    _, design = solved(name)
    design.save(tmp_path / "gains.json")
    assert od.verify(tmp_path / "gains.json").holds
    for keys, value in ((("w", "force"), "0"), (("w",), {}), (("w",), {"wind": "1"}), (("f",), ["1"])):
        forged = put(copy.deepcopy(dict(design.result)), ("diagnosis", "certificate", *keys), value)
        (tmp_path / "forged.json").write_text(json.dumps(forged))
        assert run("verify", str(tmp_path / "forged.json")).exit_code in {2, 4}, keys


def test_the_channels_that_can_be_cancelled_are_named():
    system = {"A": -np.eye(2), "B": np.eye(2), "C": [[1, 0]], "disturbances": ["wind", "load"]}
    design = od.solve(spec_of(system=system))
    assert design.diagnosis["feasible"] == {"cancel": ["wind"]}
    assert "cancel: [wind], which can be" in design.diagnosis["suggestion"]
    assert od.solve(spec_of(system=system, observer={"cancel": "wind", "alpha": 0.5})).status == "certified"


def test_a_slow_zero_limits_the_decay():
    system = {"A": [[-1, 1], [0, -0.5]], "B": [[1], [0]], "C": [[1, 0]]}
    design = od.solve(spec_of(system=system))
    assert design.status == "infeasible"
    assert "lambda = -0.5" in design.diagnosis["reason"]
    assert "whatever w1 is" in design.diagnosis["reason"]
    assert od.solve(spec_of(system=system, observer={"alpha": 0.4})).status == "certified"


def test_a_zero_of_a_member_of_the_class_is_told_with_its_slope():
    block = {"f": "q", "type": {"slope": [0, 2]}, "Bf": [0, 1], "Cq": [0, 1]}
    system = {"A": [[-1, 1], [0, -1]], "B": [[1], [0]], "C": [[1, 0]]}
    design = od.solve(spec_of(system=system, nonlinearities=[block], observer={"alpha": 0.1}))
    assert (design.status, design.diagnosis["proof"]) == ("infeasible", "exact")
    assert "at the slope 2 of f1" in design.diagnosis["reason"]


@pytest.mark.parametrize(
    ("changes", "key", "said"),
    [
        ({"system": PLANT | {"D": [[1], [0]]}, "observer": {"cancel": ["w1"]}}, "observer.cancel[0]", "it is in y1"),
        ({"system": PLANT | {"D": [[1], [0]]}}, "observer.type", "nothing to cancel"),
        ({"observer": {"cancel": "w2"}}, "observer.cancel", "allowed: w1"),
        ({"disturbance": "integrator"}, "disturbance", "leave it out"),
        ({"observer": {"gains": {"E": 0.9 * np.eye(3)[:, :2], "L": np.zeros((3, 2))}}}, "observer.gains.E", "write it"),
        ({"observer": {"alpha": 1, "objective": "max-alpha"}}, "observer.alpha", "needs a range"),
        ({"observer": {"L2": 0}}, "observer.L2", "does not belong to type unknown-input"),
        (
            {"nonlinearities": [{"type": {"lipschitz": 1}, "Bf": [1, 0, 0], "Cq": [1, 0, 0], "Dq": 1}],
             "observer": {"cancel": ["w1"]}},
            "observer.cancel[0]", "a nonlinearity is a function of it",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_one_line(changes, key, said):
    with pytest.raises(od.UsageError) as caught:
        spec_of(**changes)
    (problem,) = caught.value.problems
    assert problem.key == key
    assert said in problem.message


def test_no_decay_and_a_filtered_estimate_are_for_samples():
    with pytest.raises(od.UsageError, match="does anyway"):
        spec_of({"alpha": None, "estimate": "filtered"}, system=PLANT | {"time": "discrete"})


# Forgeries


@pytest.mark.parametrize("name", on("unknown-input-flexible-joint"))
def test_a_changed_E_L_P_or_gamma_is_not_proved(name, tmp_path):
    _, design = solved(name)
    places = {
        ("observer", "E", 1, 0): 1 + Fraction(1, 10**15),
        ("observer", "L", 3, 1): Fraction(2),
        ("certificate", "P", 0, 0): Fraction(1, 2),
        ("guarantee", "gamma"): Fraction(9, 10),
    }
    for place, times in places.items():
        forged = copy.deepcopy(dict(design.result))
        before = forged["guarantee"]["gamma"]
        if place[0] == "observer":
            put(forged, place, str(Fraction(str(forged[place[0]][place[1]][place[2]][place[3]])) * times))
        else:
            scaled(forged, place, times)
        words = forged["guarantee"]["statement"].replace(repr(before), repr(forged["guarantee"]["gamma"]))
        forged["guarantee"] |= {"statement": words, "mu2": forged["guarantee"]["gamma"] ** 2}
        (tmp_path / "forged.json").write_text(json.dumps(forged))
        outcome = run("verify", str(tmp_path / "forged.json"))
        assert outcome.exit_code == 4, (place, outcome.stderr)


# Invariance


def test_units_and_coordinates_change_E_as_they_change_x_and_y():
    spec = od.Spec(**KNOWN)
    T, y, w = np.array([[2, 1, 0], [0, 3, 0], [1, 0, 5]]), np.array([60, 0.25, 7]), np.array([1000, 3, 3])
    system, back = KNOWN["system"], np.linalg.inv(T)
    changed = {
        "A": T @ system["A"] @ back,
        "B": T @ system["B"] * w,
        "C": np.diag(y) @ system["C"] @ back,
        "D": np.diag(y) @ system["D"] * w,
    }
    other = spec_of({"cancel": ["w1"], "alpha": 0.2}, system={k: np.array(v).tolist() for k, v in changed.items()})
    E = in_floats(factor(other))
    assert np.abs(E - T @ in_floats(factor(spec)) / y).max() < 1e-9 * np.abs(E).max()


# Where the observer runs


@pytest.mark.parametrize("name", on("unknown-input-sampled"))
def test_of_samples_a_log_is_followed_exactly_and_a_missing_y_ends_what_is_proved(name, tmp_path):
    _, design = solved(name)
    run_of = design.simulate(horizon=2)
    lines = [["t", "y1", "y2"], *np.column_stack([run_of["t"], run_of["y1"], run_of["y2"]]).tolist()]
    log = tmp_path / "log.csv"
    log.write_text("\n".join(",".join(map(str, line)) for line in lines))
    whole = od.estimate(design, log)
    for state in ("drive", "twist", "load"):
        assert whole[f"hat_{state}"] == pytest.approx(run_of[f"hat_{state}"], abs=1e-9)
    lines[11][1] = ""
    log.write_text("\n".join(",".join(map(str, line)) for line in lines))
    holed = od.estimate(design, log)
    assert np.isfinite(holed["hat_drive"]).all()
    assert holed["covered"].tolist() == [1.0] * 10 + [0.0] * (len(lines) - 11)


@pytest.mark.parametrize("name", on("unknown-input-sampled"))
def test_radii_hold_in_samples_whatever_the_cancelled_input_is(name, tmp_path):
    _, design = solved(name)
    run_of = design.simulate(horizon=2)
    text = design.spec.text + "\ndata: {v_sup: 1, e0: {drive: 0.1, twist: 0.1, load: 1}}\n"
    again = od.solve(od.load(text))
    log = tmp_path / "log.csv"
    np.savetxt(
        log, np.column_stack([run_of["t"], run_of["y1"], run_of["y2"]]), delimiter=",", header="t,y1,y2", comments=""
    )
    found = od.estimate(again, log)
    for state in ("drive", "twist", "load"):
        assert (np.abs(found[f"hat_{state}"] - run_of[state]) <= found[f"radius_{state}"] + 1e-9).all()


def test_steps_of_an_implementation_come_near_the_run(known):
    sections = copy.deepcopy(KNOWN) | {"implementation": {"period": 1e-3, "method": "rk4"}}
    sections["simulation"] |= {"observer": "implementation", "horizon": 1}
    sections["observer"] |= {"gains": {name: known.gains[name] for name in ("L",)}, "bounds": None}
    stepped = od.solve(od.Spec(**sections))
    ideal = known.simulate(horizon=1)
    for state in ("a", "b", "c"):
        there = np.interp(ideal["t"], stepped.simulate()["t"], stepped.simulate()[f"hat_{state}"])
        assert there == pytest.approx(ideal[f"hat_{state}"], abs=0.05 * np.abs(ideal[f"hat_{state}"]).max())


def test_given_gains_are_analysed_with_their_own_E():
    E = [["1"], ["0"], ["0"]]
    both = [[*row, extra] for row, extra in zip(E, ("0", "0", "1/2"), strict=True)]
    design = od.solve(spec_of({"alpha": 0.5, "gains": {"E": both, "L": [[1, 0], [0, -2], [0, 1]]}}))
    assert design.status == "certified"
    assert design.result["observer"]["E"] == [[1, 0], [0, 0], [0, 0.5]]
    assert design.verify().holds


def test_nothing_is_exported_to_coq_and_it_is_said():
    _, design = solved("unknown-input-three-state")
    with pytest.raises(od.UsageError, match="not exported"):
        design.theorem()


# Every type


@pytest.mark.parametrize(
    "type_",
    [
        {"slope": [-0.5, 0.5]},
        {"lipschitz": 0.5},
        {"sector": {"K1": [[0]], "K2": [[0.5]]}},
        {"cocoercive": 2},
        "monotone",
    ],
    ids=str,
)
def test_every_type_may_stand_in_the_plant(type_):
    block = {"type": type_, "Bf": [0, -1, 0], "Cq": [0, 1, 0]}
    system = PLANT | {"A": [[-1, 1, 0], [-1, -3, 0], [0, -1, -1]], "C": [[1, 0, 0], [0, 0, 1]]}
    design = od.solve(spec_of({"alpha": 0.2}, system=system, nonlinearities=[block]))
    if type_ == "monotone":  # has no injection in f here, which L2 would be
        assert design.status in {"certified", "infeasible"}
        assert "L2: free" in design.diagnosis.get("suggestion", "L2: free")
        return
    assert design.status == "certified"
    assert design.verify().holds


# Hints


def hints(spec):
    return [found.sentence for found in od.check(spec) if found.id == "OBS953"]


def test_check_says_where_an_exact_observer_would_do():
    l2 = {"type": "l2", "alpha": 0.2, "bounds": {"L1": 5}}
    exact = "an exact unknown-input observer exists that cancels w1: observer.type: unknown-input"
    assert hints(od.Spec(system=PLANT, observer=l2)) == [exact]
    assert hints(od.Spec(system=PLANT | {"C": [[0, 0, 1]]}, observer=l2)) == []
    assert hints(od.Spec(system=PLANT, observer=l2, disturbance="integrator")) == []
    assert hints(od.Spec(system=PLANT, observer={"type": "sporadic", "T1": 0.1, "T2": 0.2, "decay": 0.1})) == []
    assert hints(shipped("infeasible/unknown-input-unstable-zero")) == []
    unstable = {"A": [[-1, 1], [0, 2]], "B": [[1], [0]], "C": [[1, 0]]}
    assert hints(od.Spec(system=unstable, observer=l2)) == []


def test_the_plant_that_is_left_is_that_of_the_family_l2():
    spec = od.Spec(**KNOWN)
    inner = reduced(spec)
    assert inner.plant.exogenous == ("d", "n")
    assert not (inner.posed.A != spec.posed.A).any()
    assert inner.posed.B.shape == (3, 2)
    assert spec.cancelled == ("w",)
    assert transform.rank(transform.projector(spec.augmented, factor(spec))) == 2
    assert fmpq(1) in inner.generator.Dm.ravel().tolist()
