"""Numbers of a spec from a log: those whose observer predicts its outputs best, judged on rows that are held back.

The rows are parted: of the first share (0.6) the first tenth is left out, in which an estimate comes in from xhat0; on
the rest, `train`, a criterion of the innovations is made small (`criterion.py`); the rows after it, `test`, judge.

What a criterion of innovations can tell: each is y less what was expected of it from the rows before, so it is one of
predictions over the time between rows, and the fitted numbers are those for such rows. An observer that is faster
follows its last y, noise and all: white noise of rms s then makes innovations of rms sqrt(2) s with r_1 = -1/2, where a
good one has nearly s and r_1 = 0; without noise nothing is won by slowness, however short the rows. Where y goes on
straight lines between rows (hold: first), an observer knows the y that it is to predict: that is refused.

Only the gain acts on the innovations, and on it only the ratio of two noises. So a level of `noise` is that for which
the design has the best gain, given what the spec says of w, and not the rms of the sensor; the size of Q and R of a
filter follows from that of the innovations.
"""

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign import work
from obsdesign.data.criterion import Course, better
from obsdesign.data.estimation import NOTHING
from obsdesign.data.free import WEIGHTS, Free, chosen, sections, times
from obsdesign.data.log import Log
from obsdesign.data.trials import BUILT, TRIALS, Held, Search, along, designed, held
from obsdesign.design import Design
from obsdesign.disk import write_whole
from obsdesign.dissipation.engine import Report
from obsdesign.errors import Problem, UsageError, one_line
from obsdesign.families import FAMILIES
from obsdesign.reading import loads
from obsdesign.records import dataclass, replace
from obsdesign.sections.editing import edited
from obsdesign.sections.writing import flow, plain
from obsdesign.spec import Spec
from obsdesign.stepping.implemented import implemented
from obsdesign.trial import Implementation

SHARE = 0.6  # of the rows that is fitted to
SETTLING = 0.1  # of these, which are left out
FEWEST = 50  # values of each output in each part
WHITE = 1e-3  # probability below which innovations are not
MARK = "# obsdesign tune:"  # begins a spec that is written here


@dataclass(frozen=True)
class Tuning:
    """What came of it: `report` as `--json`, the text of the spec, and the design of that, which is proved."""

    report: dict[str, Any]
    text: str  # with a first line that says where it is from
    design: Design

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the spec, whole or not at all. Raises `UsageError`: the folder may not be written."""
        write_whole(os.fspath(path), self.text.encode())

    def __repr__(self) -> str:
        return f"<tuning of {self.design.spec.name!r}: {self.report['fitted'] or 'as before'}>"


@dataclass
class Tuner:
    """One spec on one log."""

    before: Design
    log: Held
    share: float
    keys: Sequence[str]
    report: Report

    @property
    def spec(self) -> Spec:
        """Spec as it is."""
        return self.before.spec

    @cached_property
    def parts(self) -> tuple[int, int]:
        """First row of train, and of test."""
        end = int(self.share * sum(len(rows.t) for rows in self.log.held))
        return int(SETTLING * end), end

    def judged(self, course: Course) -> tuple[Course, Course]:
        """Train and test of a course."""
        first, end = self.parts
        return course.between(first, end), course.between(end, None)

    def tuned(self, path: str, source: str) -> Tuning:
        """Search, and hold what is found against what was there before."""
        free = chosen(self.spec, self.keys)
        require_predictions(self.before, self.log)
        was = self.judged(along(self.before, self.log))
        require_rows(was, self.log.table.path)
        first, end = self.parts
        count = sum(math.ceil(one.high - one.low) + TRIALS + 2 for one in free)
        search = Search(self.spec, self.log.until(end), first, self.report, count * (2 if len(free) > 1 else 1))
        changes = search.best(free)
        self.report(0.99, "what is found, on all rows")
        flat = search.flat
        for found in self.candidates(changes if search(changes) < math.inf else (), was[0]):
            design = self.design(found, path)
            now = self.judged(along(design, self.log)) if design.status in BUILT else was
            if better(now[1], was[1]):
                return self.told(found, design, (was, now), replace(search, flat=flat), source)
            flat = {}  # which is around what was found first
        return self.told((), self.before, (was, was), search, source)

    def candidates(self, changes: tuple[str, ...], was: Course) -> Iterator[tuple[str, ...]]:
        """What was found; of a filter in the size that its innovations have, and then that size alone."""
        if was.spread is None or not all(key in sections(self.spec).get("observer", {}) for key in WEIGHTS):
            yield from [changes] if changes else []
            return
        yield from dict.fromkeys((self.sized(changes), self.sized(())))

    def sized(self, changes: tuple[str, ...]) -> tuple[str, ...]:
        """Q and R with changes, multiplied by the factor that makes S of train as large as its innovations are."""
        spec = loads(self.spec.text, self.spec.path, (*self.spec.changes, *changes))
        c = self.judged(along(designed(spec), self.log))[0].factor
        observer = sections(spec)["observer"]
        return tuple(f"observer.{key}={flow(plain(times(observer[key], c), (), [], ''))}" for key in WEIGHTS)

    def design(self, changes: Sequence[str], path: str) -> Design:
        """Design of the text as it will be written, solved and proved as any other."""
        text, _ = self.written(changes)
        spec = loads(text, path)
        spec = spec if "name" in sections(self.spec) else replace(spec, name=self.spec.name)
        return work.trial(spec) if FAMILIES[spec.observer.type].proves else designed(spec)

    def written(self, changes: Sequence[str]) -> tuple[str, bool]:
        """Text of the spec with changes, then without what it expects, and whether its comments are kept."""
        text = self.spec.text.removeprefix("\ufeff")
        if text.startswith(MARK):
            text = text.partition("\n")[2]
        return edited(text, self.spec.path, (*self.spec.changes, *changes), ("expect",) if changes else ())

    def told(
        self,
        changes: Sequence[str],
        design: Design,
        parts: tuple[tuple[Course, Course], tuple[Course, Course]],
        search: Search,
        source: str,
    ) -> Tuning:
        """Report, and the text with a line on where it is from."""
        was, now = parts
        searched = [one.key for one in chosen(self.spec, self.keys)]
        old, new = values(self.spec, changes or searched), values(design.spec, changes)
        told = {
            "fitted": {key: number(value) for key, value in new.items()},
            "train": now[0].told,
            "test": now[1].told,
            "before": {
                "values": {key: number(value) for key, value in old.items()},
                "train": was[0].told,
                "test": was[1].told,
            },
            "kept": not changes,
            "fits": max(search.whitest, was[0].white) >= WHITE,
            "criterion": "prediction error" if was[0].spread is None else "likelihood",
            "searched": searched,
            "flat": {key: as_good(new[key], *search.flat[key]) for key in new if key in search.flat},
            "ends": [key for key in search.ends if key in new],
            "trials": len(search.least),
            "status": str(design.status),
        }
        text, kept = self.written(changes)
        told["comments"] = kept
        what = ", ".join(f"{key} {flow(old[key])} -> {flow(new[key])}" for key in new) or "as before"
        rows = f"rows {self.parts[0] + 1} to {self.parts[1]}"
        head = one_line(f"{MARK} {what}; {rows} of {self.log.table.path}, with {source}")
        return Tuning(told, f"{head}\n{text}", design)


def tune(
    source: "Design | Spec | str | os.PathLike[str]",
    data: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    columns: Mapping[str, str] = NOTHING,
    free: Sequence[str] = (),
    share: float = SHARE,
    repair: bool = False,
    progress: Report = lambda *_: None,
) -> Tuning:
    """Fit numbers of a spec to a log, and judge them on rows that are held back; what is worse there is not taken.

    `source`, `data`, `columns`, `repair`: as of `estimate`; `output`: path of the spec, if it is to be written; `free`:
    keys that are searched, else those of `free.chosen`; `share`: of the rows that is fitted to, the others judge;
    `progress`: called with the share that is done, and with what is tried.

    Raises `UsageError`: as `estimate`; nothing can be tuned, rows are too few, or innovations are of no predictions;
    `UndecidedError`: the observer, as it is, has no finite value on the log.
    """
    if not 0 < share < 1:
        raise UsageError(f"share: {share:g} is no share of the rows; give a number between 0 and 1", id="OBS904")
    before = work.trial(source)
    with before.spec.placed():
        log = held(Log.of(os.fspath(data), before.spec, columns, repair=repair))
        path = before.spec.path if output is None else os.fspath(output)
        made = Tuner(before, log, share, free, progress).tuned(path, before.path)
    if output is not None:
        made.save(output)
    return made


def as_good(value: Any, free: Free, best: float, low: float, high: float) -> list[Any]:
    """Least and most of a key, x from low to high, that the log tells no more than its value at the best x from."""
    if free.kind == "scaled":
        return [number(times(value, 10 ** (x - best))) for x in (low, high)]
    return [number(free.at(x)) for x in (low, high)]


def hurried(spec: Spec) -> Iterator[Problem]:
    """How a filter whose steps are found anew in every trial is tuned faster, if it is one."""
    if spec.period is None and spec.implementation is None and not FAMILIES[spec.observer.type].proves:
        said = "without implementation each setting looks for steps short enough for a filter in continuous time; with"
        said += " implementation: {period: .., method: rk4}, the time between rows, or system.discretise it is faster"
        yield spec.located(Problem(said, key="observer.type", id="OBS964"))


def warned(made: Tuning, data: str) -> Iterator[Problem]:
    """That no setting fits a log, if none does."""
    if not made.report["fits"]:
        said = "innovations are not white at any setting that was tried: the plant, its inputs or their signs may be"
        said += " others than in the spec, its disturbance no white noise, or what is not searched is in the way"
        yield Problem(said, data, id="OBS963")


def values(spec: Spec, changes: Sequence[str]) -> dict[str, Any]:
    """What the changed keys are in a spec; entry by entry where they are mappings."""
    found: dict[str, Any] = {}
    for change in changes:
        key = change.partition("=")[0]
        value: Any = sections(spec)
        for name in key.split("."):
            value = value[name]
        nested = isinstance(value, Mapping) and not {"min", "max"} & set(value)
        found |= {f"{key}.{name}": entry for name, entry in value.items()} if nested else {key: value}
    return found


def number(value: Any) -> Any:
    """Value as JSON has it."""
    if isinstance(value, list):
        return [number(entry) for entry in value]
    if isinstance(value, Mapping):
        return {name: number(entry) for name, entry in value.items()}
    try:
        return float(value)
    except ValueError:
        return value


def require_predictions(design: Design, log: Held) -> None:
    """Refuse innovations that are no errors of predictions."""
    spec = design.spec
    if log.where.hold == "first" and spec.period is None and not design.observer.jump:
        said = "hold: first leads the observer along straight lines to the very y that it is to predict; tune with"
        raise UsageError(f"{said} --set data.hold=zero", id="OBS962")
    steps = spec.implementation or Implementation(fmpq(1, 1000), "euler")
    if not implemented(spec, design.observer, steps).foresees:
        said = (
            "what this observer expects of y depends on y itself, so that its innovations tell nothing of its numbers"
        )
        raise UsageError(spec.located(Problem(said, key="observer.type", id="OBS962")))


def require_rows(parts: tuple[Course, Course], path: str) -> None:
    """Refuse parts with too few values."""
    for part, name in zip(parts, ("train", "test"), strict=True):
        counts = np.isfinite(part.innovations).sum(axis=0)
        if (few := int(counts.min())) < FEWEST:
            which = part.outputs[int(counts.argmin())]
            said = f"{few} values of {which} in the part to {name}, and at least {FEWEST} are needed; take a longer log"
            raise UsageError(Problem(said, path, id="OBS960"))
