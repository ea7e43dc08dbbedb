"""The figure of a trade-off between the Lipschitz constant that is tolerated and the L2 gain, over one weight."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.plot.axis import highest, log_axis, mark_beyond, mark_refused, mark_shipped
from obsdesign.plot.canvas import COLORS, drawn, legend_below, new_figure
from obsdesign.plot.traded import NAMES, short
from obsdesign.records import dataclass

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LIMIT, PROVED = COLORS[:2]
BAND = "#E9E9E9"
CORNER = COLORS[5]
OPEN = "limit not attained"
ONE_DESIGN = "corner: one design for many weights"
SAME = 1e-3  # relative: limits that differ by less are one corner
ARBITRARY = "any lipschitz would do"
UNBOUNDED = "unbounded limit"
ABOVE = {LIMIT: "limit above the panel", PROVED: "gain above the panel"}


def front_sheet(
    points: Sequence[Mapping[str, Any]],
    shipped: Mapping[str, Any] | None,
    title: str,
    names: Mapping[str, str] = NAMES,
) -> "Figure":
    """Draw `lipschitz`, `gamma` and |L| against the weight (or the decay), and `gamma` against `lipschitz`.

    Lines are limits and dots are certified gains. Marked are limits that no gain attains, corners (one design is the
    best for many weights), weights without a design, and the design that is shipped.

    Parameters
    ----------
    points
        Mappings with `weight`, `decay` (1/s) or `rho`, and `status`; where there is a solution also the limits
        `lipschitz` and `gamma` (missing where they are unbounded, or at the weight 0 arbitrary), `attained` and
        `corner`; and `certified`, a mapping with the `lipschitz`, `gamma` and norm `L` of the gains. They may come in
        any order.
    shipped
        `lipschitz` and `gamma` of the design that is shipped, or None.
    title, names
        Title, in at most two lines, and names of the quantities by their keys.
    """
    front = Front.of(points)
    figure = new_figure(10.5, 6.6)
    figure.suptitle(heading(front, title), fontsize=11)
    grid = figure.add_gridspec(3, 2, width_ratios=(1, 1.1))
    top = figure.add_subplot(grid[0, 0])
    stacked = {"lipschitz": top, **{k: figure.add_subplot(grid[i, 0], sharex=top) for i, k in ((1, "gamma"), (2, "L"))}}
    for key, axes in stacked.items():
        draw_over_weight(axes, front, key, shipped)
        axes.tick_params(labelbottom=key == "L")
    figure.align_ylabels(list(stacked.values()))
    stacked["L"].set_xlabel(names[front.parameter])
    axes = figure.add_subplot(grid[:, 1])
    draw_tradeoff(axes, front, shipped)
    axes.set(xlabel=names["lipschitz"], ylabel=names["gamma"])
    legend_below(figure)
    return figure


front_figure = drawn(front_sheet)


@dataclass(frozen=True)
class Front:
    """Points of a curve in the order of the parameter that varies."""

    parameter: str
    points: Sequence[Mapping[str, Any]]

    @classmethod
    def of(cls, points: Sequence[Mapping[str, Any]]) -> "Front":
        """Tell which parameter varies, and sort by it."""
        key = pace(points)
        weights, rates = ({p.get(name) for p in points} for name in ("weight", key))
        parameter = key if len(rates) > len(weights) else "weight"
        return cls(parameter, sorted(points, key=lambda p: float(p[parameter])))

    @property
    def x(self) -> Array:
        """Values of the parameter."""
        return column(self.points, self.parameter)

    def corners(self) -> Iterator[slice]:
        """Runs of neighbors that have the same limit, marked as corners."""
        limit, start = column(self.points, "lipschitz"), 0
        for i in range(1, len(self.points) + 1):
            same = i < len(self.points) and math.isclose(limit[i], limit[start], rel_tol=SAME)
            if not (same and self.points[i].get("corner")):
                if i - start > 1 and self.points[start].get("corner"):
                    yield slice(start, i)
                start = i

    def bands(self) -> Iterator[tuple[float, float]]:
        """Intervals of the parameter, halfway to the neighbors, in which the limit is not attained."""
        x, hidden = self.x, unattained(self.points)
        halves = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
        edges = np.flatnonzero(np.diff(np.concatenate([[False], hidden, [False]])))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            yield float(halves[begin]), float(halves[end])


def pace(points: Sequence[Mapping[str, Any]]) -> str:
    """Key of what is said of the decay: in 1/s, or rho of samples."""
    return "rho" if any("rho" in point for point in points) else "decay"


def column(points: Sequence[Mapping[str, Any]], key: str) -> Array:
    """Numbers under a key; NaN where there is none, and infinity for a limit that is unbounded."""
    return np.array([float(p[key]) if key in p else np.inf if is_unbounded(p, key) else np.nan for p in points])


def is_unbounded(point: Mapping[str, Any], key: str) -> bool:
    """Whether a solved point lacks a limit because it is infinite; at the weight 0 any `lipschitz` would do."""
    return is_solved(point) and key not in point and (key == "gamma" or (key == "lipschitz" and point["weight"] > 0))


def is_arbitrary(point: Mapping[str, Any]) -> bool:
    """Whether any `lipschitz` would do, because a solved point gives it no weight."""
    return is_solved(point) and "lipschitz" not in point and point["weight"] == 0


def is_solved(point: Mapping[str, Any]) -> bool:
    """Whether a point has limits."""
    return "attained" in point


def certified(points: Sequence[Mapping[str, Any]], key: str) -> Array:
    """What the certified gains achieve."""
    return column([p.get("certified", {}) for p in points], key)


def unattained(points: Sequence[Mapping[str, Any]]) -> Array:
    """Whether a point has a limit that no gain attains."""
    return np.array([p.get("attained") is False for p in points], dtype=bool)


def shipped_among(points: Sequence[Mapping[str, Any]], shipped: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    """Point of the design that is shipped, if it is one of them."""
    if shipped is None:
        return None
    keys = [key for key in ("lipschitz", "gamma") if key in shipped]
    same = np.all([np.isclose(certified(points, key), shipped[key], rtol=1e-9, atol=0) for key in keys], axis=0)
    return next((p for p, found in zip(points, same, strict=True) if found), None)


def draw_over_weight(axes: "Axes", front: Front, key: str, shipped: Mapping[str, Any] | None) -> None:
    """Draw one quantity against the parameter."""
    x, limit, proved = front.x, column(front.points, key), certified(front.points, key)
    for band in front.bands():
        axes.axvspan(*band, color=BAND, linewidth=0, zorder=0, label=f"{OPEN} (shaded, hollow)")
    if key != "L":
        draw_limits(axes, front, x, limit)
    axes.plot(x, proved, "o", color=PROVED, markersize=3.2, label="certified gains")
    mark_refused(axes, x, [None if is_solved(p) else str(p["status"]) for p in front.points])
    at = shipped_among(front.points, shipped)
    if at is not None:
        mark_shipped(axes, at[front.parameter], certified([at], key)[0])
    axes.set_ylabel(short(key))
    if key == "lipschitz":
        for free in x[[is_arbitrary(p) for p in front.points]]:
            axes.axvline(free, color=LIMIT, linestyle=":", label=ARBITRARY)
        mark_beyond(axes, x[np.isinf(limit)], LIMIT, 8, UNBOUNDED)
    elif key == "gamma":
        gain_axis(axes, [(x, limit, LIMIT), (x, proved, PROVED)])
    else:
        log_axis(axes, proved)


def draw_limits(axes: "Axes", front: Front, x: Array, y: Array) -> None:
    """Draw limits as a line, which ends where there is none; corners wide, and what is not attained hollow."""
    for k, corner in enumerate(front.corners()):
        label = ONE_DESIGN if k == 0 else None
        axes.plot(x[corner], y[corner], color=CORNER, alpha=0.5, linewidth=7, solid_capstyle="round", label=label)
    axes.plot(x, np.where(np.isfinite(y), y, np.nan), color=LIMIT, marker=".", markersize=4, label="limits")
    hollow = unattained(front.points) & np.isfinite(y)
    axes.plot(x[hollow], y[hollow], "o", color=LIMIT, markerfacecolor="white", markersize=4.5)


def draw_tradeoff(axes: "Axes", front: Front, shipped: Mapping[str, Any] | None) -> None:
    """Draw gamma against the Lipschitz constant; a corner, which is one point here, with its weights."""
    x, y = (column(front.points, key) for key in ("lipschitz", "gamma"))
    xs, ys = (certified(front.points, key) for key in ("lipschitz", "gamma"))
    draw_limits(axes, front, x, y)
    axes.plot(xs, ys, "o", color=PROVED, markersize=3.2, label="certified gains")
    for corner in front.corners():
        if not np.isfinite([x[corner.start], y[corner.start]]).all():
            continue
        first, last = (front.points[i][front.parameter] for i in (corner.start, corner.stop - 1))
        axes.annotate(
            f"{front.parameter} {first:.3g} to {last:.3g}",
            (x[corner.start], y[corner.start]),
            xytext=(9, 4),
            textcoords="offset points",
            fontsize=8,
        )
    if not np.isfinite(x).any():
        axes.text(0.5, 0.5, "no design", ha="center", transform=axes.transAxes)
        axes.tick_params(labelleft=False, labelbottom=False)
    if shipped is not None and "gamma" in shipped:
        mark_shipped(axes, shipped["lipschitz"], shipped["gamma"])
    gain_axis(axes, [(x, y, LIMIT), (xs, ys, PROVED)])


def gain_axis(axes: "Axes", drawn: Sequence[tuple[Array, Array, str]]) -> None:
    """Axis of gamma from zero, as high as most values need; those above it are marked at its top."""
    top = highest(np.concatenate([y for _, y, _ in drawn]))
    axes.set_ylim(-0.04 * top, 1.08 * top)
    for (x, y, color), size in zip(drawn, (8, 4), strict=True):
        mark_beyond(axes, x[np.isinf(y)], color, size, UNBOUNDED)
        mark_beyond(axes, x[(y > top) & np.isfinite(y)], color, size, ABOVE[color])


def heading(front: Front, title: str) -> str:
    """Title, with what is the same for all points in its last line."""
    other = pace(front.points) if front.parameter == "weight" else "weight"
    same = {p.get(other) for p in front.points}
    value = same.pop() if len(same) == 1 else None
    name, _, more = title.partition("\n")
    fact = f"{other} {value:.4g}{' 1/s' if other == 'decay' else ''}" if value else ""
    return "\n".join(filter(None, (name, "; ".join(filter(None, (fact, more))))))
