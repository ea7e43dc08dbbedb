"""Steps that commands share."""

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from obsdesign.errors import ObsdesignError, ViolatedError

if TYPE_CHECKING:
    from obsdesign.design import Design
    from obsdesign.simulate import Run
    from obsdesign.spec import Spec


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
    early = [] if run.status == "done" else [f"the run ended early: {run.status} at t = {run.time:.6g} s"]
    for said in () if quiet else (*early, *(f"{design.spec.path}: {each}" for each in design.unmet(run.summary))):
        typer.echo(said, err=True)
    return run


def drawn(run: "Run") -> tuple[bytes, bytes]:
    """Samples and figure of a run."""
    from obsdesign.files import csv

    return csv(*run.table()), run.plot()


def broken(run: "Run", samples: str) -> ObsdesignError | None:
    """That a run breaks a bound that is proved, if it does."""
    from obsdesign.simulate.validity import require_kept

    try:
        require_kept(run.summary, samples)
    except ViolatedError as error:
        return error
    return None


def stem(path: str) -> str:
    """Name of a spec or of its gains file, without folder and endings."""
    name = "stdin" if path == "-" else Path(path).name
    return name.removesuffix(".gains.json") if name.endswith(".gains.json") else Path(name).stem
