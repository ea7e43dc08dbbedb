"""Logs as files of columns."""

from pathlib import Path

import numpy as np


def log(path, header, *columns, sep=","):
    """A log with these columns, NaN where nothing stands."""
    rows = [sep.join("" if np.isnan(x) else repr(float(x)) for x in row) for row in np.column_stack(columns)]
    Path(path).write_text("\n".join([sep.join(header), *rows, ""]))
    return path
