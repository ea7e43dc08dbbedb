"""Trials of an observer on a log that is held: a design, its innovations along the rows, and the search of the best."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields

import numpy as np

from obsdesign.data.criterion import Course
from obsdesign.data.estimation import Estimation
from obsdesign.data.free import Free
from obsdesign.data.log import Log
from obsdesign.data.rows import Rows
from obsdesign.design import Design
from obsdesign.dissipation.engine import Engine, Report
from obsdesign.errors import InfeasibleError, Problem, UndecidedError, UsageError
from obsdesign.expressions import Expression
from obsdesign.families import FAMILIES
from obsdesign.families.observer import Observer
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.lmi.formula import Float
from obsdesign.reading import loads
from obsdesign.records import dataclass, field, replace
from obsdesign.spec import Spec

FINE = 0.02  # decades, to which a number is found
TRIALS = 14  # of a search between two points of the grid, at most
LIKELY = 4.0  # fall of 2 ln likelihood up to which a value is as good as the best: that of two standard errors
NEAR = 0.5  # decades around what was found, of a second search
BUILT = (Verdict.CERTIFIED, Verdict.NO_GUARANTEE)


@dataclass(frozen=True)
class Held(Log):
    """A log whose rows are held."""

    held: tuple[Rows, ...] = ()

    def rows(self) -> Iterator[Rows]:
        """All rows at once."""
        yield from self.held

    def until(self, end: int) -> "Held":
        """Its first rows."""
        return replace(self, held=tuple(Rows(*(part[:end] for part in rows)) for rows in self.held))


@dataclass
class Search:
    """Trials on the rows of `train`."""

    spec: Spec
    log: Held
    first: int  # row of train
    report: Report
    expected: int  # trials, for how far it is
    least: dict[tuple[str, ...], float] = field(default_factory=dict)  # criterion by changes
    whitest: float = 0.0  # greatest probability of a trial
    ends: list[str] = field(default_factory=list)  # keys of which the best is at an end of what is searched
    flat: dict[str, tuple[Free, float, float, float]] = field(default_factory=dict)  # x: best, least and most as good
    count: int = 0  # rows

    def __call__(self, changes: tuple[str, ...]) -> float:
        """Criterion with some changes; infinite where there is no design, or it escapes."""
        if changes not in self.least:
            self.report(min(0.99, len(self.least) / self.expected), ", ".join(changes))
            self.least[changes] = self.tried(changes)
        return self.least[changes]

    def tried(self, changes: tuple[str, ...]) -> float:
        """Design and run of one trial; what its gains achieve is proved, and nobody is told why where there are none.

        A filter, of which nothing is proved, has no design.
        """
        try:
            design = designed(loads(self.spec.text, self.spec.path, (*self.spec.changes, *changes)))
            if design.status not in BUILT:
                return math.inf
            course = along(design, self.log).between(self.first, None)
        except (UndecidedError, UsageError, InfeasibleError, OverflowError, ZeroDivisionError, np.linalg.LinAlgError):
            return math.inf
        self.whitest, self.count = max(self.whitest, course.white), len(course.innovations)
        return course.wanting()

    def best(self, free: Sequence[Free]) -> tuple[str, ...]:
        """Changes with the least criterion, key by key: on a grid of a point a decade, then between its neighbours.

        With several keys each is searched again around what was found, the others as they are then.
        """
        at: list[float | None] = [one.start for one in free]
        for i, one in enumerate(free):
            count = max(3, math.ceil(one.high - one.low) + 1)
            inner = [] if one.start is None else [one.start]
            at[i] = self.narrowed(free, at, i, sorted({*np.linspace(one.low, one.high, count).tolist(), *inner}))
        for i, one in enumerate(free if len(free) > 1 else ()):
            x = at[i]
            assert x is not None
            at[i] = self.narrowed(free, at, i, [max(one.low, x - NEAR), x, min(one.high, x + NEAR)])
        pairs = [(one, x) for one, x in zip(free, at, strict=True) if x is not None]
        self.ends = [one.key for one, x in pairs if min(x - one.low, one.high - x) < 2 * FINE]
        return changes_of(free, at)

    def narrowed(self, free: Sequence[Free], at: Sequence[float | None], i: int, grid: Sequence[float]) -> float:
        """Best x of one key: the least of the grid, or what Brent's method finds between its neighbours, if less."""
        from scipy.optimize import minimize_scalar

        def criterion(x: float) -> float:
            return self(changes_of(free, [*at[:i], float(x), *at[i + 1 :]]))

        values = [criterion(x) for x in grid]
        k = int(np.argmin(values))
        if values[k] == math.inf:
            return grid[k]
        worst = max(value for value in values if value < math.inf) + 1
        tried = dict(zip(grid, values, strict=True))

        def bounded(x: float) -> float:
            tried[float(x)] = criterion(x)
            return min(tried[float(x)], worst)

        found = minimize_scalar(
            bounded,
            bounds=(grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]),
            method="bounded",
            options={"xatol": FINE, "maxiter": TRIALS},
        )
        best = float(found.x) if found.fun < values[k] else grid[k]
        low, high = self.as_good(tried, best)
        self.flat.pop(free[i].key, None)
        if high - low > 1 - FINE:
            self.flat[free[i].key] = free[i], best, low, high
        return best

    def as_good(self, tried: Mapping[float, float], best: float) -> tuple[float, float]:
        """Ends of the x that were tried around the best of which the likelihood is about the same, all between too."""
        bad = [x for x, value in tried.items() if value - tried[best] > LIKELY / max(self.count, 1)]
        below, above = (
            max((x for x in bad if x < best), default=-math.inf),
            min((x for x in bad if x > best), default=math.inf),
        )
        inside = [x for x in tried if below < x < above]
        return min(inside), max(inside)


def changes_of(free: Sequence[Free], at: Sequence[float | None]) -> tuple[str, ...]:
    """Changes of a spec, of the keys that are not as it has them."""
    points = zip(free, at, strict=True)
    return tuple(one.change(x) for one, x in points if x is not None and x != one.start)


def held(log: Log) -> Held:
    """Log with its rows, without what radii need."""
    parts = [*log.rows()]
    if not parts:
        raise UsageError(Problem("has no rows", log.table.path, id="OBS811"))
    rows = Rows(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    own = {one.name: getattr(log, one.name) for one in fields(log)}
    return Held(**{**own, "where": replace(log.where, v_sup=None)}, held=(rows,))


def designed(spec: Spec) -> Design:
    """Design of a trial: without advice where there is none. Raises `UndecidedError`: as a family does."""
    family = FAMILIES[spec.observer.type]
    if not family.proves:
        return Design.of(spec, Outcome(Verdict.NO_GUARANTEE, form=spec.observer))
    return Design.of(spec, family.design(spec, Engine()))


def along(design: Design, log: Held) -> Course:
    """Innovations of a design along a log, with the covariance that it supposes of them."""
    made = Estimation(design, replace(log, spec=design.spec))
    observer, ny = made.observer, len(made.observer.outputs)
    names = len(observer.estimates)
    made.observer = supposing(observer)
    parts = [*made.parts()]
    innovations, estimates = (np.vstack([getattr(p, name) for p in parts]) for name in ("innovations", "estimates"))
    if observer.supposed is None:
        return Course(observer.outputs, innovations, peak=made.innovations.peak)
    t = np.concatenate([rows.known for rows in log.held])
    h = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    spread: Float = estimates[:, names:].reshape(-1, ny, ny) + observer.supposed.white / h
    return Course(observer.outputs, innovations, spread, made.innovations.peak)


def supposing(observer: Observer) -> Observer:
    """Observer that tells the covariance it supposes among its estimates."""
    if observer.supposed is None:
        return observer
    cells: list[Expression] = observer.supposed.states.ravel().tolist()
    return replace(observer, estimates={**observer.estimates, **{f"supposed_{k}": c for k, c in enumerate(cells)}})
