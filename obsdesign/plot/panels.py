"""Panels of a figure: what each draws on its axes. The truth is solid, estimates are dashed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.plot.axis import linear_threshold, symlog_axis, time_axis
from obsdesign.plot.canvas import COLORS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TRUE, ESTIMATE = COLORS[:2]
DASHED = (0, (4, 2))
BOUND = COLORS[6]
OUTSIDE = "#F3D9D2"
GROWTH = 10  # of a signal that escapes, against its beginning
LEAN: dict[str, Any] = {"borderaxespad": 0.1, "borderpad": 0.1, "columnspacing": 1.2, "handletextpad": 0.5}


@dataclass(frozen=True)
class Curve:
    """A true signal and, if there is one, its estimate; and the region in which both should stay, if there is one."""

    name: str
    true: Array
    estimate: Array | None
    region: tuple[float, float] | None = None


@dataclass(frozen=True)
class Comparison:
    """Panel of signals over time: truth solid, estimate dashed."""

    t: Array
    curves: Sequence[Curve]
    label: str
    escapes: bool = False

    def draw(self, axes: "Axes") -> None:
        """Draw with limits that show the signals; an initial transient of an estimate may leave the panel.

        Signals that escape are drawn on an axis that is linear as far as they are at first, and logarithmic beyond.
        """
        low, high, cut = limits(self.curves)
        grows = self.escapes and max(-low, high) > GROWTH * early(self.curves)
        cut = "" if grows else cut
        alone = len(self.curves) == 1
        for curve, color in zip(self.curves, COLORS, strict=False):
            axes.plot(self.t, curve.true, color=color, label=curve.name)
            if curve.estimate is not None:
                other, label = (ESTIMATE, f"estimate{cut}") if alone else (color, None)
                axes.plot(self.t, curve.estimate, color=other, linestyle=DASHED, label=label)
        if cut and not alone:
            axes.plot([], [], " ", label=f"an estimate{cut}")
        if grows:
            symlog_axis(axes, early(self.curves), *extremes(self.curves), 1 / 2)
            low, high = axes.get_ylim()
        axes.set_ylim(low, high)
        for curve in self.curves:
            shade_outside(axes, curve.region)
        time_axis(axes, self.t, log=False)
        axes.set_ylabel(self.label)
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3 if alone else 4, **LEAN)


@dataclass(frozen=True)
class Level:
    """A horizontal line of an error panel, from a time on."""

    value: float
    start: float
    label: str


@dataclass(frozen=True)
class Errors:
    """Panel of estimation errors on a symmetric logarithmic axis."""

    t: Array
    curves: Sequence[tuple[str, Array]]
    label: str
    log_time: bool
    level: Level | None = None

    def draw(self, axes: "Axes") -> None:
        """Draw; the axis is linear about zero, below the errors that matter."""
        for (name, values), color in zip(self.curves, COLORS, strict=False):
            axes.plot(self.t, values, color=color, label=name)
        threshold = linear_threshold([values for _, values in self.curves])
        low = min(float(values.min()) for _, values in self.curves)
        high = max(float(values.max()) for _, values in self.curves)
        if self.level:
            axes.plot([self.level.start, self.t[-1]], 2 * [self.level.value], color=BOUND, linestyle=DASHED)
            axes.plot([], [], color=BOUND, linestyle=DASHED, label=self.level.label)
            high = max(high, self.level.value)
        symlog_axis(axes, threshold, low, high, 1 / 6)
        axes.axhline(0, color="black", linewidth=0.6)
        time_axis(axes, self.t, self.log_time)
        axes.set_ylabel(self.label)
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=4, **LEAN)


@dataclass(frozen=True)
class Storage:
    """Panel of V(e) and its bound."""

    t: Array
    V: Array
    bound: Array
    log_time: bool
    until: float  # the guarantee says nothing after that

    def draw(self, axes: "Axes") -> None:
        """Draw on a logarithmic axis."""
        tiny = float(self.bound.max()) * 1e-20 + 1e-300
        known = self.t < self.until
        axes.plot(
            self.t[known],
            np.maximum(self.bound, tiny)[known],
            color=BOUND,
            linestyle=DASHED,
            label="proved bound" if known.all() else "proved bound, while in the region",
        )
        axes.plot(self.t, np.maximum(self.V, tiny), color=TRUE, label="V(e) = e' P e")
        axes.set_yscale("log")
        time_axis(axes, self.t, self.log_time)
        axes.set_ylabel("V(e)")
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, **LEAN)


Panel = Comparison | Errors | Storage


def limits(curves: Sequence[Curve]) -> tuple[float, float, str]:
    """Limits of y, and a note of what they cut off.

    They hold the truth, the second half of each estimate, and 90 % of its samples and the region as far as these
    are no further from the truth than the truth is wide; so that an initial transient hides nothing.
    """
    true = np.concatenate([c.true for c in curves])
    estimates = [c.estimate for c in curves if c.estimate is not None]
    low, high = float(true.min()), float(true.max())
    width = (high - low) or abs(high) or np.inf
    most = [np.clip(np.quantile(e, [0.05, 0.95]), low - width, high + width) for e in estimates]
    regions = [end for c in curves for end in c.region or () if np.isfinite(end)]
    ends = [np.clip(regions, low - width, high + width)] if regions else []
    seen = [true, *most, *ends, *(e[len(e) // 2 :] for e in estimates)]
    low, high = min(float(s.min()) for s in seen), max(float(s.max()) for s in seen)
    room = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    low, high = low - room, high + room
    furthest = max((float(e[np.argmax(np.abs(e))]) for e in estimates), key=abs, default=0.0)
    return low, high, "" if low <= furthest <= high else f" (reaches {furthest:.3g})"


def extremes(curves: Sequence[Curve]) -> tuple[float, float]:
    """Smallest and largest value, of estimates too."""
    drawn = [signal for c in curves for signal in (c.true, c.estimate) if signal is not None]
    return min(float(s.min()) for s in drawn), max(float(s.max()) for s in drawn)


def early(curves: Sequence[Curve]) -> float:
    """Power of ten above the signals in the first tenth of a run."""
    size = max(float(np.abs(c.true[: 1 + len(c.true) // 10]).max()) for c in curves)
    return float(10.0 ** np.ceil(np.log10(size or 1.0)))


def shade_outside(axes: "Axes", region: tuple[float, float] | None) -> None:
    """Shade what is outside a region, within the limits of the axes."""
    if region is None:
        return
    bottom, top = axes.get_ylim()
    label: str | None = "outside"
    for low, high in ((bottom, min(region[0], top)), (max(region[1], bottom), top)):
        if low < high:
            axes.axhspan(low, high, color=OUTSIDE, linewidth=0, zorder=0, label=label)
            label = None
