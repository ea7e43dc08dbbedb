"""Limits, ticks and labels of axes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.plot.canvas import COLORS, log_ticks, number
from obsdesign.spec import Spec

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DECADES = 9  # below its peak that an error is drawn: what an integration tells from zero
SPAN = 30  # an error that spans so much is drawn on a logarithmic axis
ABOVE = 1e3  # times the peak of an error: how far above it a bound is drawn
CELLS = 1000  # of time, of each of which a curve shows the least and the largest value
DOTS = 120  # samples of a curve that are told apart
WINDOWS = 20  # of time, of each of which the largest error counts where an axis is chosen
HUGE = 1e150  # what is beyond is drawn as this
CLOSEST = 0.1  # of the height of a panel: ticks with labels that do not touch
NAME = 40  # letters of a name


def finite(values: Array) -> Array:
    """Values that can be drawn: NaN where one is not finite, and none that is huge."""
    return np.where(np.isfinite(values), np.clip(values, -HUGE, HUGE), np.nan)


def cells(t: Array, count: int) -> Array:
    """Index of the first of some times in each of so many equal cells, as far as there are any."""
    return np.unique(np.searchsorted(t, np.linspace(t[0], t[-1], count, endpoint=False)))


def thinned(t: Array, values: Array) -> tuple[Array, Array]:
    """Times and values of a curve that looks the same: the least and the largest value in each cell of time."""
    if len(t) <= 4 * CELLS:
        return t, values
    begin = cells(t, CELLS)
    ends = np.append(begin[1:], len(t))
    known = np.where(np.isfinite(values), values, -np.inf)
    pairs = [(i, i + f(known[i:j]), j - 1) for i, j in zip(begin, ends, strict=True) for f in (np.argmin, np.argmax)]
    kept = np.unique(np.array(pairs))
    return t[kept], values[kept]


def levels(t: Array, size: Array) -> Array:
    """Largest of the sizes (M,) in each of some windows of time, as far as it is positive."""
    largest = np.maximum.reduceat(np.nan_to_num(np.minimum(size, HUGE)), cells(t, WINDOWS))
    return np.asarray(largest[largest > 0])


def span(sizes: Sequence[Array], bounds: Sequence[Array]) -> tuple[float, float] | None:
    """Least and largest of the levels of errors and of their bounds; None if they do not span decades."""
    errors, every = (np.concatenate([np.zeros(0), *levels]) for levels in (sizes, (*sizes, *bounds)))
    if not errors.size or every.max() <= SPAN * every.min():
        return None
    return max(float(errors.min()), float(errors.max()) * 10.0**-DECADES), float(every.max())


def growing_axis(axes: "Axes", begin: float, low: float, high: float) -> None:
    """Y axis for values from low to high that shows also how they begin: linear for small ones, else logarithmic."""
    low, high = min(low, 0.0), max(high, 0.0)
    axes.set_yscale("asinh", linear_width=begin / 10)
    signed_ticks(axes, begin / 10, low, high)


def signed_ticks(axes: "Axes", least: float, low: float, high: float) -> None:
    """Ticks at zero and at powers of ten each way, from the least on, far enough apart to be read."""
    at = axes.yaxis.get_transform().transform
    room = CLOSEST * float(np.subtract(*at(np.array([high, low]))))
    ticks = [0.0]
    for end in (low, high):
        sign, last = float(np.sign(end)), 0.0
        for k in range(round(np.log10(least)), int(np.floor(np.log10(abs(end) or least))) + 1):
            tick = sign * 10.0**k
            if sign and abs(tick) <= abs(end) and abs(float(np.subtract(*at(np.array([tick, last]))))) >= room:
                ticks.append(tick)
                last = tick
    axes.set_yticks(sorted(ticks), [number(tick).replace("-", "−") for tick in sorted(ticks)])
    said = f"logarithmic beyond ±{number(least)}"
    axes.annotate(said, (1.01, 0.5), xycoords="axes fraction", va="center", rotation=90, fontsize=7, color="#555555")
    axes.minorticks_off()


def time_axis(axes: "Axes", end: float) -> None:
    """Label and limit the axis of time, from zero."""
    axes.set_xlim(0, end if end > 0 else 1.0)
    axes.locator_params(axis="x", nbins=6, steps=[1, 2, 5, 10])
    axes.set_xlabel("t [s]")


def stairs(axes: "Axes") -> None:
    """Draw curves of samples as what they are: each value up to the next one, with a dot at it where there is room."""
    for line in axes.lines:
        count = len(np.atleast_1d(line.get_xdata()))
        if count > 2 and line.get_linestyle() != "None":
            line.set_drawstyle("steps-post")
            if count <= DOTS:
                line.set(marker=".", markersize=3.5)


def spread_axis(axes: "Axes", which: str, values: Sequence[float]) -> None:
    """Logarithmic axis where positive values spread over more than a decade and a half."""
    if values and min(values) > 0 and max(values) > 30 * min(values):
        axes.set(**{f"{which}scale": "log"})
        log_ticks(axes, which, (1,) if max(values) > 1e3 * min(values) else (1, 3))


def log_axis(axes: "Axes", values: Array) -> None:
    """Logarithmic y axis with ticks in plain numbers, which has several of them also within a decade."""
    seen = values[np.isfinite(values)]
    if not seen.size or seen.min() <= 0:
        return
    axes.set_yscale("log")
    axes.set_ylim(float(seen.min()) / 1.15, float(seen.max()) * 1.15)
    spread = seen.max() / seen.min()
    log_ticks(axes, multiples=(1,) if spread >= 1e3 else (1, 3) if spread >= 30 else (1, 2, 3, 6))


def highest(values: Array) -> float:
    """Largest of the finite values that a linear axis from zero shows: at most four times the ninth decile."""
    seen = np.abs(values[np.isfinite(values)])
    most = 4 * np.quantile(seen, 0.9) if seen.size else 0.0
    return float(seen.max(initial=0.0, where=seen <= most)) or 1.0


def mark_beyond(axes: "Axes", x: Array, color: str, size: float, label: str) -> None:
    """Triangles at the top of a panel, for what lies above it."""
    if len(x):
        axes.plot(
            x, [0.97] * len(x), "^", color=color, markersize=size, transform=axes.get_xaxis_transform(), label=label
        )


def mark_refused(axes: "Axes", x: Sequence[float] | Array, status: Sequence[str | None]) -> None:
    """Crosses at the foot of a panel, for points without a result."""
    foot = axes.get_xaxis_transform()
    for refused in dict.fromkeys(s for s in status if s is not None):
        at = [a for a, s in zip(x, status, strict=True) if s == refused]
        axes.plot(at, [0.03] * len(at), **cross(refused), transform=foot)


def cross(status: str) -> dict[str, Any]:
    """Look of points without a result."""
    marker, color = ("x", COLORS[3]) if status == "infeasible" else ("+", COLORS[2])
    return {"linestyle": "none", "marker": marker, "color": color, "clip_on": False, "label": status}


def mark_shipped(axes: "Axes", x: float, y: float, label: str = "this design") -> None:
    """Star."""
    axes.plot(x, y, "*", color=COLORS[4], markeredgecolor="black", markersize=12, label=label, clip_on=False)


def with_unit(spec: Spec, name: str) -> str:
    """Name and unit of a signal."""
    unit = spec.units.get(name)
    return plain(name) + (f" [{plain(unit)}]" if unit else "")


def plain(text: str, most: int = NAME) -> str:
    """Text of a spec in one line: what cannot be printed is replaced, and what is longer is cut.

    A legend leaves out what begins with an underscore, unless there is a space before it.
    """
    line = "".join(c if c.isprintable() else "\ufffd" for c in " ".join(text.split()))
    cut = line if len(line) <= most else f"{line[: most - 1]}…"
    return f" {cut}" if cut.startswith("_") else cut
