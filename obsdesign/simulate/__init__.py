"""Simulation of a plant with its observer, in continuous time or with measurements at instants."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from obsdesign.simulate.run import Run
from obsdesign.simulate.running import run
from obsdesign.simulate.sampling import Sampling, Schedule

if TYPE_CHECKING:
    from obsdesign.design import Design

__all__ = ["Run", "Sampling", "Schedule", "run", "simulate"]


def simulate(design: "Design", progress: Callable[[float], None] | None = None) -> Run:
    """Simulate the plant of a design with its observer, against what is proved of it; see `running.run`."""
    return run(design.spec, design.observer, design.guarantee, progress=progress)
