"""Gamma against |L1|: what the curve of this family needs."""

import math
from collections.abc import Callable
from dataclasses import replace

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.bounds import Trade
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import searchable, sized, within
from obsdesign.dissipation.modes import modes
from obsdesign.families.incremental.claim import Claim, held
from obsdesign.families.incremental.observer import errors
from obsdesign.families.incremental.request import posed, request_of
from obsdesign.families.outcome import Outcome
from obsdesign.families.trade import Trader
from obsdesign.lmi.formula import printed
from obsdesign.lmi.solve import Status
from obsdesign.spec import Spec


def trader(spec: Spec, engine: Engine, trade: Trade, design: Callable[[Spec, Engine], Outcome]) -> Trader:
    """Curve of a request; `design`: that of the family."""
    request, search = request_of(spec), searchable(posed(spec))
    unaided = Errors.of(spec.posed, spec.multiplier, spec.H, modes=modes(spec.period))

    def least(size: float) -> float:
        answer = within(engine, search, sized(request.bounds, size))
        return math.sqrt(max(answer.objective, 0.0)) if answer.status is Status.OPTIMAL else math.inf

    return Trader(
        spec=spec,
        engine=engine,
        trade=trade,
        design=lambda size: restated(spec, design(replace(spec, observer=request.within(size)), engine)),
        least=least,
        unaided=unaided.peak_gain() if request.type == "linf" else unaided.energy_gain(),
        errors=lambda gains: errors(spec, gains),
    )


def restated(spec: Spec, made: Outcome) -> Outcome:
    """Outcome with a claim that keeps the bounds of the spec, not those of a point of the curve."""
    if not isinstance(made.claim, Claim):
        return made
    asked = held(request_of(spec).printed(), printed(made.gains["L1"]), made.claim.certificate.gamma)
    return replace(made, claim=replace(made.claim, asked=asked))
