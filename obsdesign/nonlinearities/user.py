"""A multiplier matrix that the user gives."""

from dataclasses import replace

import numpy as np
from flint import fmpq, fmpq_mat

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import Array, Inequality, rational
from obsdesign.lmi.proof import holds
from obsdesign.model.multiplier import Multiplier, Scaled
from obsdesign.nonlinearities.data import WholeMatrix
from obsdesign.nonlinearities.template import Template, require_shape

REGULARISATION = (fmpq(0), *(fmpq(1, 4**k) for k in range(20)))


def user(M: Array, nq: int, nf: int) -> Multiplier:
    """Any constraint [dq; df]' M [dq; df] >= 0, with one scale: lambda M.

    `M`: symmetric, (nq + nf) square. Raises `UsageError`: M has another size, is not symmetric, or has no linear member
    K: then it has no function that is differentiable anywhere, since its Jacobian would be one.
    """
    size = nq + nf
    require_shape("multiplier: M", M, size, size)
    if np.any(M.mT != M):
        raise UsageError("multiplier: M is not symmetric", id="OBS404")
    return Multiplier((Scaled.of(M, nq, linear_member(Scaled.of(M, nq))),))


def linear_member(given: Scaled) -> Array:
    """Find K with [I; K]' M [I; K] >= 0.

    Zero if it will do, or else K = (r I - M22)^-1 M12' with a small r >= 0: for M22 <= 0 no other K gives
    more than this one in the limit of r = 0.
    """
    if positive(given.M11):
        return given.member
    nf = len(given.M22)
    unit = max(abs(given.M12).max(), abs(given.M22).max()) * rational(np.eye(nf))
    for r in REGULARISATION:
        inner = fmpq_mat(nf, nf, list((r * unit - given.M22).ravel()))
        if inner.det():
            K = np.array(inner.inv().tolist(), dtype=object) @ given.M12.mT
            if positive(replace(given, member=K).shifted().M11):
                return K
    raise UsageError(
        "multiplier: no f was found that satisfies it, not even a linear f = K q; is its sign right?", id="OBS404"
    )


def positive(symmetric: Array) -> bool:
    """Whether a matrix is positive semidefinite, in rationals: a class without this K may be empty."""
    return holds(Inequality("M11 >= 0", -symmetric))


USER = Template(
    user,
    WholeMatrix("M of [dq; df]' M [dq; df] >= 0, (nq + nf) square", "[[0, 1], [1, 0]]"),
    square=False,
    inequalities=(("[dq; df]' M [dq; df]", fmpq(1)),),
)
