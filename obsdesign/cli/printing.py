"""What a command prints, without the lines that the runners of GitHub, Azure and TeamCity obey.

A file that a command writes, such as a JUnit report, does not pass here.
"""

import codecs
import json
import os
import re
import sys
from io import TextIOWrapper
from typing import IO

import typer

from obsdesign.errors import NOT_ONE_LINE, unheeded

CONTROL = re.compile(f"(?!\n){NOT_ONE_LINE.pattern}")


class UnwrittenError(OSError):
    """Standard output cannot be written; without a number, for typer would say nothing of a broken pipe."""


def say(text: str, *, err: bool = False, nl: bool = True, color: bool | None = None, obeyed: bool = False) -> None:
    """Print on standard output, or on standard error, where one that cannot be written ends nothing.

    Unless it shall be `obeyed`: see `unheeded`. What a terminal would obey is spelled out, but for its own `color`.
    """
    plain = text if color is not None else CONTROL.sub(lambda found: json.dumps(found[0])[1:-1], text)
    try:
        typer.echo(plain if obeyed else unheeded(plain), err=err, nl=nl, color=color)
    except OSError as error:
        if not err:
            raise UnwrittenError(error.strerror) from None
        silence(sys.stderr)  # the exit code stays that of the work


def spell_out(*streams: IO[str] | None) -> None:
    """Let streams print what their encoding has no character for, as JSON would escape it."""
    codecs.register_error("spelled", spelled)
    for stream in streams:
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="spelled")


def spelled(error: UnicodeError) -> tuple[str, int]:
    r"""Characters that cannot be encoded as \u and four digits, and where to go on."""
    assert isinstance(error, UnicodeEncodeError)
    return json.dumps(error.object[error.start : error.end])[1:-1], error.end


def silence(stream: IO[str] | None) -> None:
    """Drop what a stream could not print, or it would fail once more at the exit."""
    if stream is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
