"""`obsdesign verify`: the claim of a result file, proved anew."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from obsdesign.cli.printing import say
from obsdesign.cli.program import AsJson, Quiet, Timeout
from obsdesign.cli.sources import RESULTS, Answer, each, found
from obsdesign.cli.steps import as_text, loaded, stem
from obsdesign.coq.library import command
from obsdesign.disk import require_ending, require_writable, write_whole
from obsdesign.errors import Problem, UndecidedError, UsageError
from obsdesign.sections.scalars import described
from obsdesign.watch import limited


def verify(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="GAINS.json.. [SPEC]",
            help="Result files, folders of them; - is standard input. After one file: the spec it must belong to.",
        ),
    ],
    specs: Annotated[
        bool,
        typer.Option("--specs", help="Hold each file against the spec at the path that it names, as it stands."),
    ] = False,
    theorem: Annotated[
        str, typer.Option(metavar="coq", help="Write the guarantee as a theorem for this proof assistant.")
    ] = "",
    output: Annotated[
        str, typer.Option("-o", "--output", help="With --theorem, of one file; default: NAME.theorem.v here.")
    ] = "",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Prove the claim of a gains file anew, or that there is no solution; exactly and without a solver."""
    paired = len(sources) == 2 and not sources[1].endswith(".json")
    gains, spec = (sources[:1], sources[1]) if paired else (sources, "")
    files = found(gains, RESULTS)
    require_assistant(theorem, output, files, as_json=as_json)
    with limited(timeout):
        each(
            files,
            lambda file: proved(file, named(file) if specs else spec, targets(file, theorem, output), as_json, quiet),
            as_json=as_json,
        )


def require_assistant(theorem: str, output: str, files: Sequence[str], *, as_json: bool) -> None:
    """Refuse a proof assistant that is not known, and a path of several theorems, or of none, or of two outputs."""
    if theorem not in {"", "coq"}:
        raise UsageError(f"--theorem {theorem}: no file is written for it; allowed: coq", id="OBS904")
    if output and (not theorem or len(files) > 1):
        said = "is for --theorem coq of one result file; leave -o out, and each is written to NAME.theorem.v here"
        raise UsageError(f"-o {output} {said}", id="OBS904")
    if output == "-" and as_json:
        raise UsageError("-o - and --json cannot both be on standard output; name a file", id="OBS904")
    names = [stem(file) for file in files]
    if theorem and (twice := next((name for name in names if names.count(name) > 1), None)):
        said = f"{twice}.theorem.v would be written of several files; verify them one by one, each with -o"
        raise UsageError(said, id="OBS904")


def targets(gains: str, theorem: str, output: str) -> dict[str, str]:
    """Path of the theorem of a result file, and what is said of it; none where none is asked for."""
    if not theorem:
        return {}
    path = output or f"{stem(gains)}.theorem.v"
    require_ending(path, "theorems")
    return {path: require_writable({path: "theorems"}, (gains,))[path]}


def named(gains: str) -> str:
    """Path of the spec that a result file names, as it was typed, below the current folder.

    Raises `UsageError`: there is none, or the gains are of a plant or an observer that `--set` changed.
    """
    from obsdesign.files import ResultFile
    from obsdesign.sections.changes import claimed

    file = ResultFile.open(gains)
    path = file.at("spec", "path")
    if (
        not isinstance(path, str)
        or not Path(os.path.realpath(path)).is_relative_to(Path.cwd())
        or not os.path.isfile(path)
    ):
        said = "is no spec below the current folder; solve it from here, or leave --specs out"
        raise UsageError(Problem(f"{described(path)} {said}", gains, key="spec.path", id="OBS710"))
    if changed := claimed(file.changes()):
        said = f"these gains are of {described(path)} with {', '.join(changed)}, which it does not say"
        raise file.wrong("spec.set", f"{said}; write it there and solve again, or leave --specs out", id="OBS704")
    return str(path)


def proved(gains: str, spec: str, targets: Mapping[str, str], as_json: bool, quiet: bool) -> Answer:
    """What is proved of one file, and its theorem, written where one is asked for."""
    problem = loaded(spec) if spec else None
    from obsdesign import work
    from obsdesign.files import ResultFile, checks

    file = ResultFile.open(gains) if targets else gains  # read once
    proof = work.verify(file, problem)
    rows = checks(proof.checks)
    lines = [f"{'holds' if row['holds'] else 'FAILS'}  {row['name']}" for row in rows]
    if proof.numerical:
        lines.append(f"numerical, no part of what is proved: {', '.join(proof.numerical)}")
    lines.append(f"{'proved' if proof.holds else 'NOT proved'}: {proof.claim}")
    report = {"proved": proof.holds, "claim": proof.claim, "checks": rows, "numerical": list(proof.numerical)}
    for target, told in targets.items() if proof.holds else ():
        report["theorem"] = kept(work.theorem(file, problem), target)
        lines.append(f"theorem for Coq, not compiled  {told}")
        lines.append(f"to compile it: obsdesign theorem --library library; {command('library', target)}")
    text = as_text(report) if as_json else "" if quiet else "\n".join(lines)
    if proof.holds:
        return Answer("" if "-" in targets and not as_json else text)
    failed = ", ".join(repr(row["name"]) for row in rows if not row["holds"])
    return Answer(text, failure=UndecidedError(Problem(f"the claim is not proved: {failed}", gains, id="OBS708")))


def kept(text: str, target: str) -> dict[str, Any]:
    """Write a theorem; what is said of it in JSON."""
    from obsdesign.coq.theorem import stated
    from obsdesign.files import digest

    if target == "-":
        say(text.rstrip())
    else:
        write_whole(target, text.encode())
    found = {"file": target, "sha256": digest(text), "statement": stated(text)}
    return {**found, "accepted": None, "time_s": None}
