"""The figure of several observers on a log: estimates, their errors where the truth is known, else innovations."""

from typing import TYPE_CHECKING

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.plot.axis import DECADES, finite, plain, with_unit
from obsdesign.plot.canvas import Panel, compose, drawn, legend_below, log_ticks
from obsdesign.plot.comparison import LABEL, MOST, ROW, TIMES, TITLE, looks_of, name_axis, peaks, room, told_panel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from obsdesign.data.comparison import LogComparison, LogEntrant

NOTE = (
    "Sizes are drawn without dips that are narrower than a twentieth of the panel. rms: over the last 5/6 of the log."
)


def recorded_sheet(comparison: "LogComparison") -> "Figure":
    """Draw every estimate of all observers, their errors or innovations on one axis, and a table of their sizes."""
    entrants = comparison.entrants
    names = list(dict.fromkeys(name for one in entrants for name in one.design.observer.estimates))[:MOST]
    truth = [name for name in names if any(name in one.truth for one in entrants)]
    outputs = [] if truth else list(entrants[0].design.spec.plant.outputs)[:MOST]
    count = len(entrants)
    lines = [NOTE]
    known = "errors" if truth else "innovations"
    figure = compose(
        f"{plain(comparison.title, TITLE)}: {count} observer{'s' if count > 1 else ''} on a log, estimates and {known}",
        [
            [estimate_panel(comparison, name) for name in names],
            [error_panel(comparison, name) for name in truth] or [error_panel(comparison, y, True) for y in outputs],
        ],
        foot=(told_panel(table(entrants, truth), lines), ROW * (count + 2.5 + room(lines))),
    )
    legend_below(figure)
    return figure


recorded_figure = drawn(recorded_sheet)


def estimate_panel(comparison: "LogComparison", name: str) -> Panel:
    """Panel of a signal: its truth, where the log has it, and its estimates."""

    def draw(axes: "Axes") -> None:
        entrants = comparison.entrants
        known = next((one for one in entrants if name in one.truth), None)
        if known is not None:
            t, values = in_order(known, name)
            axes.plot(t, finite(values), color="black", linewidth=1.8, label="true")
        for look, one in zip(looks_of(len(entrants)), entrants, strict=True):
            t, values = in_order(one, f"hat_{name}")
            axes.plot(t, finite(values), color=look.color, linestyle=look.line)
        axes.set_xlim(*comparison.span)
        axes.set_xlabel("t [s]")
        name_axis(axes, with_unit(entrants[0].design.spec, name))

    return draw


def error_panel(comparison: "LogComparison", name: str, innovation: bool = False) -> Panel:
    """Panel of the sizes of errors, or innovations, on a logarithmic axis."""

    def draw(axes: "Axes") -> None:
        top, entrants = 0.0, comparison.entrants
        for look, one in zip(looks_of(len(entrants)), entrants, strict=True):
            t, values = in_order(one, f"innov_{name}" if innovation else f"hat_{name}")
            if not innovation:
                values = values - in_order(one, name)[1] if name in one.truth else values[:0]
            known = np.isfinite(values)
            t, size = peaks(t[: len(values)][known], values[known], early=False)
            seen = size > 0
            axes.plot(t[seen], size[seen], color=look.color, linestyle=look.line, linewidth=look.width)
            top = max(top, float(size.max(initial=0.0)))
        if top > 0:
            axes.set_yscale("log")
            axes.set_ylim(max(axes.get_ylim()[0], top * 10.0**-DECADES), 2 * top)
            log_ticks(axes)
        axes.set_xlim(*comparison.span)
        axes.set_xlabel("t [s]")
        what = "|innovation|" if innovation else "|e|"
        name_axis(axes, f"{what} of {with_unit(entrants[0].design.spec, name)}")

    return draw


def in_order(one: "LogEntrant", head: str) -> tuple[Float, Float]:
    """Times and values of a column, by time; none where it is not there."""
    t, values = one.column("t"), one.column(head)
    if t is None or values is None:
        return np.zeros(0), np.zeros(0)
    order = np.argsort(t, kind="stable")
    return t[order], values[order]


def number(value: float | None) -> str:
    """Number of a cell; empty where there is none."""
    return "" if value is None else f"{value:.4g}"


def proved_of(one: "LogEntrant") -> str:
    """Whether something is proved of an observer, in a word or two."""
    if not one.design.proved:
        return "no guarantee"
    return "yes" if one.followed else "not of its steps"


def table(entrants: "Sequence[LogEntrant]", truth: list[str]) -> list[tuple[str, ...]]:
    """Columns of a line an observer: what is proved, and rms of innovations and errors."""
    told = [one.written() for one in entrants]
    proved = tuple(proved_of(one) for one in entrants)
    columns = [
        ("observer", *(plain(one.label, LABEL) for one in entrants)),
        ("type", *(one.design.spec.observer.type for one in entrants)),
        ("proved", *proved),
        ("order", *(str(one.order) for one in entrants)),
    ]
    for name in list(entrants[0].design.spec.plant.outputs)[:TIMES]:
        sizes = (number(one["innovation_rms"][name]) for one in told)
        columns.append((f"rms of y - ŷ, {plain(name, 18)}", *sizes))
    for name in truth[:TIMES]:
        sizes = (number(one["states"].get(name, {}).get("error_rms")) for one in told)
        columns.append((f"rms of e, {plain(name, 18)}", *sizes))
    return columns
