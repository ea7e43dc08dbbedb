"""What a run shows, as charts: estimates with the truth, their errors with the proved bound, outputs and inputs."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from obsdesign.disk import LARGEST, content_of
from obsdesign.errors import Problem, UsageError
from obsdesign.lmi.formula import Array
from obsdesign.records import dataclass
from obsdesign.reports.chart import FARTHEST, Chart, Curve, Look, of_errors, over_time
from obsdesign.spec import Spec

if TYPE_CHECKING:
    from obsdesign.simulate import Run

MOST = 6  # charts of one kind
LOOKS: tuple[Look, ...] = ("line", "line", "dashed")  # of errors beside each other


@dataclass(frozen=True)
class Signals:
    """Signals of a run by their names in its CSV file; of a run that was made here, what is proved of it too."""

    t: Array
    columns: Mapping[str, Array]
    bounded: tuple[str, Array, Array] | None = None  # what is bounded, its values, and the proved bound

    @classmethod
    def of(cls, run: "Run") -> "Signals":
        """Those of a run."""
        if run.distance_bound is not None:
            return cls(run.t, run.columns, (run.length, run.distance, run.distance_bound))
        stored = None if run.V is None or run.V_bound is None else ("V(e)", run.V, run.V_bound)
        return cls(run.t, run.columns, stored)

    @classmethod
    def read(cls, path: str, spec: Spec) -> "Signals":
        """Read a CSV file of `simulate`. Raises `UsageError`: it cannot be read, or is not one of this plant."""
        text = content_of(path, LARGEST).decode(errors="replace")
        needed = {"t", *spec.plant.states, *(f"hat_{name}" for name in spec.plant.states)}
        try:
            header, *rows = csv.reader(io.StringIO(text))
            table = np.array(rows, dtype=float)
        except (ValueError, csv.Error):
            raise UsageError(Problem("is no table of numbers", path, id="OBS808")) from None
        if missing := sorted(needed.difference(header)):
            raise UsageError(Problem(f"has no column {missing[0]}: it is no run of this plant", path, id="OBS808"))
        if table.ndim != 2 or table.shape[1] != len(header) or len(table) < 2 or not (abs(table) < FARTHEST).all():
            raise UsageError(Problem("holds no samples, or some that are not finite", path, id="OBS808"))
        columns = dict(zip(header, table.T, strict=True))
        return cls(columns["t"], columns)

    def curves(self, name: str) -> list[Curve]:
        """A signal and its estimate, if there is one."""
        truth = [Curve(name, self.columns[name], color=1)]
        hat = self.columns.get(f"hat_{name}")
        return truth if hat is None else [*truth, Curve(f"estimate of {name}", hat, "dashed", 2)]

    def error(self, name: str) -> Array:
        """Error of an estimate."""
        return self.columns[f"hat_{name}"] - self.columns[name]


def charts(signals: Signals, spec: Spec) -> Iterator[Chart]:
    """Charts in the order in which an engineer asks: what counts, its error, what is measured, what acts, the rest.

    An input that is always zero has none.
    """
    known = signals.columns
    signalled = [n for n in (*spec.plant.states, *spec.plant.exogenous) if n in known and f"hat_{n}" in known]
    wanted = [n for n in spec.H_names if n in signalled] or signalled
    yield from (estimates(signals, spec, name) for name in wanted[:MOST])
    yield errors(signals, spec, wanted[:MOST])
    yield from bound(signals)
    acting = (spec.inputs, "known input"), (spec.plant.exogenous, "unknown input")
    for names, what in ((spec.plant.outputs, "measured"), *acting):
        shown = [name for name in names if name in known and name not in wanted[:MOST]]
        told = [name for name in shown if what == "measured" or any(curve.y.any() for curve in signals.curves(name))]
        yield from (over_time(f"{name}, {what}", label(spec, name), signals.t, signals.curves(name)) for name in told)
    rest = [name for name in signalled if name in spec.plant.states and name not in wanted]
    yield from (estimates(signals, spec, name) for name in rest[:MOST])


def estimates(signals: Signals, spec: Spec, name: str) -> Chart:
    """A signal with its estimate."""
    return over_time(f"{name} and its estimate", label(spec, name), signals.t, signals.curves(name))


def errors(signals: Signals, spec: Spec, names: Sequence[str]) -> Chart:
    """Absolute errors of estimates."""
    every = [(name, signals.error(name), LOOKS[i % len(LOOKS)]) for i, name in enumerate(names)]
    curves = [
        Curve(f"error of {name}" + ("" if e.any() else ": none"), e, look, i)
        for i, (name, e, look) in enumerate(every, start=1)
    ]
    units = {spec.units.get(name, "") for name in names}
    unit = units.pop() if len(units) == 1 else ""
    return of_errors("Absolute errors", f"|error| [{unit}]" if unit else "|error|", signals.t, curves)


def bound(signals: Signals) -> Iterator[Chart]:
    """What is proved of a run against what it does."""
    if signals.bounded is not None:
        name, values, limit = signals.bounded
        curves = [Curve(name, values, color=1), Curve("proved bound", limit, "dotted", 8)]
        yield of_errors(f"{name} and its proved bound", name, signals.t, curves)


def label(spec: Spec, name: str) -> str:
    """Name and unit."""
    unit = spec.units.get(name)
    return f"{name} [{unit}]" if unit else name
