"""The command line: the only code that prints or exits. Heavy modules are imported by the command that needs them."""

import json
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from obsdesign.errors import ObsdesignError, UndecidedError, UsageError
from obsdesign.watch import INTERRUPTED, limited

if TYPE_CHECKING:
    from obsdesign.design import Design
    from obsdesign.simulate import Run
    from obsdesign.spec import Spec

EXIT = {"certified": 0, "infeasible": 3, "refuted": 3, "uncertified": 4}


class Commands(TyperGroup):
    """Group whose commands answer a user's mistake in lines on standard error and with the exit code of the error."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command."""
        try:
            return super().invoke(ctx)
        except ObsdesignError as error:
            for problem in error.problems:
                typer.echo(str(problem), err=True)
            raise typer.Exit(error.exit_code) from None
        except KeyboardInterrupt:
            typer.echo("interrupted", err=True)
            raise typer.Exit(INTERRUPTED) from None
        except BrokenPipeError as error:
            raise OSError(error.strerror) from None  # for `main`; typer would say nothing of the one with a number


app = typer.Typer(
    cls=Commands,
    help="Design, prove and simulate state observers for nonlinear systems with unknown inputs.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

SpecPath = Annotated[str, typer.Argument(metavar="SPEC", help="Spec file (YAML); - is standard input.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only, and with --json the result.")]
Solver = Annotated[str, typer.Option(help="clarabel, or another that cvxpy has for semidefinite programs.")]
Timeout = Annotated[float, typer.Option(min=1e-3, max=1e9, help="Seconds after which the command gives up.")]


def main() -> None:
    """Entry point. Matrices are small: one thread makes runs repeatable, and halves the start-up time."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # what a library would say of its own
    try:
        if sys.stdout is None:
            raise OSError("it is closed")
        app()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except OSError as error:
        if error.filename is not None:  # not of a stream
            raise
        silence()
        typer.echo(f"standard output or standard error cannot be written: {error.strerror or error}", err=True)
        sys.exit(1)


def silence() -> None:
    """Drop what could not be printed, or it would fail once more at the exit."""
    if sys.stdout is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@app.command()
def solve(
    spec: SpecPath,
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
    from obsdesign.simulate.validity import require_kept
    from obsdesign.tables.text import aligned
    from obsdesign.work import load

    with limited(timeout):
        problem = load(spec)
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


@app.command()
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
    from obsdesign.files import newest, require_writable, write_all
    from obsdesign.simulate.validity import require_kept
    from obsdesign.work import trial

    with limited(timeout):
        if not source:
            source = newest()
            if not quiet:
                typer.echo(f"simulating {source}", err=True)
        name = stem(source)
        files = output or f"{name}.run.csv", plot or f"{name}.run.png"
        require_writable(*(file for file in files if file != "-"))
        with progress(quiet) as report:
            design = trial(source, gains, solver, report)
        run = ran(design, quiet)
        samples, figure = drawn(run)
        if files[0] == "-":
            typer.echo(samples.decode(), nl=False)
        write_all({path: content for path, content in zip(files, (samples, figure), strict=True) if path != "-"})
    if files[0] == "-":
        return
    if as_json:
        typer.echo(json.dumps(run.summary, indent=2, allow_nan=False))
    elif not quiet:
        typer.echo(run_text(design, run.summary, files))
    require_kept(run.summary, files[0])


@app.command()
def compare(
    sources: Annotated[list[str], typer.Argument(metavar="SPEC|GAINS.json..", help="Specs and gains files.")],
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Runs with noise of each observer.")] = 10,
    output: Annotated[str, typer.Option("-o", "--output", help="Figure (PNG).")] = "compare.png",
    solver: Solver = "clarabel",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Compare observers on one plant, with the same input and noise: settling, noise, speed; a table and a figure."""
    from obsdesign import work
    from obsdesign.files import require_writable

    with limited(timeout):
        require_writable(output)
        with progress(quiet) as report:
            found = work.compare(sources, seeds, solver, report)
        found.plot(output)
    if as_json:
        typer.echo(as_text(found.report))
    elif not quiet:
        typer.echo(f"{found}\n\nfigure  {output}")


@app.command()
def check(spec: SpecPath, timeout: Timeout = 600, as_json: AsJson = False, quiet: Quiet = False) -> None:
    """Say what the structure of a spec allows, before any design."""
    from obsdesign import work
    from obsdesign.tables.split import entry, printed

    with limited(timeout):
        problem = work.load(spec)
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


@app.command()
def lipschitz(
    spec: SpecPath,
    scaling: Annotated[
        bool, typer.Option("--scaling", help="Search coordinates T x, f taken as any function of the states.")
    ] = False,
    T: Annotated[str, typer.Option("--T", help="Diagonal of a T to try instead: 1,1,4,0.1.")] = "",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Prove bounds of the Lipschitz constant of every f of a spec on its region."""
    from obsdesign import work
    from obsdesign.constants import require_finite
    from obsdesign.tables.constants import constants_table

    with limited(timeout):
        report = work.lipschitz(work.load(spec), scaling=scaling, T=T.split(",") if T else None)
    if as_json:
        typer.echo(as_text(report))
    elif not quiet:
        typer.echo(constants_table(report))
    require_finite(report)


@app.command()
def verify(
    gains: Annotated[str, typer.Argument(metavar="GAINS.json", help="Result file of `solve`; - is standard input.")],
    spec: Annotated[str, typer.Argument(metavar="[SPEC]", help="The spec it must belong to.")] = "",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Prove the claim of a gains file anew, or that there is no solution; exactly and without a solver."""
    from obsdesign import work
    from obsdesign.files import checks

    with limited(timeout):
        proof = work.verify(gains, work.load(spec) if spec else None)
    rows = checks(proof.checks)
    if as_json:
        report = {"proved": proof.holds, "claim": proof.claim, "checks": rows, "numerical": list(proof.numerical)}
        typer.echo(as_text(report))
    elif not quiet:
        for row in rows:
            typer.echo(f"{'holds' if row['holds'] else 'FAILS'}  {row['name']}")
        if proof.numerical:
            typer.echo(f"numerical, no part of what is proved: {', '.join(proof.numerical)}")
        typer.echo(f"{'proved' if proof.holds else 'NOT proved'}: {proof.claim}")
    if not proof.holds:
        failed = ", ".join(repr(row["name"]) for row in rows if not row["holds"])
        raise UndecidedError(f"{gains}: the claim is not proved: {failed}")


@app.command()
def schema() -> None:
    """Print the JSON Schema of a spec file."""
    from obsdesign.reading import json_schema

    typer.echo(json.dumps(json_schema(), indent=2))


# Steps that commands share


def as_text(report: Mapping[str, Any]) -> str:
    """Report as JSON."""
    return json.dumps(report, indent=2, ensure_ascii=False, allow_nan=False)


def run_text(design: "Design", summary: Mapping[str, Any], files: tuple[str, str]) -> str:
    """Summary of a run, and the files that it is in."""
    from obsdesign.tables.run import run_table

    return run_table(summary, design.spec, bool(design.guarantee or (design.proved and design.form)), files)


@contextmanager
def progress(quiet: bool) -> Iterator[Callable[[float, str], None]]:
    """Bar on standard error, on a terminal only."""
    if quiet or not sys.stderr.isatty():
        yield lambda *_: None
        return
    with typer.progressbar(length=1000, file=sys.stderr, show_eta=False) as bar:

        def report(fraction: float, what: str) -> None:
            bar.label = what
            bar.update(max(0, int(1000 * fraction) - bar.pos))

        yield report


def solved(problem: "Spec", solver: str, quiet: bool) -> "Design":
    """Design of a spec."""
    from obsdesign.work import solve

    with progress(quiet) as report:
        return solve(problem, solver, report)


def ran(design: "Design", quiet: bool) -> "Run":
    """Run of a design, with what is to be known of it before and after."""
    for warning in () if quiet else design.spec.starts_outside():
        typer.echo(str(warning), err=True)
    with progress(quiet) as report:
        run = design.simulate(lambda done: report(done, "simulation"))
    if run.status != "done" and not quiet:
        typer.echo(f"the run ended early: {run.status} at t = {run.time:.6g} s", err=True)
    return run


def drawn(run: "Run") -> tuple[bytes, bytes]:
    """Samples and figure of a run."""
    from obsdesign.files import csv

    return csv(*run.table()), run.plot()


def stem(path: str) -> str:
    """Name of a spec or of its gains file, without folder and endings."""
    name = "stdin" if path == "-" else Path(path).name
    return name.removesuffix(".gains.json") if name.endswith(".gains.json") else Path(name).stem
