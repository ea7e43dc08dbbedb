"""Cuts of the least mu over the scales lambda of multipliers, and what all of them allow.

Every signal that no P can do with says base + slopes lambda <= supplied mu for all lambda and mu. What cuts allow is
found by small linear and quadratic programs in lambda relative to some scales, so that all numbers are near 1.
"""

from collections.abc import Iterator

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.lmi.solvers import quadratic
from obsdesign.records import dataclass
from obsdesign.riccati.equation import Signal

BOX = 30.0  # factor by which a scale changes at most in one step


@dataclass(frozen=True)
class Cut:
    """What a signal says: base + slopes lambda <= supplied mu."""

    base: float
    slopes: Float
    supplied: float

    @classmethod
    def of(cls, signal: Signal, scales: Float) -> "Cut | None":
        """Cut of a signal that was found for some scales; None where it says nothing."""
        if not np.isfinite([signal.cost, signal.supplied, *signal.slopes]).all() or len(signal.slopes) != len(scales):
            return None
        return cls(signal.cost - float(signal.slopes @ scales), signal.slopes, max(signal.supplied, 0.0))


class Cuts:
    """Cuts that were met."""

    def __init__(self) -> None:
        self.met: list[Cut] = []

    def __iter__(self) -> Iterator[Cut]:
        return iter(self.met)

    def add(self, signal: Signal, scales: Float) -> None:
        """Keep what a signal says that was found for some scales."""
        made = Cut.of(signal, scales)
        if made is not None:
            self.met.append(made)

    def allowed(self, scales: Float) -> float:
        """Least mu that they allow at some scales; infinite where they allow none."""
        values = [0.0]
        for cut in self:
            need = cut.base + float(cut.slopes @ scales)
            values.append(need / cut.supplied if cut.supplied > 0 else np.inf if need > 0 else 0.0)
        return max(values)

    def lower(self, scales: Float, mu: float) -> float:
        """Least mu that they allow at any scales; `scales`, `mu`: the sizes of these. 0 where it is not found."""
        rows, right = self.rows(scales, mu)
        k = len(scales)
        positive = np.eye(k + 1)
        found = quadratic(positive[-1], np.vstack([-rows, positive]), np.concatenate([-right, np.zeros(k + 1)]))
        return max(found[1], 0.0) * mu if found else 0.0

    def nearest(self, scales: Float, mu: float, level: float) -> Float | None:
        """Scales nearest to some, relative to them, where they allow a level of about mu; None if there are none."""
        rows, right = self.rows(scales, mu)
        k = len(scales)
        G = np.vstack([-rows[:, :k], np.eye(k), -np.eye(k)])
        h = rows[:, :k].sum(axis=1) + rows[:, k] * level / mu - right
        found = quadratic(np.zeros(k), G, np.concatenate([h, np.full(k, 1 / BOX - 1), np.full(k, 1 - BOX)]), bend=1.0)
        return found and scales * (1 + found[0])

    def lowest(self, scales: Float, mu: float) -> Float | None:
        """Scales, relative to some, with the least mu that they allow there; None where none are found."""
        rows, right = self.rows(scales, mu)
        k = len(scales)
        each = np.eye(k + 1)[:k]
        h = np.concatenate([-right, np.full(k, 1 / BOX), np.full(k, -BOX)])
        found = quadratic(np.eye(k + 1)[-1], np.vstack([-rows, each, -each]), h)
        return found and scales * found[0][:-1]

    def middle(self, about: Float, mu: float) -> Float | None:
        """Scales in the middle of those where they allow a mu, relative to some scales; None if there are none."""
        rows = np.array([cut.slopes * about for cut in self])
        right = np.array([cut.supplied * mu - cut.base for cut in self])
        sizes, k = np.linalg.norm(rows, axis=1), len(about)
        most = BOX * (k + 1) * sizes  # of what the other side of a cut comes to
        if (right < -most).any():
            return None
        near = right < most
        rows, right = rows[near] / sizes[near, None], right[near] / sizes[near]
        apart = np.hstack([np.eye(k), -np.ones((k, 1))])  # a scale is at least its distance from what cuts it
        G = np.vstack([-np.hstack([rows, np.ones((len(rows), 1))]), apart, np.eye(k + 1), -np.eye(k + 1)[:k]])
        h = np.concatenate([-right, np.zeros(k), np.full(k, 1 / BOX), np.zeros(1), np.full(k, -BOX)])
        found = quadratic(-np.eye(k + 1)[-1], G, h)
        return found and about * found[0][:-1]

    def rows(self, scales: Float, mu: float) -> tuple[Float, Float]:
        """Cuts a x <= b in x = (lambda / scales, mu' / mu), each of unit size."""
        rows = np.array([[*(cut.slopes * scales), -cut.supplied * mu] for cut in self])
        right = -np.array([cut.base for cut in self])
        sizes = np.maximum(np.abs(rows).max(axis=1), np.abs(right))
        return rows / sizes[:, None], right / sizes
