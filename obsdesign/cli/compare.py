"""`obsdesign compare`: several observers on one plant, or on one log of it."""

from typing import TYPE_CHECKING, Annotated

import typer

from obsdesign.cli.estimate import named, pair
from obsdesign.cli.printing import say
from obsdesign.cli.program import AsJson, Quiet, Solver, Timeout
from obsdesign.cli.steps import as_text, progress, taken
from obsdesign.disk import require_ending
from obsdesign.errors import UsageError
from obsdesign.watch import limited

if TYPE_CHECKING:
    from obsdesign.data.comparison import LogComparison
    from obsdesign.simulate.comparison import Comparison

SEEDS = 10


def compare(
    sources: Annotated[list[str], typer.Argument(metavar="SPEC|GAINS.json..", help="Specs and gains files.")],
    seeds: Annotated[
        int | None, typer.Option(min=1, max=1000, help=f"Runs with noise of each observer, {SEEDS} if not given.")
    ] = None,
    data: Annotated[
        str, typer.Option("--data", metavar="LOG.csv", help="A log to run them on, in place of runs.")
    ] = "",
    columns: Annotated[
        list[str], typer.Option("--map", metavar="x1=COLUMN", help="Column of an output, input, truth, t or arrival.")
    ] = [],  # noqa: B006
    hold: Annotated[str, typer.Option(metavar="zero|first", help="u and y between two rows of the log.")] = "",
    repair: Annotated[
        bool, typer.Option("--repair", help="Sort rows of the log; leave out those without a time of their own.")
    ] = False,
    output: Annotated[str, typer.Option("-o", "--output", help="Figure (PNG, or SVG by its ending).")] = "compare.png",
    solver: Solver = "clarabel",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Compare observers on one plant, with one input and noise of one size, or on one log; table, figure."""
    from obsdesign.disk import require_writable

    require_ending(output, "figures")
    named(hold)
    require_together(seeds, data, [*columns, *([hold] if hold else []), *(["--repair"] if repair else [])])
    chosen = dict(map(pair, columns))
    with limited(timeout):
        kept = require_writable({output: "figures"}, read=[*sources, *([data] if data else [])])
        problems = [taken(source) for source in sources]

        with progress(quiet) as report:
            found: Comparison | LogComparison
            if data:
                from obsdesign.data import comparison

                found = comparison.compare(
                    problems, solver=solver, report=report, data=data, columns=chosen, hold=named(hold), repair=repair
                )
            else:
                from obsdesign import work

                found = work.compare(problems, seeds or SEEDS, solver, report)
        found.plot(output)
    if as_json:
        say(as_text(found.report))
    elif not quiet:
        say(f"{found}\n\nfigure  {kept[output]}")


def require_together(seeds: int | None, data: str, of_log: list[str]) -> None:
    """Refuse options of runs beside a log, and of a log without one."""
    if data and seeds is not None:
        raise UsageError("--seeds: a log has the noise that it has; leave --seeds or --data out", id="OBS904")
    if of_log and not data:
        raise UsageError("--map, --hold and --repair are of a log; name it: --data LOG.csv", id="OBS904")
