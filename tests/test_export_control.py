"""The observer as a system of python-control: in its responses it estimates what the simulator does."""

import sys
from importlib import util

import numpy as np
import pytest
from flint import fmpq
from support.exported import INPUTS, design_of, deviation, hostile

from obsdesign.errors import UsageError
from obsdesign.simulate import Run
from obsdesign.stepping.implemented import implemented
from obsdesign.stepping.machine import Machine
from obsdesign.trial import Implementation

installed = pytest.mark.skipif(util.find_spec("control") is None, reason="python-control is not installed")
TIGHT = {"rtol": 1e-9, "atol": 1e-12}


def responded(design, run: Run):
    """Estimates of the system where it is given u and y of a run."""
    from control import input_output_response

    system, u = design.to_control(), design.observer.inputs
    U = np.array([run[name] for name in (*u, *design.observer.outputs)])
    machine = Machine(implemented(design.spec, design.observer, Implementation(fmpq(1, 10**6), "euler")))
    machine.begin(0.0, U[: len(u), 0], U[len(u) :, 0])
    found = input_output_response(system, run.t, U, machine.state, solve_ivp_kwargs=TIGHT)
    return system, np.atleast_2d(found.outputs)


@installed
@pytest.mark.parametrize(
    ("name", "changes", "tolerance"),
    [
        ("pendulum-embedded", {"horizon": 5, "points": 2001, "observer": "continuous"}, 1e-6),
        ("harmonic-motor", {"points": 1001, "horizon": 1, "noise": None}, 1e-4),
        ("cuk-kkl-pebo", {"points": 4001, "horizon": 0.02}, 1e-4),
        ("discrete-feedthrough", {}, 1e-9),
        ("discrete-friction", {}, 1e-9),
    ],
)
def test_a_response_is_the_run_of_the_simulator(name, changes, tolerance):
    design = design_of(name)
    run = design.simulate(**changes)
    system, found = responded(design, run)
    expected = np.array([run[label] for label in system.output_labels])
    assert deviation(found.T, expected.T) < tolerance
    assert system.output_labels == [f"hat_{estimate}" for estimate in design.observer.estimates]
    assert system.input_labels == [*design.observer.inputs, *design.observer.outputs]
    assert system.state_labels == list(design.observer.states)
    assert system.dt == (0 if design.spec.period is None else float(design.spec.period))


@installed
def test_it_is_connected_by_names():
    from control import interconnect, tf

    filtered = tf([1], [0.1, 1], inputs="raw", outputs="y_angle", name="filter")
    system = design_of("pendulum-embedded").to_control()
    whole = interconnect([filtered, system], inputs=["raw", "y_speed"], outputs=system.output_labels)
    assert whole.nstates == 4
    assert hostile().to_control().input_labels[: len(INPUTS)] == list(INPUTS)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("ferrante2019-oscillator-clock", "its state jumps at measurements"),
        ("discrete-motor", "its estimate of a sample knows y of that sample"),
    ],
)
def test_what_has_no_such_equations_is_refused_in_a_line(name, why):
    with pytest.raises(UsageError) as refused:
        design_of(name).to_control()
    assert str(refused.value) == f"no system of python-control: {why}; export it as code [OBS922]"


def test_what_is_not_installed_is_said_in_a_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(UsageError) as refused:
        design_of("pendulum-embedded").to_control()
    assert str(refused.value) == "python-control is not installed; pip install 'obsdesign[control]' [OBS922]"
