"""`obsdesign check`: what the structure of a spec allows, before any design."""

import typer

from obsdesign.cli.program import AsJson, Quiet, SpecPath, Timeout
from obsdesign.cli.steps import as_text, loaded
from obsdesign.watch import limited


def check(spec: SpecPath, timeout: Timeout = 600, as_json: AsJson = False, quiet: Quiet = False) -> None:
    """Say what the structure of a spec allows, before any design."""
    with limited(timeout):
        problem = loaded(spec)
        from obsdesign import work
        from obsdesign.tables.split import entry, printed

        findings = work.check(problem)
    possible = all(finding.stands for finding in findings)
    if as_json:
        report = {"name": problem.name, "possible": possible, "findings": [f.written() for f in findings]}
        typer.echo(as_text(report | entry(problem) | {"notes": list(problem.notes)}))
    elif not quiet:
        typer.echo(printed(problem), nl=False)
        for finding in findings:
            mark = "ok  " if finding.holds else "FAIL" if finding.decides else "note"
            typer.echo(f"{mark}  {finding.sentence}")
    raise typer.Exit(0 if possible else 3)
