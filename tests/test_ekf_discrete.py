"""The extended Kalman filter in discrete time, against the same filter in numpy, and the Riccati equation."""

import json

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from support.commands import PNG, run

from obsdesign.reading import loads
from obsdesign.work import trial

PENDULUM = """obsdesign: 1
name: pendulum, ESTIMATE
system:
  time: discrete
  period: 0.05
  inputs: [u]
  disturbances: [push, n, m]
  dynamics: {angle: angle + 0.05*rate, rate: rate - 0.05*sin(angle) + 0.05*u + 0.05*push*cos(angle)}
  outputs: {y: sin(angle) + 0.2*n, r: rate + 0.3*push + 0.1*m}
observer:
  {type: ekf, estimate: ESTIMATE, Q: {push: 0.4, n: 0.3, m: 1}, R: {y: 1.0e-3, r: 1.0e-2}, P0: {angle: 2, rate: 3}}
simulation: {horizon: 4, x0: [0.5, 0.2], xhat0: [0, 1], u: 0.3*sin(t), w: ["cos(3*t)", 0, sin(50*t)]}
"""
SEEN = 0.05 * np.arange(81)


def filtered_by_hand(y, u):
    """Predicted and filtered estimates (N, 2) of the pendulum, w in both the dynamics and y estimated beside x."""
    Q, R = np.diag([0.4, 0.3, 1]), np.diag([1e-3, 1e-2])
    x, P = np.array([0.0, 1.0]), np.diag([2.0, 3.0])
    D = np.array([[0, 0.2, 0], [0.3, 0, 0.1]])
    predicted, corrected = [], []
    for k in range(len(y)):
        predicted.append(x)
        C = np.array([[np.cos(x[0]), 0], [0, 1]])
        both, cov = np.hstack([C, D]), np.block([[P, np.zeros((2, 3))], [np.zeros((3, 2)), Q]])
        K = cov @ both.T @ np.linalg.inv(both @ cov @ both.T + R)
        angle, rate, push, *_ = np.append(x, np.zeros(3)) + K @ (y[k] - [np.sin(x[0]), x[1]])
        corrected.append([angle, rate])
        cov = (np.eye(5) - K @ both) @ cov
        x = np.array([angle + 0.05 * rate, rate + 0.05 * (-np.sin(angle) + u[k] + push * np.cos(angle))])
        F = np.array(
            [[1, 0.05, 0, 0, 0], [-0.05 * (np.cos(angle) + push * np.sin(angle)), 1, 0.05 * np.cos(angle), 0, 0]]
        )
        P = F @ cov @ F.T
    return np.array(predicted), np.array(corrected)


@pytest.mark.parametrize("estimate", ["predicted", "filtered"])
def test_it_is_the_ordinary_filter(estimate):
    run = trial(loads(PENDULUM.replace("ESTIMATE", estimate))).simulate()
    predicted, corrected = filtered_by_hand(run.y, run["u"])
    expected = predicted if estimate == "predicted" else corrected
    assert run.t == pytest.approx(SEEN)
    assert run.xihat == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert run.e == pytest.approx(run.xihat - run.xi, abs=1e-12)


def test_its_covariance_settles_at_the_solution_of_the_riccati_equation_with_correlated_noise():
    design = trial(
        loads(
            """obsdesign: 1
system: {time: discrete, A: [[.9, .2], [-.1, .8]], C: [[1, 0]], B: [[.1, .2], [0, .3]], D: [[0, .5]]}
observer: {type: ekf, Q: [[0.4, 0.1], [0.1, 0.2]], R: 0.05, P0: {x1: 2, x2: 3}}
simulation: {horizon: 200, x0: [1, -1]}
""".replace("time: discrete,", "time: discrete, period: 1,")
        )
    )
    plant, asked = design.spec.plant.doubles, design.spec.observer
    R = asked.R + plant.D @ asked.Q @ plant.D.T
    shared = plant.B @ asked.Q @ plant.D.T
    P = solve_discrete_are(plant.A.T, plant.C.T, plant.B @ asked.Q @ plant.B.T, R, s=shared)
    theta = design.simulate().theta
    assert theta[0] == pytest.approx([2, 0, 3])
    assert theta[-1] == pytest.approx(P[np.triu_indices(2)], rel=1e-9)


def test_filtered_estimates_are_of_discrete_time():
    text = PENDULUM.replace("  time: discrete\n  period: 0.05\n", "").replace("ESTIMATE", "filtered")
    with pytest.raises(Exception, match="is of a plant with time: discrete"):
        loads(text)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_it_is_simulated_and_compared_from_the_command_line(here):
    noise = "noise: {amplitude: [.05, .1]}}"
    for estimate in ("predicted", "filtered"):
        text = PENDULUM.replace("ESTIMATE", estimate).replace("sin(50*t)]}", f"0], {noise}")
        (here / f"{estimate}.yaml").write_text(text)
    assert run("simulate", "filtered.yaml").exit_code == 0
    rows = (here / "filtered.run.csv").read_text().splitlines()
    assert len(rows) == 82
    assert (here / "filtered.run.png").read_bytes().startswith(PNG)
    found = run("compare", "predicted.yaml", "filtered.yaml", "--json", "--seeds", "4")
    assert found.exit_code == 0
    report = json.loads(found.stdout)
    first, second = report["observers"]
    assert first["states"]["angle"]["noise_rms"] > 0
    assert second["states"]["angle"]["floor"] < first["states"]["angle"]["floor"]
    assert first["fastest"] is None
    assert (here / "compare.png").read_bytes().startswith(PNG)
