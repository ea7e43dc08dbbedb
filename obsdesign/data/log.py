"""The signals of a spec in a log: which columns they are, in which units, and rows whose instants rise."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Literal

import numpy as np

from obsdesign.data.rows import Rows, joined, newest, sampled
from obsdesign.errors import Problem, UsageError
from obsdesign.families import FAMILIES
from obsdesign.files.table import Header, Table, filled, not_rising
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass, field, replace
from obsdesign.spec import Spec
from obsdesign.trial import Recorded

LATEST = 1e13  # s, of a time
APART = 0.01  # of a period: how far the instants of a plant in samples may be off
MOST = 50_000_000  # values that are held at once, where rows are put in order
ROWS = 200_000  # that are given at once, where they are


REPAIRED = ("without_time", "moved", "repeated")
COUNTED = (*REPAIRED, "samples", "gaps")
LONGEST = 1_000_000  # samples of a gap


def table(path: str) -> Table:
    """Table of a file by its ending."""
    if not path.lower().endswith((".parquet", ".pq")):
        return Table(path)
    from obsdesign.data.parquet import Parquet

    return Parquet(path)


@dataclass(frozen=True)
class Log:
    """A log of a plant.

    Raises `UsageError`: a column is missing, its unit is not that of the spec, an instant is missing, repeated or out
    of order and nothing says what to do, or rows of a plant in samples are not a period apart.
    """

    table: Table
    spec: Spec
    where: Recorded
    repair: bool = False
    clock: list[float] = field(default_factory=list)  # time of the first sample, once it is known
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(COUNTED, 0))  # of what was done to rows; of
    # the samples of a plant in discrete time, and of those among them that the log has no row of
    truth: tuple[str, ...] = ()  # signals beside u and y whose columns are read, to compare estimates with

    @classmethod
    def of(
        cls,
        path: str,
        spec: Spec,
        columns: Mapping[str, str],
        hold: Literal["zero", "first"] | None = None,
        *,
        repair: bool = False,
        truth: Sequence[str] = (),
    ) -> "Log":
        """Log at a path. `columns`: of signals, in place of those of the spec; `hold`: likewise.

        `truth`: further signals, which are read where a column has their name, or where one is named for them.
        """
        where = spec.data or Recorded()
        allowed = ("t", "arrival", *spec.plant.outputs, *spec.inputs, *truth)
        for name in columns:
            if name not in allowed:
                said = f"{name} is no signal; allowed: {', '.join(allowed)}"
                raise UsageError(Problem(f"--map {name}: {said}", id="OBS203"))
        own = {name: column for name, column in columns.items() if name not in ("t", "arrival")}
        where = replace(where, columns={**where.columns, **own}, hold=hold or where.hold)
        where = replace(where, time=columns.get("t", where.time), arrival=columns.get("arrival", where.arrival))
        file = table(path)
        heads = {text for head in file.columns for text in (head.text, head.name)} if truth else set()
        found = tuple(name for name in truth if name in where.columns or name in heads)
        return cls(file, spec, where, repair, truth=found)

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of u and y, and of what else is read, in the order of `places`."""
        return (*self.spec.inputs, *self.spec.plant.outputs, *self.truth)

    @cached_property
    def places(self) -> tuple[int, ...]:
        """Columns of the time, of the signals, and of the arrival, if there is one."""
        where = self.where
        found = [self.table.column(where.time or "t")]
        found += [self.table.column(where.columns.get(name, name)) for name in self.signals]
        return (*found, self.table.column(where.arrival)) if where.arrival else tuple(found)

    @cached_property
    def counter(self) -> int | None:
        """Column that counts measurements at instants, as a run writes it: `received`."""
        heads = [one.name for one in self.table.columns]
        counted = FAMILIES[self.spec.observer.type].sampled and not self.where.arrival
        return heads.index("received") if counted and "received" in heads else None

    @cached_property
    def factors(self) -> Float:
        """Factor of each of these columns to the unit of the spec."""
        where, heads = self.where, [self.table.columns[i] for i in self.places]
        names = ("time", *self.signals, *(["time"] if where.arrival else []))
        for name, head in zip(names, heads, strict=True):
            if name not in where.scale:
                self.require_unit(name, head)
        return np.array([float(where.scale.get(name, 1)) for name in names])

    def require_unit(self, name: str, head: Header) -> None:
        """Refuse a column that says another unit than the spec."""
        unit = "s" if name == "time" else self.spec.units.get(name, "")
        if head.differs(unit, time=name == "time"):
            said = f"column {head.text} is in {head.unit}, {name} of the spec in {unit}"
            raise self.table.wrong(
                f"{said}; write data: {{scale: {{{name}: factor}}}}, which is 1 if they are the same",
                self.table.heading,
                id="OBS811",
            )

    def rows(self) -> Iterator[Rows]:
        """All rows, some at a time; where measurements are used when they arrive, the newest are."""
        if not self.where.arrival or FAMILIES[self.spec.observer.type].sampled:
            return self.risen()
        if self.spec.period is None:
            return newest(self.risen(), self.where.hold == "first")

        def refuse(said: str, line: int) -> UsageError:
            return self.table.wrong(said, line, id="OBS811")

        return sampled(self.risen(), float(self.spec.period), APART, refuse)

    def risen(self) -> Iterator[Rows]:
        """Rows in the order in which they are known."""
        last, values = -np.inf, np.full(len(self.spec.inputs), np.nan)
        for rows in self.ordered() if self.repair else self.raw():
            made = self.filled(rows, values)
            self.require_rising(made, last)
            if len(made.t):
                made = self.sampled(made, last, values)
                last, values = made.known[-1], made.u[-1]
                yield made

    def raw(self) -> Iterator[Rows]:
        """Rows as they are in the file."""
        nu, ny = len(self.spec.inputs), len(self.spec.plant.outputs)
        places, before = (*self.places, *(() if self.counter is None else [self.counter])), 0.0
        for block in self.table.finite(places, (places[0], *(places[-1:] if self.where.arrival else ()))):
            values = block.rows[:, : len(self.places)] * self.factors
            if self.counter is not None:
                received = block.rows[:, -1]
                values[np.diff(received, prepend=before) <= 0, 1 + nu : 1 + nu + ny] = np.nan
                before = received[-1] if len(received) else before
            t = values[:, 0]
            known = np.fmax(values[:, -1], t) if self.where.arrival else t
            u, y = values[:, 1 : 1 + nu], values[:, 1 + nu : 1 + nu + ny]
            truth = values[:, 1 + nu + ny : 1 + len(self.signals)]
            guessed, none = np.asarray(np.isnan(u).any(axis=1)), np.zeros(len(t), dtype=int)
            yield Rows(t, u, y, known, block.lines, guessed, truth, none > 0, none)

    def ordered(self) -> Iterator[Rows]:
        """Rows in order, each instant once, those without one left out."""
        held, size = list[Rows](), 0
        for rows in self.raw():
            held.append(rows)
            size += rows.t.size * (len(self.places) + 1)
            if size > MOST:
                raise UsageError(
                    Problem(f"more than {MOST:,} values, too many to be put in order", self.table.path, id="OBS812")
                )
        if not held:
            return
        rows = joined(held)
        timed = np.isfinite(rows.known)
        self.counts["without_time"] += int((~timed).sum())
        order = np.flatnonzero(timed)[np.lexsort((rows.t[timed], rows.known[timed]))]
        self.counts["moved"] += int((np.diff(rows.known[timed]) < 0).sum())
        once = np.diff(rows.known[order], prepend=-np.inf) > 0
        if self.where.arrival:  # several may arrive at once
            once |= np.diff(rows.t[order], prepend=-np.inf) != 0
        self.counts["repeated"] += int((~once).sum())
        order = order[once]
        for k in range(0, len(order), ROWS):
            yield Rows(*(part[order[k : k + ROWS]] for part in rows))

    def filled(self, rows: Rows, before: Float) -> Rows:
        """Rows with what is missing of u as it was in the row before."""
        u = filled(rows.u, before)
        if len(wrong := np.argwhere(np.isnan(u))):
            k, i = wrong[0]
            said = (
                f"{self.spec.inputs[i]}: the first value of a known input is missing; begin the log where it is known"
            )
            raise self.table.wrong(said, int(rows.lines[k]), id="OBS811")
        return rows._replace(u=u)

    def require_rising(self, rows: Rows, last: float) -> None:
        """Refuse rows that are not each after the one before, or of a plant in samples not a period after it."""
        gaps = np.diff(rows.known, prepend=last)
        together = (gaps == 0) & bool(self.where.arrival)
        if len(wrong := np.flatnonzero(~(gaps > 0) & ~together)):
            k = int(wrong[0])
            t, before = rows.known[k], rows.known[k - 1] if k else last
            what = not_rising(t, before, self.where.arrival or "t")
            said = "--repair sorts rows and leaves out those without a time of their own"
            also = "rows stand in the order of arrival" if self.where.arrival else "or name the column of their arrival"
            raise self.table.wrong(f"{what}; {said}; {also}", int(rows.lines[k]), id="OBS811")
        if not np.isfinite(gaps[np.isfinite(rows.known)][1:]).all() or np.abs(rows.known).max(initial=0.0) > LATEST:
            raise self.table.wrong(f"a time is beyond {LATEST:g} s", int(rows.lines[-1]), id="OBS811")

    def sampled(self, rows: Rows, last: float, before: Float) -> Rows:
        """Rows of a plant in samples, with one for each sample of a gap: without outputs, u as it was `before`.

        Raises `UsageError`: a row is off the samples.
        """
        if self.spec.period is None or self.where.arrival:
            return rows
        period, first = float(self.spec.period), self.counts["samples"]
        if not self.clock:
            self.clock.append(float(rows.known[0]))
        at = np.rint((rows.known - self.clock[0]) / period).astype(int)
        steps = np.diff(at, prepend=first - 1)
        off = np.abs(rows.known - self.clock[0] - period * at) > APART * period
        if len(wrong := np.flatnonzero(off | (steps < 1) | (steps > LONGEST))):
            k = int(wrong[0])
            late = rows.known[k] - self.clock[0] - period * (at[k - 1] + 1 if k else first)
            gap = rows.known[k] - (rows.known[k - 1] if k else last)
            said = f"{gap:.6g} s after the row before" if np.isfinite(gap) else "its time is off"
            said += f", and {late:.3g} s off its sample; rows of this plant are {period:g} s apart"
            said += f"; a gap is a whole number of periods, at most {LONGEST:,}"
            raise self.table.wrong(said, int(rows.lines[k]), id="OBS811")
        self.counts["samples"] = int(at[-1]) + 1
        self.counts["gaps"] += (lacking := int(steps.sum()) - len(at))
        return self.spread(rows, at, steps, before) if lacking else rows

    def spread(self, rows: Rows, at: Array, steps: Array, before: Float) -> Rows:
        """Rows with one for each sample of a gap; `at`: their samples, each `steps` after that of the row before."""
        place = np.repeat(np.arange(len(at)), steps)  # for each sample the row with which the gap that it is in ends
        samples = np.arange(at[-1] + 1 - len(place), at[-1] + 1)
        known = at[place] == samples
        t = np.where(known, rows.known[place], self.clock[0] + float(self.spec.period or 0) * samples)
        u = np.where(known[:, None], rows.u[place], np.vstack([before, rows.u[:-1]])[place])
        y, truth = (np.where(known[:, None], part[place], np.nan) for part in (rows.y, rows.truth))
        none = np.zeros(len(t), dtype=int)
        own, guessed = np.where(known, rows.t[place], t), rows.guessed[place] | ~known
        return Rows(own, u, y, t, rows.lines[place], guessed, truth, none > 0, none)
