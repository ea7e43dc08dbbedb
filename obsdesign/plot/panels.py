"""Panels of a figure: what each draws on its axes. The truth is solid, estimates are dashed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.plot.axis import growing_axis, linear_threshold, number, symlog_axis, time_axis, with_unit
from obsdesign.plot.canvas import COLORS, legend_above, shared

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from obsdesign.simulate import Run

TRUE, ESTIMATE = COLORS[:2]
DASHED = (0, (4, 2))
BOUND = COLORS[6]
DOTTED = (0, (1, 1.5))
REGION = COLORS[3]
CURVES = 7  # in one panel: as many as there are colors
SINGLE = 8  # so many signals get a panel each; more share panels
FAST = 0.1  # of the run: an error that settles sooner is drawn over the logarithm of time
PEAK = 10  # widths of the truth: a transient that takes more of a panel is cut off
GROWTH = 10  # of a signal that escapes, against its beginning


@dataclass(frozen=True)
class Curve:
    """A true signal and, if there is one, its estimate; and the region in which both should stay, if there is one."""

    name: str
    true: Array
    estimate: Array | None
    region: tuple[float, float] | None = None


@dataclass(frozen=True)
class Comparison:
    """Panel of signals over time: truth solid, estimate dashed."""

    t: Array
    curves: Sequence[Curve]
    label: str
    escapes: bool = False

    def draw(self, axes: "Axes") -> None:
        """Draw with limits that show the signals; an initial transient of an estimate may leave the panel.

        Signals that escape are drawn on an axis that is linear as far as they are at first, and logarithmic beyond.
        """
        alone = len(self.curves) == 1
        for curve, color in zip(self.curves, COLORS, strict=False):
            axes.plot(self.t, curve.true, color=color, label="true" if alone else curve.name)
            if curve.estimate is not None:
                other, label = (ESTIMATE, "estimate") if alone else (color, None)
                axes.plot(self.t, curve.estimate, color=other, linestyle=DASHED, label=label)
        if not alone:
            legend_above(axes)
        if not (self.escapes and grow(axes, self.curves)):
            low, high, cut = limits(self.curves)
            axes.set_ylim(low, high)
            axes.set_title(cut, loc="left", fontsize=8)
        for curve in self.curves:
            mark_region(axes, curve.region)
        time_axis(axes, self.t, log=False)
        axes.set_ylabel(self.label)


def comparisons(run: "Run", curves: Sequence[Curve], what: str) -> Iterator[Comparison]:
    """One panel a signal, or one for several where there are many."""
    escapes = run.status == "escape"
    if len(curves) <= SINGLE:
        yield from (Comparison(run.t, [curve], with_unit(run.spec, curve.name), escapes) for curve in curves)
    else:
        yield from (Comparison(run.t, group, what, escapes) for group in shared(curves, CURVES // 2 + 1))


class Level(NamedTuple):
    """A horizontal line of an error panel, from a time on."""

    value: float
    start: float
    label: str


def settles_early(run: "Run") -> bool:
    """Whether the error settles so soon that time is better drawn on a logarithmic axis."""
    settled = run.summary["settling_time"]
    return settled is not None and settled < FAST * run.time


def draw_errors(
    axes: "Axes", run: "Run", curves: Sequence[tuple[str, Array]], label: str, level: Level | None = None
) -> None:
    """Draw estimation errors on a symmetric logarithmic axis, linear about zero, below the errors that matter."""
    t = run.steps.t
    for (name, values), color in zip(curves, COLORS, strict=False):
        axes.plot(t, values, color=color, label=name)
    sizes = [values for _, values in curves]
    low, high = min(float(values.min()) for values in sizes), max(float(values.max()) for values in sizes)
    if level:
        axes.plot([level.start, t[-1]], 2 * [level.value], color=BOUND, linestyle=DASHED)
        axes.plot([], [], color=BOUND, linestyle=DASHED, label=level.label)
        high = max(high, level.value)
    symlog_axis(axes, linear_threshold(sizes), low, high)
    axes.axhline(0, color="black", linewidth=0.6)
    time_axis(axes, t, settles_early(run))
    axes.set_ylabel(label)
    legend_above(axes)


def draw_storage(axes: "Axes", run: "Run", V: Array, bound: Array) -> None:
    """Draw V(e) on a logarithmic axis, and its bound as long as the run is in the region of the guarantee."""
    t = run.steps.t
    tiny = float(bound.max()) * 1e-20 + 1e-300
    known = t < (run.left[0].time if run.left else np.inf)
    if known.any():
        label = "proved bound" if known.all() else "proved bound, while in the region"
        axes.plot(t[known], np.maximum(bound, tiny)[known], color=BOUND, linestyle=DASHED, label=label)
    axes.plot(t, np.maximum(V, tiny), color=TRUE)
    axes.set_yscale("log")
    time_axis(axes, t, settles_early(run))
    axes.set_ylabel("V(e) = e' P e")


def limits(curves: Sequence[Curve]) -> tuple[float, float, str]:
    """Limits of y, and a note of what they cut off.

    They hold the truth, the second half of each estimate, what `usual` tells of the first, and the region as far as it
    is no further from the truth than the truth is wide; so that a high initial transient does not hide the truth.
    """
    true = np.concatenate([c.true for c in curves])
    estimates = [c.estimate for c in curves if c.estimate is not None]
    low, high = float(true.min()), float(true.max())
    width = (high - low) or abs(high) or np.inf
    regions = [end for c in curves for end in c.region or () if np.isfinite(end)]
    ends = [np.clip(regions, low - width, high + width)] if regions else []
    seen = [true, *ends, *(usual(e, low, high, width) for e in estimates), *(e[len(e) // 2 :] for e in estimates)]
    low, high = min(float(s.min()) for s in seen), max(float(s.max()) for s in seen)
    room = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    low, high = low - room, high + room
    reached = [float(end) for e in estimates for end in (e.min(), e.max())]
    furthest = max(reached, key=lambda end: max(low - end, end - high), default=low)
    return low, high, "" if low <= furthest <= high else f"estimate reaches {number(furthest)}"


def usual(estimate: Array, low: float, high: float, width: float) -> Array:
    """Range of an estimate beside which the truth is seen, else of 90 % of its samples, within a width of the truth."""
    ends = np.array([estimate.min(), estimate.max()])
    if max(high, ends[1]) - min(low, ends[0]) <= PEAK * width:
        return ends
    most: Array = np.clip(np.quantile(estimate, [0.05, 0.95]), low - width, high + width)
    return most


def grow(axes: "Axes", curves: Sequence[Curve]) -> bool:
    """Give signals an axis on which those that escape are seen from the beginning; False if none is far from it."""
    drawn = [signal for c in curves for signal in (c.true, c.estimate) if signal is not None]
    low, high = min(float(s.min()) for s in drawn), max(float(s.max()) for s in drawn)
    begin = early(curves)
    if max(-low, high) <= GROWTH * begin:
        return False
    growing_axis(axes, begin, low, high)
    return True


def early(curves: Sequence[Curve]) -> float:
    """Power of ten above the signals in the first tenth of a run."""
    size = max(float(np.abs(c.true[: 1 + len(c.true) // 10]).max()) for c in curves)
    return float(10.0 ** np.ceil(np.log10(size or 1.0)))


def mark_region(axes: "Axes", region: tuple[float, float] | None) -> None:
    """Draw the limits of a region, as far as they are within those of the axes."""
    bottom, top = axes.get_ylim()
    for limit in region or ():
        if bottom < limit < top:
            axes.axhline(limit, color=REGION, linestyle=DOTTED, linewidth=1.5, zorder=1, label="limit of the region")
