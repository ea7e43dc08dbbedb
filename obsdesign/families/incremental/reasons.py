"""Why a design is impossible, in the terms of the model, and what would be possible."""

from typing import Any

from obsdesign.dissipation.inequality import Incremental
from obsdesign.families.finding import hidden_mode
from obsdesign.families.incremental.absence import absence
from obsdesign.families.incremental.stiffness import failing_passivity, too_stiff
from obsdesign.families.outcome import Diagnosis
from obsdesign.lmi.formula import in_floats
from obsdesign.model.pencil import System, invariant_zeros, text
from obsdesign.model.structure import accuracy
from obsdesign.spec import Spec


def why_not(spec: Spec, family: Incremental, largest_alpha: float | None, known: dict[str, Any]) -> Diagnosis:
    """Reasons that hold whatever the gains, the most telling first.

    `spec`, `family`: the problem, at the alpha that is infeasible, in rationals; `largest_alpha`: the largest alpha
    that is feasible, if one was found; `known`: what the design knows already, such as a bound that was too tight.

    Returns `reason` in one sentence, `condition` that fails, data of it, `feasible` and a `suggestion`; `proof` is
    "exact" where `certificate` proves that no P, no gain and no multiplier satisfy the inequalities of the family at
    this alpha (and at a gamma that was asked for), or else "numerical".
    """
    return {**reason(spec, family, largest_alpha, known), **absence(family, known)}


def reason(spec: Spec, family: Incremental, largest_alpha: float | None, known: dict[str, Any]) -> Diagnosis:
    """Answer without its proof."""
    fixed, alpha = in_floats(family), float(family.alpha)
    named = ("alpha = ", "alpha", "alpha", ", or model w otherwise")
    if hidden := hidden_mode(fixed.plant, fixed.multiplier.member, alpha, *named):
        return hidden
    if "gamma" in known:
        return out_of_reach(spec, fixed, known["gamma"])
    if known:
        return {"condition": next(iter(known)), "reason": str(next(iter(known.values()))), **known} | {
            "suggestion": "allow larger bounds" if "bounds" in known else "design new gains: leave `gains` out"
        }
    structural = too_stiff(fixed) or failing_passivity(spec, fixed)
    if structural:
        return structural
    if largest_alpha is not None:
        return {
            "condition": "decay",
            "reason": f"alpha = {alpha:g} is too fast: there is a solution only up to alpha = {largest_alpha:.5g}",
            "feasible": {"alpha": largest_alpha},
            "suggestion": f"ask for alpha at most {largest_alpha * (1 - 1e-4):.5g}{other(family)}",
        }
    return {
        "condition": "inequality",
        "reason": f"Theorem 1 has no solution at alpha = {alpha:g}, nor at any smaller alpha that was tried",
        "feasible": {},
        "suggestion": "a tighter type of the nonlinearity or another measurement may make it feasible" + other(family),
    }


def other(family: Incremental) -> str:
    """Suggestion of a free L2 where it is fixed."""
    return "" if family.L2 is None else "; so may another L2, or `L2: free`"


def out_of_reach(spec: Spec, family: Incremental, levels: dict[str, float]) -> Diagnosis:
    """Answer that gamma is below what is possible, and which condition of arbitrary accuracy fails."""
    asked, least = levels["asked"], levels["least"]
    failing = [test for test in accuracy(family.plant, family.L2, spec.generator) if not test.holds]
    p = family.plant
    slow = [z for z in invariant_zeros(System(p.A, p.B, p.C, p.D)).values if 0 > z.real >= -float(family.alpha)]
    because = [test.sentence for test in failing]
    if slow:
        at = ", ".join(text(z) for z in slow if z.imag >= 0)
        because.append(f"the zero at lambda = {at} of v to y is no faster than alpha = {float(family.alpha):g}")
    found: Diagnosis = {
        "condition": "gamma",
        "reason": f"gamma = {asked:g} was asked for, and the least possible is {least:.6g}",
        "gamma": levels,
        "feasible": {"gamma": least},
        "suggestion": f"ask for gamma above {least:.6g}",
    }
    if because:
        found["reason"] += f"; {'; '.join(because)}"
        found["accuracy"] = [{"name": test.name, "sentence": test.sentence, **test.numbers} for test in failing]
    if slow:
        found["zeros"] = [[z.real, z.imag] for z in slow]
        found["suggestion"] += f", or for alpha below {-max(z.real for z in slow):g}"
    return found
