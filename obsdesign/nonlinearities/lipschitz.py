"""Lipschitz nonlinearities."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import block_diagonal, rational
from obsdesign.model.multiplier import Multiplier, Scaled
from obsdesign.nonlinearities.data import Constant
from obsdesign.nonlinearities.evidence import automatic
from obsdesign.nonlinearities.evidence.claims import Claim, Gain, generators
from obsdesign.nonlinearities.evidence.restriction import Restriction
from obsdesign.nonlinearities.template import Slopes, Template


def lipschitz(k: fmpq, nq: int, nf: int) -> Multiplier:
    """|df| <= k |dq|:  M = lambda [[k^2 I, 0], [0, -I]]."""
    M = block_diagonal([k * k * rational(np.eye(nq)), -rational(np.eye(nf))])
    return Multiplier((Scaled.of(M, nq),))


@dataclass(frozen=True)
class Lipschitz(Template):
    """The type, whose constant bounds the norm of the Jacobian."""

    def claims(self, data: Any, multiplier: Multiplier) -> Iterator[Claim]:
        """One inequality between norms."""
        return (Gain(M, data) for M in generators(multiplier))

    def slopes(self, data: Any, nq: int) -> Slopes:
        """At most the constant, either way."""
        return [(-data, data)] * nq

    def constants(self, data: Any, nq: int) -> tuple[fmpq, ...]:  # noqa: ARG002
        """The constant itself."""
        return (data,)

    def proved(self, f: Restriction, data: Any) -> bool:
        """By the slopes of an f_i of q_i only, or by the norm of the Jacobian."""
        return automatic.lipschitz_proved(f, data)


LIPSCHITZ = Lipschitz(
    lipschitz, Constant("norm(df) <= lipschitz norm(dq); or auto", ">= 0"), square=False, derive=automatic.lipschitz
)
