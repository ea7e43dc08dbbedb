"""`obsdesign init`: a spec to begin with."""

import os
import sys
from collections.abc import Iterable
from typing import Annotated

import typer

from obsdesign.cli.printing import say
from obsdesign.errors import Problem, UsageError


def init(
    name: Annotated[str, typer.Argument(metavar="[NAME]", help="Writes NAME.yaml; default: that of the plant.")] = "",
    family: Annotated[str, typer.Option(help="Family of the observer; default: the first that the plant has.")] = "",
    plant: Annotated[
        str, typer.Option(metavar="pendulum|motor|cell|vehicle|converter|tank|matrices", help="Default: pendulum.")
    ] = "",
) -> None:
    """Write a commented spec to begin with, which solves and simulates; on a terminal, ask for what is not given."""
    from obsdesign.disk import write_whole
    from obsdesign.starters import matching, text
    from obsdesign.tables.text import aligned

    found = matching(plant, family)
    if sys.stdin.isatty() and sys.stderr.isatty():
        plant = asked("plant", plant, [plant for plant, _ in found])
        family = asked("family", family, [family for _, family in matching(plant, family)])
        name = name or typer.prompt("name", plant, err=True)
    plant, family = matching(plant, family)[0]
    target = name or plant
    if not target.endswith((".yaml", ".yml")):
        target = f"{target}.yaml"
    if os.path.lexists(target):
        raise UsageError(Problem("is there already, and stays as it is; give another NAME", target, id="OBS914"))
    write_whole(target, text(plant, family).encode())
    say(aligned([("file", target), ("next", f"obsdesign solve {target} --simulate")]))


def asked(what: str, given: str, choices: Iterable[str]) -> str:
    """What is given, or else what the user chooses on the terminal."""
    known = list(dict.fromkeys(choices))
    if given or len(known) == 1:
        return given or known[0]

    def chosen(answer: str) -> str:
        if answer not in known:
            raise typer.BadParameter(f"choose one of {', '.join(known)}")
        return answer

    return str(typer.prompt(f"{what} ({', '.join(known)})", known[0], value_proc=chosen, err=True))
