"""The figure of a run of an observer with measurements at instants."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.plot.axis import time_axis
from obsdesign.plot.canvas import COLORS, Panel, compose, drawn, legend_above, legend_below, shared
from obsdesign.plot.panels import BOUND, CURVES, DASHED, ESTIMATE, TRUE, Comparison, Curve, comparisons, grow
from obsdesign.plot.run import ended, offset, region_panels, titled, verdict
from obsdesign.tables.text import at_least, at_most

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from obsdesign.simulate import Run, Schedule

DOTS = 400  # instants that are marked by dots; more would be a bar
NARROW = 130  # instants that are marked by dots on a curve
LOST = COLORS[3]
SHADE = "#F3D9D2"


def hybrid_sheet(run: "Run") -> "Figure":
    """Draw states with their estimates at the measurements, w, theta, |(e, d)| against its bound, and the intervals.

    Where a measurement is overdue, so that nothing is guaranteed any more, the panels are shaded.
    """
    schedule = run.schedule
    assert schedule
    states = [Curve(name, run.xi[:, i], run.xihat[:, i]) for i, name in enumerate(run.states)]
    inputs = [Curve(name, run.w[:, i], None) for i, name in enumerate(run.exogenous)]
    observed = comparisons(run, states, "states (dashed: estimates)")
    sections: tuple[list[Panel], ...] = (
        [partial(draw_sampled, panel=panel, schedule=schedule) for panel in observed],
        [*(panel.draw for panel in comparisons(run, inputs, "unknown inputs")), *injections(run), *region_panels(run)],
        [partial(draw_distance, run=run), partial(draw_intervals, schedule=schedule)],
    )
    figure = compose(heading(run), sections)
    if run.guarantee is not None and run.until < run.time:
        for axes in figure.axes:
            axes.axvspan(run.until, run.time, color=SHADE, linewidth=0, zorder=0, label="nothing is guaranteed")
    legend_below(figure)
    return figure


hybrid_figure = drawn(hybrid_sheet)


def draw_sampled(axes: "Axes", panel: Comparison, schedule: "Schedule") -> None:
    """Draw states and estimates, a dot on each of these at each of a few measurements, a cross where one is lost."""
    panel.draw(axes)
    alone = len(panel.curves) == 1
    at = schedule.received[schedule.received <= panel.t[-1]]
    for curve, color in zip(panel.curves, COLORS, strict=False):
        if curve.estimate is not None and len(at) <= NARROW:
            other, label = (ESTIMATE, "at a measurement") if alone else (color, None)
            axes.plot(at, np.interp(at, panel.t, curve.estimate), ".", color=other, markersize=4, label=label)
    mark_lost(axes, schedule)


def draw_injection(axes: "Axes", t: Array, curves: Sequence[Curve], escapes: bool) -> None:
    """Draw theta, with its jumps at the measurements as they are."""
    for curve, color in zip(curves, COLORS, strict=False):
        axes.plot(t, curve.true, color=color, linewidth=1.0, label=curve.name)
    if escapes:
        grow(axes, curves)
    time_axis(axes, t, log=False)
    axes.set_ylabel(r"correction $\theta$")
    legend_above(axes)


def draw_distance(axes: "Axes", run: "Run") -> None:
    """Draw |(e, d)|, d = C e - theta, with dots at the measurements, and what is proved of it."""
    steps = run.steps
    floor = lowest(steps.distance)
    distance = np.maximum(steps.distance, floor)
    known = steps.t < run.until
    if steps.distance_bound is not None and known.any():
        limit = np.maximum(steps.distance_bound[known], floor)
        axes.plot(steps.t[known], limit, color=BOUND, linestyle=DASHED, label="proved bound")
    axes.plot(steps.t, distance, color=TRUE)
    after = np.flatnonzero(np.diff(steps.j, prepend=0))
    if len(after) <= DOTS:
        axes.plot(steps.t[after], distance[after], ".", color=TRUE, markersize=3.5)
    axes.set_yscale("log")
    axes.set_ylim(bottom=floor)
    time_axis(axes, steps.t, log=False)
    axes.set_ylabel(r"$|(e, d)|$, $d = C e - \theta$")


def draw_intervals(axes: "Axes", schedule: "Schedule") -> None:
    """Draw the time from each measurement to the next where it ends, and T1 and T2."""
    size = 3 if len(schedule.received) <= DOTS else 1
    axes.plot(schedule.received, schedule.intervals, ".", color=TRUE, markersize=size)
    for limit, name in ((schedule.T1, "$T_1$"), (schedule.T2, "$T_2$")):
        axes.axhline(limit, color=BOUND, linewidth=0.8, linestyle=DASHED)
        axes.annotate(name, (1, limit), xycoords=("axes fraction", "data"), xytext=(3, -3), textcoords="offset points")
    mark_lost(axes, schedule)
    axes.set_ylim(0, 1.15 * max(float(schedule.intervals.max(initial=0.0)), schedule.T2))
    time_axis(axes, np.array([0.0, schedule.horizon]), log=False)
    axes.set_ylabel("interval before it [s]")


def lowest(distance: Array) -> float:
    """Foot of a logarithmic axis, below where the distance begins, mostly is and ends, but not below rounding."""
    peak = float(distance.max()) or 1.0
    ends = [float(d) for d in (distance[0], np.median(distance), distance[-1]) if d > 0]
    return 0.3 * max(min(ends, default=peak), 1e-16 * peak)


def injections(run: "Run") -> Iterator[Panel]:
    """Panels of theta, at the steps, which hold it before and after each jump."""
    curves = [Curve(f"theta_{name}", run.steps.theta[:, i], None) for i, name in enumerate(run.outputs)]
    for group in shared(curves, CURVES):
        yield partial(draw_injection, t=run.steps.t, curves=group, escapes=run.status == "escape")


def mark_lost(axes: "Axes", schedule: "Schedule") -> None:
    """Put a cross at the foot of a panel for each measurement that is lost."""
    if 0 < len(schedule.lost) <= DOTS:
        foot = [0.03] * len(schedule.lost)
        at = axes.get_xaxis_transform()
        axes.plot(schedule.lost, foot, "x", color=LOST, markersize=4, transform=at, label="measurement lost")


def heading(run: "Run") -> str:
    """Name of the spec; how the run ended, what it achieved and what is proved; what is wrong with the sampling."""
    summary, guarantee = run.summary, run.guarantee
    facts = ended(run, f"{run.time:.4g}")
    facts += [rf"$\|z\|_2$ = {summary['z_norm2']:.4g}", rf"$\|w\|_2$ = {summary['v_norm2']:.4g}"]
    facts.append(f"{summary['sampling']['received']} measurements")
    promises = ["no guarantee"]
    if guarantee is not None:
        gamma, decay = at_most(guarantee.gamma, 4), at_least(guarantee.rates().alpha, 4)
        begins = offset(summary["initial_distance"])
        proved = rf"$\gamma$ = {gamma} from zero error{begins}, {guarantee.symbol} = {decay}"
        until = f" until t = {run.until:.4g}" if run.until < run.time else ""
        promises = [f"proved: {proved}", verdict(run, until)]
    return titled(run, facts, promises)
