"""Figures of one look, panels in their rows, legends, and figures as PNG. The only matplotlib code.

One legend below all panels tells what they share, one above a panel what is its own.

Colors are those of Okabe and Ito, which people with any color vision tell apart.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from io import BytesIO
from typing import TYPE_CHECKING, Any, ParamSpec

import numpy as np

from obsdesign.lmi.formula import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Arguments = ParamSpec("Arguments")
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DPI = 150
STYLE: dict[Any, Any] = {
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.use_mathtext": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8,
    "legend.frameon": True,
    "legend.framealpha": 0.85,
    "legend.edgecolor": "none",
    "legend.handlelength": 1.8,
    "lines.linewidth": 1.3,
    "agg.path.chunksize": 20000,
    "text.usetex": False,
}

WIDTH = 10.5  # inches of a figure
ROW = 3  # panels beside each other
COLUMNS = 6  # of the grid, which rows of one, two and three panels divide
LEAN: dict[str, Any] = {"borderaxespad": 0.1, "borderpad": 0.1, "columnspacing": 1.2, "handletextpad": 0.5}
MOST = 5  # columns of a legend of a figure
ENTRY, LETTER = 0.42, 0.072  # inches of a legend: an entry without its text, and a letter
Panel = Callable[["Axes"], None]  # draws curves, limits and labels


@contextmanager
def style() -> Iterator[None]:
    """Give every figure the same look, whatever the user's settings are."""
    from matplotlib import rc_context, rcdefaults, rcParams

    with rc_context():
        rcdefaults()
        rcParams.update(STYLE)
        yield


def new_figure(width: float, height: float, gap: float = 0.02) -> "Figure":
    """Empty figure, in inches, that belongs to no window; gap between columns, as a fraction of its width."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.06, wspace=gap))
    FigureCanvasAgg(figure)
    return figure


def png(figure: "Figure") -> bytes:
    """PNG without anything that changes from run to run."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def drawn(sheet: "Callable[Arguments, Figure]") -> Callable[Arguments, bytes]:
    """Function that composes a figure as one that draws it: a PNG, the same for the same arguments."""

    @wraps(sheet)
    def picture(*args: Arguments.args, **kwargs: Arguments.kwargs) -> bytes:
        with style():
            return png(sheet(*args, **kwargs))

    return picture


def compose(title: str, sections: Sequence[Sequence[Panel]]) -> "Figure":
    """Draw sections of panels below each other, each in rows of at most three panels of the same width."""
    rows = [row for section in sections for row in shared(section, ROW)]
    figure = new_figure(WIDTH, 1.0 + 0.2 * max(0, title.count("\n") - 1) + 2.35 * len(rows))
    figure.suptitle(title, fontsize=11)
    grid = figure.add_gridspec(len(rows), COLUMNS)
    for i, row in enumerate(rows):
        width = COLUMNS // len(row)
        for j, panel in enumerate(row):
            panel(figure.add_subplot(grid[i, j * width : (j + 1) * width]))
    return figure


def shared(items: Sequence[Any], most: int) -> Iterator[Sequence[Any]]:
    """Items in groups of nearly equal size."""
    count = -(-len(items) // most)
    for i in range(count):
        yield items[i * len(items) // count : (i + 1) * len(items) // count]


def legend_above(axes: "Axes") -> None:
    """Legend of a panel, above it, in as many columns as its width has room for."""
    handles, labels = axes.get_legend_handles_labels()
    columns = int(WIDTH * axes.get_position().width / (ENTRY + LETTER * max(len(label) for label in labels)))
    axes.legend(handles, labels, loc="lower right", bbox_to_anchor=(1, 1), ncols=max(1, min(4, columns)), **LEAN)


def legend_below(figure: "Figure") -> None:
    """One legend for all panels, of what the legends of single panels do not name."""
    entries: dict[str, Any] = {}
    for axes in figure.axes:
        legend = axes.get_legend()
        own = {text.get_text() for text in legend.get_texts()} if legend else set()
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            if label not in own:
                entries.setdefault(label, handle)
    if entries:
        fitting = int(figure.get_figwidth() / (ENTRY + LETTER * max(map(len, entries))))
        columns = -(-len(entries) // -(-len(entries) // max(1, min(MOST, fitting))))
        figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=columns)


def levels(low: float, high: float, most: int) -> Array:
    """Round numbers from below low to above high, at most so many intervals."""
    from matplotlib.ticker import MaxNLocator

    return np.array(MaxNLocator(most).tick_values(low, high))


def log_ticks(axes: "Axes", multiples: Sequence[float]) -> None:
    """Ticks of a logarithmic y axis at these multiples of the powers of ten, written as plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axes.yaxis.set_major_locator(LogLocator(subs=multiples, numticks=20))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:.3g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def halo(text: Any) -> None:
    """Outline a text in white, to be read on dark colors."""
    from matplotlib.patheffects import withStroke

    text.set_path_effects([withStroke(linewidth=2.2, foreground="white")])


def ticked(lines: Any) -> None:
    """Outline lines in white, and give them ticks to the left, which of contours is the side of larger values."""
    from matplotlib.patheffects import Normal, withStroke, withTickedStroke

    ticks: dict[str, Any] = {"spacing": 14.0, "length": 0.5, "angle": 90.0}
    white = withTickedStroke(foreground="white", linewidth=2.6, **ticks)
    lines.set_path_effects([withStroke(foreground="white", linewidth=2.6), white, withTickedStroke(**ticks), Normal()])


def facets(axes: Any, corners: Array, heights: Array, cmap: str, limits: tuple[float, float]) -> None:
    """Add facets (m, k, 3), colored by their heights (m,), to axes in three dimensions."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    faces = Poly3DCollection(corners, edgecolor="black", linewidth=0.25, cmap=cmap)
    faces.set_array(heights)
    faces.set_clim(*limits)
    axes.add_collection3d(faces)
