"""The simulation against closed forms, against a plain integration, and on plants that misbehave."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from support.running import simulate

from obsdesign.dissipation.guarantee import EnergyGuarantee
from obsdesign.errors import UsageError
from obsdesign.reading import load
from obsdesign.simulate import Run
from obsdesign.spec import Spec

BEARING = "specs/corless2019-magnetic-bearing.yaml"
L2 = np.array([[0.0, -110.0]])

# Gains and storage functions that satisfy the inequality of the bearing at alpha = 0.71, mu1 = 1, and what
# a run with them gives: norm2(z) over 20 s, its two bounds, and the largest error of an unknown input.
DESIGNS = {
    0.08: (
        [
            [-1.1254407468933028, -2.289049358809694],
            [-0.07976312373658534, -44.136333824429286],
            [-0.9641726132192117, -4772.7029374177555],
            [-190.78931113776744, 4.394596814369291],
            [-4.482102522278268, -20970.08702266245],
        ],
        [
            [197.96505429181252, 0, -0.19693986924239737, -0.03761826673208026, 0.027709155142424814],
            [0, 1316.4196251671833, -11.96745113788348, 0, 0],
            [0, 0, 5.247937372636432, 0.0025478476058698827, -1.107282250943765],
            [0, 0, 0, 0.9706082454144721, -0.0008406283214693942],
            [0, 0, 0, 0, 0.25144429110920374],
        ],
        (7.385, 425, 402, 16.9),
    ),
    0.01: (
        [
            [-0.8677982972353878, -1.0096660384023721],
            [-0.12165918309104475, -51.49291136145656],
            [-3.0267994295727148, -5581.523790797065],
            [-1662.8266938229808, 76.58103382876158],
            [-33.48522819659254, -60339.020153174075],
        ],
        [
            [1998.1738615012878, 0, -0.6735735021848189, 0.31937973134041353, 0.044930643487538544],
            [0, 9929.98681768712, -90.27260743351924, 0, 0],
            [0, 0, 15.809631959471748, -0.0004776439216126739, -1.2230596667509612],
            [0, 0, 0, 1.1358021708092465, -0.0001267642156018599],
            [0, 0, 0, 0, 0.11164417977105591],
        ],
        (9.537, 1.17e3, 1.10e3, 25.4),
    ),
    0.001: (
        [
            [-4.280453362435338, 0.18899519646915205],
            [-0.5721598852484682, -80.46848122778839],
            [-36.41424820673413, -8763.23198131917],
            [-95696.82263020777, 4973.1581707062305],
            [-1348.8212509777986, -283905.7314822974],
        ],
        [
            [115533.97575827184, 0, -11.769632316402923, -3.8430321545851918, 0.5691338520579665],
            [0, 228686.311188596, -2078.966465350872, 0, 0],
            [0, 0, 107.28566612056034, -0.00048080953790152666, -1.9304383182747602],
            [0, 0, 0, 1.1580567595168278, 1.4679961208465925e-05],
            [0, 0, 0, 0, 0.05230915065353229],
        ],
        (18.09, 5.6e3, 5.35e3, 112),
    ),
}


def design(mu2: float) -> tuple[dict[str, np.ndarray], EnergyGuarantee]:
    L1, upper, _ = DESIGNS[mu2]
    P = np.triu(upper) + np.triu(upper, 1).T
    return {"L1": np.array(L1), "L2": L2}, EnergyGuarantee(gamma=mu2**0.5, rate=0.71, mu1=1.0, mu2=mu2, P=P)


def bearing(**changes: object) -> Spec:
    spec = load(BEARING)
    return replace(spec, simulation=replace(spec.simulation, **changes))


@pytest.fixture
def read(tmp_path):
    """A spec from text that begins with the plant; the rest that a spec needs is added."""

    def reader(text: str) -> Spec:
        path = tmp_path / "spec.yaml"
        observer = "observer: {type: l2, L2: 0, alpha: 0.1}\n"
        path.write_text("obsdesign: 1\nname: test\n" + observer + text)
        return load(path)

    return reader


def gains(*L1: float, L2: object = ()) -> dict[str, np.ndarray]:
    """Gains of a plant with one output."""
    return {"L1": np.array(L1, dtype=float)[:, None], "L2": np.array(L2, dtype=float).reshape(-1, 1)}


@pytest.mark.parametrize("mu2", DESIGNS)
def test_the_magnetic_bearing_gives_the_reference_values(mu2):
    norm, by_size, by_storage, peak = DESIGNS[mu2][2]
    run = simulate(load(BEARING), *design(mu2))
    summary = run.summary
    assert run.status == "done"
    assert summary["z_norm2"] == pytest.approx(norm, rel=1e-3)
    assert [b["holds"] for b in summary["bounds"]] == [True] * 4
    assert [b["bound"] for b in summary["bounds"][:2]] == pytest.approx([by_size, by_storage], rel=5e-3)
    assert np.abs(run.steps.w_error).max() == pytest.approx(peak, rel=4e-3)
    assert summary["v_norm2_infinite"] == pytest.approx(np.sqrt(1.125), rel=1e-7)
    t = run.t
    assert run.xi[:, 2] == pytest.approx(-2.7787 + (1 + t) * np.log(1 + t) - t, rel=1e-7, abs=1e-7)
    json.dumps(summary, allow_nan=False)


def test_small_errors_are_found_behind_large_states():
    short = simulate(load(BEARING), *design(0.01))
    assert short.w_error[-1] == pytest.approx([2.4675e-6, -4.42054e-3], rel=1e-4)
    long = simulate(bearing(horizon=100), *design(0.01))
    assert long.xi[-1, 0] == pytest.approx(8.0e7, rel=5e-3)
    assert long.w_error[-1] == pytest.approx([2.4496e-7, -9.1655e-4], rel=1e-4)


def test_a_false_guarantee_is_reported_as_violated():
    gains_of_bearing, guarantee = design(0.08)
    run = simulate(load(BEARING), gains_of_bearing, replace(guarantee, mu2=1e-8, gamma=1e-4, rate=3.0))
    assert not all(b["holds"] for b in run.summary["bounds"])


def test_the_error_coordinates_agree_with_a_plain_integration_of_plant_and_observer():
    given, _ = design(0.08)
    run = simulate(bearing(horizon=0.3, points=11), given, None)
    A = np.zeros((5, 5))
    A[0, 1] = A[1, 2] = A[0, 3] = A[2, 4] = 1
    C = np.array([[1, 0, 0, 0.1, 0], [0, 1, 0, 0, 0]])
    Bf, L1 = np.eye(5)[1], given["L1"]

    def rate(t, s):
        xi, xihat = s[:5], s[5:]
        v = np.array([0, 0, 0, -0.5 * (1 + t) ** -1.5, 1 / (1 + t)])
        dy = C @ (xihat - xi)
        q, qhat = xi[2], xihat[2] + (L2 @ dy)[0]
        return np.concatenate((A @ xi + Bf * q * abs(q) + v, A @ xihat + Bf * qhat * abs(qhat) + L1 @ dy))

    start = [-2.7247, 10.9842, -2.7787, 1, 0, 0, 0, 0, 0, 0]
    plain = solve_ivp(rate, (0, 0.3), start, "Radau", run.t, rtol=1e-10, atol=1e-10)
    assert np.hstack([run.xi, run.xihat]) == pytest.approx(plain.y.T, rel=1e-6, abs=1e-6)


LINEAR = """
system: {A: [[0, 1], [-2, -3]], B: [[0], [1]], C: [[1, 0]], D: [[0.2]]}
disturbance: integrator
"""


def test_a_linear_plant_follows_the_matrix_exponential(read):
    spec = read(LINEAR + "simulation: {horizon: 3, x0: [1, -1], xhat0: [0.5, 0], v: [0], points: 31}")
    L1 = np.array([-4.0, 1.0, -3.0])
    run = simulate(spec, gains(*L1), None)
    A, C = np.array([[0, 1, 0], [-2, -3, 1], [0, 0, 0]]), np.array([[1, 0, 0.2]])
    e0 = np.array([-0.5, 1, 0])
    closed = [expm((A + L1[:, None] @ C) * t) @ e0 for t in run.t]
    assert run.e == pytest.approx(np.array(closed), abs=1e-7)
    assert run.xi == pytest.approx(np.array([expm(A * t) @ [1, -1, 0] for t in run.t]), abs=1e-7)
    assert run.y[:, 0] == pytest.approx(run.xi @ C[0])
    z2 = quad(lambda t: np.sum((expm((A + L1[:, None] @ C) * t) @ e0)[:2] ** 2), 0, 3)[0]
    assert run.summary["z_norm2"] == pytest.approx(np.sqrt(z2), rel=1e-7)
    assert run.summary["v_norm2"] == 0
    assert run.summary["ratio"] is None


def test_a_sinusoid_needs_no_drive_and_is_estimated(read):
    spec = read("""
system: {A: [[-1]], B: [[1]], C: [[1]]}
disturbance: {type: {sinusoid: {omega: 2}}}
simulation: {horizon: 20, x0: [1], w: ["3*sin(2*t + 0.5)"]}
""")
    run = simulate(spec, gains(-5, -8, -2), None)
    assert run.summary["v_norm2"] == pytest.approx(0, abs=1e-12)
    assert run.w[:, 0] == pytest.approx(3 * np.sin(2 * run.t + 0.5))
    assert abs(run.w_error[-1, 0]) < 1e-5
    assert run.what[-1, 0] == pytest.approx(run.w[-1, 0], abs=1e-5)


def test_a_given_v_drives_the_disturbance_model(read):
    spec = read(LINEAR + "simulation: {horizon: 2, x0: [0, 0], v: [cos(t)]}")
    run = simulate(spec, gains(-4, 1, -3), None)
    assert run.w[:, 0] == pytest.approx(np.sin(run.t), abs=1e-7)
    assert run.summary["v_norm2"] == pytest.approx(np.sqrt(1 + np.sin(4) / 4), rel=1e-7)
    assert run.summary["v_norm2_infinite"] is None


def test_an_escaping_plant_is_reported_with_its_time(read):
    spec = read("""
system: {A: [[0]], C: [[1]]}
nonlinearities: [{f: q**3, type: monotone, Bf: [1], Cq: [1]}]
simulation: {horizon: 2, x0: [1]}
""")
    run = simulate(spec, gains(-1, L2=[0]), None)
    assert run.status == run.summary["status"] == "escape"
    assert run.time == pytest.approx(0.5, abs=1e-5)  # x = (1 - 2 t)^(-1/2)
    assert run.t[-1] <= 0.5
    assert run.xi[:400, 0] == pytest.approx((1 - 2 * run.t[:400]) ** -0.5, rel=1e-6)
    assert np.isfinite(run.table()[1]).all()
    json.dumps(run.summary, allow_nan=False)


def test_a_plant_that_leaves_the_domain_of_its_model_stalls(read):
    spec = read("""
system: {A: [[0]], C: [[1]]}
nonlinearities: [{f: -1/sqrt(q), type: monotone, region: {q: [0.01, 9]}, Bf: [1], Cq: [1]}]
simulation: {horizon: 2, x0: [1], xhat0: [1]}
""")
    run = simulate(spec, gains(-1, L2=[0]), None)  # x = (1 - 3 t / 2)^(2/3)
    assert run.status == "stall"
    assert run.time == pytest.approx(2 / 3, rel=1e-3)
    assert "t = 0.66" in run.summary["reason"]


SWITCHED = """
system: {A: [[-1]], B: [[1]], C: [[1]]}
simulation: {horizon: 3, x0: [0], w: ["where(t < 1.1, 0, 1)"], points: 301}
"""


def test_a_discontinuous_w_is_integrated_exactly(read):
    run = simulate(read(SWITCHED), gains(-1), None)
    expected = np.where(run.t < 1.1, 0, 1 - np.exp(-(run.t - 1.1)))
    assert run.xi[:, 0] == pytest.approx(expected, abs=1e-8)
    assert run.summary["v_norm2"] == pytest.approx(np.sqrt(1.9), rel=1e-9)
    gaps = np.diff(run.steps.t)
    assert (np.diff(run.steps.t[np.abs(run.steps.t - 1.1) < 1e-12]) < 1e-15).all()
    assert gaps[run.steps.t[:-1] < 1.0].max() > 0.05  # nothing was searched for before the jump


def test_a_jump_of_a_model_state_jumps_the_error_and_voids_the_bounds(read):
    spec = read(SWITCHED.replace("simulation", "disturbance: integrator\nsimulation"))
    guarantee = EnergyGuarantee(gamma=1, rate=0.1, mu1=1, mu2=1, P=np.eye(2))
    run = simulate(spec, gains(-3, -4), guarantee)
    before, after = np.searchsorted(run.t, [1.1 - 1e-9, 1.1 + 1e-9])
    assert run.w_error[after, 0] - run.w_error[before - 1, 0] == pytest.approx(-1, abs=0.1)
    assert abs(run.w_error[-1, 0]) < 0.15
    assert run.summary["bounds"] == []
    assert "jumps at t = 1.1" in run.summary["bounds_omitted"]
    assert run.V is None


@pytest.mark.parametrize("w", ["sign(sin(5*t))", "abs(sin(5*t))", "max(0, t - 1)", "where(t > 1, t, 0)"])
def test_switching_signals_agree_with_their_integral(read, w):
    spec = read(f"""
system: {{A: [[0]], B: [[1]], C: [[1]]}}
simulation: {{horizon: 3, x0: [0], w: ["{w}"], points: 4}}
""")
    run = simulate(spec, gains(-1), None)
    signal = spec.simulation.w[0].scalar(["t"])
    kinks = [1, *(np.pi / 5 * np.arange(1, 5))]
    exact = [quad(signal, 0, t, points=[k for k in kinks if k < t] or None)[0] for t in run.t[1:]]
    assert run.xi[1:, 0] == pytest.approx(exact, abs=1e-7)


def test_an_algebraic_loop_is_solved(read):
    spec = read("""
system: {A: [[-1]], C: [[1]]}
nonlinearities: [{f: q**3, type: monotone, Bf: [-1], Cq: [1], Dqf: -1}]
simulation: {horizon: 2, x0: [2], points: 21}
""")
    run = simulate(spec, gains(-1, L2=[0]), None)

    def rate(_, s):  # q + q^3 = x
        root = [next(r.real for r in np.roots([1, 0, 1, -x]) if abs(r.imag) < 1e-9) for x in s]
        return [-s[0] - root[0] ** 3, -s[1] - root[1] ** 3 - (s[1] - s[0])]

    plain = solve_ivp(rate, (0, 2), [2, 0], "Radau", run.t, rtol=1e-10, atol=1e-12)
    assert np.hstack([run.xi, run.xihat]) == pytest.approx(plain.y.T, abs=1e-7)


def test_an_output_that_contains_f_agrees_with_a_plain_integration(read):
    spec = read("""
system: {A: [[-1]], B: [[1]], C: [[1]], inputs: [u], gx: [y1*u], gy: [u]}
nonlinearities: [{f: atan(q) + t*y1/9, type: {slope: [0, 1]}, Bf: [-1], Cq: [1], Df: [0.5], gq: [u]}]
simulation: {horizon: 2, x0: [2], w: [sin(t)], u: [cos(t) - 0.1*x1], points: 21}
""")
    run = simulate(spec, gains(-1.5, L2=[-0.25]), None)

    def rate(t, s):
        x, xhat = s
        u = np.cos(t) - 0.1 * x
        y = (x + u + 0.5 * np.arctan(x + u)) / (1 - 0.5 * t / 9)
        f = np.arctan(x + u) + t * y / 9
        fhat = f
        for _ in range(200):
            dy = xhat + u + 0.5 * fhat - y
            fhat = np.arctan(xhat + u - 0.25 * dy) + t * y / 9
        dy = xhat + u + 0.5 * fhat - y
        return [-x - f + y * u + np.sin(t), -xhat - fhat + y * u - 1.5 * dy]

    plain = solve_ivp(rate, (0, 2), [2, 0], "LSODA", run.t, rtol=1e-10, atol=1e-12)
    assert np.hstack([run.xi, run.xihat]) == pytest.approx(plain.y.T, abs=1e-7)


def test_a_loop_without_a_solution_is_a_stall(read):
    spec = read("""
system: {A: [[0]], C: [[1]], gx: [1]}
nonlinearities: [{f: "max(q, 0)**2", type: monotone, Bf: [1], Cq: [1], Dqf: 1, gq: [-t]}]
simulation: {horizon: 9, x0: [0.1], xhat0: [0.1]}
""")
    run = simulate(spec, gains(-1, L2=[0]), None)  # q = x - t + q^2 has a root while x - t <= 1/4
    assert run.status == "stall"
    assert run.xi[-1, 0] - run.t[-1] == pytest.approx(0.25, abs=0.01)
    assert "loop" in run.summary["reason"]
    late = replace(spec, simulation=replace(spec.simulation, x0=np.array([2.0])))
    with pytest.raises(UsageError, match="t = 0"):
        simulate(late, gains(-1, L2=[0]), None)


def test_a_feedback_law_acts_on_the_plant_and_is_known_to_the_observer(read):
    spec = read("""
system: {A: [[1]], C: [[1]], inputs: [u], gx: [u]}
simulation: {horizon: 3, x0: [1], xhat0: [1], u: ["-3*x1 + t"]}
""")
    run = simulate(spec, gains(-4), None)
    t = run.t
    assert run.xi[:, 0] == pytest.approx(1.25 * np.exp(-2 * t) + t / 2 - 0.25, abs=1e-7)
    assert np.abs(run.e).max() == 0


NOISY = (
    LINEAR
    + """
simulation: {horizon: 1, x0: [1, 0], w: [1], points: 101, seed: %d,
             noise: {type: %s, amplitude: [0.1], period: 0.01}}
"""
)


@pytest.mark.parametrize("kind", ["uniform", "gaussian"])
def test_noise_is_repeated_by_its_seed_and_not_covered_by_the_guarantee(read, kind):
    guarantee = EnergyGuarantee(gamma=1, rate=0.1, mu1=1, mu2=1, P=np.eye(3))
    one, same, other = (simulate(read(NOISY % (s, kind)), gains(-4, 1, -3), guarantee) for s in (1, 1, 2))
    assert (one.y == same.y).all()
    assert (one.e == same.e).all()
    assert not np.allclose(one.y, other.y)
    noise = one.y[:, 0] - (one.xi[:, 0] + 0.2 * one.xi[:, 2])
    assert 0.04 < noise.std() < 0.13
    assert one.summary["bounds"] == []
    assert "noise" in one.summary["bounds_omitted"]


def test_held_noise_enters_through_the_gain(read):
    spec = read(NOISY % (3, "uniform"))
    run = simulate(spec, gains(-4, 1, -3), None)
    A, C, L1 = (
        np.array([[0, 1, 0], [-2, -3, 1], [0, 0, 0]]),
        np.array([[1, 0, 0.2]]),
        np.array([[-4], [1], [-3]]),
    )
    F = A + L1 @ C
    e, draws = np.array([-1.0, 0, -1]), np.random.default_rng(3).uniform(-1, 1, (100, 1)) * 0.1
    for n in draws[:, 0]:
        steady = np.linalg.solve(F, (L1 * n)[:, 0])
        e = expm(F * 0.01) @ (e - steady) + steady
    assert run.e[-1] == pytest.approx(e, abs=1e-6)


def test_too_much_noise_is_refused(read):
    with pytest.raises(UsageError, match=r"noise\.period"):
        simulate(read((NOISY % (1, "uniform")).replace("0.01", "1.0e-9")), gains(-4, 1, -3), None)


def test_a_w_that_depends_on_the_states_leaves_v_out(read):
    spec = read(LINEAR + "simulation: {horizon: 5, x0: [1, 0], w: [-x1**3]}")
    run = simulate(spec, gains(-4, 1, -3), EnergyGuarantee(1, 0.1, 1, 1, np.eye(3)))
    plain = solve_ivp(
        lambda _, x: [x[1], -2 * x[0] - 3 * x[1] - x[0] ** 3],
        (0, 5),
        [1, 0],
        "LSODA",
        run.t,
        rtol=1e-10,
        atol=1e-12,
    )
    assert run.xi == pytest.approx(plain.y.T, abs=1e-7)
    assert run.w[:, 0] == pytest.approx(-(run.xi[:, 0] ** 3))
    assert run.v is None
    assert run.summary["v_norm2"] is None
    assert "depends on the states" in run.summary["bounds_omitted"]
    assert run.w_error[:, 0] == pytest.approx(run.what[:, 0] - run.w[:, 0])
    assert np.abs(run.w_error[-1]) < 0.1 * np.abs(run.w_error).max()


def test_a_w_of_the_states_is_its_own_v_without_a_model(read):
    spec = read("""
system: {A: [[0]], B: [[1]], C: [[1]]}
simulation: {horizon: 2, x0: [1], w: [-x1]}
""")
    run = simulate(spec, gains(-1), EnergyGuarantee(10, 0.1, 1, 100, np.eye(1)))
    assert run.xi[:, 0] == pytest.approx(np.exp(-run.t), abs=1e-8)
    assert run.summary["v_norm2"] == pytest.approx(np.sqrt((1 - np.exp(-4)) / 2), rel=1e-7)
    assert all(b["holds"] for b in run.summary["bounds"])
    assert run.summary["v_norm2_infinite"] is None
    assert run.estimated == ()


def test_a_w_that_does_not_split_is_simulated_without_v(read):
    spec = read("""
system: {A: [[-1]], B: [[1]], C: [[1]]}
disturbance: {type: {bias+sinusoid: {omega: 2}}}
simulation: {horizon: 30, x0: [1], w: [1 + sin(2*t)]}
""")
    run = simulate(spec, gains(-5, -4, -4, 0), None)
    assert run.v is None
    assert run.e.shape[1] == 1
    assert run.w[:, 0] == pytest.approx(1 + np.sin(2 * run.t))
    assert np.abs(run.w_error[-1, 0]) < 1e-3
    json.dumps(run.summary, allow_nan=False)


def test_the_settling_time_and_the_peak_are_those_of_the_error(read):
    run = simulate(read("system: {A: [[0]], C: [[1]]}\nsimulation: {horizon: 10, x0: [3]}"), gains(-1), None)
    assert run.summary["settling_time"] == pytest.approx(np.log(100), rel=1e-3)
    assert run.summary["worst_peak"] == {"name": "x1", "value": 3.0, "time": 0.0}
    assert run.summary["final_error"] == pytest.approx(3 * np.exp(-10), rel=1e-5)
    still = simulate(read("system: {A: [[0]], C: [[1]]}\nsimulation: {horizon: 10, x0: [3]}"), gains(0), None)
    assert still.summary["settling_time"] is None


def test_the_table_has_the_columns_of_the_contract():
    run = simulate(bearing(horizon=1, points=5), *design(0.08))
    header, rows = run.table()
    x, w = ["x1", "x2", "x3"], ["w1", "w2"]
    assert header == ["t", *x, *(f"hat_{n}" for n in x), *w, *(f"hat_{n}" for n in w), "y1", "y2"]
    assert rows.shape == (5, len(header))
    assert rows[:, 0] == pytest.approx(np.linspace(0, 1, 5))
    assert rows[:, 7] == pytest.approx((1 + rows[:, 0]) ** -0.5)
    assert rows[:, 11] == pytest.approx(rows[:, 1] + 0.1 * rows[:, 7])


def test_progress_rises_to_at_most_one():
    seen: list[float] = []
    simulate(load(BEARING), *design(0.08), progress=seen.append)
    assert seen
    assert seen == sorted(seen)
    assert 0 <= seen[0] <= seen[-1] <= 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "simulation: is missing"),
        ("disturbance: integrator\nsimulation: {horizon: 1, x0: [1], w: [sqrt(t)]}", "t = 0"),
        ("nonlinearities: [{type: monotone, Bf: [1], Cq: [1]}]\nsimulation: {horizon: 1, x0: [1]}", "no `f`"),
    ],
)
def test_what_cannot_be_simulated_is_refused_in_words(read, text, message):
    spec = read("system: {A: [[-1]], C: [[1]], B: [[1]]}\n" + text)
    with pytest.raises(UsageError, match=message):
        simulate(spec, gains(*[-1] * spec.augmented.n, L2=[0] * len(spec.nonlinearities)), None)


def test_a_run_is_repeated_to_the_last_bit():
    runs: list[Run] = [simulate(bearing(points=50), *design(0.01)) for _ in range(2)]
    assert (runs[0].table()[1] == runs[1].table()[1]).all()
    assert runs[0].summary == runs[1].summary


def test_signals_of_a_run_are_found_by_their_names_in_the_csv_file():
    run = simulate(bearing(horizon=1, points=5), *design(0.08))
    header, rows = run.table()
    for name, column in zip(header, rows.T, strict=True):
        assert (run[name] == column).all()
    assert (run["hat_x2"] == run.xihat[:, 1]).all()
    with pytest.raises(UsageError, match="'hat_x9' is no signal of this run; it has t, x1,"):
        run["hat_x9"]


def test_a_run_draws_itself(tmp_path):
    run = simulate(bearing(horizon=1, points=5), *design(0.08))
    path = tmp_path / "run.png"
    assert run.plot(str(path)) == path.read_bytes()
    assert run.plot()[:8] == b"\x89PNG\r\n\x1a\n"


def test_a_run_carries_the_guarantee_of_its_design_and_no_other():
    gains, guarantee = design(0.08)
    assert simulate(load(BEARING), gains, guarantee).guarantee is guarantee
    bare = simulate(load(BEARING), gains, None)
    assert (bare.guarantee, bare.summary["gamma"], bare.summary["bounds"], bare.V_bound) == (None, None, [], None)
