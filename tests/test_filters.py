"""Filters to compare with: against filterpy, against equations in numpy, against Riccati equations, and refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from scipy.linalg import expm, solve_continuous_are, solve_discrete_are
from support.commands import run

import obsdesign as od
from obsdesign.files import digest
from obsdesign.reading import loads
from obsdesign.work import trial

PENDULUM = """obsdesign: 1
name: pendulum
system:
  time: discrete
  period: 0.05
  inputs: [u]
  disturbances: [push]
  dynamics: {angle: angle + 0.05*rate, rate: rate - 0.5*sin(angle) + 0.05*u + 0.05*push}
  outputs: {y: sin(angle), r: rate + 0.1*angle**2}
observer: OBSERVER
simulation: {horizon: 4, x0: [0.5, 0.2], xhat0: [0, 1], u: 0.3*sin(t), w: ["cos(3*t)"], NOISE}
"""
NOISE = "seed: 2, noise: {type: gaussian, amplitude: [0.03, 0.1]}"
WEIGHTS = "Q: {push: 0.4}, R: [[1.0e-3, 2.0e-4], [2.0e-4, 1.0e-2]], P0: {angle: 2, rate: 3}"
Q, R = np.outer([0, 0.05], [0, 0.05]) * 0.4, np.array([[1e-3, 2e-4], [2e-4, 1e-2]])
LINEAR = """obsdesign: 1
system: {TIMEA: [[0, 1], [-2, -0.3]], B: [[0, 0], [1, 0]], C: [[1, 0]], D: [[0, 0.5]]}
observer: {type: KIND, Q: [[0.4, 0.1], [0.1, 0.2]], R: 0.05}
simulation: {horizon: 30, x0: [1, -1], w: ["0.1*sin(t)", "0.1*cos(3*t)"]}
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def filter_of(text):
    return trial(loads(text))


def pendulum(observer):
    """Run of a filter in discrete time, with noise."""
    text = PENDULUM.replace("OBSERVER", f"{{{observer}, {WEIGHTS}}}").replace("NOISE", NOISE)
    return filter_of(text).simulate()


def f(x, _=0, u=0.0):
    return np.array([x[0] + 0.05 * x[1], x[1] - 0.5 * np.sin(x[0]) + 0.05 * u])


def h(x):
    return np.array([np.sin(x[0]), x[1] + 0.1 * x[0] ** 2])


def by_filterpy(filter_, step, y, u):
    """Predicted and filtered estimates, and the covariances of the first."""
    filter_.x, filter_.P, filter_.Q, filter_.R = np.array([0.0, 1.0]), np.diag([2.0, 3.0]), Q, R
    predicted, corrected, cov = [], [], []
    for k in range(len(y)):
        predicted.append(filter_.x.copy())
        cov.append(filter_.P[np.triu_indices(2)].copy())
        step(y[k], u[k], k == 0)
        corrected.append(filter_.x_post.copy())
    return np.array(predicted), np.array(corrected), np.array(cov)


def test_the_extended_filter_is_that_of_filterpy():
    filter_ = ExtendedKalmanFilter(2, 2)
    found = pendulum("type: ekf")

    def step(y, u, _):
        filter_.update(y, lambda x: np.array([[np.cos(x[0]), 0], [0.2 * x[0], 1]]), h)
        filter_.F = np.array([[1, 0.05], [-0.5 * np.cos(filter_.x[0]), 1]])
        filter_.predict_x = lambda _: setattr(filter_, "x", f(filter_.x, u=u))
        filter_.predict()

    predicted, corrected, cov = by_filterpy(filter_, step, found.y, found["u"])
    assert np.abs(predicted[-1] - f(corrected[-2], u=found["u"][-2])).max() < 1e-12  # they are what they are taken for
    assert found.xihat == pytest.approx(predicted, rel=1e-9, abs=1e-9)
    assert found.theta == pytest.approx(cov, rel=1e-9, abs=1e-12)
    assert pendulum("type: ekf, estimate: filtered").xihat == pytest.approx(corrected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("ours", "alpha", "beta", "kappa"),
    [("", 1, 2, 0), (", alpha: 0.5, beta: 0, kappa: 1", 0.5, 0, 1), (", alpha: 1.0e-2, kappa: 3 - 2", 1e-2, 2, 1)],
)
def test_the_unscented_filter_is_that_of_filterpy_with_the_same_sigma_points(ours, alpha, beta, kappa):
    points = MerweScaledSigmaPoints(2, alpha, beta, kappa)
    filter_ = UnscentedKalmanFilter(2, 2, 0.05, h, f, points)
    found = pendulum(f"type: ukf{ours}")

    def step(y, u, first):
        if first:
            filter_.sigmas_f = points.sigma_points(filter_.x, filter_.P)
        filter_.update(y)
        filter_.predict(u=u)

    predicted, corrected, cov = by_filterpy(filter_, step, found.y, found["u"])
    assert found.xihat == pytest.approx(predicted, rel=1e-9, abs=1e-9)
    assert found.theta == pytest.approx(cov, rel=1e-9, abs=1e-10)
    assert pendulum(f"type: ukf{ours}, estimate: filtered").xihat == pytest.approx(corrected, rel=1e-9, abs=1e-9)
    assert np.abs(found.xihat - pendulum("type: ekf").xihat).max() > 1e-3


PARTS = """obsdesign: 1
system:
  time: discrete
  period: 0.05
  disturbances: [push, n, m]
  dynamics: {angle: angle + 0.05*rate, rate: rate - 0.05*sin(angle) + 0.05*push*cos(angle)}
  outputs: {y: sin(angle) + 0.2*n, r: rate + 0.3*push + 0.1*m}
observer: {type: ukf, Q: {push: 0.4, n: 0.3, m: 1}, R: {y: 1.0e-3, r: 1.0e-2}, P0: {angle: 2, rate: 3}}
simulation: {horizon: 2, x0: [0.5, 0.2], xhat0: [0, 1], w: ["cos(3*t)", 0, sin(50*t)]}
"""


def sigma(mean, cov, images):
    """Mean and covariance of images of sigma points with alpha 1, beta 2, kappa 0, and the deviations of both."""
    m = len(mean)
    L = np.linalg.cholesky(cov + 1e-300 * np.eye(m)) * np.sqrt(m)
    X = np.array([mean, *(mean + L.T), *(mean - L.T)])
    Y = np.array([images(x) for x in X])
    Wm, Wc = np.full(2 * m + 1, 0.5 / m), np.full(2 * m + 1, 0.5 / m)
    Wm[0], Wc[0] = 0, 2
    dx, dy = X - mean, Y - Wm @ Y
    return Wm @ Y, dy.T @ np.diag(Wc) @ dy, dx.T @ np.diag(Wc) @ dy


def test_sigma_points_are_taken_of_a_disturbance_that_acts_on_both_or_not_linearly():
    """That of n and m, which act on an output alone, is added to R."""
    run_ = filter_of(PARTS).simulate()
    x, P, R = np.array([0.0, 1.0]), np.diag([2.0, 3.0]), np.diag([1e-3 + 0.04 * 0.3, 1e-2 + 0.01])
    for k, y in enumerate(run_.y):
        assert run_.xihat[k] == pytest.approx(x, rel=1e-9, abs=1e-9)
        s, cov = np.append(x, 0), np.block([[P, np.zeros((2, 1))], [np.zeros((1, 2)), np.full((1, 1), 0.4)]])
        yhat, S, cross = sigma(s, cov, lambda s: np.array([np.sin(s[0]), s[1] + 0.3 * s[2]]))
        K = cross @ np.linalg.inv(S + R)
        s, cov = s + K @ (y - yhat), cov - K @ (S + R) @ K.T
        x, P, _ = sigma(
            s, cov, lambda s: np.array([s[0] + 0.05 * s[1], s[1] - 0.05 * np.sin(s[0]) + 0.05 * s[2] * np.cos(s[0])])
        )


def text(kind, sampled=False):
    time = "time: discrete, period: 0.1, A: [[1, 0.1], [-0.2, 0.97]], B: [[0, 0], [0.3, 0]], " if sampled else ""
    made = LINEAR.replace("KIND", kind)
    return made.replace("TIMEA: [[0, 1], [-2, -0.3]], B: [[0, 0], [1, 0]], " if sampled else "TIME", time)


@pytest.mark.parametrize("sampled", [False, True])
def test_of_a_linear_plant_all_three_are_one_in_the_end(sampled):
    ekf, ukf, lqe = (filter_of(text(kind, sampled)).simulate() for kind in ("ekf", "ukf", "lqe"))
    assert ukf.xihat == pytest.approx(ekf.xihat, abs=1e-6)
    assert ukf.theta == pytest.approx(ekf.theta, abs=1e-6)
    assert lqe.theta.size == 0
    assert lqe.xihat[-1] == pytest.approx(ekf.xihat[-1], abs=1e-6)
    assert np.abs(lqe.xihat - ekf.xihat).max() > 1e-3


@pytest.mark.parametrize("sampled", [False, True])
def test_the_stationary_gain_is_that_of_the_riccati_equation_with_correlated_noise(sampled):
    design = filter_of(text("lqe", sampled))
    plant, asked, observer = design.spec.plant.doubles, design.spec.observer, design.observer
    S, N = asked.R + plant.D @ asked.Q @ plant.D.T, plant.B @ asked.Q @ plant.D.T
    P = (solve_discrete_are if sampled else solve_continuous_are)(
        plant.A.T, plant.C.T, plant.B @ asked.Q @ plant.B.T, S, s=N
    )
    K = (plant.A @ P @ plant.C.T + N) / (S + plant.C @ P @ plant.C.T) if sampled else (P @ plant.C.T + N) / S
    known = [*observer.states, "y1"]

    def rates(y):
        done = {**dict.fromkeys(known, 0.0), "y1": y}
        waiting = dict(observer.algebraic)
        while waiting:
            name = next(name for name, side in waiting.items() if side.names <= done.keys())
            done[name] = waiting.pop(name).scalar([*done])(*done.values())
        return np.array([side.scalar([*done])(*done.values()) for side in observer.dynamics.values()])

    assert rates(1.0) - rates(0.0) == pytest.approx(K[:, 0], rel=1e-9)


def test_the_unscented_rates_are_those_of_its_equations():
    spec = """obsdesign: 1
system:
  inputs: [u]
  disturbances: [push, n]
  dynamics: {angle: rate, rate: -sin(angle) - 0.1*rate**3 + u + push}
  outputs: {y: sin(angle) + 0.2*n}
observer: {type: ukf, Q: [[0.1, 0.02], [0.02, 0.3]], R: {y: 1.0e-4}, alpha: 0.7, beta: 1, kappa: 2}
"""
    observer = filter_of(spec).observer
    x, u, y, P = np.array([0.7, -0.4]), 0.2, 0.9, np.array([[0.3, 0.05], [0.05, 0.2]])
    known = {"t": 0.0, "u": u, "y": y, "hat_angle": x[0], "hat_rate": x[1]}
    known |= {"P_angle_angle": P[0, 0], "P_angle_rate": P[0, 1], "P_rate_rate": P[1, 1]}
    waiting = dict(observer.algebraic)
    while waiting:
        name = next(name for name, side in waiting.items() if side.names <= known.keys())
        known[name] = waiting.pop(name).scalar([*known])(*known.values())
    found = {name: side.scalar([*known])(*known.values()) for name, side in observer.dynamics.items()}

    points = MerweScaledSigmaPoints(2, 0.7, 1, 2)
    X = points.sigma_points(x, P)
    F = np.array([[b, -np.sin(a) - 0.1 * b**3 + u] for a, b in X])
    H = np.sin(X[:, :1])
    B, D, Q = np.array([[0, 0], [1, 0]]), np.array([[0, 0.2]]), np.array([[0.1, 0.02], [0.02, 0.3]])
    S, W = 1e-4 + D @ Q @ D.T, np.diag(points.Wc)
    K = ((X - x).T @ W @ (H - points.Wm @ H) + B @ Q @ D.T) @ np.linalg.inv(S)
    M = (X - x).T @ W @ (F - points.Wm @ F)
    rate = M + M.T + B @ Q @ B.T - K @ S @ K.T
    assert known["hat_y"] == pytest.approx((points.Wm @ H)[0], rel=1e-12)
    moved = points.Wm @ F + K[:, 0] * (y - points.Wm @ H)
    assert [found["hat_angle"], found["hat_rate"]] == pytest.approx(list(moved), rel=1e-9)
    assert [found[f"P_{n}"] for n in ("angle_angle", "angle_rate", "rate_rate")] == pytest.approx(
        list(rate[np.triu_indices(2)]), rel=1e-9
    )


def test_in_steps_a_y_that_is_held_counts_as_one_sample_and_x_goes_on_without_it():
    """By rk4, whose error is of the fifth power of a step, against the exponential, and whatever P0 is."""
    A, B, C, h = np.array([[0, 1], [-2, -0.3]]), np.array([[0], [1.0]]), np.array([[1.0, 0]]), 2.0**-6
    plant = "{A: [[0, 1], [-2, -0.3]], B: [0, 1], C: [1, 0]}"
    end = "implementation: {period: 0.015625, method: rk4}\nsimulation: {horizon: 4, x0: [1, -1], w: [cos(3*t)], "
    end += "points: 257, observer: implementation, noise: {type: gaussian, amplitude: 0.02, period: 0.015625}}\n"
    both = expm(h * np.block([[A, B @ B.T * 0.5], [np.zeros((2, 2)), -A.T]]))
    Phi, Qh = both[:2, :2], both[:2, 2:] @ both[:2, :2].T
    for P0, reached in (("1", 2e-6), ("1.0e+6", 2e-4)):
        observer = f"{{type: ekf, Q: 0.5, R: 1.0e-5, P0: {P0}}}"
        found = filter_of(f"obsdesign: 1\nsystem: {plant}\nobserver: {observer}\n{end}").simulate()
        x, P = np.zeros(2), float(P0) * np.eye(2)
        for k, y in enumerate(found["y1"]):
            assert [found[f"hat_x{i}"][k] for i in (1, 2)] == pytest.approx(list(x), abs=reached if k < 200 else 2e-6)
            K = P @ C.T / (C @ P @ C.T + 1e-5 / h)
            x, P = Phi @ (x + K[:, 0] * (y - x[0])), Phi @ (P - K @ C @ P) @ Phi.T + Qh
        other = observer.replace("ekf", "ukf")
        same = filter_of(f"obsdesign: 1\nsystem: {plant}\nobserver: {other}\n{end}").simulate()
        assert same["hat_x2"] == pytest.approx(found["hat_x2"], abs=1e-5)


CURVED = """obsdesign: 1
system: {inputs: [u], disturbances: [w], dynamics: {x: (u - 1)*x + 0.1*x**3 + w}, outputs: {y: x}}
observer: {type: lqe, Q: 1, R: 1, AT}
simulation: {horizon: 1, x0: [0.5], xhat0: [0.1], u: 0.5}
"""


@pytest.mark.parametrize(("at", "x", "u"), [("", 0.1, 0), ("at: {u: 0.5}", 0.1, 0.5), ("at: {x: 2, u: 0.5}", 2, 0.5)])
def test_the_stationary_filter_is_of_the_plant_at_a_point(at, x, u):
    observer = filter_of(CURVED.replace("AT", at)).observer
    a = u - 1 + 0.3 * x**2
    side = observer.dynamics["hat_x"]
    slope = side.derivative("y").scalar([])()
    assert slope == pytest.approx(a + np.sqrt(a**2 + 1), rel=1e-9)


HIDDEN = "obsdesign: 1\nsystem: {%s}\nobserver: {type: lqe, Q: 1, R: 1}\nsimulation: {horizon: 1, x0: [1, 1]}\n"
UNSEEN = "A: [[-1, 0], [0, 0.5]], B: [1, 1], C: [1, 0]"
IDLE = "A: [[-1, 1], [0, 0]], B: [1, 0], C: [1, 0]"


@pytest.mark.parametrize(
    ("plant", "said"),
    [
        (
            UNSEEN,
            "mode lambda = 0.5 along x2 (1.00) is not seen by any output, and it does not decay",
        ),
        (IDLE, "the mode lambda = 0 of x2 is not reached by the w of Q: give Q or B an entry that drives it"),
        ("time: discrete, A: [[0.5, 0], [0, 1.5]], B: [1, 1], C: [1, 0]", "lambda = 1.5 along x2 (1.00) is not seen"),
        ("time: discrete, A: [[0.5, 1], [0, 1]], B: [1, 0], C: [1, 0]", "the mode lambda = 1 of x2 is not reached"),
    ],
)
def test_a_riccati_equation_without_a_stabilising_solution_is_one_line(plant, said):
    Path("p.yaml").write_text(HIDDEN % plant)
    for command in ("simulate", "check"):
        outcome = run(command, "p.yaml")
        assert outcome.exit_code == 3, outcome.output
        line = next(line for line in outcome.output.splitlines() if "Riccati" in line)
        assert said in line
    assert run("simulate", "p.yaml").output.count("\n") == 1


def test_a_mode_that_is_at_the_edge_but_driven_and_one_that_grows_undriven_have_gains():
    for plant in (IDLE.replace("B: [1, 0]", "B: [1, 1]"), IDLE.replace("[0, 0]]", "[0, 0.3]]")):
        assert filter_of(HIDDEN % plant).simulate().status == "done"


@pytest.mark.parametrize(
    ("kind", "weights", "said"),
    [
        ("ukf", "Q: -1, R: 1", "observer.Q: -1 is not allowed; give a number >= 0"),
        (
            "lqe",
            "Q: 1, R: [[1, 0], [0, 1]]",
            "observer.R: expected 1 row (one for each output) and 1 column (",
        ),
        ("ukf", "Q: {pull: 1}, R: 1", "observer.Q.pull: unknown signal pull; allowed: w"),
        ("lqe", "Q: 1, R: {z: 1}", "observer.R.z: unknown signal z; allowed: y"),
        ("ekf", "Q: 1, R: {x2: 1}", "observer.R.x2: unknown signal x2; allowed: y"),
        ("ekf", "Q: 1, R: {y: 0}", "observer.R.y: 0 is not allowed; give a number > 0"),
        ("ekf", "Q: 1, R: {}", "observer.R: y is missing; give each output a number > 0"),
        ("lqe", "Q: 1, R: 0", "observer.R: has the eigenvalue 0; it must be positive definite"),
        ("lqe", "Q: 1, R: 1, P0: 1", "observer.P0: P0 does not belong to type lqe, but to ekf or ukf"),
        ("ekf", "Q: 1, R: 1, alpha: 1", "observer.alpha: alpha does not belong to type ekf"),
        ("lqe", "Q: 1, R: 1, at: {v: 1}", "observer.at.v: unknown signal v; allowed: x, u"),
        ("ukf", "Q: 1, R: 1, alpha: 0", "observer.alpha: 0 is not allowed; give a number > 0"),
        ("ukf", "Q: 1, R: 1, kappa: -1", "observer.kappa: -1 is not allowed; give a number > -n, which is -1 here"),
        ("ukf", "Q: 1, R: 1, P0: 0", "observer.P0: has the eigenvalue 0; it must be positive definite"),
        ("ukf", "Q: 1, R: 1, estimate: filtered", "observer.estimate: is of a plant with time: discrete"),
    ],
)
def test_what_is_wrong_is_one_line(kind, weights, said):
    Path("p.yaml").write_text(CURVED.replace("type: lqe, Q: 1, R: 1, AT", f"type: {kind}, {weights}"))
    outcome = run("simulate", "p.yaml")
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1), outcome.output
    assert said in outcome.stderr


TWO = """obsdesign: 1
system: {disturbances: [leak, push], dynamics: {soc: leak, temp: push - temp}, outputs: {tacho: soc, ammeter: temp}}
observer: {type: ekf, WEIGHTS}
simulation: {horizon: 1, x0: [1, 1], w: ["0", "0"]}
"""


def test_what_a_mapping_leaves_out_is_as_its_key_says_or_named():
    Path("p.yaml").write_text(TWO.replace("WEIGHTS", "Q: 1, R: {tacho: 1}"))
    outcome = run("simulate", "p.yaml")
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1), outcome.output
    assert "observer.R: ammeter is missing; give each output a number > 0" in outcome.stderr
    asked = loads(TWO.replace("WEIGHTS", "Q: {leak: 2}, R: {tacho: 1, ammeter: 3}, P0: {soc: 5}")).observer
    assert [np.diag(M).tolist() for M in (asked.Q, asked.R, asked.P0)] == [[2, 0], [1, 3], [5, 1]]
    assert "0 for a w that is not named" in run("explain", "observer.Q").stdout
    assert "1 for a state that is not named" in run("explain", "observer.P0").stdout


def test_the_spread_of_sigma_points_is_no_rate_that_asks_for_a_period():
    text = """obsdesign: 1
system: {time: discrete, disturbances: [d], dynamics: {x: 0.9*x + d}, outputs: {y: x}}
observer: {type: KIND, Q: 1, R: 1}
simulation: {horizon: 20, x0: {x: 1}, w: {d: "0"}}
"""
    same = filter_of(text.replace("KIND", "ekf")).simulate()
    for kind in ("ukf", "ukf, alpha: 0.5"):
        assert filter_of(text.replace("KIND", kind)).simulate().xihat == pytest.approx(same.xihat, abs=1e-9)


@pytest.mark.parametrize("at", ["at: {x: 0}", ""])
def test_a_point_without_slopes_is_one_line(at):
    plant = CURVED.replace("0.1*x**3", "sqrt(x)").replace("AT", at).replace("xhat0: [0.1]", "xhat0: [0]")
    with pytest.raises(od.UsageError, match="no finite slopes where it is linearised; name another point"):
        filter_of(plant).simulate()


@pytest.mark.parametrize("kind", ["ekf", "ukf", "lqe"])
def test_nothing_is_solved_or_proved_of_one(kind):
    spec = CURVED.replace("lqe", kind).replace(", AT", "")
    Path("p.yaml").write_text(spec)
    made = {"obsdesign": 1, "name": "p", "spec": {"path": "p.yaml", "sha256": digest(spec), "text": spec}}
    Path("p.gains.json").write_text(json.dumps({**made, "status": "certified", "observer": {"type": kind}}))
    for command, file in (("solve", "p.yaml"), ("verify", "p.gains.json")):
        outcome = run(command, file)
        assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
        assert f"{kind} has no guarantee: nothing is solved or proved" in outcome.stderr
