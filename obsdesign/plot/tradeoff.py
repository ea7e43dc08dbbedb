"""The figure of a search."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

from obsdesign.families.outcome import BETTER
from obsdesign.plot.axis import mark_refused, mark_shipped, plain, spread_axis
from obsdesign.plot.canvas import COLORS, DOTTED, TRUE, drawn, legend_below, new_figure
from obsdesign.plot.traded import NAMES, short
from obsdesign.tables.text import at_least, at_most

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKERS = "osD^vP"  # curves that coincide stay apart


def curves_sheet(
    curves: Sequence[Mapping[str, Any]], parameter: str, title: str, names: Mapping[str, str] = NAMES
) -> "Figure":
    """Draw several trade-off curves, one for each injection and relaxation: lines for the limits, marks for the gains.

    A dotted line is the gamma that the gains do have where measurements are periodic: none below it can be proved.

    Parameters
    ----------
    curves
        Mappings with `injection`, `relaxation` and `points`: the parameter, the limit of the other quantity (gamma, or
        T2 against a decay), and `certified`, what the gains of the point are proved to achieve.
    parameter
        Key on the x axis.
    title, names
        Title, and names of the quantities by their keys.
    """
    figure, axes = sheet(title)
    y = next(
        (key for c in curves for p in c["points"] for key in ("gamma", "T2") if key in p and key != parameter), "gamma"
    )
    drawn = known = False
    for curve, color, marker in zip(curves, cycle(COLORS), cycle(MARKERS), strict=False):
        look: dict[str, Any] = {"color": color, "markersize": 4.5}
        solved = [(p[parameter], p[y]) for p in curve["points"] if p.get(y) is not None]
        if solved:
            axes.plot(*zip(*solved, strict=True), **look)
        proved = [(p[parameter], p["certified"][y]) for p in curve["points"] if "certified" in p]
        if proved:
            axes.plot(*zip(*proved, strict=True), marker, markerfacecolor="none", **look)
        least = [(p[parameter], p["truth"][y]) for p in curve["points"] if y in p.get("truth", {})]
        if least:
            axes.plot(*zip(*least, strict=True), linestyle=DOTTED, color=color)
            known = True
        if solved or proved:
            drawn = True
            axes.plot([], [], marker=marker, label=f"{curve['injection']}, {curve['relaxation']}", **look)
    if drawn:
        axes.plot([], [], color="black", label="best found")
        axes.plot([], [], "o", color="black", markerfacecolor="none", label="certified gains")
    if known:
        axes.plot([], [], linestyle=DOTTED, color="black", label="no less for these gains")
    spread_axis(axes, "x", [p[parameter] for c in curves for p in c["points"]])
    spread_axis(axes, "y", [p[y] for c in curves for p in c["points"] if p.get(y) is not None])
    axes.set(xlabel=names.get(parameter, plain(parameter)), ylabel=names[y])
    legend_below(figure)
    return figure


def tradeoff_sheet(
    points: Sequence[Mapping[str, Any]],
    shipped: Mapping[str, Any] | None,
    title: str,
    x: str = "alpha",
    y: str = "gamma",
    names: Mapping[str, str] = NAMES,
) -> "Figure":
    """Draw the curve of a search; a point without a result stands at the foot, under its status.

    Points are mappings with the searched `x`, the result `y` (missing or None where there is none) and "status".
    `shipped` is the point of the design that is shipped, or None; `names` are those of the quantities.
    """
    figure, axes = sheet(title)
    solved = sorted((p[x], p[y]) for p in points if p.get(y) is not None)
    if solved:
        axes.plot(*zip(*solved, strict=True), color=TRUE, marker="o", markersize=3.5, label=f"best {short(y)}")
    axes.margins(y=0.1)
    mark_refused(axes, [p[x] for p in points], [str(p["status"]) if p.get(y) is None else None for p in points])
    if shipped is not None:
        values = ", ".join(f"{short(key)} = {proved(key, shipped[key])}" for key in (x, y))
        mark_shipped(axes, shipped[x], shipped[y], f"this design: {values}")
    spread_axis(axes, "x", [p[x] for p in points])
    spread_axis(axes, "y", [value for _, value in solved])
    axes.set(xlabel=names.get(x, plain(x)), ylabel=names[y])
    legend_below(figure)
    return figure


def proved(key: str, value: float) -> str:
    """Number that is proved, rounded to the safe side: up where less is better."""
    return (at_least if BETTER.get(key, 1) > 0 else at_most)(value, 4)


def sheet(title: str) -> "tuple[Figure, Axes]":
    """Figure of one panel."""
    figure = new_figure(6.8, 4.6)
    figure.suptitle(title, fontsize=11)
    return figure, figure.add_subplot()


curves_figure, tradeoff_figure = drawn(curves_sheet), drawn(tradeoff_sheet)
