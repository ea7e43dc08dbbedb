"""`obsdesign compare`: several observers on one plant."""

from typing import Annotated

import typer

from obsdesign.cli.printing import say
from obsdesign.cli.program import AsJson, Quiet, Solver, Timeout
from obsdesign.cli.steps import as_text, progress, taken
from obsdesign.disk import require_ending
from obsdesign.watch import limited


def compare(
    sources: Annotated[list[str], typer.Argument(metavar="SPEC|GAINS.json..", help="Specs and gains files.")],
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Runs with noise of each observer.")] = 10,
    output: Annotated[str, typer.Option("-o", "--output", help="Figure (PNG, or SVG by its ending).")] = "compare.png",
    solver: Solver = "clarabel",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Compare observers on one plant, with one input and noise of one size: settling, noise, speed; table, figure."""
    from obsdesign.disk import require_writable

    require_ending(output, "figures")
    with limited(timeout):
        kept = require_writable({output: "figures"}, read=sources)
        problems = [taken(source) for source in sources]
        from obsdesign import work

        with progress(quiet) as report:
            found = work.compare(problems, seeds, solver, report)
        found.plot(output)
    if as_json:
        say(as_text(found.report))
    elif not quiet:
        say(f"{found}\n\nfigure  {kept[output]}")
