"""A multiplier matrix that the user gives."""

from obsdesign.lmi.formula import Array
from obsdesign.nonlinearities.multiplier import Multiplier, Scaled


def user(M: Array, nq: int, nf: int) -> Multiplier:  # noqa: ARG001
    """[dq; df]' M [dq; df] >= 0 for the given symmetric M, (nq + nf) square, with one scale: lambda M."""
    return Multiplier((Scaled.of(M, nq),))
