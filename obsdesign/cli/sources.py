"""Commands on one source or on several: files, folders with all below them, and - for standard input."""

import json
import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import typer

from obsdesign.cli.printing import say
from obsdesign.cli.problems import tell, without_memory
from obsdesign.disk import below
from obsdesign.errors import ObsdesignError, Problem, TimeLimitError, UsageError, one_line

SPECS, RESULTS = (".yaml", ".yml"), (".gains.json",)  # endings of files
WORST = (1, 2, 4, 3, 0)  # exit codes, the worst first


class Answer(NamedTuple):
    """What a command says of one source."""

    text: str = ""  # for standard output
    code: int = 0
    failure: ObsdesignError | None = None  # told after the text; its exit code is the one that counts


def each(sources: Sequence[str], answer: Callable[[str], Answer], *, as_json: bool) -> None:
    """Answer for every source, and exit with the worst of the codes.

    The JSON of several is a list with a report of each, which names its `source`; what failed is told in its report, as
    `problems`. Raises what is raised of a source that is the only one; of several, the others go on, but none after the
    limit of time.
    """
    several, reports = len(sources) > 1, []
    codes = list[int]()
    for source in sources:
        try:
            found = answer(source)
        except KeyboardInterrupt as stopped:
            if several:
                stopped.add_note(f"{len(codes)} of {len(sources)} are done, and what they wrote is kept")
            raise
        except (ObsdesignError, MemoryError) as error:
            if not several:
                raise
            found = Answer(failure=without_memory(error) if isinstance(error, MemoryError) else error)
        if as_json and several:
            reports.append({"source": source, **report_of(found)})
        elif as_json and found.failure:
            say(json.dumps(report_of(found), indent=2))
        elif found.text:
            say(f"== {one_line(source)}\n{found.text}\n" if several else found.text, nl=not found.text.endswith("\n"))
        if found.failure:
            tell(found.failure.problems)
        codes.append(found.failure.exit_code if found.failure else found.code)
        if isinstance(found.failure, TimeLimitError):
            break
    if reports:
        say(json.dumps(reports, indent=2))  # a path may hold what is no text: ASCII
    raise typer.Exit(min(codes, key=WORST.index))


def report_of(answer: Answer) -> dict[str, Any]:
    """Report of a source, with the problems of what failed."""
    report: dict[str, Any] = json.loads(answer.text or "{}")
    return report | ({"problems": [one.written() for one in answer.failure.problems]} if answer.failure else {})


def found(sources: Sequence[str], endings: tuple[str, ...] = SPECS) -> list[str]:
    """Sources with the files of these endings below a folder in place of the folder, in the order of their paths.

    Raises `UsageError`: there is none below a folder.
    """
    made: list[str] = []
    for source in sources:
        if not os.path.isdir(source):
            made.append(source)
            continue
        files = [path for path in below(source, endings) if not os.path.basename(path).startswith(".")]
        if not files:
            raise UsageError(
                Problem(f"no file below this folder ends with {' or '.join(endings)}", source, id="OBS903")
            )
        made += sorted(files)
    return list(dict.fromkeys(made))


def require_one(sources: Sequence[str], *options: str) -> None:
    """Refuse options that name one file, where there are several sources; raises `UsageError`."""
    if len(sources) > 1 and any(options):
        raise UsageError(
            f"-o, --plot and --gains go with one source, not with {len(sources)}: leave them out", id="OBS904"
        )


def require_apart(sources: Sequence[str], names: Sequence[str]) -> None:
    """Refuse sources whose files would have the same names; raises `UsageError`."""
    for i, name in enumerate(names):
        if name in names[:i]:
            pair = f"{sources[names.index(name)]} and {sources[i]}"
            said = f"{pair} would both write {name}.*; `obsdesign batch` keeps a folder for each"
            raise UsageError(said, id="OBS904")
