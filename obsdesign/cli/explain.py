"""`obsdesign explain`: the manual."""

from typing import Annotated

import typer


def explain(
    topic: Annotated[str, typer.Argument(metavar="[TOPIC|ID]", help="Default: the list of topics.")] = "",
) -> None:
    """Print a page of the manual, or what a message such as OBS104 means: its cause, an example, its cure."""
    from obsdesign.guide import explained, topics
    from obsdesign.tables.text import aligned

    if topic:
        typer.echo(explained(topic).rstrip())
    else:
        typer.echo(aligned([*topics().items()]))
        typer.echo("\nobsdesign explain TOPIC prints a page, obsdesign explain OBS104 what a message means")
