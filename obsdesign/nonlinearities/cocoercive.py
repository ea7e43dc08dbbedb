"""Cocoercive nonlinearities: gradients of smooth convex functions, saturations, softmax."""

import numpy as np
from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import rational
from obsdesign.model.multiplier import Multiplier, Scaled
from obsdesign.nonlinearities.data import Constant
from obsdesign.nonlinearities.evidence import automatic
from obsdesign.nonlinearities.template import Template, require_as_many


def cocoercive(k: fmpq, nq: int, nf: int) -> Multiplier:
    """Monotone and Lipschitz in one, dq'df >= df'df / k:  M = lambda [[0, I], [I, -2/k I]].

    The gradient of a convex function is so exactly if its Lipschitz constant is k (Baillon and Haddad, 1977); for a
    scalar f it is a slope in [0, k].

    Raises `UsageError`: nf is not nq, or k <= 0.
    """
    require_as_many("cocoercive", nq, nf)
    if k <= 0:
        raise UsageError(f"cocoercive: the constant is {k}; it must be positive", id="OBS404")
    M = np.array([[fmpq(0), fmpq(1)], [fmpq(1), -2 / k]], dtype=object)
    return Multiplier((Scaled.of(np.kron(M, rational(np.eye(nq))), nq),))


COCOERCIVE = Template(
    cocoercive,
    Constant("dq'df >= df'df / cocoercive; or auto", "> 0", "2"),
    inequalities=(("dq' df - df' df / k", fmpq(1, 2)),),
    derive=automatic.cocoercive,
    slopes=lambda k, nq: [(fmpq(0), k)] * nq,
    lipschitz=True,
)
