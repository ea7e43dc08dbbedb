"""The figure of a run."""

from collections.abc import Iterator, Mapping
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.families.guarantee import LAST, Guarantee
from obsdesign.plot.axis import number, plain, with_unit
from obsdesign.plot.canvas import drawn
from obsdesign.plot.layout import Panel, compose, legend_below, shared
from obsdesign.plot.panels import CURVES, SINGLE, Comparison, Curve, Errors, Level, Storage, comparisons
from obsdesign.spec import limited

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from obsdesign.simulate import Run

LINE = 118  # characters of the title
FAST = 0.1  # of the run: an error that settles sooner is drawn over the logarithm of time


def run_sheet(run: "Run") -> "Figure":
    """Draw states and unknown inputs with their estimates, errors, and V(e) against its bound.

    Errors are drawn at the steps of the integrator, so that a peak between two samples is seen, and on a
    symmetric logarithmic axis; where they settle early, over the logarithm of time.
    """
    log_time = settles_early(run)
    sections = (
        state_panels(run),
        [*input_panels(run, log_time), *region_panels(run)],
        error_panels(run, log_time),
    )
    figure = compose(heading(run), [list(section) for section in sections])
    legend_below(figure)
    return figure


run_figure = drawn(run_sheet)


def settles_early(run: "Run") -> bool:
    """Whether the error settles so soon that time is better drawn on a logarithmic axis."""
    settled = run.summary["settling_time"]
    return settled is not None and settled < FAST * run.time


def state_panels(run: "Run") -> Iterator[Panel]:
    """Panels of the plant's states."""
    n = run.plant_states
    curves = [Curve(name, run.xi[:, i], run.xihat[:, i]) for i, name in enumerate(run.states[:n])]
    return comparisons(run.spec, run.t, curves, "states (dashed: estimates)", escapes(run))


def input_panels(run: "Run", log_time: bool) -> Iterator[Panel]:
    """Panels of the unknown inputs, and beside a reconstruction its error."""
    column = {channel: i for i, channel in enumerate(run.estimated)}
    curves = [
        Curve(name, run.w[:, i], run.what[:, column[i]] if i in column else None)
        for i, name in enumerate(run.exogenous)
    ]
    yield from comparisons(run.spec, run.t, curves, "unknown inputs (dashed: estimates)", escapes(run))
    if "reconstruction" in run.summary:
        yield reconstruction_error(run, run.summary["reconstruction"], log_time)


def reconstruction_error(run: "Run", accuracy: Mapping[str, Any], log_time: bool) -> Errors:
    """Panel of |what - w|, with its proved limit if there is one, else with the one that the run shows."""
    size = np.linalg.norm(run.steps.w_error, axis=1)
    late = LAST * run.time
    if "bound" in accuracy:
        level = Level(accuracy["bound"], late, f"proved limit {number(accuracy['bound'])}")
    else:
        level = Level(accuracy["limsup"], late, f"at the end {number(accuracy['limsup'])}")
    return Errors(run.steps.t, [(f"peak {number(accuracy['peak'])}", size)], r"$\|\hat{w} - w\|$", log_time, level)


def region_panels(run: "Run") -> Iterator[Panel]:
    """Panels of the arguments of f that have to stay in a region."""
    for i, k, column, region in list(limited(run.spec.nonlinearities))[:SINGLE]:
        curve = Curve(f"q{k + 1}", run.q[:, column], run.qhat[:, column], region)
        yield Comparison(run.t, [curve], f"q{k + 1} of nonlinearity {i}", escapes(run))


def escapes(run: "Run") -> bool:
    """Whether the run ended because a signal became too large."""
    return run.status == "escape"


def error_panels(run: "Run", log_time: bool) -> Iterator[Panel]:
    """Errors of the states, errors of the modeled unknown inputs, and V(e)."""
    n = run.plant_states
    states = [(f"e_{with_unit(run.spec, name)}", run.steps.e[:, i]) for i, name in enumerate(run.states[:n])]
    for group in shared(states, CURVES):
        yield Errors(run.steps.t, group, "state errors", log_time)
    inputs = [
        (f"e_{with_unit(run.spec, run.exogenous[i])}", run.steps.w_error[:, k]) for k, i in enumerate(run.estimated)
    ]
    for group in shared([] if "reconstruction" in run.summary else inputs, CURVES):
        yield Errors(run.steps.t, group, "unknown-input errors", log_time)
    if run.steps.V is not None and run.steps.V_bound is not None:
        until = run.left[0].time if run.left else np.inf
        yield Storage(run.steps.t, run.steps.V, run.steps.V_bound, log_time, until)


def heading(run: "Run") -> str:
    """Name of the spec; how the run ended, what it achieved and what is proved; whether it stayed in its region."""
    guarantee = run.guarantee
    facts = [{"done": "", "escape": "ESCAPE", "stall": "STALLED"}[run.status]]
    if facts[0]:
        facts[0] += f" at t = {run.time:.5g} s"
    sup = guarantee is not None and guarantee.norm == "sup"
    for signal in ("z", run.spec.observer.drive):
        key, text = (f"{signal}_sup", rf"$\sup|{signal}|$") if sup else (f"{signal}_norm2", rf"$\|{signal}\|_2$")
        if run.summary[key] is not None:
            facts.append(f"{text} = {run.summary[key]:.4g}")
    if guarantee is None:
        facts.append("no guarantee")
    else:
        facts += [f"proved: {proved(run, guarantee)}", verdict(run, " until then" if run.left else "")]
    lines = [*wrap(plain(run.spec.name), LINE), ",  ".join(f for f in facts if f)]
    if run.left:
        lines += [line for part in run.summary["validity"]["note"].split("; ") for line in wrap(plain(part), LINE)]
    return "\n".join(line for line in lines if line)


def proved(run: "Run", guarantee: Guarantee) -> str:
    """What is proved: a gain, where there is an input, and a rate of decay."""
    alpha = guarantee.rates().alpha
    decays = f"{guarantee.symbol} = {alpha:.4g}" if alpha else r"$e \rightarrow 0$"
    return decays if run.summary["gamma"] is None else rf"$\gamma$ = {guarantee.gamma:.4g}, {decays}"


def verdict(run: "Run", until: str) -> str:
    """Whether the run keeps what is proved, and until when."""
    checks = run.summary["bounds"]
    broken = sum(not check["holds"] for check in checks)
    if broken:
        return f"{broken} of {len(checks)} bounds VIOLATED"
    return f"all {len(checks)} bounds hold{until}" if checks else "no bound applies"
