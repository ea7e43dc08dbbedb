"""Figures of runs, and of trade-off curves and surfaces, as PNG."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from obsdesign.plot import run as continuous
from obsdesign.plot.front import front_figure
from obsdesign.plot.hybrid import hybrid_figure
from obsdesign.plot.surface import surface_figure
from obsdesign.plot.tradeoff import curves_figure, tradeoff_figure

if TYPE_CHECKING:
    from obsdesign.simulate import Run

__all__ = ["curves_figure", "front_figure", "run_figure", "search_figure", "surface_figure", "tradeoff_figure"]


def run_figure(run: "Run") -> bytes:
    """Draw a run of an observer; see `run.run_figure`, `hybrid.hybrid_figure`."""
    return continuous.run_figure(run) if run.schedule is None else hybrid_figure(run)


def search_figure(result: Mapping[str, Any], conditions: Sequence[str] = ()) -> bytes | None:
    """Draw the points of a search, from a result file, in the form that fits them; None where there are none.

    Curves side by side, or a trade-off over a weight, over a weight and a decay rate, or of gamma against a rate.
    `conditions`: what all points keep to, below the name.
    """
    search, claimed = result.get("search", {}), result.get("guarantee", {})
    points, title = search.get("points", []), "\n".join([result["name"], *conditions])
    if "curves" in search:
        return curves_figure(search["curves"], search["parameter"], title)
    if not points:
        return None
    if any("weight" in point for point in points):
        draw = surface_figure if "parameters" in search else front_figure
        return draw(points, claimed if "lipschitz" in claimed else None, title)
    return tradeoff_figure(points, claimed if "gamma" in claimed else None, title)
