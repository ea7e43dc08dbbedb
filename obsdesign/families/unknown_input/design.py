"""From a request for an unknown-input observer to certified gains: E from the plant, L as the family l2 designs it."""

from dataclasses import replace

from obsdesign.dissipation.engine import Engine
from obsdesign.families.finding import UNDISTURBED
from obsdesign.families.incremental import design as incremental
from obsdesign.families.incremental.claim import Claim as InnerClaim
from obsdesign.families.outcome import Diagnosis, Outcome, Verdict
from obsdesign.families.unknown_input.absence import missing
from obsdesign.families.unknown_input.claim import Claim, cancelling
from obsdesign.families.unknown_input.request import factor, reduced, request_of
from obsdesign.lmi.formula import Exact, in_floats
from obsdesign.spec import Spec

REDUCED = "here A and Bf are T A and T Bf, and L2 = 0"
FREER = "a type of observer with an injection in f (l2 with L2: free), or another type of the nonlinearity"


def design(spec: Spec, engine: Engine) -> Outcome:
    """Design, or analyze, an observer with E and L.

    Raises `UsageError`: the limit of gamma is zero and nothing bounds the gain. Raises `UndecidedError`: the solver
    found neither a solution nor that there is none.
    """
    E = factor(spec)
    if E is None:
        return Outcome(Verdict.INFEASIBLE, diagnosis=missing(spec))
    return found(spec, E, incremental.design(reduced(spec, E), engine))


def found(spec: Spec, E: Exact, made: Outcome) -> Outcome:
    """Outcome of the plant that is left in the terms of the spec."""
    gains, claim, given = {}, None, request_of(spec).gains is not None
    if made.gains:
        gains = {"E": in_floats(E), "L": 0.0 - made.gains["L1"]}
    if isinstance(made.claim, InnerClaim):
        claim = Claim(made.claim.certificate, E, cancelling(spec, E), made.claim.asked)
    names = ", ".join(spec.cancelled)
    alone = f"nothing but {names} acts on this plant, and it is cancelled: the claim is the decay"
    said = [alone] if made.gains else []
    notes = tuple(text for note in made.notes for text in (said if note == UNDISTURBED else [note]))
    return replace(made, gains=gains, claim=claim, notes=notes, diagnosis=told(made.diagnosis, given))


def told(diagnosis: Diagnosis, given: bool) -> Diagnosis:
    """Diagnosis that speaks of no injection L2, which there is not, nor of the plant itself where E is given."""
    if not diagnosis:
        return diagnosis
    reason, instead = str(diagnosis.get("reason", "")), str(diagnosis.get("suggestion", ""))
    if given:
        cure = "leave gains out, so that E follows from the plant, or give another E"
        reason = f"{reason}; that is of what the E that is given leaves of the plant"
        diagnosis = {**diagnosis, "reason": reason, "suggestion": cure}
    elif "L2" in instead:
        diagnosis = {**diagnosis, "suggestion": FREER}
    return {**diagnosis, "reason": f"{reason}; {REDUCED}"} if "L2" in reason else diagnosis
