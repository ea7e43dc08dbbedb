"""`obsdesign verify`: the claim of a result file, proved anew."""

from typing import Annotated

import typer

from obsdesign.cli.problems import reported
from obsdesign.cli.program import AsJson, Quiet, Timeout
from obsdesign.cli.steps import loaded
from obsdesign.errors import Problem, UndecidedError
from obsdesign.watch import limited


def verify(
    gains: Annotated[str, typer.Argument(metavar="GAINS.json", help="Result file of `solve`; - is standard input.")],
    spec: Annotated[str, typer.Argument(metavar="[SPEC]", help="The spec it must belong to.")] = "",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Prove the claim of a gains file anew, or that there is no solution; exactly and without a solver."""
    with limited(timeout):
        problem = loaded(spec) if spec else None
        from obsdesign import work
        from obsdesign.files import checks

        proof = work.verify(gains, problem)
    rows = checks(proof.checks)
    if not as_json and not quiet:
        for row in rows:
            typer.echo(f"{'holds' if row['holds'] else 'FAILS'}  {row['name']}")
        if proof.numerical:
            typer.echo(f"numerical, no part of what is proved: {', '.join(proof.numerical)}")
        typer.echo(f"{'proved' if proof.holds else 'NOT proved'}: {proof.claim}")
    report = {"proved": proof.holds, "claim": proof.claim, "checks": rows, "numerical": list(proof.numerical)}
    with reported(report, as_json):
        if not proof.holds:
            failed = ", ".join(repr(row["name"]) for row in rows if not row["holds"])
            raise UndecidedError(Problem(f"the claim is not proved: {failed}", gains, id="OBS708"))
