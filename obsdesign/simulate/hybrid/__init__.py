"""Simulation of observers whose measurements arrive sporadically: flows between them, a jump at each."""

from obsdesign.simulate.hybrid.run import HybridRun, HybridSamples
from obsdesign.simulate.hybrid.sampling import Sampling, Schedule
from obsdesign.simulate.hybrid.simulation import simulate_sporadic

__all__ = ["HybridRun", "HybridSamples", "Sampling", "Schedule", "simulate_sporadic"]
