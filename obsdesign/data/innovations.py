"""Statistics of innovations y - yhat: mean, size, autocorrelation, and whether they are white."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass, field

LAGS = 20
ROUNDING = 1e-12  # of the largest |y|: an rms up to this is no more than what rounding leaves of y - yhat


@dataclass
class Innovations:
    """Statistics of rows that come some at a time; those in which a value is missing do not count.

    autocorrelation r_k = sum (i_j - m)(i_(j+k) - m) / sum (i_j - m)^2, k = 1, .., 20, with m the mean, over the values
                    that are known, in their order.
    white           probability that innovations of white noise are correlated as much or more: that of chi-squared with
                    20 degrees of freedom above n (n + 2) sum r_k^2 / (n - k) (Ljung and Box, 1978). Below .05 or so
                    they are not white: noise, gains or the plant are other than in the spec. None where they are zero
                    to rounding, as those of an output that the observer takes wholly: rounding is no noise.
    """

    names: tuple[str, ...]
    count: Float = field(init=False)
    sum: Float = field(init=False)
    products: Float = field(init=False)  # (LAGS + 1, names): of values that are k apart
    first: list[Float] = field(init=False)  # of each name the first LAGS values, and the last
    last: list[Float] = field(init=False)
    peak: Float = field(init=False)  # of each output the largest |y|

    def __post_init__(self) -> None:
        m = len(self.names)
        self.count, self.sum, self.products = np.zeros(m), np.zeros(m), np.zeros((LAGS + 1, m))
        self.first, self.last = [np.zeros(0)] * m, [np.zeros(0)] * m
        self.peak = np.zeros(m)

    def add(self, rows: Float) -> None:
        """Take more rows, (K, names)."""
        for i, column in enumerate(rows.T):
            values = column[np.isfinite(column)]
            self.count[i] += len(values)
            self.sum[i] += values.sum()
            before = len(self.last[i])
            joined = np.concatenate([self.last[i], values])
            with np.errstate(all="ignore"):  # of an observer that escapes
                for k in range(LAGS + 1):
                    late = joined[max(before, k) :]
                    self.products[k, i] += late @ joined[max(before, k) - k :][: len(late)]
            self.first[i] = np.concatenate([self.first[i], values[: LAGS - len(self.first[i])]])
            self.last[i] = joined[-LAGS:]

    def measured(self, y: Float) -> None:
        """Take the outputs of some rows, (K, names), whose size tells what is rounding."""
        self.peak = np.maximum(self.peak, np.where(np.isfinite(y), np.abs(y), 0.0).max(axis=0, initial=0.0))

    def report(self) -> dict[str, Any]:
        """Entries by output; None where nothing is known."""
        return {name: self.of(i) for i, name in enumerate(self.names)}

    def sizes(self) -> dict[str, Any]:
        """Rms and whiteness by output, and which of them are zero to rounding, if any."""
        told = self.report()
        zero = [name for name, one in told.items() if "zero_to_rounding" in one]
        return {
            "innovation_rms": {name: one["rms"] for name, one in told.items()},
            "white": {name: one["white"] for name, one in told.items()},
            **({"zero_to_rounding": zero} if zero else {}),
        }

    def of(self, i: int) -> dict[str, Any]:
        """Entry of one output."""
        n = float(self.count[i])
        if n == 0:
            return {"mean": None, "rms": None, "autocorrelation": [], "white": None}
        mean, rms = self.sum[i] / n, float(np.sqrt(self.products[0, i] / n))
        if not np.isfinite([mean, rms]).all():  # of an observer that escapes
            return {"mean": None, "rms": None, "autocorrelation": [], "white": None}
        r = self.correlation(i, float(mean), n)
        zero = {"zero_to_rounding": True} if rms <= ROUNDING * self.peak[i] else {}
        white = self.whiteness(r, n) if r and not zero else None
        return {"mean": float(mean), "rms": rms, "autocorrelation": r, "white": white, **zero}

    def correlation(self, i: int, mean: float, n: float) -> list[float]:
        """Autocorrelation at lags 1, 2, ..; none where nothing varies, or there are too few rows."""
        spread = self.products[0, i] - n * mean * mean
        if n <= LAGS + 1 or not np.inf > spread > 1e-24 * max(self.products[0, i], 1e-300):
            return []
        found = []
        for k in range(1, LAGS + 1):
            ends = self.first[i][:k].sum() + self.last[i][-k:].sum()
            found.append(
                float((self.products[k, i] - mean * (2 * self.sum[i] - ends) + (n - k) * mean * mean) / spread)
            )
        return found

    @staticmethod
    def whiteness(r: Sequence[float], n: float) -> float:
        """Probability of a correlation as large, of white noise."""
        from scipy.special import chdtrc

        sizes = sum(value * value / (n - k) for k, value in enumerate(r, start=1))
        return float(chdtrc(len(r), n * (n + 2) * sizes))
