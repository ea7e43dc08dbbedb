"""`obsdesign solve`: the observer of a spec."""

from pathlib import Path
from typing import Annotated

import typer

from obsdesign.cli.program import AsJson, Changes, Quiet, Solver, SpecPaths, Timeout
from obsdesign.cli.sources import Answer, each, found, require_apart, require_one
from obsdesign.cli.steps import broken, drawn, ran, run_text, solved, stem
from obsdesign.errors import EXIT, UsageError
from obsdesign.watch import limited


def solve(
    specs: SpecPaths,
    changes: Changes = [],  # noqa: B006
    output: Annotated[str, typer.Option("-o", "--output", help="Gains file; - is standard output.")] = "",
    simulate: Annotated[bool, typer.Option("--simulate", help="Simulate too: FILE.run.csv and FILE.run.png.")] = False,
    plot: Annotated[bool, typer.Option("--plot", help="Plot the curves of a search, NAME.curve.png.")] = False,
    solver: Solver = "clarabel",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Design the observer of a spec and write its certified gains."""
    from obsdesign.files import is_regular, require_writable, write_all
    from obsdesign.tables.text import aligned
    from obsdesign.work import load

    def answer(spec: str) -> Answer:
        problem = load(spec, changes)
        target = output or f"{stem(spec)}.gains.json"
        printed = target == "-"
        if not printed:
            require_writable(target)
        named = not printed and is_regular(target)
        beside, name = (Path(target).parent, stem(target)) if named else (Path(), stem(spec))
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
        if plot and not design.plot_search(str(beside / f"{name}.curve.png")) and not quiet:
            typer.echo("no curve to plot: give a range, with objective min-gamma or pareto", err=True)
        if design.status == "uncertified":
            typer.echo(f"{spec}: these gains are not certified: no proof of them was found", err=True)
        for said in design.unmet():
            typer.echo(f"{spec}: {said}", err=True)
        if printed or as_json:
            told = text.decode()
        else:
            told = "" if quiet else aligned([*design.table(), ("file", target)])
            told += f"\n\n{run_text(design, run.summary, paths)}" if run and not quiet else ""
        return Answer(told, EXIT[design.status], broken(run, paths[0]) if run else None)

    with limited(timeout):
        sources = found(specs)
        require_one(sources, output)
        require_apart(sources, [stem(source) for source in sources])
        each(sources, answer, as_json=as_json)
