"""The figure of a trade-off over the weight and the decay: maps and surfaces."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.plot.axis import cross, highest, mark_shipped
from obsdesign.plot.canvas import COLORS, drawn, facets, halo, legend_below, levels, new_figure, ticked
from obsdesign.plot.front import (
    ARBITRARY,
    CORNER,
    ONE_DESIGN,
    OPEN,
    UNBOUNDED,
    column,
    is_arbitrary,
    is_solved,
    pace,
    shipped_among,
    unattained,
)
from obsdesign.plot.traded import NAMES, short
from obsdesign.records import dataclass

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAPS = {"lipschitz": "viridis", "gamma": "cividis"}
LEVELS = 9
FLAT = 1e-3  # relative: what varies less is drawn as flat
BARE = "#E4E4E4"
AROUND = ((0, 0), (0, 1), (1, 1), (1, 0))  # a cell
EDGE = 0.04  # of a map: labels are cut there


def surface_sheet(
    points: Sequence[Mapping[str, Any]],
    shipped: Mapping[str, Any] | None,
    title: str,
    names: Mapping[str, str] = NAMES,
) -> "Figure":
    """Draw the limits of `lipschitz` and `gamma` over weight and decay rate, as contour maps and as surfaces.

    Where there is no design, or where the batch has not got to, the maps are gray and the surfaces have holes; gamma
    is cut where a few values, near the weight 1 that does not ask for it, are far above all others.

    `points`, `shipped`, `title`, `names`: as for `front.front_sheet`; the points may come in any order and need not
    fill the grid.
    """
    grid = Grid.of(points)
    figure = new_figure(10.5, 8.4, gap=0.05)
    figure.suptitle(title, fontsize=11)
    cells = figure.add_gridspec(2, 2, width_ratios=(1.15, 1))
    for row, key in enumerate(MAPS):
        field = Field.of(grid, key, names[key])
        axes = figure.add_subplot(cells[row, 0])
        draw_map(axes, grid, field)
        mark_points(axes, grid, key, shipped)
        draw_surface(figure.add_subplot(cells[row, 1], projection="3d"), grid, field)
    legend_below(figure)
    return figure


surface_figure = drawn(surface_sheet)


@dataclass(frozen=True)
class Grid:
    """Points by decay rate or rho (rows) and weight (columns)."""

    points: Sequence[Mapping[str, Any]]
    key: str  # of the rows
    weights: Array
    decays: Array

    @classmethod
    def of(cls, points: Sequence[Mapping[str, Any]]) -> "Grid":
        """Take all weights and decay rates that occur."""
        key = pace(points)
        return cls(points, key, *(np.unique(column(points, name)) for name in ("weight", key)))

    def table(self, values: Array) -> Array:
        """Values of the points as a matrix, NaN where there is no point."""
        at = [
            np.searchsorted(axis, column(self.points, key))
            for axis, key in ((self.decays, self.key), (self.weights, "weight"))
        ]
        table = np.full((len(self.decays), len(self.weights)), np.nan)
        table[*at] = values
        return table


@dataclass(frozen=True)
class Field:
    """A quantity over the grid, NaN where there is none, and the levels of its contours."""

    key: str
    name: str
    values: Array
    levels: Array
    cut: float  # larger values are drawn as this; infinity where all are drawn

    @classmethod
    def of(cls, grid: Grid, key: str, name: str) -> "Field":
        """Cut what is far above most values."""
        table = grid.table(column(grid.points, key))
        top = highest(table) if key == "gamma" else np.inf
        cut = top if np.isfinite(table).any() and (table > top).any() else np.inf
        values = np.where(np.isnan(table), np.nan, np.minimum(table, cut))
        seen = values[np.isfinite(values)]
        low, high = (seen.min(), seen.max()) if seen.size else (0.0, 1.0)
        least = FLAT * abs(low) or FLAT
        return cls(key, name, values, levels(low, max(high, low + least), LEVELS), cut)

    @property
    def label(self) -> str:
        """Name, and where it is cut."""
        return self.name + (f", cut at {self.cut:.3g}" if np.isfinite(self.cut) else "")

    @property
    def quads(self) -> list[tuple[int, int]]:
        """Lower left corners of the cells all corners of which have a value."""
        known = np.isfinite(self.values)
        full = known[:-1, :-1] & known[1:, :-1] & known[:-1, 1:] & known[1:, 1:]
        return [(int(i), int(j)) for i, j in np.argwhere(full)]

    @property
    def look(self) -> dict[str, Any]:
        """Colors, the same on the map and on the surface."""
        return {"cmap": MAPS[self.key], "vmin": self.levels[0], "vmax": self.levels[-1]}


def draw_map(axes: "Axes", grid: Grid, field: Field) -> None:
    """Draw filled contours with labeled lines over a gray ground; dots where there is no cell to fill."""
    axes.grid(visible=False)
    axes.patch.set(facecolor=BARE)
    over = grid.weights, grid.decays, np.ma.masked_invalid(field.values)
    colors: Any
    if field.quads:
        colors = axes.contourf(*over, levels=field.levels, **field.look)
        lines = axes.contour(*over, levels=field.levels[1:-1], colors="black", linewidths=0.6)
        tidy(axes, axes.clabel(lines, fontsize=7.5, fmt="%.4g"))
        outline(axes, grid)
    else:
        decay, weight = np.nonzero(np.isfinite(field.values))
        colors = axes.scatter(
            grid.weights[weight], grid.decays[decay], c=field.values[decay, weight], s=60, zorder=2, **field.look
        )
    axes.figure.colorbar(colors, ax=axes)
    axes.set_title(field.label, loc="left")
    axes.set(xlabel=NAMES["weight"], ylabel=NAMES[grid.key])


def tidy(axes: "Axes", labels: Sequence[Any]) -> None:
    """Give labels a white outline, to be read on dark colors; drop those that the border would cut."""
    for label in labels:
        x, y = axes.transAxes.inverted().transform(axes.transData.transform(label.get_position()))
        label.set_visible(EDGE < x < 1 - EDGE and EDGE < y < 1 - EDGE)
        halo(label)


def outline(axes: "Axes", grid: Grid) -> None:
    """Mark the region in which the limit is not attained, and that of the corners, by ticks on the inner side."""
    corner = np.array([p.get("corner") is True for p in grid.points])
    known = np.array([is_solved(p) for p in grid.points])
    constrained = known & ~np.array([is_arbitrary(p) for p in grid.points])
    for flag, among, color, label in (
        (unattained(grid.points), known, COLORS[1], OPEN),
        (corner, constrained, CORNER, ONE_DESIGN),
    ):
        inside = np.ma.masked_invalid(grid.table(np.where(among, flag, np.nan)))
        if inside.all():
            axes.set_title(f"everywhere: {label}", loc="right", fontsize=8)
        elif inside.any():
            lines = axes.contour(grid.weights, grid.decays, inside, levels=[0.5], colors=color, linewidths=1.3)
            for drawn in (lines, *axes.plot([], [], color=color, label=f"{label} (ticked side)")):
                ticked(drawn)


def mark_points(axes: "Axes", grid: Grid, key: str, shipped: Mapping[str, Any] | None) -> None:
    """Mark the points without a design, those where gamma is unbounded, and the one that is shipped."""
    refused = {i: str(p["status"]) for i, p in enumerate(grid.points) if not is_solved(p)}
    for status in dict.fromkeys(refused.values()):
        put(axes, [grid.points[i] for i, s in refused.items() if s == status], **cross(status))
    if key == "lipschitz":
        arbitrary = [p for p in grid.points if is_arbitrary(p)]
        put(axes, arbitrary, marker="d", color=COLORS[0], markerfacecolor="white", label=ARBITRARY)
    unbounded = [p for p in grid.points if np.isinf(column([p], key)).any()]
    put(axes, unbounded, marker="^", color=COLORS[1], label=UNBOUNDED)
    at = shipped_among(grid.points, shipped)
    if at is not None:
        mark_shipped(axes, at["weight"], at[grid.key])
    if not np.isfinite(grid.table(column(grid.points, key))).all():
        axes.fill([], [], facecolor=BARE, linewidth=0, label="no value")


def put(axes: "Axes", points: Sequence[Mapping[str, Any]], **look: Any) -> None:
    """Marks at the weight and the decay rate of points."""
    if points:
        x, y = column(points, "weight"), column(points, pace(points))
        axes.plot(x, y, **{"linestyle": "none", "markersize": 5, "clip_on": False, "zorder": 5, **look})


def draw_surface(axes: Any, grid: Grid, field: Field) -> None:
    """Draw the cells that have all their corners, seen from where the surface is low; dots where there is none."""
    if field.quads:
        corners = np.array([[(i + a, j + b) for a, b in AROUND] for i, j in field.quads])
        i, j = corners[..., 0], corners[..., 1]
        z = field.values[i, j]
        cells = np.stack([grid.weights[j], grid.decays[i], z], axis=-1)
        facets(axes, cells, z.mean(axis=-1), MAPS[field.key], (field.levels[0], field.levels[-1]))
    else:
        i, j = np.nonzero(np.isfinite(field.values))
        z = field.values[i, j]
        axes.scatter(grid.weights[j], grid.decays[i], z, c=z, s=40, depthshade=False, **field.look)
    for which, values in (("x", grid.weights), ("y", grid.decays)):
        if len(values) > 1:
            axes.set(**{f"{which}lim": (values[0], values[-1])})
        else:
            axes.set(**{f"{which}ticks": values})
    axes.set_zlim(field.levels[0], field.levels[-1])
    axes.set(xlabel=NAMES["weight"], ylabel=NAMES[grid.key])
    axes.zaxis.set_rotate_label(False)
    axes.set_zlabel(short(field.key), rotation=90, labelpad=7)
    axes.view_init(elev=26, azim=-130)
