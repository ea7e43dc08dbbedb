"""Gamma against |L|: what the curve of this family needs."""

import math
from collections.abc import Callable
from dataclasses import replace

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.bounds import Trade
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import bounded, sized
from obsdesign.dissipation.modes import modes
from obsdesign.families.lipschitz.claim import Claim, held
from obsdesign.families.lipschitz.min_gamma import solve_of
from obsdesign.families.lipschitz.observer import errors
from obsdesign.families.lipschitz.relaxations import S_PROCEDURE, proportions
from obsdesign.families.lipschitz.request import request_of
from obsdesign.families.lipschitz.study import Study
from obsdesign.families.outcome import Outcome
from obsdesign.families.trade import Trader
from obsdesign.lmi.formula import printed
from obsdesign.lmi.solve import Status
from obsdesign.spec import Spec


def trader(spec: Spec, engine: Engine, trade: Trade, design: Callable[[Spec, Engine], Outcome]) -> Trader:
    """Curve of a request; `design`: that of the family."""
    request = request_of(spec)
    parts = proportions(request.lipschitz)
    unit = S_PROCEDURE[request.pace].of(spec.posed, spec.multiplier, parts, spec.H, request.rates[0])
    solve = solve_of(Study(engine, unit, request))

    def least(size: float) -> float:
        answer = bounded(solve, sized(request.bounds, size))
        return math.sqrt(max(answer.objective, 0.0)) if answer.status is Status.OPTIMAL else math.inf

    return Trader(
        spec=spec,
        engine=engine,
        trade=trade,
        design=lambda size: restated(spec, design(replace(spec, observer=request.within(size)), engine)),
        least=least,
        unaided=Errors.of(spec.posed, spec.multiplier, spec.H, modes=modes(spec.period)).energy_gain(),
        errors=lambda gains: errors(spec, gains),
    )


def restated(spec: Spec, made: Outcome) -> Outcome:
    """Outcome with a claim that keeps the bounds of the spec, not those of a point of the curve."""
    if not isinstance(made.claim, Claim):
        return made
    kept = held(request_of(spec), printed(made.gains["L"]), made.claim.certificate, disturbed=spec.disturbed)
    return replace(made, claim=replace(made.claim, bound=kept))
