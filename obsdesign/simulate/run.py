"""A simulated run: what was true, what was estimated, and how the two compare."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from typing import Any

import numpy as np

from obsdesign.errors import UsageError
from obsdesign.families.guarantee import Guarantee
from obsdesign.lmi.formula import Array
from obsdesign.model.equations import free
from obsdesign.records import dataclass
from obsdesign.simulate.integrate import Status
from obsdesign.simulate.sampling import Schedule
from obsdesign.simulate.validity import Leaving
from obsdesign.spec import Spec


@dataclass(frozen=True)
class Samples:
    """Signals at the times t, one row a time.

    The error is e = xihat - xi as it was integrated, not the rounded difference of the columns here. Where no
    v generates the given w, the states xm of the disturbance model have no true value: then xi and e hold the
    plant's states only, and v, V, V_bound and, if H needs xm, z are None.

    Where measurements arrive at instants, j distinguishes the rows before and after each, y is the one last received
    (before the first: what the observer supposes), and the distance is |(e, d)|, the length of (e, theta~), with theta~
    what a measurement without noise would add to the further states theta of the observer; without any it is |e|.
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
    u: Array  # (N, nu), known inputs
    y: Array  # (N, ny), as measured: with noise
    y_true: Array  # (N, ny), without noise, also where it is not measured
    theta: Array  # (N, further states of the observer)
    v: Array | None  # (N, nv)
    z: Array | None  # (N, nz)
    V: Array | None  # (N,)
    V_bound: Array | None  # (N,)
    j: Array  # (N,), number of measurements received so far
    timer: Array  # (N,), s, to the next measurement, at most what T2 leaves; infinite where there is none
    distance: Array  # (N,): |(e, d)|, or |e|
    distance_bound: Array | None  # (N,), that of V, read as a bound on it

    @property
    def length(self) -> str:
        """What `distance` is."""
        return "|(e, d)|" if self.theta.shape[1] else "|e|"

    def rows(self, which: Array) -> "Samples":
        """Return the same at some of the times."""
        columns = {field.name: getattr(self, field.name) for field in fields(Samples)}
        chosen: dict[str, Any] = {k: None if column is None else column[which] for k, column in columns.items()}
        return Samples(**chosen)


@dataclass(frozen=True, repr=False)
class Run(Samples):
    """Samples of a run up to its horizon, an escape or a stall, and the same at the steps of the integrator.

    The steps resolve what evenly spaced samples miss, such as a peak within a millisecond; they hold the state before
    and after each measurement. A sample at the instant of a measurement is the state after it.

    `run["hat_theta"]` is a signal by its name in the CSV file, (N,).
    """

    steps: Samples
    spec: Spec
    guarantee: Guarantee | None  # what the run is held against
    schedule: Schedule | None  # of the measurements, where y is known at instants only
    states: tuple[str, ...]  # names of the columns of xihat; of xi and e as far as they go
    plant_states: int  # how many of these are the plant's
    exogenous: tuple[str, ...]
    estimated: tuple[int, ...]  # channels of w that the observer estimates, by its model or by reconstruction
    outputs: tuple[str, ...]
    status: Status
    time: float  # s, where the run ended
    left: tuple[Leaving, ...]  # first leavings of the regions on which the declared types hold
    until: float  # s, from when on the guarantee says nothing; infinite: never
    summary: Mapping[str, Any]

    def table(self) -> tuple[list[str], Array]:
        """Header and rows: t, each state, hat_ each state, each w, hat_ each estimated w, each y, each u.

        The noise_ of each y comes last where simulation.noise is in it. Where measurements arrive at instants, y is the
        one last received, and their number so far comes before u.
        """
        n = self.plant_states
        states, estimated = self.states[:n], [self.exogenous[i] for i in self.estimated]
        header = ["t", *states, *hatted(states), *self.exogenous, *hatted(estimated), *self.outputs]
        columns = [self.t[:, None], self.xi[:, :n], self.xihat[:, :n], self.w, self.what, self.y]
        if self.schedule is not None:
            header, columns = [*header, "received"], [*columns, self.j[:, None]]
        header, columns = [*header, *self.spec.inputs], [*columns, self.u]
        if self.schedule is None and (self.y != self.y_true).any():
            taken = set(header)
            header = [*header, *(free(f"noise_{name}", taken) for name in self.outputs)]
            columns = [*columns, self.y - self.y_true]
        return header, np.hstack(columns)

    @cached_property
    def columns(self) -> Mapping[str, Array]:
        """Signals by their names in the CSV file."""
        header, rows = self.table()
        return dict(zip(header, rows.T, strict=True))

    def __repr__(self) -> str:
        return f"<run of {self.spec.name!r}: {self.status} at t = {self.time:g} s, {len(self.t)} samples>"

    def __getitem__(self, name: str) -> Array:
        """Return a signal by its name in the CSV file, (N,)."""
        if name not in self.columns:
            raise UsageError(f"{name!r} is no signal of this run; it has {', '.join(self.columns)}", id="OBS203")
        return self.columns[name]

    def plot(self, path: str | None = None, *, every: bool = False) -> bytes:
        """Draw the run, and write it where a path is given: as SVG if this ends so, else as PNG.

        At most four panels tell what the spec wants to know; `every` adds the others: all states and inputs, V, ..
        Raises `UsageError` if the file cannot be written.
        """
        from obsdesign.disk import write_whole
        from obsdesign.plot import form_of, run_figure

        figure = run_figure(self, every=every, form=form_of(path))
        if path is not None:
            write_whole(path, figure)
        return figure


def hatted(names: Sequence[str]) -> list[str]:
    """Names of estimates."""
    return [f"hat_{name}" for name in names]
