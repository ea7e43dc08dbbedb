"""Filters as equations, in the time of their plant."""

from importlib import import_module

from obsdesign.families.filters.frame import Frame
from obsdesign.families.filters.request import FilterRequest
from obsdesign.families.observer import Observer
from obsdesign.spec import Spec

STATIONARY = "lqe"
MODULES = {"ekf": "extended", "ukf": "unscented", STATIONARY: "stationary"}


def observer(spec: Spec, request: FilterRequest) -> Observer:
    """Filter of a spec.

    Raises `UsageError`: a nonlinearity has no f, or the plant has an algebraic loop, or how it is disturbed is not what
    this filter takes; `InfeasibleError`: there is no stationary gain.
    """
    module, frame = import_module(f"{__package__}.{MODULES[request.type]}"), Frame.of(spec, request)
    made: Observer = (module.of_flow if spec.period is None else module.of_samples)(frame)
    return made
