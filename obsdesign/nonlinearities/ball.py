"""Nonlinearities near a linear map."""

from flint import fmpq

from obsdesign.lmi.formula import Array, identity
from obsdesign.model.multiplier import Multiplier, Scaled
from obsdesign.nonlinearities.data import Matrices
from obsdesign.nonlinearities.template import Template, require_shape
from obsdesign.sections.forms import MATRIX, Entries, Section, key, required


def ball(data: tuple[Array, Array], nq: int, nf: int) -> Multiplier:
    """|df - K dq| <= |W dq|:  M = lambda [[W'W - K'K, K'], [K, -I]].

    `data`: K (nf, nq), the member of the class, and W (any number of rows, nq). Raises `UsageError`: K or W has another
    size.
    """
    K, W = data
    require_shape("ball: K", K, nf, nq)
    require_shape("ball: W", W, len(W), nq)
    return Multiplier((Scaled(K, W.mT @ W - K.mT @ K, K.mT, -identity(nf, K)),))


class Ball(Section):
    """norm(df - K dq) <= norm(W dq)."""

    K: Entries | None = key(MATRIX, "nf x nq, the centre", otherwise="0", example="[[0.5]]")
    W: Entries = required(MATRIX, "with nq columns, the radius", example="[[0.2]]")


BALL = Template(
    ball,
    Matrices(Ball, "norm(df - K dq) <= norm(W dq)", "{K: 0.5, W: 0.2}", wide=("W",)),
    square=False,
    inequalities=(("|W dq|^2 - |df - K dq|^2", fmpq(1)),),
)
