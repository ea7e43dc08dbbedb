"""The figure of estimates on a log: each with what is proved of it, and innovations."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.plot.canvas import COLORS, ESTIMATE, Panel, compose, drawn, legend_below

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST = 6  # estimates, and as many innovations
FULL = 0.9  # share of rows with a measurement from which on they are a line


def estimates_sheet(
    name: str, header: Sequence[str], rows: Float, report: Mapping[str, Any], units: Mapping[str, str]
) -> "Figure":
    """Draw estimates (one panel each, shaded where their error is proved to be) and innovations along a log.

    `header`, `rows`: columns as in the file of estimates; `report`: what is said of them; `units`: of the signals.
    """
    columns = dict(zip(header, rows[np.argsort(rows[:, 0], kind="stable")].T, strict=True))
    t = columns["t"]
    estimates = [head.removeprefix("hat_") for head in header if head.startswith("hat_")][:MOST]
    outputs = [head.removeprefix("innov_") for head in header if head.startswith("innov_")][:MOST]
    panels: list[Panel] = [partial(draw_estimate, t=t, name=one, columns=columns, units=units) for one in estimates]
    told: dict[str, Any] = {"columns": columns, "report": report, "units": units}
    below: list[Panel] = [partial(draw_innovation, t=t, name=one, **told) for one in outputs]
    figure = compose(f"{name}\nestimates on a log of {report['rows']:,} rows", [panels, below])
    legend_below(figure)
    return figure


def draw_estimate(axes: "Axes", t: Float, name: str, columns: Mapping[str, Float], units: Mapping[str, str]) -> None:
    """An estimate, and where the truth is within its radius, as long as the guarantee covers the row."""
    estimate, radius = columns[f"hat_{name}"], columns.get(f"radius_{name}")
    axes.plot(t, estimate, color=ESTIMATE, label="estimate")
    if radius is not None and np.isfinite(radius).any():
        low, high = estimate - radius, estimate + radius
        proved = list(np.isfinite(radius))
        axes.fill_between(t, low, high, where=proved, color=ESTIMATE, alpha=0.2, lw=0, label="within its radius")
        span = float(np.ptp(estimate)) or 1.0
        middle = float(estimate.max() + estimate.min()) / 2
        widest = max(span, 2 * float(np.nanmedian(radius)))
        axes.set_ylim(middle - widest, middle + widest)
    axes.set(xlabel="t [s]", ylabel=with_unit(name, units))


def draw_innovation(
    axes: "Axes",
    t: Float,
    name: str,
    columns: Mapping[str, Float],
    report: Mapping[str, Any],
    units: Mapping[str, str],
) -> None:
    """The innovation of an output, with its size."""
    told = report["innovations"][name]
    known = np.isfinite(columns[f"innov_{name}"])
    look: dict[str, Any] = {"lw": 0.7} if known.mean() > FULL else {"lw": 0, "marker": ".", "markersize": 3}
    axes.plot(t[known], columns[f"innov_{name}"][known], color=COLORS[2], label="innovation", **look)
    white = "" if told["white"] is None else f", p = {told['white']:.2g} if white"
    white = ", zero to rounding" if "zero_to_rounding" in told else white
    rms = "" if told["rms"] is None else f"rms {told['rms']:.3g}"
    axes.set(xlabel="t [s]", ylabel=f"{with_unit(name, units)} less expected", title=f"{rms}{white}")


def with_unit(name: str, units: Mapping[str, str]) -> str:
    """Label of a signal."""
    return f"{name} [{units[name]}]" if name in units else name


estimates_figure = drawn(estimates_sheet)
