"""The figure of a run: at most four panels that tell what the spec wants to know, or every panel."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.families.guarantee import ESTIMATES, STEPS, Guarantee
from obsdesign.families.samples import gamma_of_v
from obsdesign.lmi.formula import printed
from obsdesign.plot import signals
from obsdesign.plot.axis import plain, stairs
from obsdesign.plot.canvas import Panel, compose, drawn, legend_below, shared
from obsdesign.plot.hybrid import draw_distance, draw_injection, draw_intervals
from obsdesign.plot.panels import CURVES, Signals, draw_errors, draw_storage
from obsdesign.plot.signals import Curve, Estimate
from obsdesign.tables.text import at_most

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from obsdesign.simulate import Run

LINE = 126  # characters of the title
REASON = 110  # and of what a mark in the panels means
SINGLE = 8  # so many signals get a panel each; more share panels
TALL, LOW = 3.0, 2.35  # inches of a row, where there are two, and where there are more
SHADE = "#F3D9D2"
ENDED = "#B00000"
IDEAL = "proved: how it estimates without disturbance and noise; no bound on the error of a run"
HOW = {"stopped": "STOPPED", "escape": "ESCAPE", "stall": "STALLED"}


def run_sheet(run: "Run", every: bool = False) -> "Figure":
    """Draw what the spec wants to know: estimates beside the truth, their errors, what is measured, and the inputs.

    Of many estimates those are drawn that settle last. Errors are drawn at the steps of the integrator, so that a peak
    between two samples is seen. `every`: also all other estimates, outputs and inputs, arguments of f with their
    regions, V, and what measurements at instants do. Signals in discrete time are drawn as stairs, of as many samples
    as the spec says.
    """
    run = thinned(run)
    wanted = signals.wanted(run)
    last = sorted(wanted, key=lambda each: each.unsettled, reverse=True)[:CURVES]
    shown = [each for each in wanted if each in last]
    measured, driven = signals.outputs(run), signals.driving(run, shown)
    first = [Signals(run, [each.curve for each in shown], named("estimates", shown, wanted)).draw, errors(run, shown)]
    second = [
        Signals(run, some, named(what, some, part)).draw
        for part, what in ((measured, "outputs"), (driven, "inputs"))
        if (some := part[:CURVES])
    ]
    rest = further(run, shown, [*measured[CURVES:], *driven[CURVES:]]) if every else []
    figure = compose(heading(run), [first, second, *rest], LOW if every else TALL)
    for axes in figure.axes if run.spec.period is not None else ():
        stairs(axes)
    mark_end(figure, run)
    legend_below(figure)
    return figure


run_figure = drawn(run_sheet)


def thinned(run: "Run") -> "Run":
    """Run in discrete time with signals at `simulation.points` of its samples, if it has more; its errors at all."""
    most = run.spec.simulation.points if run.spec.simulation else len(run.t)
    if run.spec.period is None or len(run.t) <= most:
        return run
    return replace(run, **vars(run.rows(np.arange(0, len(run.t), -(-len(run.t) // most)))))


def named(what: str, shown: Sequence[Any], every: Sequence[Any]) -> str:
    """Label of a panel of several signals, which says how many there are where it shows some."""
    return what if len(shown) == len(every) else f"{len(shown)} of {len(every)} {what}"


def errors(run: "Run", estimates: Sequence[Estimate]) -> Panel:
    """Panel of the errors of some estimates."""
    return partial(draw_errors, run=run, estimates=estimates)


def further(run: "Run", shown: Sequence[Estimate], more: Sequence[Curve]) -> Iterator[list[Panel]]:
    """Sections of the panels that are no answer to what the spec wants to know."""
    others = signals.others(run, shown)
    yield [panel.draw for panel in panels(run, [each.curve for each in others], "estimates")]
    yield [errors(run, group) for group in shared(others, CURVES)]
    yield [panel.draw for panel in panels(run, [*more, *signals.arguments(run)], "signals")]
    last: list[Panel] = []
    if run.steps.V is not None:
        last.append(partial(draw_storage, run=run))
    if run.schedule is not None:
        last += [partial(draw_injection, run=run, which=some) for some in shared(range(run.theta.shape[1]), CURVES)]
        last += [partial(draw_distance, run=run), partial(draw_intervals, schedule=run.schedule)]
    yield last


def panels(run: "Run", curves: Sequence[Curve], what: str) -> Iterator[Signals]:
    """One panel a signal, or one for several where there are many."""
    most = 1 if len(curves) <= SINGLE else CURVES
    yield from (Signals(run, group, what) for group in shared(curves, most))


def mark_end(figure: "Figure", run: "Run") -> None:
    """Mark in all panels where a run ended before its horizon, and from where on nothing of it is guaranteed."""
    begin, why = void(run)
    for axes in figure.axes:
        if begin < run.time:
            axes.axvspan(begin, run.time, color=SHADE, linewidth=0, zorder=0, label=why)
        if run.status != "done":
            axes.axvline(run.time, color=ENDED, linewidth=1.5, label=plain(ended(run), REASON), clip_on=False)


def void(run: "Run") -> tuple[float, str]:
    """From when on the guarantee says nothing, or the declared types do not hold; infinite: never. And why."""
    if run.left and (run.guarantee is None or run.left[0].time <= run.until):
        what = "region of the declared types" if run.guarantee is None else "local guarantee"
        return run.left[0].time, plain(f"{what} left: {run.left[0]}", REASON)
    if run.guarantee is None or not np.isfinite(run.until):
        return np.inf, ""
    why = run.schedule.why if run.schedule else "a measurement is overdue"
    return run.until, f"nothing is guaranteed: {why} at t = {run.until:.4g}"


def heading(run: "Run") -> str:
    """Name of the spec, and below it how the run ended, what is proved, and whether the run keeps it."""
    said = [ended(run), *promises(run)]
    told = wrap(plain("; ".join(filter(None, said)), 9 * LINE), LINE, max_lines=2, placeholder=" …")
    return "\n".join([plain(run.spec.name, LINE), *told])


def promises(run: "Run") -> Iterator[str]:
    """What is proved, whether the run keeps it, and why a bound is left out."""
    omitted = str(run.summary["bounds_omitted"] or "")
    if run.guarantee is None:
        steps = omitted if omitted.startswith(STEPS) else "no guarantee"
        yield IDEAL if omitted.startswith(ESTIMATES) else steps
        return
    checks = run.summary["bounds"]
    broken = sum(not check["holds"] for check in checks)
    if broken:
        yield f"{broken} of {len(checks)} bounds VIOLATED"
    yield f"proved: {proved(run, run.guarantee)}"
    if not checks:
        said = f"no bound: {omitted}".replace(": every bound from then on", " from then on")
        yield said if omitted else "no bound applies"
        return
    if not broken:
        until = f" until t = {void(run)[0]:.4g}" if void(run)[0] < run.time else ""
        yield f"all {len(checks)} bounds hold{until}"
    if not run.left and not np.isfinite(run.until):
        yield omitted


def proved(run: "Run", guarantee: Guarantee) -> str:
    """What is proved: a gain, where there is an input, and a rate of decay."""
    rate = guarantee.rates().told
    decays = f"{guarantee.symbol} = {rate}" if rate else f"{guarantee.resting} → 0 without a disturbance"
    decays += ", of a model in samples" if run.spec.continuous else ""
    if run.summary["gamma"] is None:
        return decays
    name = "γ of v itself" if run.spec.observer.filtered else "γ"
    gamma = gamma_of_v(run.spec, printed(guarantee.gamma), guarantee.norm)
    return f"{name} = {at_most(gamma)} from zero error, {decays}"


def ended(run: "Run") -> str:
    """How a run ended before its horizon, if it did."""
    if run.status == "done":
        return ""
    event = str(run.summary["reason"]).partition(": ")[2]
    why = f" ({event})" if run.status == "stopped" else ": computed until then"
    return f"{HOW[run.status]} at t = {run.time:.5g} s{why}"
