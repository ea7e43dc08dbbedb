"""Runs of many seeds at once: against single runs, closed forms, and a stiff estimator."""

from dataclasses import replace

import numpy as np
import pytest
from flint import fmpq
from scipy.linalg import expm
from support.cuk import CUK, stiff

from obsdesign.families import FAMILIES
from obsdesign.reading import load, loads
from obsdesign.simulate import run, running, simulation
from obsdesign.simulate.collocation import NODES, Step
from obsdesign.simulate.definitions import error
from obsdesign.simulate.ensemble import spread
from obsdesign.simulate.perturbation import Perturbation
from obsdesign.simulate.simulation import follow, initial, system_of

SCALAR = """
obsdesign: 1
system: {A: [[0]], C: [[1]], inputs: [], states: [x], outputs: [y]}
observer: {type: l2, alpha: 0.1}
simulation: {horizon: 40, x0: 0, noise: {type: gaussian, amplitude: 0.3, period: 0.01}, seed: 5}
"""


def single(spec, observer, seed, instants):
    """Errors of one run by itself at some instants, (N, n)."""
    trial = replace(spec.simulation, seed=seed)
    system = system_of(spec, trial, observer)
    run = follow(system, initial(system, trial, None), system.breaks(), instants)
    return system.table(run.t, run.s).of(map(error, spec.plant.states))


@pytest.fixture
def fine(monkeypatch):
    """Single runs with more digits than their noise needs."""
    monkeypatch.setattr(simulation, "RTOL_NOISE", 1e-9)


def require_single_runs(spec, observer, accuracy=1e-6):
    """Hold the first seed of an ensemble, once and once more, against its own run."""
    for seed in (3, 4):
        found = spread(spec, observer, (seed, 8), (0.0, spec.simulation.horizon))
        alone = single(spec, observer, seed, found.t)
        assert len(found.t) > 10
        assert np.abs(found.errors[:, : alone.shape[1]] - alone).max() <= accuracy * np.abs(alone).max()


@pytest.mark.usefixtures("fine")
def test_a_nonlinear_copy_of_its_plant_agrees_with_single_runs_of_the_same_seed():
    spec = load("specs/pendulum.yaml")
    noise = loads(SCALAR).simulation.noise
    trial = replace(spec.simulation, horizon=2.0, noise=replace(noise, amplitude=np.array([0.01, 0.02])))
    gains = {"L1": np.array([[-2.0, -1.0], [-1.0, -2.0], [-1.0, -1.0]]), "L2": np.zeros((1, 2))}
    spec = replace(spec, simulation=trial)
    require_single_runs(spec, FAMILIES["l2"].observer(spec, gains))


@pytest.mark.usefixtures("fine")
def test_a_stiff_estimator_agrees_with_single_runs_of_the_same_seed():
    require_single_runs(loads(CUK), stiff(fmpq(1, 1000)))


@pytest.mark.usefixtures("fine")
def test_measurements_at_instants_agree_with_single_runs_of_the_same_seed():
    text = load("specs/ferrante2019-manipulator.yaml").text.split("expect:")[0]
    spec = loads(text)
    noise = replace(loads(SCALAR).simulation.noise, amplitude=np.full(len(spec.plant.outputs), 0.05))
    trial = replace(spec.simulation, horizon=3.0, noise=noise, sampling="periodic")
    spec = replace(spec, simulation=trial)
    n, ny = spec.plant.n, len(spec.plant.outputs)
    gains = {"L": 2.0 * spec.plant.doubles.C.T, "H": np.zeros((ny, ny))}
    assert gains["L"].shape == (n, ny)
    require_single_runs(spec, FAMILIES[spec.observer.type].observer(spec, gains))


@pytest.mark.parametrize("rate", [2.0, 6e5])
def test_the_noise_of_a_linear_observer_has_the_rms_of_its_closed_form(rate):
    """e' = -k (e - n), n held over h: at the end of each period e has the variance s^2 (1 - a) / (1 + a), a = e^(-kh).

    In between e = a_t e_0 + (1 - a_t) n; the mean over a period of the square is taken by a fine quadrature.
    """
    spec = loads(SCALAR)
    observer = FAMILIES["l2"].observer(spec, {"L1": np.array([[-rate]]), "L2": np.zeros((0, 1))})
    rms = spread(spec, observer, tuple(range(40)), (10.0, 40.0)).rms[:, 0]
    h, size = 0.01, 0.3
    a = np.exp(-rate * h)
    inside = np.exp(-rate * h * (np.arange(1000) + 0.5) / 1000)
    variance = size**2 * (inside**2 * (1 - a) / (1 + a) + (1 - inside) ** 2).mean()
    assert np.sqrt((rms**2).mean()) == pytest.approx(np.sqrt(variance), rel=0.03)


def test_the_noise_that_is_drawn_gives_exactly_what_the_linear_recursion_gives():
    spec = loads(SCALAR)
    observer = FAMILIES["l2"].observer(spec, {"L1": np.array([[-2.0]]), "L2": np.zeros((0, 1))})
    found = spread(spec, observer, (7, 9), (0.0, 40.0))
    d, a, middle = 0.0, np.exp(-2.0 * 0.01), np.exp(-2.0 * 0.005)
    expected = []
    for n in Perturbation(spec, observer, (7, 9)).noises[:, 0, 0]:
        expected.append(middle * d + (1 - middle) * n)
        d = a * d + (1 - a) * n
    assert found.errors[:, 0] == pytest.approx(np.array(expected), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("stiffness", [1.0, 1e3, 1e7])
def test_a_step_is_exact_for_a_linear_flow_with_a_constant_input(stiffness):
    J = np.array([[-stiffness, 1.0], [0.5, -1.0]])
    b, d = np.array([[stiffness], [1.0]]), np.array([[1.0], [-2.0]])
    step = Step.of(J, 0.1)
    found, _, _, _ = step.advance(d, lambda at: np.einsum("ij,jks->iks", J, at) + b[:, None], np.ones(2))
    rest = -np.linalg.solve(J, b)
    assert found == pytest.approx(rest + expm(0.1 * J) @ (d - rest), rel=1e-10, abs=1e-12)


def test_a_step_has_the_order_six_of_the_gauss_method_where_nothing_is_stiff():
    def end(h):
        d, step = np.array([[1.0]]), Step.of(np.zeros((1, 1)), h)
        for k in range(round(1 / h)):
            t = k * h + h * NODES
            d, _, _, _ = step.advance(d, lambda at, t=t: -at * np.cos(t)[None, :, None], np.ones(1))
        return d.item()

    errors = [abs(end(h) - np.exp(-np.sin(1))) for h in (0.5, 0.25)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(6, abs=0.5)


@pytest.mark.usefixtures("fine")
def test_a_run_with_many_noise_samples_is_the_one_that_lsoda_follows(monkeypatch):
    spec = loads(CUK)
    quick = run(spec, stiff(fmpq(1, 1000)), None)
    monkeypatch.setattr(running, "applies", lambda _: False)
    slow = run(spec, stiff(fmpq(1, 1000)), None)
    assert len(quick.steps.t) > 4 * 600
    assert quick.y == pytest.approx(slow.y, rel=1e-6, abs=1e-9)
    assert quick.e == pytest.approx(slow.e, rel=1e-6, abs=1e-6)
    assert quick.summary["z_norm2"] == pytest.approx(slow.summary["z_norm2"], rel=1e-6)
    for name in ("i1", "v4"):
        assert quick.summary["settling"][name] == pytest.approx(slow.summary["settling"][name], rel=1e-4)
