"""From a spec to an observer for sporadic measurements: by clock-dependent certificates, or by those of the paper."""

from obsdesign.dissipation.engine import Engine
from obsdesign.families.outcome import Outcome
from obsdesign.families.sporadic.clock.design import ClockDesigner
from obsdesign.families.sporadic.exponential import design_sporadic
from obsdesign.families.sporadic.request import request_of
from obsdesign.spec import Spec


def design(spec: Spec, engine: Engine) -> Outcome:
    """Design, or analyze, the observer that a spec asks for."""
    request = request_of(spec)
    if request.clocked:
        return ClockDesigner(spec.augmented, spec.multiplier, spec.H, request, engine).outcome()
    return design_sporadic(spec.augmented, spec.multiplier, spec.H, request, engine)
