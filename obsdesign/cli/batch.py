"""`obsdesign batch`: folders of specs."""

import glob
import os
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from obsdesign.cli.follow import followed
from obsdesign.cli.printing import say
from obsdesign.cli.program import AsJson, Quiet, Solver, seconds
from obsdesign.errors import Problem, UsageError

if TYPE_CHECKING:
    from obsdesign.batches import Summary


class Format(StrEnum):
    """What other programs read."""

    JUNIT = "junit"
    GITHUB = "github"
    SARIF = "sarif"
    JSON = "json"


KINDS = {Format.JUNIT: "JUnit XML", Format.GITHUB: "annotations", Format.SARIF: "SARIF", Format.JSON: "summaries"}
MERGING = {"merge", "out", "form", "output_file", "as_json", "quiet"}  # options that a merge heeds


def batch(
    ctx: typer.Context,
    paths: Annotated[list[str], typer.Argument(metavar="PATH..", help="Specs, folders of specs, globs.")],
    changes: Annotated[
        list[str],
        typer.Option("--set", metavar="KEY=VALUE,..", help="Another value of a key; of several each combination."),
    ] = [],  # noqa: B006
    out: Annotated[str, typer.Option("--out", help="Folder of all results.")] = "results",
    jobs: Annotated[int, typer.Option(min=0, max=4096, help="Processes; 0: one a core.")] = 0,
    simulate: Annotated[bool, typer.Option("--simulate", help="Simulate too: CSV and PNG beside the gains.")] = False,
    exclude: Annotated[list[str], typer.Option(metavar="GLOB", help="Paths, folders or names to leave out.")] = [],  # noqa: B006
    force: Annotated[bool, typer.Option("--force", help="Redo what is up to date.")] = False,
    fail_fast: Annotated[bool, typer.Option("--fail-fast", help="End with the first not as expected.")] = False,
    shard: Annotated[str, typer.Option(metavar="I/N", help="Every N-th spec, from the I-th.")] = "",
    changed_since: Annotated[str, typer.Option(metavar="DIR|summary.json", help="Skip what is the same there.")] = "",
    memory: Annotated[float, typer.Option(min=0, max=1e9, help="MiB a spec; 0: no limit.")] = 0,
    merge: Annotated[bool, typer.Option("--merge", help="Make one of the results of shards, the PATHs.")] = False,
    form: Annotated[Format | None, typer.Option("--format", help="Print this in place of the table.")] = None,
    output_file: Annotated[str, typer.Option(help="Write what --format asks for to a file.")] = "",
    solver: Solver = "clarabel",
    scheduler: Annotated[str, typer.Option(metavar="tcp://HOST:8786", help="Run on this Dask cluster.")] = "",
    timeout: Annotated[float, typer.Option(min=1e-3, max=1e9, help="Seconds a spec.", callback=seconds)] = 600,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="Say why each is run.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Solve and verify every spec of folders, in parallel, and only where it is due; hold each to its `expect:`."""
    from obsdesign import batches
    from obsdesign.disk import remove_earlier

    require_together(ctx)
    kept = require_replaceable(output_file, form, paths, [out, changed_since, *(paths if merge else ())])
    with missed(form, output_file):
        if merge:
            with batches.held(out) as folder:
                remove_earlier(output_file)
                summary = batches.merge(paths, folder)
        else:
            tell_unmatched(paths, [] if quiet else exclude)
            with followed(quiet, verbose, output_file) as follower:
                summary = batches.batch(
                    paths,
                    changes=changes,
                    out=out,
                    jobs=jobs or None,
                    simulate=simulate,
                    exclude=exclude,
                    force=force,
                    fail_fast=fail_fast,
                    shard=shard or None,
                    changed_since=changed_since or None,
                    timeout=timeout,
                    memory=memory or None,
                    solver=solver,
                    scheduler=scheduler or None,
                    follower=follower,
                )
    told(summary, "json" if as_json and not form else form, output_file, kept, as_json=as_json, quiet=quiet)
    raise typer.Exit(summary.exit_code)


def require_together(ctx: typer.Context) -> None:
    """Refuse options that do not go together; raises `UsageError`."""
    options = {str(one.name): max(one.opts, key=len) for one in ctx.command.params if one.opts[0].startswith("-")}
    given = [name for name in options if getattr(ctx.get_parameter_source(name), "name", "") == "COMMANDLINE"]
    if "output_file" in given and "form" not in given:
        raise UsageError("--output-file: nothing to write; --format says what", id="OBS904")
    if {"as_json", "form"} <= {*given} and "output_file" not in given:
        raise UsageError("--json and --format are both printed; write one with --output-file", id="OBS904")
    if "merge" in given and (idle := [options[name] for name in given if name not in MERGING]):
        said = f"{', '.join(idle)}: --merge runs no spec, and would ignore this; leave it out"
        raise UsageError(said, id="OBS904")


def require_replaceable(output_file: str, form: Format | None, paths: list[str], folders: list[str]) -> str:
    """Refuse a path at which a spec, a result or a summary in one of the folders would be lost; raises `UsageError`.

    Returns what is to be said of the path, if there is one.
    """
    if form is None or not output_file:
        return ""
    from obsdesign.batches.find import matches
    from obsdesign.batches.record import is_result
    from obsdesign.disk import require_writable

    if is_result(output_file, filter(None, folders)):
        said = "has the name of a result, and would stand in its place; name another"
        raise UsageError(Problem(said, output_file, id="OBS904"))
    read = [one for path in paths for one in (matches(path) if glob.has_magic(path) else [path])]
    return require_writable({output_file: KINDS[form]}, read=read)[output_file]


def tell_unmatched(paths: list[str], exclude: list[str]) -> None:
    """Say which patterns leave no spec out."""
    from obsdesign.batches.find import unmatched
    from obsdesign.batches.table import shown

    for pattern in unmatched(paths, exclude):
        say(f"--exclude {shown(pattern)}: leaves nothing out; no spec below the paths matches", err=True)


@contextmanager
def missed(form: str | None, output_file: str) -> Iterator[None]:
    """Say, where a batch is refused as a whole, that what another program waits for is not written.

    Where it is interrupted, however early, nothing of an earlier one is left to that program.
    """
    from obsdesign.disk import remove_earlier

    try:
        yield
    except KeyboardInterrupt:
        remove_earlier(output_file)
        raise
    except UsageError as error:
        if form is None:
            raise
        earlier = "; the file is of an earlier batch" if os.path.exists(output_file) else ""
        said = f"--format {form}: nothing is written{earlier}"
        raise UsageError(*error.problems, Problem(said, output_file, id=error.problems[0].id)) from None


def told(summary: "Summary", form: str | None, output_file: str, kept: str, *, as_json: bool, quiet: bool) -> None:
    """Print a summary, or write it, in the form that is asked for; where GitHub runs this, also as its annotations.

    `kept`: what is said of the file.
    """
    from obsdesign.batches.formats import FORMATS, github
    from obsdesign.batches.table import rows
    from obsdesign.disk import write_whole

    if os.environ.get("GITHUB_ACTIONS") == "true" and form != "github":
        for line in github(summary):
            say(line, nl=False, err=True, obeyed=True)
    if form and output_file:
        write_whole(output_file, "".join(FORMATS[form](summary)).encode())
        form = "json" if as_json else None
    if form:
        for line in FORMATS[form](summary):
            say(line, nl=False, obeyed=form == "github")
    elif not quiet:
        for row in rows(summary):
            say(row)
        if kept:
            say(f"file  {kept}")
