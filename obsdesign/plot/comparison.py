"""The figure of a comparison: states with the estimates of every observer, and errors with noise."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.plot.axis import DECADES, finite, plain, time_axis, with_unit
from obsdesign.plot.canvas import COLORS, Panel, compose, drawn, legend_below, log_ticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from obsdesign.simulate.comparison import Comparison, Entrant

PALETTE = (*COLORS[:-1], "#8C564B", "#7F7F7F", "#ADA200")  # the truth is black
TITLE = 70  # letters of the name
LINES = ((0, (5, 1.5)), (0, (1, 1)), (0, (4, 1, 1, 1)), (0, (8, 2)), (0, (2, 2)))  # of estimates that coincide
CELLS = 400  # of time, in each of which the largest error is drawn
WIDEST = 2.2
FAST = 0.02  # of the horizon: where an error settles sooner, time is drawn on a logarithmic axis
BEFORE = 0.2  # of the first settling time, from which on a logarithmic axis is drawn
ROOM = 0.5  # of the height of the truth, which estimates may take beyond it on each side


@dataclass(frozen=True)
class Look:
    """How an observer is drawn."""

    label: str
    color: str
    line: tuple[int, tuple[float, ...]]
    width: float  # of its errors: the first are the widest, to be seen below the others


def looks(comparison: "Comparison") -> list[Look]:
    """One for each observer; what nothing is proved of says so."""
    return [
        Look(
            plain(one.label) + ("" if one.design.proved else " (no guarantee)"),
            PALETTE[k % len(PALETTE)],
            LINES[k % len(LINES)],
            max(WIDEST - 0.5 * k, 0.7),
        )
        for k, one in enumerate(comparison.entrants)
    ]


def comparison_sheet(comparison: "Comparison") -> "Figure":
    """Draw truth and estimates of each state without noise, and below them the errors, with noise if there is any."""
    first = comparison.entrants[0]
    names = list(first.run.summary["settling"])
    estimates: list[Panel] = [states_panel(comparison, i) for i in range(first.run.plant_states)]
    count, noise = len(comparison.entrants), "with noise" if first.spread else "without noise"
    figure = compose(
        f"{plain(comparison.title, TITLE)}: {count} observer{'s' if count > 1 else ''}, errors {noise}",
        [estimates, [error_panel(comparison, name) for name in names]],
    )
    legend_below(figure)
    return figure


comparison_figure = drawn(comparison_sheet)


def states_panel(comparison: "Comparison", i: int) -> Panel:
    """Panel of a state."""
    first = comparison.entrants[0].run

    def draw(axes: "Axes") -> None:
        signals, name = comparison.entrants[0].record.signals, first.states[i]
        truth = finite(signals.xi[:, i])
        axes.plot(signals.t, truth, color="black", linewidth=1.8, label="true")
        for look, one in zip(looks(comparison), comparison.entrants, strict=True):
            estimate = finite(one.record.signals.xihat[:, one.run.states.index(name)])
            axes.plot(one.record.t, estimate, color=look.color, linestyle=look.line, label=look.label)
        height = float(np.ptp(truth)) or abs(float(truth[0])) or 1.0
        low, high = axes.get_ylim()
        axes.set_ylim(max(low, truth.min() - ROOM * height), min(high, truth.max() + ROOM * height))
        limit_time(axes, comparison)
        axes.set_ylabel(with_unit(comparison.entrants[0].design.spec, name))

    return draw


def error_panel(comparison: "Comparison", name: str) -> Panel:
    """Panel of the errors of an estimate, on a logarithmic axis."""

    def draw(axes: "Axes") -> None:
        top = 0.0
        for look, (_, t, size) in zip(looks(comparison), sizes(comparison, name), strict=True):
            seen = size > 0
            axes.plot(t[seen], size[seen], color=look.color, linewidth=look.width, label=look.label)
            top = max(top, float(size.max(initial=0.0)))
        if top > 0:
            axes.set_yscale("log")
            axes.set_ylim(max(axes.get_ylim()[0], top * 10.0**-DECADES), 2 * top)
            log_ticks(axes)
        limit_time(axes, comparison)
        axes.set_ylabel(f"|e| of {with_unit(comparison.entrants[0].design.spec, name)}")

    return draw


def sizes(comparison: "Comparison", name: str) -> Iterator[tuple["Entrant", Array, Array]]:
    """Largest |e| of each observer in cells of time; nothing of one that does not estimate it."""
    for one in comparison.entrants:
        t, e = one.errors.get(name, (np.zeros(0), np.zeros(0)))
        size = np.abs(np.nan_to_num(finite(e)))
        if len(t) > 2 * CELLS:
            scale = np.log(np.maximum(t, t[t > 0][0])) if settle_early(comparison) else t
            cells = np.unique(np.searchsorted(scale, np.linspace(scale[0], scale[-1], CELLS, endpoint=False)))
            t, size = t[cells], np.maximum.reduceat(size, cells)
        yield one, t, size


def settled(comparison: "Comparison", share: str) -> list[float]:
    """Times at which errors that there were at first have settled, in order."""
    times = [state[share] for one in comparison.entrants for state in one.run.summary["settling"].values()]
    return sorted(t for t in times if t)


def settle_early(comparison: "Comparison") -> bool:
    """Whether an error settles so soon that time is better drawn on a logarithmic axis."""
    return any(t < FAST * comparison.entrants[0].run.time for t in settled(comparison, "t1"))


def limit_time(axes: "Axes", comparison: "Comparison") -> None:
    """Label and limit the axis of time; on a logarithmic one at most six decades, before the first has settled."""
    t, end = comparison.entrants[0].run.t, comparison.entrants[0].run.time
    time_axis(axes, end)
    if settle_early(comparison):
        first = min([t[1], *(BEFORE * time for time in settled(comparison, "t5"))])
        axes.set_xscale("log")
        axes.set_xlim(max(float(first), 1e-6 * end), end)
        log_ticks(axes, "x")
