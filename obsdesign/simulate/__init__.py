"""Simulation of a plant with its observer."""

from collections.abc import Callable, Mapping

import numpy as np

from obsdesign.dissipation.bounds import Range
from obsdesign.families.guarantee import Guarantee
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.families.sporadic.guarantee import SporadicGuarantee
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.lmi.formula import Array
from obsdesign.simulate import simulation
from obsdesign.simulate.hybrid import HybridRun, Sampling, simulate_sporadic
from obsdesign.simulate.run import Run
from obsdesign.spec import Spec

__all__ = ["HybridRun", "Run", "simulate"]


def simulate(
    spec: Spec,
    gains: Mapping[str, Array],
    guarantee: Guarantee | None,
    progress: Callable[[float], None] | None = None,
) -> Run | HybridRun:
    """Simulate the plant of a spec with an observer of its family; see `simulation.simulate`, `simulate_sporadic`.

    Parameters
    ----------
    gains
        As the family calls them, with its signs: L1 and L2, or L, or L and H.
    """
    if isinstance(spec.observer, SporadicRequest):
        assert guarantee is None or isinstance(guarantee, SporadicGuarantee)
        return simulate_sporadic(spec, gains, sampling(spec, spec.observer, guarantee), guarantee, progress)
    if isinstance(spec.observer, LipschitzRequest):
        gains = {"L1": -gains["L"], "L2": np.zeros((len(spec.augmented.Cq), len(spec.augmented.C)))}
    return simulation.simulate(spec, gains, guarantee, progress)


def sampling(spec: Spec, request: SporadicRequest, guarantee: SporadicGuarantee | None) -> Sampling:
    """How measurements arrive: as the spec says, for the intervals of the guarantee or the least that are asked for."""
    T2 = request.T2.low if isinstance(request.T2, Range) else request.T2
    longest = guarantee.T2 if guarantee else float(max(T2, request.T1))
    trial = spec.simulation
    if trial is None:
        return Sampling(float(request.T1), longest)
    return Sampling(float(request.T1), longest, trial.sampling, trial.period, trial.dropout, trial.theta0)
