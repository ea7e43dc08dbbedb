"""Observers without an LMI: every statement that one rests on is proved, refuted, or left open."""

from typing import Any

from obsdesign.dissipation.engine import Engine
from obsdesign.families.algebraic.claim import Claim
from obsdesign.families.algebraic.identity import Answer
from obsdesign.families.algebraic.request import request_of
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.spec import Spec


def design(spec: Spec, engine: Engine) -> Outcome:  # noqa: ARG001
    """Observer of a spec, with what was found of its statements."""
    form = request_of(spec).form
    assert form is not None
    claim = Claim.of(spec, form)
    if claim.refuted:
        return Outcome(Verdict.REFUTED, claim=claim, form=form, diagnosis=diagnosis(claim))
    status = Verdict.CERTIFIED if claim.holds else Verdict.UNCERTIFIED
    open_ones = [verdict.name for verdict in claim.verdicts if verdict.answer is Answer.OPEN]
    notes = tuple(f"neither proved nor refuted: {name}" for name in open_ones)
    return Outcome(status, claim=claim, form=form, notes=notes)


def diagnosis(claim: Claim) -> dict[str, Any]:
    """What is false, and where."""
    first, *others = claim.refuted
    also = f"; {len(others)} further statements fail" if others else ""
    return {"condition": "identity", "reason": f"{first.sentence}{also}", **first.written(), "feasible": {}}
