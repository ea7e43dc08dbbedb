"""The extended Kalman filter: its equations, the Riccati equation it settles at, and where it is refused."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are
from support.commands import PNG, run
from support.shipped import FILTERS, SPECS, shipped

from obsdesign.files import digest
from obsdesign.reading import loads
from obsdesign.work import trial

LINEAR = """obsdesign: 1
system: {A: [[0, 1], [-2, -0.3]], B: [[0, 0], [1, 0]], C: [[1, 0]], D: [[0, 0.5]]}
observer: {type: ekf, Q: [[0.4, 0.1], [0.1, 0.2]], R: 0.05, P0: {x1: 2, x2: 3}}
simulation: {horizon: 40, x0: [1, -1], w: ["0", "0"]}
"""
CURVED = """obsdesign: 1
name: pendulum
system:
  inputs: [u]
  disturbances: [push, n]
  dynamics: {angle: rate, rate: -sin(angle) - 0.1*rate*abs(rate) + u + push}
  outputs: {y: sin(angle) + 0.2*n}
observer: {type: ekf, Q: {push: 0.1, n: 0.3}, R: {y: 1.0e-4}}
simulation: {horizon: 20, x0: [0.5, 0.2], u: 0.3*sin(t), w: ["0", "0"]}
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def filter_of(text):
    return trial(loads(text))


def test_its_covariance_settles_at_the_solution_of_the_riccati_equation_with_correlated_noise():
    design = filter_of(LINEAR)
    plant, asked = design.spec.plant.doubles, design.spec.observer
    S = asked.R + plant.D @ asked.Q @ plant.D.T
    shared = plant.B @ asked.Q @ plant.D.T
    P = solve_continuous_are(plant.A.T, plant.C.T, plant.B @ asked.Q @ plant.B.T, S, s=shared)
    theta = design.simulate().theta
    assert theta[0] == pytest.approx([2, 0, 3])
    assert theta[-1] == pytest.approx(P[np.triu_indices(2)], rel=1e-6)


def test_its_rates_are_those_of_the_linearized_plant():
    observer = filter_of(CURVED).observer
    x, u, t, y = np.array([0.7, -0.4]), 0.2, 0.0, 0.9
    P = np.array([[0.3, 0.05], [0.05, 0.2]])
    known = {"t": t, "u": u, "y": y, "hat_angle": x[0], "hat_rate": x[1]}
    known |= {"P_angle_angle": P[0, 0], "P_angle_rate": P[0, 1], "P_rate_rate": P[1, 1]}
    waiting = dict(observer.algebraic)
    while waiting:
        name = next(name for name, side in waiting.items() if side.names <= known.keys())
        known[name] = waiting.pop(name).scalar([*known])(*known.values())
    found = {name: side.scalar([*known])(*known.values()) for name, side in observer.dynamics.items()}

    def f(x):
        return np.array([x[1], -np.sin(x[0]) - 0.1 * x[1] * abs(x[1]) + u])

    A = np.column_stack([(f(x + h) - f(x - h)) / 2e-6 for h in 1e-6 * np.eye(2)])
    B, C, D, Q = np.array([[0, 0], [1, 0]]), np.array([[np.cos(x[0]), 0]]), np.array([[0, 0.2]]), np.diag([0.1, 0.3])
    S = 1e-4 + D @ Q @ D.T
    K = (P @ C.T + B @ Q @ D.T) @ np.linalg.inv(S)
    rate = A @ P + P @ A.T + B @ Q @ B.T - K @ S @ K.T
    moved = f(x) + K[:, 0] * (y - np.sin(x[0]))
    assert [found["hat_angle"], found["hat_rate"]] == pytest.approx(list(moved), rel=1e-8)
    assert [found[f"P_{n}"] for n in ("angle_angle", "angle_rate", "rate_rate")] == pytest.approx(
        list(rate[np.triu_indices(2)]), rel=1e-7
    )


def test_it_follows_a_nonlinear_plant():
    found = filter_of(CURVED).simulate().summary
    assert found["settling"]["rate"]["t1"] < 15
    assert found["bounds"] == []


def test_a_disturbance_model_is_estimated_too():
    text = LINEAR.replace("D: [[0, 0.5]]", "D: [[0, 0]]").replace('w: ["0", "0"]', 'w: ["0.7", "0"]')
    design = filter_of(text.replace("observer:", "disturbance: [integrator, unknown]\nobserver:"))
    assert design.simulate()["hat_w1"][-1] == pytest.approx(0.7, rel=1e-3)


def test_simulate_says_that_nothing_is_guaranteed():
    Path("p.yaml").write_text(CURVED)
    outcome = run("simulate", "p.yaml")
    assert outcome.exit_code == 0
    assert any(line.startswith("guarantee") and "no guarantee" in line for line in outcome.stdout.splitlines())
    assert Path("p.run.png").read_bytes().startswith(PNG)


def test_solve_refuses_it_in_one_line():
    Path("p.yaml").write_text(CURVED)
    outcome = run("solve", "p.yaml")
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
    assert outcome.stderr.startswith("p.yaml:8:")
    assert (
        "ekf has no guarantee: nothing is solved or proved; simulate, compare, estimate and export take it"
        in outcome.stderr
    )
    assert not Path("p.gains.json").exists()


def test_verify_refuses_a_file_that_holds_one():
    made = {"obsdesign": 1, "name": "pendulum", "spec": {"path": "p.yaml", "sha256": digest(CURVED), "text": CURVED}}
    Path("p.gains.json").write_text(json.dumps({**made, "status": "certified", "observer": {"type": "ekf"}}))
    for command in ("verify", "simulate"):
        outcome = run(command, "p.gains.json")
        assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
        assert "ekf has no guarantee" in outcome.stderr


def test_check_says_so_and_finds_nothing_in_the_way():
    Path("p.yaml").write_text(CURVED)
    outcome = run("check", "p.yaml")
    assert outcome.exit_code == 0
    assert outcome.stdout.startswith("note  ekf: no guarantee")


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("push: 0.1,", "pull: 0.1,", "observer.Q.pull: unknown signal pull; allowed: push, n"),
        ("R: {y: 1.0e-4}", "R: {}", "observer.R: y is missing; give each output a number > 0"),
        ("R: {y: 1.0e-4}", "R: -1", "observer.R: -1 is not allowed; give a number >= 0"),
        ("R: {y: 1.0e-4}", "alpha: 1", "observer.alpha: alpha does not belong to type ekf"),
        ("Q: {push: 0.1, n: 0.3}, ", "", "observer.Q: is required"),
        ("Q: {push: 0.1, n: 0.3}", "Q: [[1, 2], [0, 1]]", "observer.Q: is not symmetric"),
        (
            "Q: {push: 0.1, n: 0.3}",
            "Q: [[1, 2], [2, 1]]",
            "observer.Q: has the eigenvalue -1; it must be positive semi",
        ),
        ("Q: {push: 0.1, n: 0.3}", "Q: [1, 2, 3]", "observer.Q: expected"),
    ],
)
def test_weights_that_are_none_are_refused(before, after, said):
    assert before in CURVED
    Path("p.yaml").write_text(CURVED.replace(before, after))
    outcome = run("simulate", "p.yaml")
    assert outcome.exit_code == 2
    assert said in outcome.stderr


def test_a_disturbance_model_beside_equations_is_refused():
    Path("p.yaml").write_text(CURVED.replace("observer:", "disturbance: [integrator, unknown]\nobserver:"))
    outcome = run("simulate", "p.yaml")
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
    assert "disturbance: type ekf takes it with a plant in matrices" in outcome.stderr


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (CURVED.replace("0.2*n}", "0.2*n*rate}"), "how w enters y depends on the states"),
        (
            LINEAR.replace("D: [[0, 0.5]]}", "D: [[0, 0.5]]}\nnonlinearities: [{f: sin(q), type: sin, Bf: [0, 1], "
            "Cq: [1, 0], Dqf: 0.5}]"),
            "takes no plant with an algebraic loop",
        ),
    ],
)  # fmt: skip
def test_plants_that_it_does_not_take_are_refused(text, said):
    Path("p.yaml").write_text(text)
    outcome = run("simulate", "p.yaml")
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
    assert said in outcome.stderr


@pytest.mark.parametrize("name", FILTERS)
def test_a_shipped_filter_meets_what_its_spec_expects_and_says_so_where_it_does_not(name):
    expect = shipped(name).expect
    assert shipped(name).observer.type == name.rpartition("-")[2]
    assert len(expect) > 1
    outcome = run("simulate", SPECS / f"{name}.yaml")
    assert (outcome.exit_code, outcome.stderr) == (0, "")
    assert "no guarantee" in outcome.stdout
    key, value = next(iter(expect.items()))
    changed = re.sub(r"verified: [\d.]+", "verified: 0.001", shipped(name).text, count=1)
    Path("other.yaml").write_text(changed)
    outcome = run("simulate", "other.yaml")
    assert outcome.exit_code == 0
    found = re.match(rf"other.yaml: expect.{key}: expected 0.001, found (\S+) ", outcome.stderr)
    assert float(found[1]) == pytest.approx(value["verified"], rel=0.01)
    assert outcome.stderr.count("\n") == 1


def test_a_shipped_filter_is_compared_with_observers_of_the_same_plant():
    outcome = run("compare", *(SPECS / f"{name}.yaml" for name in ("cuk-kkl", "cuk-ekf")), "--json", "-q")
    assert outcome.exit_code == 0, outcome.output
    kkl, ekf = json.loads(outcome.stdout)["observers"]
    assert (kkl["status"], ekf["status"]) == ("certified", "no guarantee")
    assert ekf["states"]["i1"]["t5"] < 0.05 * kkl["states"]["i1"]["t5"]
