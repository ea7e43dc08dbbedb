"""Panels of a run of an observer with measurements at instants."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.plot.axis import finite, plain, thinned, time_axis
from obsdesign.plot.canvas import BOUND, COLORS, DOT_DASHED, DOTTED, TRUE, legend_above, log_ticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from obsdesign.simulate import Run, Schedule

DOTS = 400  # instants that are marked by dots; more would be a bar
LOST = COLORS[3]


def draw_injection(axes: "Axes", run: "Run", which: Sequence[int]) -> None:
    """Draw some components of theta at the steps, which hold it before and after each jump."""
    theta = finite(run.steps.theta)
    lines = [axes.plot(run.steps.t, theta[:, i], color=c)[0] for i, c in zip(which, COLORS, strict=False)]
    time_axis(axes, run.time)
    axes.set_ylabel("correction θ")
    legend_above(axes, lines, [f"θ of {plain(run.outputs[i])}" for i in which])


def draw_distance(axes: "Axes", run: "Run") -> None:
    """Draw |(e, d)|, d = C e - theta, or |e|, with dots at the measurements, and what is proved of it."""
    steps = run.steps
    floor = lowest(steps.distance)
    distance = finite(np.maximum(steps.distance, floor))
    known = steps.t < run.until
    if steps.distance_bound is not None and known.any():
        limit = finite(np.maximum(steps.distance_bound[known], floor))
        label = f"proved bound on {run.length}"
        axes.plot(*thinned(steps.t[known], limit), color=BOUND, linestyle=DOTTED, label=label)
    axes.plot(*thinned(steps.t, distance), color=TRUE)
    after = np.flatnonzero(np.diff(steps.j, prepend=0))
    if len(after) <= DOTS:
        axes.plot(steps.t[after], distance[after], ".", color=TRUE, markersize=3.5)
    axes.set_yscale("log")
    axes.set_ylim(bottom=floor)
    log_ticks(axes)
    time_axis(axes, run.time)
    axes.set_ylabel(f"{run.length}, d = C e - θ" if "d" in run.length else run.length)


def draw_intervals(axes: "Axes", schedule: "Schedule") -> None:
    """Draw the time from each measurement to the next where it ends, and T1 and T2."""
    size = 3 if len(schedule.received) <= DOTS else 1
    axes.plot(schedule.received, schedule.intervals, ".", color=TRUE, markersize=size)
    for limit, name in ((schedule.T1, "T1"), (schedule.T2, "T2")):
        axes.axhline(limit, color=BOUND, linewidth=0.8, linestyle=DOT_DASHED)
        axes.annotate(name, (1, limit), xycoords=("axes fraction", "data"), xytext=(3, -3), textcoords="offset points")
    mark_lost(axes, schedule)
    axes.set_ylim(0, 1.15 * max(float(schedule.intervals.max(initial=0.0)), schedule.T2))
    time_axis(axes, schedule.horizon)
    axes.set_ylabel("sampling interval [s]")


def lowest(distance: Array) -> float:
    """Foot of a logarithmic axis, below where the distance begins, mostly is and ends, but not below rounding."""
    peak = float(distance.max()) or 1.0
    ends = [float(d) for d in (distance[0], np.median(distance), distance[-1]) if d > 0]
    return 0.3 * max(min(ends, default=peak), 1e-16 * peak)


def mark_lost(axes: "Axes", schedule: "Schedule") -> None:
    """Put a cross at the foot of a panel for each measurement that is lost."""
    if 0 < len(schedule.lost) <= DOTS:
        foot = [0.03] * len(schedule.lost)
        at = axes.get_xaxis_transform()
        axes.plot(schedule.lost, foot, "x", color=LOST, markersize=4, transform=at, label="measurement lost")
