"""The program: how a command answers, and the arguments that commands share."""

import math
import os
import sys
import warnings
from copy import copy
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from obsdesign import __version__
from obsdesign.cli.printing import UnwrittenError, say, silence, spell_out
from obsdesign.cli.problems import answer, without_memory
from obsdesign.errors import ObsdesignError, Problem, UsageError
from obsdesign.watch import INTERRUPTED

MISTAKE: Any = typer.BadParameter.__mro__[1]  # what typer raises of a command line


MEANT = {  # command that does what another word asks for
    "run": "simulate",
    "sim": "simulate",
    "plot": "simulate",
    "design": "solve",
    "synthesize": "solve",
    "validate": "check",
    "lint": "check",
    "prove": "verify",
    "new": "init",
    "create": "init",
    "sweep": "batch",
    "test": "batch",
    "doc": "explain",
    "docs": "explain",
    "help": "explain",
    "man": "explain",
}


class Command(TyperCommand):
    """A command that tells the version too."""

    def get_params(self, ctx: Any) -> Any:
        """Parameters, with --version before --help."""
        version = copy(next(one for one in ctx.find_root().command.params if one.name == "version"))
        version.expose_value = False
        *params, helping = super().get_params(ctx)
        return [*params, version, helping]


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

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command of a name; raises `UsageError` with the one that was meant."""
        if ctx.resilient_parsing or args[0] in self.commands or args[0].startswith("-"):
            return super().resolve_command(ctx, args)
        raise UsageError(no_command(args[0], list(self.commands)), id="OBS901")

    def invoke(self, ctx: Any) -> Any:
        """Run a command."""
        try:
            return super().invoke(ctx)
        except MISTAKE as error:
            answer(misused(error), as_json=ctx.obj)
        except ObsdesignError as error:
            answer(error, as_json=ctx.obj)
        except MemoryError as error:
            answer(without_memory(error), as_json=ctx.obj)
        except KeyboardInterrupt as stopped:
            say("; ".join(["interrupted", *getattr(stopped, "__notes__", ())]), err=True)
            raise typer.Exit(INTERRUPTED) from None
        except OSError as error:
            if isinstance(error, UnwrittenError):
                raise  # for `main`
            if "--help" in sys.argv:  # which typer prints
                raise UnwrittenError(error.strerror) from None
            said = f"the system refuses: {error.strerror or error}"
            answer(UsageError(Problem(said, shown(error.filename), id="OBS915")), as_json=ctx.obj)


def shown(name: Any) -> str:
    """Name of a file as an error of the system has it: a text, bytes, a number, or none."""
    return os.fsdecode(name) if isinstance(name, str | bytes) else ""


def no_command(word: str, known: list[str]) -> str:
    """What is said of a word that is no command, with what was probably meant."""
    from obsdesign.sections.words import nearest

    if os.path.exists(word):
        takers = ", ".join(name for name in ("solve", "simulate", "verify") if name in known)
        return f"obsdesign: {word} is a file; write a command before it, such as {takers}; see obsdesign --help"
    meant = MEANT.get(word.lower()) or nearest(word, known)
    question = f"; did you mean obsdesign {meant}?" if meant else ";"
    return f"obsdesign: there is no command {word}{question} allowed: {', '.join(known)}; see obsdesign --help"


def misused(error: Any) -> UsageError:
    """What typer says of a command line, in one line; an option that is a key of a spec is set otherwise."""
    path = error.ctx.command_path if error.ctx else "obsdesign"
    said = error.format_message().rstrip(".").replace("Value error, ", "")
    sets = error.ctx and any("--set" in one.opts for one in error.ctx.command.params)
    keys = keys_named(error.option_name) if sets and said.startswith("No such option") else []
    said = f"{said.partition(' (')[0]}; of a spec it is set by --set {keys[0]}=VALUE" if keys else said
    return UsageError(f"{path}: {said[:1].lower()}{said[1:]}; see {path} --help", id="OBS901")


def keys_named(option: str) -> list[str]:
    """Keys of a spec of the name of an option, such as observer.alpha of --alpha."""
    from obsdesign.reading import reference

    return [key for key in reference.entries() if option.startswith("--") and key.rpartition(".")[2] == option[2:]]


app = typer.Typer(
    cls=Commands,
    help="Design, prove and simulate state observers for nonlinear systems with unknown inputs.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def tell_version(asked: bool) -> None:
    """Print the version."""
    if asked:
        say(f"obsdesign {__version__}")
        raise typer.Exit


Version = Annotated[
    bool, typer.Option("-V", "--version", help="Show the version.", is_eager=True, callback=tell_version)
]


@app.callback()
def options(version: Version = False) -> None:
    """Options of the program itself."""


def known(solver: str) -> str:
    """Name of a solver, if it is one; what needs none costs no import. Raises `UsageError`."""
    if solver.lower() != "clarabel":
        from obsdesign.lmi.solvers import call

        call(solver)
    return solver


def seconds(limit: float) -> float:
    """A limit of time; one that is no number is in no range."""
    if math.isnan(limit):
        raise typer.BadParameter("nan is no number of seconds")
    return limit


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
Timeout = Annotated[
    float,
    typer.Option(min=1e-3, max=1e9, help="Seconds after which the command gives up.", callback=seconds),
]


def main() -> None:
    """Entry point. Matrices are small: one thread makes runs repeatable, and halves the start-up time."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    spell_out(sys.stdout, sys.stderr)
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # what a library would say of its own
    try:
        if sys.stdout is None:
            raise OSError("it is closed")
        app()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except OSError as error:
        silence(sys.stdout)
        said = f"standard output cannot be written: {error.strerror or error}"
        say(str(Problem(said, id="OBS906")), err=True)
        sys.exit(1)
