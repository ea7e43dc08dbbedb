"""Plants as equations through the command line: what they are split into, what is said of them, how they run."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from flint import fmpq
from support.commands import run
from support.shipped import shipped, solved

import obsdesign as od
from obsdesign.expressions import parse
from obsdesign.expressions.algebra import identical
from obsdesign.guide import page
from obsdesign.reading import loads
from obsdesign.tables.split import entry
from obsdesign.work import solve

LINK = {
    "states": ["motor_angle", "motor_{0}", "link_angle", "link_{0}"],
    "dynamics": {
        "motor_angle": "motor_{0}",
        "motor_{0}": "-48.6*motor_angle - 1.25*motor_{0} + 48.6*link_angle",
        "link_angle": "link_{0}",
        "link_{0}": "19.5*(motor_angle - link_angle) - 3.33*sin(link_angle)",
    },
    "outputs": {"y1": "motor_angle", "y2": "motor_{0}"},
}


def link(rate, **further):
    """Equations of the flexible link, with the name of its rates."""
    text = yaml.safe_dump({**LINK, **further}).replace("{0}", rate).replace("'", "")
    return yaml.safe_load(text.replace("[w]", " + 2*w"))


BEARING = {
    "states": ["x1", "x2", "x3"],
    "disturbances": ["w1", "w2"],
    "dynamics": {"x1": "x2 + w1", "x2": "x3 + x3*abs(x3)", "x3": "w2"},
    "outputs": {"y1": "x1 + 0.1*w1", "y2": "x2"},
}
PENDULUM = {
    "states": ["angle", "speed"],
    "disturbances": ["w1"],
    "units": {"angle": "rad", "speed": "rad/s"},
    "dynamics": {"angle": "speed", "speed": "-g_over_l*sin(angle) - damping*speed + w1"},
    "outputs": {"y_angle": "angle", "y_speed": "speed + 0.5*w1"},
}
JOINT, MANIPULATOR = link("speed"), link("rate", disturbances=["w1"])
MANIPULATOR["dynamics"]["motor_rate"] += " + 2*w1"
SAME = {  # the equations of a shipped spec in matrices, and the types that no enclosure finds, with the scale of f
    "corless2019-magnetic-bearing": (BEARING, {"x3*abs(x3)": "q|q|"}, 1),
    "pendulum": (PENDULUM, {"sin(angle)": {"lipschitz": 1}}, 1),
    "abbaszadeh2010-flexible-joint-structured": (JOINT, {}, fmpq(333, 100)),
    "ferrante2019-manipulator": (MANIPULATOR, {"sin(link_angle)": {"lipschitz": 1}}, fmpq(333, 100)),
}


def as_equations(name):
    """Text of a shipped spec with its plant as equations."""
    system, types, _ = SAME[name]
    content = yaml.safe_load(shipped(name).text)
    content |= {"system": {**system, "types": types}}
    return yaml.safe_dump({key: value for key, value in content.items() if key != "nonlinearities"}, sort_keys=False)


@pytest.mark.parametrize("name", SAME)
def test_a_shipped_plant_as_equations_has_the_same_matrices_and_types(name):
    spec, matrices, scale = loads(as_equations(name)), shipped(name), SAME[name][2]
    assert spec.plant.states == matrices.plant.states
    for key in ("A", "B", "C", "D", "Cq", "Dq", "Dqf", "Df"):
        assert (getattr(spec.plant, key) == getattr(matrices.plant, key)).all(), key
    Bf, other = spec.plant.Bf, matrices.plant.Bf
    signs = {c / d for c, d in zip(Bf.ravel(), other.ravel(), strict=True) if d != 0}
    assert signs <= {fmpq(scale), -fmpq(scale)}
    assert ((Bf != 0) == (other != 0)).all()
    for found, declared in zip(spec.nonlinearities, matrices.nonlinearities, strict=True):
        assert [scale * k for k in found.lipschitz] == list(declared.lipschitz)
    equations = (s.equations(s.plant) for s in (spec, matrices))
    for left, right in zip(*({**e.dynamics, **e.outputs, **e.algebraic}.items() for e in equations), strict=True):
        assert left[0] == right[0]
    first, second = (explicit(s) for s in (spec, matrices))
    assert first.keys() == second.keys()
    assert all(identical(first[key], second[key]) for key in first)


def explicit(spec):
    """Right sides of a plant in states and disturbances."""
    plant = spec.equations(spec.plant)
    q = dict(plant.algebraic)
    return {name: side.substituted(q) for name, side in {**plant.dynamics, **plant.outputs}.items()}


@pytest.mark.parametrize("name", ["corless2019-magnetic-bearing", "pendulum", "ferrante2019-manipulator"])
def test_a_shipped_plant_as_equations_has_the_same_limit(name):
    design, (_, other) = solve(loads(as_equations(name))), solved(name)
    tolerance = 1e-9 if SAME[name][2] == 1 else 1e-6
    assert design.status == other.status
    assert design.limit["gamma"] == pytest.approx(other.limit["gamma"], rel=tolerance)


@pytest.mark.parametrize("name", ["tanks-equations", "cell-equations", "motor-equations", "vehicle-equations"])
def test_the_split_is_a_spec_in_matrices_of_the_same_plant(name):
    spec = shipped(name)
    split = json.loads(json.dumps(entry(spec)["split"]))
    content = yaml.safe_load(spec.text)
    terms = [{k: v for k, v in term.items() if k != "term"} for term in split.pop("nonlinearities")]
    names = {"states": list(spec.plant.states), "outputs": list(spec.plant.outputs), "inputs": list(spec.inputs)}
    system = {**names, "disturbances": list(spec.plant.exogenous), **split}
    again = loads(yaml.safe_dump({**content, "system": system, "nonlinearities": terms}))
    assert not again.as_equations
    for key in ("A", "B", "C", "D", "Bf", "Cq", "Dq", "Dqf", "Df"):
        assert (getattr(again.plant, key) == getattr(spec.plant, key)).all(), key
    assert again.gx == spec.gx
    assert [b.region for b in again.nonlinearities] == [b.region for b in spec.nonlinearities]
    assert [b.lipschitz for b in again.nonlinearities] == [b.lipschitz for b in spec.nonlinearities]


SPEC = """obsdesign: 1
name: case
parameters: {P: 3, c: 2}
system: {inputs: [u], disturbances: [w], dynamics: {x: v, v: %s + w}, outputs: {y: %s}%s}
observer: {type: l2, alpha: 0.05, bounds: {L1: 50}}
"""


STAYS = "{0} and its estimate stay in [-{1}, {1}]"


def terms_of(side, output="x + 0.1*w", further=""):
    """Terms of a right side with their types and where they hold."""
    spec = loads(SPEC % (side, output, f", {further}" if further else ""))
    return {b.term: (b.type.removesuffix(" (auto)"), *spec.limits(i)) for i, b in enumerate(spec.nonlinearities)}


@pytest.mark.parametrize(
    ("side", "further", "terms"),
    [
        ("-c*tanh(50*v)", "", {"tanh(50*v)": ("slope [0, 50]",)}),
        ("-sqrt(v)", "domain: {v: [1, 4]}", {"sqrt(v)": ("slope [0.25, 0.5]", "v and its estimate stay in [1, 4]")}),
        ("-P/v", "domain: {v: [1, 10]}", {"1/v": ("slope [-1, -0.01]", "v and its estimate stay in [1, 10]")}),
        ("-atan(v)", "", {"atan(v)": ("slope [0, 1]",)}),
        ("-exp(v)", "", {"exp(v)": ("slope [0, .inf]",)}),
        ("exp(-v)", "", {"-exp(-v)": ("slope [0, .inf]",)}),
        ("-v*abs(v)", "", {"v*abs(v)": ("slope [0, .inf]",)}),
        ("-u*v", "domain: {u: [0.1, 0.9], v: [5, 50]}", {"u*v": ("slope [0.1, 0.9]", "u stays in [0.1, 0.9]")}),
        ("-sin(x) - 2*sin(x) + v", "", {"sin(x)": ("slope [-1, 1]",)}),
        ("-(x - v)**3 - x + v", "", {"(x - v)**3": ("slope [0, .inf]",)}),
        ("sin(t) + u**2 - 3*x", "", {}),
        (
            "-x*v",
            "domain: {x: [-1, 1], v: [-2, 2]}",
            {"x*v": ("jacobian of 4 vertices", STAYS.format("x", 1), STAYS.format("v", 2))},
        ),
        ("-tanh(50*v)", "types: {tanh(50*v): monotone}", {"tanh(50*v)": ("monotone",)}),
        ("-tanh(50*v)", "types: {tanh(50.0*v): monotone}", {"tanh(50*v)": ("monotone",)}),
        ("-tanh(50*v)", "types: {f1: {slope: [0, 51]}}", {"tanh(50*v)": ("slope [0, 51]",)}),
    ],
)  # fmt: skip
def test_terms_as_a_user_types_them(side, further, terms):
    assert terms_of(side, further=further) == terms


def test_a_type_that_is_only_assumed_is_so_on_the_domain():
    further = "domain: {v: [-1, 100]}, types: {v*exp(-v**2): {lipschitz: 1}}"
    spec = loads(SPEC % ("-v*exp(-v**2)", "x", f", {further}"))
    assert spec.assumed[0].startswith("lipschitz 1 of v*exp(-v**2) (searched on ")
    assert spec.validity == "as long as v and its estimate stay in [-1, 100]"


def test_a_polynomial_of_an_output_is_a_term_of_it():
    assert terms_of("-x", "x**3 + x + 0.1*w", "domain: {x: [0, 2]}") == {
        "x**3": ("slope [0, 12]", "x and its estimate stay in [0, 2]")
    }


def test_the_domain_of_an_output_is_that_of_the_state_it_shows():
    assert terms_of("-sqrt(x)", "2*x", "domain: {y: [2, 8]}") == {
        "sqrt(x)": ("slope [0.25, 0.5]", "x and its estimate stay in [1, 4]")
    }


@pytest.mark.parametrize("measured", ["x", "2*x"])
def test_a_product_with_a_state_that_is_measured_without_noise_is_known(measured):
    (term,) = loads(SPEC % ("-x*v", measured, ", domain: {x: [-1, 1]}")).nonlinearities
    factor = "" if measured == "x" else "0.5*"
    assert (term.arguments, term.region) == (("v",), None)
    assert identical(term.f[0], parse(f"{factor}y*q", ("y", "q")))
    assert term.others["y"] == ((-1, 1) if factor == "" else (-2, 2))


def test_equal_terms_of_several_equations_are_one_nonlinearity():
    text = SPEC.replace("x: v,", "x: v - 3*tanh(x + v),") % ("2*tanh(x + v)", "x + w", "")
    spec = loads(text)
    assert [b.term for b in spec.nonlinearities] == ["tanh(x + v)"]
    assert spec.plant.Bf.ravel().tolist() == [-3, 2]
    assert spec.plant.Cq.tolist() == [[1, 1]]


def test_what_is_measured_at_instants_is_not_known_between_them():
    text = (SPEC % ("-y*v", "x", "")).replace(
        "type: l2, alpha: 0.05, bounds: {L1: 50}", "type: sporadic, T1: 0.1, T2: 0.2"
    )
    with pytest.raises(
        od.UsageError, match="needs y, which the observer does not know between two measurements; write"
    ):
        loads(text)
    states = (text.replace("-y*v", "-x*v")).replace("{y: x}", "{y: x}, domain: {x: [-1, 1], v: [-1, 1]}")
    assert [b.arguments for b in loads(states).nonlinearities] == [("x", "v")]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


LOCAL = SPEC % ("-2*v - x - u*v - sqrt(x + 2) + 1", "x + 0.1*w", ", domain: {v: [-5, 5], x: [-1, 7], u: [0.1, 0.9]}")
TRIAL = """simulation:
  horizon: 4
  x0: {v: 2.5}
  u: {u: "where(t < 2, 0.2, 0.5 - 0.1*tanh(x))"}
  w: {w: "0.1*exp(-t)"}
"""


def test_check_prints_the_split(folder):
    (folder / "case.yaml").write_text(LOCAL)
    outcome = run("check", "case.yaml")
    assert outcome.exit_code == 0, outcome.output
    said = outcome.stdout
    assert "plant  x' = A x + Bf f(q) + gx + B w,  y = C x + D w: the equations exactly, proved\n" in said
    assert "A       0   1   over x, v\n       -1  -2\n" in said
    assert "gx     v: 1\n" in said
    assert (
        "f1     u*v   slope [0.1, 0.9] (auto)   for u in [0.1, 0.9]\n       = u*q, q = v; enters as -1 in v\n" in said
    )
    assert "for x in [-1, 7]\n" in said


def test_the_result_holds_the_split_and_verify_holds_the_file_to_it(folder):
    (folder / "case.yaml").write_text(LOCAL)
    assert run("solve", "case.yaml").exit_code == 0
    content = json.loads((folder / "case.gains.json").read_text())
    split = content["split"]
    assert list(split) == ["A", "B", "C", "D", "gx", "gy", "nonlinearities"]
    assert (split["A"], split["D"], split["gx"]) == ([[0, 1], [-1, -2]], [[0.1]], ["0", "1"])
    first = split["nonlinearities"][0]
    assert first == {
        "term": "u*v", "f": "u*q", "type": {"slope": [0.1, 0.9]}, "region": {"u": [0.1, 0.9]},
        "Bf": [0, -1], "Cq": [[0, 1]], "Dqf": [[0, 0]], "Dq": [[0]], "Df": [0],
    }  # fmt: skip
    assert json.loads(run("check", "case.yaml", "--json").stdout)["split"] == split
    assert run("verify", "case.gains.json", "case.yaml").exit_code == 0
    for wrong in ({**split, "A": [[0, 1], [-1, -3]]}, {**split, "nonlinearities": []}, None):
        changed = {key: value for key, value in {**content, "split": wrong}.items() if value is not None}
        (folder / "wrong.gains.json").write_text(json.dumps(changed))
        outcome = run("verify", "wrong.gains.json")
        assert outcome.exit_code == 2
        assert "split: is not how the equations of the spec are split" in outcome.stderr


def test_numbers_of_the_split_are_exact():
    spec = loads(SPEC % ("-x/3 - 0.1*v", "x + w", ""))
    split = entry(spec)["split"]
    assert split["A"] == [[0, 1], ["-1/3", -0.1]]
    assert entry(shipped("pendulum")) == {}


@pytest.mark.usefixtures("sketched")
def test_sentences_name_the_terms_and_states(folder):
    (folder / "case.yaml").write_text(LOCAL + TRIAL)
    outcome = run("solve", "case.yaml", "--simulate")
    assert outcome.exit_code == 0, outcome.output
    assert re.search(r"^local +as long as u stays in \[0.1, 0.9\] and x and its estimate stay in", outcome.stdout, re.M)
    assert "the region of the declared types, x in [-1, 7], u in [0.1, 0.9]" in outcome.stdout
    assert "nonlinearity" not in outcome.stdout
    constants = run("lipschitz", "case.yaml").stdout
    assert "u*v" in constants
    assert "x in [-1, 7]" in constants
    assert "f_1" not in constants


@pytest.mark.usefixtures("sketched")
def test_a_run_leaves_the_domain_of_a_state(folder):
    (folder / "case.yaml").write_text(LOCAL + TRIAL.replace("v: 2.5", "x: 8"))
    outcome = run("solve", "case.yaml", "--simulate")
    assert "x of the plant is 8, outside [-1, 7], at t = 0" in outcome.stdout


def test_a_start_outside_the_domain_is_told_in_its_states():
    spec = loads(LOCAL + TRIAL.replace("  w:", "  xhat0: {x: -2}\n  w:"))
    (problem,) = spec.starts_outside()
    assert "it sets x to -2, outside its region [-1, 7]" in problem.message


ESCAPE = """obsdesign: 1
name: escape
system:
  inputs: [u]
  disturbances: [torque]
  dynamics: {x: 2*x + u, z: -z + torque}
  outputs: {y: x + 0.1*torque, yz: z}
disturbance: integrator
observer: {type: l2, alpha: 0.1, bounds: {L1: 20}}
simulation:
  horizon: 5
  x0: {x: 0.5}
  xhat0: {torque: 0.25}
  u: {u: "where(t < 0.3, 1, -0.2*x)"}
  w: {torque: "0.1*sin(t)"}
  events: {too far: "abs(x) > 10"}
"""


def test_a_run_ends_at_an_event_and_says_so(folder):
    (folder / "escape.yaml").write_text(ESCAPE)
    outcome = run("simulate", "escape.yaml", "--json")
    assert outcome.exit_code == 0, outcome.output
    summary = json.loads(outcome.stdout)
    # x = (0.5 + 0.5) exp(2 t) - 0.5 until 0.3, and grows at the rate 1.8 from then on
    time = 0.3 + np.log(10 / (np.exp(0.6) - 0.5)) / 1.8
    assert summary["status"] == "stopped"
    assert summary["time"] == pytest.approx(time, abs=1e-6)
    assert summary["reason"] == f"at t = {summary['time']:.6g}: too far: abs(x) > 10"
    with (folder / "escape.run.csv").open() as file:
        assert file.readline().split(",") == ["t", "x", "z", "hat_x", "hat_z", "torque", "hat_torque", "y", "yz", "u\n"]
        assert float(file.readline().split(",")[6]) == 0.25
    assert "the run ended early: stopped at t = " in run("simulate", "escape.yaml").stderr


@pytest.mark.parametrize("noise", ["", "  noise: {type: normal, amplitude: 0.01, period: 0.05}\n"])
def test_an_event_ends_a_run_of_stretches(folder, noise):
    text = ESCAPE.replace("abs(x) > 10", "max(t > 1, x > 100)*(z < 50)").replace("too far", "late")
    (folder / "escape.yaml").write_text(text + noise)
    summary = json.loads(run("simulate", "escape.yaml", "--json").stdout)
    assert (summary["status"], summary["time"]) == ("stopped", pytest.approx(1, abs=1e-9))


def test_an_event_that_has_happened_is_refused(folder):
    (folder / "escape.yaml").write_text(ESCAPE.replace("abs(x) > 10", "abs(x) > 0.1"))
    outcome = run("simulate", "escape.yaml")
    assert outcome.exit_code == 2
    assert "simulation.events.too far: abs(x) > 0.1 is true at the start already" in outcome.stderr


def test_normal_noise_is_gaussian_noise():
    text = ESCAPE + "  noise: {type: %s, amplitude: 0.01, period: 0.05}\n"
    first, second = (loads(text % kind).simulation.noise for kind in ("normal", "gaussian"))
    assert first.type == second.type == "gaussian"


def test_names_and_lists_of_a_simulation_say_the_same():
    listed = (
        ESCAPE.replace("x0: {x: 0.5}", "x0: [0.5, 0]").replace("{torque: 0.25}", "[0, 0, 0.25]")
        .replace('u: {u: "where(t < 0.3, 1, -0.2*x)"}', 'u: "where(t < 0.3, 1, -0.2*x)"')
        .replace('w: {torque: "0.1*sin(t)"}', 'w: ["0.1*sin(t)"]')
    )  # fmt: skip
    first, second = (vars(loads(text).simulation) for text in (ESCAPE, listed))
    assert str(first) == str(second)


def test_channels_of_w_have_names_in_a_plant_in_matrices_too():
    text = shipped("pendulum").text.replace("  outputs: [", "  disturbances: [torque]\n  outputs: [")
    spec = loads(text)
    assert spec.plant.exogenous == ("torque",)
    assert spec.model_states == ("torque",)
    assert spec.H_names == ("angle", "speed", "torque")
    assert replace(spec, text="").plant.B.tolist() == shipped("pendulum").plant.B.tolist()


def test_the_equations_of_the_manual_solve_and_run(folder):
    (text,) = re.findall(r"```yaml\n(.*?)```", page("equations"), re.DOTALL)
    (folder / "vehicle.yaml").write_text(text)
    outcome = run("solve", "vehicle.yaml", "--simulate", "--json")
    assert outcome.exit_code == 0, outcome.output
    assert json.loads(outcome.stdout)["observer"]["type"] == "l2"
    columns = "t,v,hat_v,slope,noise,hat_slope,speed,brake,noise_speed\n"
    assert (folder / "vehicle.run.csv").read_text().startswith(columns)
