"""Figures of runs, and of trade-off curves and surfaces, as PNG or SVG: the same bytes for the same arguments."""

from collections.abc import Mapping
from typing import Any

from obsdesign.plot.canvas import Form, form_of
from obsdesign.plot.front import front_figure
from obsdesign.plot.gain import GAINS, gain_figure
from obsdesign.plot.run import run_figure
from obsdesign.plot.surface import surface_figure
from obsdesign.plot.traded import heading, names
from obsdesign.plot.tradeoff import curves_figure, tradeoff_figure
from obsdesign.spec import Spec
from obsdesign.tables.text import spectral_norm

__all__ = [
    "Form",
    "curves_figure",
    "form_of",
    "front_figure",
    "gain_figure",
    "run_figure",
    "search_figure",
    "surface_figure",
    "tradeoff_figure",
]


def search_figure(result: Mapping[str, Any], spec: Spec | None = None, form: Form = "png") -> bytes | None:
    """Draw the points of a search, from a result file, in the form that fits them; None where there are none.

    Curves side by side, or a trade-off over a weight, over a weight and a decay rate, or of gamma against a rate.
    `spec`: that of the result, for what all points keep to, and the names and units on the axes.
    """
    search, claimed = result.get("search", {}), result.get("guarantee", {})
    points, title = search.get("points", []), heading(result["name"], spec.conditions if spec else ())
    told: dict[str, Any] = {"names": names(spec), "form": form}
    if "curves" in search:
        return curves_figure(search["curves"], search["parameter"], title, **told)
    if not points:
        return None
    if (gain := search.get("parameter")) in GAINS:
        size = {gain: spectral_norm(result["observer"][gain])} if gain in result.get("observer", {}) else {}
        kept = [one for one in spec.conditions if not one.startswith(f"|{gain}|")] if spec else []  # not what is varied
        title = heading(result["name"], kept)
        return gain_figure(points, {**claimed, **size} if size and "gamma" in claimed else None, title, gain, **told)
    if any("weight" in point for point in points):
        draw = surface_figure if "parameters" in search else front_figure
        return draw(points, claimed if "lipschitz" in claimed else None, title, **told)
    return tradeoff_figure(
        points, claimed if "gamma" in claimed else None, title, x=search.get("parameter", "alpha"), **told
    )
