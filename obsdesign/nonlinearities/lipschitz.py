"""Lipschitz nonlinearities."""

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import block_diagonal, rational
from obsdesign.model.multiplier import Multiplier, Scaled


def lipschitz(k: fmpq, nq: int, nf: int) -> Multiplier:
    """|df| <= k |dq|:  M = lambda [[k^2 I, 0], [0, -I]]."""
    M = block_diagonal([k * k * rational(np.eye(nq)), -rational(np.eye(nf))])
    return Multiplier((Scaled.of(M, nq),))
