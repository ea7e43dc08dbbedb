"""`obsdesign diff`: what changed from one result file to another."""

from typing import Annotated

import typer

from obsdesign.cli.printing import say
from obsdesign.cli.program import AsJson, Quiet, Timeout
from obsdesign.cli.steps import as_text
from obsdesign.watch import limited


def diff(
    old: Annotated[str, typer.Argument(metavar="OLD.json", help="Result file of `solve`.")],
    new: Annotated[str, typer.Argument(metavar="NEW.json", help="Another one.")],
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Say what changed from one result file to another: spec, gains, guarantee, as the files have them."""
    from obsdesign.difference import as_rows
    from obsdesign.difference import diff as difference
    from obsdesign.tables.text import aligned

    with limited(timeout):
        found = difference(old, new)
    if as_json:
        say(as_text(found))
    elif not quiet:
        say(aligned(as_rows(found)))
