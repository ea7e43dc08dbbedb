"""`obsdesign solve`: the observer of a spec."""

from pathlib import Path
from typing import Annotated

import typer

from obsdesign.cli.program import AsJson, Quiet, Solver, SpecPath, Timeout
from obsdesign.cli.steps import drawn, ran, run_text, solved, stem
from obsdesign.errors import EXIT, UsageError
from obsdesign.watch import limited


def solve(
    spec: SpecPath,
    output: Annotated[str, typer.Option("-o", "--output", help="Gains file; - is standard output.")] = "",
    simulate: Annotated[bool, typer.Option("--simulate", help="Simulate too: CSV and PNG beside the gains.")] = False,
    plot: Annotated[bool, typer.Option("--plot", help="Plot the curves of a search, NAME.curve.png.")] = False,
    solver: Solver = "clarabel",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Design the observer of a spec and write its certified gains."""
    from obsdesign.files import is_regular, require_writable, write_all
    from obsdesign.simulate.validity import require_kept
    from obsdesign.tables.text import aligned
    from obsdesign.work import load

    with limited(timeout):
        problem = load(spec)
        name = stem(spec)
        target = output or f"{name}.gains.json"
        printed = target == "-"
        if not printed:
            require_writable(target)
        beside = Path(target).parent if not printed and is_regular(target) else Path()
        paths = str(beside / f"{name}.run.csv"), str(beside / f"{name}.run.png")
        design = solved(problem, solver, quiet)
        text, run = design.text(), None
        files = {} if printed else {target: text}
        try:
            if simulate and design.built:
                run = ran(design, quiet)
                files |= dict(zip(paths, drawn(run), strict=True))
        except UsageError:
            files.clear()
            raise
        finally:
            write_all(files)
        if printed or as_json:
            typer.echo(text, nl=False)
        elif not quiet:
            typer.echo(aligned([*design.table(), ("file", target)]))
            if run:
                typer.echo(f"\n{run_text(design, run.summary, paths)}")
        if plot and not design.plot_search(str(beside / f"{name}.curve.png")) and not quiet:
            typer.echo("no curve to plot: give a range, with objective min-gamma or pareto", err=True)
        if design.status == "uncertified":
            typer.echo(f"{spec}: these gains are not certified: no proof of them was found", err=True)
        for failed in (entry for entry in design.expected(run.summary if run else None) if not entry["holds"]):
            said = f"expected {failed['expected']}, found {'nothing' if failed['found'] is None else failed['found']}"
            typer.echo(f"{spec}: expect.{failed['key']}: {said}", err=True)
        if run:
            require_kept(run.summary, paths[0])
    raise typer.Exit(EXIT[design.status])
