"""`obsdesign lipschitz`: Lipschitz constants between two proved bounds."""

from typing import Annotated

import typer

from obsdesign.cli.program import AsJson, Changes, Quiet, SpecPaths, Timeout
from obsdesign.cli.sources import Answer, each, found
from obsdesign.cli.steps import as_text, failing, loaded
from obsdesign.watch import limited


def lipschitz(
    specs: SpecPaths,
    changes: Changes = [],  # noqa: B006
    scaling: Annotated[
        bool, typer.Option("--scaling", help="Search coordinates T x, f taken as any function of the states.")
    ] = False,
    T: Annotated[str, typer.Option("--T", help="Diagonal of a T to try instead: 1,1,4,0.1.")] = "",
    timeout: Timeout = 600,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Prove bounds of the Lipschitz constant of every f of a spec on its region."""

    def answer(spec: str) -> Answer:
        problem = loaded(spec, changes)
        from obsdesign import work
        from obsdesign.constants import require_finite
        from obsdesign.tables.constants import constants_table

        report = work.lipschitz(problem, scaling=scaling, T=T.split(",") if T else None)
        text = as_text(report) if as_json else "" if quiet else constants_table(report)
        return Answer(text, failure=failing(lambda: require_finite(report)))

    with limited(timeout):
        each(found(specs), answer, as_json=as_json)
