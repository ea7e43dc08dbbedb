"""Panels in rows of a figure, and legends: one below all panels for what they share, above a panel for its own."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from obsdesign.plot.canvas import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 10.5  # inches of a figure
ROW = 3  # panels beside each other
COLUMNS = 6  # of the grid, which rows of one, two and three panels divide
LEAN: dict[str, Any] = {"borderaxespad": 0.1, "borderpad": 0.1, "columnspacing": 1.2, "handletextpad": 0.5}
MOST = 5  # columns of a legend of a figure
ENTRY, LETTER = 0.42, 0.072  # inches of a legend: an entry without its text, and a letter


class Panel(Protocol):
    """What draws itself on axes."""

    def draw(self, axes: "Axes") -> None:
        """Draw curves, limits and labels."""


def compose(title: str, sections: Sequence[Sequence[Panel]]) -> "Figure":
    """Draw sections of panels below each other, each in rows of at most three panels of the same width."""
    rows = [row for section in sections for row in shared(section, ROW)]
    figure = new_figure(WIDTH, 1.0 + 0.2 * max(0, title.count("\n") - 1) + 2.35 * len(rows))
    figure.suptitle(title, fontsize=11)
    grid = figure.add_gridspec(len(rows), COLUMNS)
    for i, row in enumerate(rows):
        width = COLUMNS // len(row)
        for j, panel in enumerate(row):
            panel.draw(figure.add_subplot(grid[i, j * width : (j + 1) * width]))
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
        columns = -(-len(entries) // -(-len(entries) // MOST))
        figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=columns)
