"""L-infinity observers: Theorem 1 of Chakrabarty, Corless, Buzzard, Zak and Rundell (2016).

Sufficient conditions for exogenous input estimation in nonlinear systems, American Control Conference. The inequalities
(13a), (13b) say that along the error equations

    V' <= -2 alpha (V - mu1 |v|^2),    |z|^2 <= mu2 V,    z = H e,

(Lemma 1), so that with gamma = sqrt(mu1 mu2), as Definition 2 has it,

    P1  e decays at the rate alpha where v = 0;
    P2  |e(t)| is bounded for every e0 and every bounded v;
    P3  |z(t)| <= gamma |v|_inf from e0 = 0;
    P4  limsup |z(t)| <= gamma |v|_inf from every e0.

The plant may have f in its output (Df), and v may drive a disturbance model: (13a) is (13) of the family l2 with no
weight of z and the supply 2 alpha mu1. Here alpha is a genuine search: 2 alpha P and 2 alpha mu1 compete.

Misprints: (5b) has no derivative on its left; (26) reads L1 = P^-1 Y1; the example (47) has no solution for L2 = 0, the
value that is printed, and gamma = 3.8e-4 contradicts its P: gamma = 1 / sqrt(7.15) for H = I.
"""

from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.dissipation.inequality import EQUATIONS, ONE, Incremental, Theorem
from obsdesign.families.incremental.guarantee import PeakGuarantee
from obsdesign.lmi.formula import Array, Inequality, Values


class Linf(Incremental):
    """Theorem 1, for a fixed alpha; each gain is given or (None) to be found."""

    about = Theorem(
        name="linf",
        guarantee=PeakGuarantee,
        decrease="V' + 2 alpha V - 2 alpha mu1 |v|^2 <= 0",
        gamma="sup|z| <= gamma sup|v| from zero error",
        level="mu1 mu2 <= gamma^2",
        monotone=False,
    )

    def theorem(self, v: Values) -> tuple[Inequality, ...]:
        """(13a), (13b), P > 0 and membership of the multiplier."""
        output = Inequality("|z|^2 <= mu2 V", self.H.mT @ self.H - v["mu2"] * v["P"])
        return (*self.conditions(v, 0 * v["mu1"], 2 * self.alpha * v["mu1"]), output)

    def weights(self, mu: Array) -> Values:
        """mu1 = mu and mu2 = 1, so that P >= H'H and (13a) is linear in mu."""
        return {"mu1": mu, "mu2": ONE}

    def unscaled(self, values: Values, mu: fmpq) -> Values:
        """P / mu and the multiplier / mu."""
        return {name: value / mu for name, value in values.items()}

    def storage_bound(self, P: Array, mu: Array, largest: Any) -> Array:
        """P / mu - p I, times mu."""
        return np.asarray(P - largest * mu * self.eye)

    @staticmethod
    def level_margin(gamma: fmpq, mu1: fmpq, mu2: fmpq) -> fmpq:
        """gamma^2 - mu1 mu2."""
        return gamma * gamma - mu1 * mu2

    @staticmethod
    def statement(gamma: float, alpha: float) -> str:
        """P1 to P4 of Definition 2."""
        return (
            f"(P1) |e(t)| <= sqrt(cond(P)) exp(-{alpha!r} t) |e0| where v = 0; "
            "(P2) e' P e <= max(e0' P e0, mu1 sup|v|^2) at all times; "
            f"(P3) |z(t)| <= {gamma!r} sup|v| from e0 = 0; (P4) limsup |z(t)| <= {gamma!r} sup|v| from every e0; "
            f"for {EQUATIONS}"
        )
