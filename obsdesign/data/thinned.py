"""Rows of a log that a figure shows."""

import numpy as np

from obsdesign.lmi.formula import Float

DRAWN = 6000  # rows of a figure at most


class Thinned:
    """Some of the rows of a log, evenly apart, enough for a figure."""

    def __init__(self) -> None:
        self.rows = np.zeros((0, 0))
        self.stride, self.seen = 1, 0

    def add(self, table: Float) -> None:
        """Take rows."""
        chosen = table[(-self.seen) % self.stride :: self.stride]
        self.seen += len(table)
        self.rows = np.vstack([self.rows, chosen]) if self.rows.size else chosen
        while len(self.rows) > DRAWN:
            self.rows, self.stride = self.rows[::2], 2 * self.stride
