"""Follow a plant and its observer from the start to the horizon."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.families.guarantee import Guarantee
from obsdesign.families.observer import Observer
from obsdesign.simulate import exact
from obsdesign.simulate.integrate import Flow, Segment, Tolerance, Trajectory, Vector, finite, integrate
from obsdesign.simulate.march import march
from obsdesign.simulate.recursion import Recursion
from obsdesign.simulate.sampling import Sampling
from obsdesign.simulate.scenario import received, scenario
from obsdesign.simulate.sizes import sizes
from obsdesign.simulate.system import System
from obsdesign.spec import Spec
from obsdesign.trial import Simulation

RTOL = 1e-8
RTOL_NOISE = 1e-6  # every noise sample, or row of a long file, is a restart, and more digits would be digits of it
MANY = 100  # stretches in a run: they are short
ATOL = 1e-12  # of the size of a state at the start


def system_of(
    spec: Spec,
    simulation: Simulation,
    observer: Observer,
    guarantee: Guarantee | None = None,
    sampling: Sampling | None = None,
) -> System:
    """Plant and observer in the scenario of a `simulation` section; with another plant it copies fewer signals."""
    acting = scenario(spec, simulation, bool(observer.jump))
    if observer.jump:
        acting = received(acting, simulation, sampling or sampled(simulation, observer, guarantee), guarantee)
    there = {*acting.plant.states, *acting.plant.algebraic, *acting.plant.outputs}
    if not there.issuperset(observer.twins.values()):
        observer = replace(observer, twins={hat: twin for hat, twin in observer.twins.items() if twin in there})
    return (System if acting.clock is None else Recursion)(acting, observer, spec.H.astype(float), guarantee)


def follow(
    system: System,
    start: Vector,
    breaks: list[tuple[float, float]],
    samples: Vector,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Follow the flow and its jumps from the start to the horizon, with its state at some samples (N,), increasing.

    A linear plant whose inputs are constant in each of many stretches, between measurements, jumps or samples of noise,
    is solved by matrix exponentials; one along many rows of a file by a step of collocation in each, any other flow by
    LSODA. A plant in discrete time is a recursion over its own samples.
    """
    told = progress and (lambda t: progress(t / system.scenario.horizon))
    if isinstance(system, Recursion):
        return system.follow(start, told)
    stretches = list(system.scenario.stretches(breaks))
    many = bool(system.observer.jump) or len(stretches) > MANY
    affine = system.constant() if many else None
    if affine is not None:
        return exact.follow(system, affine, start, stretches, samples)
    allowed = tolerance(start, system)
    if along_rows(system) and (found := march(system, start, stretches, samples, allowed, told)):
        return found
    flow = Flow(system.rhs, system.jacobian, system.end, sizes(system, start), system.watch, system.stopped)
    segments = (
        Segment(stretch.start, stretch.stop, partial(system.enter, stretch), system.held(stretch))
        for stretch in stretches
    )
    return integrate(flow, start, segments, samples, allowed, told, explicit=many)


def sampled(simulation: Simulation, observer: Observer, guarantee: Guarantee | None) -> Sampling:
    """How measurements arrive: as the spec says, for the intervals of the guarantee or the least that are asked for."""
    assert observer.intervals
    T1, T2 = observer.intervals
    longest = getattr(guarantee, "T2", T2)
    return Sampling(T1, longest, simulation.sampling, simulation.period, simulation.dropout, simulation.theta0)


def initial(system: System, simulation: Simulation, sampling: Sampling | None) -> Vector:
    """Return the initial state of the flow; raises `ArithmeticError` where a signal or nonlinearity has no value."""
    given = simulation.theta0 if sampling is None else sampling.theta0
    theta0 = np.zeros(len(system.further)) if given is None else given
    if len(theta0) != len(system.further):
        said = "is the correction theta before the first measurement, which this observer does not have: leave it out"
        raise UsageError(Problem(said, key="simulation.theta0", id="OBS206"))
    with np.errstate(all="ignore"):
        start = finite(system.start(simulation.x0, simulation.xhat0, theta0))
        finite(system.program.run(0.0, start[: system.width], system.beside(0.0)))
    return start


def tolerance(start: Vector, system: System) -> Tolerance:
    """Tolerance of a step; the absolute one goes by the size of each state and its estimate at the start.

    It is as much smaller for the errors as a reconstruction of w magnifies them.
    """
    ns, n = len(system.integrated), len(system.copied)
    size = np.abs(start[ns : ns + n]) if n else np.zeros(ns)
    size[:ns] = np.maximum(size[:ns], np.abs(start[:ns]))
    nonzero = size[size > 0]
    size[size == 0] = nonzero.min() if len(nonzero) else 1.0
    further = np.full(len(system.followed) + len(system.further), size.max())
    integrals = np.full(len(start) - system.end, size.max() ** 2)
    errors = size[:n] / system.amplification()
    absolute = ATOL * np.concatenate((size[:ns], errors, further, integrals))
    coarse = system.scenario.noisy or along_rows(system)
    return Tolerance(RTOL_NOISE if coarse else RTOL, absolute)


def along_rows(system: System) -> bool:
    """Whether a run goes along so many rows of files that its stretches are short."""
    acting = system.scenario
    return len(acting.recorded.edges(acting.horizon)) > MANY
