"""The figure of a search."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

from obsdesign.plot.axis import mark_refused, mark_shipped, plain, spread_axis, symbol
from obsdesign.plot.canvas import COLORS, drawn, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TRUE = COLORS[0]
MARKERS = "osD^vP"  # curves that coincide stay apart


def curves_sheet(curves: Sequence[Mapping[str, Any]], parameter: str, title: str) -> "Figure":
    """Draw several trade-off curves, one for each injection and relaxation: lines for the limits, marks for the gains.

    Parameters
    ----------
    curves
        Mappings with `injection`, `relaxation` and `points`: the parameter, the limit of the other quantity (gamma, or
        T2 against a decay), and `certified`, what the gains of the point are proved to achieve.
    parameter
        Key on the x axis.
    """
    figure = new_figure(6.8, 4.4)
    axes = figure.add_subplot()
    axes.set_title(plain(title), fontsize=11)
    y = next(
        (key for c in curves for p in c["points"] for key in ("gamma", "T2") if key in p and key != parameter), "gamma"
    )
    for curve, color, marker in zip(curves, cycle(COLORS), cycle(MARKERS), strict=False):
        look: dict[str, Any] = {"color": color, "markersize": 4.5}
        solved = [(p[parameter], p[y]) for p in curve["points"] if p.get(y) is not None]
        if solved:
            axes.plot(*zip(*solved, strict=True), **look)
        proved = [(p[parameter], p["certified"][y]) for p in curve["points"] if "certified" in p]
        if proved:
            axes.plot(*zip(*proved, strict=True), marker, markerfacecolor="none", **look)
        if solved or proved:
            axes.plot([], [], marker=marker, label=f"{curve['injection']}, {curve['relaxation']}", **look)
    spread_axis(axes, "x", [p[parameter] for c in curves for p in c["points"]])
    spread_axis(axes, "y", [p[y] for c in curves for p in c["points"] if p.get(y) is not None])
    axes.set_xlabel(symbol(parameter))
    axes.set_ylabel(symbol(y))
    if axes.get_legend_handles_labels()[1]:
        axes.legend(title="line: best found, mark: certified gains", title_fontsize=8, alignment="left")
    return figure


def tradeoff_sheet(
    points: Sequence[Mapping[str, Any]],
    shipped: Mapping[str, Any] | None,
    title: str,
    x: str = "alpha",
    y: str = "gamma",
) -> "Figure":
    """Draw the curve of a search; a point without a result stands at the foot, under its status.

    Points are mappings with the searched `x`, the result `y` (missing or None where there is none) and "status".
    `shipped` is the point of the design that is shipped, or None.
    """
    figure = new_figure(6.4, 4.2)
    axes = figure.add_subplot()
    axes.set_title(plain(title), fontsize=11)
    solved = sorted((p[x], p[y]) for p in points if p.get(y) is not None)
    if solved:
        axes.plot(*zip(*solved, strict=True), color=TRUE, marker="o", markersize=3.5, label=f"best {symbol(y)}")
    axes.margins(y=0.1)
    mark_refused(axes, [p[x] for p in points], [str(p["status"]) if p.get(y) is None else None for p in points])
    if shipped is not None:
        mark_shipped(axes, shipped[x], shipped[y])
    spread_axis(axes, "x", [p[x] for p in points])
    spread_axis(axes, "y", [value for _, value in solved])
    axes.set_xlabel(symbol(x))
    axes.set_ylabel(symbol(y))
    axes.legend()
    return figure


curves_figure, tradeoff_figure = drawn(curves_sheet), drawn(tradeoff_sheet)
