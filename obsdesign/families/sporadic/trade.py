"""Gamma against |L|, or |K| of a reset: what the curve of this family needs.

No convex problem tells the least gamma within a bound, so that each bound that is looked at is a design.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

from flint import fmpq

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.bounds import Trade
from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.families.sporadic.claim import Claim
from obsdesign.families.sporadic.clock.claim import ClockClaim
from obsdesign.families.sporadic.held import held
from obsdesign.families.sporadic.observer import sampled
from obsdesign.families.sporadic.request import request_of
from obsdesign.families.trade import Trader
from obsdesign.lmi.formula import printed
from obsdesign.spec import Spec


def trader(spec: Spec, engine: Engine, trade: Trade, design: Callable[[Spec, Engine], Outcome]) -> Trader:
    """Curve of a request; `design`: that of the family."""
    request = request_of(spec)

    @cache
    def made(size: fmpq) -> Outcome:
        return restated(spec, design(replace(spec, observer=request.within(size)), engine))

    def least(size: float) -> float:
        try:
            found = made(printed(float(f"{size:.3g}")))
        except UndecidedError:
            return math.inf
        if found.status is not Verdict.CERTIFIED or found.claim is None:
            return math.inf
        return float(found.claim.written(spec, {})["guarantee"]["gamma"])

    return Trader(
        spec=spec,
        engine=engine,
        trade=trade,
        design=made,
        least=least,
        unaided=Errors.of(spec.posed, spec.multiplier, spec.H).energy_gain(),
        errors=lambda gains: sampled(spec, gains, None),
    )


def restated(spec: Spec, made: Outcome) -> Outcome:
    """Outcome with a claim that keeps the bounds of the spec, not those of a point of the curve."""
    if not isinstance(made.claim, Claim | ClockClaim):
        return made
    exact = {name: printed(gain) for name, gain in made.gains.items()}
    return replace(made, claim=replace(made.claim, asked=held(request_of(spec), exact)))
