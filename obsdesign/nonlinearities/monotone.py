"""Monotone (incrementally passive) nonlinearities: q|q|, q^3, gradients of convex functions."""

import numpy as np

from obsdesign.lmi.formula import Array, rational
from obsdesign.nonlinearities.multiplier import Multiplier, Scaled


def monotone(data: None, nq: int, nf: int) -> Multiplier:  # noqa: ARG001
    """dq' df >= 0 (nf = nq):  M = lambda [[0, I], [I, 0]].

    The block M22 is zero, so a design must satisfy an equality in its (f, f) rows.
    """
    assert nf == nq
    passive: Array = rational(np.kron([[0, 1], [1, 0]], np.eye(nq)))
    return Multiplier((Scaled.of(passive, nq),))
