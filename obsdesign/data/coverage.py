"""Rows of a log of which what is proved of an observer says something."""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import cast

import numpy as np

from obsdesign.data.rows import Rows
from obsdesign.design import Design
from obsdesign.families.guarantee import ROUNDING, SampledGuarantee
from obsdesign.lmi.formula import Array, Float
from obsdesign.spec import limited
from obsdesign.stepping.implemented import watched


class Coverage:
    """Whether rows, which come some at a time, are covered: from the first on that is not, none is."""

    def __init__(self, design: Design) -> None:
        self.design = design
        self.left = self.taken = False  # a row was not covered; whether there was a measurement at an instant
        self.measured: float | None = None  # s, the last measurement at an instant, or the first row
        self.latest = -math.inf  # s, of the rows that came
        self.why = ""  # a row was not covered

    def of(self, rows: Rows, q: Float, spread: Float, fresh: Array) -> Array:
        """Rows that are covered, (K,): arguments q of f in the observer (K, nq), radii of these (K, nq).

        `rows`: with times at which estimates are told; `fresh`: those whose y is used at its own time.
        """
        whole = np.isfinite(rows.y).all(axis=1) | bool(self.design.observer.jump)
        inside = np.ones(len(q), dtype=bool)
        for column, low, high in self.limits:
            inside &= (q[:, column] - spread[:, column] >= low) & (q[:, column] + spread[:, column] <= high)
        rests: dict[str, Array] = {
            "a known input is missing": ~rows.guessed,
            "y is used after its time": fresh,
            "an output is missing": np.asarray(whole),
            **self.timely(rows.t, rows.y),
            "an argument of f is, or may be, outside the region of its type": inside,
        }
        return self.kept(rests, rows.lines) & self.covers

    @cached_property
    def covers(self) -> bool:
        """Whether anything is proved of the observer, for inputs and outputs of any size."""
        return self.design.guarantee is not None and not any(block.others for block in self.design.spec.nonlinearities)

    def timely(self, t: Float, y: Float) -> dict[str, Array]:
        """Rows at which no measurement at instants is overdue, none sooner than the guarantee expects, none late.

        A measurement that came after one that was made later was not there when that was taken.
        """
        guarantee = self.design.guarantee
        if guarantee is None or not self.design.observer.jump:
            return {}
        sampled, kept = cast("SampledGuarantee", guarantee), np.ones(len(t), dtype=bool)
        reached = np.maximum.accumulate(np.concatenate([[self.latest], t]))
        self.latest = float(reached[-1])
        shortest = sampled.T1 if sampled.ahead is not None else 0.0
        for k, found in enumerate(np.isfinite(y).tolist()):
            measured = any(found)
            gap = float(t[k]) - (self.measured if self.measured is not None else float(t[k]))
            hasty = measured and self.taken and gap < shortest * (1 - ROUNDING)
            kept[k] = gap <= sampled.T2 * (1 + ROUNDING) and not hasty and measured == all(found)
            self.taken |= measured
            if measured or self.measured is None:
                self.measured = float(t[k])
        return {
            "a row came after one that was made later": t >= reached[:-1],
            "a measurement is overdue, comes before T1 or lacks an output": kept,
        }

    def kept(self, rests: Mapping[str, Array], lines: Array) -> Array:
        """Rows up to the first in which something fails on which bounds rest, (K,) by what has failed then.

        Where radii are told, the arguments of f in the plant too are where types hold: within their radius.
        """
        holds = np.asarray(np.logical_and.reduce([*rests.values()]))
        if self.left or holds.all():
            return holds & (not self.left)
        k = int(np.argmin(holds))
        self.end(next(why for why, part in rests.items() if not part[k]), int(lines[k]))
        return np.asarray(np.logical_and.accumulate(holds))

    def end(self, why: str, line: int) -> None:
        """Cover nothing from a row on."""
        if not self.left:
            self.left, self.why = True, f"{why} in line {line}, and from there on nothing is proved"

    @cached_property
    def limits(self) -> list[tuple[int, float, float]]:
        """Argument of f, and the limits within which its type holds."""
        spec = self.design.spec
        known = len(watched(spec, self.design.observer))
        return [(column, *ends) for _, _, column, ends in limited(spec.nonlinearities) if column < known]
