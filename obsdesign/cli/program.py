"""The program: how a command answers, and the arguments that commands share."""

import os
import sys
import warnings
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from obsdesign import __version__
from obsdesign.cli.printing import say, silence
from obsdesign.cli.problems import answer
from obsdesign.errors import ObsdesignError, Problem, UsageError
from obsdesign.watch import INTERRUPTED

MISTAKE: Any = typer.BadParameter.__mro__[1]  # what typer raises of a command line


class Commands(TyperGroup):
    """Group whose commands answer a user's mistake in lines on standard error and with the exit code of the error."""

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **options: Any) -> Any:
        """Read the command line as far as the name of a command; without one typer prints the help."""
        as_json, bare = "--json" in args, not args
        try:
            ctx = super().make_context(info_name, args, *rest, **options)
        except MISTAKE as error:
            if bare:
                raise
            answer(misused(error), as_json=as_json)
        ctx.obj = as_json
        return ctx

    def invoke(self, ctx: Any) -> Any:
        """Run a command."""
        try:
            return super().invoke(ctx)
        except MISTAKE as error:
            answer(misused(error), as_json=ctx.obj)
        except ObsdesignError as error:
            answer(error, as_json=ctx.obj)
        except KeyboardInterrupt as stopped:
            say("; ".join(["interrupted", *getattr(stopped, "__notes__", ())]), err=True)
            raise typer.Exit(INTERRUPTED) from None
        except BrokenPipeError as error:
            raise OSError(error.strerror) from None  # for `main`; typer would say nothing of the one with a number


def misused(error: Any) -> UsageError:
    """What typer says of a command line, in one line."""
    path, said = error.ctx.command_path, error.format_message().rstrip(".").replace("Value error, ", "")
    return UsageError(f"{path}: {said[:1].lower()}{said[1:]}; see {path} --help", id="OBS901")


app = typer.Typer(
    cls=Commands,
    help="Design, prove and simulate state observers for nonlinear systems with unknown inputs.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def tell_version(asked: bool) -> None:
    """Print the version."""
    if asked:
        say(f"obsdesign {__version__}")
        raise typer.Exit


Version = Annotated[bool, typer.Option("--version", help="Show the version.", is_eager=True, callback=tell_version)]


@app.callback()
def options(version: Version = False) -> None:
    """Options of the program itself."""


def known(solver: str) -> str:
    """Name of a solver, if it is one; what needs none costs no import. Raises `UsageError`."""
    if solver.lower() != "clarabel":
        from obsdesign.lmi.solvers import call

        call(solver)
    return solver


SpecPaths = Annotated[
    list[str], typer.Argument(metavar="SPEC..", help="Spec files (YAML), folders of them; - is standard input.")
]
Changes = Annotated[
    list[str],
    typer.Option("--set", metavar="KEY=VALUE", help="Another value of a key, such as observer.alpha=0.5."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only, and with --json the result.")]
PlotAll = Annotated[bool, typer.Option("--plot-all", help="Figure with every panel: all states, inputs, V, ..")]
Solver = Annotated[
    str, typer.Option(help="clarabel, or another that cvxpy has for semidefinite programs.", callback=known)
]
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
        silence(sys.stdout)
        said = f"standard output cannot be written: {error.strerror or error}"
        say(str(Problem(said, id="OBS906")), err=True)
        sys.exit(1)
