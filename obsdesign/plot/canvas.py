"""Figures of one look, panels in their rows, legends, and figures as PNG or SVG. The only matplotlib code.

One legend below all panels tells what they share, one above a panel what is its own; none lies on curves. Text is drawn
as it is and never read as mathematics, since names come from specs; Greek letters are written as such.

Colors are those of Okabe and Ito, which people with any color vision tell apart.
"""

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from io import BytesIO
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from obsdesign.lmi.formula import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Form = Literal["png", "svg"]
METADATA: dict[Form, dict[str, str | None]] = {  # who made it, and nothing that changes
    "png": {"Software": "obsdesign"},
    "svg": {"Creator": "obsdesign", "Date": None},
}
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
TRUE, ESTIMATE, BOUND = COLORS[0], COLORS[1], COLORS[6]
DASHED, DOTTED, DOT_DASHED = (0, (4, 2)), (0, (1, 1.3)), (0, (5, 1.5, 1, 1.5))  # estimates, bounds, limits
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
    "axes.formatter.limits": (-3, 5),
    "axes.formatter.useoffset": False,
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
    "text.parse_math": False,
    "svg.fonttype": "none",  # text stays text: to be searched, copied and read aloud
    "svg.hashsalt": "obsdesign",
}
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

WIDTH = 10.5  # inches of a figure
ROW = 3  # panels beside each other
CROWDED = 1e4  # ratio of the ends of a logarithmic axis from which on ticks within a decade are a bar
COLUMNS = 6  # of the grid, which rows of one, two and three panels divide
LEAN: dict[str, Any] = {"borderaxespad": 0.1, "borderpad": 0.1, "columnspacing": 1.2, "handletextpad": 0.5}
MOST = 5  # columns of a legend of a figure
ENTRY, LETTER = 0.42, 0.064  # inches of a legend: an entry without its text, and a letter
Panel = Callable[["Axes"], None]  # draws curves, limits and labels


@contextmanager
def style() -> Iterator[None]:
    """Give every figure the same look, whatever the user's settings are; what the font lacks is drawn as a box."""
    from matplotlib import rc_context, rcdefaults, rcParams

    with rc_context(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph ")
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


def drawn(sheet: "Callable[..., Figure]") -> "Callable[..., bytes]":
    """Function that composes a figure as one that draws it: the same bytes for the same arguments.

    It takes one keyword more, `form`: png, or svg.
    """

    @wraps(sheet)
    def picture(*args: Any, form: Form = "png", **kwargs: Any) -> bytes:
        buffer = BytesIO()
        with style():
            sheet(*args, **kwargs).savefig(buffer, format=form, metadata=METADATA[form])
        return buffer.getvalue()

    return picture


def form_of(path: str | None) -> Form:
    """Form of a figure by the ending of its file: svg, else png."""
    return "svg" if path is not None and path.lower().endswith(".svg") else "png"


def compose(
    title: str, sections: Sequence[Sequence[Panel]], height: float = 2.35, foot: tuple[Panel, float] | None = None
) -> "Figure":
    """Draw sections of panels below each other, each in rows of at most three panels of the same width and height.

    `foot`: a last panel over the whole width, and its height (inches).
    """
    rows = [row for section in sections for row in shared(section, ROW)]
    heights = [*[height] * len(rows), *([foot[1]] if foot else [])]
    figure = new_figure(WIDTH, 1.0 + sum(heights))
    figure.suptitle(title, fontsize=11)
    grid = figure.add_gridspec(len(heights), COLUMNS, height_ratios=heights)
    for i, row in enumerate(rows):
        width = COLUMNS // len(row)
        for j, panel in enumerate(row):
            panel(figure.add_subplot(grid[i, j * width : (j + 1) * width]))
    if foot:
        foot[0](figure.add_subplot(grid[-1, :]))
    return figure


def shared(items: Sequence[Any], most: int) -> Iterator[Sequence[Any]]:
    """Items in groups of nearly equal size."""
    count = -(-len(items) // most)
    for i in range(count):
        yield items[i * len(items) // count : (i + 1) * len(items) // count]


def legend_above(axes: "Axes", handles: Sequence[Any], labels: Sequence[str]) -> None:
    """Legend of a panel, above it, in as many columns as its width has room for."""
    columns = columns_for(labels, WIDTH * axes.get_position().width)
    axes.legend(handles, labels, loc="lower right", bbox_to_anchor=(1, 1), ncols=columns, **LEAN)


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
        columns = columns_for(list(entries), figure.get_figwidth())
        figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=columns)


def columns_for(labels: Sequence[str], width: float) -> int:
    """Columns of a legend in a width (inches), as equal as they can be."""
    fitting = max(1, min(MOST, int(width / (ENTRY + LETTER * max(map(len, labels))))))
    return -(-len(labels) // -(-len(labels) // fitting))


def levels(low: float, high: float, most: int) -> Array:
    """Round numbers from below low to above high, at most so many intervals."""
    from matplotlib.ticker import MaxNLocator

    return np.array(MaxNLocator(most).tick_values(low, high))


def log_ticks(axes: "Axes", which: str = "y", multiples: Sequence[float] = (1,)) -> None:
    """Ticks of a logarithmic axis at these multiples of the powers of ten, written without mathematics."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    axis = getattr(axes, f"{which}axis")
    axis.set_major_locator(LogLocator(subs=multiples, numticks=9 if len(multiples) == 1 else 20))
    axis.set_major_formatter(FuncFormatter(lambda value, _: power(value)))
    axis.set_minor_formatter(NullFormatter())
    low, high = axis.get_view_interval()
    if high > CROWDED * low > 0:
        axis.set_minor_locator(NullLocator())


def number(value: float) -> str:
    """Three digits; a power of ten is written as one."""
    digits, _, exponent = f"{value:.3g}".partition("e")
    if not exponent:
        return digits
    ten = f"10{str(int(exponent)).translate(SUPERSCRIPTS)}"
    return ten if digits == "1" else f"{digits} × {ten}"


def power(value: float) -> str:
    """Tick of a logarithmic axis: powers of ten from 1000 on, and to 0.001, are written as such."""
    k = round(np.log10(value)) if value > 0 else 0
    plain = abs(k) < 3 or not np.isclose(value, 10.0**k, rtol=1e-9)
    return number(value) if plain else f"10{str(k).translate(SUPERSCRIPTS)}"


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
