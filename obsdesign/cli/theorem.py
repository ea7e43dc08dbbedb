"""`obsdesign theorem`: the library that a theorem is compiled with."""

from pathlib import Path
from typing import Annotated

import typer

from obsdesign.cli.printing import say
from obsdesign.coq.library import command, library
from obsdesign.disk import require_writable, write_all
from obsdesign.errors import Problem, UsageError


def theorem(
    folder: Annotated[
        str, typer.Option("--library", metavar="DIR", help="Folder, which is made, for the library in Coq.")
    ],
) -> None:
    """Write the library in Coq that theorems of `verify --theorem coq` are compiled with, and say how."""
    if not folder:
        raise UsageError("--library: the name of the folder is empty; name a folder, which is made", id="OBS904")
    if Path(folder).is_file():
        raise UsageError(Problem("is a file; name a folder, which is made", folder, id="OBS904"))
    Path(folder).mkdir(parents=True, exist_ok=True)
    files = {str(Path(folder, name)): content for name, content in library().items()}
    told = require_writable(dict.fromkeys(files, "theorems"))
    write_all(files)
    say("\n".join(f"library  {told[path]}" for path in files))
    say(f"to compile it and a theorem: {command(folder, 'NAME.theorem.v')}")
