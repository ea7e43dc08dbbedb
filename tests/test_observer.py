"""The observers of the families as equations."""

from pathlib import Path

import numpy as np
import pytest

from obsdesign.errors import UsageError
from obsdesign.expressions import parse
from obsdesign.families import FAMILIES
from obsdesign.families.observer import Observer
from obsdesign.reading import loads

PLANT = (
    "system: {A: [[0, 1], [-2, -3]], B: [[1, 0], [0, 1]], C: [[1, 0]], D: [[0, 0.5]], inputs: [u],\n"
    "  gx: [u, 0], gy: [t]}"
)
LOOP = (
    "nonlinearities: [{f: q + sin(y1)*q, type: {lipschitz: 9}, Bf: [1, 0], Cq: [0, 1], Dqf: 0.2, Df: 0.5, Dq: [0, 1]}]"
)


def made(kind, gains, text="", **observer):
    keys = "".join(f", {key}: {value}" for key, value in ({"type": kind} | observer).items())[2:]
    spec = loads(f"obsdesign: 1\nobserver: {{{keys}}}\n{PLANT}\n{text}")
    given = {name: np.array(matrix, dtype=float) for name, matrix in gains.items()}
    return FAMILIES[kind].observer(spec, given)


def texts(part):
    return {name: side.text for name, side in part.items()}


@pytest.mark.parametrize("kind", ["l2", "linf"])
def test_a_copy_of_the_plant_with_two_injections(kind):
    observer = made(kind, {"L1": [[-3], [0.25]], "L2": [[-7]]}, LOOP, L2=0, alpha=1)
    assert texts(observer.dynamics) == {
        "hat_x1": "hat_x2 + hat_q1 + sin(y1)*hat_q1 + u - 3*hat_y1 + 3*y1",
        "hat_x2": "-2*hat_x1 - 3*hat_x2 + 0.25*hat_y1 - 0.25*y1",
    }
    assert texts(observer.algebraic) == {
        "hat_q1": "hat_x2 + 0.2*(hat_q1 + sin(y1)*hat_q1) - 7*hat_y1 + 7*y1",
        "hat_y1": "hat_x1 + 0.5*(hat_q1 + sin(y1)*hat_q1) + t",
    }
    assert texts(observer.estimates) == {"x1": "hat_x1", "x2": "hat_x2"}
    assert observer.twins == {"hat_x1": "x1", "hat_x2": "x2", "hat_q1": "q1", "hat_y1": "y1"}
    assert (observer.jump, observer.intervals) == ({}, None)


def test_a_disturbance_model_is_copied_and_estimates_w():
    gains = {"L1": [[-1], [-2], [-3]], "L2": np.zeros((0, 1))}
    observer = made("l2", gains, "disturbance: [integrator, unknown]", L2=0, alpha=1)
    states = observer.states
    assert states[:2] == ("hat_x1", "hat_x2")
    assert texts(observer.estimates) == {"x1": "hat_x1", "x2": "hat_x2", "w1": states[2]}
    assert observer.dynamics["hat_x1"].text == f"hat_x2 + {states[2]} + u - hat_y1 + y1"


def test_a_reconstruction_estimates_w_by_the_injection():
    gains = {"L1": [[-3], [0.5]], "L2": np.zeros((0, 1))}
    observer = made("linf", gains, alpha=1, reconstruct="w")
    assert texts(observer.estimates)["w1"] == "-3*hat_y1 + 3*y1"
    assert texts(observer.estimates)["w2"] == "0.5*hat_y1 - 0.5*y1"


def test_the_gain_of_a_lipschitz_system_multiplies_the_other_sign():
    linear = "nonlinearities: [{f: sin(q), type: {lipschitz: 1}, Bf: [0, 1], Cq: [1, 0]}]"
    observer = made("lipschitz", {"L": [[3], [0.5]]}, linear)
    assert observer.dynamics["hat_x1"].text == "hat_x2 + u - 3*hat_y1 + 3*y1"


SPORADIC = PLANT.replace(", D: [[0, 0.5]]", "")


def test_a_sporadic_observer_jumps_at_a_measurement():
    keys = "type: sporadic, T1: 0.1, T2: {min: 0.2, max: 1}, decay: 0.1, objective: max-T2"
    text = f"obsdesign: 1\nobserver: {{{keys}}}\n{SPORADIC}\n"
    spec = loads(text + "nonlinearities: [{f: sin(q), type: sin, Bf: [1, 0], Cq: [0, 1]}]\n")
    observer = FAMILIES["sporadic"].observer(spec, {"L": np.array([[3.0], [0.5]]), "H": np.array([[-2.0]])})
    assert texts(observer.dynamics) == {
        "hat_x1": "hat_x2 + sin(hat_q1) + u + 3*theta_y1",
        "hat_x2": "-2*hat_x1 - 3*hat_x2 + 0.5*theta_y1",
        "theta_y1": "-2*theta_y1",
    }
    assert texts(observer.algebraic) == {"hat_q1": "hat_x2", "hat_y1": "hat_x1 + t"}
    assert texts(observer.jump) == {"theta_y1": "y1 - hat_y1"}
    assert observer.intervals == (0.1, 0.2)


def test_y_is_not_known_between_measurements():
    x = {"x": parse("y - x", ["x", "y"])}
    assert Observer(x, x, (), ("y",)).states == ("x",)
    with pytest.raises(UsageError, match="needs y, which the observer does not know between two measurements"):
        Observer(x, {}, (), ("y",), jump={"x": parse("y", ["y"])})
    with pytest.raises(UsageError, match=r"z in .* is no signal"):
        Observer({"x": parse("z", ["z"])}, {}, (), ())


@pytest.mark.parametrize("kind", [name for name, family in FAMILIES.items() if family.proves])
def test_every_family_runs_an_observer_of_the_states_of_a_shipped_spec(kind):
    from obsdesign.reading import load
    from obsdesign.work import solve

    name = {"l2": "pendulum", "linf": "chakrabarty2016-cubic", "lipschitz": "abbaszadeh2010-flexible-joint-gains",
            "sporadic": "ferrante2019-oscillator-gains", "kkl": "cuk-kkl", "pebo": "cuk-pebo",
            "kkl+pebo": "cuk-kkl-pebo", "immersion-invariance": "cuk-immersion",
            "high-gain": "cuk-high-gain", "unknown-input": "unknown-input-flexible-joint"}[kind]  # fmt: skip
    spec = load(str(Path(__file__).parents[1] / "specs" / f"{name}.yaml"))
    design = solve(spec)
    observer = FAMILIES[kind].observer(spec, design.gains or design.form)
    assert set(spec.plant.states) <= set(observer.estimates)
    assert bool(observer.jump) == FAMILIES[kind].sampled
