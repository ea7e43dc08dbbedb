"""`obsdesign lipschitz`: Lipschitz constants between two proved bounds."""

from typing import Annotated

import typer

from obsdesign.cli.problems import reported
from obsdesign.cli.program import AsJson, Quiet, SpecPath, Timeout
from obsdesign.cli.steps import loaded
from obsdesign.watch import limited


def lipschitz(
    spec: SpecPath,
    scaling: Annotated[
        bool, typer.Option("--scaling", help="Search coordinates T x, f taken as any function of the states.")
    ] = False,
    T: Annotated[str, typer.Option("--T", help="Diagonal of a T to try instead: 1,1,4,0.1.")] = "",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Prove bounds of the Lipschitz constant of every f of a spec on its region."""
    with limited(timeout):
        problem = loaded(spec)
        from obsdesign import work
        from obsdesign.constants import require_finite
        from obsdesign.tables.constants import constants_table

        report = work.lipschitz(problem, scaling=scaling, T=T.split(",") if T else None)
    if not as_json and not quiet:
        typer.echo(constants_table(report))
    with reported(report, as_json):
        require_finite(report)
