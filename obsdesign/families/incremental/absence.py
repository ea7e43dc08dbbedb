"""Why a design is impossible, in the terms of the model, and the exact proofs of it."""

from collections.abc import Mapping
from typing import Any

from flint import fmpq

from obsdesign.dissipation.bounds import Range, ends
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.pace import Pace
from obsdesign.families.finding import enough, hidden_mode
from obsdesign.families.incremental.request import Request, posed, request_of
from obsdesign.families.incremental.samples import at_the_edge, obstacle
from obsdesign.families.incremental.stiffness import QUIET, failing_passivity, rising, too_stiff
from obsdesign.families.outcome import Diagnosis, Proof
from obsdesign.files import ResultFile
from obsdesign.lmi.faces import refutation
from obsdesign.lmi.farkas import Refutation, check
from obsdesign.lmi.formula import Array, Unknown, Values, approximate, in_floats, printed, rational
from obsdesign.lmi.proof import Formula
from obsdesign.model.pencil import System, invariant_zeros, text
from obsdesign.model.structure import accuracy, undetectable
from obsdesign.records import replace
from obsdesign.spec import Spec
from obsdesign.tables.text import at_least

TIGHTER, MEASURED = "a tighter type of the nonlinearity or another measurement", "another measurement"
LOWER = 1 - 1e-6  # share of a rate at which what has no solution has none beyond rounding
LARGE = 16  # order from which nothing is searched that would do instead
CLOSE = 1e-3  # relative, from the edge of what is feasible to what is suggested


def question(family: Incremental, gamma: fmpq | None = None) -> tuple[Formula, tuple[Unknown, ...]]:
    """Inequalities of a family for a gamma, or (None) for any, and their unknowns: what a refutation refutes.

    `family`: in rationals, with L2; L1 may be given.
    """
    p, free = family.plant, [Unknown("mu", (1, 1))] if gamma is None else []
    gains = [Unknown("Y", p.C.mT.shape)] if family.L1 is None else []

    def formula(v: Values) -> Any:
        level = family.weights(v["mu"] if gamma is None else rational([[gamma * gamma]]))
        exact = {name: mu if mu.dtype == object else rational(mu) for name, mu in level.items()}
        return family.theorem({**v, **exact})

    return formula, (Unknown("P", p.A.shape, symmetric=True), *gains, *family.multiplier.unknowns(), *free)


def refuted(family: Incremental, gamma: fmpq | None, multipliers: Mapping[str, Array]) -> Refutation:
    """Decide, with no solver, whether the multipliers of a certificate prove that a family has no solution."""
    return check(*question(family, gamma), multipliers)


def impossible(family: Incremental) -> bool:
    """Whether it is proved that no gain has any gamma at this rate, whatever a solver says; L2 must be given."""
    return family.L2 is not None and refutation(*question(family)) is not None


def absence(family: Incremental, known: dict[str, Any]) -> Diagnosis:
    """`proof` and, where it is exact, `certificate`: not for bounds, nor where the design has L2 to choose as well."""
    if family.L2 is None or "bounds" in known:
        return {"proof": "numerical"}
    gamma = printed(known["gamma"]["asked"]) if "gamma" in known else None
    found = refutation(*question(family, gamma))
    if found is None:
        return {"proof": "numerical"}
    level = {} if gamma is None else {"gamma": str(gamma)}
    return {
        "proof": "exact",
        "certificate": {**found.written(), family.about.pace.key: str(family.about.pace.told(family.rate)), **level},
    }


def read(spec: Spec, file: ResultFile) -> Proof:
    """Prove anew that an infeasible result has no solution, and say what is proved.

    Raises `UsageError`: the file holds no dual certificate: its verdict is numerical or structural; or it is malformed.
    """
    root = ("diagnosis", "certificate")
    request = request_of(spec).printed()
    pace = request.pace
    rate = pace.told(file.number(*root, pace.key))
    family = posed(spec, rate)
    if family.L2 is None:
        raise file.wrong(
            "diagnosis.certificate", "a certificate is for a given L2, and the spec leaves it free", id="OBS707"
        )
    gamma = file.number(*root, "gamma") if "gamma" in file.table(*root) else None
    if gamma is not None and (request.gains or request.level is None):
        raise file.wrong(
            "diagnosis.certificate.gamma", "the spec asks for no gamma, so that one proves nothing of it", id="OBS707"
        )
    if gamma is not None and request.level is not None and gamma < request.level:
        raise file.unasked((request.level, None), *root, "gamma")
    if not covers(request, family, gamma):
        raise file.unasked(request.told, *root, pace.key)
    refutation = refuted(family, gamma, file.matrices(*root, "multipliers"))
    level = "" if gamma is None else f" and gamma = {at_least(gamma)}"
    words = f"{subject(pace)} has no solution at {pace.key} = {approximate(pace.told(rate))!r}{level}"
    words += f", nor at {pace.stronger}" if falls(family, gamma) else ""
    given_level = () if gamma is None else ("gamma",)
    return Proof(words, refutation.checks, used=("kind", pace.key, *given_level, "multipliers", "checks"))


def falls(family: Incremental, gamma: fmpq | None) -> bool:
    """Whether what has no solution at a rate has none at a larger one.

    So it is for any gamma (2 alpha m may grow with alpha), and for a given one where the rate has no other part in it.
    """
    return gamma is None or family.about.monotone


def covers(request: Request, family: Incremental, gamma: fmpq | None) -> bool:
    """Whether no solution at the rate of a family means that there is none at any rate that is asked for."""
    low, high = ends(request.rate)
    return family.rate == low and (low == high or falls(family, gamma))


def why_not(spec: Spec, family: Incremental, largest: float | None, known: dict[str, Any]) -> Diagnosis:
    """Reasons that hold whatever the gains, the most telling first.

    `spec`, `family`: the problem, at the rate that is infeasible, in rationals; `largest`: the largest rate
    that is feasible, if one was found; `known`: what the design knows already, such as a bound that was too tight.

    Returns `reason` in one sentence, `condition` that fails, data of it, `feasible` and a `suggestion`; `proof` is
    "exact" where `certificate` proves that no P, no gain and no multiplier satisfy the inequalities of the family at
    this rate (and at a gamma that was asked for), or else "numerical".
    """
    gamma = printed(known["gamma"]["asked"]) if "gamma" in known else None
    whole = covers(request_of(spec).printed(), family, gamma) and not long_known(in_floats(family))
    proof = absence(family, known) if whole else {"proof": "numerical"}
    return {**reason(spec, family, largest, known), **proof}


def reason(spec: Spec, family: Incremental, largest: float | None, known: dict[str, Any]) -> Diagnosis:
    """Answer without its proof."""
    fixed, pace = in_floats(family), family.about.pace
    named = (f"{pace.key} = ", ", or another model of w")
    if hidden := hidden_mode(fixed.plant, fixed.multiplier.member, fixed.edge, pace, *named) or at_the_edge(fixed):
        return hidden
    if "gamma" in known:
        return out_of_reach(spec, fixed, known["gamma"], largest)
    if known:
        id = "OBS611" if "bounds" in known else "OBS609"
        return {"id": id, "condition": next(iter(known)), "reason": str(next(iter(known.values()))), **known} | {
            "suggestion": "look at new gains: leave `gains` out"
        }
    if told := structural(spec, fixed):
        return told
    if largest is not None:
        only = "a solution was found only" if pace.sampled else "there is a solution only"
        return {
            "id": "OBS602",
            "condition": "decay",
            "reason": f"{pace.said(family.rate)} is too fast: {only} {pace.edge(largest)}" + within_bounds(spec),
            "feasible": {pace.key: pace.told(largest)},
            "suggestion": f"ask for {pace.slower(largest * (1 - 1e-4), 5)}{other(family)}",
        }
    return {
        "id": "OBS603",
        "condition": "inequality",
        "reason": f"{subject(pace)} has no solution at {pace.said(family.rate)}{no_slower(family)}"
        + within_bounds(spec),
        "feasible": {},
        "suggestion": f"{TIGHTER if spec.nonlinearities else MEASURED} may make it feasible" + other(family),
    }


def subject(pace: Pace) -> str:
    """What has no solution, at the beginning of a sentence; that of samples is of no paper."""
    return "the inequality" if pace.sampled else "Theorem 1"


def no_slower(family: Incremental) -> str:
    """That slower decays were tried, if there are any."""
    return f", nor at {family.about.pace.weaker} that was tried" if family.rate else ""


def slower_helps(spec: Spec, family: Incremental) -> bool:
    """Whether the largest rate with a solution tells more than what rules every gain out without a solver.

    Of a large plant it is not searched, which takes minutes.
    """
    if family.plant.n >= LARGE:
        return False
    told = structural(spec, in_floats(family))
    return told is None or told["suggestion"] == QUIET


def long_known(family: Incremental) -> bool:
    """Whether a mode of a large plant is hidden, so that multipliers that refute take minutes and prove no more."""
    return family.plant.n >= LARGE and bool(undetectable(family.plant, family.multiplier.member, family.edge))


def ruled_out(spec: Spec, family: Incremental) -> bool:
    """Whether no gain is possible, without a solver's word, which takes long of large plants; a family in doubles.

    Of a small plant it is so at a slightly lower rate too: at the edge, which doubles do not tell, a solver decides.
    """
    if undetectable(family.plant, family.multiplier.member, family.edge):
        return True
    if family.plant.n >= LARGE:
        return structural(spec, family) is not None
    lower = replace(family, rate=printed(float(family.rate) * LOWER))
    return not family.about.pace.sampled and structural(spec, lower) is not None


def structural(spec: Spec, family: Incremental) -> Diagnosis | None:
    """What rules every gain out without a solver, where it does; a family in doubles."""
    if family.about.pace.sampled:
        return obstacle(spec, family)
    found = too_stiff(family) or failing_passivity(spec, family)
    return found if found or not rising(family) else too_stiff(family.shifted())


def within_bounds(spec: Spec) -> str:
    """Bounds and level that what is said to be feasible keeps; nothing where there are none."""
    request = request_of(spec)
    words = request.bounds.words(posed(spec).about.gain)
    words += [f"gamma <= {float(request.level):g}"] if request.level is not None else []
    return f" within the bounds ({' and '.join(words)})" if words else ""


def other(family: Incremental) -> str:
    """Suggestion of a free L2 where it is fixed."""
    return "; so may another L2, or `L2: free`" if family.L2 is not None and family.about.feedback else ""


def out_of_reach(spec: Spec, family: Incremental, levels: dict[str, float], largest: float | None) -> Diagnosis:
    """Answer that gamma is below what is possible, and which condition of arbitrary accuracy fails.

    `levels`: of gamma, what is asked and the least, over all gains and if there are bounds within them.
    """
    asked, least, request = levels["asked"], levels["least"], request_of(spec)
    searched = isinstance(request.rate, Range) and not family.about.monotone
    known = "that was found" if searched else "possible"
    p, pace = family.plant, family.about.pace
    failing = [] if pace.sampled else [t for t in accuracy(p, family.L2, spec.generator) if not t.holds]
    zeros = () if pace.sampled else invariant_zeros(System(p.A, p.B, p.C, p.D)).values
    slow = [z for z in zeros if 0 > z.real >= -float(family.rate)]
    because = [test.sentence for test in failing]
    if slow:
        at = ", ".join(text(z) for z in slow if z.imag >= 0)
        because.append(f"the zero at lambda = {at} of v to y is no faster than {pace.said(family.rate)}")
    found: Diagnosis = {
        "id": "OBS604",
        "condition": "gamma",
        "reason": f"gamma = {asked:g} was asked for, and the least {known} is {least:.6g}",
        "gamma": levels,
        "feasible": {"gamma": least},
        "suggestion": enough(least, levels.get("bounded"), searched=searched, exact=request.bounds.L1 is None),
    }
    if because:
        found["reason"] += f"; {'; '.join(because)}"
        found["accuracy"] = [{"name": test.name, "sentence": test.sentence, **test.numbers} for test in failing]
    if slow:
        found["zeros"] = [[z.real, z.imag] for z in slow]
    if largest is not None:
        found["feasible"][pace.key] = pace.told(largest)
        found["suggestion"] += f", or {pace.slower(largest * (1 - CLOSE))}, with which there is one"
    return found
