"""The figure of many runs: the error of every estimate, its median, the middle of the runs, and the worst one."""

from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from obsdesign.plot.axis import DECADES, plain, time_axis, with_unit
from obsdesign.plot.canvas import BOUND, ESTIMATE, TRUE, Panel, compose, drawn, legend_below, log_ticks
from obsdesign.plot.comparison import name_axis
from obsdesign.tables.text import checked_until, seed_range

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from obsdesign.simulate.montecarlo import MonteCarlo

LINE, LINES = 120, 3  # letters of a line of the heading, and lines at most
FAST, SETTLED = 0.02, 0.05  # of the horizon: where a median falls to such a part sooner, time is logarithmic


def envelope_sheet(found: "MonteCarlo") -> "Figure":
    """Draw |error| of every estimate over time: the band of 5 to 95 % of the runs, the median, the worst run."""
    figure = compose(heading(found), [[panel(found, k) for k in range(len(found.names))]])
    legend_below(figure)
    return figure


envelope_figure = drawn(envelope_sheet)


def heading(found: "MonteCarlo") -> str:
    """Name of the spec, number of runs, and what is proved of them or that nothing is."""
    report = found.report
    lost = len(report["escaped"]) + len(report["stalled"])
    runs = report["runs"]
    said = [f"{runs} run{'s' * (runs > 1)}, {seed_range(report)}", promise(found)]
    said += [f"{lost} of them did not go on to the end, and are not drawn"] if lost else []
    said += [f"{len(report['left_region'])} left the region of the declared types"] if report["left_region"] else []
    said += ["nothing is drawn: every run is the same"] if found.same else []
    told = wrap(plain("; ".join(said), LINES * LINE), LINE, max_lines=LINES, placeholder=" …")
    return "\n".join([plain(found.spec.name, LINE), *told])


def promise(found: "MonteCarlo") -> str:
    """How the runs keep the bounds that are proved of them."""
    bounds = found.report["bounds"]
    if found.why or not bounds:
        return "no guarantee" if found.why else "no bound is checked"
    if broken := sum(not bound["holds"] for bound in bounds):
        return f"{broken} of {len(bounds)} bounds VIOLATED"
    every = all(bound["checked"] == found.report["runs"] for bound in bounds)
    said = f"{len(bounds)} proved bounds hold in every run{'' if every else ' of which they are stated'}"
    stated = [one for one in found.members if one.bounds]
    cut = {one.seed: one.bounds[0]["until"] for one in stated if "until" in one.bounds[0]}
    why = dict.fromkeys(one.cut_by for one in stated if one.seed in cut)
    least = min(cut.values(), default=None)
    until = checked_until({"checked": len(stated), "cut": len(cut), "cut_by": [*why], "until": least})
    return ", ".join(filter(None, (said, until)))


def panel(found: "MonteCarlo", k: int) -> Panel:
    """Panel of one estimate."""
    name, curves = found.names[k], found.envelope(k)
    median, low, high, worst = (np.where(column > 0, column, np.nan) for column in curves.T)
    seed = found.report["errors"][name]["worst_rms_seed"]

    def draw(axes: "Axes") -> None:
        axes.fill_between(found.t, low, high, color=TRUE, alpha=0.25, linewidth=0, label="5 to 95 % of the runs")
        axes.plot(found.t, median, color=TRUE, label="median")
        axes.plot(found.t, worst, color=ESTIMATE, linewidth=0.9, label="the run of largest rms")
        if seed is None:
            axes.text(0.5, 0.5, "no run came to its end", transform=axes.transAxes, ha="center", color=BOUND)
        else:
            axes.set_title(f"worst: seed {seed}", loc="left", fontsize=8)
        seen = curves[np.isfinite(curves) & (curves > 0)]
        if seen.size:
            axes.set_yscale("log")
            axes.set_ylim(max(0.5 * seen.min(), seen.max() * 10.0**-DECADES), 2 * seen.max())
            log_ticks(axes)
        simulation = found.spec.simulation
        assert simulation
        time_axis(axes, simulation.horizon)
        if early(found):
            axes.set_xscale("log")
            axes.set_xlim(found.t[found.t > 0][0], simulation.horizon)
            log_ticks(axes, "x")
        name_axis(axes, f"|e| of {with_unit(found.spec, name)}")

    return draw


def early(found: "MonteCarlo") -> bool:
    """Whether the median of an error has settled so soon that time is better drawn on a logarithmic axis."""
    medians = (found.envelope(k)[:, 0] for k in range(len(found.names)))
    limits = ((size, SETTLED * np.nanmax(size)) for size in medians if np.isfinite(size).any() and np.nanmax(size) > 0)
    settled = (found.t[np.flatnonzero(size > limit)[-1]] for size, limit in limits)
    return found.spec.period is None and any(t < FAST * found.t[-1] for t in settled)
