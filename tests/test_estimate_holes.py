"""Logs with holes: of an output that is missing an observer runs in open loop, of any family, by any engine."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from support.logs import log
from support.shipped import solved

import obsdesign as od
from obsdesign.data.interpreted import Interpreted
from obsdesign.data.runner import Compiled
from obsdesign.errors import UsageError
from obsdesign.reading import loads
from obsdesign.stepping.implemented import implemented
from obsdesign.tables.estimates import estimates_table
from obsdesign.work import trial

PERIOD = 0.01

# f enters an output (Df), and the injection L2 its argument: qhat and yhat are an algebraic loop
TWO = """
obsdesign: 1
name: Two rates
system: {states: [x, z], inputs: [u], outputs: [y1, y2], A: [[-1, 1], [-2, -1]], B: [[0.1], [0.2]],
         C: [[1, 0], [0, 1]], D: [[0.1], [0]], gx: [0, u], gy: [0.1*u, 0]}
nonlinearities: [{f: sin(q), type: {slope: [-1, 1]}, Bf: [0.3, 0.5], Cq: [1, 0.5], Df: [0.2, 0.1]}]
observer: {type: l2, alpha: 0.1, gains: {L1: [[-1, 0.2], [0.1, -2]], L2: [[-0.3, 0.4]]}}
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def two():
    """The observer in steps of `PERIOD`, as C and in Python."""
    design = trial(loads(f"{TWO}implementation: {{period: {PERIOD}, method: rk4}}\n"))
    one = implemented(design.spec, design.observer)
    return Compiled.of(one), Interpreted.of(one)


def rate_of_two(x, u, y, known):
    """Its equations, in which y - yhat is 0 where y is not known; the loop is solved by repetition."""
    A, C = np.array([[-1, 1], [-2, -1.0]]), np.eye(2)
    L1, L2, Df = np.array([[-1, 0.2], [0.1, -2]]), np.array([-0.3, 0.4]), np.array([0.2, 0.1])
    off = np.zeros(2)
    for _ in range(20):
        f = np.sin(x @ [1, 0.5] + L2 @ off)
        off = np.where(known, C @ x + Df * f + [0.1 * u, 0] - np.where(known, y, 0), 0)
    return A @ x + np.array([0.3, 0.5]) * f + [0, u] + L1 @ off


def course(rng, K, gap):
    """Rows with a second output at every tenth, holes in the first beside."""
    t = np.cumsum(rng.uniform(0.2, 1.8, K)) * gap
    u, y = np.sin(t), np.column_stack([np.cos(t), np.sin(2 * t)])
    y[np.arange(K) % 10 > 0, 1] = np.nan
    y[rng.uniform(size=K) < 0.2, 0] = np.nan
    return t, u, y


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_an_output_at_a_tenth_of_the_rate_is_left_out_between_its_rows(hold):
    """Without steps in the spec: against an integrator to 1e-8, over each time between rows."""
    t, u, y = course(np.random.default_rng(4), 30, 0.1)
    found = od.estimate(trial(loads(TWO)), log("log.csv", ["t", "u", "y1", "y2"], t, u, y), hold=hold)
    x, expected = np.zeros(2), [np.zeros(2)]
    for k in range(len(t) - 1):
        slope = np.where(np.isnan(y[k + 1]), 0, (y[k + 1] - y[k]) / (t[k + 1] - t[k])) * (hold == "first")
        climb = (u[k + 1] - u[k]) / (t[k + 1] - t[k]) * (hold == "first")
        known = np.isfinite(y[k])
        at = lambda s, x, k=k, slope=slope, climb=climb, known=known: rate_of_two(  # noqa: E731
            x, u[k] + climb * (s - t[k]), y[k] + slope * (s - t[k]), known
        )
        x = solve_ivp(at, (t[k], t[k + 1]), x, rtol=1e-8, atol=1e-10, method="DOP853").y[:, -1]
        expected.append(x)
    hats = np.column_stack([found["hat_x"], found["hat_z"]])
    assert np.abs(hats - expected).max() < 3e-6 * np.abs(expected).max()
    assert found.report["step"] > 1e-3
    assert found.report["missing"] == np.isnan(y).any(axis=1).sum()


@given(st.integers(0, 10**6))
@settings(max_examples=8, deadline=None)
def test_engines_and_a_loop_by_hand_agree_wherever_holes_are(two, seed):
    rng = np.random.default_rng(seed)
    K = 25
    t, u, y = PERIOD * np.arange(K), rng.normal(size=(K, 1)), rng.normal(size=(K, 2))
    y[rng.uniform(size=(K, 2)) < rng.uniform()] = np.nan
    x, expected = np.zeros(2), []
    for k in range(K):
        expected.append(x)
        rate = lambda x, k=k: rate_of_two(x, u[k, 0], y[k], np.isfinite(y[k]))  # noqa: E731
        k1 = rate(x)
        k2 = rate(x + PERIOD / 2 * k1)
        k3 = rate(x + PERIOD / 2 * k2)
        x = x + PERIOD / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + PERIOD * k3))
    for start in two:
        found = start.copied().run(t, u, y, 0, first=False)
        assert found.rows == K
        assert found.estimates == pytest.approx(np.array(expected), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("kind", [Compiled, Interpreted])
def test_exact_steps_are_exact_of_what_is_left(kind):
    """Of a linear plant with a fast injection, in rows of all kinds, against the matrix exponential."""
    text = TWO.replace("f: sin(q)", "f: 0*q").replace("[[-1, 0.2], [0.1, -2]]", "[[-900, 2], [1, -800]]")
    design = trial(loads(f"{text}implementation: {{period: {PERIOD}, method: exact}}\n"))
    rng, K = np.random.default_rng(2), 30
    t, u, y = PERIOD * np.cumsum(rng.uniform(0.3, 2, K)), rng.normal(size=(K, 1)), rng.normal(size=(K, 2))
    y[rng.uniform(size=K) < 0.4, 1] = np.nan
    found = kind.of(implemented(design.spec, design.observer)).run(t, u, y, 0, first=False)
    A, L1, x = np.array([[-1, 1], [-2, -1.0]]), np.array([[-900, 2.0], [1, -800]]), np.zeros(2)
    for k in range(K):
        assert found.estimates[k] == pytest.approx(x, rel=1e-9, abs=1e-9)
        known = np.diag(np.isfinite(y[k]).astype(float))
        b = [0, u[k, 0]] - L1 @ known @ (np.nan_to_num(y[k]) - [0.1 * u[k, 0], 0])
        if k + 1 < K:
            grown = expm((t[k + 1] - t[k]) * np.block([[A + L1 @ known, b[:, None]], [np.zeros((1, 3))]]))
            x = grown[:2, :2] @ x + grown[:2, 2]


FILTER = """
obsdesign: 1
name: Filter
system: {TIME, states: [x, z], outputs: [y1, y2], A: [[0.9, 0.1], [-0.2, 0.8]], B: [[1, 0], [0, 1]],
         C: [[1, 0], [1, 1]]}
observer: {type: ekf, Q: [[0.1, 0.02], [0.02, 0.2]], R: [[0.5, 0.3], [0.3, 0.4]], P0: 2, ESTIMATE}
"""


@pytest.mark.parametrize("estimate", ["predicted", "filtered"])
@pytest.mark.parametrize("kind", [Compiled, Interpreted])
def test_a_filter_takes_nothing_from_what_it_does_not_know(kind, estimate):
    """Against the ordinary filter with the rows of C and R that are known, R not being diagonal."""
    text = FILTER.replace("TIME", "time: discrete, period: 1").replace("ESTIMATE", f"estimate: {estimate}")
    design, rng = trial(loads(text)), np.random.default_rng(1)
    A, C = np.array([[0.9, 0.1], [-0.2, 0.8]]), np.array([[1, 0], [1, 1.0]])
    Q, R = np.array([[0.1, 0.02], [0.02, 0.2]]), np.array([[0.5, 0.3], [0.3, 0.4]])
    y = rng.normal(size=(60, 2))
    y[rng.uniform(size=(60, 2)) < 0.5] = np.nan
    found = kind.of(implemented(design.spec, design.observer)).run(
        np.arange(60.0), np.zeros((60, 0)), y, 0, first=False
    )
    x, P = np.zeros(2), 2 * np.eye(2)
    for k in range(60):
        i, before = np.isfinite(y[k]), x
        K = P @ C[i].T @ np.linalg.inv(C[i] @ P @ C[i].T + R[np.ix_(i, i)])
        x, P = x + K @ (y[k, i] - C[i] @ x), P - K @ C[i] @ P
        assert found.estimates[k] == pytest.approx(x if estimate == "filtered" else before, rel=1e-9, abs=1e-9)
        x, P = A @ x, A @ P @ A.T + Q


UNKNOWN = """
obsdesign: 1
name: Unknown input
system: {states: [x1, x2, x3], inputs: [u], outputs: [y1, y2], A: [[-2, -2, 0], [0, 0, 1], [0, -3, -4]],
         B: [[1], [0], [0]], C: [[1, 0, 0], [0, 0, 1]], gx: [0, 0, u], gy: [u, 0]}
observer: {type: unknown-input, alpha: 0.5}
"""


@pytest.fixture(scope="module")
def unknown():
    """Design of an unknown-input observer."""
    return od.solve(loads(UNKNOWN))


def test_an_output_that_estimates_hold_at_once_goes_on_by_the_plant(unknown):
    """While y1 is not known, xhat goes on as the plant does, with y2 injected where that is known."""
    design = unknown
    E, L = (np.asarray(design.gains[name], dtype=float) for name in ("E", "L"))
    A, C = np.array([[-2, -2, 0], [0, 0, 1], [0, -3, -4.0]]), np.array([[1, 0, 0], [0, 0, 1.0]])
    t, u, y = course(np.random.default_rng(7), 40, 0.1)
    y[0] = 1.0, 0.5
    found = od.estimate(design, log("log.csv", ["t", "u", "y1", "y2"], t, u, y))
    xi, m = np.zeros(3), y[0] - [u[0], 0]
    for k in range(len(t)):
        known = np.isfinite(y[k])
        m = np.where(known, y[k] - [u[k], 0], m)
        xhat = xi + E @ m
        assert [found[f"hat_{x}"][k] for x in ("x1", "x2", "x3")] == pytest.approx(xhat, rel=1e-4, abs=1e-4)
        if k + 1 == len(t):
            break

        def rate(_, s, k=k, known=known):
            xi, m = s[:3], s[3:]
            xhat = xi + E @ m
            moves = A @ xhat + [0, 0, u[k]]
            own = (np.eye(3) - E @ C) @ moves + L @ np.where(known, np.where(known, y[k], 0) - C @ xhat - [u[k], 0], 0)
            return [*own, *np.where(known, 0, C @ moves)]

        s = solve_ivp(rate, (t[k], t[k + 1]), [*xi, *m], rtol=1e-10, atol=1e-12).y[:, -1]
        xi, m = s[:3], s[3:]


def test_an_observer_that_begins_with_y_waits_for_it(unknown):
    """Rows before the first that has it have no estimates; from there on it is as on a log that begins there."""
    t, u, y = course(np.random.default_rng(7), 30, 0.1)
    y[:7, 0], y[7] = np.nan, (1.0, 0.5)
    design, names = unknown, ["t", "u", "y1", "y2"]
    found = od.estimate(design, log("log.csv", names, t, u, y))
    later = od.estimate(design, log("later.csv", names, t[7:], u[7:], y[7:]))
    assert np.isnan(found["hat_x1"][:7]).all()
    assert found["hat_x2"][7:] == pytest.approx(later["hat_x2"], rel=1e-4, abs=1e-5)
    assert found.report["waited"] == {"rows": 7, "for": ["y1"]}
    assert "at the first row with y1; 7 before it" in estimates_table(found.report, "", "")
    y[:, 0] = np.nan
    with pytest.raises(UsageError, match="no row has y1, with which this observer begins"):
        od.estimate(design, log("log.csv", names, t, u, y))


def test_a_filter_in_steps_predicts_alone_where_y_is_missing():
    """x' = -x + w, y = x + v in steps of h: x and P by hand, a correction with R/h in the steps that have y."""
    system = "{states: [x], outputs: [y], A: [[-1]], B: [[1]], C: [[1]]}"
    text = f"obsdesign: 1\nname: Steps\nsystem: {system}\nobserver: {{type: ekf, Q: 2, R: 0.1, P0: 3}}\n"
    design = trial(loads(f"{text}implementation: {{period: {PERIOD}, method: rk4}}\n"))
    rng = np.random.default_rng(3)
    y = rng.normal(size=(80, 1))
    y[rng.uniform(size=(80, 1)) < 0.6] = np.nan
    start = Interpreted.of(implemented(design.spec, design.observer))
    found = start.run(PERIOD * np.arange(80), np.zeros((80, 0)), y, 0, first=False).estimates[:, 0]
    x, P, decay = 0.0, 3.0, np.exp(-PERIOD)
    for k in range(80):
        assert found[k] == pytest.approx(x, rel=1e-7, abs=1e-9)
        K = P / (P + 0.1 / PERIOD) * np.isfinite(y[k, 0])
        x, P = decay * (x + K * (np.nan_to_num(y[k, 0]) - x)), decay**2 * (1 - K) * P + (1 - decay**2)


def test_in_samples_an_output_that_estimates_hold_goes_on_by_the_plant():
    """xhat = xi + E y, where y is that of the plant a sample after xhat where it is not known."""
    spec, design = solved("unknown-input-sampled")
    p, E, L = spec.plant.doubles, *(np.asarray(design.gains[name], dtype=float) for name in "EL")
    f, rng = spec.nonlinearities[0].f[0].scalar(["q"]), np.random.default_rng(0)
    y = rng.normal(size=(40, 2))
    y[1:][rng.uniform(size=(39, 2)) < 0.5] = np.nan
    start = Interpreted.of(implemented(spec, design.observer))
    found = start.run(float(spec.period) * np.arange(40), np.zeros((40, 0)), y, 0, first=False).estimates
    xi, m = np.zeros(3), y[0]
    for k in range(40):
        known = np.isfinite(y[k])
        xhat = xi + E @ np.where(known, y[k], m)
        assert found[k] == pytest.approx(xhat, rel=1e-9, abs=1e-9)
        following = p.A @ xhat + p.Bf[:, 0] * f(float(p.Cq[0] @ xhat))
        xi = following - E @ p.C @ following + L @ np.where(known, np.nan_to_num(y[k]) - p.C @ xhat, 0)
        m = p.C @ following
