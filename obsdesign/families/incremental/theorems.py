"""The inequalities of each family of observers with the gains L1 and L2, in continuous time and of samples."""

from dataclasses import replace

from obsdesign.dissipation.discrete import Discrete
from obsdesign.dissipation.guarantee import EnergyGuarantee, EnergyOfSteps
from obsdesign.dissipation.inequality import EQUATIONS, ONE, Incremental, Theorem
from obsdesign.dissipation.pace import RHO
from obsdesign.families.incremental.guarantee import PeakGuarantee, PeakOfSteps
from obsdesign.lmi.formula import Array, Inequality, Values, product


class L2(Incremental):
    """L2 observers: Theorem 1 of Corless and Chakrabarty, L2 observers for systems with unknown inputs (2019).

    The inequality (13) says that along the error equations

        V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 <= 0,    z = H e,

    so e decays at the rate alpha where v = 0, and |z|_2 <= sqrt(e0' P e0 / mu1) + gamma |v|_2, gamma = sqrt(mu2 / mu1).

    Misprints: Gamma after (14) lacks L2 Df beside D_qf, as section 5.1 has it; in (17) both ratios are upside down,
    |e(t)| <= exp(-alpha t) sqrt(b2 / b1) |e0| + sqrt(mu2 / b1) |v|_2 with b1, b2 the extreme eigenvalues of P. The line
    search over alpha of Remark 4 is no search: P >= 0 makes every solution at alpha one at any smaller alpha, so the
    least gamma never decreases with alpha.
    """

    about = Theorem(
        name="l2",
        guarantee=EnergyGuarantee,
        decrease="V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 <= 0",
        gamma="norm2(z) <= gamma norm2(v) from zero error",
        level="mu2 <= gamma^2 mu1",
        margin=lambda gamma, mu1, mu2: gamma * gamma * mu1 - mu2,
        statement="norm2(z) <= sqrt(e0' P e0 / mu1) + {gamma} norm2(v), "
        f"and |e(t)| <= sqrt(cond(P)) exp(-{{rate}} t) |e0| where v = 0; for {EQUATIONS}",
        monotone=True,
    )

    def theorem(self, v: Values) -> tuple[Inequality, ...]:
        """(13), P > 0 and membership of the multiplier."""
        return tuple(self.conditions(v, v["mu1"], v["mu2"]))

    def weights(self, mu: Array) -> Values:
        """mu1 = 1 and mu2 = mu."""
        return {"mu1": ONE, "mu2": mu}


class Linf(Incremental):
    """L-infinity observers: Theorem 1 of Chakrabarty, Corless, Buzzard, Zak and Rundell (2016).

    Sufficient conditions for exogenous input estimation in nonlinear systems, American Control Conference. The
    inequalities (13a), (13b) say that along the error equations

        V' <= -2 alpha (V - mu1 |v|^2),    |z|^2 <= mu2 V,    z = H e,

    (Lemma 1), so that with gamma = sqrt(mu1 mu2), as Definition 2 has it,

        P1  e decays at the rate alpha where v = 0;
        P2  |e(t)| is bounded for every e0 and every bounded v;
        P3  |z(t)| <= gamma |v|_inf from e0 = 0;
        P4  limsup |z(t)| <= gamma |v|_inf from every e0.

    The plant may have f in its output (Df), and v may drive a disturbance model: (13a) is (13) of the family l2 with no
    weight of z and the supply 2 alpha mu1. Here alpha is a genuine search: 2 alpha P and 2 alpha mu1 compete.

    Misprints: (5b) has no derivative on its left; (26) reads L1 = P^-1 Y1; the example (47) has no solution for L2 = 0,
    the value that is printed, and gamma = 3.8e-4 contradicts its P: gamma = 1 / sqrt(7.15) for H = I.
    """

    about = Theorem(
        name="linf",
        guarantee=PeakGuarantee,
        decrease="V' + 2 alpha V - 2 alpha mu1 |v|^2 <= 0",
        gamma="sup|z| <= gamma sup|v| from zero error",
        level="mu1 mu2 <= gamma^2",
        margin=lambda gamma, mu1, mu2: gamma * gamma - mu1 * mu2,
        statement="(P1) |e(t)| <= sqrt(cond(P)) exp(-{rate} t) |e0| where v = 0; "
        "(P2) e' P e <= max(e0' P e0, mu1 sup|v|^2) at all times; "
        "(P3) |z(t)| <= {gamma} sup|v| from e0 = 0; (P4) limsup |z(t)| <= {gamma} sup|v| from every e0; "
        f"for {EQUATIONS}",
        monotone=False,
        peak=True,
    )

    def theorem(self, v: Values) -> tuple[Inequality, ...]:
        """(13a), (13b), P > 0 and membership of the multiplier."""
        output = Inequality("|z|^2 <= mu2 V", product(self.H.mT, self.H) - v["mu2"] * v["P"])
        return (*self.conditions(v, 0 * v["mu1"], self.loss * v["mu1"]), output)

    def weights(self, mu: Array) -> Values:
        """mu1 = mu and mu2 = 1, so that P >= H'H and (13a) is linear in mu."""
        return {"mu1": mu, "mu2": ONE}


class DiscreteL2(Discrete, L2):
    """L2 observers of plants x+ = A x + Bf f(q) + gx + B w, by our own derivation.

        V+ - rho^2 V + mu1 |z|^2 - mu2 |v|^2 <= 0,    0 < rho <= 1,    gamma = sqrt(mu2 / mu1),

    so that sum |z|^2 <= V_0 / mu1 + gamma^2 sum |v|^2 over any first samples, and |e_k| <= sqrt(cond P) rho^k |e_0|
    where v = 0. At rho = 1 only z -> 0 follows.
    """

    about = replace(
        L2.about,
        guarantee=EnergyOfSteps,
        decrease="V+ - rho^2 V + mu1 |z|^2 - mu2 |v|^2 <= 0",
        statement="sum |z|^2 <= e0' P e0 / mu1 + {gamma}^2 sum |v|^2 over any first samples{more}, "
        "and |e_k| <= sqrt(cond(P)) {rate}^k |e0| where v = 0; for {equations}",
        pace=RHO,
        at_rest="weak",
    )


class DiscreteLinf(Discrete, Linf):
    """L-infinity observers of plants x+ = A x + Bf f(q) + gx + B w, by our own derivation.

        V+ <= rho^2 V + (1 - rho^2) mu1 |v|^2,    |z|^2 <= mu2 V,    0 <= rho < 1,    gamma = sqrt(mu1 mu2),

    so that V_k <= max(V_0, mu1 sup|v|^2), with P1 to P4 of `Linf` in samples. The best rho may be 0, with dead beat.
    """

    about = replace(
        Linf.about,
        guarantee=PeakOfSteps,
        decrease="V+ - rho^2 V - (1 - rho^2) mu1 |v|^2 <= 0",
        statement="(P1) |e_k| <= sqrt(cond(P)) {rate}^k |e0| where v = 0; "
        "(P2) e' P e <= max(e0' P e0, {times}mu1 sup|v|^2) at all samples; "
        "(P3) |z_k| <= {gamma} sup|v| from e0 = 0; (P4) limsup |z_k| <= {gamma} sup|v| from every e0; "
        "for {equations}",
        pace=RHO,
    )


THEOREMS: dict[str, type[Incremental]] = {family.about.name: family for family in (L2, Linf)}
DISCRETE: dict[str, type[Incremental]] = {family.about.name: family for family in (DiscreteL2, DiscreteLinf)}


def theorem(name: str, *, sampled: bool) -> type[Incremental]:
    """Theorem of a family, for a plant in continuous time or of samples."""
    return (DISCRETE if sampled else THEOREMS)[name]
