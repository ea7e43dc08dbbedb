"""From a request for an observer of a Lipschitz system to certified gains.

The limit is the supremum of the Lipschitz constant, or the infimum of gamma or of a weighted sum, over all gains. It is
not attained as a rule (P becomes singular and the gain unbounded), so that the gains are those of the smallest |L|
within the slack of it, rounded to few digits. What is proved of the rounded ones is the s-procedure, which every
relaxation implies.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.constants import restriction
from obsdesign.dissipation.bounds import Range, require_agreement
from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families.lipschitz.claim import Claim
from obsdesign.families.lipschitz.given_gains import gamma_of, largest_of
from obsdesign.families.lipschitz.max_lipschitz import largest
from obsdesign.families.lipschitz.min_gamma import least_gamma
from obsdesign.families.lipschitz.pareto import scanned, weighed
from obsdesign.families.lipschitz.relaxations import RELAXATIONS, S_PROCEDURE, proportions
from obsdesign.families.lipschitz.request import LipschitzRelaxation, LipschitzRequest, request_of
from obsdesign.families.lipschitz.study import Study
from obsdesign.families.lipschitz.suprema import ceiling
from obsdesign.families.lipschitz.trade import trader
from obsdesign.families.outcome import Outcome, Verdict, finite, limited
from obsdesign.lmi.formula import Array, Exact, approximate, printed
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.nonlinearities.evidence.constant import lipschitz_constant
from obsdesign.spec import Spec


def design(spec: Spec, engine: Engine) -> Outcome:
    """Design, or analyze, the observer that a spec asks for."""
    request = request_of(spec)

    def tolerable(constant: float) -> bool:
        """Whether no block of f is seen to have a larger constant than its share of one."""
        shares = [constant * float(max(block.lipschitz) / max(request.lipschitz)) for block in spec.nonlinearities]
        known = [
            0.0 if block.f is None else lipschitz_constant(restriction(block)).lower for block in spec.nonlinearities
        ]
        return all(lower < share for lower, share in zip(known, shares, strict=True))

    if request.trade and not request.gains:
        return trader(spec, engine, request.trade, design).outcome()
    return design_lipschitz(spec.posed, spec.multiplier, spec.H, request, engine, tolerable)


def design_lipschitz(
    plant: Plant[Exact],
    multiplier: Multiplier,
    H: Array,
    request: LipschitzRequest,
    engine: Engine,
    tolerable: Callable[[float], bool] = bool,
) -> Outcome:
    """Design, or analyze, an observer of a Lipschitz system, with the constant that no gain can exceed.

    `plant`, `multiplier`, `H`: the problem, in rationals, as `Lipschitz.of` takes it; z = H e. Of the multiplier only
    the sizes of its blocks matter: their constants are those of the request; `tolerable`: whether f may have no larger
    constant than one.

    Raises `UsageError`: the limit is infinite, or that of gamma zero, and nothing bounds the gain; bounds that an
    objective does not know; pareto with gains; compare with a range. Raises `UndecidedError`: the solver found neither
    a solution nor that there is none.
    """
    require_agreement(request)
    rates = request.rates
    unit = S_PROCEDURE[request.pace].of(plant, multiplier, proportions(request.lipschitz), H, rates[0])
    most = ceiling(unit) if len(rates) == 1 else None

    def of(relaxation: LipschitzRelaxation) -> Outcome:
        study = Study(engine, unit, replace(request, relaxation=relaxation), tolerable)
        made = replace(designed(study, rates), scaling=study.scaling)
        return made if most is None else replace(made, beyond={**made.beyond, "ceiling": most})

    return compared(of, bool(plant.B.shape[1])) if request.relaxation == "compare" else of(request.relaxation)


def designed(study: Study, rates: Sequence[fmpq]) -> Outcome:
    """Outcome of one relaxation."""
    request, weight = study.request, study.request.weight
    require_agreement(request)
    if isinstance(weight, Range) or isinstance(request.rate, Range):
        return scanned(study, weight.grid() if isinstance(weight, Range) else (weight or fmpq(0),), rates)
    if request.gains:
        return (largest_of if request.objective == "max-lipschitz" else gamma_of)(study, printed(request.gains["L"]))
    blocked = study.obstacle()
    if blocked:
        return Outcome(Verdict.INFEASIBLE, diagnosis=blocked)
    return {"max-lipschitz": largest, "min-gamma": least_gamma, "pareto": weighed}[request.objective](study)


# Every relaxation of one request, side by side


def compared(design: Callable[[LipschitzRelaxation], Outcome], disturbed: bool) -> Outcome:
    """Design of the tightest relaxation that has one, with a row for each.

    `design`: outcome of a relaxation; `disturbed`: whether there is a w. Raises `UsageError` or `UndecidedError`: no
    relaxation has a design, and for this one that is not because there is none.
    """
    rows, outcomes = [], []
    error: UsageError | UndecidedError | None = None
    for relaxation in RELAXATIONS:
        try:
            made = design(relaxation)
        except (UsageError, UndecidedError) as raised:
            error = error or raised
            status = "refused" if isinstance(raised, UsageError) else "undecided"
            said = [" ".join(problem.message.split()) for problem in raised.problems]
            rows.append({"relaxation": relaxation, "status": status, "reason": "; ".join(said)})
            continue
        outcomes.append(made)
        rows.append(row(relaxation, made, disturbed))
    best = next((made for made in outcomes if made.status is Verdict.CERTIFIED), None)
    if best is None and error:
        raise error
    made = best or outcomes[0]
    return replace(made, beyond={**made.beyond, "comparison": rows})


def row(relaxation: str, made: Outcome, disturbed: bool) -> dict[str, Any]:
    """What became of one relaxation; without w its gamma means nothing."""
    found: dict[str, Any] = {"relaxation": relaxation, "status": str(made.status), "limit": finite(made.limit)}
    if isinstance(made.claim, Claim):
        found["certified"] = {
            "lipschitz": approximate(made.claim.lipschitz),
            **({"gamma": approximate(made.claim.certificate.gamma)} if disturbed else {}),
            "L": float(np.linalg.norm(made.gains["L"], 2)),
        }
        found["limit"] = limited(found["limit"], found["certified"])
    if made.diagnosis:
        found["reason"] = made.diagnosis["reason"]
    return found
