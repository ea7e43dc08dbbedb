"""Commands on one source or on several: files, folders with all below them, and - for standard input."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import typer

from obsdesign.cli.program import show
from obsdesign.errors import ObsdesignError, TimeLimitError, UsageError

SPECS, RESULTS = (".yaml", ".yml"), (".gains.json",)  # endings of files
WORST = (1, 2, 4, 3, 0)  # exit codes, the worst first


class Answer(NamedTuple):
    """What a command says of one source."""

    text: str = ""  # for standard output
    code: int = 0
    failure: ObsdesignError | None = None  # told after the text; its exit code is the one that counts


def each(sources: Sequence[str], answer: Callable[[str], Answer], *, as_json: bool) -> None:
    """Answer for every source, and exit with the worst of the codes; the JSON of several is a list.

    Raises what is raised of a source that is the only one; of several, each is told, and the others go on.
    """
    codes, texts = [], []
    for source in sources:
        try:
            found = answer(source)
        except ObsdesignError as error:
            if len(sources) == 1 or isinstance(error, TimeLimitError):
                raise
            found = Answer(failure=error)
        if as_json and len(sources) > 1:
            texts.append(found.text.strip())
        elif found.text:
            typer.echo(
                f"== {source}\n{found.text}\n" if len(sources) > 1 else found.text, nl=not found.text.endswith("\n")
            )
        if found.failure:
            show(found.failure)
        codes.append(found.failure.exit_code if found.failure else found.code)
    if as_json and len(sources) > 1:
        typer.echo("[" + ",\n".join(filter(None, texts)) + "]")
    raise typer.Exit(min(codes, key=WORST.index))


def found(sources: Sequence[str], endings: tuple[str, ...] = SPECS) -> list[str]:
    """Sources with the files of these endings below a folder in place of the folder, in the order of their paths.

    Raises `UsageError`: there is none below a folder.
    """
    made: list[str] = []
    for source in sources:
        if not Path(source).is_dir():
            made.append(source)
            continue
        below = [
            os.path.join(folder, name)
            for folder, _, names in os.walk(source)
            for name in names
            if name.endswith(endings) and not name.startswith(".")
        ]
        if not below:
            raise UsageError(f"{source}: no file below this folder ends with {' or '.join(endings)}")
        made += sorted(below)
    return list(dict.fromkeys(made))


def require_one(sources: Sequence[str], *options: str) -> None:
    """Refuse options that name one file, where there are several sources; raises `UsageError`."""
    if len(sources) > 1 and any(options):
        raise UsageError(f"-o, --plot and --gains go with one source, not with {len(sources)}: leave them out")


def require_apart(sources: Sequence[str], names: Sequence[str]) -> None:
    """Refuse sources whose files would have the same names; raises `UsageError`."""
    for i, name in enumerate(names):
        if name in names[:i]:
            pair = f"{sources[names.index(name)]} and {sources[i]}"
            raise UsageError(f"{pair} would both write {name}.*; `obsdesign batch` keeps a folder for each")
