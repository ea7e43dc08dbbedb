"""Holes in the time of a log: rows that are missing, where nothing says how far apart rows are."""

from typing import Any

import numpy as np

from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass

LONG = 20  # times the mean of the intervals before
FEWEST = 3  # intervals that tell what is usual


@dataclass
class Intervals:
    """Intervals between rows that come some at a time; of rows at the same time there is none."""

    last: float = np.nan  # s, time of the last row
    count: int = 0
    total: float = 0.0  # s
    holes: int = 0  # intervals more than 20 times as long as the mean of those before
    longest: float = 0.0  # s, of these
    line: int = 0  # .. and the row with which it ends
    t: float = 0.0

    def add(self, t: Float, lines: Array) -> None:
        """Take rows at times t (K,), which do not fall."""
        gaps = np.diff(t, prepend=self.last)
        place = np.flatnonzero(gaps > 0)
        gaps = gaps[place]
        before = self.total + np.concatenate([[0.0], np.cumsum(gaps)])
        count = self.count + np.arange(len(gaps))
        long = np.flatnonzero((count >= FEWEST) & (gaps * count > LONG * before[:-1]))
        self.holes += len(long)
        if len(long) and gaps[long].max() > self.longest:
            k = int(long[np.argmax(gaps[long])])
            self.longest, self.line, self.t = float(gaps[k]), int(lines[place[k]]), float(t[place[k]])
        self.count, self.total = self.count + len(gaps), float(before[-1])
        self.last = float(t[-1]) if len(t) else self.last

    def report(self) -> dict[str, Any]:
        """Entry of a report, if there is a hole."""
        found = {"count": self.holes, "longest": self.longest, "line": self.line, "t": self.t}
        return {"holes": found} if self.holes else {}
