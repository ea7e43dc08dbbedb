"""Try an observer on the scenario of a spec."""

from collections.abc import Callable, Mapping

import numpy as np

from obsdesign.errors import UsageError
from obsdesign.families.guarantee import Guarantee
from obsdesign.lmi.formula import Array
from obsdesign.simulate.coupled import Coupled
from obsdesign.simulate.integrate import Tolerance, Vector, finite, integrate
from obsdesign.simulate.record import Record
from obsdesign.simulate.run import Run
from obsdesign.simulate.scenario import scenario
from obsdesign.simulate.summary import summarise
from obsdesign.spec import Simulation, Spec

RTOL = 1e-8
RTOL_NOISE = 1e-6  # every noise sample is a restart, and more digits would be digits of the noise
ATOL = 1e-12  # of the size of a state at the start


def simulate(
    spec: Spec,
    gains: Mapping[str, Array],
    guarantee: Guarantee | None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Simulate the plant of a spec with the observer (12) of Corless and Chakrabarty (2019).

    xihat' = A xihat + Bf f(t, y, qhat) + gx + L1 (yhat - y)
    qhat   = Cq xihat + Dqf f(t, y, qhat) + gq + L2 (yhat - y)
    yhat   = C xihat + Df f(t, y, qhat) + gy
    what   = pinv(B) L1 (yhat - y) where the spec asks for a reconstruction of w

    Parameters
    ----------
    spec
        With a `simulation` section.
    gains
        L1 (n + nm, ny) and L2 (nq, ny), in doubles.
    guarantee
        What the gains are proved to achieve; None leaves the bounds out.
    progress
        Called now and then with the fraction that is done.

    Returns
    -------
    Run
        Up to the horizon, or to an escape or a stall, with its summary.

    Raises
    ------
    UsageError
        If the spec has no `simulation`, a nonlinearity no f, or a signal no value at t = 0.
    """
    simulation = spec.simulation
    if simulation is None:
        raise UsageError("the spec has no `simulation` section: give at least horizon, x0, and w or v")
    acting = scenario(spec, simulation)
    system = Coupled(spec, acting, gains, guarantee)
    breaks = acting.breaks([term.expression for term in system.observer.stack.terms])
    start = initial(system, simulation)
    trajectory = integrate(
        system.flow(),
        start,
        acting.segments(breaks, len(start)),
        np.linspace(0, simulation.horizon, simulation.points),
        tolerance(start, system),
        progress and (lambda t: progress(t / simulation.horizon)),
    )
    record = Record(spec, system, guarantee, breaks, trajectory)
    return Run(
        **vars(record.at_samples()),
        steps=record.at_steps(),
        states=acting.plant.states,
        plant_states=acting.n,
        exogenous=spec.plant.exogenous,
        estimated=record.estimated,
        outputs=acting.plant.outputs,
        status=trajectory.status,
        time=trajectory.time,
        left=record.left,
        summary=summarise(record),
    )


def initial(system: Coupled, simulation: Simulation) -> Vector:
    """Return the initial state of the flow, where every signal and nonlinearity must have a value."""
    try:
        with np.errstate(all="ignore"):
            start = finite(system.start(simulation.x0, simulation.xhat0))
            finite(system.rhs(0.0, start, system.scenario.held(0.0)))
    except ArithmeticError as error:
        raise UsageError(
            f"simulation: at t = 0 a signal, the v that w needs, or a nonlinearity has no value: {error}"
        ) from error
    return start


def tolerance(start: Vector, system: Coupled) -> Tolerance:
    """Tolerance of a step; the absolute one goes by the size of each state and its estimate at the start.

    It is as much smaller for the errors as a reconstruction of w magnifies them.
    """
    n, ns = system.scenario.plant.n, system.ns
    size = np.abs(start[ns : ns + n])
    size[:ns] = np.maximum(size[:ns], np.abs(start[:ns]))
    nonzero = size[size > 0]
    size[size == 0] = nonzero.min() if len(nonzero) else 1.0
    integrals = np.full(len(start) - ns - n, size.max() ** 2)
    absolute = ATOL * np.concatenate((size[:ns], size / system.amplification(), integrals))
    return Tolerance(RTOL_NOISE if system.scenario.noise.any() else RTOL, absolute)
