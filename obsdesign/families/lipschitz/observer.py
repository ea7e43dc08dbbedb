"""The observer of a Lipschitz system: a copy of the plant with one injection."""

from collections.abc import Mapping

import numpy as np

from obsdesign.families.incremental import observer as incremental
from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import Array
from obsdesign.spec import Spec


def observer(spec: Spec, gains: Mapping[str, Array]) -> Observer:
    """Observer with the gain L (n, ny), which multiplies y - yhat: L1 = -L, and L2 = 0."""
    none = np.zeros((len(spec.augmented.Cq), len(spec.augmented.C)))
    return incremental.observer(spec, {"L1": -gains["L"], "L2": none})
