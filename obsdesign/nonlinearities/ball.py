"""Nonlinearities near a linear map."""

from obsdesign.lmi.formula import Array, identity
from obsdesign.model.multiplier import Multiplier, Scaled
from obsdesign.nonlinearities.sizes import require_shape


def ball(data: tuple[Array, Array], nq: int, nf: int) -> Multiplier:
    """|df - K dq| <= |W dq|:  M = lambda [[W'W - K'K, K'], [K, -I]].

    Parameters
    ----------
    data
        K (nf, nq), the member of the class, and W (any number of rows, nq).

    Raises
    ------
    UsageError
        K or W has another size.
    """
    K, W = data
    require_shape("ball: K", K, nf, nq)
    require_shape("ball: W", W, len(W), nq)
    return Multiplier((Scaled(K, W.mT @ W - K.mT @ K, K.mT, -identity(nf, K)),))
