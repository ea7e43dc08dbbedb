"""Runs of sporadic observers: figures of the paper, closed forms, independent integrations, and wrong input."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from support.running import simulate_sporadic
from support.sporadic import DESIGN, LINK, OSCILLATOR, PREDICTOR, free, gains, paper, read

from obsdesign.errors import UsageError
from obsdesign.expressions import parse
from obsdesign.families.sporadic.guarantee import SporadicGuarantee
from obsdesign.families.sporadic.observer import holding
from obsdesign.simulate import Sampling, Schedule
from obsdesign.simulate.scenario import scenario
from obsdesign.simulate.system import System
from obsdesign.trial import Noise

# Not linear, if only beyond where any run goes: by the integrator, not by exponentials.
IDLE = (
    OSCILLATOR + "nonlinearities: [{f: 'max(q - 1e6, 0)', type: {lipschitz: 1}, Bf: [0, 1], Cq: [1, 0]}]"
)  # not linear
ROBOT = """
system: {A: [[0, 1, 0], [0, -0.01, 0], [1, 0, 0]], B: [[0], [1], [0]], C: [[1, 0, 0], [0, 0, 1]]}
performance: {H: [[0, 1, 0]]}
simulation: {horizon: 20, x0: 0, w: ["where(t <= 2, 1, where(t <= 6, 0, where(t <= 8, -1, 0)))"]}
"""
RIVAL = gains([[0.3648], [-0.4655]], [[-0.3648]])  # (50)
HOLD = gains([[3.7, -2.194], [2.908, -2.075], [1.637, 0.1545]], np.zeros((2, 2)))
HOLD_RIVAL = gains([[0.8079, 0.2555], [0.2071, 0.055], [0.7609, 0.7714]], np.zeros((2, 2)))


@pytest.mark.parametrize(
    ("text", "found", "T1", "T2", "ratio", "peaks"),
    [
        (OSCILLATOR, DESIGN, 0.205, 0.41, 0.9021, (0.752, 0.998)),
        (OSCILLATOR, RIVAL, 0.205, 0.41, 1.6512, (1.324, 3.034)),
        (ROBOT, HOLD, 0.1714, 0.3, 0.8950, (None, 1.035)),
        (ROBOT, HOLD_RIVAL, 0.1714, 0.3, 1.9071, (None, 1.806)),
    ],
)
def test_the_responses_of_figures_3_and_7_are_reproduced(text, found, T1, T2, ratio, peaks):
    run = simulate_sporadic(read(text), found, paper(T1, T2), None)
    assert run.summary["ratio"] == pytest.approx(ratio, abs=6e-5)
    for state, peak in enumerate(peaks):
        if peak is not None:
            assert np.abs((-run.steps.e)[:, state]).max() == pytest.approx(peak, abs=1.1e-3)
    json.dumps(run.summary, allow_nan=False)


def test_figure_3_has_127_measurements_and_figure_9_has_351():
    assert simulate_sporadic(read(OSCILLATOR), DESIGN, paper(0.205, 0.41), None).summary["sampling"]["received"] == 127
    run = simulate_sporadic(read(LINK), PREDICTOR, paper(0.05, 0.1), None)
    assert len(run.schedule.received) == run.summary["sampling"]["received"] == 351
    assert run.status == "done"


@pytest.mark.parametrize(("found", "left"), [(DESIGN, 6.7e-6), (RIVAL, 0.398)])
def test_the_free_responses_of_figure_4_are_reproduced(found, left):
    run = simulate_sporadic(free(), found, paper(0.205, 0.41, theta0=np.array([5.0])), None)
    assert run.distance[0] == pytest.approx(np.sqrt(9 + 9 + 4))
    assert run.t[-1] == 10
    assert run.distance[-1] == pytest.approx(left, rel=5e-3)


@pytest.mark.parametrize(("text", "rel"), [(OSCILLATOR, 1e-11), (IDLE, 1e-6)])
def test_a_linear_plant_follows_its_exponentials(text, rel):
    F = np.block([[np.array([[0, 1], [-4, 0]]), -DESIGN["L"]], [np.zeros((1, 2)), DESIGN["H"]]])
    spec = read(text, w=None, x0=np.ones(2), xhat0=np.full(2, -2.0), horizon=10.0, points=41)
    run = simulate_sporadic(spec, DESIGN, Sampling(0.25, 0.25), None)
    x = np.array([3.0, 3, 0])
    expected = [x]
    for _ in range(40):
        x = expm(0.25 * F) @ x
        x[2] = x[0]
        expected.append(x)
    found = np.hstack([(-run.e), run.theta])[:-1]  # samples at measurements are after these
    assert found == pytest.approx(np.array(expected)[:-1], rel=rel, abs=rel)
    assert (-run.e)[-1] == pytest.approx(expected[-1][:2], rel=rel, abs=rel)
    assert run.j.tolist() == [*range(40), 39]  # there is no measurement at the horizon itself


def test_a_known_term_of_the_argument_reaches_plant_and_observer():
    text = "system: {A: [[-1]], B: [[1]], C: [[1]], inputs: [u]}\nsimulation: {horizon: 2, x0: [1], u: [cos(t)]}\n"
    spec = read(text + "nonlinearities: [{f: sin(q), type: sin, Bf: [1], Cq: [1], gq: [u + t]}]")
    run = simulate_sporadic(spec, gains([[1]], [[0]]), Sampling(0.5, 0.5), None)

    def rhs(t, s):
        z, zhat, theta = s
        return [-z + np.sin(z + np.cos(t) + t), -zhat + np.sin(zhat + np.cos(t) + t) + theta, 0]

    s = np.array([1.0, 0, 0])
    for k in range(4):
        s = solve_ivp(rhs, (k / 2, k / 2 + 0.5), s, rtol=1e-11, atol=1e-13).y[:, -1]
        s[2] = s[0] - s[1]
    assert [run.xi[-1, 0], run.xihat[-1, 0]] == pytest.approx(s[:2].tolist(), rel=1e-6)


def test_the_jacobian_is_the_derivative_of_the_flow():
    text = LINK.replace("Cq: [0, 0, 1, 0]", "Cq: [0, 0, 1, 0], gq: [u**2]").replace(
        "A:", "inputs: [u]\n  gx: [0, u, 0, sin(u)]\n  A:"
    )
    u, w = (parse(e, ["t", *"abcd"]) for e in ("a*b + t", "c**2*d"))
    spec = read(
        text.replace("system:", "system:\n  states: [a, b, c, d]").replace("simulation: {", "simulation: {u: [t], ")
    )
    simulation = replace(spec.simulation, u=(u,), w=(w,))
    V = SporadicGuarantee(gamma=2.0, decay=0.1, delta=1.0, T1=0.1, T2=1.0, P1=np.eye(4), P2=np.eye(2))
    planned = Schedule(np.array([0.5]), np.array([]), 0.1, 1.0, 1.0)
    acting = replace(scenario(spec, simulation, sampled=True), schedule=planned, eta=np.zeros((1, 2)))
    system = System(acting, holding(spec, PREDICTOR), spec.H.astype(float), V)
    s = np.random.default_rng(0).normal(size=len(system.start(np.zeros(4), np.zeros(4), np.zeros(2))))
    steps, still = 1e-6 * np.eye(len(s)), np.zeros(2)
    numeric = [(system.rhs(0.3, s + d, still) - system.rhs(0.3, s - d, still)) / 2e-6 for d in steps]
    assert system.jacobian(0.3, s, still) == pytest.approx(np.array(numeric).T, rel=1e-6, abs=1e-6)


def without_f(p):
    return replace(p, Bf=p.Bf[:, :0], Df=p.Df[:, :0], Cq=p.Cq[:0], Dq=p.Dq[:0], Dqf=p.Dqf[:0, :0])


def plainly(spec, found, schedule, f, w, start):
    """(z, zhat, theta, integral of |yp|^2) at the horizon, in the coordinates of the paper; w jumps at 0.5."""
    A, B, C = (np.array(m, dtype=float) for m in (spec.plant.A, spec.plant.B, spec.plant.C))
    n, Cp = len(A), spec.H.astype(float)

    def rhs(t, s):
        z, zhat, theta = s[:n], s[n : 2 * n], s[2 * n : -1]
        yp = Cp @ (z - zhat)
        rates = A @ z + f(z) + B[:, 0] * w(t), A @ zhat + f(zhat) + found["L"] @ theta, found["H"] @ theta, [yp @ yp]
        return np.concatenate(rates)

    s, t = start, 0.0
    for stop, measured in sorted([*((t, True) for t in schedule.received), (0.5, False), (schedule.horizon, False)]):
        end = np.nextafter(stop, 0)
        s = solve_ivp(rhs, (t, end), s, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
        if measured:
            s[2 * n : -1] = C @ (s[:n] - s[n : 2 * n])
        t = stop
    return s


@pytest.mark.parametrize("linear", [True, False])
def test_a_run_agrees_with_an_integration_in_the_coordinates_of_the_paper(linear):
    x0, xhat0, theta0 = np.array([0.3, 0.1, -0.2, 0.4]), np.array([0.1, 0, 0, 0.2]), np.array([0.1, -0.3])
    text = LINK.replace("where(t <= 20, sin(2*t), 0)", "where(t < 0.5, 1, -2)" if linear else "sin(2*t)")
    spec = read(text, x0=x0, xhat0=xhat0, horizon=1.5)
    spec = replace(spec, plant=without_f(spec.plant), nonlinearities=(), gq=()) if linear else spec
    spec = replace(spec, plant=replace(spec.plant, Cq=spec.plant.Cq[:0]), gq=()) if linear else spec
    run = simulate_sporadic(spec, PREDICTOR, Sampling(0.05, 0.1, "random", theta0=theta0), None)

    def f(z):
        return np.array([0, 0, 0, 0 if linear else -3.33 * np.sin(z[2])])

    def w(t):
        return (1 if t < 0.5 else -2) if linear else np.sin(2 * t)

    s = plainly(spec, PREDICTOR, run.schedule, f, w, np.concatenate((x0, xhat0, theta0, [0])))
    tolerance = {"rel": 1e-9 if linear else 2e-6, "abs": 1e-10 if linear else 1e-8}
    assert run.xi[-1] == pytest.approx(s[:4], **tolerance)
    assert run.xihat[-1] == pytest.approx(s[4:8], **tolerance)
    assert run.theta[-1] == pytest.approx(s[8:10], **tolerance)
    assert run.summary["z_norm2"] == pytest.approx(np.sqrt(s[-1]), rel=tolerance["rel"])


def test_the_exponentials_and_the_integrator_give_the_same_run():
    sampling = Sampling(0.2, 0.4, "random", dropout=0.2)
    noise = Noise("uniform", np.array([0.1]), 1.0)
    V = SporadicGuarantee(gamma=2.0, decay=0.1, delta=1.0, T1=0.2, T2=0.4, P1=np.diag([1.0, 2]), P2=np.array([[3.0]]))
    exact, smooth = (
        simulate_sporadic(read(t, horizon=8.0, x0=np.ones(2), noise=noise), DESIGN, sampling, V)
        for t in (OSCILLATOR, IDLE)
    )
    assert (exact.j == smooth.j).all()
    for name in ("xi", "xihat", "theta", "y", "distance", "V", "V_bound", "distance_bound"):
        assert getattr(smooth, name) == pytest.approx(getattr(exact, name), rel=1e-4, abs=1e-5), name
    assert smooth.summary["z_norm2"] == pytest.approx(exact.summary["z_norm2"], rel=1e-5)


def test_known_terms_and_inputs_move_the_plant_and_not_the_error():
    terms = "system: {inputs: [u], gx: [u, 1], gy: [2],"
    spec = read(OSCILLATOR.replace("system: {", terms).replace("x0: [0, 0]", "u: ['where(t < 3, 1, -1)'], x0: [0, 0]"))
    run, bare = (simulate_sporadic(s, DESIGN, paper(0.205, 0.41), None) for s in (spec, read(OSCILLATOR)))
    assert (-run.e) == pytest.approx((-bare.e), abs=1e-12)
    assert np.abs(run.xi - bare.xi).max() > 1
    at = run.t < 3
    z1, z2 = run.xi[at].T  # z1' = z2 + 1 + w, z2' = -4 z1 + 1 with w = -1
    assert z1 == pytest.approx((1 - np.cos(2 * run.t[at])) / 4, abs=1e-12)
    assert z2 == pytest.approx(np.sin(2 * run.t[at]) / 2, abs=1e-12)
    assert run.y[-1] == pytest.approx(2 + np.interp(run.schedule.received[-1], run.t, run.xi[:, 0]), abs=1e-3)
    assert run.y[0] == 2  # what the observer supposes of an output with gy = 2 at zhat = 0


def test_a_state_feedback_and_a_smooth_input_are_integrated():
    feedback = read(OSCILLATOR.replace("system: {", "system: {inputs: [u], gx: [0, u],"), w=None, horizon=5.0)
    u = parse("-x2 + sin(t)", ["t", "x1", "x2"])
    spec = replace(feedback, simulation=replace(feedback.simulation, u=(u,), x0=np.array([1.0, 0])))
    run = simulate_sporadic(spec, DESIGN, Sampling(0.2, 0.4), None)
    end = solve_ivp(lambda t, z: [z[1], -4 * z[0] - z[1] + np.sin(t)], (0, 5), [1, 0], rtol=1e-11, atol=1e-12).y[:, -1]
    assert run.xi[-1] == pytest.approx(end, rel=1e-6)


def test_the_timer_counts_down_to_the_next_measurement():
    run = simulate_sporadic(free(points=1001), DESIGN, Sampling(0.25, 0.5, period=0.5), None)
    expected = 0.5 - np.mod(run.t + 1e-12, 0.5)
    assert run.timer[:-1] == pytest.approx(expected[:-1], abs=1e-9)


def test_without_a_guarantee_nothing_is_checked_and_the_summary_says_so():
    run = simulate_sporadic(free(), DESIGN, Sampling(0.205, 0.41), None)
    assert run.V is run.V_bound is run.distance_bound is None
    assert run.summary["bounds"] == []
    assert run.summary["bounds_omitted"] == "no guarantee: nothing is proved of these gains with this plant"


def test_the_table_holds_what_the_observer_has_at_each_time():
    run = simulate_sporadic(free(points=101), DESIGN, Sampling(0.25, 0.5, period=0.5), None)
    header, rows = run.table()
    assert header == ["t", "x1", "x2", "hat_x1", "hat_x2", "w1", "y1", "received"]
    assert rows.shape == (101, 8)
    assert np.isfinite(rows).all()
    assert rows[0, -2] == -2  # C zhat(0), as long as nothing is received
    assert rows[7, -2:] == pytest.approx([np.interp(0.5, run.t, run.xi[:, 0]), 1])


def test_an_observer_that_diverges_is_an_escape():
    run = simulate_sporadic(free(horizon=200.0), gains([[50], [0]], [[5]]), Sampling(1, 1), None)
    assert run.status == "escape"
    assert run.time < 200
    assert np.isfinite(run.table()[1]).all()
    json.dumps(run.summary, allow_nan=False)


def test_a_stiff_injection_is_solved_by_exponentials_and_by_lsoda_alike():
    stiff = gains([[2e5], [0]], [[-1e6]])
    still = {"w": None, "x0": np.ones(2), "horizon": 1.0, "points": 50}
    exact, smooth = (simulate_sporadic(read(t, **still), stiff, Sampling(0.1, 0.2), None) for t in (OSCILLATOR, IDLE))
    assert (-smooth.e) == pytest.approx((-exact.e), rel=1e-5, abs=1e-7)
    flow, jump = expm(0.2 * np.array([[0, 1], [-4, 0]])), np.diag([1 - 0.2, 1])  # L/|H| = 0.2 at once
    end = flow @ np.linalg.matrix_power(jump @ flow, 4) @ np.ones(2)
    assert (-exact.e)[-1] == pytest.approx(end, rel=1e-5)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ("t - 1", "the law gives -0.59 at t = 0.41"),
        ("0", "the law gives 0 at t = 0.41"),
        ("sqrt(-1 - t)", "the law gives nan"),
        ("1/(t - 0.41)", "the law gives inf"),
        ("1e-9", "more than 200,000 measurements"),
    ],
)
def test_a_law_that_gives_no_interval_is_refused_in_one_line(law, message):
    with pytest.raises(UsageError, match=message) as caught:
        simulate_sporadic(free(), DESIGN, Sampling(0.205, 0.41, parse(law, ["t"])), None)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"T1": 0.5}, "0 <= T1 <= T2"),
        ({"T1": -0.1}, "0 <= T1 <= T2"),
        ({"T1": 0.0, "T2": 0.0}, "0 <= T1 <= T2"),
        ({"T2": float("nan")}, "0 <= T1 <= T2"),
        ({"law": ""}, "give periodic, random, or a law"),
        ({"law": "sometimes"}, "give periodic, random, or a law"),
        ({"law": parse("x + t", ["x", "t"])}, "contains x"),
        ({"period": 0.0}, "simulation.period"),
        ({"dropout": 1.0}, "simulation.dropout"),
        ({"dropout": -0.1}, "simulation.dropout"),
    ],
)
def test_a_sampling_that_makes_no_sense_is_refused(wrong, message):
    with pytest.raises(UsageError, match=message):
        Sampling(**({"T1": 0.205, "T2": 0.41} | wrong))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("C: [[1, 0]]", "C: [[1, 0]], gx: [y1, 0]", "y1 needs y1"),
        ("simulation:", "nonlinearities: [{type: {lipschitz: 1}, Bf: [0, 1], Cq: [1, 0]}]\nsimulation:", "has no `f`"),
        ('w: ["', 'w: ["1/t + ', "no finite value"),
    ],
)
def test_a_spec_that_the_observer_has_no_place_for_is_refused(old, new, message):
    with pytest.raises(UsageError, match=message):
        simulate_sporadic(read(OSCILLATOR.replace(old, new)), DESIGN, Sampling(0.205, 0.41), None)


def test_a_spec_without_a_simulation_is_refused():
    with pytest.raises(UsageError, match="simulation: is missing"):
        simulate_sporadic(replace(read(OSCILLATOR), simulation=None), DESIGN, Sampling(0.205, 0.41), None)
