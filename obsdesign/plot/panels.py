"""Panels of a figure of a run: what each draws on its axes. The truth is solid, estimates are dashed."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.families.guarantee import HELD, LAST, RESOLVED
from obsdesign.lmi.formula import Array
from obsdesign.plot.axis import ABOVE, finite, growing_axis, levels, plain, span, thinned, time_axis
from obsdesign.plot.canvas import (
    BOUND,
    COLORS,
    DASHED,
    DOT_DASHED,
    DOTTED,
    ESTIMATE,
    TRUE,
    legend_above,
    log_ticks,
    number,
)
from obsdesign.plot.hybrid import DOTS, mark_lost
from obsdesign.plot.signals import Curve, Estimate
from obsdesign.records import dataclass

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from obsdesign.simulate import Run

REGION = COLORS[3]
MEASURED: dict[str, Any] = {"color": "black", "alpha": 0.4, "linewidth": 0.7}
BAND = "proved: the truth is in here"
CURVES = 4  # in one panel
PEAK = 4  # widths of the truth: a transient that takes more of a panel is cut off
GROWTH = 10  # of a signal that escapes, against its beginning
APART = 20  # of two signals in one panel: a smaller one is multiplied by a power of ten
SHARES = (("t5", 5, "D"), ("t1", 1, "s"))  # settling time, percent of the error at first, and how it is marked
SETTLED = "stays within 5 %, 1 % of |e(0)|"
BESIDE = 26  # letters that fit beside a panel; a longer label stands above it
MOST, LEAST = 84, 8  # letters that fit above a panel, and of a name that are left of it
SIGNS = {"D": "◇", "s": "□"}
BUSY = 20  # times its height that a signal goes up and down
SEEN = 0.05  # of the samples, at which a band has to be narrower than its panel to be drawn
LINE = 0.01  # of the height of a panel: about that of a line
NARROWER, MOSTLY = 0.25, 0.5  # of the panel, at so many of the samples: of several bands


@dataclass(frozen=True)
class Signals:
    """Panel of signals over time: truth solid, estimate dashed, what is measured gray."""

    run: "Run"
    curves: Sequence[Curve]
    label: str  # where there are several; one is labeled by its name

    def draw(self, axes: "Axes") -> None:
        """Draw with limits that show the signals; an initial transient of an estimate may leave the panel.

        Of signals of several sizes the smaller ones are multiplied by powers of ten. Signals that escape are drawn on
        an axis that is linear as far as they are at first, and logarithmic beyond.
        """
        escapes, alone = self.run.status == "escape", len(self.curves) == 1
        factors = [1.0] * len(self.curves) if escapes else scales(self.curves)
        curves = [curve.scaled(factor) for curve, factor in zip(self.curves, factors, strict=True)]
        looks = [(TRUE, ESTIMATE)] if alone else [(color, color) for color in COLORS[: len(curves)]]
        lines = [self.draw_curve(axes, curve, *look) for curve, look in zip(curves, looks, strict=True)]
        cut = "" if escapes and grow(axes, curves) else limit(axes, curves, factors)
        self.tell(axes, *(looks[0] if alone else ("black", "black")))
        for curve, (_, color) in zip(curves, looks, strict=True):
            mark_region(axes, curve.region)
            draw_band(axes, self.run.t, curve, color, alone, stairs=self.run.spec.period is not None)
        if self.run.schedule is not None and any(curve.instants is not None for curve in curves):
            mark_lost(axes, self.run.schedule)
        time_axis(axes, self.run.time)
        beside = alone and len(self.curves[0].label) <= BESIDE
        axes.set_ylabel(self.curves[0].label if beside else self.label)
        axes.set_title(cut, loc="left", fontsize=8)
        if not beside:
            legend_above(axes, lines, [c.label + times(f) for c, f in zip(curves, factors, strict=True)])

    def draw_curve(self, axes: "Axes", curve: Curve, color: str, other: str) -> Any:
        """Draw one signal with what is known of it; returns the line of the truth."""
        t = self.run.t
        if curve.measured is not None and curve.instants is not None:
            axes.plot(curve.instants, curve.measured, **dots(len(curve.measured)), color=color)
        elif curve.measured is not None:
            axes.plot(*thinned(t, curve.measured), **{**MEASURED, "color": color})
        (line,) = axes.plot(*thinned(t, curve.true), color=color, zorder=1.9 if busy(curve.true) else 2)
        if curve.estimate is not None:
            axes.plot(*thinned(t, curve.estimate), color=other, linestyle=DASHED)
        return line

    def tell(self, axes: "Axes", color: str, other: str) -> None:
        """Say below the figure which lines are which, if there are several sorts."""
        estimated, measured = (
            any(getattr(curve, name) is not None for curve in self.curves) for name in ("estimate", "measured")
        )
        if estimated or measured:
            axes.plot([], [], color=color, label="true")
        if estimated:
            axes.plot([], [], color=other, linestyle=DASHED, label="estimate")
        if measured and self.run.schedule is None:
            axes.plot([], [], **MEASURED, label="measured")
        elif measured:
            axes.plot([], [], **dots(0), color=color, label="measured")


def busy(values: Array) -> bool:
    """Whether a signal goes up and down so often that it is a ground to others, and better drawn below them."""
    seen = known([values])
    return bool(np.abs(np.diff(seen)).sum() > BUSY * np.ptp(seen))


def dots(count: int) -> dict[str, Any]:
    """Look of so many measurements."""
    return {"linestyle": "none", "marker": ".", "markersize": 4 if count <= DOTS else 1.5}


def scales(curves: Sequence[Curve]) -> list[float]:
    """Powers of ten with which signals are seen beside each other; 1 where they are of about one size."""
    sizes = [max(map(abs, limits([curve]))) for curve in curves]
    top = max(sizes)
    return [10.0 ** np.floor(np.log10(top / size)) if 0 < size < top / APART else 1.0 for size in sizes]


def times(factor: float) -> str:
    """How a factor is told beside a name."""
    return "" if factor == 1 else f" × {number(factor)}"


def limit(axes: "Axes", curves: Sequence[Curve], factors: Sequence[float] | None = None) -> str:
    """Set the limits of y; returns a note of what they cut off, without the factors that the curves have."""
    low, high = limits(curves)
    axes.set_ylim(low, high)
    return cut_off(curves, factors or [1.0] * len(curves), low, high)


def cut_off(curves: Sequence[Curve], factors: Sequence[float], low: float, high: float) -> str:
    """Note of the estimate that is farthest beyond limits, if one is."""
    ends = [
        (max(low - end, end - high), end / factor, curve.label)
        for curve, factor in zip(curves, factors, strict=True)
        if (signal := curve.estimate if curve.stepped is None else curve.stepped) is not None
        for end in (float(known([signal]).min()), float(known([signal]).max()))
    ]
    beyond, reached, label = max(ends, default=(0.0, 0.0, ""))
    if beyond <= 0:
        return ""
    alone = len({curve.label for curve in curves}) == 1
    which = "an estimate" if alone else f"estimate of {label.partition(' [')[0]}"
    return f"{which} reaches {number(reached)}"


def draw_band(axes: "Axes", t: Array, curve: Curve, color: str, alone: bool, *, stairs: bool) -> None:
    """Shade where the truth is proved to be, around the estimate.

    Not where this is more than the panel nearly always, or, beside others, more than a part of it most of the time,
    and not where it is never more than a line.
    """
    if curve.radius is None or curve.estimate is None:
        return
    low, high = axes.get_ylim()
    room, share = (high - low, SEEN) if alone else (NARROWER * (high - low), MOSTLY)
    width = 2 * np.nan_to_num(curve.radius, nan=np.inf)
    if np.mean(width < room) < share or width.max() < LINE * (high - low):
        return
    ends = [thinned(t, curve.estimate + sign * curve.radius) for sign in (-1, 1)]
    (below, lower), (above, upper) = ends
    if len(t) > len(below) or len(t) > len(above):
        lower, upper = (np.interp(t, at, end) for at, end in ends)
        below = t
    step: dict[str, Any] = {"step": "post"} if stairs else {}
    axes.fill_between(below, lower, upper, color=color, alpha=0.18, linewidth=0, zorder=0.5, **step)
    axes.fill_between([], [], color="black", alpha=0.18, linewidth=0, label=BAND)


def draw_errors(axes: "Axes", run: "Run", estimates: Sequence[Estimate]) -> None:
    """Draw errors with their proved bounds, where they peak and from when on they stay within 5 % and 1 % of the first.

    The size on a logarithmic axis where errors, or a bound and its error, span decades; else the error itself.
    """
    t, alone = run.steps.t, len(estimates) == 1
    sizes = [np.abs(each.error) for each in estimates]
    bounds = [each.bound for each in estimates if each.bound is not None]
    spread = span(*([levels(t, size) for size in each] for each in (sizes, bounds)))
    lines = []
    for each, size, color in zip(estimates, sizes, COLORS, strict=False):
        shown = size if spread else each.error
        lines += axes.plot(*thinned(t, shown), color=color)
        for sign in (1,) if spread else (1, -1):
            draw_bound(axes, each, sign, BOUND if alone else color)
    if spread:
        peak = max(float(size.max()) for size in sizes) or spread[1]
        axes.set_yscale("log")
        axes.set_ylim(spread[0] / 3, 2 * min(max(spread[1], peak), ABOVE * peak))
        log_ticks(axes)
    else:
        axes.axhline(0, color="black", linewidth=0.6)
    for each, color in zip(estimates, COLORS, strict=False):
        mark(axes, each, bool(spread), color)
    time_axis(axes, run.time)
    what = "|error|" if spread else "error"
    alone = alone and len(estimates[0].label) <= BESIDE
    axes.set_ylabel(f"{what} of {estimates[0].label}" if alone else what)
    legend_above(axes, lines, [told(each, alone) for each in estimates])


def draw_bound(axes: "Axes", estimate: Estimate, sign: int, color: str) -> None:
    """Draw what is proved of an error: a bound at each instant, or a limit for the last fifth of the run."""
    look: dict[str, Any] = {"color": color, "linestyle": DOTTED, "linewidth": 1.3}
    t = estimate.t
    if estimate.bound is not None and np.isfinite(estimate.bound).any():
        axes.plot(*thinned(t, sign * estimate.bound), **look)
        axes.plot([], [], **{**look, "color": BOUND}, label="proved bound on the error")
    if estimate.limit is not None:
        late = np.array([LAST * t[-1], t[-1]])
        axes.plot(late, np.full(2, sign * estimate.limit), **look)
        axes.plot([], [], **{**look, "color": BOUND}, label="proved of the last fifth")


def mark(axes: "Axes", estimate: Estimate, sizes: bool, color: str) -> None:
    """Mark the peak of an error (or of its size), and from when on it stays within 5 % and 1 % of the first one."""
    low, high = axes.get_ylim()
    settled = {sign: (estimate.settling or {}).get(key) for key, _, sign in SHARES}
    times = {sign: time for sign, time in settled.items() if time and not ends_first(estimate, time)}
    drawn = np.abs(estimate.error) if sizes else estimate.error
    values = {sign: (time, float(np.interp(time, estimate.t, drawn))) for sign, time in times.items()}
    top = int(np.argmax(np.nan_to_num(np.abs(estimate.error))))  # where the estimate jumps there are two at one time
    for marker, (at, value) in {"o": (float(estimate.t[top]), float(drawn[top])), **values}.items():
        if value and low <= value <= high:
            look: dict[str, Any] = {"color": color, "markersize": 4.5, "clip_on": False, "zorder": 4}
            axes.plot(at, value, marker=marker, markerfacecolor="white", linestyle="none", **look)
    if times:
        axes.plot([], [], "D", color="black", markerfacecolor="white", markersize=4.5, label=SETTLED)


def told(estimate: Estimate, alone: bool) -> str:
    """Legend of an error: its name, its peak, and the times after which it stays within 5 % and 1 % of the first."""
    at, peak = estimate.peak
    said = [f"peak {number(peak)} at {number(at)} s (○)" if peak else "no error"]
    for key, share, sign in SHARES:
        time = (estimate.settling or {}).get(key, 0.0)
        if time is None or ends_first(estimate, time):
            said.append(f"{share} % not reached" if time is None else f"{share} % not held before the end")
            break
        if time:
            said.append(f"{share} % after {number(time)} s ({SIGNS[sign]})")
    text = ", ".join(said)
    return text if alone else f"{plain(estimate.label, max(MOST - len(text), LEAST))}: {text}"


def ends_first(estimate: Estimate, time: float) -> bool:
    """Whether a run ends so soon after a time that what was reached then is not seen to be kept."""
    return time > HELD * float(estimate.t[-1])


def draw_storage(axes: "Axes", run: "Run") -> None:
    """Draw V(e) on a logarithmic axis, and its bound as long as the guarantee says something of the run."""
    V, bound, t = run.steps.V, run.steps.V_bound, run.steps.t
    assert V is not None
    assert bound is not None
    known = t < run.until
    if known.any():
        shown = finite(bound[known])
        axes.plot(*thinned(t[known], shown), color=BOUND, linestyle=DOTTED, label="proved bound on V")
    axes.plot(*thinned(t, finite(V)), color=TRUE)
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, float(finite(V)[np.isfinite(V)].max(initial=0.0)) * RESOLVED**2), high)
    log_ticks(axes)
    time_axis(axes, run.time)
    axes.set_ylabel("V(e)")


def limits(curves: Sequence[Curve]) -> tuple[float, float]:
    """Limits of y.

    They hold the truth, the second half of each estimate, what `usual` tells of the first, and the region as far as it
    is no further from the truth than the truth is wide; so that a high initial transient does not hide the truth.
    """
    true = known([c.true for c in curves])
    estimates = [known([c.estimate]) for c in curves if c.estimate is not None]
    low, high = float(true.min()), float(true.max())
    width = (high - low) or abs(high) or np.inf
    regions = [end for c in curves for end in c.region or () if np.isfinite(end)]
    ends = [np.clip(regions, low - width, high + width)] if regions else []
    measured = [np.clip(known([c.measured]), low - width, high + width) for c in curves if c.measured is not None]
    late = [e[len(e) // 2 :] for e in estimates]
    seen = [true, *ends, *measured, *(usual(e, low, high, width) for e in estimates), *late]
    low, high = min(float(s.min()) for s in seen), max(float(s.max()) for s in seen)
    room = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    return low - room, high + room


def known(signals: Sequence[Array]) -> Array:
    """Finite values of some signals, at least one."""
    values = np.concatenate(signals)
    seen: Array = values[np.isfinite(values)]
    return seen if seen.size else np.zeros(1)


def usual(estimate: Array, low: float, high: float, width: float) -> Array:
    """Range of an estimate beside which the truth is seen, else of 90 % of its samples, within a width of the truth."""
    ends = np.array([estimate.min(), estimate.max()])
    if max(high, ends[1]) - min(low, ends[0]) <= PEAK * width:
        return ends
    most: Array = np.clip(np.quantile(estimate, [0.05, 0.95]), low - width, high + width)
    return most


def grow(axes: "Axes", curves: Sequence[Curve]) -> bool:
    """Give signals an axis on which those that escape are seen from the beginning; False if none is far from it."""
    drawn = known([signal for c in curves for signal in (c.true, c.estimate) if signal is not None])
    low, high = float(drawn.min()), float(drawn.max())
    begin = early(curves)
    if max(-low, high) <= GROWTH * begin:
        return False
    growing_axis(axes, begin, low, high)
    return True


def early(curves: Sequence[Curve]) -> float:
    """Power of ten above the signals in the first tenth of a run."""
    size = max(float(np.abs(known([c.true[: 1 + len(c.true) // 10]])).max()) for c in curves)
    return float(10.0 ** np.ceil(np.log10(size or 1.0)))


def mark_region(axes: "Axes", region: tuple[float, float] | None) -> None:
    """Draw the limits of a region, as far as they are within those of the axes."""
    bottom, top = axes.get_ylim()
    for end in region or ():
        if bottom < end < top:
            axes.axhline(end, color=REGION, linestyle=DOT_DASHED, linewidth=1.3, zorder=1, label="limit of the region")
