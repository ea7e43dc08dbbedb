"""Simulation of a plant with its observer, in continuous time or with measurements at instants."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from obsdesign.families import FAMILIES
from obsdesign.simulate.drawing import drawn, foreign, observer_of, tried
from obsdesign.simulate.run import Run
from obsdesign.simulate.running import run
from obsdesign.simulate.sampling import Sampling, Schedule

if TYPE_CHECKING:
    from obsdesign.design import Design

__all__ = ["Run", "Sampling", "Schedule", "run", "simulate"]


def simulate(
    design: "Design", changes: Mapping[str, Any] | None = None, progress: Callable[[float], None] | None = None
) -> Run:
    """Simulate the plant of a design with its observer, against what is proved of it; see `running.run`.

    `changes`: other values of keys of `simulation`. The plant and its start are those that the seed draws.
    """
    spec = tried(design, changes or {})
    with spec.placed():
        trial, observer = drawn(spec), observer_of(design, spec)
        why = foreign(design, trial.parameters)
        found = run(trial.spec, observer, design.guarantee, progress=progress, foreign=why)
        signals = dict(zip(observer.own, found.steps.theta.T, strict=True))
        told = {**trial.written(), **FAMILIES[spec.observer.type].report(spec, design.form, found.steps.t, signals)}
        return replace(found, summary={**found.summary, **told}) if told else found
