"""The command line: the only code that prints or exits. Heavy modules are imported by the command that needs them."""

from obsdesign.cli.batch import batch
from obsdesign.cli.check import check
from obsdesign.cli.compare import compare
from obsdesign.cli.diff import diff
from obsdesign.cli.estimate import estimate
from obsdesign.cli.explain import explain
from obsdesign.cli.export import export
from obsdesign.cli.init import init
from obsdesign.cli.lipschitz import lipschitz
from obsdesign.cli.program import Command, app, main
from obsdesign.cli.report import report
from obsdesign.cli.schema import schema
from obsdesign.cli.simulate import simulate
from obsdesign.cli.solve import solve
from obsdesign.cli.theorem import theorem
from obsdesign.cli.tune import tune
from obsdesign.cli.verify import verify

__all__ = ["app", "main"]

for command in (
    init,
    solve,
    simulate,
    batch,
    compare,
    check,
    lipschitz,
    verify,
    theorem,
    estimate,
    tune,
    export,
    diff,
    report,
    schema,
    explain,
):
    app.command(cls=Command)(command)
