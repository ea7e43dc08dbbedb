"""`obsdesign estimate`: an observer on recorded data."""

import os
import sys
from typing import TYPE_CHECKING, Annotated

import typer

from obsdesign.cli.printing import say
from obsdesign.cli.program import AsJson, Changes, Quiet, Timeout
from obsdesign.cli.steps import as_text, interruptible, progress, stem
from obsdesign.disk import require_ending, require_two, require_writable
from obsdesign.errors import UsageError
from obsdesign.watch import limited

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Literal

    from obsdesign.data.estimation import Estimates, Estimation


def estimate(
    source: Annotated[str, typer.Argument(metavar="GAINS.json|SPEC", help="Result file; a spec is solved first.")],
    data: Annotated[str, typer.Argument(metavar="DATA.csv", help="Log: a column of time, and of each signal.")],
    output: Annotated[str, typer.Option("-o", "--output", help="Estimates (CSV); - is standard output.")] = "",
    plot: Annotated[str, typer.Option("--plot", help="Figure (PNG, or SVG by its ending).")] = "",
    changes: Changes = [],  # noqa: B006
    columns: Annotated[
        list[str], typer.Option("--map", metavar="y1=COLUMN", help="Column of an output, input, of t or of arrival.")
    ] = [],  # noqa: B006
    hold: Annotated[str, typer.Option(metavar="zero|first", help="u and y between two rows.")] = "",
    repair: Annotated[
        bool, typer.Option("--repair", help="Sort rows; leave out those without a time of their own.")
    ] = False,
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Run an observer on a log of measurements; write estimates, innovations and a figure."""
    named(hold)
    chosen = dict(map(pair, columns))
    name = stem(source)
    paths = output or f"{name}.estimate.csv", plot or figure_of(output or f"{name}.estimate.csv")
    require_ending(paths[0], "estimates")
    require_ending(paths[1], "figures")
    require_two(*paths, "estimates and figure")
    kinds = {paths[0]: "estimates", **({paths[1]: "figures"} if paths[1] else {})}
    kept = require_writable(kinds, read=[source, data])
    with limited(timeout), interruptible(lambda: "no estimates and no figure are written"):
        from obsdesign.data.estimation import Estimation
        from obsdesign.data.log import Log
        from obsdesign.work import trial

        with progress(quiet) as report:
            design = trial(source, "", "clarabel", report, changes)
            with design.spec.placed():
                made = Estimation(design, Log.of(data, design.spec, chosen, named(hold), repair=repair))
                found = kept_in(paths[0], made, lambda share: report(share, "estimates"))
        if paths[1]:
            found.plot(paths[1])
    for one in found.report.get("outlying", ()):
        say(f"{data}: {one['note']}", err=True)
    if paths[0] == "-":
        return
    if as_json:
        say(as_text(found.report))
    elif not quiet:
        from obsdesign.tables.estimates import estimates_table

        say(estimates_table(found.report, kept[paths[0]], kept[paths[1]]))


def kept_in(path: str, made: "Estimation", heard: "Callable[[float], None]") -> "Estimates":
    """Estimates, written to a path or to standard output as they are made."""
    from obsdesign.data.estimation import written
    from obsdesign.disk import whole

    if path == "-":
        return written(made, sys.stdout.buffer, heard)
    with whole(path) as file:
        return written(made, file, heard)


def named(hold: str) -> "Literal['zero', 'first'] | None":
    """How u and y are held, of an option; None: as the spec says. Raises `UsageError`."""
    if hold in ("zero", "first"):
        return "zero" if hold == "zero" else "first"
    if hold:
        raise UsageError(f"--hold: {hold!r} is not known; allowed: zero, first", id="OBS904")
    return None


def pair(text: str) -> tuple[str, str]:
    """A signal and its column, of an option."""
    signal, equal, column = text.partition("=")
    if not (signal and equal and column):
        raise UsageError(f"--map {text}: write SIGNAL=COLUMN, such as y1=Current", id="OBS904")
    return signal.strip(), column.strip()


def figure_of(output: str) -> str:
    """Figure beside the estimates; none beside those on standard output."""
    return "" if output == "-" else f"{os.path.splitext(output)[0]}.png"
