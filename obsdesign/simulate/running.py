"""Try an observer on the scenario of a spec."""

from collections.abc import Callable

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.families.guarantee import Guarantee
from obsdesign.families.observer import Observer
from obsdesign.simulate.perturbed import applies, perturbed
from obsdesign.simulate.record import Record
from obsdesign.simulate.run import Run
from obsdesign.simulate.sampling import Sampling
from obsdesign.simulate.simulation import follow, initial, system_of
from obsdesign.simulate.stepped import passage
from obsdesign.simulate.summary import summarise
from obsdesign.simulate.undefined import undefined
from obsdesign.spec import Spec


def run(
    spec: Spec,
    observer: Observer,
    guarantee: Guarantee | None,
    sampling: Sampling | None = None,
    progress: Callable[[float], None] | None = None,
    foreign: str = "",
) -> Run:
    """Simulate the plant of a spec with an observer, up to the horizon, an event, an escape or a stall.

    See `recorded`.
    """
    return run_of(recorded(spec, observer, guarantee, sampling, progress, foreign))


def recorded(
    spec: Spec,
    observer: Observer,
    guarantee: Guarantee | None,
    sampling: Sampling | None = None,
    progress: Callable[[float], None] | None = None,
    foreign: str = "",
) -> Record:
    """Record of a run.

    The signals of the observer have the same names as those of the plant with its disturbance model. Without a
    guarantee, what is proved of the observer, the bounds are left out. `sampling` says how measurements reach an
    observer that jumps at each; None: as the spec says. `progress` is called now and then with the fraction done.
    `foreign`: why nothing is proved with the plant of the spec, which is another than the observer was designed for.

    Raises `UsageError` if the spec has no `simulation`, a nonlinearity no f, a signal no value at t = 0, or
    measurements go back in time.
    """
    simulation = spec.simulation
    if simulation is None:
        raise UsageError(Problem("is missing; give at least horizon, x0, and w or v", key="simulation", id="OBS801"))
    if simulation.stepped and spec.period is None:
        return passage(spec, observer, sampling, progress, foreign)[1]
    system = system_of(spec, simulation, observer, guarantee, sampling)
    try:
        start, breaks = initial(system, simulation, sampling), system.breaks()
    except ArithmeticError as error:
        key, said = undefined(spec, simulation)
        raise UsageError(Problem(said, key=key, id="OBS304")) from error
    if reason := system.stopped(0.0, start, system.beside(0.0)):
        name, _, condition = reason.partition(": ")
        raise UsageError(
            Problem(f"{condition} is true at the start already", key=f"simulation.events.{name}", id="OBS802")
        )
    samples = np.linspace(0, simulation.horizon, simulation.points)
    quick = perturbed(spec, observer, guarantee, samples) if applies(system) else None
    return Record(spec, system, breaks, quick or follow(system, start, breaks, samples, progress), foreign)


def run_of(record: Record) -> Run:
    """Run of a record, with all that is said of it."""
    acting, trajectory = record.acting, record.trajectory
    return Run(
        **vars(record.at_samples()),
        steps=record.at_steps(),
        spec=record.spec,
        guarantee=None if record.foreign else record.guarantee,
        schedule=acting.schedule,
        states=acting.plant.states,
        plant_states=acting.n,
        exogenous=record.spec.plant.exogenous,
        estimated=record.estimated,
        outputs=acting.outputs,
        status=trajectory.status,
        time=trajectory.time,
        left=record.left,
        until=record.until,
        summary=summarise(record),
    )
