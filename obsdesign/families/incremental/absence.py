"""Why a design is impossible, in the terms of the model, and the exact proofs of it."""

from collections.abc import Mapping
from typing import Any

from flint import fmpq

from obsdesign.dissipation.bounds import Range, ends
from obsdesign.dissipation.inequality import Incremental
from obsdesign.families.finding import enough, hidden_mode
from obsdesign.families.incremental.request import Request, request_of
from obsdesign.families.incremental.stiffness import failing_passivity, too_stiff
from obsdesign.families.incremental.theorems import THEOREMS
from obsdesign.families.outcome import Diagnosis, Proof
from obsdesign.files import ResultFile
from obsdesign.lmi.faces import refutation
from obsdesign.lmi.farkas import Refutation, check
from obsdesign.lmi.formula import Array, Unknown, Values, approximate, in_floats, printed, rational
from obsdesign.lmi.proof import Formula
from obsdesign.model.pencil import System, invariant_zeros, text
from obsdesign.model.structure import accuracy
from obsdesign.spec import Spec
from obsdesign.tables.text import at_least

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
    """Whether it is proved that no gain has any gamma at this alpha, whatever a solver says; L2 must be given."""
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
    return {"proof": "exact", "certificate": {**found.written(), "alpha": str(family.alpha), **level}}


def read(spec: Spec, file: ResultFile) -> Proof:
    """Prove anew that an infeasible result has no solution, and say what is proved.

    Raises `UsageError`: the file holds no dual certificate: its verdict is numerical or structural; or it is malformed.
    """
    root = ("diagnosis", "certificate")
    request, alpha = request_of(spec).printed(), file.number(*root, "alpha")
    given = {"L1": None, "L2": request.L2} | dict(request.gains or {})
    family = THEOREMS[request.type](spec.augmented, spec.multiplier, spec.H, alpha, given["L1"], given["L2"])
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
        raise file.unasked(ends(request.alpha), *root, "alpha")
    refutation = refuted(family, gamma, file.matrices(*root, "multipliers"))
    level = "" if gamma is None else f" and gamma = {at_least(gamma)}"
    words = f"Theorem 1 has no solution at alpha = {approximate(alpha)!r}{level}"
    words += ", nor at a larger alpha" if falls(family, gamma) else ""
    given_level = () if gamma is None else ("gamma",)
    return Proof(words, refutation.checks, used=("kind", "alpha", *given_level, "multipliers", "checks"))


def falls(family: Incremental, gamma: fmpq | None) -> bool:
    """Whether what has no solution at an alpha has none at a larger one.

    So it is for any gamma (2 alpha m may grow with alpha), and for a given one where alpha has no other part in it.
    """
    return gamma is None or family.about.monotone


def covers(request: Request, family: Incremental, gamma: fmpq | None) -> bool:
    """Whether no solution at the alpha of a family means that there is none at any alpha that is asked for."""
    low, high = ends(request.alpha)
    return family.alpha == low and (low == high or falls(family, gamma))


def why_not(spec: Spec, family: Incremental, largest_alpha: float | None, known: dict[str, Any]) -> Diagnosis:
    """Reasons that hold whatever the gains, the most telling first.

    `spec`, `family`: the problem, at the alpha that is infeasible, in rationals; `largest_alpha`: the largest alpha
    that is feasible, if one was found; `known`: what the design knows already, such as a bound that was too tight.

    Returns `reason` in one sentence, `condition` that fails, data of it, `feasible` and a `suggestion`; `proof` is
    "exact" where `certificate` proves that no P, no gain and no multiplier satisfy the inequalities of the family at
    this alpha (and at a gamma that was asked for), or else "numerical".
    """
    gamma = printed(known["gamma"]["asked"]) if "gamma" in known else None
    whole = covers(request_of(spec).printed(), family, gamma)
    proof = absence(family, known) if whole else {"proof": "numerical"}
    return {**reason(spec, family, largest_alpha, known), **proof}


def reason(spec: Spec, family: Incremental, largest_alpha: float | None, known: dict[str, Any]) -> Diagnosis:
    """Answer without its proof."""
    fixed, alpha = in_floats(family), float(family.alpha)
    named = ("alpha = ", "alpha", ", or another model of w")
    if hidden := hidden_mode(fixed.plant, fixed.multiplier.member, alpha, *named):
        return hidden
    if "gamma" in known:
        return out_of_reach(spec, fixed, known["gamma"], largest_alpha)
    if known:
        id = "OBS611" if "bounds" in known else "OBS609"
        return {"id": id, "condition": next(iter(known)), "reason": str(next(iter(known.values()))), **known} | {
            "suggestion": "look at new gains: leave `gains` out"
        }
    structural = too_stiff(fixed) or failing_passivity(spec, fixed)
    if structural:
        return structural
    if largest_alpha is not None:
        return {
            "id": "OBS602",
            "condition": "decay",
            "reason": f"alpha = {alpha:g} is too fast: there is a solution only up to alpha = {largest_alpha:.5g}"
            + within_bounds(spec),
            "feasible": {"alpha": largest_alpha},
            "suggestion": f"ask for alpha at most {at_least(largest_alpha * (1 - 1e-4), 5)}{other(family)}",
        }
    return {
        "id": "OBS603",
        "condition": "inequality",
        "reason": f"Theorem 1 has no solution at alpha = {alpha:g}, nor at any smaller alpha that was tried"
        + within_bounds(spec),
        "feasible": {},
        "suggestion": "a tighter type of the nonlinearity or another measurement may make it feasible" + other(family),
    }


def within_bounds(spec: Spec) -> str:
    """Bounds and level that what is said to be feasible keeps; nothing where there are none."""
    request = request_of(spec)
    words = request.bounds.words("L1")
    words += [f"gamma <= {float(request.level):g}"] if request.level is not None else []
    return f" within the bounds ({' and '.join(words)})" if words else ""


def other(family: Incremental) -> str:
    """Suggestion of a free L2 where it is fixed."""
    return "" if family.L2 is None else "; so may another L2, or `L2: free`"


def out_of_reach(spec: Spec, family: Incremental, levels: dict[str, float], largest_alpha: float | None) -> Diagnosis:
    """Answer that gamma is below what is possible, and which condition of arbitrary accuracy fails.

    `levels`: of gamma, what is asked and the least, over all gains and if there are bounds within them.
    """
    asked, least, request = levels["asked"], levels["least"], request_of(spec)
    searched = isinstance(request.alpha, Range) and not family.about.monotone
    known = "that was found" if searched else "possible"
    failing = [test for test in accuracy(family.plant, family.L2, spec.generator) if not test.holds]
    p = family.plant
    slow = [z for z in invariant_zeros(System(p.A, p.B, p.C, p.D)).values if 0 > z.real >= -float(family.alpha)]
    because = [test.sentence for test in failing]
    if slow:
        at = ", ".join(text(z) for z in slow if z.imag >= 0)
        because.append(f"the zero at lambda = {at} of v to y is no faster than alpha = {float(family.alpha):g}")
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
    if largest_alpha is not None:
        found["feasible"]["alpha"] = largest_alpha
        found["suggestion"] += f", or alpha at most {at_least(largest_alpha * (1 - CLOSE), 4)}, with which there is one"
    return found
