"""The figure of a run."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import chain
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.families.guarantee import ESTIMATES, LAST, Guarantee
from obsdesign.plot.axis import number, plain, with_unit
from obsdesign.plot.canvas import Panel, compose, drawn, legend_below, shared
from obsdesign.plot.panels import CURVES, SINGLE, Comparison, Curve, Level, comparisons, draw_errors, draw_storage
from obsdesign.spec import limited
from obsdesign.tables.text import at_least, at_most

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from obsdesign.simulate import Run

LINE = 118  # characters of the title


def run_sheet(run: "Run") -> "Figure":
    """Draw states and unknown inputs with their estimates, errors, and V(e) against its bound.

    Errors are drawn at the steps of the integrator, so that a peak between two samples is seen, and on a
    symmetric logarithmic axis; where they settle early, over the logarithm of time.
    """
    states = [Curve(name, run.xi[:, i], run.xihat[:, i]) for i, name in enumerate(run.states[: run.plant_states])]
    sections: tuple[list[Panel], ...] = (
        [panel.draw for panel in comparisons(run, states, "states (dashed: estimates)")],
        [*input_panels(run), *region_panels(run)],
        list(error_panels(run)),
    )
    figure = compose(heading(run), sections)
    legend_below(figure)
    return figure


run_figure = drawn(run_sheet)


def input_panels(run: "Run") -> Iterator[Panel]:
    """Panels of the unknown inputs, and beside a reconstruction its error."""
    column = {channel: i for i, channel in enumerate(run.estimated)}
    curves = [
        Curve(name, run.w[:, i], run.what[:, column[i]] if i in column else None)
        for i, name in enumerate(run.exogenous)
    ]
    yield from (panel.draw for panel in comparisons(run, curves, "unknown inputs (dashed: estimates)"))
    if "reconstruction" in run.summary:
        yield reconstruction_error(run, run.summary["reconstruction"])


def reconstruction_error(run: "Run", accuracy: Mapping[str, Any]) -> Panel:
    """Panel of |what - w|, with its proved limit if there is one, else with the one that the run shows."""
    limit, what = ("bound", "proved limit") if "bound" in accuracy else ("limsup", "at the end")
    level = Level(accuracy[limit], LAST * run.time, f"{what} {number(float(at_most(accuracy[limit], 3)))}")
    curves = [(f"peak {number(accuracy['peak'])}", np.linalg.norm(run.steps.w_error, axis=1))]
    return partial(draw_errors, run=run, curves=curves, label=r"$\|\hat{w} - w\|$", level=level)


def region_panels(run: "Run") -> Iterator[Panel]:
    """Panels of the arguments of f that have to stay in a region."""
    for i, k, column, region in list(limited(run.spec.nonlinearities))[:SINGLE]:
        name = run.spec.nonlinearities[i - 1].argument(k, f"q{k + 1} of nonlinearities[{i - 1}]")
        curve = Curve(name.partition(" of ")[0], run.q[:, column], run.qhat[:, column], region)
        yield Comparison(run.t, [curve], name, run.status == "escape").draw


def error_panels(run: "Run") -> Iterator[Panel]:
    """Errors of the states, errors of the modeled unknown inputs, and V(e)."""
    n = run.plant_states
    states = [(f"e_{with_unit(run.spec, name)}", run.steps.e[:, i]) for i, name in enumerate(run.states[:n])]
    for group in shared(states, CURVES):
        yield partial(draw_errors, run=run, curves=group, label="state errors")
    inputs = [
        (f"e_{with_unit(run.spec, run.exogenous[i])}", run.steps.w_error[:, k]) for k, i in enumerate(run.estimated)
    ]
    for group in shared([] if "reconstruction" in run.summary else inputs, CURVES):
        yield partial(draw_errors, run=run, curves=group, label="unknown-input errors")
    if run.steps.V is not None and run.steps.V_bound is not None:
        yield partial(draw_storage, run=run, V=run.steps.V, bound=run.steps.V_bound)


def heading(run: "Run") -> str:
    """Name of the spec; how the run ended, what it achieved and what is proved; whether it stayed in its region."""
    guarantee = run.guarantee
    facts = ended(run, f"{run.time:.5g}")
    sup = guarantee is not None and guarantee.norm == "sup"
    for signal in ("z", run.spec.observer.drive):
        key, text = (f"{signal}_sup", rf"$\sup|{signal}|$") if sup else (f"{signal}_norm2", rf"$\|{signal}\|_2$")
        if run.summary[key] is not None:
            facts.append(f"{text} = {run.summary[key]:.4g}")
    estimates = str(run.summary.get("bounds_omitted", "")).startswith(ESTIMATES)
    promises = ["no bound is proved" if estimates else "no guarantee"]
    if guarantee is not None:
        promises = [f"proved: {proved(run, guarantee)}", verdict(run, " until then" if run.left else "")]
    return titled(run, facts, promises)


def ended(run: "Run", time: str) -> list[str]:
    """How a run ended before its horizon, if it did."""
    how = {"done": "", "stopped": "STOPPED", "escape": "ESCAPE", "stall": "STALLED"}[run.status]
    why = f" ({str(run.summary['reason']).partition(': ')[2]})" if run.status == "stopped" else ": valid until then"
    return [f"{how} at t = {time} s{why}"] if how else []


def titled(run: "Run", *facts: Sequence[str]) -> str:
    """Name of the spec, lines of facts, the region of a local guarantee, and why a bound is left out."""
    note = run.summary.get("validity", {}).get("note", "")
    omitted = "" if run.guarantee is None or run.left else run.summary["bounds_omitted"] or ""
    remarks = [part for text in (note, omitted) for part in text.split("; ")]
    name, *rest = (wrap(plain(text), LINE) for text in (run.spec.name, *remarks))
    return "\n".join([*name, *(",  ".join(line) for line in facts), *chain(*rest)])


def proved(run: "Run", guarantee: Guarantee) -> str:
    """What is proved: a gain, where there is an input, and a rate of decay."""
    alpha = guarantee.rates().alpha
    decays = f"{guarantee.symbol} = {at_least(alpha, 4)}" if alpha else r"$e \rightarrow 0$"
    if run.summary["gamma"] is None:
        return decays
    begins = offset(run.summary["initial_error"])
    return rf"$\gamma$ = {at_most(guarantee.gamma, 4)} from zero error{begins}, {decays}"


def offset(error: float) -> str:
    """What to say of a gain from zero error where a run begins with an error: the norms above are another ratio."""
    return " (this run begins with an error)" if error else ""


def verdict(run: "Run", until: str) -> str:
    """Whether the run keeps what is proved, and until when."""
    checks = run.summary["bounds"]
    broken = sum(not check["holds"] for check in checks)
    if broken:
        return f"{broken} of {len(checks)} bounds VIOLATED"
    return f"all {len(checks)} bounds hold{until}" if checks else "no bound applies"
