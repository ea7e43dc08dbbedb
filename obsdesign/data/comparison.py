"""Several observers on one log: innovations, and errors where the log knows the truth."""

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from obsdesign.data.driver import ROUNDING
from obsdesign.data.estimation import NOTHING, Estimation, told
from obsdesign.data.innovations import Innovations
from obsdesign.data.log import Log
from obsdesign.data.rows import Rows
from obsdesign.data.thinned import Thinned
from obsdesign.design import Design
from obsdesign.errors import Problem, UndecidedError, UsageError
from obsdesign.families import FAMILIES
from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass, field
from obsdesign.simulate.comparison import WINDOW, Comparison, shared, told_apart
from obsdesign.simulate.summary import SHARES
from obsdesign.spec import Spec
from obsdesign.work import compare as compared
from obsdesign.work import trial

if TYPE_CHECKING:
    from obsdesign.dissipation.engine import Report

TIMED, LEAST = 5000, 0.05  # rows, and CPU time in s, from which that of a step is taken


@dataclass
class Errors:
    """Sizes of errors of rows that come some at a time.

    error_rms   root of the mean of their squares, over the rows of the window
    t5, t1      times from the first row on after which |error| stays below 5 % and 1 % of that of the first row
    """

    names: tuple[str, ...]
    window: tuple[float, float]
    begin: float  # s, of the first row
    count: Float = field(init=False)
    squares: Float = field(init=False)
    first: Float = field(init=False)
    below: dict[str, Float] = field(init=False)  # times of the rows from which on it is below these shares of the first

    def __post_init__(self) -> None:
        m = len(self.names)
        self.count, self.squares = np.zeros(m), np.zeros(m)
        self.first, self.below = np.full(m, np.nan), {name: np.full(m, np.nan) for name in SHARES}

    def add(self, t: Float, e: Float) -> None:
        """Take errors (K, names) at times (K,)."""
        inside = (t >= self.window[0]) & (t <= self.window[1])
        with np.errstate(over="ignore"):
            self.squares += np.nansum(np.where(inside[:, None], e, np.nan) ** 2, axis=0)
        self.count += (inside[:, None] & np.isfinite(e)).sum(axis=0)
        for i, column in enumerate(e.T):
            known = np.flatnonzero(np.isfinite(column))
            if not len(known):
                continue
            if np.isnan(self.first[i]):
                self.first[i] = abs(column[known[0]])
            for name, share in SHARES.items():
                high = np.flatnonzero(np.abs(column[known]) > share * self.first[i])
                after = known[high[-1] + 1 :] if len(high) else known
                if len(high) or np.isnan(self.below[name][i]):
                    self.below[name][i] = t[after[0]] if len(after) else np.nan

    def report(self) -> dict[str, dict[str, float | None]]:
        """Entries by name; None where nothing is known, or an error does not stay below a level."""
        return {name: {"error_rms": self.rms(i), **self.times(i)} for i, name in enumerate(self.names)}

    def rms(self, i: int) -> float | None:
        """Rms of an error in the window."""
        found = math.sqrt(self.squares[i] / self.count[i]) if self.count[i] else math.nan
        return found if math.isfinite(found) else None

    def times(self, i: int) -> dict[str, float | None]:
        """Settling times of an error, to the row; 0 where there is none at first."""
        if self.first[i] == 0:
            return dict.fromkeys(SHARES, 0.0)
        return {name: None if np.isnan(at[i]) else float(at[i]) - self.begin for name, at in self.below.items()}


@dataclass(frozen=True)
class Cost:
    """CPU time of the first rows of a log, reading left out, and how many steps it is spent on."""

    row: float  # s
    steps: float  # of the observer in a row

    @property
    def written(self) -> dict[str, float]:
        """Entries of a report."""
        return {"time_s": self.row / self.steps, "steps_a_row": self.steps, "row_s": self.row}


@dataclass(frozen=True)
class LogEntrant:
    """One observer on a log, and what was found of it."""

    label: str
    design: Design
    order: int
    truth: tuple[str, ...]  # estimates that the log knows
    errors: Errors
    innovations: Innovations  # in the window
    rows: Float  # some rows for a figure: t, estimates, innovations, truth
    heads: tuple[str, ...]
    counts: Mapping[str, Any]
    cost: Cost | None  # None where no step is taken on its own
    run: str  # done, or why it ended

    @property
    def said(self) -> dict[str, str | None]:
        """What is proved of it in words; None where nothing is. A log is held against no bound."""
        claim, spec = self.design.claim, self.design.spec
        if not (self.design.proved and claim):
            return {"statement": None, "claim": None}
        of_steps = [] if self.followed else ["of its steps along a log nothing is proved"]
        said = "; ".join([claim.headline(spec), *spec.provisos, *of_steps])
        return {"statement": claim.statement(spec), "claim": said}

    @property
    def followed(self) -> bool:
        """Whether a log is followed as what is proved says: in samples, or from measurement to measurement, to 1e-6."""
        spec = self.design.spec
        return spec.period is not None or (FAMILIES[spec.observer.type].sampled and spec.implementation is None)

    def column(self, head: str) -> Float | None:
        """Some rows of a column; None where there is none."""
        return self.rows[:, self.heads.index(head)] if head in self.heads else None

    def written(self) -> dict[str, Any]:
        """Entry of a report."""
        return {
            "name": self.design.spec.name,
            "label": self.label,
            "file": self.design.path,
            "type": self.design.spec.observer.type,
            "status": str(self.design.status),
            **self.said,
            "order": self.order,
            "run": self.run,
            **self.counts,
            **self.innovations.sizes(),
            "states": self.errors.report(),
            **(self.cost.written if self.cost else dict.fromkeys(("time_s", "steps_a_row", "row_s"))),
        }


@dataclass(frozen=True)
class LogComparison:
    """Observers side by side on a log: `report` (as `--json`), `plot(path)`, and a table as its text."""

    path: str
    span: tuple[float, float]  # s
    window: tuple[float, float]
    rows: int
    entrants: tuple[LogEntrant, ...]

    @cached_property
    def report(self) -> Mapping[str, Any]:
        """Everything that is said of them, as `--json`; `time_s` and `row_s` differ between two runs."""
        known = dict.fromkeys(name for one in self.entrants for name in one.truth)
        return {
            "plant": {"name": self.entrants[0].design.spec.name},
            "data": {"file": self.path, "rows": self.rows, "span": list(self.span), "truth": list(known)},
            "window": list(self.window),
            "observers": [one.written() for one in self.entrants],
        }

    @property
    def title(self) -> str:
        """What the names of all have in common, or the first."""
        names = [one.design.spec.name for one in self.entrants]
        return shared(names) or names[0]

    def plot(self, path: str | None = None) -> bytes:
        """Draw estimates, errors or innovations, and write them where a path is given: SVG if it ends so, else PNG."""
        from obsdesign.disk import write_whole
        from obsdesign.plot import form_of
        from obsdesign.plot.recorded import recorded_figure

        figure = recorded_figure(self, form=form_of(path))
        if path is not None:
            write_whole(path, figure)
        return figure

    def __str__(self) -> str:
        from obsdesign.tables.recorded import recorded_table

        return recorded_table(self.report)


def compare(
    sources: "Sequence[Design | Spec | str | os.PathLike[str]]",
    seeds: int = 10,
    solver: str = "clarabel",
    report: "Report" = lambda *_: None,
    *,
    data: str | os.PathLike[str] | None = None,
    columns: Mapping[str, str] = NOTHING,
    hold: Literal["zero", "first"] | None = None,
    repair: bool = False,
) -> Comparison | LogComparison:
    """Run several observers on one plant, or on one log of it; of any families.

    `sources`: designs, specs, which are solved first, or paths of spec and result files; `seeds`: runs with noise of
    each, without a log; `data`: path of a log, as `estimate` takes it, with `columns`, `hold` and `repair`; a column
    with the name of a state or disturbance, or one that is named for it, is its truth. Returns a comparison: `report`
    (as `--json`), `plot(path)`, and a table as its text.

    Raises `UsageError`: their plants, or what acts on them, differ; a column is missing; there are no gains;
    `InfeasibleError`: a spec has no solution.
    """
    if data is None:
        return compared(sources, seeds, solver, report)
    if not sources:
        raise UsageError("nothing to compare; give at least one design, spec or path", id="OBS904")
    designs = [trial(source, "", solver, report) for source in sources]
    require_signals([design.spec for design in designs])
    require_known(designs, columns)
    return on_log(designs, os.fspath(data), columns, hold, repair, report)


def require_signals(specs: Sequence[Spec]) -> None:
    """Refuse observers that do not take the same signals."""
    first = specs[0]
    for spec in specs:
        for what, one, other in (
            ("outputs", first.plant.outputs, spec.plant.outputs),
            ("inputs", first.inputs, spec.inputs),
        ):
            if sorted(one) != sorted(other):
                here, there = (", ".join(sorted(names)) or "empty" for names in (other, one))
                said = f"the list of {what} is {here}, but {there} in {first.path}; observers on one log take the same"
                raise UsageError(spec.located(Problem(said, key=f"system.{what}", id="OBS805")))


def require_known(designs: Sequence[Design], columns: Mapping[str, str]) -> None:
    """Refuse a column of what no observer estimates and none takes."""
    known = dict.fromkeys(("t", "arrival", *designs[0].spec.plant.outputs, *designs[0].spec.inputs))
    known |= dict.fromkeys(name for design in designs for name in design.observer.estimates)
    for name in columns:
        if name not in known:
            raise UsageError(Problem(f"--map {name}: {name} is no signal; allowed: {', '.join(known)}", id="OBS203"))


def on_log(
    designs: Sequence[Design],
    path: str,
    columns: Mapping[str, str],
    hold: Literal["zero", "first"] | None,
    repair: bool,
    report: "Report",
) -> LogComparison:
    """Each observer along all rows; the window is known from a first look at these."""

    def log(design: Design) -> Log:
        spec, names = design.spec, tuple(design.observer.estimates)
        taken = {"t", "arrival", *spec.plant.outputs, *spec.inputs, *names}
        own = {name: column for name, column in columns.items() if name in taken}
        return Log.of(path, spec, own, hold, repair=repair, truth=names)

    begin, end, count = math.inf, -math.inf, 0
    for rows in log(designs[0]).rows():
        begin, end, count = min(begin, float(rows.t.min())), max(end, float(rows.t.max())), count + len(rows.t)
    if not count:
        raise UsageError(Problem("has no rows", path, id="OBS811"))
    window = (begin + WINDOW * (end - begin), end)
    found = []
    for k, (label, design) in enumerate(zip(told_apart(designs), designs, strict=True)):
        with design.spec.placed():
            made = Estimation(design, log(design))
            heard = lambda share, k=k, label=label: report((k + share) / len(designs), label)  # noqa: E731
            found.append(entrant(label, made, begin, window, heard))
    return LogComparison(path, (begin, end), window, count, tuple(found))


def entrant(
    label: str, made: Estimation, begin: float, window: tuple[float, float], heard: Callable[[float], None]
) -> LogEntrant:
    """One observer along the rows of a log."""
    names, truth = made.names, tuple(name for name in made.names if name in made.log.truth)
    errors, kept = Errors(truth, window, begin), Thinned()
    innovations, run = Innovations(made.observer.outputs), "done"
    at, known = [names.index(name) for name in truth], [made.log.truth.index(name) for name in truth]
    try:
        for part in told(made, heard):
            errors.add(part.t, part.estimates[:, at] - part.truth[:, known])
            inside = (part.t >= window[0]) & (part.t <= window[1])
            innovations.add(part.innovations[inside])
            kept.add(np.column_stack([part.t, part.estimates, part.innovations, part.truth[:, known]]))
        innovations.peak = made.innovations.peak
    except UndecidedError as error:
        run = "; ".join(str(problem) for problem in error.problems)
        errors, innovations = Errors(truth, window, begin), Innovations(made.observer.outputs)
    heads = ("t", *(f"hat_{n}" for n in names), *(f"innov_{y}" for y in made.observer.outputs), *truth)
    counts: dict[str, Any] = {
        "rows": made.rows,
        "missing": made.missing,
        "late": made.late or made.delays.unused,
        "uncovered": made.uncovered,
    }
    counts |= {"engine": made.engine, "step": made.step or None}
    rows = kept.rows if kept.rows.size else np.zeros((0, len(heads)))
    order, cost = len(made.observer.states), None if run != "done" else cost_of(made)
    return LogEntrant(label, made.design, order, truth, errors, innovations, rows, heads, counts, cost, run)


def cost_of(made: Estimation) -> Cost | None:
    """CPU time of a row: the least of several ways along the first rows; None of measurements that come late.

    Reading the log is not counted; between two rows there may be several steps of the observer.
    """
    log, start = made.log, made.start
    if made.late_ones or start is None:
        return None
    rows = first_of(Log(log.table, log.spec, log.where, log.repair, truth=log.truth)).cut(made.waited)
    if not len(rows.t):
        return None
    least, spent = math.inf, 0.0
    while spent < LEAST:
        one = start.copied()
        before = time.process_time()
        one.run(rows.known, rows.u, rows.y, 0, made.first, made.step)
        took = time.process_time() - before
        least, spent = min(least, took), spent + max(took, 1e-6)
    steps = steps_of(made, rows, float(start.one.period.p) / float(start.one.period.q))
    count = max(1, len(rows.known) - 1)
    return Cost(least / count, steps / count)


def first_of(log: Log) -> Rows:
    """First rows."""
    return next(Rows(*(part[:TIMED] for part in rows)) for rows in log.rows())


def steps_of(made: Estimation, rows: Rows, period: float) -> int:
    """Steps along rows."""
    gaps = np.diff(rows.known)
    if made.spec.period is not None:
        return max(1, len(gaps))
    return max(1, int(np.maximum(1, np.ceil(gaps / (made.step or period) - ROUNDING)).sum()))
