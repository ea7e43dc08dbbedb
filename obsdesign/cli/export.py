"""`obsdesign export`: an observer as code."""

import json
from typing import Annotated

import typer

from obsdesign.cli.printing import say
from obsdesign.cli.program import AsJson, Quiet, Timeout
from obsdesign.cli.steps import progress
from obsdesign.watch import limited


def export(
    source: Annotated[str, typer.Argument(metavar="GAINS.json|SPEC", help="Result file; a spec is solved first.")],
    to: Annotated[str, typer.Option("--to", metavar="c|python|matlab|fmu", help="Language.")],
    output: Annotated[
        str, typer.Option("-o", "--output", metavar="DIR", help="Empty folder, or one that is made; default: ID-TO.")
    ] = "",
    single: Annotated[bool, typer.Option("--float", help="Floats of 32 bits (C).")] = False,
    name: Annotated[str, typer.Option(metavar="ID", help="Identifier; default: the name of the file.")] = "",
    period: Annotated[str, typer.Option(metavar="SECONDS", help="Time of a step, where not that of the spec.")] = "",
    method: Annotated[str, typer.Option(metavar="euler|rk4|exact", help="Of a step, where not that of the spec.")] = "",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write an observer as code that runs without this package: C99, Python, MATLAB, or a functional mock-up unit."""
    from obsdesign.exports import checked_target, exported, require_empty

    target = checked_target(to)
    if output:
        require_empty(output)
    with limited(timeout):
        from obsdesign.work import trial

        with progress(quiet) as report:
            design = trial(source, "", "clarabel", report)
        made = exported(design, target, name=name, period=period or None, method=method or None, single=single)
        paths = made.write(output or f"{made.subject.name}-{to}")
    cost = made.subject.cost()
    if as_json:
        told = {"files": paths, "cost": cost, "words": list(made.subject.words), "notes": list(made.notes)}
        say(json.dumps(told, indent=2, ensure_ascii=False))
        return
    if not quiet:
        say("\n".join([*made.subject.words, *(f"written  {path}" for path in paths), *made.notes]))
        say("a step: " + ", ".join(f"{count} {kind}" for kind, count in sorted(cost.items())))
