"""An observer on a log of any length: estimates, radii, innovations, row by row."""

import os
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import IO, Any, Literal

import numpy as np

from obsdesign.data.coverage import Coverage
from obsdesign.data.escape import Outlying
from obsdesign.data.innovations import Innovations
from obsdesign.data.intervals import Intervals
from obsdesign.data.late import Delays, History
from obsdesign.data.log import REPAIRED, Log
from obsdesign.data.radius import Radius, radius
from obsdesign.data.rows import Rows
from obsdesign.data.runner import Passed, Runner, agree, runner
from obsdesign.data.thinned import Thinned
from obsdesign.design import Design
from obsdesign.disk import whole
from obsdesign.errors import Problem, UndecidedError, UsageError
from obsdesign.lmi.formula import Array, Float, rational_number
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec
from obsdesign.stepping.implemented import implemented
from obsdesign.trial import Implementation

NOTHING: Mapping[str, str] = MappingProxyType({})
MOST = 1_000_000  # steps between two rows
FINEST = 2**14  # parts of the time between rows, beyond which a spec must tell its steps


@dataclass(frozen=True)
class Part:
    """Estimates of some rows."""

    t: Float  # (K,), s
    estimates: Float  # (K, ne)
    innovations: Float  # (K, ny); NaN where y is missing
    radii: Float  # (K, names of the radius)
    covered: Array  # (K,), whether a local guarantee still holds
    truth: Float  # (K, m), of what the log knows of the plant beside u and y

    def table(self) -> Float:
        """Columns side by side, as in the file."""
        return np.column_stack([self.t, self.estimates, self.innovations, self.radii, self.covered])


class Estimation:
    """A design on a log; `parts` runs it, once, and `report` is what is said of it then.

    Raises `UsageError`: see `Log`; the observer cannot be written in steps.
    """

    def __init__(self, design: Design, log: Log) -> None:
        self.design, self.log, self.spec = design, log, design.spec
        self.observer = design.observer
        self.first = log.where.hold == "first"
        self.innovations = Innovations(self.observer.outputs)
        self.radius = radius(design, log.where, self.names)
        self.rows = self.missing = self.late = self.lost = self.uncovered = self.contradicted = self.bounded = 0
        self.first_contradicted: dict[str, Any] = {}
        self.waited, self.begins_with = 0, tuple[str, ...]()  # rows before the first that has these outputs
        self.engine, self.delays = "", Delays()
        self.step = self.coarsest = 0.0  # s, between rows; 0: that of the spec
        self.coverage, self.outlying, self.intervals = Coverage(design), Outlying(self.observer.outputs), Intervals()
        self.start: Runner | None = None  # the observer before the first row

    @property
    def names(self) -> tuple[str, ...]:
        """What is estimated."""
        return tuple(self.observer.estimates)

    @cached_property
    def header(self) -> list[str]:
        """Heads of the columns."""
        radii = self.radius.names if not isinstance(self.radius, str) else ()
        heads = [[f"hat_{n}" for n in self.names], [f"innov_{y}" for y in self.observer.outputs]]
        return ["t", *heads[0], *heads[1], *(f"radius_{n}" for n in radii), "covered"]

    def parts(self) -> Iterator[Part]:
        """Estimates, some rows at a time."""
        before: Rows | None = None
        made: Runner | None = None
        history: History | None = None
        for block in self.log.rows():
            if made is None:
                made = self.begun(block)
                self.engine, self.start, self.begins_with = made.engine, made.copied(), made.one.begins_with
                history = History(made, self.first) if self.late_ones else None
            if early := self.before_begin(block):
                yield self.waiting(block.cut(0, early))
            if not len((rows := block.cut(early)).t):
                continue
            joined, begin = rows, 0
            if history is not None:
                history, passed = self.taken(history, rows)
                self.late, self.lost = history.late, history.lost
            else:
                if before is not None:
                    joined, begin = Rows(*(np.concatenate(p) for p in zip(before, rows, strict=True))), 1
                made, passed = self.advanced(made, joined, begin)
            estimates, expected, arguments = (part[begin : passed.rows] for part in passed[:3])
            escaped = self.escaped(joined, passed.rows) if passed.rows < len(joined.t) else None
            self.outlying = self.outlying.with_rows(rows)
            yield self.part(rows, Passed(estimates, expected, arguments, passed.rows))
            if escaped is not None:
                raise escaped
            before = rows.cut(-1)
        if made is None:
            raise UsageError(Problem("has no rows", self.log.table.path, id="OBS811"))
        if self.rows == self.waited:
            said = f"no row has {' and '.join(self.begins_with)}, with which this observer begins"
            raise UsageError(Problem(f"{said}; give one that does", self.log.table.path, id="OBS975"))

    def before_begin(self, rows: Rows) -> int:
        """How many rows are before the first that has each output with which the observer begins; 0 once it has."""
        if self.rows > self.waited or not self.begins_with:
            return 0
        places = [self.observer.outputs.index(name) for name in self.begins_with]
        able = np.isfinite(rows.y[:, places]).all(axis=1)
        return int(np.argmax(able)) if able.any() else len(rows.t)

    def waiting(self, rows: Rows) -> Part:
        """Rows before the observer begins, without estimates."""
        K = len(rows.t)
        for name in ("rows", "waited", "missing", "uncovered"):
            setattr(self, name, getattr(self, name) + K)
        self.coverage.end("the observer does not begin yet", int(rows.lines[0]))
        estimates, innovations, radii = (
            np.full((K, n), np.nan) for n in (len(self.names), rows.y.shape[1], self.width)
        )
        return Part(rows.known, estimates, innovations, radii, np.zeros(K, dtype=bool), rows.truth)

    @property
    def width(self) -> int:
        """Number of radii."""
        return 0 if isinstance(self.radius, str) else len(self.radius.names)

    def escaped(self, rows: Rows, count: int) -> UndecidedError:
        """Error after so many rows, with the value that stands out, if one does."""
        said = "the observer has no finite value after this row" + self.outlying.cause(rows, count)
        return UndecidedError(Problem(said, self.log.table.path, int(rows.lines[max(count - 1, 0)]), id="OBS813"))

    def taken(self, history: History, rows: Rows) -> tuple[History, Passed]:
        """Take rows, some of them late; steps, where the spec tells none, are found by halving."""
        while True:
            one, other = history.copied(), history.copied()
            found = one.run(rows, self.step)
            if not self.step:
                return one, found
            finer = other.run(rows, self.step / 2)
            if finer.rows == found.rows and agree(found.estimates, finer.estimates):
                return one, found
            self.refine(rows)

    def refine(self, rows: Rows) -> None:
        """Halve the step; raises `UndecidedError` where it is short already for these rows."""
        self.step /= 2
        if self.step * FINEST < self.coarsest:
            said = "however short its steps are, halving them changes its estimates: it is too fast here, or escapes"
            said += "; write implementation: {period: .., method: exact}, or mend the log"
            said += self.outlying.cause(rows, len(rows.t))
            raise UndecidedError(Problem(said, self.log.table.path, id="OBS813"))

    @property
    def late_ones(self) -> bool:
        """Whether measurements may come late and are taken at their own time."""
        return bool(self.log.where.arrival and self.observer.jump)

    def begun(self, rows: Rows) -> Runner:
        """Observer at its start, in the steps of the spec, or in steps that are found."""
        if self.spec.period is not None or self.spec.implementation is not None:
            return runner(implemented(self.spec, self.observer))
        gaps = np.diff(np.unique(rows.t if self.late_ones else rows.known))
        self.coarsest = self.step = float(np.median(gaps)) if len(gaps) else 1.0
        alone = replace(self.observer, correction=None)
        return runner(implemented(self.spec, alone, Implementation(rational_number(self.step), "rk4")))

    def advanced(self, made: Runner, rows: Rows, begin: int) -> tuple[Runner, Passed]:
        """Go along rows; where the spec tells no steps, in such that halving them changes no estimate by 1e-6."""
        longest = float(np.diff(rows.known).max(initial=0.0))
        period = self.step or float(made.one.period.p) / float(made.one.period.q)
        if longest > MOST * period:
            line = int(rows.lines[int(np.argmax(np.diff(rows.known))) + 1])
            said = f"{longest:.6g} s after the row before, which is more than {MOST:,} steps of {period:.3g} s"
            raise UndecidedError(Problem(said, self.log.table.path, line, id="OBS813"))
        if not self.step:
            return made, made.run(rows.known, rows.u, rows.y, begin, self.first)

        def run(h: float) -> tuple[Runner, Passed]:
            one = made.copied()
            return one, one.run(rows.known, rows.u, rows.y, begin, self.first, h)

        _, found = run(self.step)
        while True:
            one, finer = run(self.step / 2)
            if finer.rows == found.rows and agree(found.estimates[begin:], finer.estimates[begin:]):
                return one, finer
            found = finer
            self.refine(rows)

    def part(self, rows: Rows, passed: Passed) -> Part:
        """Rows as they are written, and counted."""
        K = len(passed.estimates)
        rows = Rows(*(part[:K] for part in rows))
        y, fresh = rows.y, self.delays.timely(rows) if not self.late_ones else np.ones(K, dtype=bool)
        innovations = np.where(rows.held[:, None], np.nan, y - passed.expected)
        self.innovations.add(innovations)
        self.innovations.measured(y)
        first, self.rows = self.rows, self.rows + K
        self.missing += int(np.isnan(y).any(axis=1).sum())
        t = rows.t if self.late_ones else rows.known
        radii, spread = np.zeros((K, 0)), np.zeros(passed.arguments.shape)
        if not isinstance(self.radius, str):
            radii, spread = self.radius.along(first, t, np.asarray(np.isfinite(y).any(axis=1)))
        if self.spec.period is None and not self.observer.jump:
            self.intervals.add(t, rows.lines)
        covered = self.coverage.of(rows._replace(t=t), passed.arguments, spread, fresh)
        radii = np.where(covered[:, None], radii, np.nan)
        self.bounded += int(covered.sum())
        if isinstance(self.radius, Radius):
            beyond = np.flatnonzero(covered & self.radius.contradicted(innovations, np.arange(first, first + K)))
            if len(beyond) and not self.contradicted:
                self.first_contradicted = {"line": int(rows.lines[beyond[0]]), "t": float(t[beyond[0]])}
            self.contradicted += len(beyond)
        self.uncovered += int((~covered).sum())
        return Part(t, passed.estimates, innovations, radii, covered, rows.truth)

    @property
    def reason(self) -> dict[str, str]:
        """Premise of the radii, or why no row has one."""
        if isinstance(self.radius, str):
            return {"none": self.radius}
        return {"premise": self.radius.premise} if self.bounded else {"none": self.coverage.why}

    def report(self) -> dict[str, Any]:
        """What is said of the log."""
        told = {name: count for name, count in self.log.counts.items() if count and name in REPAIRED}
        return {
            "rows": self.rows,
            "missing": self.missing,
            "late": self.late or self.delays.unused,
            **({"lost": lost} if (lost := self.lost or self.delays.unused) else {}),
            **self.delays.report(),
            **({"gaps": gaps} if (gaps := self.log.counts["gaps"]) else {}),
            **self.intervals.report(),
            **self.outlying.report(),
            **({"waited": {"rows": self.waited, "for": [*self.begins_with]}} if self.waited else {}),
            "engine": self.engine,
            "step": self.step or None,
            "uncovered": self.uncovered,
            **({"contradicted": self.contradicted} if self.contradicted else {}),
            **({"first_contradicted": first} if (first := self.first_contradicted) else {}),
            "radius": self.reason,
            "innovations": self.innovations.report(),
            **({"repaired": told} if told else {}),
        }


@dataclass(frozen=True, repr=False)
class Estimates:
    """Estimates on a log: `estimates["hat_theta"]` is a column by its head, of all rows where these are held here.

    `report`: what is said of them, as `--json`. Of estimates that were written to a file some rows are held.
    """

    name: str
    header: list[str]
    rows: Float  # (K, header)
    report: dict[str, Any]
    units: Mapping[str, str]  # of the signals

    def __getitem__(self, name: str) -> Float:
        """Return a column by its head."""
        if name not in self.header:
            raise UsageError(f"{name!r} is no column; there are {', '.join(self.header)}", id="OBS203")
        return np.asarray(self.rows[:, self.header.index(name)])

    def plot(self, path: str | None = None) -> bytes:
        """Draw them, and write the figure where a path is given: as SVG if this ends so, else as PNG."""
        from obsdesign.disk import write_whole
        from obsdesign.plot import form_of
        from obsdesign.plot.estimates import estimates_figure

        figure = estimates_figure(self.name, self.header, self.rows, self.report, self.units, form=form_of(path))
        if path is not None:
            write_whole(path, figure)
        return figure

    def __repr__(self) -> str:
        return f"<estimates of {self.name!r}: {self.report['rows']} rows>"


def estimate(
    source: "Design | Spec | str | os.PathLike[str]",
    data: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    columns: Mapping[str, str] = NOTHING,
    hold: Literal["zero", "first"] | None = None,
    repair: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Estimates:
    """Run the observer of a result on a log: one row of estimates a row of the log.

    `source`: a design, or the path of a result file or of a spec, which is solved first; `data`: path of the log (CSV,
    or Parquet where pyarrow is installed); `output`: path of the estimates as CSV, so that they need not be held;
    `columns`: heads of columns by signal, where they are not its name; `hold`: u and y between rows; `repair`: put rows
    in order of time, and leave out those without a time of their own; `progress`: called with the share that is done.

    Raises `UsageError`: there are no gains, a column is missing or in another unit, times do not rise;
    `UndecidedError`: the observer has no finite value on the log.
    """
    from obsdesign.work import trial

    design = trial(source)
    with design.spec.placed():
        made = Estimation(design, Log.of(os.fspath(data), design.spec, columns, hold, repair=repair))
        if output is None:
            rows = [part.table() for part in told(made, progress)]
            return Estimates(design.spec.name, made.header, np.vstack(rows), made.report(), design.spec.units)
        with whole(os.fspath(output)) as file:
            return written(made, file, progress)


def written(made: Estimation, file: IO[bytes], progress: Callable[[float], None] | None = None) -> Estimates:
    """Write the estimates of a log as CSV, some rows at a time; those that a figure shows are kept."""
    file.write((",".join(made.header) + "\n").encode())
    line, thinned = ",".join(["%.15g", *["%.12g"] * (len(made.header) - 1)]) + "\n", Thinned()
    for part in told(made, progress):
        table = part.table()
        thinned.add(table)
        text = (line * len(table)) % tuple(table.ravel().tolist())
        file.write(text.replace("nan", "").encode())
    return Estimates(made.spec.name, made.header, thinned.rows, made.report(), made.spec.units)


def told(made: Estimation, progress: Callable[[float], None] | None) -> Iterator[Part]:
    """Parts of the estimates, after each of which it is told how much of the log is read."""
    for part in made.parts():
        yield part
        if progress is not None:
            progress(made.log.table.share)
