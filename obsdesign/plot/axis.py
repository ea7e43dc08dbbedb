"""Limits, ticks and labels of axes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.spec.model import Spec

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DECADES = 14  # below the peak that an error axis shows


def linear_threshold(values: Sequence[Array]) -> float:
    """Power of ten above the smallest initial, median or final error, at most 14 decades below the peak.

    Above, so that an error that goes on oscillating does so inside the linear part.
    """
    sizes = [np.abs(v) for v in values]
    peak = max(float(size.max()) for size in sizes) or 1.0
    ends = [(size[0], np.median(size), size[-max(1, len(size) // 20) :].max()) for size in sizes]
    smallest = min((float(size) for three in ends for size in three if size > 0), default=peak)
    return float(10.0 ** np.ceil(np.log10(max(smallest, peak * 10.0**-DECADES))))


def symlog_ticks(threshold: float, peak: float) -> list[float]:
    """Zero and at most four powers of ten each way, from the threshold to the peak."""
    low, high = round(np.log10(threshold)), int(np.floor(np.log10(max(peak, threshold))))
    stride = max(1, -(-(high - low) // 3))
    decades = [10.0**k for k in range(high, low - 1, -stride)]
    return sorted([0.0, *decades, *(-d for d in decades)])


def time_axis(axes: "Axes", t: Array, log: bool) -> None:
    """Label and limit the time axis; on a logarithmic one at most six decades."""
    end = float(t[-1]) if len(t) and t[-1] > 0 else 1.0
    if log:
        axes.set_xscale("log")
        axes.set_xlim(max(float(t[1]), 1e-6 * end), end)
    else:
        axes.set_xlim(0, end)
    axes.set_xlabel("t [s]")


def spread_axis(axes: "Axes", which: str, values: Sequence[float]) -> None:
    """Logarithmic axis where positive values spread over more than a decade and a half."""
    if values and min(values) > 0 and max(values) > 30 * min(values):
        axes.set(**{f"{which}scale": "log"})


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


def plain(text: str) -> str:
    """Text as it is, not as mathematics."""
    return text.replace("$", r"\$")
