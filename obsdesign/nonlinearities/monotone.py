"""Monotone (incrementally passive) nonlinearities: q|q|, q^3, gradients of convex functions."""

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import rational
from obsdesign.model.multiplier import Multiplier, Scaled
from obsdesign.nonlinearities.template import Template, require_as_many


def monotone(data: None, nq: int, nf: int) -> Multiplier:  # noqa: ARG001
    """Incremental passivity, dq' df >= 0:  M = lambda [[0, I], [I, 0]].

    The block M22 is zero, so a design must satisfy an equality in its (f, f) rows.

    Raises `UsageError`: nf is not nq.
    """
    require_as_many("monotone", nq, nf)
    return Multiplier((Scaled.of(rational(np.kron([[0, 1], [1, 0]], np.eye(nq))), nq),))


MONOTONE = Template(monotone, inequalities=(("dq' df", fmpq(1, 2)),), slopes=lambda _, nq: [(fmpq(0), None)] * nq)
