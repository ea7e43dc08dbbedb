"""Try an observer with sporadic measurements on the scenario of a spec."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from obsdesign.errors import UsageError
from obsdesign.families.guarantee import SampledGuarantee
from obsdesign.lmi.formula import Array
from obsdesign.simulate.hybrid import exact, smooth
from obsdesign.simulate.hybrid.record import Record
from obsdesign.simulate.hybrid.run import HybridRun
from obsdesign.simulate.hybrid.sampling import Sampling, Schedule, schedule
from obsdesign.simulate.hybrid.summary import summarise
from obsdesign.simulate.hybrid.system import Hybrid
from obsdesign.simulate.integrate import Vector, finite
from obsdesign.spec import Simulation, Spec


def simulate_sporadic(
    spec: Spec,
    gains: Mapping[str, Array],
    sampling: Sampling,
    guarantee: SampledGuarantee | None,
    progress: Callable[[float], None] | None = None,
) -> HybridRun:
    """Simulate the plant of a spec with the observer (4) of Ferrante, Gouaisbaut, Sanfelice and Tarbouriech.

    zhat'  = A zhat + Bf f(t, u, qhat) + gx + L theta,  qhat = Cq zhat + gq
    theta' = H theta
    theta+ = y(t_k) + eta_k - yhat(t_k)                 at each measurement

    A linear plant whose inputs are constant between jumps is solved by matrix exponentials, any other by LSODA. The
    noise of the spec is drawn anew at each measurement; its period plays no part.

    Parameters
    ----------
    spec
        With a `simulation` section.
    gains
        L (n, ny) and H (ny, ny), in doubles.
    sampling
        How the measurements reach the observer.
    guarantee
        What the gains are proved to achieve, and for which intervals; None leaves the bounds out.
    progress
        Called now and then with the fraction that is done.

    Returns
    -------
    HybridRun
        Up to the horizon, or to an escape or a stall, with its summary.

    Raises
    ------
    UsageError
        If the spec has no `simulation`, a nonlinearity no f or one that needs y between measurements, a signal no
        value at t = 0, or the law of the measurements gives an interval that is not positive.
    """
    simulation = spec.simulation
    if simulation is None:
        raise UsageError("the spec has no `simulation` section: give at least horizon and x0")
    intervals, loss, noise = (np.random.default_rng(s) for s in np.random.SeedSequence(simulation.seed).spawn(3))
    planned = schedule(sampling, simulation.horizon, intervals, loss)
    if guarantee is not None:
        planned = replace(planned, T1=guarantee.T1, T2=guarantee.T2)
    eta = noise_samples(simulation, planned, len(spec.plant.outputs), noise)
    system = Hybrid(spec, simulation, gains, planned, eta, guarantee)
    start = initial(system, simulation, sampling)
    breaks = system.breaks()
    stretches = planned.stretches(breaks)
    samples = np.linspace(0, simulation.horizon, simulation.points)
    if system.stepwise():
        trajectory = exact.follow(system, start, stretches, samples)
    else:
        told = progress and (lambda t: progress(t / simulation.horizon))
        trajectory = smooth.integrate(system, start, stretches, samples, told)
    record = Record(system, breaks, trajectory)
    return HybridRun(
        **vars(record.at_samples()),
        steps=record.at_steps(),
        schedule=planned,
        states=spec.plant.states,
        exogenous=spec.plant.exogenous,
        outputs=spec.plant.outputs,
        status=trajectory.status,
        time=trajectory.time,
        left=record.left,
        until=record.until,
        summary=summarise(record),
    )


def noise_samples(simulation: Simulation, planned: Schedule, ny: int, generator: np.random.Generator) -> Array:
    """Noise (K, ny) of each measurement that is received."""
    size, noise = (len(planned.received), ny), simulation.noise
    if noise is None:
        return np.zeros(size)
    draw = generator.standard_normal(size) if noise.type == "gaussian" else generator.uniform(-1, 1, size)
    return np.asarray(noise.amplitude * draw)


def initial(system: Hybrid, simulation: Simulation, sampling: Sampling) -> Vector:
    """Return the initial state of the flow, where every signal and nonlinearity must have a value."""
    theta0 = np.zeros(system.ny) if sampling.theta0 is None else sampling.theta0
    start = system.start(simulation.x0, simulation.xhat0, theta0)
    try:
        with np.errstate(all="ignore"):
            finite(system.rhs(0.0, start, start))
    except ArithmeticError as error:
        raise UsageError(f"simulation: at t = 0 a signal or a nonlinearity has no value: {error}") from error
    return start
