"""Measurements that become known late: an observer of instants goes back to them, another uses them when they come."""

from bisect import bisect_right
from typing import Any

import numpy as np

from obsdesign.data.rows import Rows
from obsdesign.data.runner import Passed, Runner
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass, field, replace

KEPT = 1000  # measurements that it can go back by


@dataclass
class Delays:
    """Rows that are used when they arrive."""

    unused: int = 0  # which came after newer ones, and are not used
    rows: int = 0  # which were used after their time, or at which none was new
    longest: float = 0.0  # s, from the time of a y to a row at which it is used

    def timely(self, rows: Rows) -> Array:
        """Rows that were known at their time."""
        after = np.asarray(rows.known > rows.t) | rows.held
        self.unused += int(rows.unused.sum())
        self.rows += int(after.sum())
        self.longest = max(self.longest, float((rows.known - rows.t)[after].max(initial=0.0)))
        return ~after

    def report(self) -> dict[str, Any]:
        """Entry of the report, if any row came late."""
        return {"stale": {"rows": self.rows, "longest": self.longest}} if self.rows else {}


@dataclass
class Taken:
    """A measurement, and the observer after it."""

    t: float
    u: Float  # (1, nu)
    y: Float  # (1, ny)
    after: Runner


@dataclass
class History:
    """Measurements in the order of their time, each with the observer after it, so that one more can come between."""

    start: Runner
    first: bool  # whether u goes on straight lines between measurements
    taken: list[Taken] = field(default_factory=list)
    late: int = 0  # measurements that came so
    lost: int = 0  # .. before all that are kept: they are not used
    full: bool = False  # whether earlier ones are not kept any more

    def copied(self) -> "History":
        """The same, which goes on by itself."""
        return replace(self, taken=[*self.taken])

    def run(self, rows: Rows, h: float = 0.0) -> Passed:
        """Take rows in the order in which they became known; what is made of each at its own time."""
        found = []
        for k in range(len(rows.t)):
            one = self.take(float(rows.t[k]), rows.u[k : k + 1], rows.y[k : k + 1], h)
            found.append(one)
            if one.rows < 1:
                break
        parts = [np.vstack([getattr(one, name) for one in found]) for name in ("estimates", "expected", "arguments")]
        estimates, expected, arguments = parts
        return Passed(estimates, expected, arguments, sum(one.rows for one in found))

    def take(self, t: float, u: Float, y: Float, h: float) -> Passed:
        """Take one measurement, and those after it once more."""
        place = bisect_right([one.t for one in self.taken], t)
        behind = self.taken[place:]
        self.late += bool(behind)
        if behind and not place and self.full:
            self.lost += 1
            y = np.full_like(y, np.nan)
        del self.taken[place:]
        found = self.follow(t, u, y, h)
        for one in behind:
            self.follow(one.t, one.u, one.y, h)
        if len(self.taken) > KEPT:
            self.full = True
            del self.taken[: len(self.taken) - KEPT]
        return found

    def follow(self, t: float, u: Float, y: Float, h: float) -> Passed:
        """Go on from the last measurement to one more."""
        if not self.taken:
            made = self.start.copied()
            passed = made.run(np.array([t]), u, y, 0, self.first, h)
        else:
            before = self.taken[-1]
            made = before.after.copied()
            both = np.array([before.t, t]), np.vstack([before.u, u]), np.vstack([before.y, y])
            passed = made.run(*both, 1, self.first, h)
        done = passed.rows - bool(self.taken)
        self.taken.append(Taken(t, u, y, made))
        estimates, expected, arguments = (part[-1:] for part in passed[:3])
        return Passed(estimates, expected, arguments, done)
