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


def estimates_sheet(name: str, header: Sequence[str], rows: Float, report: Mapping[str, Any]) -> "Figure":
    """Draw estimates (one panel each, shaded where their error is proved to be) and innovations along a log.

    `header`, `rows`: columns as in the file of estimates; `report`: what is said of them.
    """
    columns = dict(zip(header, rows.T, strict=True))
    t = columns["t"]
    estimates = [head.removeprefix("hat_") for head in header if head.startswith("hat_")][:MOST]
    outputs = [head.removeprefix("innov_") for head in header if head.startswith("innov_")][:MOST]
    panels: list[Panel] = [partial(draw_estimate, t=t, name=one, columns=columns) for one in estimates]
    below: list[Panel] = [partial(draw_innovation, t=t, name=one, columns=columns, report=report) for one in outputs]
    figure = compose(f"{name}\nestimates on a log of {report['rows']:,} rows", [panels, below])
    legend_below(figure)
    return figure


def draw_estimate(axes: "Axes", t: Float, name: str, columns: Mapping[str, Float]) -> None:
    """An estimate, and where the truth is within its radius, as long as the guarantee covers the row."""
    estimate, radius = columns[f"hat_{name}"], columns.get(f"radius_{name}")
    axes.plot(t, estimate, color=ESTIMATE, label="estimate")
    if radius is not None:
        held = columns["covered"] > 0
        low, high = estimate - radius, estimate + radius
        axes.fill_between(t, low, high, where=list(held), color=ESTIMATE, alpha=0.2, lw=0, label="within its radius")
        span = float(np.ptp(estimate)) or 1.0
        middle = float(estimate.max() + estimate.min()) / 2
        widest = max(span, 2 * float(np.median(radius)))
        axes.set_ylim(middle - widest, middle + widest)
    axes.set(xlabel="t [s]", ylabel=name)


def draw_innovation(axes: "Axes", t: Float, name: str, columns: Mapping[str, Float], report: Mapping[str, Any]) -> None:
    """The innovation of an output, with its size."""
    told = report["innovations"][name]
    axes.plot(t, columns[f"innov_{name}"], color=COLORS[2], lw=0.7, label="innovation")
    white = "" if told["white"] is None else f", p = {told['white']:.2g} if white"
    rms = "" if told["rms"] is None else f"rms {told['rms']:.3g}"
    axes.set(xlabel="t [s]", ylabel=f"{name} less expected", title=f"{rms}{white}")


estimates_figure = drawn(estimates_sheet)
