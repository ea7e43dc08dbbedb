"""`obsdesign init`: a spec to begin with."""

import os
import shlex
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from obsdesign.cli.printing import say
from obsdesign.errors import NOT_ONE_LINE, Problem, UsageError

FOLDERS = {"", ".", ".."}  # how the path of a folder ends, in which the file has the name of its plant
LONGEST = 240  # bytes of the name of a file: results add an ending


def init(
    name: Annotated[
        str, typer.Argument(metavar="[NAME]", help="Writes NAME.yaml; default: that of the plant, and the other way.")
    ] = "",
    family: Annotated[str, typer.Option(help="Family of the observer; default: the first that the plant has.")] = "",
    plant: Annotated[
        str,
        typer.Option(
            metavar="pendulum|motor|fan|cell|vehicle|single-track|converter|tank|matrices", help="Default: pendulum."
        ),
    ] = "",
) -> None:
    """Write a commented spec to begin with, which solves and simulates; on a terminal, ask for what is not given."""
    from obsdesign.disk import require_writable, write_whole
    from obsdesign.starters import PLANTS, matching, text
    from obsdesign.tables.text import aligned

    plant = plant or (Path(name).stem if Path(name).stem in PLANTS else "")
    found = matching(plant, family)
    if sys.stdin.isatty() and sys.stderr.isatty():
        plant = asked("plant", plant, [plant for plant, _ in found])
        family = asked("family", family, [family for _, family in matching(plant, family)])
        name = name or typer.prompt("name", plant, err=True)
    plant, family = matching(plant, family)[0]
    target = os.path.join(name, plant) if os.path.basename(name) in FOLDERS else name
    if not target.endswith((".yaml", ".yml")):
        target = f"{target}.yaml"
    require_name(target)
    if os.path.lexists(target):
        raise UsageError(Problem("is there already, and stays as it is; give another NAME", target, id="OBS914"))
    require_writable({target: "specs"})
    write_whole(target, text(plant, family).encode())
    others = [one for one in PLANTS if one != plant]
    families = [one for _, one in matching(plant, "") if one != family]
    rows = [("file", target), ("plant", f"{plant}   --plant has also {', '.join(others)}")]
    rows += [("family", f"{family}   --family has also {', '.join(families)}")] if families else []
    say(aligned([*rows, ("next", f"obsdesign solve {shlex.quote(target)} --simulate")]))


def require_name(target: str) -> None:
    """Refuse a name that would end a line, or is that of an option; raises `UsageError`."""
    if found := NOT_ONE_LINE.search(target):
        said = f"the name holds the character U+{ord(found[0]):04X}; give another NAME"
        raise UsageError(Problem(said, target, id="OBS902"))
    if len(os.fsencode(Path(target).name)) > LONGEST:
        said = f"the name has more than {LONGEST} bytes; give a shorter NAME"
        raise UsageError(Problem(said, f"{target[:40]}..", id="OBS902"))
    if target.startswith("-"):
        raise UsageError(Problem("a command would take it for an option; give another NAME", target, id="OBS902"))


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
