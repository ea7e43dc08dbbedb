"""Runs in discrete time against a recursion written apart, and against the bounds that are proved of them."""

import json
import re
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from flint import fmpq
from scipy.optimize import root
from support.commands import run as run_command
from support.running import simulate
from support.samples import text

from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UsageError
from obsdesign.families.incremental.design import design
from obsdesign.reading import loads

STEPS = 60
F = {  # of each plant, as numpy has it
    "K1": lambda q: np.array([np.tanh(q[0]), 0.5 * np.sin(q[1])]),
    "K2": lambda q: np.array([np.sin(q[0]), np.tanh(q[0] + q[1])]),
    "K4": lambda q: q**3,
    "K5": lambda q: q + np.sin(q),
    "K8": lambda q: q * np.abs(q),
    "Q1": lambda q: np.clip(q, -1, 1),
}
WRITTEN = {  # and as a spec has it, where its type does not say it
    "K1": ["tanh(q)", "0.5*sin(q)"],
    "K2": ["[sin(q1), tanh(q1 + q2)]"],
    "K4": ["q**3"],
    "K5": ["q + sin(q)"],
}
CASES = [
    ("K1", "type: l2, rho: .95"),
    ("K1", "type: l2, rho: .95, estimate: filtered"),
    ("K2", "type: l2, rho: .9"),
    ("K2", "type: l2, rho: .9, L2: [[-1, 0], [0, 0]]"),
    ("K4", "type: l2, rho: .98"),
    ("K4", "type: l2, rho: .98, L2: free"),
    ("K5", "type: l2, rho: .95"),
    ("K5", "type: l2, rho: .95, L2: [[.5]]"),
    ("K8", "type: l2, rho: .95, estimate: filtered, L2: [[0, -10]]"),
    ("K8", "type: l2, rho: .95, estimate: filtered, L2: [[0, -3]]"),
    ("Q1", "type: linf, rho: .8"),
    ("Q1", "type: linf, rho: .8, estimate: filtered"),
]


X0 = {"K1": [1, -1, 0.5], "K2": [1, 0.5, -1], "K4": [1, -0.5], "K5": [0.5, -1], "K8": [0.2, 0.1, -0.3], "Q1": [2, -1]}
W = [lambda t: np.sin(2 * t), lambda t: np.cos(5 * t) * np.exp(-t / 5), lambda t: np.sin(t) ** 2]
W_WRITTEN = ["sin(2*t)", "cos(5*t)*exp(-t/5)", "sin(t)**2"]


def spec_of(plant, observer, simulation, period=0.1):
    """Spec with f, a period and a trial."""
    said = text(plant, observer)
    if "period" not in said:
        said = said.replace("time: discrete,", f"time: discrete, period: {period},")
    system, _, observer = said.partition("observer:")
    for f in WRITTEN.get(plant, ()):
        inline = "{type: " in system
        old, new = ("{type: ", f"{{f: {f}, typ: ") if inline else ("- type: ", f"- f: {f}\n    typ: ")
        system = system.replace(old, new, 1)
    return loads(f"{system.replace('typ:', 'type:')}observer:{observer}simulation: {simulation}\n")


@cache
def designed(plant, observer):
    """Spec with a trial, gains, and what is proved of them."""
    x0, nw = X0[plant], 3 if plant in {"K2", "K8"} else 2
    trial = f"{{horizon: 6, x0: {x0}, w: [{', '.join(W_WRITTEN[:nw])}]}}"
    spec = spec_of(plant, f"{observer}, slack: .02", trial)
    made = design(spec, Engine())
    return spec, made.gains, made.claim.guarantee(spec)


def recursion(plant, gains, f, x, xhat, v, *, filtered, noise=None):
    """States, estimates and outputs of a plant and its observer, sample by sample: their equations as they are.

    `noise`, (samples + 1, ny), is added to what is measured.
    """
    noise = np.zeros((len(v), len(plant.C))) if noise is None else noise
    A, Bf, B, Cq, Dqf, Dq, C, Df, D = (
        getattr(plant.doubles, name) for name in ("A", "Bf", "B", "Cq", "Dqf", "Dq", "C", "Df", "D")
    )
    L1, L2 = (gains[name].astype(float) for name in ("L1", "L2"))

    def solved(q):
        """The q with q = q(f(q))."""
        found = root(lambda g: g - q(f(g)), np.zeros(len(Cq)), method="hybr", tol=1e-14)
        return found.x

    rows = []
    for (now, here), (following, there) in pairwise(zip(v, noise, strict=True)):
        q = solved(lambda g: Cq @ x + Dqf @ g + Dq @ now)  # noqa: B023
        y = C @ x + Df @ f(q) + D @ now + here
        rows.append([*x, *xhat, *y])
        after = A @ x + Bf @ f(q) + B @ now
        if filtered:
            measured = C @ after + D @ following + there
            ahead = lambda g: C @ (A @ xhat + Bf @ g) - measured  # noqa: B023, E731
        else:
            ahead = lambda g: C @ xhat + Df @ g - y  # noqa: B023, E731
        qhat = solved(lambda g: Cq @ xhat + Dqf @ g + L2 @ ahead(g))  # noqa: B023
        xhat = A @ xhat + Bf @ f(qhat) + L1 @ ahead(f(qhat))
        x = after
    return np.array(rows)


@pytest.mark.parametrize(("plant", "observer"), CASES)
def test_a_run_is_the_recursion_of_plant_and_observer(plant, observer):
    spec, gains, guarantee = designed(plant, observer)
    run = simulate(spec, gains, guarantee)
    times = 0.1 * np.arange(STEPS + 2)
    v = np.column_stack([w(times) for w in W])[:, : len(spec.drives)]
    expected = recursion(
        spec.augmented, gains, F[plant], np.array(X0[plant], float), np.zeros(spec.augmented.n), v,
        filtered="filtered" in observer,
    )  # fmt: skip
    assert run.t == pytest.approx(times[:-1], abs=1e-14)
    assert np.hstack([run.xi, run.xihat, run.y]) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert run.e == pytest.approx(run.xihat - run.xi, abs=1e-9)
    assert run.w == pytest.approx(v[:-1], abs=1e-12)


@pytest.mark.parametrize(("plant", "observer"), CASES)
def test_the_bounds_that_are_proved_hold_at_every_sample(plant, observer):
    run = simulate(*designed(plant, observer))
    assert run.summary["bounds_omitted"] is None
    assert len(run.summary["bounds"]) >= 5
    assert all(bound["holds"] for bound in run.summary["bounds"])
    assert (run.V_bound * (1 + 1e-9) >= run.V).all()
    V, v = run.V, np.sqrt(drive_of(run)[:-1])
    g = run.guarantee
    supplied = g.rate**2 * V[:-1] + (g.mu2 if g.norm == "norm2" else (1 - g.rate**2) * g.mu1) * v**2
    stored = V[1:] + (g.mu1 * (run.z[:-1] ** 2).sum(axis=1) if g.norm == "norm2" else 0)
    assert (stored <= supplied * (1 + 1e-9) + 1e-12).all()
    step = next(bound for bound in run.summary["bounds"] if bound["name"].startswith("at each sample"))
    at = round(step["time"] / 0.1) - 1
    assert (step["value"], step["bound"]) == pytest.approx((stored[at], supplied[at]), rel=1e-9)


def drive_of(run):
    """|v|^2 of the inequality at each sample, (N,): of filtered estimates the noise is that of the next sample."""
    times = 0.1 * np.arange(len(run.t) + 1)
    v = np.column_stack([w(times) for w in W])[:, : run.v.shape[1]] ** 2
    if not run.spec.observer.filtered:
        return v[:-1].sum(axis=1)
    return v[:-1, 0] + v[1:, 1:].sum(axis=1)


@pytest.mark.parametrize(("plant", "observer"), [CASES[0], CASES[1], ("Q1", "type: linf, rho: .8")])
@pytest.mark.parametrize("what", ["gamma", "rho"])
def test_a_false_guarantee_is_caught(plant, observer, what):
    spec, gains, guarantee = designed(plant, observer)
    if what == "rho":
        lie = replace(guarantee, rate=0.3)
    elif guarantee.norm == "norm2":
        lie = replace(guarantee, mu2=guarantee.mu2 / 1e4, gamma=guarantee.gamma / 100)
    else:
        lie = replace(guarantee, mu1=guarantee.mu1 / 1e4, gamma=guarantee.gamma / 100)
    run = simulate(spec, gains, lie)
    broken = [bound["name"] for bound in run.summary["bounds"] if not bound["holds"]]
    assert any(name.startswith("at each sample") for name in broken)
    assert len(broken) > 1


@pytest.mark.parametrize("observer", ["type: l2, rho: .95", "type: l2, rho: .95, estimate: filtered"])
def test_noise_is_drawn_at_each_sample(observer):
    spec, gains, guarantee = designed("K1", observer)
    trial = "{horizon: 6, x0: [1, -1, .5], w: [sin(2*t), 0], noise: {type: normal, amplitude: .3}, seed: 3}"
    noisy = replace(spec, simulation=spec_of("K1", observer, trial).simulation)
    run = simulate(noisy, gains, guarantee)
    noise = (run.y - run.y_true)[:, 0]
    assert len(set(noise)) == STEPS + 1
    assert noise.std() == pytest.approx(0.3, rel=0.3)
    assert np.array_equal(noise, run["noise_y1"])
    assert run.summary["bounds_omitted"] == "the guarantee does not cover simulation.noise"
    times = 0.1 * np.arange(STEPS + 2)
    v = np.column_stack([np.sin(2 * times), 0 * times])
    expected = recursion(
        spec.augmented, gains, F["K1"], np.array(X0["K1"], float), np.zeros(3), v,
        filtered="filtered" in observer, noise=np.append(noise, 0.0)[:, None],
    )  # fmt: skip
    assert np.hstack([run.xi, run.xihat, run.y])[:-1] == pytest.approx(expected[:-1], rel=1e-9, abs=1e-9)
    again = simulate(noisy, gains, guarantee)
    assert np.array_equal(run.y, again.y)


DRIVEN = """obsdesign: 1
system: {time: discrete, period: 0.2, A: [[.9, .1], [-.1, .8]], C: [[1, 0], [0, 1]], B: [[1], [.5]], D: [[.1], [0]]}
disturbance: MODEL
observer: {type: l2, L2: 0, ESTIMATE gains: {L1: [[-.5, .1], [.1, -.4], ROWS], L2: []}}
simulation: {horizon: 8, x0: [1, -1], SIGNAL}
"""
MODELS = [
    ("integrator", 1, "w: [sin(t)]"),
    ("integrator", 1, "w: ['where(t <= 0.6000001, 0, 1)']"),
    ("double-integrator", 2, "w: [sin(t)]"),
    ("{type: {sinusoid: {omega: 3}}}", 2, "w: [t*sin(3*t)]"),
    ("integrator", 1, "v: [cos(t)]"),
    ("double-integrator", 2, "v: [cos(t)]"),
    ("{type: {bias+sinusoid: {omega: 3}}}", 3, "v: [cos(t), sin(t)]"),
    ("{model: {Am: [[.9]], Bm: [[.1]], Cm: [[1]]}}", 1, "v: [cos(t)]"),
]


@pytest.mark.parametrize("estimate", ["", "estimate: filtered,"])
@pytest.mark.parametrize(("model", "order", "signal"), MODELS)
def test_a_disturbance_model_is_driven_by_shifts(model, order, signal, estimate):
    rows = ", ".join(["[-.1, -.1]"] * order)
    text = DRIVEN.replace("MODEL", model).replace("ROWS", rows).replace("SIGNAL", signal).replace("ESTIMATE", estimate)
    spec = loads(text)
    gains = {"L1": np.array(spec.observer.gains["L1"].astype(float)), "L2": np.zeros((0, 2))}
    run = simulate(spec, gains, None)
    plant, model = spec.augmented.doubles, spec.generator
    assert run.xi[1:] == pytest.approx(run.xi[:-1] @ plant.A.T + run.v[:-1] @ plant.B.T, abs=1e-9)
    assert run.w == pytest.approx(run.xi[:, 2:] @ model.Cm.astype(float).T, abs=1e-9)
    if signal.startswith("w"):
        given = spec.simulation.w[0].function(["t"])(run.t)
        assert run.w[:, 0] == pytest.approx(given, abs=1e-12)
    times = 0.2 * np.arange(len(run.t) + 1)
    v = np.vstack([run.v, np.zeros((1, run.v.shape[1]))])
    expected = recursion(
        spec.augmented, gains, lambda q: q, run.xi[0], np.zeros(2 + order), v, filtered=bool(estimate)
    )  # fmt: skip
    assert len(times) == len(v)
    assert np.hstack([run.xi, run.xihat, run.y]) == pytest.approx(expected, abs=1e-8)
    assert run.what[:, 0] == pytest.approx(run.xihat[:, 2:] @ model.Cm[0].astype(float), abs=1e-9)


@pytest.mark.parametrize(
    ("trial", "said"),
    [
        ("{horizon: 6, noise: {amplitude: .1, period: .05}}", "0.05 s is not that of the samples, 0.1 s"),
        ("{horizon: .05}", "ends before the next sample; give at least system.period, 0.1 s"),
        ("{horizon: 1e6}", "more than 1,000,000 samples"),
        ("{horizon: 6, sampling: random}", "belongs to observer.type sporadic"),
    ],
)
def test_what_does_not_go_with_samples_is_refused_in_one_line(trial, said):
    with pytest.raises(UsageError, match=re.escape(said)) as refused:
        spec_of("K1", "type: l2, rho: .95", trial)
    assert len(refused.value.problems) == 1


def test_the_period_of_the_noise_may_be_repeated():
    given = spec_of("K1", "type: l2", "{horizon: 6, noise: {amplitude: .1, period: .1}}").simulation
    assert given.noise.period == 0.1


PENDULUM = """obsdesign: 1
system:
  time: discrete
  period: 0.05
  inputs: [u]
  disturbances: [push, n]
  dynamics: {angle: angle + 0.05*rate, rate: 0.98*rate - 0.05*sin(angle) + 0.05*u + 0.05*push}
  outputs: {y: angle + 0.1*n + 0.2*u}
observer: OBSERVER
simulation: {horizon: 5, x0: [1, 0], xhat0: [0.5, 0.5], u: 0.3*sin(t) - 0.1*rate, w: [cos(3*t), sin(40*t)]}
"""


@pytest.mark.parametrize("estimate", ["predicted", "filtered"])
def test_equations_give_the_next_sample(estimate):
    observer = f"{{type: l2, rho: 1, estimate: {estimate}, gains: {{L1: [-.4, -.8], L2: [0]}}}}"
    spec = loads(PENDULUM.replace("OBSERVER", observer))
    run = simulate(spec, {"L1": np.array([[-0.4], [-0.8]]), "L2": np.zeros((1, 1))}, None)
    t = 0.05 * np.arange(102)
    push, n = np.cos(3 * t), np.sin(40 * t)
    x, xhat = np.array([1.0, 0.0]), np.array([0.5, 0.5])

    def moved(x, u, push):
        return np.array([x[0] + 0.05 * x[1], 0.98 * x[1] - 0.05 * np.sin(x[0]) + 0.05 * u + 0.05 * push])

    for k in range(101):
        u = 0.3 * np.sin(t[k]) - 0.1 * x[1]
        y = x[0] + 0.1 * n[k] + 0.2 * u
        assert [run["y"][k], run["u"][k]] == pytest.approx([y, u], abs=1e-12)
        assert np.hstack([run.xi[k], run.xihat[k]]) == pytest.approx([*x, *xhat], abs=1e-12)
        x, bar = moved(x, u, push[k]), moved(xhat, u, 0)
        if estimate == "filtered":
            u = 0.3 * np.sin(t[k + 1]) - 0.1 * x[1]
            y = x[0] + 0.1 * n[k + 1] + 0.2 * u
            xhat = bar + np.array([-0.4, -0.8]) * (bar[0] + 0.2 * u - y)
        else:
            xhat = bar + np.array([-0.4, -0.8]) * (xhat[0] + 0.2 * u - y)


def given(text, L1, L2=()):
    """Run of a spec, with gains of a plant with one output, of which nothing is proved."""
    gains = {"L1": np.array(L1, float)[:, None], "L2": np.array(L2, float).reshape(-1, 1)}
    return simulate(loads(f"obsdesign: 1\n{text}"), gains, None)


SCALAR = """
system: {time: discrete, period: 0.1, A: [[A0]], C: [[1]]}
observer: {type: l2, gains: {L1: [-.5], L2: []}}
simulation: {horizon: H0, x0: [1], xhat0: [0], points: 5, events: {}}
"""


def test_all_samples_are_kept_and_points_thins_the_figure_alone():
    run = given(SCALAR.replace("A0", "0.9").replace("H0", "3.05"), [-0.5])
    assert run.t == pytest.approx(0.1 * np.arange(31))
    assert run.table()[1].shape == (31, 4)
    assert run.xi[:, 0] == pytest.approx(0.9 ** np.arange(31), rel=1e-12)
    assert run.e[:, 0] == pytest.approx(-(0.4 ** np.arange(31)), rel=1e-12)
    assert np.array_equal(run.t, run.steps.t)
    assert run.plot().startswith(b"\x89PNG")
    assert run.summary["z_norm2"] == pytest.approx(np.sqrt(sum(0.16**k for k in range(31))), rel=1e-12)
    assert run.summary["time"] == 3.0


def test_an_error_has_settled_at_the_first_sample_from_which_on_it_is_small():
    run = given(SCALAR.replace("A0", "0.9").replace("H0", "3"), [-0.5])
    assert run.summary["settling"]["x1"] == {"t5": 0.4, "t1": pytest.approx(0.6), "peak": 1.0}
    assert run.summary["settling_time"] == pytest.approx(0.6)


def test_an_event_ends_a_run_at_a_sample():
    text = SCALAR.replace("A0", "1.5").replace("H0", "3").replace("{}", "{large: x1 > 5}")
    run = given(text, [-0.5])
    assert (run.status, run.time) == ("stopped", pytest.approx(0.4))
    assert run.xi[-1, 0] == 1.5**4
    assert "large" in run.summary["reason"]


def test_a_state_that_outgrows_the_doubles_escapes():
    run = given(SCALAR.replace("A0", "1e20").replace("H0", "3"), [-0.5])
    assert run.status == "escape"
    assert np.isfinite(run.table()[1]).all()
    assert run.xi[-1, 0] == pytest.approx(1e140, rel=1e-9)
    assert run.time == run.t[-1] == pytest.approx(0.7)


def test_a_plant_that_leaves_the_domain_of_its_model_ends_at_the_last_sample_in_it():
    run = given(
        """
system: {time: discrete, period: 0.1, A: [[1]], C: [[1]]}
nonlinearities: [{f: -sqrt(q), type: {slope: [-10, 0]}, region: {q: [0.01, 9]}, Bf: [.1], Cq: [1]}]
observer: {type: l2, gains: {L1: [-.5], L2: [0]}}
simulation: {horizon: 10, x0: [0.04], xhat0: [0.04]}
""",
        [-0.5],
        [0],
    )
    x = [0.04, 0.02, 0.02 - 0.1 * np.sqrt(0.02)]  # the next one is below zero
    assert (run.status, run.time) == ("stall", pytest.approx(0.2))
    assert run.xi[:, 0] == pytest.approx(x)
    assert "after t = 0.2: the model has no finite value" in run.summary["reason"]
    assert run.left[0].time == pytest.approx(0.2)


def test_a_run_that_leaves_the_region_is_held_to_its_bounds_before():
    spec, gains, guarantee = designed("K1", "type: l2, rho: .95")
    first = replace(spec.nonlinearities[0], region=((fmpq(-1, 2), fmpq(1, 2)),))
    local = replace(spec, nonlinearities=(first, spec.nonlinearities[1]))
    started = replace(local, simulation=replace(spec.simulation, x0=np.array([1.0, 0.0, 0.5])))
    run = simulate(started, gains, guarantee)
    assert run.left[0].time in run.t
    assert run.until == run.left[0].time > 0
    assert run.left[0].time == run.t[np.argmax(np.maximum(np.abs(run.q[:, 0]), np.abs(run.qhat[:, 0])) > 0.5)]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_command_line_solves_simulates_and_compares_in_samples(here):
    for name, observer in (("one", "type: l2, rho: .95"), ("two", "type: l2, rho: .95, estimate: filtered")):
        trial = "{horizon: 6, x0: [1, -1, .5], noise: {amplitude: .1}, seed: 2}"
        (here / f"{name}.yaml").write_text(spec_of("K1", observer, trial).text.replace("K1", name))
        assert run_command("solve", f"{name}.yaml").exit_code == 0
    assert run_command("simulate", "two.gains.json").exit_code == 0
    assert len((here / "two.run.csv").read_text().splitlines()) == STEPS + 2
    found = run_command("compare", "one.gains.json", "two.gains.json", "--json", "--seeds", "3")
    assert found.exit_code == 0
    report = json.loads(found.stdout)
    quiet, noisy, gains = [], [], loaded(here, "one")
    for seed in (2, 3, 4):
        trial = f"{{horizon: 6, x0: [1, -1, .5], noise: {{amplitude: .1}}, seed: {seed}}}"
        spec = spec_of("K1", "type: l2, rho: .95", trial)
        noisy.append(simulate(spec, gains, None).e)
        quiet.append(simulate(replace(spec, simulation=replace(spec.simulation, noise=None)), gains, None).e)
    late = 0.1 * np.arange(STEPS + 1) >= 1
    rms = [np.sqrt(np.mean((a - b)[late] ** 2, axis=0)) for a, b in zip(noisy, quiet, strict=True)]
    states = report["observers"][0]["states"]
    assert [states[name]["noise_rms"] for name in ("x1", "x2", "x3")] == pytest.approx(np.mean(rms, axis=0), rel=1e-9)
    assert report["observers"][0]["states"]["x1"]["floor"] == pytest.approx(
        np.sqrt(np.mean(quiet[0][late, 0] ** 2)), rel=1e-9
    )
    assert report["notes"] == []


def loaded(here, name):
    """Gains of a file."""
    observer = json.loads((here / f"{name}.gains.json").read_text())["observer"]
    return {name: np.array(observer[name], float).reshape(-1, 1) for name in ("L1", "L2")}


def test_a_plant_in_samples_and_one_in_continuous_time_are_not_compared(here):
    trial = "{horizon: 6, x0: [1, -1, .5]}"
    text = spec_of("K1", "type: l2, rho: .95", trial).text
    (here / "one.yaml").write_text(text)
    (here / "two.yaml").write_text(text.replace("period: 0.1", "period: 0.2"))
    found = run_command("compare", "one.yaml", "two.yaml")
    assert found.exit_code == 2
    assert "time is discrete, with samples 0.2 s apart, but discrete, with samples 0.1 s apart" in found.output
