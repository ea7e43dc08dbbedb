"""Rows of a log of which what is proved of an observer says something."""

from functools import cached_property
from typing import cast

import numpy as np

from obsdesign.design import Design
from obsdesign.families.guarantee import ROUNDING, SampledGuarantee
from obsdesign.lmi.formula import Array, Float
from obsdesign.spec import limited
from obsdesign.stepping.implemented import watched


class Coverage:
    """Whether rows, which come some at a time, are covered: from the first on that is not, none is."""

    def __init__(self, design: Design, *, late: bool) -> None:
        self.design = design
        self.late = late  # whether measurements are taken at their own time, whenever they come
        self.left = self.taken = False  # a row was not covered; whether there was a measurement at an instant
        self.measured: float | None = None  # s, the last measurement at an instant, or the first row

    def of(self, t: Float, y: Float, q: Float, spread: Float, fresh: Array) -> Array:
        """Rows that are covered: t (K,), y (K, ny), arguments q of f in the observer (K, nq), radii of these (K, nq).

        `fresh`: rows in which no known input is missing, and whose y is used at its own time.
        """
        known = fresh & (np.isfinite(y).all(axis=1) | bool(self.design.observer.jump))
        return self.inside(q, spread, known & self.timely(t, y)) & self.covers

    @cached_property
    def covers(self) -> bool:
        """Whether anything is proved of the observer, for inputs and outputs of any size."""
        return self.design.guarantee is not None and not any(block.others for block in self.design.spec.nonlinearities)

    def timely(self, t: Float, y: Float) -> Array:
        """Rows at which no measurement at instants is overdue, and none came sooner than the guarantee expects."""
        guarantee = self.design.guarantee
        if guarantee is None or not self.design.observer.jump or self.late:
            return np.ones(len(t), dtype=bool)
        sampled, kept = cast("SampledGuarantee", guarantee), np.ones(len(t), dtype=bool)
        shortest = sampled.T1 if sampled.ahead is not None else 0.0
        for k, found in enumerate(np.isfinite(y).tolist()):
            measured = any(found)
            gap = float(t[k]) - (self.measured if self.measured is not None else float(t[k]))
            hasty = measured and self.taken and gap < shortest * (1 - ROUNDING)
            kept[k] = gap <= sampled.T2 * (1 + ROUNDING) and not hasty and measured == all(found)
            self.taken |= measured
            if measured or self.measured is None:
                self.measured = float(t[k])
        return kept

    def inside(self, q: Float, spread: Float, kept: Array) -> Array:
        """Rows up to which the arguments of f stay where the types hold, and nothing that bounds rest on is missing.

        Where radii are told, those of the plant too: within the radius of its argument of that in the observer.
        `spread`: these radii, (K, nq); `kept`: rows in which nothing is missing or late.
        """
        for column, low, high in self.limits:
            kept &= (q[:, column] - spread[:, column] >= low) & (q[:, column] + spread[:, column] <= high)
        if self.left:
            return np.zeros(len(q), dtype=bool)
        kept = np.logical_and.accumulate(kept)
        self.left = not kept.all()
        return kept

    @cached_property
    def limits(self) -> list[tuple[int, float, float]]:
        """Argument of f, and the limits within which its type holds."""
        spec = self.design.spec
        known = len(watched(spec, self.design.observer))
        return [(column, *ends) for _, _, column, ends in limited(spec.nonlinearities) if column < known]
