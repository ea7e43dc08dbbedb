"""A run in which the observer goes in steps, on u and y at their instants, as exported code does."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.families.guarantee import STEPS, Course
from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import Array, Float
from obsdesign.simulate.clock import steps_within
from obsdesign.simulate.integrate import Trajectory
from obsdesign.simulate.record import Record
from obsdesign.simulate.recursion import ESCAPE, GROWS
from obsdesign.simulate.run import Samples
from obsdesign.simulate.sampling import Sampling, Schedule
from obsdesign.simulate.scenario import measurement_noise, received, scenario
from obsdesign.simulate.simulation import follow, initial, sampled
from obsdesign.simulate.system import System
from obsdesign.spec import Spec
from obsdesign.stepping.implemented import Implemented, implemented
from obsdesign.stepping.machine import Machine, StuckError

MOST = 10**6  # steps of a run
ROUNDING = 1e-9  # of a period: measurements this near to a step are taken at it


class Row(NamedTuple):
    """An instant of a run in steps."""

    t: float
    measured: int | None  # number of the measurement that is received, of measurements at instants
    on: float  # s, to the next row


class Passage(NamedTuple):
    """What an observer is given and makes of it, row by row."""

    rows: list[Row]
    u: Float  # (K, nu)
    y: Float  # (K, ny), as it is measured
    states: Float  # (K, ns), after the measurement of the row
    estimates: Float  # (K, ne)


def passage(
    spec: Spec,
    observer: Observer,
    sampling: Sampling | None = None,
    progress: Callable[[float], None] | None = None,
    foreign: str = "",
) -> tuple[Passage, "Stepped"]:
    """Run of an observer in the steps of its spec, and the record of the run.

    Raises `UsageError`: the spec has no implementation, or more than a million steps.
    """
    one, simulation = implemented(spec, observer), spec.simulation
    assert simulation
    steps = steps_within(simulation.horizon, one.period)
    if not 0 < steps <= MOST:
        said = f"holds {steps:,} steps of implementation.period; give one to {MOST:,}"
        raise UsageError(Problem(said, key="simulation.horizon", id="OBS210"))
    acting = scenario(spec, simulation, bool(observer.jump))
    nothing = dict.fromkeys((*acting.plant.states, *observer.estimates), Expression.number(0))
    alone = Observer({}, nothing, observer.inputs, observer.outputs)
    schedule: Schedule | None = None
    if observer.jump:
        timed = received(acting, simulation, sampling or sampled(simulation, observer, None), None)
        schedule = timed.schedule
    system = System(acting, alone, spec.H.astype(float), None)
    start, breaks = initial(system, replace(simulation, theta0=None), None), system.breaks()
    rows = list(schedule_of(one, steps, schedule))
    t = np.array([row.t for row in rows])
    trajectory = follow(system, start, breaks, t, progress)
    kept = len(trajectory.t)
    table = system.table(trajectory.t, trajectory.s)
    u, y = table.of(observer.inputs), table.of(system.seen)
    if schedule is not None:
        eta = measurement_noise(simulation, (len(schedule.received), len(observer.outputs)))
        for k, row in enumerate(rows[:kept]):
            if row.measured is not None:
                y[k] += eta[row.measured]
    states, estimates, trouble = ran(Machine(one), rows[:kept], u, y)
    if trouble:
        kept = len(states)
        part = replace(trajectory, t=trajectory.t[:kept], s=trajectory.s[:kept], time=float(trajectory.t[kept - 1]))
        trajectory = replace(part, status="escape", reason=trouble)
    found = Passage(rows[:kept], u[:kept], y[:kept], states, estimates)
    return found, Stepped(spec, system, breaks, trajectory, found, one, foreign)


def schedule_of(one: Implemented, steps: int, schedule: Schedule | None) -> Iterator[Row]:
    """Rows at each step, and at each measurement, where y is known at instants."""
    period = float(one.period.p) / float(one.period.q)
    ticks = [(k * float(one.period.p) / float(one.period.q), -1) for k in range(steps + 1)]
    received = schedule.received.tolist() if schedule else []
    instants = dict(ticks)
    for k, t in enumerate(received):
        nearest = ticks[min(round(t / period), steps)][0]
        instants[nearest if abs(t - nearest) <= ROUNDING * period else t] = k
    times = sorted(t for t in instants if t <= ticks[-1][0])
    for t, after in zip(times, [*times[1:], times[-1]], strict=True):
        yield Row(t, instants[t] if instants[t] >= 0 else None, after - t)


def ran(machine: Machine, rows: Sequence[Row], u: Float, y: Float) -> tuple[Float, Float, str]:
    """States and estimates of each row, the measurement of the row being known, and why they end before the last."""
    states, estimates = [], []
    one = machine.one
    period = float(one.period.p) / float(one.period.q)
    try:
        for row, inputs, outputs in zip(rows, u.tolist(), y.tolist(), strict=True):
            if one.jump and row.measured is not None:
                machine.jump(row.t, inputs, outputs)
            estimates.append(machine.estimate(row.t, inputs, outputs))
            states.append(machine.state.copy())
            if abs(row.on - period) <= ROUNDING * period:
                machine.step(row.t, inputs, outputs)
            elif row.on > 0:
                machine.part(row.t, row.on, inputs, outputs)
            if np.abs(machine.state).max(initial=0.0) > ESCAPE:
                raise StuckError(GROWS, id="OBS304")
    except StuckError as error:
        done = min(len(states), len(estimates))
        return np.array(states[:done]), np.array(estimates[:done]), f"after t = {rows[done - 1].t:.6g}: {error}"
    return np.array(states), np.array(estimates), ""


class Stepped(Record):
    """Record of a run in steps, one row a step; estimates are those that the observer has after it."""

    def __init__(
        self,
        spec: Spec,
        system: System,
        breaks: Sequence[tuple[float, float]],
        trajectory: Trajectory,
        made: Passage,
        one: Implemented,
        foreign: str = "",
    ) -> None:
        rows = replace(trajectory, path_t=trajectory.t[:0], path_s=trajectory.s[:0])
        super().__init__(spec, system, breaks, rows, foreign)
        self.made, self.one, self._steps = made, one, self._samples
        known = np.flatnonzero(np.isin(trajectory.t, self.t))
        self.states, self.found, self.u, self.y = (
            rows[known] for rows in (made.states, made.estimates, made.u, made.y)
        )

    @property
    def uncovered(self) -> str:
        """Why no bound can be stated."""
        period, method = float(self.one.period), self.one.method
        return self.foreign or f"{STEPS} of {period:g} s ({method}): what is proved is about it in continuous time"

    def estimate_of(self, name: str) -> Array:
        """Estimate of a state of the plant or of its disturbance model, (M,)."""
        names = tuple(self.one.observer.estimates)
        if name in names:
            return np.asarray(self.found[:, names.index(name)])
        hat = next(hat for hat, twin in self.one.observer.twins.items() if twin == name)
        return np.asarray(self.states[:, self.one.states.index(hat)])

    @cached_property
    def errors(self) -> Array:
        """Errors of the estimates of states; of a disturbance model that has no copy, zero."""
        known = {*self.one.observer.estimates, *self.one.observer.twins.values()}
        xi = self.now.of(self.acting.plant.states)
        rows = [
            self.estimate_of(name) - x if name in known else np.zeros(len(x))
            for name, x in zip(self.acting.plant.states, xi.T, strict=True)
        ]
        return np.column_stack(rows)

    @cached_property
    def course(self) -> Course:
        """Error at the rows; the energies are sums over them."""
        drives = self.acting.plant.exogenous if self.spec.observer.filtered else self.acting.drive
        z, v2 = np.linalg.norm(self.z, axis=1), (self.now.of(drives) ** 2).sum(axis=1)
        on = np.diff(self.t, append=self.t[-1:])
        sums = [np.concatenate([[0.0], np.cumsum(on * values)[:-1]]) for values in (z**2, v2)]
        zero = np.zeros(len(self.t))
        drive = self.spec.observer.drive
        return Course(self.t, self.e, z, sums[0], sums[1], np.maximum.accumulate(np.sqrt(v2)), zero, drive)

    @cached_property
    def signals(self) -> Samples:
        """Signals at the rows."""
        names = tuple(self.one.observer.estimates)
        wanted = [name for name in self.acting.inputs if name in self.system.estimated]
        what = self.found[:, [names.index(name) for name in wanted]]
        w = self.now.of(self.acting.w)
        true = self.now.of([self.system.estimated[name] for name in wanted])
        own = [i for i, name in enumerate(self.one.observer.states) if name in self.one.observer.own]
        beside = {"w_error": what - true, "y": self.y, "theta": self.states[:, own]}
        return replace(super().signals, what=what, w=w, **beside)
