"""`obsdesign check`: what the structure of a spec allows, before any design."""

import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from obsdesign.cli.printing import say
from obsdesign.cli.problems import show
from obsdesign.cli.program import AsJson, Changes, Quiet, SpecPaths, Timeout
from obsdesign.cli.sources import Answer, each, found
from obsdesign.cli.steps import as_text, loaded
from obsdesign.errors import ObsdesignError, UsageError
from obsdesign.watch import limited

if TYPE_CHECKING:
    from obsdesign.families.finding import Finding

PAUSE = 0.2  # s between two looks at the files


def check(
    specs: SpecPaths,
    changes: Changes = [],  # noqa: B006
    watch: Annotated[bool, typer.Option("--watch", help="Check again whenever a file is saved, until Ctrl-C.")] = False,
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Say what the structure of a spec allows, before any design."""
    if watch and "-" in specs:
        raise UsageError("--watch looks at files; standard input is read once", id="OBS904")
    for _ in saves(specs) if watch else [()]:
        try:
            with limited(timeout):
                each(found(specs), lambda spec: checked(spec, changes, as_json, quiet), as_json=as_json)
        except (typer.Exit, ObsdesignError) as ended:
            if not watch:
                raise
            if isinstance(ended, ObsdesignError):
                show(ended, as_json=as_json)


def checked(spec: str, changes: Sequence[str], as_json: bool, quiet: bool) -> Answer:
    """What is said of one spec."""
    problem = loaded(spec, changes)
    from obsdesign import work
    from obsdesign.tables.split import entry, printed

    findings = work.check(problem)
    possible = all(finding.stands for finding in findings)
    if as_json:
        report = {"name": problem.name, "possible": possible, "findings": [f.written() for f in findings]}
        text = as_text(report | entry(problem) | {"notes": list(problem.notes)})
    else:
        read = [f"read  {note}\n" for note in problem.notes]
        text = "" if quiet else "".join([printed(problem), *read, *map(line, findings)])
    return Answer(text, 0 if possible else 3)


def line(finding: "Finding") -> str:
    """Line of a finding; what does not hold with what to do and the id that explains it.

    Nothing where it rules nothing out and nothing is to be done: `--json` has it.
    """
    if finding.holds:
        return f"ok    {finding.sentence}\n"
    if not (finding.decides or finding.advice):
        return ""
    said = "; ".join(filter(None, (finding.sentence, finding.advice)))
    return f"{'FAIL' if finding.decides else 'note'}  {said} [{finding.id}]\n"


def saved(sources: Sequence[str]) -> list[tuple[str, int]]:
    """Files, as far as there are any, with the times at which they were saved."""
    times = []
    with suppress(UsageError):  # a folder without specs, of which the check tells
        for path in found(sources):
            with suppress(OSError):
                times.append((path, Path(path).stat().st_mtime_ns))
    return times


def saves(sources: Sequence[str]) -> Iterator[None]:
    """Begin, and go on after every save of a file, without end."""
    seen: object = None
    while True:
        if (now := saved(sources)) != seen:
            seen = now
            yield
            say(f"checked at {time.strftime('%H:%M:%S')}, and again after every save; Ctrl-C ends", err=True)
        time.sleep(PAUSE)
