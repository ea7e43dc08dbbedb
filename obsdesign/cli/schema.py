"""`obsdesign schema`: what an editor wants to know of a spec."""

import json

import typer


def schema() -> None:
    """Print the JSON Schema of a spec file."""
    from obsdesign.reading import json_schema

    typer.echo(json.dumps(json_schema(), indent=2))
