"""A simulated run: what was true, what was estimated, and how the two compare."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.simulate.integrate import Status
from obsdesign.simulate.validity import Leaving


@dataclass(frozen=True)
class Samples:
    """Signals at the times t, one row a time.

    The error is e = xihat - xi as it was integrated, not the rounded difference of the columns here. Where no
    v generates the given w, the states xm of the disturbance model have no true value: then xi and e hold the
    plant's states only, and v, V, V_bound and, if H needs xm, z are None.
    """

    t: Array  # (N,), s
    xi: Array  # (N, n + nm)
    xihat: Array  # (N, n + nm)
    e: Array  # (N, n + nm)
    w: Array  # (N, nw)
    what: Array  # (N, len(estimated))
    w_error: Array  # (N, len(estimated)): what - w, without cancellation where xm has a true value
    q: Array  # (N, nq), arguments of f in the plant
    qhat: Array  # (N, nq), in the observer
    y: Array  # (N, ny), as measured: with noise
    v: Array | None  # (N, nv)
    z: Array | None  # (N, nz)
    V: Array | None  # (N,)
    V_bound: Array | None  # (N,)

    def rows(self, which: Array) -> "Samples":
        """Return the same at some of the times."""
        chosen: dict[str, Any] = {k: None if column is None else column[which] for k, column in vars(self).items()}
        return Samples(**chosen)


@dataclass(frozen=True)
class Run(Samples):
    """Samples of a run up to its horizon, an escape or a stall, and the same at the steps of the integrator.

    The steps resolve what evenly spaced samples miss, such as a peak within a millisecond.
    """

    steps: Samples
    states: tuple[str, ...]  # names of the columns of xihat; of xi and e as far as they go
    plant_states: int  # how many of these are the plant's
    exogenous: tuple[str, ...]
    estimated: tuple[int, ...]  # channels of w that the observer estimates, by its model or by reconstruction
    outputs: tuple[str, ...]
    status: Status
    time: float  # s, where the run ended
    left: tuple[Leaving, ...]  # first leavings of the regions on which the declared types hold
    summary: Mapping[str, Any]

    def table(self) -> tuple[list[str], Array]:
        """Header and rows: t, each state, hat_ each state, each w, hat_ each estimated w, each y."""
        n = self.plant_states
        states, estimated = self.states[:n], [self.exogenous[i] for i in self.estimated]
        header = ["t", *states, *hatted(states), *self.exogenous, *hatted(estimated), *self.outputs]
        columns = [self.t[:, None], self.xi[:, :n], self.xihat[:, :n], self.w, self.what, self.y]
        return header, np.hstack(columns)


def hatted(names: Sequence[str]) -> list[str]:
    """Names of estimates."""
    return [f"hat_{name}" for name in names]
