"""What a command prints, without the lines that the runners of GitHub, Azure and TeamCity obey.

A file that a command writes, such as a JUnit report, does not pass here.
"""

import os
import re
import sys
from typing import IO

import typer

from obsdesign.errors import LOGGED

COMMAND = re.compile(r"(^|\r)([^\S\r\n]*):(?=:)", re.MULTILINE)  # of GitHub: ::error::, also after spaces


def say(text: str, *, err: bool = False, nl: bool = True, color: bool | None = None, obeyed: bool = False) -> None:
    """Print on standard output, or on standard error, where one that cannot be written ends nothing.

    Unless it shall be `obeyed`, `::` at the beginning of a line and `##[` and `##word[` anywhere are written with an
    escape, which in JSON stands for the same text.
    """
    plain = text if obeyed else LOGGED.sub(r"#\\u0023", COMMAND.sub(r"\1\2\\u003a", text))
    try:
        typer.echo(plain, err=err, nl=nl, color=color)
    except OSError:
        if not err:
            raise
        silence(sys.stderr)  # the exit code stays that of the work


def silence(stream: IO[str] | None) -> None:
    """Drop what a stream could not print, or it would fail once more at the exit."""
    if stream is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
