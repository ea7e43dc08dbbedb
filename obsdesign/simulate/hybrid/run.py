"""A simulated run of an observer with sporadic measurements."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.simulate.hybrid.sampling import Schedule
from obsdesign.simulate.integrate import Status
from obsdesign.simulate.run import hatted
from obsdesign.simulate.validity import Leaving


@dataclass(frozen=True)
class HybridSamples:
    """Signals at the times t, one row a time; j distinguishes the rows before and after a measurement.

    The error is eps = z - zhat as it was integrated, not the rounded difference of the columns here. Before the first
    measurement y holds what the observer supposes, C zhat(0) + theta(0). V and its bounds are None without a guarantee.
    """

    t: Array  # (N,), s
    j: Array  # (N,), number of measurements received so far
    z: Array  # (N, n)
    zhat: Array  # (N, n)
    eps: Array  # (N, n)
    theta: Array  # (N, ny)
    distance: Array  # (N,): |x|_A, the length of (eps, C eps - theta)
    timer: Array  # (N,), s, to the next measurement, at most what T2 leaves
    w: Array  # (N, nw)
    y: Array  # (N, ny), as last received
    yp: Array  # (N, np), performance output Cp eps
    V: Array | None  # (N,)
    V_bound: Array | None  # (N,)
    distance_bound: Array | None  # (N,), that of V, read as a bound on |x|_A

    def rows(self, which: Array) -> "HybridSamples":
        """Return the same at some of the times."""
        chosen: dict[str, Any] = {k: None if column is None else column[which] for k, column in vars(self).items()}
        return HybridSamples(**chosen)


@dataclass(frozen=True)
class HybridRun(HybridSamples):
    """Evenly spaced samples of a run up to its horizon, an escape or a stall, and its steps.

    The steps are finer than the intervals between measurements and hold the state before and after each; a sample
    at the instant of a measurement is the state after it.
    """

    steps: HybridSamples
    schedule: Schedule  # of the measurements
    states: tuple[str, ...]
    exogenous: tuple[str, ...]
    outputs: tuple[str, ...]
    status: Status
    time: float  # s, where the run ended
    left: tuple[Leaving, ...]  # first leavings of the regions on which the declared types hold
    until: float  # s, from when on the guarantee says nothing; infinite: never
    summary: Mapping[str, Any]

    def table(self) -> tuple[list[str], Array]:
        """Header and rows: t, each state, hat_ each state, each w, each y as last received, measurements so far."""
        header = ["t", *self.states, *hatted(self.states), *self.exogenous, *self.outputs, "received"]
        columns = [self.t[:, None], self.z, self.zhat, self.w, self.y, self.j[:, None]]
        return header, np.hstack(columns)
