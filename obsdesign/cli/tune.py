"""`obsdesign tune`: numbers of a spec from recorded data."""

from typing import Annotated

import typer

from obsdesign.cli.estimate import pair
from obsdesign.cli.printing import say
from obsdesign.cli.problems import tell
from obsdesign.cli.program import AsJson, Changes, Quiet, Timeout
from obsdesign.cli.steps import as_text, interruptible, progress, stem
from obsdesign.disk import require_ending, require_writable
from obsdesign.watch import limited


def tune(
    source: Annotated[str, typer.Argument(metavar="GAINS.json|SPEC", help="Result file; a spec is solved first.")],
    data: Annotated[str, typer.Argument(metavar="DATA.csv", help="Log: a column of time, and of each signal.")],
    output: Annotated[str, typer.Option("-o", "--output", help="Spec with the fitted numbers.")] = "",
    changes: Changes = [],  # noqa: B006
    columns: Annotated[
        list[str], typer.Option("--map", metavar="y1=COLUMN", help="Column of an output, input, of t or of arrival.")
    ] = [],  # noqa: B006
    free: Annotated[
        list[str], typer.Option("--free", metavar="KEY", help="Key that is fitted, such as observer.alpha.")
    ] = [],  # noqa: B006
    share: Annotated[
        float, typer.Option(min=0.1, max=0.9, help="Share of the rows that is fitted to; the others judge.")
    ] = 0.6,
    repair: Annotated[
        bool, typer.Option("--repair", help="Sort rows; leave out those without a time of their own.")
    ] = False,
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Fit noise, weights or decay of a spec to a log, judge them on rows held back, and write the spec."""
    chosen = dict(map(pair, columns))
    path = output or f"{stem(source)}.tuned.yaml"
    require_ending(path, "tuned specs")
    kept = require_writable({path: "tuned specs"}, read=[source, data])
    with limited(timeout), interruptible(lambda: "no spec is written"):
        from obsdesign.data import tuning
        from obsdesign.work import trial

        with progress(quiet) as report:
            design = trial(source, "", "clarabel", report, changes)
        tell(() if quiet else [*tuning.hurried(design.spec)])
        with progress(quiet) as report:
            target = None if path == "-" else path
            made = tuning.tune(
                design, data, target, columns=chosen, free=free, share=share, repair=repair, progress=report
            )
    tell(() if quiet else [*tuning.warned(made, data)])
    if path == "-":
        say(made.text.rstrip("\n"))
        return
    if as_json:
        say(as_text(made.report))
    elif not quiet:
        from obsdesign.tables.tuning import tuning_table

        say(tuning_table(made.report, kept[path]))
