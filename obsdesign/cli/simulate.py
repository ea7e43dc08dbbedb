"""`obsdesign simulate`: plant and observer run together."""

from typing import Annotated

import typer

from obsdesign.cli.montecarlo import Options, many, require_many
from obsdesign.cli.printing import say
from obsdesign.cli.program import AsJson, Changes, PlotAll, Quiet, Solver, Timeout
from obsdesign.cli.sources import RESULTS, SPECS, Answer, each, found, require_apart, require_one
from obsdesign.cli.steps import as_text, drawn, failing, interruptible, progress, ran, run_text, stem, taken
from obsdesign.disk import require_ending
from obsdesign.errors import one_line
from obsdesign.watch import limited


def simulate(
    sources: Annotated[
        list[str], typer.Argument(metavar="[SPEC|GAINS.json]..", help="Default: the newest certified gains.")
    ] = [],  # noqa: B006
    changes: Changes = [],  # noqa: B006
    gains: Annotated[str, typer.Option(help="Gains file to use with a spec.")] = "",
    labelled: Annotated[bool, typer.Option("--labelled", help="Gains of another plant, with no guarantee.")] = False,
    runs: Annotated[int | None, typer.Option(min=1, max=10_000, help="Runs, each with its own seed.")] = None,
    jobs: Annotated[int | None, typer.Option(min=0, max=4096, help="Processes of --runs; 0: one a core.")] = None,
    output: Annotated[str, typer.Option("-o", "--output", help="Samples (CSV); - is standard output.")] = "",
    plot: Annotated[str, typer.Option("--plot", help="Figure (PNG, or SVG by its ending).")] = "",
    plot_all: PlotAll = False,
    solver: Solver = "clarabel",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Simulate plant and observer; write the samples and a figure."""
    from obsdesign.disk import newest, require_two, require_writable, write_all

    require_many(runs, jobs, plot, plot_all)
    require_ending(output, "samples" if runs is None else "envelopes")
    require_ending(plot, "figures")
    asked = Options(runs or 0, jobs or 0, gains, labelled, changes, output, plot, solver, as_json, quiet)
    with limited(timeout):
        if not sources:
            sources = [newest()]
            if not quiet:
                say(f"simulating {one_line(sources[0])}", err=True)
        given = found(sources, (*SPECS, *RESULTS))
        require_one(given, output, plot, gains)
        require_apart(given, [stem(file) for file in given])

        def answer(source: str) -> Answer:
            if runs is not None:
                return many(source, asked)
            name = stem(source)
            paths = output or f"{name}.run.csv", plot or f"{name}.run.png"
            require_two(*paths, "samples and figure")
            kinds = dict(zip(paths, ("samples", "figures"), strict=True))
            kept = require_writable(kinds, read=[source, *[gains] * bool(gains)])
            problem = taken(source, () if gains and not labelled else changes)
            from obsdesign import work
            from obsdesign.simulate.recorded import followed
            from obsdesign.simulate.validity import require_kept

            with progress(quiet) as report:
                design = work.trial(problem, gains, solver, report, changes, labelled=labelled)
            require_writable(kinds, read=followed(design.elsewhere or design.spec))
            with interruptible(lambda: "no samples and no figure are written"):
                run = ran(design, quiet)
            samples, figure = drawn(run, paths[1], plot_all)
            write_all({path: made for path, made in zip(paths, (samples, figure), strict=True) if path != "-"})
            if paths[0] == "-":
                return Answer(samples.decode())
            files = kept[paths[0]], kept[paths[1]]
            text = as_text(run.summary) if as_json else "" if quiet else run_text(design, run.summary, files)
            return Answer(text, failure=failing(lambda: require_kept(run.summary, paths[0])))

        each(given, answer, as_json=as_json)
