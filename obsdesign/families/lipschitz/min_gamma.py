"""Objective min-gamma: the least gamma at the declared constant."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from flint import fmpq

from obsdesign.dissipation.decimals import round_up
from obsdesign.dissipation.gain import Solve, bounded, excluded, judged, least, rounded_gains, smallest, unjudged
from obsdesign.dissipation.zero import Level, Vanishing, loudness, reached, settled, tabulated, vanishing
from obsdesign.errors import UndecidedError
from obsdesign.families.lipschitz.claim import Claim
from obsdesign.families.lipschitz.given_gains import tolerating
from obsdesign.families.lipschitz.reasons import out_of_reach
from obsdesign.families.lipschitz.relaxations import Lipschitz, Theorem4
from obsdesign.families.lipschitz.study import Study
from obsdesign.families.lipschitz.suprema import cancels
from obsdesign.families.outcome import Outcome, Verdict, bounded_kind
from obsdesign.lmi.formula import Array
from obsdesign.lmi.solve import Status

CANCELS = (
    "L D = B has a solution: a finite gain keeps w from the error, gamma = 0 is attained and nothing is left to do"
)


def least_gamma(study: Study) -> Outcome:
    """Design for the least gamma within the bounds."""
    family = study.attenuation(float(study.declared))
    limit, gap = limit_of(study, family)
    asked = math.inf if study.bounds.gamma is None else float(study.bounds.gamma)
    limits: dict[str, Any] = {
        "limit": {"gamma": limit.gamma, "attained": limit.attained, **gap},
        "beyond": widened(study),
    }
    most = limit.gamma
    if study.restricted:
        answer = settled(study.engine, family, bounded(solve_of(study), study.bounds), study.bounds)
        if answer.status is not Status.OPTIMAL:
            decided, goals = answer.status is Status.INFEASIBLE, {"goal": asked**2, "least": limit.gamma**2}
            return study.out_of_bounds(solve_of, decided=decided, **goals, **limits)
        limit = Level.within(answer, Vanishing(limit.table, limit.instead, limit.attained), study.bounds)
        attained = limit.attained or study.closed
        limits["limit_bounded"] = {"gamma": limit.gamma, "attained": attained, **bounded_kind(study.bounds)}
    if study.restricted and most <= asked < limit.gamma:
        decided = excluded(solve_of(study), study.bounds, asked**2)
        return study.out_of_bounds(solve_of, decided=decided, goal=asked**2, **limits)
    if asked < limit.gamma:
        slower = study.slower(solve_of, asked**2)
        levels = {"asked": asked, "least": most, **({"bounded": limit.gamma} if study.restricted else {})}
        said = "" if slower is None else study.unit.about.pace.slower(slower)
        reason = out_of_reach(levels, float(study.declared), said, exact=study.bounds.L1 is None)
        return Outcome(Verdict.INFEASIBLE, diagnosis=reason, **limits)
    target = min(limit.target(study.slack), asked)
    notes = (CANCELS,) if limit.attained and not limit.gamma and cancels(study.unit.plant) else ()
    central = study.central(target)
    notes = notes if central is None else (*notes, central[2])
    L, claim = central[:2] if central else study.first(small_gains(study, family, study.declared, target))
    if L is None:
        raise UndecidedError(f"no gain was found for gamma = {target:g}", id="OBS507")
    return study.outcome(L, tolerating(study, L, claim), notes=notes, **limits)


def solve_of(study: Study) -> Solve:
    """Least gamma^2 within bounds at the declared constant."""
    return least(study.engine, study.attenuation(float(study.declared)))


def limit_of(study: Study, family: Lipschitz) -> tuple[Level, dict[str, float]]:
    """Least gamma over all gains, and its gap where Riccati equations found it.

    Raises `UsageError`: it falls to zero as the gain grows, and nothing bounds the gain. Raises `UndecidedError`: it
    was not found.
    """
    answer = unjudged(study.engine, family)
    rows = (zero := vanishing(study.engine, family, answer)).table
    answer = answer if rows or zero.instead else judged(study.engine, family, answer)
    if rows and not study.restricted:
        said = "the least gamma is 0, with a gain that grows without bound; choose `bounds: {L: ..}` from this table"
        loud = loudness(study.engine, family, rows, study.noise)
        raise tabulated(f"{said}, or `bounds: auto`, its knee", "L", "gamma", rows, loud)
    if answer.status is not Status.OPTIMAL and not rows and not zero.instead:
        raise UndecidedError(f"the least gamma was not found: {answer.reason}", id="OBS507")
    level = Level.of_all(answer, zero)
    attained = level.attained or (level.gamma > 0 and reached(study.engine, family, level.gamma, study.bounds))
    return replace(level, attained=attained), {} if answer.gap is None else {"gap": round_up(answer.gap, 2)}


def small_gains(study: Study, family: Lipschitz, constant: fmpq, gamma: float) -> Iterator[tuple[Array, Claim | None]]:
    """Gains of small norm that reach a gamma in a family, in more and more digits, and their proofs."""
    for values in smallest(study.engine, family, gamma, study.bounds):
        for L1 in rounded_gains(values, study.bounds):
            yield -L1, study.proved(-L1, constant, gamma, values)


def widened(study: Study) -> dict[str, Any]:
    """Least gamma over all constants from the declared one on, and its constant; where Theorem 3 is not monotone."""
    if study.relaxation != "abbaszadeh":
        return {}
    family = study.attenuation(float(study.declared), Theorem4)
    answer = study.engine.minimise(family.least_gamma())
    if answer.status is not Status.OPTIMAL:
        return {}
    constant = study.constant_of(answer.values["xi"].item())
    return {"widened": {"lipschitz": constant, "gamma": math.sqrt(max(answer.objective, 0.0))}}
