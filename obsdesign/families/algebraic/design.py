"""Observers without an LMI: every statement that one rests on is proved, refuted, or left open."""

from typing import Any

from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families.algebraic.claim import Claim, diagnosis
from obsdesign.families.algebraic.empirical import Empirical, fit
from obsdesign.families.algebraic.find import Found
from obsdesign.families.algebraic.forms import Sought
from obsdesign.families.algebraic.found import sought
from obsdesign.families.algebraic.identity import Answer
from obsdesign.families.algebraic.request import request_of
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.spec import Spec

UNUSED = "every coordinate that was found decays by itself, so that nothing is estimated: the estimator is not used"
WIDER = "try observer.functions, a larger observer.degree, or observer.lambdas"


def design(spec: Spec, engine: Engine) -> Outcome:
    """Observer of a spec, its coordinates found where that is asked, with what was found of its statements."""
    form = request_of(spec).form
    assert form is not None
    notes: tuple[str, ...] = ()
    if isinstance(form, Sought):
        assert spec.typed
        engine.report(0.1, "coordinates")
        asked = form
        form, found, missing = sought(spec.typed, asked)
        if form is None:
            return Outcome(Verdict.INFEASIBLE, diagnosis=not_found(spec, found, missing))
        unused = asked.estimator is not None and form.estimator is None
        notes = (found.sentence, *([UNUSED] if unused else []), *found.remarks)
    engine.report(0.5, "statements")
    claim = Claim.of(spec, form)
    if claim.refuted:
        return Outcome(Verdict.REFUTED, claim=claim, form=form, diagnosis=diagnosis(claim), notes=notes)
    status = Verdict.CERTIFIED if claim.holds else Verdict.UNCERTIFIED
    notes += tuple(verdict.sentence for verdict in claim.verdicts if verdict.answer is Answer.OPEN)
    return Outcome(status, claim=claim, form=form, notes=notes)


def not_found(spec: Spec, found: Found, missing: tuple[str, ...]) -> dict[str, Any]:
    """States that no coordinates of the ansatz give, or constants that no regression holds; and a fitted observer."""
    reason = found.sentence
    if not found.missing:
        names = ", ".join(missing)
        reason = f"no derivative of an output is linear in the constant of {names}, so that nothing estimates it"
    numeric = fitted(spec) if found.missing else None
    told = [
        WIDER,
        *found.remarks,
        *([f"filters whose inverse is fitted are an observer, {numeric.sentence}"] if numeric else []),
    ]
    return {
        "id": "OBS613",
        "condition": "coordinates",
        "reason": reason,
        "missing": list(missing),
        "feasible": {},
        "suggestion": "; ".join(told),
        **({"empirical": numeric.written()} if numeric else {}),
    }


def fitted(spec: Spec) -> Empirical | None:
    """Filters with a fitted inverse; None where the plant gives no bounded domain to fit it on."""
    assert spec.typed
    inputs = spec.typed.equations.inputs
    u = dict(zip(inputs, spec.simulation.u, strict=True)) if spec.simulation else {}
    if len(u) < len(inputs) or (spec.simulation and any(side.text in spec.simulation.recorded for side in u.values())):
        return None
    try:
        return fit(spec.typed, u)
    except (UsageError, UndecidedError):
        return None
