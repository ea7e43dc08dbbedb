"""Observers for measurements that arrive sporadically: Ferrante, Gouaisbaut, Sanfelice and Tarbouriech (2019).

L2 state estimation with guaranteed convergence speed in the presence of sporadic measurements, IEEE Transactions on
Automatic Control 64(8). The output of x' = A x + Bf f(q) + B w, q = Cq x + Dqf f + Dq w, is measured at the instants
t_k only, 0 <= t_1 <= T2 and T1 <= t_{k+1} - t_k <= T2, as y = C x + eta. The observer (4) is

    xhat' = A xhat + Bf f(qhat) + L theta,    theta' = H theta         between measurements,
    theta+ = y - C xhat                                                at each of them.

With e = x - xhat, d = C e - theta, z = Cp e, and the time tau left to the next measurement,

    V = e' P1 e + exp(delta tau) d' P2 d                                                        (27)

grows at a measurement, where d+ = -eta, by at most exp(delta T2) eta' P2 eta, and (28) says that in between

    V' + 2 lambda_t V + |z|^2 - mu |w|^2 <= 0.

The matrix M of this inequality depends on tau through s = exp(delta tau) alone, and affinely: M(1) <= 0 and M(r) <= 0
for any r >= exp(delta T2) prove it for every tau in [0, T2] (Theorem 2 and Lemma 3). With rho1 = min(lmin(P1),
lmin(P2)) and rho2 = max(lmax(P1), lmax(P2) exp(delta T2)) it follows that

    rate    |(e, d)(t)| <= sqrt(rho2 / rho1) exp(-lambda_t t) |(e, d)(0)| where w = 0 and eta = 0 (Theorem 1 (i));
    gain    |z|_2 <= sqrt(rho2) |(e, d)(0)| + gamma |w|_2 where eta = 0, gamma^2 >= mu (Theorem 1 (ii));
    bound   |(e, d)(t)| is at most the first plus gamma / sqrt(2 lambda_t rho1) sup|w| and nu sup|eta|,
            nu^2 = lmax(P2) exp(delta T2) / ((1 - exp(-2 lambda_t T1)) rho1)     (Lemma 2 with its tight constant),

for every sequence of measurements; T1 plays a part in nu only. Without w and z the first is Corollary 1. For
lambda_t = 0 and M < 0, rate and bound hold with lambda_t = beta / (2 rho2), beta = -max over tau of lmax(M) (Corollary
2).

Misprints: Theorem 1 (ii) has rho2 for sqrt(rho2); (23) lacks 1 / rho1 in the term of eta; (37) has lambda_t P1 for
2 lambda_t P1; the second inequality of (36) has P for P_T2; (48) does not need mu.
"""

from collections.abc import Callable
from typing import Any

from flint import arb

from obsdesign.families.sporadic.units import SPEC, Units
from obsdesign.lmi.formula import Array, Inequality, Values, he, identity, in_floats, printed, symmetric
from obsdesign.lmi.spectrum import extremes
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass

EQUATIONS = (
    "xhat' = A xhat + Bf f(qhat) + g + L theta, theta' = H theta between measurements, "
    "theta+ = y - C xhat at a measurement, e = x - xhat, d = C e - theta, z = Cp e"
)
DECREASE = "V' + 2 lambda_t V + |z|^2 - mu |w|^2 <= 0"


def extent(P1: Array, P2: Array, ratio: arb) -> tuple[arb, arb, arb]:
    """rho1 and rho2, the smallest and largest V of |(e, d)| = 1, and omega2, that of e = 0, with ratio for s.

    `P1`, `P2`: in rationals, positive definite.
    """
    (low1, high1), (low2, high2) = extremes(P1), extremes(P2)
    omega2 = high2 * ratio
    return low1.min(low2), high1.max(omega2), omega2


def tied_gain(injection: str, L: Array, C: Array) -> Array | None:
    """H that goes with L, in the decimals of doubles: 0 to hold, -C L to predict; None if H is free."""
    product = C @ L
    return {"hold": 0 * product, "predictor": printed(in_floats(-product))}.get(injection)


@dataclass(frozen=True)
class Sporadic:
    """The inequality (28) for a fixed rate and a fixed exponent, in the numbers of the plant.

    `ratio` is exp(delta T2), or in rationals a number that is not below it.
    """

    plant: Plant[Array]  # Df = 0 and D = 0
    multiplier: Multiplier
    Cp: Array  # (nz, n)
    decay: Any  # lambda_t, 1/s
    delta: Any  # 1/s
    ratio: Any
    units: Units = SPEC  # of the plant and of both rates

    def flows(self, matrix: Callable[[Any], Array]) -> tuple[Inequality, Inequality]:
        """A matrix that is affine in s negative at both ends of the interval; definite if lambda_t = 0."""
        last, first = (
            Inequality(f"{DECREASE} for tau = {tau}", matrix(s), strict=not self.decay)
            for tau, s in (("0", 1), ("T2", self.ratio))
        )
        return last, first

    def supply(self, v: Values) -> tuple[list[Array], list[Array], list[Array]]:
        """Upper triangle in (e, w, f) of weight |z|^2 - mu |w|^2 + [dq; df]' M [dq; df]."""
        p = self.plant
        M11, M12, M22 = self.multiplier.matrix(v)
        along = M11 @ p.Dqf + M12
        return (
            [v["weight"] * (self.Cp.mT @ self.Cp) + p.Cq.mT @ M11 @ p.Cq, p.Cq.mT @ M11 @ p.Dq, p.Cq.mT @ along],
            [p.Dq.mT @ M11 @ p.Dq - v["mu"] * identity(p.B.shape[1], p.B), p.Dq.mT @ along],
            [p.Dqf.mT @ M11 @ p.Dqf + he(p.Dqf.mT @ M12) + M22],
        )

    def dissipation(self, v: Values, s: Any) -> Array:
        """M of (30) in (e, d, w, f), where J = P1 L and Y' = P2 (C L + H)."""
        p, P1, P2, J, Y = self.plant, v["P1"], v["P2"], v["J"], v["Y"]
        (ee, ew, ef), w, f = self.supply(v)
        faster = 2 * self.decay - self.delta
        return symmetric(
            [
                [
                    he(P1 @ p.A - J @ p.C) + 2 * self.decay * P1 + ee,
                    J + s * (p.A.mT @ p.C.mT @ P2 - p.C.mT @ Y),
                    P1 @ p.B + ew,
                    P1 @ p.Bf + ef,
                ],
                [s * (he(Y) + faster * P2), s * (P2 @ p.C @ p.B), s * (P2 @ p.C @ p.Bf)],
                w,
                f,
            ]
        )

    def without_gains(self, v: Values, s: Any) -> Array:
        """M with theta = 0, that is d = C e: negative at both ends iff some L and H satisfy (28).

        One direction is plain. For the other, with x = (e, w, f), c = C e, u = 1/s and h = s d, J and Y enter as
        2 e'J (u h - c) + 2 h'Y'(u h - c). If none will do, then by a theorem of alternatives there are second moments
        of (x, h) at both ends for which these terms vanish and the rest is not negative. With S = E x x',
        V = E x (h - c)' / (r - 1) and (u - 1)(u - 1/r) = 0 the moments S - S2 and S2 = V (C V)^+ V' of x alone
        contradict the two inequalities.
        """
        p, P1, P2 = self.plant, v["P1"], v["P2"]
        (ee, ew, ef), w, f = self.supply(v)
        held = s * (p.C.mT @ P2 @ p.C)
        Q = P1 + held
        return symmetric(
            [
                [he(Q @ p.A) + 2 * self.decay * Q - self.delta * held + ee, Q @ p.B + ew, Q @ p.Bf + ef],
                w,
                f,
            ]
        )

    def positive(self, v: Values) -> list[Inequality]:
        """P1 and P2 positive definite, and the multiplier in its cone."""
        return [
            Inequality("P1 > 0", -v["P1"], strict=True),
            Inequality("P2 > 0", -v["P2"], strict=True),
            *self.multiplier.inequalities(v),
        ]

    def for_gains(self, v: Values, s: Any, L: Array, H: Array) -> Array:
        """M of (30) for given gains."""
        return self.dissipation({**v, "J": v["P1"] @ L, "Y": (self.plant.C @ L + H).mT @ v["P2"]}, s)

    def theorem(self, v: Values, L: Array, H: Array) -> tuple[Inequality, ...]:
        """Theorem 2 for given gains; strict where lambda_t = 0 (Corollary 2)."""
        return *self.flows(lambda s: self.for_gains(v, s, L, H)), *self.positive(v)
