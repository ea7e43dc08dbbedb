"""Runs in discrete time against a recursion written apart, and against the bounds that are proved of them."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import root
from support.running import simulate
from support.samples import text

from obsdesign.dissipation.engine import Engine
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


def recursion(plant, gains, f, x, xhat, v, *, filtered):
    """States, estimates and outputs of a plant and its observer, sample by sample: their equations as they are."""
    A, Bf, B, Cq, Dqf, Dq, C, Df, D = (
        getattr(plant.doubles, name) for name in ("A", "Bf", "B", "Cq", "Dqf", "Dq", "C", "Df", "D")
    )
    L1, L2 = (gains[name].astype(float) for name in ("L1", "L2"))

    def solved(q):
        """The q with q = q(f(q))."""
        found = root(lambda g: g - q(f(g)), np.zeros(len(Cq)), method="hybr", tol=1e-14)
        return found.x

    rows = []
    for now, following in pairwise(v):
        q = solved(lambda g: Cq @ x + Dqf @ g + Dq @ now)  # noqa: B023
        y = C @ x + Df @ f(q) + D @ now
        rows.append([*x, *xhat, *y])
        after = A @ x + Bf @ f(q) + B @ now
        if filtered:
            measured = C @ after + D @ following
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
