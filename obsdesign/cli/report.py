"""`obsdesign report`: one page that people read, of a result file or of a folder of them."""

from typing import Annotated

import typer

from obsdesign.cli.printing import say
from obsdesign.cli.program import AsJson, Quiet, Timeout
from obsdesign.cli.steps import as_text, progress
from obsdesign.disk import require_ending
from obsdesign.watch import limited


def report(
    source: Annotated[str, typer.Argument(metavar="GAINS.json|FOLDER", help="Result file, or a folder of them.")],
    output: Annotated[str, typer.Option("-o", "--output", help="Page (HTML).")] = "report.html",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Make one self-contained page: problem, guarantee proved anew, gains, curves, trajectories, origin."""
    from obsdesign.disk import require_writable
    from obsdesign.reports.page import report as made
    from obsdesign.simulate.validity import require_kept

    require_ending(output, "pages")
    with limited(timeout):
        kept = require_writable({output: "pages"}, read=[source])
        with progress(quiet) as told:
            page = made(source, output, told)
    counts = ", ".join(f"{count} {status}" for status, count in page.counts.items())
    if as_json:
        say(as_text({"file": output, "counts": page.counts, "without": page.without}))
    elif not quiet:
        say(f"{counts}\nreport  {kept[output]}")
    for entry in page.entries:
        if entry.trial.summary:
            require_kept(entry.trial.summary, entry.file.path)
    if page.failure:
        raise page.failure
