"""What is wrong, as it is told: lines on standard error, on a terminal with the place in the file; and as JSON."""

import os
import shutil
import sys
from collections.abc import Sequence
from typing import NoReturn
from unicodedata import combining, east_asian_width

import typer

from obsdesign.cli.printing import say
from obsdesign.errors import Excerpt, ObsdesignError, Problem, UndecidedError, listed, one_line

MOST = 10  # problems whose line is shown


def without_memory(error: MemoryError) -> UndecidedError:
    """What is told where there is no more memory."""
    return UndecidedError(f"there is not enough memory; ask for less, such as fewer states: {error}", id="OBS908")


def answer(error: ObsdesignError, *, as_json: bool) -> NoReturn:
    """Tell what is wrong, and exit with the code of the error."""
    show(error, as_json=as_json)
    raise typer.Exit(error.exit_code)


def show(error: ObsdesignError, *, as_json: bool) -> None:
    """Tell what is wrong, on standard output too as JSON."""
    tell(error.problems)
    if as_json:
        say(listed(error.problems))


def tell(problems: Sequence[Problem]) -> None:
    """Print one line each on standard error; on a terminal also the lines of the file that the first are about."""
    terminal = sys.stderr.isatty()
    for i, problem in enumerate(problems):
        say(str(problem), err=True)
        if terminal and i < MOST and problem.excerpt:
            say(pointed(problem.excerpt, shutil.get_terminal_size().columns), err=True, color=coloured())


def coloured() -> bool:
    """Whether a terminal shows colours, and its user wants to see them."""
    return not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def pointed(excerpt: Excerpt, width: int) -> str:
    """Line of a problem with a caret under its column, of at most so many characters."""
    before, after = map(one_line, excerpt[1:])
    margin = " " * len(str(excerpt.line))
    room = max(20, width - len(margin) - 4)
    if cells(before) > room // 2:
        before = f"…{before[1 - room // 2 :]}"
    if cells(before) + cells(after) > room:
        after = f"{after[: room - cells(before) - 1]}…"
    caret = typer.style("^", fg=typer.colors.RED, bold=True)
    return f" {excerpt.line} | {before}{after}\n {margin} | {' ' * cells(before)}{caret}"


def cells(text: str) -> int:
    """Cells of a terminal that a text takes."""
    return sum(2 if east_asian_width(c) in "WF" else not combining(c) for c in text)
