"""Steps that commands share."""

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from obsdesign.cli.printing import say
from obsdesign.cli.problems import tell
from obsdesign.errors import ObsdesignError, TimeLimitError, one_line

if TYPE_CHECKING:
    from obsdesign.design import Design
    from obsdesign.simulate import Run
    from obsdesign.spec import Spec


def as_text(report: Mapping[str, Any]) -> str:
    """Report as JSON."""
    return json.dumps(report, indent=2, ensure_ascii=False, allow_nan=False)


def run_text(design: "Design", summary: Mapping[str, Any], files: tuple[str, str]) -> str:
    """Summary of a run, and the files that it is in."""
    from obsdesign.simulate.drawing import tried
    from obsdesign.tables.run import run_table

    return run_table(summary, tried(design, {}), bool(design.guarantee or (design.proved and design.form)), files)


@contextmanager
def progress(quiet: bool) -> Iterator[Callable[[float, str], None]]:
    """Hear how far a step is: a bar shows it on a terminal, and an interrupt tells it."""
    reached = ""

    def heard(fraction: float, what: str) -> None:
        nonlocal reached
        reached = f"{fraction:.0%} done ({what})"
        show(fraction, what)

    with interruptible(lambda: reached), bar(quiet) as show:
        yield heard


@contextmanager
def bar(quiet: bool) -> Iterator[Callable[[float, str], None]]:
    """Bar on standard error, on a terminal only."""
    if quiet or not sys.stderr.isatty():
        yield lambda *_: None
        return
    with typer.progressbar(length=1000, file=sys.stderr, show_eta=False) as bar:

        def report(fraction: float, what: str) -> None:
            bar.label = one_line(what)
            bar.update(max(0, int(1000 * fraction) - bar.pos))

        yield report


@contextmanager
def interruptible(said: Callable[[], str]) -> Iterator[None]:
    """Let an interrupt tell how far a command came, what is kept, and how to go on."""
    try:
        yield
    except KeyboardInterrupt as stopped:
        if text := said():
            stopped.add_note(text)
        raise


def loaded(path: str, changes: Sequence[str] = ()) -> "Spec":
    """Spec of a file. Its text is parsed before heavy modules are imported, so that a typing error is told at once."""
    from obsdesign.sections.source import read

    document = read(path, changes)
    from obsdesign.reading.resolve import resolve

    return resolve(document)


def taken(path: str, changes: Sequence[str] = ()) -> "Spec | str":
    """Spec of a file, or the path of a result file."""
    return path if path.endswith(".json") else loaded(path, changes)


def solved(problem: "Spec", solver: str, quiet: bool) -> "Design":
    """Design of a spec."""
    from obsdesign.work import solve

    with progress(quiet) as report:
        return solve(problem, solver, report)


def ran(design: "Design", quiet: bool) -> "Run":
    """Run of a design, with what is to be known of it before and after."""
    tell(() if quiet or design.elsewhere else [*design.spec.starts_outside()])
    with progress(quiet) as report:
        run = design.simulate(lambda done: report(done, "simulation"))
    if run.status != "done" and not quiet:
        say(f"the run ended early: {run.status} at t = {run.time:.6g} s", err=True)
    tell(() if quiet else design.unmet(run.summary))
    return run


def drawn(run: "Run", figure: str, every: bool) -> tuple[bytes, bytes]:
    """Samples of a run, and its figure in the form that its path asks for; with every panel, or those that answer."""
    from obsdesign.files import csv
    from obsdesign.plot import form_of, run_figure

    return csv(*run.table()), run_figure(run, every=every, form=form_of(figure))


def failing(step: Callable[[], None]) -> ObsdesignError | None:
    """Error of a step that follows a result, which is told all the same."""
    try:
        step()
    except TimeLimitError:
        raise
    except ObsdesignError as error:
        return error
    return None


def stem(path: str) -> str:
    """Name of a spec or of its gains file, without folder and endings."""
    name = "stdin" if path == "-" else Path(path).name
    return name.removesuffix(".gains.json") if name.endswith(".gains.json") else Path(name).stem
