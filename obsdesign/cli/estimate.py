"""`obsdesign estimate`: an observer on recorded data."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from obsdesign.cli.printing import say
from obsdesign.cli.program import AsJson, Quiet, Timeout
from obsdesign.cli.steps import as_text, interruptible, progress, stem
from obsdesign.disk import require_ending, require_two, require_writable, write_whole
from obsdesign.errors import UsageError
from obsdesign.watch import limited


def estimate(
    source: Annotated[str, typer.Argument(metavar="GAINS.json|SPEC", help="Result file; a spec is solved first.")],
    data: Annotated[str, typer.Argument(metavar="DATA.csv", help="Log: a column of time, and of each signal.")],
    output: Annotated[str, typer.Option("-o", "--output", help="Estimates (CSV); - is standard output.")] = "",
    plot: Annotated[str, typer.Option("--plot", help="Figure (PNG, or SVG by its ending).")] = "",
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
    from obsdesign.sections.words import unknown

    if hold and hold not in ("zero", "first"):
        raise UsageError(f"--hold: {unknown('hold', hold, ('zero', 'first'), {})}", id="OBS904")
    chosen = dict(map(pair, columns))
    name = stem(source)
    paths = output or f"{name}.estimate.csv", plot or figure_of(output or f"{name}.estimate.csv")
    require_ending(paths[0], "estimates")
    require_ending(paths[1], "figures")
    require_two(*paths, "estimates and figure")
    kinds = {paths[0]: "estimates", **({paths[1]: "figures"} if paths[1] else {})}
    kept = require_writable(kinds, read=[source, data])
    with limited(timeout), interruptible(lambda: "no estimates and no figure are written"):
        from obsdesign.data.estimation import Estimation, written
        from obsdesign.data.log import Log
        from obsdesign.disk import whole
        from obsdesign.work import trial

        with progress(quiet) as report:
            design = trial(source, "", "clarabel", report)
            with design.spec.placed():
                log = Log.of(data, design.spec, chosen, "first" if hold == "first" else "zero" if hold else None,
                             repair=repair)  # fmt: skip
                made = Estimation(design, log)
                heard = lambda share: report(share, "estimates")  # noqa: E731
                if paths[0] == "-":
                    found = written(made, sys.stdout.buffer, heard)
                else:
                    with whole(paths[0]) as file:
                        found = written(made, file, heard)
        if paths[1]:
            from obsdesign.plot import form_of
            from obsdesign.plot.estimates import estimates_figure

            write_whole(paths[1], estimates_figure(found.name, found.header, found.rows, found.report,
                                                   form=form_of(paths[1])))  # fmt: skip
    if paths[0] == "-":
        return
    if as_json:
        say(as_text(found.report))
    elif not quiet:
        from obsdesign.tables.estimates import estimates_table

        say(estimates_table(found.report, kept[paths[0]], kept[paths[1]]))


def pair(text: str) -> tuple[str, str]:
    """A signal and its column, of an option."""
    signal, equal, column = text.partition("=")
    if not (signal and equal and column):
        raise UsageError(f"--map {text}: write SIGNAL=COLUMN, such as y1=Current", id="OBS904")
    return signal.strip(), column.strip()


def figure_of(output: str) -> str:
    """Figure beside the estimates; none beside those on standard output."""
    return "" if output == "-" else str(Path(output).with_suffix(".png"))
