"""The observer as equations."""

import numpy as np

from obsdesign.dissipation.analysis import Errors
from obsdesign.expressions import Expression
from obsdesign.families.observer import Copy, Observer, injected
from obsdesign.lmi.formula import printed


def errors(spec, gains):
    """Error systems of it."""
    return Errors.of(spec.augmented, spec.multiplier, spec.H, gains["L1"])


def observer(spec, gains):
    """A copy of the plant with L1 (yhat - y)."""
    plant = spec.augmented
    copy = Copy.of(spec.equations(plant))
    copy = injected(copy, printed(gains["L1"]), printed(np.zeros((len(plant.Cq), len(plant.C)))), plant.outputs)
    states = {copy.twins[name]: Expression.variable(name) for name in copy.dynamics}
    return Observer(
        copy.dynamics, states, spec.inputs, plant.outputs, {**copy.algebraic, **copy.outputs}, twins=copy.twins
    )
