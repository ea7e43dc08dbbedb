"""An observer on a log: the estimates of the simulator, whatever the file looks like, and what is proved of them."""

import json
import math
import os
import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.commands import files, run
from support.logs import log
from support.shipped import SPECS, solved

import obsdesign as od
from obsdesign.data import runner
from obsdesign.data.innovations import LAGS, Innovations
from obsdesign.data.interpreted import Interpreted
from obsdesign.data.radius import radius
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.files import table
from obsdesign.reading import loads
from obsdesign.stepping.implemented import implemented
from obsdesign.tables.estimates import estimates_table
from obsdesign.work import trial

SCALAR = """
obsdesign: 1
name: Scalar
system: {time: discrete, period: 0.1, states: [x], inputs: [force], outputs: [y], A: [[0.9]], B: [[0.1, 0]], C: [[1]],
         D: [[0, 0.05]], gx: [0.1*force], units: {y: m}}
observer: {type: linf, rho: 0.8, objective: min-gamma}
simulation: {horizon: 5, x0: [2], u: [sin(t)], w: ["cos(3*t)", "sin(5*t)"]}
data: {v_sup: 1.5, e0: {x: 2}}
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def scalar():
    """A design, and a run of it: signals and the truth."""
    design = od.solve(loads(SCALAR))
    return design, design.simulate()


def of_run(made, path="log.csv"):
    """Log of a run: time, inputs, outputs as they are measured."""
    return log(path, ["t", *made.spec.inputs, *made.outputs], made.t, made.u, made.y)


def assert_same(found, expected):
    """Numbers that agree to 1e-9 of their size."""
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * max(1e-300, np.abs(expected).max()))


# the simulator


@pytest.mark.parametrize(
    ("name", "period", "method"),
    [
        ("discrete-battery", None, None),
        ("discrete-motor", None, None),  # filtered
        ("pendulum-embedded", None, None),
        ("cuk-kkl-pebo", "1.0e-5", "rk4"),
        ("noisy-output", "1.0e-2", "exact"),
    ],
)
def test_estimates_are_those_of_the_simulator(name, period, method):
    spec, design = solved(name)
    text = spec.text if period is None else f"{spec.text}\nimplementation: {{period: {period}, method: {method}}}\n"
    if period:
        design = od.solve(loads(text, spec.path))
    horizon = min(spec.simulation.horizon, 0.02 if "cuk" in name else 2)
    made = design.simulate(observer="implementation", horizon=horizon)
    found = od.estimate(design, of_run(made))
    for state in spec.plant.states:
        assert_same(found[f"hat_{state}"], made[f"hat_{state}"])
    assert found.report["rows"] == len(made.t)
    assert (found["covered"] == float(design.guarantee is not None)).all()


def test_between_rows_it_is_as_exact_as_it_says():
    """Against an integrator to 1e-10, with y held, at instants of all kinds."""
    spec, design = solved("noisy-output")
    one, L1 = spec.augmented.doubles, design.gains["L1"]
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.001, 0.4, 60))
    y = np.sin(t)[:, None] + 0.1 * rng.normal(size=(60, len(one.C)))
    found = od.estimate(design, log("log.csv", ["t", *spec.plant.outputs], t, y))
    x = np.zeros(one.n)
    block = spec.nonlinearities[0]
    f = block.f[0].scalar(["q"])

    def rate(_, x, y):
        q = one.Cq @ x + design.gains["L2"] @ (one.C @ x - y)
        return one.A @ x + one.Bf @ np.array([f(float(q[0]))]) + L1 @ (one.C @ x - y)

    for k in range(59):
        x = solve_ivp(rate, (t[k], t[k + 1]), x, args=(y[k],), rtol=1e-10, atol=1e-12, method="DOP853").y[:, -1]
    hats = np.array([found[f"hat_{state}"][-1] for state in spec.plant.states])
    assert hats == pytest.approx(x[: spec.plant.n], rel=1e-5, abs=1e-6)
    assert found.report["step"] < np.median(np.diff(t))


def test_straight_lines_are_nearer_to_continuous_time_than_steps():
    design = solved("noisy-output")[1]
    made = design.simulate(horizon=4, points=81)
    path, off = of_run(made), {}
    for hold in ("zero", "first"):
        found = od.estimate(design, path, hold=hold)
        off[hold] = max(np.abs(found[f"hat_{s}"] - made[f"hat_{s}"]).max() for s in design.spec.plant.states)
    assert off["first"] < off["zero"] / 5


def test_both_engines_agree(scalar, monkeypatch):
    """Rows at all kinds of instants, with holes."""
    rng = np.random.default_rng(0)
    for name in ("noisy-output", "ferrante2019-oscillator-gap", "cuk-kkl-pebo"):
        spec, _ = solved(name)
        design = od.solve(loads(f"{spec.text}\nimplementation: {{period: {1e-5 if 'cuk' in name else 1e-2}}}\n"))
        one = implemented(design.spec, design.observer)
        made = design.simulate()
        pick = np.linspace(0, len(made.t) - 1, 200).astype(int)
        t, u, y = np.cumsum(float(one.period) * rng.uniform(0.2, 3, 200)), made.u[pick], made.y[pick].copy()
        y[1:][rng.uniform(size=y[1:].shape) < 0.1] = np.nan
        for first in (False, True):
            found = [kind.run(t, u, y, 0, first) for kind in (runner.Compiled.of(one), Interpreted.of(one))]
            for part, other in zip(found[0][:3], found[1][:3], strict=True):
                assert part == pytest.approx(other, rel=1e-9, abs=1e-9, nan_ok=True)
    design, made = scalar
    compiled = od.estimate(design, of_run(made))
    monkeypatch.setattr(runner.shutil, "which", lambda _: None)
    plain = od.estimate(design, of_run(made))
    assert (compiled.report["engine"], plain.report["engine"]) == ("c", "numpy")
    assert_same(compiled.rows, plain.rows)


def test_the_size_of_blocks_does_not_matter(scalar, monkeypatch):
    design, made = scalar
    whole = od.estimate(design, of_run(made))
    monkeypatch.setattr(table, "BLOCK", 97)
    part = od.estimate(design, "log.csv")
    assert part.rows.tolist() == whole.rows.tolist()
    assert part.report["innovations"]["y"]["rms"] == pytest.approx(whole.report["innovations"]["y"]["rms"], rel=1e-12)


# what is proved


def test_the_truth_is_within_the_radius_and_that_is_not_vacuous(scalar):
    design, made = scalar
    found = od.estimate(design, of_run(made))
    share = np.abs(made["x"] - found["hat_x"]) / found["radius_x"]
    assert share.max() <= 1
    assert share.max() > 0.2


def test_the_radius_is_the_closed_form_of_its_inequality(scalar):
    """One state: radius^2 = V / P, V = rho^(2 k) P e0^2 + c |v|^2 (1 - rho^(2 k)) / (1 - rho^2)."""
    design, made = scalar
    found = od.estimate(design, of_run(made))
    P = float(design.claim.guarantee(design.spec).P[0, 0])
    rates = design.guarantee.rates()
    left = rates.rho ** (2 * np.arange(len(made.t)))
    V = left * P * 4 + rates.c * 1.5**2 * (1 - left) / (1 - rates.rho**2)
    assert found["radius_x"] == pytest.approx(np.sqrt(V / P), rel=1e-6)


def test_the_radius_of_the_first_row_is_what_is_given():
    """Two states: sqrt(V) of both weighs each error by all of P, and yet that at the first row is within e0."""
    text = (
        SCALAR.replace("states: [x]", "states: [x, v]")
        .replace("x: 2", "x: 2, v: 0.01")
        .replace("x0: [2]", "x0: [2, 0]")
    )
    text = text.replace(
        "A: [[0.9]], B: [[0.1, 0]], C: [[1]]", "A: [[0.9, 0.1], [0, 0.8]], B: [[0.1, 0], [0, 0]], C: [[1, 0]]"
    )
    text = text.replace("gx: [0.1*force]", "gx: [0.1*force, 0]").replace("rho: 0.8", "rho: 0.9")
    design = od.solve(loads(text))
    found = od.estimate(design, of_run(design.simulate()))
    assert found["radius_x"][0] == 2
    assert found["radius_v"][0] == 0.01 < found["radius_v"][1]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("data: {v_sup: 1.5, e0: {x: 2}}", "data: {v_sup: 1.5}"), "e0 of x"),
        (("data: {v_sup: 1.5, e0: {x: 2}}", ""), "v_sup"),
    ],
)
def test_without_what_it_rests_on_there_is_no_radius(scalar, change, why):
    _, made = scalar
    found = od.estimate(od.solve(loads(SCALAR.replace(*change))), of_run(made))
    assert "radius_x" not in found.header
    assert why in found.report["radius"]["none"]


PENDULUM = """
obsdesign: 1
name: Pendulum of a log
system:
  states: [angle, speed]
  inputs: [torque]
  disturbances: [push, noise]
  units: {angle: rad, speed: rad/s, torque: N m, encoder: rad}
  dynamics: {angle: speed, speed: -9.81*sin(angle) - 0.5*speed + torque + 0.5*push}
  outputs: {encoder: angle + 1.3e-3*noise}
  domain: {speed: [-4, 4], torque: [-2, 2]}
  discretise: {period: 0.01, method: hold, defect: {q_rate: auto, w_rate: 2}}
observer: {type: linf, rho: {min: 0.8, max: 0.99, points: 12}}
data: {time: time, v_sup: 1.4143, e0: {angle: 0.8, speed: 0.3}}
"""


def test_a_pendulum_of_another_program_is_within_the_radius_in_every_row():
    """Made by MuJoCo 4.0 (RK4, steps of 0.1 ms): a torque that nobody knows, |w| <= 1 and |w'| <= 2, an encoder of 4096
    counts with noise of 0.5 mrad, which its channel of 1.3 mrad bounds, and the truth beside them.
    """
    data = Path(__file__).parent / "support" / "pendulum.csv"
    found = od.estimate(od.solve(loads(PENDULUM)), data)
    truth = dict(zip(("angle", "speed"), np.loadtxt(data, delimiter=",", skiprows=1).T[3:], strict=True))
    for name, true in truth.items():
        assert (np.abs(true - found[f"hat_{name}"]) <= found[f"radius_{name}"]).all()
        assert found[f"radius_{name}"][-1] < 0.25 * np.abs(true).max()
    assert (found["covered"] == 1).all()
    assert "q and w no faster" in found.report["radius"]["premise"]


CONTINUOUS = """
obsdesign: 1
name: Continuous
system: {states: [x], outputs: [y], A: [[-1]], B: [[1, 0]], C: [[1]], D: [[0, 0.1]]}
observer: {type: linf, objective: min-gamma, alpha: 0.9}
simulation: {horizon: 5, x0: [2], w: ["cos(3*t)", "sin(5*t)"]}
data: {v_sup: 3, e0: {x: 2}}
"""


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (CONTINUOUS, "y is not known between rows"),
        (f"{CONTINUOUS}implementation: {{period: 0.01}}\n", "nothing is proved of the steps"),
        (PENDULUM.replace(", defect: {q_rate: auto, w_rate: 2}", ""), "give discretise a defect"),
    ],
)
def test_there_is_no_radius_where_nothing_is_proved(text, why):
    design = od.solve(loads(text))
    names = [*design.spec.inputs, *design.spec.plant.outputs]
    t = 0.01 * np.arange(3) if "PENDULUM" in text or "Pendulum" in text else 0.1 * np.arange(3)
    head = "time" if "Pendulum" in text else "t"
    found = od.estimate(design, log("log.csv", [head, *names], t, *[np.ones(3)] * len(names)))
    assert why in found.report["radius"]["none"]
    assert not any(one.startswith("radius_") for one in found.header)


ESCAPING = """
obsdesign: 1
name: Region
system: {time: discrete, period: 1, states: [x, z], outputs: [y], A: [[0.5, 0], [0, 0.5]], B: [[0, 0], [0, 0]],
         C: [0, 1], D: [0, 1]}
nonlinearities:
  - {f: "where(q<1, 0*q, 10*(q-1))", type: {slope: [0, 0.3], region: {q: [-1, 1]}}, Bf: [1, 0], Cq: [1, 0]}
observer: {type: l2, rho: 0.85, gains: {L1: [[0], [0]]}}
data: {v_sup: 1.0e-3, e0: {x: 3, z: 0.1}}
"""


def test_a_plant_that_may_be_outside_the_region_is_not_covered():
    """The observer stays at 0, in the region; the plant, within e0 of it, need not be."""
    t, y = np.arange(12.0), np.zeros(12)
    path = log("log.csv", ["t", "y"], t, y)
    wide = od.estimate(od.solve(loads(ESCAPING)), path)
    assert (wide["covered"] == 0).all()
    assert np.isnan(wide["radius_x"]).all()
    near = od.estimate(od.solve(loads(ESCAPING.replace("x: 3", "x: 0.3"))), path)
    assert (near["covered"] == 1).all()
    assert np.isfinite(near["radius_x"]).all()


def stepped(design):
    """A design that is run in steps of its own."""
    spec = loads(f"{design.spec.text}\nimplementation: {{period: 1.0e-2, method: rk4}}\n")
    return replace(design, spec=spec)


def test_a_measurement_that_is_overdue_ends_what_is_proved():
    design = solved("ferrante2019-oscillator-clock")[1]
    T1, T2 = design.guarantee.T1, design.guarantee.T2
    t = np.cumsum([0.0, *[(T1 + T2) / 2] * 5, 2 * T2, *[(T1 + T2) / 2] * 3])
    found = od.estimate(design, log("log.csv", ["t", *design.spec.plant.outputs], t, np.ones(len(t))))
    assert found["covered"].tolist() == [1.0] * 6 + [0.0] * 4
    claims = [od.compare([one], data="log.csv").report["observers"][0]["claim"] for one in (design, stepped(design))]
    assert ["of its steps along a log nothing is proved" in claim for claim in claims] == [False, True]
    for rows, covered in ((t, 6), (t[[0, 1, 3, 2, 4]], 3 if t[3] - t[1] <= T2 else 2)):
        path = log("late.csv", ["t", *design.spec.plant.outputs, "rx"], rows, np.ones(len(rows)), rows.max() + rows * 0)
        found = od.estimate(design, path, columns={"arrival": "rx"})
        assert found["covered"].tolist() == [1.0] * covered + [0.0] * (len(rows) - covered)


PROPOSITION = """
obsdesign: 1
system: {A: [[0, 1], [-1, -0.5]], B: [[0], [1]], C: [[1, 0]]}
observer: {type: sporadic, T1: 0.205, T2: 0.41, decay: 0.05, relaxation: proposition-2, delta: 2, objective: min-gamma,
           gains: {L: [[1.5], [-0.5]], H: [[-1.5]]}}
"""


@pytest.mark.parametrize("text", ["", pytest.param(PROPOSITION, marks=pytest.mark.slow)], ids=["clock", "proposition"])
def test_the_truth_is_within_the_radius_where_measurements_come_at_instants(text):
    """Noise and w as large as they are said to be, at their worst signs; rows without y lie between measurements."""
    design = od.solve(loads(text)) if text else solved("ferrante2019-oscillator-gap")[1]
    where = loads("obsdesign: 1\nsystem: {A: [[0, 0], [0, 0]], C: [1, 0]}\nobserver: {type: l2}\n"
                  "data: {v_sup: 0.2, eta_sup: 0.01, e0: {x1: 1, x2: 0.5}}").data  # fmt: skip
    design = replace(design, spec=replace(design.spec, data=where))
    A, B = np.array(design.spec.plant.A, dtype=float), np.array(design.spec.plant.B, dtype=float)[:, 0]
    rng = np.random.default_rng(4)
    taken = np.cumsum(rng.uniform(0.205, 0.41, 60)) - 0.205
    t = np.unique(np.concatenate([[0.0], taken, np.linspace(0.03, taken[-1], 50)]))
    true = solve_ivp(lambda t, x: A @ x + 0.2 * B * np.sign(np.sin(1.1 * t)), (0, t[-1]), [1.0, 0.5], t_eval=t,
                     rtol=1e-9, atol=1e-9, max_step=0.05).y.T  # fmt: skip
    y = np.where(np.isin(t, taken), true[:, 0] + 0.01 * np.sign(rng.normal(size=len(t))), np.nan)
    found = od.estimate(design, log("log.csv", ["t", "y1"], t, y))
    assert found.report["uncovered"] == 0
    shares = [np.abs(true[:, i] - found[f"hat_x{i + 1}"]) / found[f"radius_x{i + 1}"] for i in (0, 1)]
    assert 0.05 < np.max(shares) <= 1
    c = design.result["guarantee"]
    start = c["overshoot"] * math.sqrt(1 + 0.25 + 1) * np.exp(-c["rate"] * t)
    size = start + 0.2 * c["disturbance"] + 0.01 * c["noise"]
    assert (found["radius_x2"] <= size * (1 + 1e-6)).all()
    gap = log("gap.csv", ["t", "y1"], [0, 0.3, 0.75, 0.9], np.zeros(4))
    assert np.isnan(od.estimate(design, gap)["radius_x2"]).tolist() == [False, False, True, True]
    assert radius(design, replace(where, eta_sup=None), ("x1",)) == "data: {eta_sup} is not given"
    behind = [*range(20), *range(21, 40), 20, *range(40, len(t))]  # one row comes after 19 others
    late = log("late.csv", ["t", "y1", "rx"], t[behind], y[behind], np.maximum.accumulate(t[behind]))
    told = od.estimate(design, late, columns={"arrival": "rx"})
    assert np.isfinite(told["radius_x2"]).tolist() == (told["covered"] == 1).tolist()
    ends = int(np.argmin(told["covered"]))
    assert told["radius_x2"][:20].tolist() == pytest.approx(found["radius_x2"][:20].tolist())
    assert 20 <= ends <= 39
    assert "up to the first row that came after" in told.report["radius"]["premise"]


def test_a_claim_for_a_range_of_inputs_has_no_radius():
    """The slope of f depends on u, whose range is not followed."""
    text = """
obsdesign: 1
name: Ranged
system:
  time: discrete
  period: 0.1
  states: [x, z]
  inputs: [u]
  disturbances: [w]
  dynamics: {x: 0.5*x + 0.1*z, z: 0.5*z + 0.1*u*sin(z) + 0.1*w}
  outputs: {y: x}
  domain: {x: [-1, 1], z: [-1, 1], u: [-1, 1]}
observer: {type: linf, rho: 0.9, gains: {L1: [[-0.1], [0]]}}
data: {v_sup: 1, e0: {x: 0.1, z: 0.1}}
"""
    design = od.solve(loads(text))
    assert design.status == "certified"
    found = od.estimate(design, log("log.csv", ["t", "u", "y"], 0.1 * np.arange(4), 5 * np.ones(4), np.zeros(4)))
    assert "ranges of known inputs" in found.report["radius"]["none"]
    assert (found["covered"] == 0).all()


def test_rows_that_drift_from_their_samples_are_refused(scalar):
    design, made = scalar
    path = log("log.csv", ["t", "force", "y"], made.t * 1.005, made.u, made.y)
    with pytest.raises(UsageError, match="off its sample"):
        od.estimate(design, path)


def test_a_gap_of_whole_periods_is_as_many_rows_without_outputs(scalar):
    design, made = scalar
    y = made.y[:, 0].copy()
    lacking = np.isin(np.arange(len(y)), [3, 4, 5, 9, 20])
    y[lacking] = np.nan
    u = made.u[:, 0].copy()
    u[lacking] = np.nan
    whole = od.estimate(design, log("whole.csv", ["t", "force", "y"], made.t, u, y))
    kept = ~lacking
    found = od.estimate(design, log("log.csv", ["t", "force", "y"], made.t[kept], u[kept], y[kept]))
    assert found["t"] == pytest.approx(made.t, abs=1e-12)
    assert found.rows == pytest.approx(whole.rows, nan_ok=True)
    assert (found.report["rows"], found.report["missing"], found.report["gaps"]) == (len(y), 5, 5)
    assert "5 samples without a row" in estimates_table(found.report, "", "")


def test_a_gap_may_lie_between_two_blocks(scalar, monkeypatch):
    design, made = scalar
    kept = ~np.isin(np.arange(len(made.t)), [*range(3, 9), 20, 31])
    path = log("log.csv", ["t", "force", "y"], made.t[kept], made.u[kept], made.y[kept])
    whole = od.estimate(design, path)
    monkeypatch.setattr(table, "BLOCK", 40)
    assert od.estimate(design, path).rows == pytest.approx(whole.rows, nan_ok=True)


def test_innovations_that_the_premise_does_not_allow_are_counted(scalar):
    """|y - yhat| <= |e| + 0.05 |v|: none of the run contradicts it, one that is just beyond the bound does."""
    design, made = scalar
    found = od.estimate(design, of_run(made))
    assert "contradicted" not in found.report
    y, bound = made.y.copy(), found["radius_x"] + 0.05 * 1.5
    for factor in (0.999, 1.001):
        y[40, 0] = made.y[40, 0] - found["innov_y"][40] + factor * bound[40]
        told = od.estimate(design, log("log.csv", ["t", "force", "y"], made.t, made.u, y)).report
        assert ("contradicted" in told) == ("contradicts these" in estimates_table(told, "", "")) == (factor > 1)
    assert told["first_contradicted"] == {"line": 42, "t": pytest.approx(4.0)}


def test_a_known_input_that_is_missing_ends_what_is_proved(scalar):
    design, made = scalar
    u = made.u.copy()
    u[10] = np.nan
    found = od.estimate(design, log("log.csv", ["t", "force", "y"], made.t, u, made.y))
    assert found["covered"].tolist() == [1.0] * 10 + [0.0] * (len(u) - 10)
    y = np.where(np.arange(len(u)) == 0, np.nan, made.y[:, 0])
    found = od.estimate(design, log("log.csv", ["t", "force", "y"], made.t, made.u, y))
    assert found.report["radius"] == {"none": "an output is missing in line 2, and from there on nothing is proved"}


LOCAL = CONTINUOUS.replace("A: [[-1]]", "A: [[-3]]").replace(
    "observer:", "nonlinearities: [{f: q**3/3, type: {slope: auto, region: {q: [-1, 1]}}, Bf: [1], Cq: [1]}]\nobserver:"
)


def test_a_local_guarantee_that_is_left_is_told_row_by_row():
    design = od.solve(loads(LOCAL))
    t = np.arange(0, 6, 0.05)
    y = np.where((t > 2) & (t < 4), 3.0, 0.0)
    found = od.estimate(design, log("log.csv", ["t", "y"], t, y))
    left = np.argmax(np.abs(found["hat_x"]) > 1)
    assert 0 < left < len(t) - 1
    assert (found["covered"] == (np.arange(len(t)) < left)).all()
    assert found.report["uncovered"] == len(t) - left


@pytest.mark.parametrize("kind", ["filtered", "predicted"])
@pytest.mark.parametrize(
    "family", ["{type: l2, rho: 0.9, bounds: {L1: 5}, ESTIMATE}", "{type: ekf, Q: [[1, 0], [0, 1]], R: 0.1, ESTIMATE}"]
)
def test_an_innovation_is_against_what_was_expected_before(kind, family):
    """Of filtered estimates, against the prediction from the sample before: x+ = .9 x + .1 u, by hand."""
    text = SCALAR.replace(
        "{type: linf, rho: 0.8, objective: min-gamma}", family.replace("ESTIMATE", f"estimate: {kind}")
    )
    spec = loads(text)
    design = od.solve(spec) if "l2" in family else trial(spec)
    t, u, y = 0.1 * np.arange(30), np.sin(np.arange(30.0)), np.cos(0.3 * np.arange(30))
    found = od.estimate(design, log("log.csv", ["t", "force", "y"], t, u, y))
    hat = found["hat_x"]
    before = 0.9 * hat[:-1] + 0.1 * u[:-1] if kind == "filtered" else hat[1:]
    assert found["innov_y"][1:] == pytest.approx(y[1:] - before, abs=1e-9)


def test_rows_without_a_measurement_do_not_count_as_innovations():
    rng = np.random.default_rng(2)
    values = np.convolve(rng.normal(size=401), [1, 0.8], "valid")[:, None]
    sparse, dense = Innovations(("y",)), Innovations(("y",))
    holes = np.full((4000, 1), np.nan)
    holes[::10] = values
    sparse.add(holes)
    dense.add(values)
    assert sparse.report() == dense.report()
    assert dense.report()["y"]["white"] < 1e-6


def test_a_run_with_measurements_at_instants_is_a_log():
    """Of its rows those are measurements at which the number received rises."""
    design = solved("ferrante2019-oscillator-clock")[1]
    made = design.simulate(horizon=6, points=6001)
    header, rows = made.table()
    Path("run.csv").write_text("\n".join([",".join(header), *(",".join(map(repr, row)) for row in rows.tolist()), ""]))
    found = od.estimate(design, "run.csv")
    assert found.report["missing"] == len(made.t) - made.j[-1]
    for state in design.spec.plant.states:
        assert found[f"hat_{state}"][-1] == pytest.approx(
            made[f"hat_{state}"][-1], abs=0.02 * np.abs(made[state]).max()
        )


def test_a_decimal_comma_goes_with_semicolons(scalar):
    design, made = scalar
    expected = od.estimate(design, of_run(made))
    Path("de.csv").write_text(Path("log.csv").read_text().replace(",", ";").replace(".", ","))
    assert od.estimate(design, "de.csv").rows.tolist() == expected.rows.tolist()


def test_instants_that_begin_late_are_as_exact_as_others():
    """Seconds since 1970 leave 2e-7 s to a double, which is no step of its own."""
    design = solved("pendulum-embedded")[1]
    t, y = 1e-3 * np.arange(400), np.sin(np.arange(400.0) / 50)
    early = od.estimate(design, log("early.csv", ["t", "y_angle", "y_speed"], t, y, y))
    late = od.estimate(design, log("late.csv", ["t", "y_angle", "y_speed"], t + 1.7e9, y, y), "out.csv")
    assert late["hat_angle"] == pytest.approx(early["hat_angle"], rel=1e-9, abs=1e-12)
    assert len(set(np.loadtxt("out.csv", delimiter=",", skiprows=1, usecols=0))) == 400


def test_a_row_without_a_measurement_ends_what_is_proved(scalar):
    design, made = scalar
    y = made.y.copy()
    y[20] = np.nan
    found = od.estimate(design, log("log.csv", ["t", "force", "y"], made.t, made.u, y))
    assert found.report["missing"] == 1
    assert found["covered"].tolist() == [1.0] * 20 + [0.0] * (len(y) - 20)
    assert np.isnan(found["innov_y"]).sum() == 1
    assert np.isfinite(found["hat_x"]).all()


# the file


def test_any_dialect_is_read(scalar):
    design, made = scalar
    expected = od.estimate(design, of_run(made))
    plain = Path("log.csv").read_text()
    Path("tabs.csv").write_text(plain.replace(",", "\t"))
    Path("semi.csv").write_bytes(("\ufeff" + plain.replace(",", ";").replace("\n", "\r\n")).encode())
    rows = plain.splitlines()
    Path("quoted.csv").write_text("\n".join(['"t","force","y [m]"', rows[1], "", *rows[2:], "", ""]))
    Path("notes.csv").write_text("\n".join([f"{rows[0]},note", *(f"{row},a b" for row in rows[1:])]))
    for path in ("tabs.csv", "semi.csv", "quoted.csv", "notes.csv"):
        assert od.estimate(design, path).rows.tolist() == expected.rows.tolist()


def test_comments_before_the_heads_are_skipped(scalar):
    """Also where the heads are the last of them, as numpy writes it."""
    design, made = scalar
    expected = od.estimate(design, of_run(made)).rows.tolist()
    heads, *rows = Path("log.csv").read_text().splitlines()
    starts = "# a bench; of May\n#\n{}", "# a bench\n# {}", "\ufeff# a bench\n{}", "\ufeff\n \n# a\n\n{}", "\n# {}\n"
    for start in starts:
        Path("noted.csv").write_text("\n".join([start.format(heads), *rows, ""]), encoding="utf-8")
        assert od.estimate(design, "noted.csv").rows.tolist() == expected
    Path("noted.csv").write_text("\n".join(["# a bench", "#", heads, rows[0], "0.1,x,1", ""]))
    with pytest.raises(UsageError, match=r"noted\.csv:5:0: force: 'x' is no number"):
        od.estimate(design, "noted.csv")


def test_a_byte_that_is_not_utf_8_is_told_with_its_line(scalar):
    Path("log.csv").write_bytes("t,force,y,note\n0,0,1,ok\n0.1,,1,\u00e9t\u00e9\n".encode("latin-1"))
    with pytest.raises(UsageError, match=r"log\.csv:3:0: the byte 0xE9 is no text in UTF-8; .*iconv -f latin1"):
        od.estimate(scalar[0], "log.csv")
    Path("log.csv").write_bytes("t,force,y,\u00b0C\n0,0,1,2\n".encode("latin-1"))
    with pytest.raises(UsageError, match=r"log\.csv:1:0: the byte 0xB0"):
        od.estimate(scalar[0], "log.csv")
    Path("log.csv").write_text("t,force,y\n0,0,1\n", encoding="utf-16")
    with pytest.raises(UsageError, match=r"log\.csv:1:0: is text in UTF-16; .*iconv -f utf-16"):
        od.estimate(scalar[0], "log.csv")


def test_columns_are_mapped_and_scaled(scalar):
    design, made = scalar
    expected = od.estimate(design, of_run(made))
    log("mm.csv", ["time [ms]", "F (N)", "Position (mm)"], 1000 * made.t, made.u, 1000 * made.y)
    section = "{columns: {y: Position (mm)}, scale: {y: 0.001, time: 0.001}, time: 'time [ms]', v_sup: 1.5, e0: {x: 2}}"
    other = od.solve(loads(SCALAR.replace("{v_sup: 1.5, e0: {x: 2}}", section)))
    found = od.estimate(other, "mm.csv", columns={"force": "F"})
    assert_same(found.rows, expected.rows)


ROWS = "t,force,y\n0,0,1\n0.1,0,1\n0.2,0,1\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "begins with no line of column names"),
        ("0,1,2\n0.1,1,2\n", "the first line must name the columns"),
        (ROWS.replace("force", "farce"), "has no column force; did you mean farce?"),
        (ROWS.replace("force", "y"), "two columns have the head y"),
        (ROWS.replace(",y\n", ",y [mm]\n"), "column y [mm] is in mm, y of the spec in m"),
        (ROWS.replace("t,", "t [ms],"), "column t [ms] is in ms, time of the spec in s"),
        (f"{ROWS}0.3,0", "log.csv:5:0: has 2 values and 3 columns have a name; is the log cut off here?"),
        (f"{ROWS}0.3,0,x\n", "log.csv:5:0: y: 'x' is no number"),
        (f"{ROWS}0.3,0,inf\n", "log.csv:5:0: y: infinite"),
        (f"{ROWS}0.2,0,1\n", "log.csv:5:0: t = 0.2 is that of the row before"),
        (f"{ROWS}0.15,0,1\n", "log.csv:5:0: t = 0.15 is before that of the row before, 0.2; --repair"),
        (f"{ROWS},0,1\n", "log.csv:5:0: the time is missing"),
        (
            f"{ROWS}0.45,0,1\n",
            "log.csv:5:0: 0.25 s after the row before, and 0.15 s off its sample; rows of this plant are 0.1 s apart",
        ),
        ("t,force,y\n0,,1\n", "force: the first value of a known input is missing"),
        ("t,force,y\n", "has no rows"),
        ("t,force,y\n" + "0" * 300_000, "log.csv:2:0: a row is longer than 262,144 bytes"),
    ],
)
def test_a_log_that_is_wrong_is_told_with_its_line(scalar, text, said):
    Path("log.csv").write_text(text)
    with pytest.raises(UsageError) as error:
        od.estimate(scalar[0], "log.csv")
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_that_is_no_text_is_refused(scalar):
    Path("log.csv").write_bytes(b"t,force,y\n" + bytes(range(128, 256)) * 3000)
    with pytest.raises(UsageError, match=r"UTF-8|longer than"):
        od.estimate(scalar[0], "log.csv")
    with pytest.raises(UsageError, match="cannot be read"):
        od.estimate(scalar[0], "none.csv")
    with pytest.raises(UsageError, match="is a folder"):
        od.estimate(scalar[0], ".")


@pytest.mark.parametrize("folder", [".", "..", "/"])
def test_estimates_are_not_written_in_place_of_a_folder(folder):
    outcome = run("estimate", "any.gains.json", "any.csv", "-o", folder)
    assert (outcome.exit_code, outcome.stderr) == (2, f"{folder}: cannot be written: it is a folder [OBS902]\n")


STARTS = ["2026-11-29T00:00:00Z", "2026-11-29 01:00:00.000+01:00", "20261129T000000"]


@pytest.mark.parametrize("start", STARTS)
def test_instants_may_be_written_as_iso_8601_does(scalar, start):
    design, made = scalar
    expected = od.estimate(design, of_run(made))
    first = datetime.fromisoformat(start)
    text = Path("log.csv").read_text().splitlines()
    rows = [row.split(",", 1) for row in text[1:]]
    dated = [f"{(first + timedelta(seconds=float(t))).isoformat()},{rest}" for t, rest in rows]
    Path("dated.csv").write_text("\n".join([text[0], *dated, ""]))
    found = od.estimate(design, "dated.csv", "out.csv")
    assert found["t"][0] == datetime(2026, 11, 29, tzinfo=UTC).timestamp()
    assert_same(found["hat_x"], expected["hat_x"])
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    times = pa.array([datetime.fromisoformat(row.split(",", 1)[0]) for row in dated], pa.timestamp("us"))
    pq.write_table(
        pa.table({"t": times, "u": made.u[:, 0], "y": made.y[:, 0]}).rename_columns(text[0].split(",")), "d.pq"
    )
    assert_same(od.estimate(design, "d.pq", "out.csv")["hat_x"], expected["hat_x"])


def test_an_instant_stands_in_no_column_but_that_of_the_time(scalar):
    design, made = scalar
    of_run(made)
    head, row, *rest = Path("log.csv").read_text().splitlines()
    Path("log.csv").write_text("\n".join([head, f"{row.rpartition(',')[0]},2026-11-29T00:00:00Z", *rest]))
    with pytest.raises(UsageError, match="'2026-11-29T00:00:00Z' is no number"):
        od.estimate(design, "log.csv")
    Path("log.csv").write_text("\n".join([head, f"29.11.2026,{row.partition(',')[2]}", *rest]))
    with pytest.raises(UsageError, match=r"t: '29\.11\.2026' is no number"):
        od.estimate(design, "log.csv")


def test_parquet_is_read_as_csv_is(scalar):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    design, made = scalar
    expected = od.estimate(design, of_run(made))
    y = pa.array([None if k == 7 else float(x) for k, x in enumerate(made.y[:, 0])])
    columns = {"t [s]": made.t, "note": ["a"] * len(y), "force": made.u[:, 0].astype("float32"), "y": y}
    pq.write_table(pa.table(columns), "log.parquet")
    found = od.estimate(design, "log.parquet")
    assert found["hat_x"][:8] == pytest.approx(expected["hat_x"][:8], rel=1e-6)
    assert (found.report["rows"], found.report["missing"]) == (len(y), 1)
    with pytest.raises(UsageError, match="note: string is no column of numbers"):
        od.estimate(design, "log.parquet", columns={"y": "note"})
    Path("bad.parquet").write_text("t,y\n")
    with pytest.raises(UsageError, match="is no Parquet file"):
        od.estimate(design, "bad.parquet")


def test_repair_puts_rows_in_order(scalar):
    design, made = scalar
    expected = od.estimate(design, of_run(made))
    lines = Path("log.csv").read_text().splitlines()
    mixed = [lines[0], *lines[3:7], lines[5], ",0,1", *lines[1:3], *lines[7:]]
    Path("log.csv").write_text("\n".join(mixed))
    found = od.estimate(design, "log.csv", repair=True)
    assert found.rows.tolist() == expected.rows.tolist()
    assert found.report["repaired"] == {"without_time": 1, "moved": 2, "repeated": 1}


# measurements at instants


def test_late_measurements_are_taken_at_their_own_time():
    """In whatever order they arrive, the last estimate is that of all of them in the order of their time."""
    spec, _ = solved("ferrante2019-oscillator-clock")
    design = od.solve(loads(f"{spec.text}\nimplementation: {{period: 1.0e-2, method: rk4}}\n"))
    made = design.simulate(horizon=10)
    t = np.cumsum(np.random.default_rng(3).uniform(0.1, 0.3, 40))
    y = np.column_stack([np.interp(t, made.t, column) for column in made.y_true.T])
    names = list(spec.plant.outputs)
    expected = od.estimate(design, log("sorted.csv", ["t", *names], t, y))
    delay = np.where((np.arange(40) % 7 == 3) & (np.arange(40) < 30), 0.9, 0.01)
    order = np.argsort(t + delay, kind="stable")
    path = log("late.csv", ["t", *names, "t_rx"], t[order], y[order], (t + delay)[order])
    found = od.estimate(design, path, columns={"arrival": "t_rx"})
    last = int(np.argmax(found["t"]))
    assert found.report["late"] >= 4
    for state in spec.plant.states:
        assert found[f"hat_{state}"][last] == pytest.approx(expected[f"hat_{state}"][-1], rel=1e-9)
    assert found["t"].tolist() == t[order].tolist()


def used_at(k, stamps, arrivals, period=0.1):
    """Row that an observer of a plant in samples uses at sample k: the newest that is known."""
    return max((stamp, row) for row, stamp in enumerate(stamps) if arrivals[row] <= k * period + 1e-9)


def test_a_plant_in_samples_uses_the_newest_row_that_is_known(scalar, monkeypatch):
    """Rows come at any time, and out of order; radii end where one is used after its own."""
    design, made = scalar
    rng, K = np.random.default_rng(2), len(made.t)
    delay = np.where((np.arange(K) > 12) & (rng.random(K) < 0.5), rng.uniform(0.01, 0.45, K), 0)
    order = np.argsort(made.t + delay, kind="stable")
    t, rx = made.t[order], (made.t + delay)[order]
    path = log("late.csv", ["t", "force", "y", "rx"], t, made.u[order], made.y[order], rx)
    N = 1 + math.ceil(max(rx) / 0.1 - 0.01)
    rows = [used_at(k, t, rx)[1] for k in range(N)]
    expected = od.estimate(design, log("same.csv", ["t", "force", "y"], np.arange(N) / 10, made.u[order][rows],
                                       made.y[order][rows]))  # fmt: skip
    monkeypatch.setattr(table, "BLOCK", 400)
    found = od.estimate(design, path, columns={"arrival": "rx"})
    assert found["t"] == pytest.approx(np.arange(N) / 10)
    assert found["hat_x"].tolist() == expected["hat_x"].tolist()
    late = int(np.argmax(t[rows] < np.arange(N) / 10 - 1e-3))
    assert 12 < late < 20
    assert found["radius_x"][:late].tolist() == expected["radius_x"][:late].tolist()
    assert np.isnan(found["radius_x"][late:]).all()
    assert found.report["radius"]["premise"].endswith("up to the first that is used after its time")
    assert found.report["lost"] == K - len(set(rows)) > 3
    assert found.report["stale"]["rows"] == (t[rows] < np.arange(N) / 10 - 1e-3).sum()
    assert found.report["stale"]["longest"] == pytest.approx((np.arange(N) / 10 - t[rows]).max())
    together = np.where((made.t > 1.95) & (made.t < 2.95), made.t[30], made.t)  # rows 20 to 29 come with row 30
    found = od.estimate(design, log("late.csv", ["t", "force", "y", "rx"], made.t, made.u, made.y, together),
                        columns={"arrival": "rx"})  # fmt: skip
    assert found.report["stale"] == {"rows": 10, "longest": pytest.approx(1.0)}
    falls = log("falls.csv", ["t", "force", "y", "rx"], t, made.u[order], made.y[order], rx[::-1] + 9)
    with pytest.raises(UsageError, match=r"falls.csv:3:0: rx = [\d.]+ is before that of the row before"):
        od.estimate(design, falls, columns={"arrival": "rx"})
    off = log("off.csv", ["t", "force", "y", "rx"], t + 0.002 * (t > 2), made.u[order], made.y[order], rx + 0.002)
    with pytest.raises(UsageError, match=r"off.csv:.*its time is off its sample"):
        od.estimate(design, off, columns={"arrival": "rx"})


MOVING = """
obsdesign: 1
name: Cart
system: {states: [place, speed], inputs: [force], outputs: [y], A: [[0, 1], [-1, -0.5]], B: [[0], [1]], C: [[1, 0]],
         gx: [0, force]}
observer: {type: l2, gains: {L1: [[-2], [-1]]}, alpha: 0.1}
"""


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("hold", ["zero", "first"])
def test_the_newest_row_holds_from_its_arrival(hold, compiled, monkeypatch):
    """Some rows come together, and some after newer ones, which changes nothing; a small loop says the same."""
    if not compiled:
        monkeypatch.setattr(runner.shutil, "which", lambda _: None)
    rng, K = np.random.default_rng(5), 60
    t = np.arange(K) * 0.1
    arrival = np.sort(t + np.where(rng.random(K) < 0.3, rng.uniform(0.1, 0.5, K), 0.01))
    order = np.argsort(t + np.where(rng.random(K) < 0.3, 0.25, 0.0), kind="stable")
    arrival = np.maximum.accumulate(np.maximum(arrival, t[order]))
    arrival[11] = arrival[10] = max(arrival[10:12])
    signals = np.column_stack([np.cos(2 * t), np.sin(3 * t)])[order]
    path = log("late.csv", ["t", "force", "y", "rx"], t[order], signals, arrival)
    monkeypatch.setattr(table, "BLOCK", 500)  # bytes of a block, so that rows wait for those of the next
    found = od.estimate(od.solve(loads(MOVING)), path, columns={"arrival": "rx"}, hold=hold)

    used = np.flatnonzero(t[order] >= np.maximum.accumulate(t[order]))
    A, C, L = np.array([[0, 1], [-1, -0.5]]), np.array([1.0, 0]), np.array([-2.0, -1])

    def held(s, now):
        place = used[used <= now][-1]
        after = used[used > now]
        if hold == "zero" or not len(after) or arrival[after[0]] == arrival[place]:
            return signals[place]
        share = (s - arrival[place]) / (arrival[after[0]] - arrival[place])
        return signals[place] + share * (signals[after[0]] - signals[place])

    def rate(s, x, now):
        u, y = held(s, now)
        return A @ x + np.array([0, u]) + L * (C @ x - y)

    x, expected = np.zeros(2), [np.zeros(2)]
    for k in range(K - 1):
        if arrival[k + 1] > arrival[k]:
            run = solve_ivp(rate, (arrival[k], arrival[k + 1]), x, args=(k,), rtol=1e-10, atol=1e-12)
            x = run.y[:, -1]
        expected.append(x)
    assert found["t"] == pytest.approx(arrival)
    hats = np.column_stack([found["hat_place"], found["hat_speed"]])
    assert np.abs(hats - expected).max() < 3e-6
    dropped = K - len(used)
    assert found.report["late"] == found.report["lost"] == dropped > 5
    assert np.isnan(found["innov_y"]).sum() == dropped
    latest = np.maximum.accumulate(t[order])
    assert found.report["stale"]["longest"] == pytest.approx((arrival - latest).max())


# innovations


def test_statistics_of_parts_are_those_of_the_whole():
    rng = np.random.default_rng(5)
    rows = np.cumsum(rng.normal(size=(500, 2)), axis=0) * 0.1 + [3.0, 0.0]
    streamed = Innovations(("a", "b"))
    for part in np.split(rows, [3, 4, 11, 60, 61, 300]):
        streamed.add(part)
    for i, told in enumerate(streamed.report().values()):
        x = rows[:, i] - rows[:, i].mean()
        r = [x[k:] @ x[:-k] / (x @ x) for k in range(1, LAGS + 1)]
        assert told["mean"] == pytest.approx(rows[:, i].mean())
        assert told["rms"] == pytest.approx(math.sqrt((rows[:, i] ** 2).mean()))
        assert told["autocorrelation"] == pytest.approx(r, abs=1e-9)
        assert told["white"] < 1e-6


@given(st.integers(0, 1000))
def test_white_noise_looks_white_and_filtered_noise_does_not(seed):
    noise = np.random.default_rng(seed).normal(size=(2000, 1))
    white, colored = Innovations(("y",)), Innovations(("y",))
    white.add(noise)
    colored.add(noise[1:] + 0.5 * noise[:-1])
    assert white.report()["y"]["white"] > 1e-5
    assert colored.report()["y"]["white"] < 1e-6


def test_what_is_not_known_has_no_statistics():
    silent = Innovations(("y",))
    silent.add(np.full((30, 1), np.nan))
    assert silent.report() == {"y": {"mean": None, "rms": None, "autocorrelation": [], "white": None}}
    constant = Innovations(("y",))
    constant.add(np.full((30, 1), 2.0))
    assert constant.report()["y"]["white"] is None


@pytest.mark.parametrize(("size", "zero"), [(2.0, True), (3e-5, False)])
def test_what_is_rounding_is_neither_white_nor_not(size, zero):
    found = Innovations(("y", "z"))
    rounding = np.cumsum(np.random.default_rng(0).normal(size=(400, 2)), axis=0) * 1e-17
    found.add(rounding)
    found.measured(np.array([[np.nan, 1.0], [-size, 0.0], [0.0, np.inf]]))
    told = found.report()
    assert (told["y"]["white"] is None) == zero
    assert ("zero_to_rounding" in told["y"]) == zero
    assert found.sizes().get("zero_to_rounding") == (["y", "z"] if zero else ["z"])
    assert told["y"]["rms"] == pytest.approx(np.sqrt(np.mean(rounding[:, 0] ** 2)))


# the command


@pytest.fixture
def gains(scalar):
    design, made = scalar
    design.save("scalar.gains.json")
    of_run(made)
    return "scalar.gains.json"


def test_the_command_writes_estimates_and_a_figure(gains, scalar):
    outcome = run("estimate", gains, "log.csv")
    assert outcome.exit_code == 0, outcome.output
    assert files() == ["log.csv", "scalar.estimate.csv", "scalar.estimate.png", "scalar.gains.json"]
    text = Path("scalar.estimate.csv").read_text().splitlines()
    assert text[0] == "t,hat_x,innov_y,radius_x,covered"
    assert len(text) == 1 + len(scalar[1].t)
    report = json.loads(run("estimate", gains, "log.csv", "--json", "-o", "other.csv", "--plot", "b.svg").stdout)
    assert report["rows"] == len(scalar[1].t)
    assert report["innovations"]["y"].keys() == {"mean", "rms", "autocorrelation", "white"}
    piped = run("estimate", gains, "log.csv", "-o", "-", "-q")
    assert piped.stdout == Path("other.csv").read_text() == Path("scalar.estimate.csv").read_text()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--map", "y"], "write SIGNAL=COLUMN"),
        (["--map", "z=y"], "z is no signal; allowed: t, arrival, y, force"),
        (["--map", "y=Y"], "has no column Y; did you mean y?"),
        (["--hold", "second"], "'second' is not known; allowed: zero, first"),
        (["-o", "out.json"], "whose names end with .csv"),
        (["-o", "log.csv"], "is read here, and would be overwritten"),
        (["--plot", "log.csv"], "whose names end with .png or .svg"),
    ],
)
def test_wrong_arguments_are_one_line_and_write_nothing(gains, arguments, said):
    before = files()
    outcome = run("estimate", gains, "log.csv", *arguments)
    assert outcome.exit_code == 2, outcome.output
    assert said in outcome.stderr
    assert len(outcome.stderr.strip().splitlines()) == 1
    assert files() == before


def test_a_log_that_breaks_off_leaves_nothing(gains, monkeypatch):
    monkeypatch.setattr(table, "BLOCK", 200)
    Path("log.csv").write_text(f"{Path('log.csv').read_text()}5.1,0")
    outcome = run("estimate", gains, "log.csv")
    assert outcome.exit_code == 2
    assert files() == ["log.csv", "scalar.gains.json"]


def test_an_observer_that_escapes_is_told_with_the_row():
    spec, _ = solved("corless2019-magnetic-bearing")
    design = od.solve(loads(f"{spec.text}\nimplementation: {{period: 1.0e-3}}\n"))
    t = np.arange(0, 0.1, 1e-3)
    with pytest.raises(UndecidedError, match=r"log.csv:[0-9]+:0: the observer has no finite value after this row"):
        od.estimate(design, log("log.csv", ["t", *spec.plant.outputs], t, np.ones((len(t), 2))))


ESCAPES = CONTINUOUS.replace(
    "observer:", "nonlinearities: [{f: q**3, type: {slope: [0, 3], region: {q: [-1, 1]}}, Bf: [1], Cq: [1]}]\nobserver:"
).replace("A: [[-1]]", "A: [[-4]]")


@pytest.mark.parametrize("steps", ["", "implementation: {period: 0.01}\n"])
def test_a_value_that_stands_out_is_told_where_the_observer_escapes(steps):
    design = trial(loads(ESCAPES + steps))
    t = 0.1 * np.arange(30)
    y = np.cos(t)
    assert od.estimate(design, log("log.csv", ["t", "y"], t, y)).report["rows"] == 30
    y[12] = 1e12
    path = log("log.csv", ["t", "y"], t, y)
    with pytest.raises(UndecidedError, match=r"line 14 has y = 1e\+12, and the others at most 1: leave it empty"):
        od.estimate(design, path)
    y[12] = np.nan
    assert od.estimate(design, log("log.csv", ["t", "y"], t, y)).report["missing"] == 1


@pytest.mark.parametrize("block", [4 * 2**20, 60])
def test_a_value_that_stands_out_is_told_whatever_it_does(gains, scalar, monkeypatch, block):
    monkeypatch.setattr(table, "BLOCK", block)
    y = scalar[1].y[:, 0].copy()
    largest = np.abs(y).max()
    for factor, stands in ((999, False), (1001, True)):
        y[20] = -factor * largest
        path = log("out.csv", ["t", "force", "y"], scalar[1].t, scalar[1].u, y)
        outcome = run("estimate", gains, path, "--json")
        found = json.loads(outcome.stdout)
        assert ("outlying" in found) == stands
        assert outcome.stderr.startswith("out.csv: line 22 has y = -") == stands
    (one,) = found["outlying"]
    assert [one[key] for key in ("output", "line", "value", "others")] == ["y", 22, y[20], pytest.approx(largest)]
    assert one["note"] in run("estimate", gains, path).stdout


@pytest.mark.parametrize("block", [4 * 2**20, 60])
def test_a_hole_in_continuous_time_is_told(monkeypatch, block):
    monkeypatch.setattr(table, "BLOCK", block)
    t = np.cumsum([0.0, *[0.1] * 10, 1.9, *[0.1] * 10, 6.0, 0.1])
    found = od.estimate(trial(loads(CONTINUOUS)), log("log.csv", ["t", "y"], t, np.cos(t)))
    hole = {"count": 1, "longest": pytest.approx(6), "line": 24, "t": pytest.approx(t[22])}
    assert found.report["holes"] == hole
    assert "at most 6 s, up to line 24" in estimates_table(found.report, "", "")


def test_what_is_known_of_a_log_is_set_beside_a_result(gains):
    outcome = run("estimate", gains, "log.csv", "--set", "data.v_sup=3", "-o", "wide.csv", "-q")
    assert outcome.exit_code == 0, outcome.output
    assert run("estimate", gains, "log.csv", "-o", "own.csv", "-q").exit_code == 0
    wide, own = (np.loadtxt(path, delimiter=",", skiprows=1)[:, 3] for path in ("wide.csv", "own.csv"))
    assert wide[0] == own[0]
    assert (wide[1:] > own[1:]).all()
    assert run("estimate", gains, "log.csv", "--set", "observer.rho=0.5").exit_code == 2


def test_rows_that_are_too_far_apart_are_told_before_any_step():
    design = solved("pendulum-embedded")[1]
    path = log("log.csv", ["t", "y_angle", "y_speed"], [0.0, 0.001, 1e9], *[np.zeros(3)] * 2)
    with pytest.raises(UndecidedError, match=r"log.csv:4:0: 1e\+09 s after the row before"):
        od.estimate(design, path)


def test_what_a_killed_command_left_half_written_is_removed(gains):
    """By what is written part by part at once; by another command where nobody wrote to it for long.

    The number of a process that runs may be that of an earlier one.
    """
    Path(".obsdesign-staged-999999999-abc").write_text("half")
    assert run("estimate", gains, "log.csv", "-q").exit_code == 0
    assert not any(name.startswith(".obsdesign") for name in files())
    mine, others, young = (Path(f".obsdesign-staged-{n}-abc") for n in (os.getpid(), 999999999, 999999998))
    for path in (mine, others, young):
        path.write_text("half")
    for path, age in ((mine, 1e6), (others, 1e6), (young, 10)):
        os.utime(path, (time.time() - age,) * 2)
    assert run("simulate", gains, "-o", "run.csv", "-q").exit_code == 0
    assert [path.exists() for path in (mine, others, young)] == [False, False, True]
    mine.write_text("of a process that runs")
    assert run("estimate", gains, "log.csv", "-q").exit_code == 0
    assert [path.exists() for path in (mine, young)] == [True, False]


def test_gains_that_are_not_there_are_told():
    outcome = run("solve", SPECS / "infeasible" / "hidden-sensor-bias.yaml", "-o", "none.gains.json", "-q")
    assert outcome.exit_code == 3
    Path("log.csv").write_text(ROWS)
    outcome = run("estimate", "none.gains.json", "log.csv")
    assert outcome.exit_code == 2
    assert "no gains" in outcome.stderr
