"""Limits, ticks and labels of axes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.plot.canvas import COLORS, log_ticks
from obsdesign.spec import Spec

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DECADES = 14  # below the peak that an error axis shows
NEAR = 10  # times the threshold: what a linear axis shows as well
CLOSEST = 0.1  # of the height of a panel: ticks with labels that do not touch


def linear_threshold(values: Sequence[Array]) -> float:
    """Power of ten above the smallest initial, median or final error, at most 14 decades below the peak.

    Above, so that an error that goes on oscillating does so inside the linear part.
    """
    sizes = [np.abs(v) for v in values]
    peak = max(float(size.max()) for size in sizes) or 1.0
    ends = [(size[0], np.median(size), size[-max(1, len(size) // 20) :].max()) for size in sizes]
    smallest = min((float(size) for three in ends for size in three if size > 0), default=peak)
    return float(10.0 ** np.ceil(np.log10(max(smallest, peak * 10.0**-DECADES))))


def symlog_axis(axes: "Axes", threshold: float, low: float, high: float) -> None:
    """Y axis for values from low to high, linear below the threshold, else logarithmic; linear if all are near it."""
    low, high = min(low, 0.0), max(high, 0.0)
    if max(-low, high) <= NEAR * threshold:
        return
    decades = sum(max(0.0, np.log10(size / threshold)) for size in (-low, high) if size > 0)
    axes.set_yscale("symlog", linthresh=threshold, linscale=max(0.5, decades / 8))
    signed_ticks(axes, threshold, low, high)


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
    axes.set_yticks(sorted(ticks))
    said = f"logarithmic beyond ±{number(least)}"
    axes.annotate(said, (1.01, 0.5), xycoords="axes fraction", va="center", rotation=90, fontsize=7, color="#555555")
    axes.minorticks_off()


def time_axis(axes: "Axes", t: Array, log: bool) -> None:
    """Label and limit the time axis; on a logarithmic one at most six decades."""
    end = float(t[-1]) if len(t) and t[-1] > 0 else 1.0
    if log:
        axes.set_xscale("log")
        axes.set_xlim(max(float(t[1]), 1e-6 * end), end)
    else:
        axes.set_xlim(0, end)
        axes.locator_params(axis="x", nbins=6, steps=[1, 2, 5, 10])
    axes.set_xlabel("t [s]")


def spread_axis(axes: "Axes", which: str, values: Sequence[float]) -> None:
    """Logarithmic axis where positive values spread over more than a decade and a half."""
    if values and min(values) > 0 and max(values) > 30 * min(values):
        axes.set(**{f"{which}scale": "log"})


def log_axis(axes: "Axes", values: Array) -> None:
    """Logarithmic y axis with ticks in plain numbers, which has several of them also within a decade."""
    seen = values[np.isfinite(values)]
    if not seen.size or seen.min() <= 0:
        return
    axes.set_yscale("log")
    axes.set_ylim(float(seen.min()) / 1.15, float(seen.max()) * 1.15)
    spread = seen.max() / seen.min()
    if spread < 1e3:
        log_ticks(axes, (1, 2, 3, 6) if spread < 30 else (1, 3))


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


def mark_shipped(axes: "Axes", x: float, y: float) -> None:
    """Star."""
    axes.plot(x, y, "*", color=COLORS[4], markeredgecolor="black", markersize=12, label="shipped", clip_on=False)


def symbol(key: str) -> str:
    """Greek letter of a key, or the key."""
    greek = {
        "alpha": r"decay rate $\alpha$ [1/s]",
        "gamma": r"$\gamma$",
        "omega": r"$\omega$ [rad/s]",
        "T2": r"$T_2$ [s]",
        "decay": r"decay rate $\lambda_t$ [1/s]",
    }
    return greek.get(key, plain(key))


def with_unit(spec: Spec, name: str) -> str:
    """Name and unit of a signal."""
    unit = spec.units.get(name)
    return plain(f"{name} [{unit}]" if unit else name)


def number(value: float) -> str:
    """Three digits; a power of ten is written as one."""
    digits, _, exponent = f"{value:.3g}".partition("e")
    return rf"${digits} \times 10^{{{int(exponent)}}}$" if exponent else digits


def plain(text: str) -> str:
    """Text as it is, not as mathematics."""
    return text.replace("$", r"\$")
