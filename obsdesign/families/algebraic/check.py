"""What is found of the statements of an observer, before it is built."""

from obsdesign.dissipation.engine import Engine
from obsdesign.families.algebraic.claim import Claim
from obsdesign.families.algebraic.design import not_found
from obsdesign.families.algebraic.forms import Sought
from obsdesign.families.algebraic.found import sought
from obsdesign.families.algebraic.identity import Answer
from obsdesign.families.algebraic.request import request_of
from obsdesign.families.finding import Finding, finding
from obsdesign.spec import Spec

OPEN = "a run of `simulate` shows how it goes; a smaller system.domain may allow the proof"


def check(spec: Spec, engine: Engine) -> list[Finding]:  # noqa: ARG001
    """Each statement, and whether it is proved."""
    form = request_of(spec).form
    if isinstance(form, Sought):
        assert spec.typed
        form, found, missing = sought(spec.typed, form)
        if form is None:
            return [finding("coordinates", False, not_found(spec, found, missing)["reason"], decides=True, id="OBS613")]
    assert form is not None
    return [
        finding(
            "statement",
            verdict.answer is Answer.PROVED,
            f"{verdict.name}: proved" if verdict.answer is Answer.PROVED else verdict.sentence,
            decides=verdict.answer is Answer.REFUTED,
            advice="" if verdict.answer is Answer.REFUTED else OPEN,
            id="OBS612",
        )
        for verdict in Claim.of(spec, form).verdicts
    ]
