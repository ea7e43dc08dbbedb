"""Lipschitz nonlinearities."""

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import block_diagonal, rational
from obsdesign.model.multiplier import Multiplier, Scaled
from obsdesign.nonlinearities.data import Constant
from obsdesign.nonlinearities.evidence import automatic
from obsdesign.nonlinearities.evidence.claims import Gain, generators
from obsdesign.nonlinearities.template import Template


def lipschitz(k: fmpq, nq: int, nf: int) -> Multiplier:
    """|df| <= k |dq|:  M = lambda [[k^2 I, 0], [0, -I]]."""
    M = block_diagonal([k * k * rational(np.eye(nq)), -rational(np.eye(nf))])
    return Multiplier((Scaled.of(M, nq),))


LIPSCHITZ = Template(
    lipschitz,
    Constant("norm(df) <= lipschitz norm(dq); or auto", ">= 0", "3.33"),
    square=False,
    derive=automatic.lipschitz,
    slopes=lambda k, nq: [(-k, k)] * nq,
    lipschitz=True,
    conditions=lambda k, multiplier: (Gain(M, k) for M in generators(multiplier)),
)
