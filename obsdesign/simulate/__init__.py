"""Simulation of a plant with its observer, in continuous time or with measurements at instants."""

from collections.abc import Callable
from typing import Protocol

from obsdesign.families.guarantee import Guarantee
from obsdesign.families.observer import Observer
from obsdesign.simulate.run import Run
from obsdesign.simulate.sampling import Sampling, Schedule
from obsdesign.simulate.simulation import run
from obsdesign.spec import Spec

__all__ = ["Run", "Sampling", "Schedule", "run", "simulate"]


class Designed(Protocol):
    """A design, as far as a simulation needs it."""

    @property
    def spec(self) -> Spec:
        """The problem."""

    @property
    def observer(self) -> Observer:
        """Equations of the observer with its gains."""

    @property
    def guarantee(self) -> Guarantee | None:
        """What is proved of this observer and of the plant of the spec; None where nothing is."""


def simulate(design: Designed, progress: Callable[[float], None] | None = None) -> Run:
    """Simulate the plant of a design with its observer, against what is proved of it; see `simulation.run`."""
    return run(design.spec, design.observer, design.guarantee, progress=progress)
