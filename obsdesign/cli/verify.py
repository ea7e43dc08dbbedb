"""`obsdesign verify`: the claim of a result file, proved anew."""

import os
from pathlib import Path
from typing import Annotated

import typer

from obsdesign.cli.program import AsJson, Quiet, Timeout
from obsdesign.cli.sources import RESULTS, Answer, each, found
from obsdesign.cli.steps import as_text, loaded
from obsdesign.cli.theorems import Export
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
    compiled: Annotated[
        bool,
        typer.Option("--compile", help="With --theorem coq: have it checked by coqc, and record that in the file."),
    ] = False,
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Prove the claim of a gains file anew, or that there is no solution; exactly and without a solver."""
    paired = len(sources) == 2 and not sources[1].endswith(".json")
    gains, spec = (sources[:1], sources[1]) if paired else (sources, "")
    files = found(gains, RESULTS)
    export = Export(theorem, output, compiled)
    export.require(files, as_json=as_json)
    with limited(timeout):
        each(
            files,
            lambda file: proved(file, named(file) if specs else spec, export, as_json, quiet),
            as_json=as_json,
        )


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


def proved(gains: str, spec: str, export: Export, as_json: bool, quiet: bool) -> Answer:
    """What is proved of one file, and its theorem, written where one is asked for."""
    problem, target = loaded(spec) if spec else None, export.target(gains)
    from obsdesign import work
    from obsdesign.files import ResultFile, checks

    file = ResultFile.open(gains) if target else gains  # read once
    proof = work.verify(file, problem)
    rows = checks(proof.checks)
    lines = [f"{'holds' if row['holds'] else 'FAILS'}  {row['name']}" for row in rows]
    if proof.numerical:
        lines.append(f"numerical, no part of what is proved: {', '.join(proof.numerical)}")
    lines.append(f"{'proved' if proof.holds else 'NOT proved'}: {proof.claim}")
    report = {"proved": proof.holds, "claim": proof.claim, "checks": rows, "numerical": list(proof.numerical)}
    failure: UndecidedError | None = None
    if target and isinstance(file, ResultFile) and proof.holds:
        from obsdesign.cli.exported import exported

        made = exported(file, work.theorem(file, problem), *target, compiled=export.compiled)
        report["theorem"], failure = made.report(), made.failure
        lines += made.lines()
    text = as_text(report) if as_json else "" if quiet else "\n".join(lines)
    if proof.holds:
        on_output = target is not None and target[0] == "-" and not as_json
        return Answer("" if on_output else text, failure=failure)
    failed = ", ".join(repr(row["name"]) for row in rows if not row["holds"])
    return Answer(text, failure=UndecidedError(Problem(f"the claim is not proved: {failed}", gains, id="OBS708")))
