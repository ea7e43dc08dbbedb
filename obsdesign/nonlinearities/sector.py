"""Nonlinearities in the sector between two linear maps."""

from flint import fmpq

from obsdesign.lmi.formula import Array
from obsdesign.model.multiplier import Multiplier
from obsdesign.nonlinearities.ball import ball
from obsdesign.nonlinearities.data import Matrices
from obsdesign.nonlinearities.template import Template, require_shape
from obsdesign.sections.forms import MATRIX, Entries, Section, key, required


def sector(data: tuple[Array, Array], nq: int, nf: int) -> Multiplier:
    """(df - K1 dq)' (K2 dq - df) >= 0:  M = lambda / 2 [[-K1'K2 - K2'K1, K1' + K2'], [K1 + K2, -2 I]].

    This is the ball of center (K1 + K2) / 2 and radius W = (K2 - K1) / 2. A weight X, (df - K1 dq)' X (K2 dq - df),
    would be no multiplier of this class in general, not even a positive definite one.

    `data`: K1 and K2 (nf, nq); they may be exchanged. Raises `UsageError`: K1 or K2 has another size.
    """
    K1, K2 = data
    require_shape("sector: K1", K1, nf, nq)
    require_shape("sector: K2", K2, nf, nq)
    return ball(((K1 + K2) / 2, (K2 - K1) / 2), nq, nf)


class Sector(Section):
    """(df - K1 dq)' (K2 dq - df) >= 0."""

    K1: Entries | None = key(MATRIX, "nf x nq", otherwise="0", example="[[0.1]]")
    K2: Entries = required(MATRIX, "nf x nq", example="[[2]]")


SECTOR = Template(
    sector,
    Matrices(Sector, "(df - K1 dq)' (K2 dq - df) >= 0", "{K1: 0.1, K2: 2}"),
    square=False,
    inequalities=(("(df - K1 dq)' (K2 dq - df)", fmpq(1)),),
)
