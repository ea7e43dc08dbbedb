"""Why an observer escapes on a log, where one value stands out."""

import numpy as np

from obsdesign.data.rows import Rows
from obsdesign.lmi.formula import Float

OUTLYING = 1e3  # times the largest of all others: a value that stands out
FEWEST = 3  # values that tell what is usual


def cause(outputs: tuple[str, ...], rows: Rows, count: int, peak: Float) -> str:
    """End of a message that names a value of an output which is larger than all others; empty where none stands out.

    `outputs`: their names; `count`: rows up to which the observer got; `peak`: the largest of each output before these
    rows.
    """
    for i, column in enumerate(np.abs(rows.y[: count + 1].T)):
        known = np.flatnonzero(np.isfinite(column))
        if len(known) < FEWEST:
            continue
        *_, k = known[np.argsort(column[known], kind="stable")]
        others = max(float(column[known[known != k]].max()), float(peak[i]))
        if column[k] > OUTLYING * others:
            said = f"; line {int(rows.lines[k])} has {outputs[i]} = {rows.y[k, i]:.4g}, and the others at most"
            return f"{said} {others:.4g}: leave it empty there if it is no measurement"
    return ""
