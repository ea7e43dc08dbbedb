"""The figure of a comparison: signals with every estimate, errors on one axis, and what is proved side by side."""

from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from obsdesign.families.guarantee import HELD
from obsdesign.families.samples import gamma_of_v
from obsdesign.lmi.formula import Array, printed
from obsdesign.plot.axis import DECADES, finite, plain, stairs, time_axis, with_unit
from obsdesign.plot.canvas import COLORS, Panel, compose, drawn, legend_below, log_ticks
from obsdesign.plot.panels import BESIDE, limit
from obsdesign.plot.signals import Curve
from obsdesign.records import dataclass
from obsdesign.tables.text import at_least, at_most

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from obsdesign.simulate.comparison import Comparison, Entrant

PALETTE = (*COLORS[:-1], "#8C564B", "#7F7F7F", "#ADA200")  # the truth is black
TITLE = 70  # letters of the name
LINES = ((0, (5, 1.5)), (0, (1, 1)), (0, (4, 1, 1, 1)), (0, (8, 2)), (0, (2, 2)))  # of estimates that coincide
MOST = 6  # signals that are drawn
CELLS = 400  # of time, in each of which the largest error is drawn
DIP = 21  # cells: an error that falls and comes back within so many is drawn as if it had not fallen
WIDEST = 2.2
FAST = 0.02  # of the horizon: where an error settles sooner, time is drawn on a logarithmic axis
BEFORE = 0.2  # of the first settling time, from which on a logarithmic axis is drawn
ROW, SWATCH, GAP = 0.24, 6, 3  # of the table: height (inches), letters of a line, letters between columns
FONT, FITS, LABEL = 8.0, 150, 60  # of the table: size of its letters, how many of it fit in a line, most of a name
REMARK = 320  # of a remark, in two lines
MARK = 100  # letters of what a mark means
TIMES = 4  # estimates of which the table has the settling time
HEADER = ("observer", "type", "proved", "γ", "decay rate [1/s]", "order", "fastest [1/s]")
OTHERS = "The γ are of different kinds (type, z or v of the spec): the smaller one need not be the better."
FAINT = "#555555"
NOTE = (
    "γ, decay rate: proved, in the sense of its type. 5 %: when |e| without noise stays below 5 % of |e(0)|. "
    "Errors are drawn without dips that are narrower than a twentieth of the panel."
)


@dataclass(frozen=True)
class Look:
    """How an observer is drawn."""

    color: str
    line: tuple[int, tuple[float, ...]]
    width: float  # of its errors: the first are the widest, to be seen below the others


def looks(comparison: "Comparison") -> list[Look]:
    """One for each observer."""
    return looks_of(len(comparison.entrants))


def looks_of(count: int) -> list[Look]:
    """Looks of so many observers."""
    return [Look(PALETTE[k % len(PALETTE)], LINES[k % len(LINES)], max(WIDEST - 0.5 * k, 0.9)) for k in range(count)]


@dataclass(frozen=True)
class Signal:
    """A state or an unknown input of the plant, with the estimates of those observers that have one."""

    name: str
    label: str
    t: Array
    true: Array
    estimates: "Mapping[int, tuple[Array, Array]]"  # times and values, by the number of the observer


def comparison_sheet(comparison: "Comparison") -> "Figure":
    """Draw every signal with its estimates, the errors of all observers on one axis, and a table of what is proved.

    The estimates are those without noise, the errors those with noise, if there is any. Of many signals those are drawn
    that the first spec asks for.
    """
    first = comparison.entrants[0]
    every = signals(comparison)
    asked = [one for one in every if one.name in first.design.spec.H_names] or every
    shown = every if len(every) <= MOST else asked[:MOST]
    count = len(comparison.entrants)
    noise = "estimates without noise, errors with it" if first.spread else "without noise"
    some = "" if len(shown) == len(every) else f", {len(shown)} of {len(every)} signals"
    figure = compose(
        f"{plain(comparison.title, TITLE)}: {count} observer{'s' if count > 1 else ''}, {noise}{some}",
        [
            [signal_panel(comparison, one) for one in shown],
            [error_panel(comparison, one) for one in shown if one.estimates],
        ],
        foot=(
            table_panel(comparison, [one.name for one in shown if one.estimates]),
            ROW * (count + 2.5 + room(remarks(comparison))),
        ),
    )
    mark_left(figure, comparison)
    legend_below(figure)
    return figure


comparison_figure = drawn(comparison_sheet)


def mark_left(figure: "Figure", comparison: "Comparison") -> None:
    """Mark in all panels of signals when a run without noise left the region in which its guarantee holds."""
    for look, one in zip(looks(comparison), comparison.entrants, strict=True):
        for leaving in one.run.left[:1]:
            said = plain(f"{plain(one.label, LABEL)} leaves its region at t = {leaving.time:.4g} s", MARK)
            for axes in figure.axes[:-1]:
                axes.axvline(leaving.time, color=look.color, linestyle=":", linewidth=1.2, label=said)


def signals(comparison: "Comparison") -> list[Signal]:
    """States and unknown inputs of the plant; no input that is always zero and that nobody estimates."""
    found: dict[str, Signal] = {}
    for k, one in enumerate(comparison.entrants):
        run, known, spec = one.run, one.record.signals, one.design.spec
        truths = dict(zip(run.states[: run.plant_states], known.xi.T, strict=False))
        truths |= dict(zip(run.exogenous, known.w.T, strict=True))
        hats = dict(zip(run.states[: run.plant_states], known.xihat.T, strict=False))
        hats |= {run.exogenous[i]: column for i, column in zip(run.estimated, known.what.T, strict=True)}
        for name, true in truths.items():
            signal = found.setdefault(name, Signal(name, with_unit(spec, name), known.t, finite(true), {}))
            estimates = {**signal.estimates, **({k: (known.t, finite(hats[name]))} if name in hats else {})}
            found[name] = Signal(name, signal.label, signal.t, signal.true, estimates)
    return [signal for signal in found.values() if signal.estimates or signal.true.any()]


def signal_panel(comparison: "Comparison", signal: Signal) -> Panel:
    """Panel of a signal and its estimates."""

    def draw(axes: "Axes") -> None:
        axes.plot(signal.t, signal.true, color="black", linewidth=1.8 if signal.estimates else 0.9, label="true")
        for k, (t, estimate) in signal.estimates.items():
            look = looks(comparison)[k]
            axes.plot(t, estimate, color=look.color, linestyle=look.line)
        if comparison.entrants[0].design.spec.period is not None:
            stairs(axes)
        curves = [Curve(signal.name, signal.true, estimate) for _, estimate in signal.estimates.values()]
        axes.set_title(limit(axes, curves or [Curve(signal.name, signal.true)]), loc="left", fontsize=8)
        limit_time(axes, comparison)
        name_axis(axes, signal.label)

    return draw


def error_panel(comparison: "Comparison", signal: Signal) -> Panel:
    """Panel of the errors of an estimate, on a logarithmic axis."""

    def draw(axes: "Axes") -> None:
        top = 0.0
        for look, one in zip(looks(comparison), comparison.entrants, strict=True):
            t, size = peaks(*one.errors.get(signal.name, (np.zeros(0), np.zeros(0))), settle_early(comparison))
            seen = size > 0
            axes.plot(t[seen], size[seen], color=look.color, linestyle=look.line, linewidth=look.width)
            top = max(top, float(size.max(initial=0.0)))
        if top > 0:
            axes.set_yscale("log")
            axes.set_ylim(max(axes.get_ylim()[0], top * 10.0**-DECADES), 2 * top)
            log_ticks(axes)
        limit_time(axes, comparison)
        name_axis(axes, f"|e| of {signal.label}")

    return draw


def name_axis(axes: "Axes", label: str) -> None:
    """Name what a panel shows beside it, or above it where the name is longer than the panel is high."""
    if len(label) <= BESIDE:
        axes.set_ylabel(label)
    else:
        axes.set_title(label, loc="right", fontsize=8)


def peaks(t: Array, error: Array, early: bool) -> tuple[Array, Array]:
    """Largest |e| in cells of time, without dips of less than `DIP` cells, so that an oscillation is a line.

    A fall that is for good is kept where it is: dips are filled by a closing, which moves no other edge.
    `early`: cells of a logarithmic axis of time.
    """
    from scipy.ndimage import grey_closing

    size = np.abs(np.nan_to_num(finite(error)))
    if len(t) < 2:
        return t, size
    edges = np.linspace(t[0], t[-1], CELLS + 1)
    if early:
        edges = np.geomspace(t[t > 0][0], t[-1], CELLS + 1)
    every = np.concatenate([t, edges])
    order = np.argsort(every, kind="stable")
    values = np.concatenate([size, np.interp(edges, t, size)])[order]
    begin = np.searchsorted(every[order], edges[:-1])
    closed = grey_closing(np.pad(np.maximum.reduceat(values, begin), DIP), size=(DIP,))
    return (edges[:-1] + edges[1:]) / 2, closed[DIP:-DIP]


def table_panel(comparison: "Comparison", names: list[str]) -> Panel:
    """Panel of one line an observer: how it is drawn, what is proved, and when it has settled."""
    timed = names if len(names) <= TIMES else []
    columns = [column for column in zip(HEADER, *map(told, comparison.entrants), strict=True) if any(column[1:])]
    columns += [(f"5 % of {plain(n, 22)} [s]", *(settled_text(one, n) for one in comparison.entrants)) for n in timed]
    return told_panel(columns, remarks(comparison))


def told_panel(columns: "Sequence[tuple[str, ...]]", lines: "Sequence[str]") -> Panel:
    """Panel of columns, each a head and a cell an observer, beside how these are drawn; remarks below."""
    widths = [max(map(len, column)) + GAP for column in columns]
    total = SWATCH + sum(widths)
    at = (SWATCH + np.concatenate([[0], np.cumsum(widths)[:-1]])) / total
    font, count, below = min(FONT, FONT * FITS / total), len(columns[0]) - 1, room(lines)

    def draw(axes: "Axes") -> None:
        axes.set_axis_off()
        axes.set(xlim=(0, 1), ylim=(-below, count + 2.5))
        for x, (name, *cells) in zip(at, columns, strict=True):
            axes.text(x, count + 1.75, name, va="center", fontsize=font, color=FAINT)
            for i, cell in enumerate(cells):
                axes.text(x, count + 0.75 - i, cell or "–", va="center", fontsize=font)
        for i, look in enumerate(looks_of(count)):
            axes.plot([0, 0.8 * at[0]], [count + 0.75 - i] * 2, color=look.color, linestyle=look.line, linewidth=WIDEST)
        axes.text(0, 0.4 - below / 2, "\n".join(lines), va="center", fontsize=7, color=FAINT)

    return draw


def remarks(comparison: "Comparison") -> list[str]:
    """Lines below the table."""
    notes = [line for note in comparison.notes for line in wrap(plain(note, REMARK), REMARK // 2)]
    return [NOTE, *([OTHERS] if differ(comparison) else []), *notes]


def room(lines: "Sequence[str]") -> float:
    """Rows of the table that its remarks take beyond those of two lines."""
    return 0.5 * max(len(lines) - 2, 0)


def differ(comparison: "Comparison") -> bool:
    """Whether the gains that are proved are of different kinds: another type, another error z or another input v."""
    specs = [one.design.spec for one in comparison.entrants if one.design.guarantee is not None]
    kinds = {(s.observer.type, s.observer.drive, str(s.H.tolist()), str(s.generator.Am.tolist())) for s in specs}
    return len(kinds) > 1


def told(one: "Entrant") -> list[str]:
    """Cells of an observer under `HEADER`; one without a number is empty."""
    spec, guarantee = one.design.spec, one.design.guarantee
    gamma = decay = ""
    proved = "no guarantee"
    if one.design.proved:
        limits = {"no bound": guarantee is None, "local": spec.validity, "types assumed": spec.assumed}
        proved = ", ".join(["yes", *(word for word, holds in limits.items() if holds)])
        proved += f" until t = {one.run.left[0].time:.4g}" if one.run.left else ""
    if guarantee is not None:
        gamma = at_most(gamma_of_v(spec, printed(guarantee.gamma), guarantee.norm), 4) if spec.disturbed else ""
        decay = at_least(guarantee.rates().alpha, 4)
    fastest = f"{one.fastest:.4g}" if np.isfinite(one.fastest) else ""
    order = str(len(one.record.system.observer.states))
    return [plain(one.label, LABEL), spec.observer.type, proved, gamma, decay, order, fastest]


def settled_text(one: "Entrant", name: str) -> str:
    """When an error stays below 5 % of its first value."""
    times = one.run.summary["settling"].get(name)
    if times is None or times["t5"] is None:
        return "" if times is None else "never"
    time = times["t5"]
    return "from 0" if time == 0 else f"{time:.3g}" if time <= HELD * one.run.time else "not held"


def settled(comparison: "Comparison", share: str) -> list[float]:
    """Times at which errors that there were at first have settled, in order."""
    times = [state[share] for one in comparison.entrants for state in one.run.summary["settling"].values()]
    return sorted(t for t in times if t)


def settle_early(comparison: "Comparison") -> bool:
    """Whether an error settles so soon that time is better drawn on a logarithmic axis."""
    return any(t < FAST * comparison.entrants[0].run.time for t in settled(comparison, "t1"))


def limit_time(axes: "Axes", comparison: "Comparison") -> None:
    """Label and limit the axis of time; on a logarithmic one at most six decades, before the first has settled."""
    t, end = comparison.entrants[0].run.t, comparison.entrants[0].run.time
    time_axis(axes, end)
    if settle_early(comparison):
        first = min([t[1], *(BEFORE * time for time in settled(comparison, "t5"))])
        axes.set_xscale("log")
        axes.set_xlim(max(float(first), 1e-6 * end), end)
        log_ticks(axes, "x")
