"""The figure of gamma against the size of the gain, with the noise that each gain lets through."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.plot.axis import log_axis, mark_refused, mark_shipped, plain
from obsdesign.plot.canvas import COLORS, DOT_DASHED, DOTTED, TRUE, drawn, legend_below, log_ticks, new_figure
from obsdesign.plot.traded import NAMES, short
from obsdesign.plot.tradeoff import proved

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GAINS = ("L1", "L", "K")
NOISE = {
    "noise_error": "rms of the error\nfor the declared noise",
    "noise_density": "rms of the error for white\nnoise of density 1",
}
MOST = 6  # estimates that are drawn


def gain_sheet(
    points: Sequence[Mapping[str, Any]],
    shipped: Mapping[str, Any] | None,
    title: str,
    x: str,
    names: Mapping[str, str] = NAMES,
) -> Any:
    """Draw gamma against the norm of a gain, and below it the rms of the noise in each estimate, in logarithms.

    All points are certified gains; the dotted line joins the ends, below which the knee is the farthest point.

    Parameters
    ----------
    points
        Mappings with the bound `x`, `status`, and where a gain is certified `certified` (its `gamma`, and its norm
        under `x`) and `noise_error` or `noise_density`: the rms by estimate.
    shipped
        Norm of the gain that is shipped, under `x`, its `gamma`, and `limit`, with the `gamma` that no gain is below;
        None if none is.
    title, names
        Title, and names of the quantities by their keys.
    """
    figure = new_figure(6.8, 6.2)
    figure.suptitle(title, fontsize=11)
    top, below = (figure.add_subplot(2, 1, k) for k in (1, 2))
    made = sorted((p for p in points if "certified" in p), key=lambda p: float(p["certified"][x]))
    draw_gamma(top, made, shipped, x)
    draw_noise(below, made, x)
    mark_refused(top, [p[x] for p in points], [None if "certified" in p else str(p["status"]) for p in points])
    across = np.array([*(p["certified"][x] for p in made), *(p[x] for p in points if "certified" not in p)])
    for axes in (top, below):
        log_x(axes, across)
    top.tick_params(labelbottom=False)
    below.set_xlabel(names.get(x, plain(x)))
    legend_below(figure)
    return figure


def log_x(axes: "Axes", values: Array) -> None:
    """Logarithmic axis of the gain, the same in both panels."""
    axes.set_xscale("log")
    axes.set_xlim(float(values.min()) / 1.2, float(values.max()) * 1.2)
    log_ticks(axes, "x", (1,) if values.max() > 1e3 * values.min() else (1, 3))


def draw_gamma(axes: "Axes", made: Sequence[Mapping[str, Any]], shipped: Mapping[str, Any] | None, x: str) -> None:
    """Certified gains, the line between their ends, the limit over all gains, and the design that is shipped."""
    gains, gammas = (np.array([p["certified"][key] for p in made]) for key in (x, "gamma"))
    axes.plot(gains, gammas, ".-", color=TRUE, markersize=7, label="certified gains")
    if len(made) > 1:
        axes.plot(gains[[0, -1]], gammas[[0, -1]], linestyle=DOTTED, color="black", label="between the ends")
    limit = (shipped or {}).get("limit", {})
    least = limit.get("gamma") if limit.get("kind", "infimum") == "infimum" else None
    if least:
        axes.axhline(least, linestyle=DOT_DASHED, color="black", label="limit of all gains")
    if shipped is not None:
        values = f"{short(x)} = {shipped[x]:.4g}, γ = {proved('gamma', shipped['gamma'])}"
        mark_shipped(axes, shipped[x], shipped["gamma"], f"this design: {values}")
    axes.set_ylabel("γ, gain to the error z")
    log_axis(axes, np.array([*gammas, *([least] if least else [])]))


def draw_noise(axes: "Axes", made: Sequence[Mapping[str, Any]], x: str) -> None:
    """Rms of the noise in each estimate, of certified gains."""
    key = next((key for key in NOISE for p in made if p.get(key)), "noise_density")
    axes.set_ylabel(NOISE[key])
    known = [p for p in made if p.get(key)]
    for name, color in zip(list(known[0][key])[:MOST] if known else (), cycle(COLORS), strict=False):
        sizes = [p[key][name] for p in known]
        axes.plot([p["certified"][x] for p in known], sizes, ".-", color=color, label=f"noise in {plain(name)}")
    log_axis(axes, np.array([size for p in known for size in list(p[key].values())[:MOST] if size > 0]))
    if not known:
        axes.text(0.5, 0.5, "not told: slopes are not bounded", ha="center", transform=axes.transAxes)


gain_figure = drawn(gain_sheet)
