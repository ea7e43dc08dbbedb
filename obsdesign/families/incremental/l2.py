"""L2 observers: Theorem 1 of Corless and Chakrabarty, L2 observers for systems with unknown inputs (2019).

The inequality (13) says that along the error equations

    V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 <= 0,    z = H e,

so e decays at the rate alpha where v = 0, and |z|_2 <= sqrt(e0' P e0 / mu1) + gamma |v|_2, gamma = sqrt(mu2 / mu1).

Misprints: Gamma after (14) lacks L2 Df beside D_qf, as section 5.1 has it; in (17) both ratios are upside down,
|e(t)| <= exp(-alpha t) sqrt(b2 / b1) |e0| + sqrt(mu2 / b1) |v|_2 with b1, b2 the extreme eigenvalues of P. The line
search over alpha of Remark 4 is no search: P >= 0 makes every solution at alpha one at any smaller alpha, so the least
gamma never decreases with alpha.
"""

from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.dissipation.guarantee import EnergyGuarantee
from obsdesign.dissipation.inequality import EQUATIONS, ONE, Incremental, Theorem
from obsdesign.lmi.formula import Array, Inequality, Values


class L2(Incremental):
    """Theorem 1, for a fixed alpha; each gain is given or (None) to be found."""

    about = Theorem(
        name="l2",
        guarantee=EnergyGuarantee,
        decrease="V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 <= 0",
        gamma="norm2(z) <= gamma norm2(v) from zero error",
        level="mu2 <= gamma^2 mu1",
        monotone=True,
    )

    def theorem(self, v: Values) -> tuple[Inequality, ...]:
        """(13), P > 0 and membership of the multiplier."""
        return tuple(self.conditions(v, v["mu1"], v["mu2"]))

    def weights(self, mu: Array) -> Values:
        """mu1 = 1 and mu2 = mu."""
        return {"mu1": ONE, "mu2": mu}

    def unscaled(self, values: Values, mu: fmpq) -> Values:  # noqa: ARG002
        """The same: the solver has the claim itself."""
        return values

    def storage_bound(self, P: Array, mu: Array, largest: Any) -> Array:  # noqa: ARG002
        """P - p I."""
        return np.asarray(P - largest * self.eye)

    @staticmethod
    def level_margin(gamma: fmpq, mu1: fmpq, mu2: fmpq) -> fmpq:
        """gamma^2 mu1 - mu2."""
        return gamma * gamma * mu1 - mu2

    @staticmethod
    def statement(gamma: float, alpha: float) -> str:
        """Norms over [0, T], for every T."""
        return (
            f"norm2(z) <= sqrt(e0' P e0 / mu1) + {gamma!r} norm2(v), "
            f"and |e(t)| <= sqrt(cond(P)) exp(-{alpha!r} t) |e0| where v = 0; for {EQUATIONS}"
        )
