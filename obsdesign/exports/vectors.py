"""Vectors that an exported observer is tested with: what it is given, and what a run in the same steps estimates."""

import numpy as np

from obsdesign.design import Design
from obsdesign.errors import Problem, UsageError
from obsdesign.exports.subject import Subject
from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass, replace
from obsdesign.simulate.recorded import absent
from obsdesign.simulate.stepped import passage
from obsdesign.stepping.machine import Machine, StuckError
from obsdesign.trial import Implementation

MOST = 200  # steps
LEAST = 10  # of signals that stand for a run: fewer test nothing


@dataclass(frozen=True)
class Vectors:
    """Rows of a run: at each instant the known signals, whether a measurement is taken, and the estimates after it.

    To the next row an observer steps with u and y of this row, or, where it knows y of its sample, with u of both rows
    and y of the next.
    """

    t: Float  # (K,)
    u: Float  # (K, nu)
    y: Float  # (K, ny)
    measured: Float  # (K,), 1 where a measurement is taken, of measurements at instants; else 0
    on: Float  # (K,), s, to the next row
    estimates: Float  # (K, ne)
    simulated: bool  # whether they are of the simulation of the spec; else of signals that stand for it
    why: str = ""  # .. where the spec has a simulation


def vectors(design: Design, subject: Subject) -> Vectors:
    """Vectors of the first steps of the simulation of a spec, or of waves where it has none, or its files are gone."""
    simulation = design.spec.simulation
    if simulation is None:
        return waves(subject)
    if missing := absent(design.spec):
        said = f"{' and '.join(missing)} of the simulation {'are' if len(missing) > 1 else 'is'} not there"
        return replace(waves(subject, said), why=said)
    one = subject.implemented
    horizon = min(simulation.horizon, MOST * subject.period)
    brief = replace(simulation, horizon=max(horizon, subject.period), stepped=True, events={})
    spec = replace(design.spec, simulation=brief)
    if one.method:
        spec = replace(spec, implementation=Implementation(one.period, one.method))  # type: ignore[arg-type]
        made, record = passage(spec, one.observer)
        if record.trajectory.status == "escape":
            said = f"in steps of {subject.period:g} s, {one.method}, the simulation of the spec escapes"
            why = f"{said} {record.trajectory.reason}; take a shorter period"
            raise UsageError(Problem(why, key="implementation.period", id="OBS921"))
        t = np.array([row.t for row in made.rows])[: len(made.estimates)]
        measured = np.array([float(row.measured is not None) for row in made.rows])[: len(t)]
        on = np.array([row.on for row in made.rows])[: len(t)]
        return Vectors(t, made.u[: len(t)], made.y[: len(t)], measured, on, made.estimates, simulated=True)
    run = replace(design, spec=spec).simulate()
    names = tuple(one.observer.estimates)
    found = np.column_stack([run[f"hat_{name}"] for name in names])
    steps = run.steps
    none, on = np.zeros(len(steps.t)), np.full(len(steps.t), subject.period)
    return Vectors(steps.t, steps.u, steps.y, none, on, found, simulated=True)


def waves(subject: Subject, why: str = "the spec has no simulation") -> Vectors:
    """Vectors of slow waves in place of u and y, and why they are needed."""
    one, K = subject.implemented, 50
    t = np.asarray(np.arange(K) * subject.period, dtype=np.float64)
    phase: Float = np.arange(K, dtype=float)[:, None] / 10
    u: Float = np.sin(phase + np.arange(len(subject.inputs)))
    y: Float = np.sin(phase + 0.5 + np.arange(len(subject.outputs)))
    measured = (np.arange(K) % 7 == 0).astype(float) if subject.instants else np.zeros(K)
    machine, found = Machine(one), list[Float]()
    try:
        for k in range(K):
            if measured[k]:
                machine.jump(t[k], u[k], y[k])
            found.append(machine.estimate(t[k], u[k], y[k]))
            if k + 1 < K:
                late = subject.ahead
                machine.step(t[k], [*u[k], *u[k + 1]] if late else u[k], y[k + 1] if late else y[k])
    except StuckError:
        pass  # the equations have no value there
    n = len(found)
    if n < LEAST:
        said = f"{why}, and the equations have no value on the signals that stand for a run"
        raise UsageError(Problem(f"{said}; give one, whose steps test the code", key="simulation", id="OBS921"))
    estimates = np.array(found).reshape(n, len(subject.estimates))
    return Vectors(t[:n], u[:n], y[:n], measured[:n], np.full(n, subject.period), estimates, simulated=False)
