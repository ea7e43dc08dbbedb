"""The observer of a Lipschitz system: a copy of the plant with one injection."""

from collections.abc import Mapping

import numpy as np

from obsdesign.dissipation.analysis import Errors
from obsdesign.families.incremental import observer as incremental
from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import Array
from obsdesign.spec import Spec


def observer(spec: Spec, gains: Mapping[str, Array]) -> Observer:
    """Observer with the gain L (n, ny), which multiplies y - yhat: L1 = -L, and L2 = 0."""
    return incremental.observer(spec, as_incremental(spec, gains))


def errors(spec: Spec, gains: Mapping[str, Array]) -> Errors:
    """Error systems of the observer."""
    return incremental.errors(spec, as_incremental(spec, gains))


def as_incremental(spec: Spec, gains: Mapping[str, Array]) -> dict[str, Array]:
    """Gains L1 and L2 of the same observer."""
    return {"L1": -gains["L"], "L2": np.zeros((len(spec.posed.Cq), len(spec.posed.C)))}
