"""Values of a log that stand out: why an observer escapes, or what carries it off for a while."""

from typing import Any

import numpy as np

from obsdesign.data.rows import Rows
from obsdesign.records import dataclass

OUTLYING = 1e3  # times the largest of all others: a value that stands out
FEWEST = 3  # values that tell what is usual


@dataclass
class Outlying:
    """The two largest of each output, by their lines, of rows that come some at a time."""

    outputs: tuple[str, ...]
    top: tuple[dict[int, float], ...] = ()
    count: tuple[int, ...] = ()  # values of each output

    def with_rows(self, rows: Rows) -> "Outlying":
        """The same, and some rows more; what holds on, or is there already, counts once."""
        top, count = list(self.top or [{} for _ in self.outputs]), list(self.count or [0] * len(self.outputs))
        for i, column in enumerate(rows.y.T):
            known = np.flatnonzero(np.isfinite(column) & ~rows.held)
            count[i] += len(known)
            largest = known[np.argsort(np.abs(column[known]), kind="stable")][-3:]
            both = top[i] | {int(rows.lines[k]): float(column[k]) for k in largest}
            top[i] = dict(sorted(both.items(), key=lambda one: abs(one[1]))[-2:])
        return Outlying(self.outputs, tuple(top), tuple(count))

    @property
    def found(self) -> list[dict[str, Any]]:
        """Of each output that has one, the value that is more than 1000 times as large as all others, and its line."""
        told = []
        for name, top, count in zip(self.outputs, self.top, self.count, strict=False):
            if count < FEWEST or len(top) < 2:
                continue
            (_, others), (line, value) = top.items()
            if abs(value) > OUTLYING * abs(others):
                said = f"line {line} has {name} = {value:.4g}, and the others at most {abs(others):.4g}"
                note = f"{said}: leave it empty there if it is no measurement"
                told.append({"output": name, "line": line, "value": value, "others": abs(others), "note": note})
        return told

    def cause(self, rows: Rows, count: int) -> str:
        """End of a message with the first value that stands out; empty where none does.

        `count`: how far the observer got in these rows.
        """
        found = self.with_rows(rows.cut(0, count + 1)).found
        return f"; {found[0]['note']}" if found else ""

    def report(self) -> dict[str, Any]:
        """Entry of a report, if a value stands out."""
        return {"outlying": found} if (found := self.found) else {}
