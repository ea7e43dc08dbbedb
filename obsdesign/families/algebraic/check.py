"""What is found of the statements of an observer, before it is built."""

from obsdesign.dissipation.engine import Engine
from obsdesign.families.algebraic.claim import Claim
from obsdesign.families.algebraic.identity import Answer
from obsdesign.families.algebraic.request import request_of
from obsdesign.families.finding import Finding, finding
from obsdesign.spec import Spec


def check(spec: Spec, engine: Engine) -> list[Finding]:  # noqa: ARG001
    """Each statement, and whether it is proved."""
    form = request_of(spec).form
    if form is None:
        return []
    return [
        finding(
            "statement",
            verdict.answer is Answer.PROVED,
            verdict.sentence if verdict.answer is Answer.REFUTED else f"{verdict.name}: {verdict.answer}",
            decides=verdict.answer is Answer.REFUTED,
        )
        for verdict in Claim.of(spec, form).verdicts
    ]
