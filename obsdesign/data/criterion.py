"""How well an observer predicts the outputs of a log: what `tune` makes small, and what it judges by.

With i_k = y_k - yhat_k, where yhat_k knows the rows before k, over N rows:

likelihood, of a filter         J = (1/N) sum_k [ln det S_k + i_k' S_k^-1 i_k]
prediction error, of any other  J = sum_j ln (1/N) sum_k i_jk^2 + (1/ny) sum_j sum_(l = 1..20) r_jl^2

S_k is the covariance of i_k that the filter supposes. With Q and R multiplied by c it is c S_k; the best c is
(1/n) sum_k i_k' S_k^-1 i_k, n the count of values, and but for a constant J is (1/N) [sum_k ln det S_k + n ln c] then
(Schweppe, 1965; Mehra, 1970). r_jl is the autocorrelation of i_j at lag l. The first sum of a prediction error is the
likelihood of innovations that are white, whatever their sizes are (Ljung, System Identification, 1999, 7.4); the second
is 20 / N on average where they are.
"""

import math
from functools import cached_property
from typing import Any

import numpy as np

from obsdesign.data.innovations import Innovations
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass

SAME = 1e-4  # of ln rms: what is no worse, as where Q and R are multiplied by a number and P0 is not
BATCHES = 20  # parts of the rows that are held back
CHANCE = 2.0  # standard errors, which chance wins once in forty times


@dataclass(frozen=True)
class Course:
    """Innovations along a log, and the covariance that is supposed of each, of a filter."""

    outputs: tuple[str, ...]
    innovations: Float  # (K, ny); NaN where y is missing
    spread: Float | None = None  # (K, ny, ny)
    peak: Float | None = None  # (ny,), largest |y| of the log

    def between(self, begin: int, end: int | None) -> "Course":
        """Some of its rows."""
        spread = None if self.spread is None else self.spread[begin:end]
        return Course(self.outputs, self.innovations[begin:end], spread, self.peak)

    @property
    def told(self) -> dict[str, Any]:
        """Entry of a report: rows, rms of the innovations and probability of a correlation as large, by output."""
        return {"rows": len(self.innovations), **self.statistics.sizes()}

    @property
    def statistics(self) -> Innovations:
        """Statistics of the innovations."""
        found = Innovations(self.outputs)
        found.add(self.innovations)
        found.peak = found.peak if self.peak is None else self.peak
        return found

    @property
    def error(self) -> float:
        """Sum over the outputs of ln rms: what is smaller of a better prediction, in whatever units."""
        with np.errstate(all="ignore"):
            squares = np.nanmean(self.innovations**2, axis=0)
            found = float(np.log(np.maximum(squares, 1e-300)).sum() / 2)
        return found if math.isfinite(found) else math.inf

    def wanting(self) -> float:
        """Criterion of innovations of an unknown size: the likelihood at the best c, or the prediction error."""
        if self.spread is None:
            return 2 * self.error + self.correlated
        logarithms, squares, count = self.sums
        if not (squares > 0 and math.isfinite(logarithms) and math.isfinite(squares)):
            return math.inf
        return (logarithms + count * math.log(squares / count)) / len(self.innovations)

    @property
    def factor(self) -> float:
        """The best c; 1 where nothing is supposed."""
        _, squares, count = self.sums
        return squares / count if count and squares > 0 and math.isfinite(squares) else 1.0

    @property
    def surprise(self) -> float:
        """Likelihood J with the covariance as it is supposed; infinite where it is none."""
        logarithms, squares, _ = self.sums
        found = (logarithms + squares) / len(self.innovations)
        return found if math.isfinite(found) else math.inf

    @property
    def correlated(self) -> float:
        """Mean over the outputs of the sum of r^2."""
        rows = [entry["autocorrelation"] for entry in self.statistics.report().values()]
        total = sum(r * r for row in rows for r in row) / len(rows)
        return total if math.isfinite(total) else math.inf

    @property
    def white(self) -> float:
        """Least probability over the outputs that white noise is as correlated; 1 where there is none."""
        return min((p for p in self.told["white"].values() if p is not None), default=1.0)

    @property
    def sums(self) -> tuple[float, float, int]:
        """Sums over the rows of ln det S and of i' S^-1 i, and how many values are known."""
        logarithms, squares = self.parts
        return float(logarithms.sum()), float(squares.sum()), int(np.isfinite(self.innovations).sum())

    @cached_property
    def parts(self) -> tuple[Float, Float]:
        """Of each row ln det S and i' S^-1 i over what is known of it, (K,); infinite where S is no covariance.

        Where nothing is supposed S is the identity.
        """
        known: Array = np.isfinite(self.innovations)
        K, ny = known.shape
        spread = np.broadcast_to(np.eye(ny), (K, ny, ny)) if self.spread is None else self.spread
        logarithms, squares = np.zeros(K), np.zeros(K)
        for pattern in np.unique(known, axis=0):
            rows = (known == pattern).all(axis=1)
            S = spread[rows][:, pattern][:, :, pattern]
            i = self.innovations[rows][:, pattern]
            with np.errstate(all="ignore"):
                if not (np.isfinite(S).all() and (np.linalg.eigvalsh(S) > 0).all()):
                    logarithms[rows] = squares[rows] = math.inf
                elif pattern.any():
                    logarithms[rows] = np.linalg.slogdet(S)[1]
                    squares[rows] = (i * np.linalg.solve(S, i[..., None])[..., 0]).sum(axis=1)
        return logarithms, squares


def better(now: Course, before: Course) -> bool:
    """Whether rows that are held back are predicted no worse, and what is won on them is more than chance.

    What is won on a row is the fall of ln det S + i' S^-1 i; where nothing is supposed, of the sum of i_j^2 over their
    mean before. Its mean is held against its standard error, from the means of 20 parts of the rows, for what is won on
    rows beside each other may be correlated.
    """
    if now.error > before.error + SAME:
        return False
    if before.spread is None:
        with np.errstate(all="ignore"):
            sizes = np.nanmean(before.innovations**2, axis=0)
            won = np.nansum((before.innovations**2 - now.innovations**2) / np.maximum(sizes, 1e-300), axis=1)
    else:
        won = sum(before.parts) - sum(now.parts)
    means = np.array([part.mean() for part in np.array_split(won, BATCHES)])
    return bool(means.mean() > CHANCE * means.std(ddof=1) / math.sqrt(BATCHES))
