"""`obsdesign simulate`: plant and observer run together."""

from typing import Annotated

import typer

from obsdesign.cli.problems import reported
from obsdesign.cli.program import AsJson, Quiet, Solver, Timeout
from obsdesign.cli.steps import drawn, progress, ran, run_text, stem, taken
from obsdesign.watch import limited


def simulate(
    source: Annotated[
        str, typer.Argument(metavar="[SPEC|GAINS.json]", help="Default: the newest certified gains.")
    ] = "",
    gains: Annotated[str, typer.Option(help="Gains file to use with a spec.")] = "",
    output: Annotated[str, typer.Option("-o", "--output", help="Samples (CSV); - is standard output.")] = "",
    plot: Annotated[str, typer.Option("--plot", help="Figure (PNG).")] = "",
    solver: Solver = "clarabel",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Simulate plant and observer; write the samples and a figure."""
    from obsdesign.disk import require_writable, write_all

    with limited(timeout):
        if not source:
            from obsdesign.files import newest

            source = newest()
            if not quiet:
                typer.echo(f"simulating {source}", err=True)
        name = stem(source)
        files = output or f"{name}.run.csv", plot or f"{name}.run.png"
        require_writable(*(file for file in files if file != "-"))
        problem = taken(source)
        from obsdesign.simulate.validity import require_kept
        from obsdesign.work import trial

        with progress(quiet) as report:
            design = trial(problem, gains, solver, report)
        run = ran(design, quiet)
        samples, figure = drawn(run)
        if files[0] == "-":
            typer.echo(samples.decode(), nl=False)
        write_all({path: content for path, content in zip(files, (samples, figure), strict=True) if path != "-"})
    if files[0] == "-":
        return
    if not as_json and not quiet:
        typer.echo(run_text(design, run.summary, files))
    with reported(run.summary, as_json):
        require_kept(run.summary, files[0])
