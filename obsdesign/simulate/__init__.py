"""Simulation of a plant with its observer."""

from obsdesign.simulate.run import Run
from obsdesign.simulate.simulation import simulate

__all__ = ["Run", "simulate"]
