"""Figures of runs and of trade-off curves, as PNG. The only matplotlib code.

Colors are those of Okabe and Ito, which people with any color vision tell apart; the truth is solid,
estimates are dashed.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.observers.guarantee import Guarantee
from obsdesign.simulate import Run
from obsdesign.spec.model import Spec

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
TRUE, ESTIMATE = COLORS[:2]
DASHED = (0, (4, 2))
ROW = 4  # panels beside each other
CURVES = 7  # in one panel: as many as there are colors
SINGLE = 8  # so many signals get a panel each; more share panels
FAST = 0.1  # of the run: an error that settles sooner is drawn over the logarithm of time
DECADES = 14  # below the peak that an error axis shows
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
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.use_mathtext": True,
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
}


def run_figure(spec: Spec, run: Run, guarantee: Guarantee | None) -> bytes:
    """Draw states and unknown inputs with their estimates, errors, and V(e) against its bound.

    Errors are drawn at the steps of the integrator, so that a peak between two samples is seen, and on a
    symmetric logarithmic axis; where they settle early, over the logarithm of time.

    Returns
    -------
    bytes
        A PNG, the same for the same run.
    """
    with style():
        return png(run_sheet(spec, run, guarantee))


def tradeoff_figure(
    points: Sequence[Mapping[str, Any]],
    shipped: Mapping[str, Any] | None,
    title: str,
    x: str = "alpha",
    y: str = "gamma",
) -> bytes:
    """Draw the curve of a search.

    Parameters
    ----------
    points
        Mappings with the searched x, the result y (missing or None where there is none) and "status".
    shipped
        The point of the design that is shipped, or None.
    title, x, y
        Title, and the keys on the axes.

    Returns
    -------
    bytes
        A PNG, the same for the same points.
    """
    with style():
        return png(tradeoff_sheet(points, shipped, title, x, y))


def run_sheet(spec: Spec, run: Run, guarantee: Guarantee | None) -> "Figure":
    """Compose a figure of a run: a row (or more) each of states, unknown inputs and errors."""
    sections = state_panels(spec, run), input_panels(spec, run), error_panels(run, guarantee)
    rows = [row for section in sections for row in shared(list(section), ROW)]
    figure = new_figure(10.5, 0.75 + 2.35 * len(rows))
    figure.suptitle(heading(spec, run, guarantee), fontsize=11)
    grid = figure.add_gridspec(len(rows), 1)
    for i, row in enumerate(rows):
        columns = grid[i].subgridspec(1, len(row))
        for j, panel in enumerate(row):
            panel.draw(figure.add_subplot(columns[j]))
    return figure


def tradeoff_sheet(
    points: Sequence[Mapping[str, Any]], shipped: Mapping[str, Any] | None, title: str, x: str, y: str
) -> "Figure":
    """Compose a figure of a search; a point without a result stands at the foot, under its status."""
    figure = new_figure(6.4, 4.2)
    axes = figure.add_subplot()
    axes.set_title(plain(title), fontsize=11)
    solved = sorted((p[x], p[y]) for p in points if p.get(y) is not None)
    if solved:
        axes.plot(*zip(*solved, strict=True), color=TRUE, marker="o", markersize=3.5, label=f"best {symbol(y)}")
    refused = sorted((p[x], str(p["status"])) for p in points if p.get(y) is None)
    for i, status in enumerate(dict.fromkeys(status for _, status in refused)):
        at, foot = [p for p, s in refused if s == status], axes.get_xaxis_transform()
        color = COLORS[1 + i % (len(COLORS) - 1)]
        axes.plot(at, [0.03] * len(at), "x", color=color, transform=foot, clip_on=False, label=status)
    if shipped is not None:
        axes.plot(
            shipped[x],
            shipped[y],
            "*",
            color=COLORS[4],
            markeredgecolor="black",
            markersize=13,
            label="shipped",
        )
    spread_axis(axes, "x", [p[x] for p in points])
    spread_axis(axes, "y", [value for _, value in solved])
    axes.set_xlabel(symbol(x))
    axes.set_ylabel(symbol(y))
    axes.legend()
    return figure


@dataclass(frozen=True)
class Curve:
    """A true signal and, if there is one, its estimate."""

    name: str
    true: Array
    estimate: Array | None


@dataclass(frozen=True)
class Comparison:
    """Panel of signals over time: truth solid, estimate dashed."""

    t: Array
    curves: Sequence[Curve]
    label: str

    def draw(self, axes: "Axes") -> None:
        """Draw with limits that show the signals; an initial transient of an estimate may leave the panel."""
        alone = len(self.curves) == 1
        for curve, color in zip(self.curves, COLORS, strict=False):
            axes.plot(self.t, curve.true, color=color, label=curve.name)
            if curve.estimate is not None:
                other, label = (ESTIMATE, "estimate") if alone else (color, None)
                axes.plot(self.t, curve.estimate, color=other, linestyle=DASHED, label=label)
        low, high, cut = limits(self.curves)
        axes.set_ylim(low, high)
        if cut:
            axes.set_title(cut, loc="right", fontsize=7, color="#555555", pad=2)
        time_axis(axes, self.t, log=False)
        axes.set_ylabel(self.label)
        axes.legend(loc="best", ncols=1 if alone else 2)


@dataclass(frozen=True)
class Errors:
    """Panel of estimation errors on a symmetric logarithmic axis."""

    t: Array
    curves: Sequence[tuple[str, Array]]
    label: str
    log_time: bool

    def draw(self, axes: "Axes") -> None:
        """Draw; the axis is linear about zero, below the errors that matter."""
        for (name, values), color in zip(self.curves, COLORS, strict=False):
            axes.plot(self.t, values, color=color, label=name)
        threshold = linear_threshold([values for _, values in self.curves])
        low = min(float(values.min()) for _, values in self.curves)
        high = max(float(values.max()) for _, values in self.curves)
        decades = np.log10(max(-low, high, threshold) / threshold)
        axes.set_yscale("symlog", linthresh=threshold, linscale=max(0.8, decades / 6))
        axes.set_yticks([tick for tick in symlog_ticks(threshold, max(-low, high)) if low <= tick <= high or tick == 0])
        axes.minorticks_off()
        axes.axhline(0, color="black", linewidth=0.6)
        time_axis(axes, self.t, self.log_time)
        axes.set_ylabel(self.label)
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, borderaxespad=0.1)


@dataclass(frozen=True)
class Storage:
    """Panel of V(e) and its bound."""

    t: Array
    V: Array
    bound: Array
    log_time: bool

    def draw(self, axes: "Axes") -> None:
        """Draw on a logarithmic axis."""
        tiny = max(float(self.V.max()), float(self.bound.max())) * 1e-20 + 1e-300
        axes.plot(
            self.t,
            np.maximum(self.bound, tiny),
            color=COLORS[6],
            linestyle=DASHED,
            label="proved bound",
        )
        axes.plot(self.t, np.maximum(self.V, tiny), color=TRUE, label="V(e) = e' P e")
        axes.set_yscale("log")
        time_axis(axes, self.t, self.log_time)
        axes.set_ylabel("V(e)")
        axes.legend(loc="best")


Panel = Comparison | Errors | Storage


def state_panels(spec: Spec, run: Run) -> Iterator[Panel]:
    """Panels of the plant's states."""
    n = run.plant_states
    curves = [Curve(name, run.xi[:, i], run.xihat[:, i]) for i, name in enumerate(run.states[:n])]
    return comparisons(spec, run.t, curves, "states (dashed: estimates)")


def input_panels(spec: Spec, run: Run) -> Iterator[Panel]:
    """Panels of the unknown inputs."""
    column = {channel: i for i, channel in enumerate(run.estimated)}
    curves = [
        Curve(name, run.w[:, i], run.what[:, column[i]] if i in column else None)
        for i, name in enumerate(run.exogenous)
    ]
    return comparisons(spec, run.t, curves, "unknown inputs (dashed: estimates)")


def comparisons(spec: Spec, t: Array, curves: Sequence[Curve], what: str) -> Iterator[Panel]:
    """One panel a signal, or one for several where there are many."""
    if len(curves) <= SINGLE:
        for curve in curves:
            yield Comparison(t, [curve], with_unit(spec, curve.name))
    else:
        for group in shared(curves, CURVES // 2 + 1):
            yield Comparison(t, group, what)


def error_panels(run: Run, guarantee: Guarantee | None) -> Iterator[Panel]:
    """Errors of the states, errors of the unknown inputs, and V(e)."""
    settled = run.summary["settling_time"]
    log_time = settled is not None and settled < FAST * run.time
    n = run.plant_states
    states = [(f"e_{name}", run.steps.e[:, i]) for i, name in enumerate(run.states[:n])]
    for group in shared(states, CURVES):
        yield Errors(run.steps.t, group, "state errors", log_time)
    inputs = [(f"e_{run.exogenous[i]}", run.steps.w_error[:, k]) for k, i in enumerate(run.estimated)]
    for group in shared(inputs, CURVES):
        yield Errors(run.steps.t, group, "unknown-input errors", log_time)
    if guarantee is not None and run.steps.V is not None and run.steps.V_bound is not None:
        yield Storage(run.steps.t, run.steps.V, run.steps.V_bound, log_time)


def shared(items: Sequence[Any], most: int) -> Iterator[Sequence[Any]]:
    """Items in groups of nearly equal size."""
    count = -(-len(items) // most)
    for i in range(count):
        yield items[i * len(items) // count : (i + 1) * len(items) // count]


def heading(spec: Spec, run: Run, guarantee: Guarantee | None) -> str:
    """Name of the spec; how the run ended; what it achieved and what is proved."""
    facts = [{"done": "", "escape": "ESCAPE", "stall": "STALLED"}[run.status]]
    if facts[0]:
        facts[0] += f" at t = {run.time:.4g} s"
    for key, text in (("z_norm2", r"$\|z\|_2$"), ("v_norm2", r"$\|v\|_2$")):
        if run.summary[key] is not None:
            facts.append(f"{text} = {run.summary[key]:.4g}")
    if guarantee is None:
        facts.append("no guarantee")
    else:
        facts.append(rf"proved: $\gamma$ = {guarantee.gamma:.4g}, $\alpha$ = {guarantee.alpha:.4g}")
    return "\n".join(part for part in (plain(spec.name), ",  ".join(f for f in facts if f)) if part)


def limits(curves: Sequence[Curve]) -> tuple[float, float, str]:
    """Limits of y, and a note of what they cut off.

    They hold the truth and 90 % of the samples of each estimate, so that an initial transient hides nothing.
    """
    true = np.concatenate([c.true for c in curves])
    estimates = [c.estimate for c in curves if c.estimate is not None]
    seen = [true, *(np.quantile(e, [0.05, 0.95]) for e in estimates)]
    low, high = min(float(s.min()) for s in seen), max(float(s.max()) for s in seen)
    room = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    low, high = low - room, high + room
    furthest = max((float(e[np.argmax(np.abs(e))]) for e in estimates), key=abs, default=0.0)
    return low, high, "" if low <= furthest <= high else f"estimate reaches {furthest:.3g}"


def linear_threshold(values: Sequence[Array]) -> float:
    """Power of ten below the smallest initial, median or final error, at most 14 decades below the peak."""
    sizes = [np.abs(v) for v in values]
    peak = max(float(size.max()) for size in sizes) or 1.0
    ends = [(size[0], np.median(size), size[-max(1, len(size) // 20) :].max()) for size in sizes]
    smallest = min((float(size) for three in ends for size in three if size > 0), default=peak)
    return float(10.0 ** np.floor(np.log10(max(smallest, peak * 10.0**-DECADES))))


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
    }
    return greek.get(key, plain(key))


def with_unit(spec: Spec, name: str) -> str:
    """Name and unit of a signal."""
    unit = spec.units.get(name)
    return plain(f"{name} [{unit}]" if unit else name)


def plain(text: str) -> str:
    """Text as it is, not as mathematics."""
    return text.replace("$", r"\$")


@contextmanager
def style() -> Iterator[None]:
    """Give every figure the same look, whatever the user's settings are."""
    from matplotlib import rc_context, rcdefaults, rcParams

    with rc_context():
        rcdefaults()
        rcParams.update(STYLE)
        yield


def new_figure(width: float, height: float) -> "Figure":
    """Empty figure, in inches, that belongs to no window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.06))
    FigureCanvasAgg(figure)
    return figure


def png(figure: "Figure") -> bytes:
    """PNG without anything that changes from run to run."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
