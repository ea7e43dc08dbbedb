"""Runs against clock-dependent certificates, of observers that hold their output error or reset their estimates."""

import copy
import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq
from scipy.integrate import solve_ivp
from scipy.interpolate import BPoly
from scipy.linalg import expm
from support.commands import PNG, result_of, run
from support.forging import scaled
from support.sweep import seeds

import obsdesign
from obsdesign.expressions import Expression
from obsdesign.expressions.bernstein import bernstein
from obsdesign.families import FAMILIES
from obsdesign.reading import loads
from obsdesign.simulate import run as simulated
from obsdesign.simulate import simulation
from obsdesign.simulate.definitions import error
from obsdesign.simulate.ensemble import spread
from obsdesign.simulate.scenario import measurement_noise
from obsdesign.simulate.simulation import follow, initial, system_of
from obsdesign.trial import Noise

HEAD = """
obsdesign: 1
name: Oscillator
system: {A: [[0, 1], [-4, 0]], B: [1, 0], C: [1, 0]}
"""
OBSERVER = """
observer: {type: sporadic, T1: 0.205, T2: 0.41, decay: 0.05, gains: {K: [0.78, 0.45]}}
simulation: {horizon: 10, x0: [1, -2], xhat0: [0, 3]}
"""
RESET = HEAD + OBSERVER
HOLD = RESET.replace("K: [0.78, 0.45]", "L: [2.067, -3], H: -1.384")
SINE = "nonlinearities: [{f: 0.5*sin(q), type: {lipschitz: 0.5}, Bf: [0, 1], Cq: [1, 0]}]\n"
IDLE = "nonlinearities: [{f: 'max(q - 1e6, 0)', type: {lipschitz: 1}, Bf: [0, 1], Cq: [1, 0]}]\n"  # not linear
LINK = """
obsdesign: 1
name: Flexible link
system: {A: [[0, 1, 0, 0], [-48.6, -1.25, 48.6, 0], [0, 0, 0, 1], [19.5, 0, -19.5, 0]], B: [0, 2, 0, 0],
  C: [[1, 0, 0, 0], [0, 1, 0, 0]]}
nonlinearities: [{f: 3.33*sin(q), type: {lipschitz: 3.33}, Bf: [0, 0, 0, -1], Cq: [0, 0, 1, 0]}]
performance: {H: [[0, 0, 1, 0], [0, 0, 0, 1]]}
observer: {type: sporadic, T1: 0.05, T2: 0.1, decay: 0.01, gains: {
  L: [[11.5042, 0.788213], [-2.59655, 14.3202], [4.72995, 1.89367], [8.29872, 2.046]],
  H: [[-9.7899, -0.0342746], [-47.0298, -7.46493]]}}
simulation: {horizon: 3, x0: [0.5, 0, 1, -1]}
"""
SPECS = {
    "reset": RESET,
    "hold": HOLD,
    "sine": HEAD + SINE + OBSERVER,
    "ahead": HOLD.replace("decay: 0.05", "decay: 0.05, clock: {lookahead: 2, degree: 3}"),
    "any": HOLD.replace("T1: 0.205", "T1: 0"),
    "link": LINK,
}


pytestmark = pytest.mark.xdist_group("clock-simulate")  # its results are solved for once


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("clock")


@pytest.fixture(scope="module")
def solved(folder):
    """Solves a spec, once; returns its result file."""

    def solved(name):
        gains = folder / f"{name}.gains.json"
        if not gains.exists():
            result_of(folder, SPECS[name], name)
        return gains

    return solved


DRAWN = set()  # names of specs a run of which was drawn


@pytest.fixture
def tried(solved, tmp_path, request):
    """Simulates the gains of a spec with other keys of its trial; returns the summary. One run of each is drawn."""

    def tried(name, *changes):
        if name in DRAWN:
            request.getfixturevalue("sketched")
        DRAWN.add(name)
        sets = [part for change in changes for part in ("--set", f"simulation.{change}")]
        files = ("-o", tmp_path / "run.csv", "--plot", tmp_path / "run.png")
        outcome = run(
            "simulate", solved(name).parent / f"{name}.yaml", "--gains", solved(name), *files, "--json", *sets
        )
        assert outcome.exit_code == 0, outcome.output
        return json.loads(outcome.stdout, parse_constant=pytest.fail)

    return tried


# A reset of the estimates


def test_a_reset_of_a_linear_plant_follows_its_exponentials(tried, tmp_path):
    summary = tried("reset", "points=41", "sampling=periodic", "period=0.25", "horizon=10")
    flow, jump = expm(0.25 * np.array([[0.0, 1], [-4, 0]])), np.eye(2) - np.outer([0.78, 0.45], [1, 0])
    x, e = np.array([1.0, -2]), np.array([1.0, -5])
    expected = [np.concatenate((x, x - e))]
    for _ in range(40):
        x, e = flow @ x, jump @ flow @ e
        expected.append(np.concatenate((x, x - e)))
    expected[-1][2:] = x - np.linalg.solve(jump, e)  # there is no measurement at the horizon itself
    header, *rows = (tmp_path / "run.csv").read_text().splitlines()
    assert header == "t,x1,x2,hat_x1,hat_x2,w1,y1,received"
    samples = np.array([[float(x) for x in row.split(",")] for row in rows])
    assert samples[:, 1:5] == pytest.approx(np.array(expected), rel=1e-11, abs=1e-11)
    assert samples[0, 6] == 0  # C zhat(0), as long as nothing is received
    assert samples[1:-1, 6] == pytest.approx(samples[1:-1, 1], abs=1e-11)
    assert summary["final_error"] == pytest.approx(np.linalg.norm(np.linalg.solve(jump, e)), rel=1e-9)


def set_in(text, *changes):
    """A spec with other keys of its trial."""
    return loads(text, changes=[f"simulation.{change}" for change in changes])


def given(spec):
    """Run of the gains of a spec, of which nothing is proved."""
    return simulated(spec, FAMILIES["sporadic"].observer(spec, spec.observer.gains), None)


def test_the_exponentials_and_the_integrator_give_the_same_run_of_a_reset():
    changes = "sampling=random", "dropout=0.2", "noise={amplitude: 0.1}", "w=['where(t < 3, 1, -1)']"
    exact, smooth = (given(set_in(HEAD + more + OBSERVER, *changes)) for more in ("", IDLE))
    assert (exact.j == smooth.j).all()
    for name in ("xi", "xihat", "e", "y", "distance"):
        assert getattr(smooth, name) == pytest.approx(getattr(exact, name), rel=1e-4, abs=1e-5), name
    assert smooth.summary["z_norm2"] == pytest.approx(exact.summary["z_norm2"], rel=1e-5)


def test_a_reset_of_a_nonlinear_plant_agrees_with_an_integration_of_plant_and_observer():
    found = given(set_in(SPECS["sine"], "sampling=random", "w=[sin(2*t)]", "horizon=3"))
    K, s, t = np.array([0.78, 0.45]), np.array([1.0, -2, 0, 3]), 0.0

    def rhs(t, s):
        return [s[1] + np.sin(2 * t), -4 * s[0] + 0.5 * np.sin(s[0]), s[3], -4 * s[2] + 0.5 * np.sin(s[2])]

    for stop in (*found.schedule.received, 3.0):
        s = solve_ivp(rhs, (t, stop), s, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
        s[2:] += K * (s[0] - s[2]) * (stop < 3)
        t = stop
    assert len(found.schedule.received) > 5
    assert np.concatenate((found.xi[-1], found.xihat[-1])) == pytest.approx(s, rel=2e-6, abs=1e-8)


def test_the_error_of_a_reset_keeps_its_digits_beside_large_states():
    text = (
        HEAD.replace("A: [[0, 1], [-4, 0]]", "A: [[0, 1], [0, 0]], states: [x1, x2], inputs: [u], gx: [u, 0]")
        + OBSERVER
    )
    found = given(set_in(text, "u=[1e12]", "x0=[1, 1]", "xhat0=[0, 0]", "sampling=periodic"))
    flow, jump = np.array([[1, 0.41], [0, 1]]), np.eye(2) - np.outer([0.78, 0.45], [1, 0])
    e = np.ones(2)
    for _ in found.schedule.received:
        e = jump @ flow @ e
    left = 10 - found.schedule.received[-1]
    assert np.abs(found.xi[-1]).max() > 1e12
    assert -found.e[-1] == pytest.approx([e[0] + left * e[1], e[1]], rel=1e-9)


def test_known_terms_move_the_plant_and_its_copy_alike():
    more = ", inputs: [u], gx: [u, 1], gy: [2]"
    spec = set_in(RESET.replace("C: [1, 0]", "C: [1, 0]" + more), "u=[cos(t)]", "xhat0=[1, -2]", "sampling=random")
    found = given(spec)
    assert np.abs(found.e).max() == 0
    assert found.y[0] == 3


def test_a_reset_has_no_theta(tried, tmp_path):
    summary = tried("reset")
    assert {"initial_distance", "final_distance"}.isdisjoint(summary)
    assert "|(e, d)|" not in json.dumps(summary)
    assert any(bound["name"].startswith("|e|(t) <= overshoot") for bound in summary["bounds"])
    found = given(loads(RESET))
    assert found.theta.shape == (len(found.t), 0)
    assert (found.distance == np.linalg.norm(found.e, axis=1)).all()
    path = tmp_path / "reset.yaml"
    path.write_text(RESET)
    outcome = run("simulate", path, "-o", tmp_path / "a.csv", "--set", "simulation.theta0=1")
    assert outcome.exit_code == 2
    assert "simulation.theta0" in outcome.stderr
    assert "leave it out" in outcome.stderr


@pytest.mark.parametrize(("name", "gap"), [("reset", False), ("reset", True), ("sine", False)])
def test_the_noise_of_many_seeds_adds_to_a_reset_what_it_adds_to_single_runs(name, gap, monkeypatch):
    monkeypatch.setattr(simulation, "RTOL_NOISE", 1e-9)
    spec = set_in(SPECS[name], "sampling=random", "noise={type: gaussian, amplitude: 0.1}")
    observer = adapting(spec) if gap else FAMILIES["sporadic"].observer(spec, spec.observer.gains)
    found = spread(spec, observer, (3, 8), (0.0, 10.0))
    noise = replace(spec.simulation, seed=3)
    assert len(found.t) > 20
    # the instants of measurements are those of the spec, the noise is that of the seed
    made = system_of(spec, spec.simulation, observer)
    other = system_of(spec, noise, observer)
    made.scenario = replace(made.scenario, eta=other.scenario.eta[: len(made.scenario.eta)])
    alone = follow(made, initial(made, spec.simulation, None), made.breaks(), found.t)
    errors = made.table(alone.t, alone.s).of(map(error, spec.plant.states))
    assert np.abs(found.errors - errors).max() <= 1e-6 * np.abs(errors).max()


def test_a_one_step_method_that_gives_up_within_a_step_loses_no_sample():
    text = """
system: {A: [[1.06]], B: [[-0.3]], C: [[-0.51]]}
nonlinearities: [{f: 0.2*sin(q), type: {lipschitz: 0.2}, Bf: [-0.38], Cq: [0.46]}]
observer: {type: sporadic, T1: 0.2765, T2: 0.553, gains: {K: [-1.408]}}
simulation: {horizon: 11.06, x0: [1.57], sampling: random, dropout: 0.2}
"""
    for seed in (0, 4):
        found = given(set_in("obsdesign: 1\n" + text, f"seed={seed}"))
        assert found.status == "done"
        assert len(found.t) == 2000


# A gain that depends on the gap

KNOTS = np.array([0.205, 0.3, 0.41])
GAIN = np.array([[[[0.7], [0.4]], [[1.0], [0.2]], [[0.8], [0.5]]], [[[0.8], [0.5]], [[0.6], [0.9]], [[0.9], [0.45]]]])


def adapting(spec):
    """Observer whose gain is that of `GAIN` after each gap."""
    return FAMILIES["sporadic"].observer(spec, {"knots": KNOTS, "K_of_gap": GAIN})


@pytest.mark.parametrize(("more", "rel"), [("", 1e-11), (IDLE, 1e-5)])
def test_a_gain_of_the_gap_corrects_by_its_value_at_the_gap_that_has_just_ended(more, rel):
    changes = "sampling=random", "noise={amplitude: 0.1}", "horizon=5", "dropout=0.2", "seed=3"
    spec = set_in(HEAD + more + OBSERVER, *changes)
    found, K = simulated(spec, adapting(spec), None), BPoly(np.moveaxis(GAIN, 0, 1), KNOTS)
    gaps, eta = found.schedule.intervals, measurement_noise(spec.simulation, (len(found.schedule.received), 1))
    assert gaps.max() > 0.41  # one is lost
    flow, (x, xhat) = np.array([[0, 1.0], [-4, 0]]), (np.array([1.0, -2]), np.array([0.0, 3]))
    for gap, noise in zip(gaps, eta, strict=True):
        x, xhat = expm(flow * gap) @ x, expm(flow * gap) @ xhat
        xhat = xhat + K(np.clip(gap, 0.205, 0.41))[:, 0] * (x[0] + noise[0] - xhat[0])
    left = expm(flow * (5 - found.schedule.received[-1]))
    assert found.xihat[-1] == pytest.approx(left @ xhat, rel=rel)
    assert found.xi[-1] == pytest.approx(left @ x, rel=rel)
    assert found.length == "|e|"


def test_weights_of_a_piecewise_polynomial_are_those_of_its_bernstein_form():
    knots = (fmpq(1, 5), fmpq(3, 10), fmpq(41, 100))
    weights = bernstein("s", knots, 2)
    s = np.array([0, 0.2, 0.25, np.nextafter(0.3, 0), 0.3, 0.35, 0.41, 2])
    values = np.array([weight.function(["s"])(s) for weight in weights])
    assert (values >= 0).all()
    assert values.sum(axis=0) == pytest.approx(np.ones(len(s)), abs=1e-15)
    K = BPoly(np.moveaxis(GAIN, 0, 1), [float(knot) for knot in knots])
    expected = K(np.clip(s, 0.2, 0.41))[:, :, 0].T
    assert GAIN.reshape(6, 2).T @ values == pytest.approx(expected, rel=1e-13)
    value, at = fmpq(0), fmpq(1, 4)
    for weight in weights:
        (c, rest), *others = weight.substituted({"s": Expression.number(at)}).summands()
        assert (rest.text, others) == ("1", [])
        value += c
    assert value == 1  # in rationals


# What is proved, along runs

TRIALS = [
    ("sampling=random", "seed=3"),
    ("sampling=periodic",),
    ("sampling={law: 0.1025*sin(10*t) + 0.3075}", "w=['where(t <= 2, -1, where(t <= 5, 1, 0))']", "xhat0=[1, -2]"),
    ("sampling=random", "noise={amplitude: 0.3}", "w=[2*sin(2*t)]"),
    ("sampling=random", "noise={type: gaussian, amplitude: 0.1}", "xhat0=[1, -2]", "seed=7"),
]


def require_kept(summary, least=2):
    """Hold every bound of a run within the intervals against the run."""
    assert summary["status"] == "done"
    assert summary["sampling"]["outside"] == 0
    assert summary["bounds_omitted"] is None
    assert len(summary["bounds"]) >= least
    for bound in summary["bounds"]:
        assert bound["holds"], bound
        assert 0 < bound["value"] <= bound["bound"] * (1 + 1e-6)


@pytest.mark.parametrize("trial", TRIALS)
@pytest.mark.parametrize("name", ["reset", "hold", "sine", "ahead"])
def test_a_run_within_the_intervals_keeps_every_bound(tried, name, trial):
    require_kept(tried(name, *trial), 1 if name == "ahead" else 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    "trial", [(), ("w=[sin(2*t)]", "noise={amplitude: [0.1, 0.1]}"), ("sampling=random", "seed=2")]
)
def test_a_run_of_the_flexible_link_keeps_every_bound(tried, trial):
    require_kept(tried("link", *trial))


def test_without_a_shortest_interval_gaps_are_drawn_down_to_a_thousandth_of_t2(tried):
    for seed in range(3):
        summary = tried("any", "sampling=random", f"seed={seed}", "w=[sin(2*t)]", "horizon=40")
        require_kept(summary)
        assert 0.00041 <= summary["sampling"]["shortest"] < 0.05
        assert summary["sampling"]["longest"] <= 0.41
        assert "jitter" not in summary["sampling"]
    noisy = tried("any", "sampling=random", "noise={amplitude: 0.1}")
    assert not any("sup|eta|" in bound["name"] for bound in noisy["bounds"])


@pytest.mark.parametrize(("name", "ahead"), [("reset", 1), ("hold", 1), ("ahead", 2), ("any", 0)])
def test_an_interval_that_is_too_short_voids_the_guarantee_from_before_it_on(tried, solved, name, ahead):
    law = "sampling={law: 'where(t > 2, where(t < 2.4, 0.1, 0.3), 0.3)'}"
    summary = tried(name, law)
    received = np.array(
        obsdesign.read(solved(name)).simulate(sampling={"law": law[15:-1].strip("' ")}).schedule.received
    )
    if not ahead:
        return require_kept(summary)
    first = int(np.argmax(np.diff(received) < 0.2))  # the measurement that begins the short interval
    until = received[first + 1 - ahead]
    assert f"too short begins at t = {until:.6g}, nothing is guaranteed from then on" in summary["bounds_omitted"]
    assert summary["bounds"]
    for bound in summary["bounds"]:
        assert bound["holds"]
        assert bound.get("time", 0) < until
    return None


def test_a_measurement_that_is_overdue_or_lost_ends_the_guarantee(tried):
    for changes in (("sampling={law: 'where(t > 3, 2, 0.3)'}",), ("sampling=random", "dropout=0.3", "horizon=30")):
        for name in ("reset", "hold", "ahead"):
            summary = tried(name, *changes)
            assert "a measurement is overdue" in summary["bounds_omitted"]
            assert summary["bounds"]
            assert all(bound["holds"] for bound in summary["bounds"])


def storage(content, tau):
    """P (K, m, m) of the witness that a run is held against, at values (K,) of the clock, by scipy's Bernstein form."""
    witnesses = content["certificate"]["witnesses"]
    witness = witnesses.get("energy", witnesses["gamma"])
    knots = [float(Fraction(s)) for s in witness["knots"]]
    P = np.array([[[[float(Fraction(x)) for x in row] for row in M] for M in part] for part in witness["P"]])
    return BPoly(np.moveaxis(P, 0, 1), knots)(tau), float(Fraction(witness["lambda"]))


@pytest.mark.parametrize("name", ["reset", "hold", "sine"])
@seeds(3)
def test_v_of_a_file_decays_along_a_run_and_is_the_v_of_the_run(solved, name, seed):
    path = solved(name)
    found = obsdesign.read(path).simulate(sampling="random", seed=seed).steps
    y = found.y_true - found.xihat[:, :1]
    x = -found.e if name != "hold" else np.hstack([-found.e, y - found.theta])
    P, decay = storage(json.loads(path.read_text()), np.minimum(found.timer, 0.41))
    V = np.einsum("ti,tij,tj->t", x, P, x)
    np.testing.assert_allclose(found.V, V, rtol=1e-6, atol=1e-12)
    grown = V[1:] * np.exp(2 * decay * np.diff(found.t)) / V[:-1]
    assert (grown[V[:-1] > 1e-9 * V[0]] <= 1 + 1e-5).all()
    assert (np.diff(found.j) == 1).sum() > 20


@seeds(4)
def test_gaps_chosen_to_be_the_worst_keep_v_below_its_bound(solved, seed):
    """The next gap is the one of a few, at random or by the state, that leaves the most of |e|."""
    content = json.loads(solved("reset").read_text())
    random, A = np.random.default_rng(seed), np.array([[0.0, 1], [-4, 0]])
    jump = np.eye(2) - np.outer([0.78, 0.45], [1, 0])
    e, gap, gaps = random.normal(size=2), 0.41, np.linspace(0.205, 0.41, 9)
    for _ in range(100):
        (P,), decay = storage(content, np.array([gap]))
        before = e @ P @ e
        e = expm(gap * A) @ e
        (P,), _ = storage(content, np.zeros(1))
        assert e @ P @ e <= before * np.exp(-2 * decay * gap) * (1 + 1e-9)
        landed = e @ P @ e
        e = jump @ e
        tried = sorted(gaps, key=lambda g: -np.linalg.norm(jump @ expm(g * A) @ e))
        gap = tried[0] if random.random() < 0.7 else random.choice(gaps)
        (P,), _ = storage(content, np.array([gap]))
        assert e @ P @ e <= landed * (1 + 1e-9)
        e /= np.linalg.norm(e)


def test_noise_of_which_nothing_bounds_what_it_adds_to_v_leaves_the_other_bounds_and_the_run(solved):
    for name in ("reset", "sine"):
        design = obsdesign.read(solved(name))
        witness = design.guarantee.witness
        numbers = {key: value for key, value in witness.numbers.items() if key != "kappa"}
        guarantee = replace(design.guarantee, witness=replace(witness, numbers=numbers))
        trial = replace(design.spec.simulation, noise=Noise("uniform", np.array([0.1]), 1.0), sampling="random")
        found = simulated(replace(design.spec, simulation=trial), design.observer, guarantee)
        assert found.status == "done"
        assert len(found.t) == 2000
        (bound,) = found.summary["bounds"]
        assert bound["name"] == "|e|(t) <= overshoot exp(-rate t) |e|(0) + noise sup|eta|"
        assert bound["holds"]
        assert np.isfinite(found.V).all()
        assert np.isfinite(found.V_bound[found.j == 0]).all()
        assert np.isinf(found.V_bound[found.j > 0]).all()
        assert found.plot(every=True).startswith(PNG)


# False claims


@pytest.mark.parametrize("name", ["reset", "hold", "ahead"])
def test_a_storage_function_that_is_scaled_in_one_segment_proves_nothing(solved, name):
    for witness in obsdesign.read(solved(name)).claim.witnesses.values():
        assert witness.holds
        for places in witness.theorem.clock.places:
            for factor in (fmpq(98, 100), fmpq(102, 100)):
                P = witness.P.copy()
                P[:, places] *= factor
                assert not replace(witness, P=P).holds
        for number, value in witness.numbers.items():
            assert not replace(witness, numbers={**witness.numbers, number: value * fmpq(9, 10)}).holds


def test_verify_refuses_a_file_whose_storage_function_is_scaled_in_one_segment(solved, tmp_path):
    genuine = json.loads(solved("reset").read_text())
    for i in range(len(genuine["certificate"]["witnesses"]["gamma"]["P"])):
        forged = scaled(copy.deepcopy(genuine), ("certificate", "witnesses", "gamma", "P", i), "1.01")
        path = tmp_path / "forged.gains.json"
        path.write_text(json.dumps(forged))
        outcome = run("verify", path, "-q")
        assert outcome.exit_code == 2
        assert "does not begin with the matrix that the last one ends with" in outcome.stderr
    whole = scaled(copy.deepcopy(genuine), ("certificate", "witnesses", "gamma", "P"), "1.01")
    path.write_text(json.dumps(whole))
    assert run("verify", path, "-q").exit_code == 4
