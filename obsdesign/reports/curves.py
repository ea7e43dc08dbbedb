"""Points of a search as charts, as maps over two parameters, and as a table."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from obsdesign.records import dataclass
from obsdesign.reports.chart import BOTTOM, FARTHEST, HEIGHT, LEFT, NEAREST, RIGHT, TOP, WIDTH, Axis, Chart, Curve
from obsdesign.tables.design import QUANTITIES

LEVELS = 9
CERTIFIED = "certified when designed, as recorded"  # of gains that are not in the file: nothing is proved anew
STATUS = "status, as recorded"
LABELS = {
    "alpha": "decay rate α [1/s]",
    "decay": "decay rate [1/s]",
    "rho": "decay ρ a sample",
    "gamma": "gain γ",
    "T2": "T2 [s]",
    "L1": "bound on |L1|",
    "L": "bound on |L|",
    "K": "bound on |K|",
}
SPREAD = 30  # ratio from which on an axis is logarithmic
Point = Mapping[str, Any]


@dataclass(frozen=True)
class Map:
    """A quantity over two parameters: cells of nine levels, and their values."""

    title: str
    across: Axis
    along: Axis
    cells: tuple[tuple[str, str, str, str, int, str], ...]  # x, y, width, height, level, what it says
    ends: tuple[str, str]
    box: tuple[int, int, int, int]
    size: tuple[int, int] = (WIDTH, HEIGHT)
    ticks = Chart.ticks


@dataclass(frozen=True)
class Table:
    """Points of a search, one a row."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def groups(search: Mapping[str, Any]) -> list[tuple[str, Sequence[Point]]]:
    """Curves with their names; a single one has none."""
    several = search.get("curves") or [{"points": search.get("points", [])}]
    return [(", ".join(str(c[key]) for key in ("injection", "relaxation") if key in c), c["points"]) for c in several]


def parameters(search: Mapping[str, Any]) -> list[str]:
    """What was searched over."""
    return list(search.get("parameters") or [search.get("parameter", "alpha")])


def quantities(search: Mapping[str, Any]) -> list[str]:
    """What was found at the points."""
    points = [point for _, group in groups(search) for point in group]
    keys = [key for key in (*QUANTITIES, "T2") if key not in parameters(search)]
    return [key for key in keys if any(number(point, key) is not None for point in points)]


def number(point: Point, key: str) -> float | None:
    """Number of a point, if it has one of this name that can be drawn."""
    value = point.get(key)
    if not isinstance(value, int | float) or isinstance(value, bool) or abs(value) >= FARTHEST:
        return None
    return float(value) if abs(value) >= NEAREST else 0.0


def figures(search: Mapping[str, Any]) -> Iterator[Chart | Map]:
    """One figure for each quantity."""
    for key in quantities(search):
        axes = parameters(search)
        yield map_of(search, key, axes) if len(axes) > 1 else chart_of(search, key, axes[0])


def chart_of(search: Mapping[str, Any], key: str, parameter: str) -> Chart:
    """Limits as lines, and what gains were certified to achieve as points."""
    points = [point for _, group in groups(search) for point in group]
    x = np.unique([value for point in points if (value := number(point, parameter)) is not None])
    curves: list[Curve] = []
    for color, (name, group) in enumerate(groups(search), start=1):
        limits, proved = column(x, group, parameter, key), column(x, group, parameter, key, "certified")
        if np.isfinite(limits).any():
            curves.append(Curve(f"{name}: limit".removeprefix(": "), limits, "line", color))
        if np.isfinite(proved).any():
            curves.append(Curve(f"{name}: {CERTIFIED}".removeprefix(": "), proved, "points", color))
    values = np.concatenate([curve.y for curve in curves])
    across, along = (axis(LABELS.get(name, name), seen) for name, seen in ((parameter, x), (key, values)))
    missing = sum(number(point, key) is None for point in points)
    note = f"{missing} of {len(points)} points have no value; the table says why" if missing else ""
    return Chart(f"{LABELS.get(key, key)} over {parameter}", x, tuple(curves), across, along, note)


def column(x: Any, group: Sequence[Point], parameter: str, key: str, part: str = "") -> Any:
    """Values of a group at the abscissae, NaN where there are none."""
    found = np.full(len(x), np.nan)
    for point in group:
        where, value = number(point, parameter), number(point.get(part, {}) if part else point, key)
        if where is not None and value is not None:
            found[np.searchsorted(x, where)] = value
    return found


def axis(label: str, values: Any) -> Axis:
    """Axis, logarithmic where positive values spread widely."""
    seen = values[np.isfinite(values)]
    log = bool(seen.size and seen.min() > 0 and seen.max() > SPREAD * seen.min())
    return Axis.over(label, values, log=log)


def map_of(search: Mapping[str, Any], key: str, axes: Sequence[str]) -> Map:
    """Cells around the points, colored by level; those without a value stay empty."""
    box = (LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM)
    points = [p for p in search["points"] if all(number(p, name) is not None for name in axes)]
    grids = [np.unique([number(p, name) for p in points]) for name in axes]
    edges = [bounds(grid) for grid in grids]
    across, along = (Axis(LABELS.get(n, n), float(e[0]), float(e[-1])) for n, e in zip(axes, edges, strict=True))
    known = [(p, value) for p in points if (value := number(p, key)) is not None]
    cut = np.quantile([v for _, v in known], [0.0, 0.95])
    more = " and more" if max(v for _, v in known) > cut[1] else ""
    cells = []
    for point, value in known:
        i, j = (int(np.searchsorted(g, point[n])) for g, n in zip(grids, axes, strict=True))
        (x0, x1), (y1, y0) = across.at(edges[0][i : i + 2]) * box[2], (1 - along.at(edges[1][j : j + 2])) * box[3]
        level = int(np.clip((value - cut[0]) / (np.ptp(cut) or 1.0) * LEVELS, 0, LEVELS - 1))
        said = f"{key} {value:.5g}: {', '.join(f'{name} {number(point, name):.4g}' for name in axes)}"
        cells.append(
            (f"{x0:.1f}", f"{y0:.1f}", f"{x1 - x0:.1f}", f"{y1 - y0:.1f}", level, f"{key} {value:.5g}: {said}")
        )
    title = f"{LABELS.get(key, key)} over {' and '.join(axes)} (numerical)"
    return Map(title, across, along, tuple(cells), (f"{cut[0]:.4g}", f"{cut[1]:.4g}{more}"), box)


def bounds(grid: Any) -> Any:
    """Edges of cells around the points of a grid."""
    middle = (grid[1:] + grid[:-1]) / 2
    ends = np.array([2 * grid[0] - middle[0], 2 * grid[-1] - middle[-1]]) if len(middle) else grid[0] + [-0.5, 0.5]
    return np.concatenate([ends[:1], middle, ends[1:]])


def table(search: Mapping[str, Any]) -> Table | None:
    """All points, with what became of them as the file records it."""
    rows, over, found = [], parameters(search), quantities(search)
    named = any(name for name, _ in groups(search))
    for name, group in groups(search):
        for point in group:
            numbers = (number(part, key) for part, keys in parts(point, over, found) for key in keys)
            cells = ["" if value is None else f"{value:.6g}" for value in numbers]
            rows.append((*([name] if named else []), *cells, str(point.get("status", ""))))
    header = (*(["curve"] if named else []), *over, *(f"{key}, limit" for key in found))
    return Table((*header, *(f"{key}, {CERTIFIED}" for key in found), STATUS), tuple(rows)) if rows else None


def parts(point: Point, over: Sequence[str], found: Sequence[str]) -> tuple[tuple[Point, Sequence[str]], ...]:
    """Parts of a point, with the keys that a table shows of them."""
    return (point, over), (point, found), (point.get("certified", {}), found)
