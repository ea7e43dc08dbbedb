"""`obsdesign solve`: the observer of a spec."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from obsdesign.cli.printing import say
from obsdesign.cli.problems import tell
from obsdesign.cli.program import AsJson, Changes, PlotAll, Quiet, Solver, SpecPaths, Timeout
from obsdesign.cli.sources import Answer, each, found, require_apart, require_one
from obsdesign.cli.steps import drawn, failing, interruptible, loaded, ran, run_text, solved, stem
from obsdesign.disk import require_ending
from obsdesign.errors import EXIT, Problem, UsageError
from obsdesign.watch import limited

if TYPE_CHECKING:
    from obsdesign.design import Design
    from obsdesign.simulate import Run
    from obsdesign.spec import Spec

FEW = 5  # points of a range that show its course


def solve(
    specs: SpecPaths,
    changes: Changes = [],  # noqa: B006
    output: Annotated[str, typer.Option("-o", "--output", help="Gains file; - is standard output.")] = "",
    simulate: Annotated[bool, typer.Option("--simulate", help="Simulate too: FILE.run.csv and FILE.run.png.")] = False,
    plot: Annotated[bool, typer.Option("--plot", help="Plot the curves of a search, NAME.curve.png.")] = False,
    plot_all: PlotAll = False,
    solver: Solver = "clarabel",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Design the observer of a spec and write its certified gains."""
    from obsdesign.disk import require_writable, write_all

    def answer(spec: str) -> Answer:
        problem = loaded(spec, changes)
        from obsdesign.tables.text import aligned

        target = output or f"{stem(spec)}.gains.json"
        printed = target == "-"
        kept = require_writable({target: "results"}, read=[spec])
        paths, curve = beside(target, spec)
        more = {paths[0]: "samples", paths[1]: "figures"} if simulate else {}
        more |= {curve: "figures"} if plot else {}
        kept |= require_writable(more, read=[spec, *logs(problem)]) if more else {}
        with interruptible(lambda: lost(problem, spec)):
            design = solved(problem, solver, quiet)
        if design.status == "uncertified":
            tell([Problem("these gains are not certified: no proof of them was found", spec, id="OBS616")])
        tell(design.unmet())
        text, run = design.text(), None
        files = {} if printed else {target: text}
        try:
            if simulate and design.built:
                with interruptible(lambda: "" if printed else f"{target} is kept; `obsdesign simulate` runs it"):
                    run = ran(design, quiet)
                    files |= dict(zip(paths, drawn(run, paths[1], plot_all), strict=True))
        except UsageError:
            files.clear()
            raise
        finally:
            write_all(files)
        if printed or as_json:
            told = text.decode()
        else:
            told = "" if quiet else aligned([*design.table(), ("file", kept[target])])
            if run and not quiet:
                told += f"\n\n{run_text(design, run.summary, (kept[paths[0]], kept[paths[1]]))}"
        last = partial(finish, design, run, paths[0], (curve, kept[curve]) if plot else None, quiet=quiet)
        return Answer(told, EXIT[design.status], failing(last))

    require_ending(output, "results")
    with limited(timeout):
        sources = found(specs)
        require_one(sources, output)
        require_apart(sources, [stem(source) for source in sources])
        each(sources, answer, as_json=as_json)


def finish(design: "Design", run: "Run | None", samples: str, curve: tuple[str, str] | None, *, quiet: bool) -> None:
    """Draw the curve of a search, where it is asked for, and hold a run in `samples` against what is proved of it.

    `curve`: its path, and what is said of it.
    """
    if curve:
        drawn = design.plot_search(curve[0])
        said = f"curve  {curve[1]}" if drawn else "no curve to plot: give a range, with objective min-gamma or pareto"
        if not quiet:
            say(said, err=True)
    if run:
        from obsdesign.simulate.validity import require_kept

        require_kept(run.summary, samples)


def lost(problem: "Spec", path: str) -> str:
    """What an interrupted design leaves, and how to go on."""
    from obsdesign.dissipation.bounds import Range

    asked: Any = problem.observer
    called = {"rate": asked.pace.key} if hasattr(asked, "rate") else {}  # of a theorem, in a spec
    ranges = {called.get(key, key): value.points for key, value in vars(asked).items() if isinstance(value, Range)}
    fewer = " ".join(f"--set observer.{key}.points={FEW}" for key, points in ranges.items() if points > FEW)
    said = f"nothing of {path} is written, and the same command begins it anew"
    return f"{said}; with {fewer} it ends sooner" if fewer else said


def logs(problem: "Spec") -> list[str]:
    """Paths of the files that a run reads."""
    from obsdesign.simulate.recorded import followed

    return followed(problem)


def beside(target: str, spec: str) -> tuple[tuple[str, str], str]:
    """Paths of the samples and the figure of a run, and of the figure of a search: beside a gains file that is kept."""
    from obsdesign.disk import is_regular

    kept = target != "-" and is_regular(target)
    folder, name = (Path(target).parent, stem(target)) if kept else (Path(), stem(spec))
    samples, figure, curve = (str(folder / f"{name}.{kind}") for kind in ("run.csv", "run.png", "curve.png"))
    return (samples, figure), curve
