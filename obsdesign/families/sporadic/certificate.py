"""What proves the guarantees of an observer for sporadic measurements, and the proof; no solver takes part."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import arb, fmpq

from obsdesign.errors import UsageError
from obsdesign.families.sporadic.guarantee import SporadicGuarantee
from obsdesign.families.sporadic.theorem import EQUATIONS, Sporadic
from obsdesign.files import witness
from obsdesign.lmi.formula import Array, Exact, Values, approximate, in_floats, rational
from obsdesign.lmi.proof import Check, Proved, prove
from obsdesign.model import loop
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant

MEANING = "norm2(z) <= gamma norm2(w) from zero error"  # of gamma
LARGEST_EXPONENT = 100  # of exp(delta T2)


@dataclass(frozen=True)
class SporadicConstants:
    """What holds for every sequence of measurements with T1 <= t_{k+1} - t_k <= T2; in doubles.

    |(e, d)(t)| <= overshoot exp(-rate t) |(e, d)(0)| + disturbance sup|w| + noise sup|eta|, and
    |z|_2 <= initial |(e, d)(0)| + gamma |w|_2 where eta = 0.
    """

    gamma: float
    decay: float  # lambda_t that is proved, 1/s
    rate: float  # lambda_t, or that of Corollary 2 where lambda_t = 0
    overshoot: float
    initial: float
    disturbance: float
    noise: float
    jitter: float  # (T2 - T1) / T1


@dataclass(frozen=True)
class SporadicCertificate(Proved):
    """Storage function and multiplier, in rationals, that prove a level gamma of given gains, and what was checked."""

    family: Sporadic  # in rationals; its ratio is not below exp(delta T2)
    L: Array
    H: Array
    T1: fmpq
    T2: fmpq
    gamma: fmpq
    mu: fmpq
    P1: Array  # (n, n)
    P2: Array  # (ny, ny)
    multipliers: dict[str, Array]  # by the names of the unknowns
    checks: tuple[Check, ...]

    def written(self) -> dict[str, Any]:
        """Witness and checks, as a result file holds them."""
        return witness({"P1": self.P1, "P2": self.P2}, self.multipliers, self.checks)

    @property
    def constants(self) -> SporadicConstants:
        """Constants of Theorem 1 with Lemma 2, in doubles; infinite where doubles do not reach."""
        P1, P2 = (np.linalg.eigvalsh(in_floats(P)) for P in (self.P1, self.P2))
        largest = float(P2[-1]) * approximate(self.family.ratio)
        rho1, rho2 = min(float(P1[0]), float(P2[0])), max(float(P1[-1]), largest)
        decay, T1, gamma = float(self.family.decay), float(self.T1), float(self.gamma)
        rate = decay or self.slowest() / (2 * rho2)
        if rho1 <= 0 or rate <= 0 or T1 <= 0:  # only where the certificate does not hold, or by rounding
            return SporadicConstants(gamma, decay, max(rate, 0.0), *(math.inf,) * 4, self.jitter)
        forgotten = -math.expm1(-2 * rate * T1)
        return SporadicConstants(
            gamma,
            decay,
            rate,
            overshoot=math.sqrt(rho2 / rho1),
            initial=math.sqrt(rho2),
            disturbance=gamma / math.sqrt(2 * rate * rho1),
            noise=math.sqrt(largest / (forgotten * rho1)),
            jitter=self.jitter,
        )

    @property
    def guarantee(self) -> SporadicGuarantee:
        """Claim and storage function in doubles, which a run is held against."""
        P1, P2 = (np.vectorize(approximate, otypes=[float])(P) for P in (self.P1, self.P2))
        gamma, decay, delta, T1, T2 = map(
            approximate, (self.gamma, self.family.decay, self.family.delta, self.T1, self.T2)
        )
        return SporadicGuarantee(gamma, decay, delta, T1, T2, P1, P2)

    @property
    def jitter(self) -> float:
        """(T2 - T1) / T1."""
        return float((self.T2 - self.T1) / self.T1) if self.T1 else math.inf

    def slowest(self) -> float:
        """Return beta of Corollary 2: minus the largest eigenvalue of M over tau, which one of the ends has."""
        v = {**self.multipliers, "P1": self.P1, "P2": self.P2, "mu": rational([[self.mu]]), "weight": rational([[1]])}
        first, last, *_ = self.family.theorem(v, self.L, self.H)
        return -max(float(np.linalg.eigvalsh(in_floats(flow.matrix))[-1]) for flow in (first, last))

    def statement(self) -> str:
        """Guarantee in words, with the observer written out."""
        g, T1, T2 = self.constants, float(self.T1), float(self.T2)
        return (
            f"for every sequence of measurements that are {T1!r} to {T2!r} apart (a jitter of {100 * g.jitter:.4g} %), "
            f"and a first one no later than {T2!r}: "
            f"(P1) |(e, d)(t)| <= {g.overshoot:.6g} exp(-{g.rate!r} t) |(e, d)(0)| where w = 0 and eta = 0; "
            f"(P2) otherwise plus {g.disturbance:.6g} sup|w| + {g.noise:.6g} sup|eta|; "
            f"(P3) |z|_2 <= {g.gamma!r} |w|_2 + {g.initial:.6g} |(e, d)(0)| where eta = 0; for {EQUATIONS}"
        )


def exponential(exponent: fmpq) -> fmpq:
    """Rational that is not below exp(exponent), by ball arithmetic.

    Raises `UsageError`: the exponent is negative or above `LARGEST_EXPONENT`.
    """
    if not 0 <= exponent <= LARGEST_EXPONENT:
        raise UsageError(f"delta T2 = {approximate(exponent):g} is not between 0 and {LARGEST_EXPONENT}")
    return arb(exponent).exp().upper().fmpq()


def certify_sporadic(
    plant: Plant[Exact],
    multiplier: Multiplier,
    Cp: Array,
    gains: tuple[Array, Array],
    interval: tuple[fmpq, fmpq],
    decay: fmpq,
    delta: fmpq,
    gamma: fmpq,
    mu: fmpq,
    values: Values,
) -> SporadicCertificate:
    """Check every condition of the claim exactly.

    `plant`, `multiplier`, `Cp`: the problem, in rationals; `gains`, `interval`, `decay`, `gamma`: L and H, T1 and T2,
    lambda_t, and the level: the claim; `delta`, `mu`, `values`: exponent, supply, and P1, P2 and the multipliers: what
    proves it. Raises `UsageError`: delta T2 is negative or beyond `LARGEST_EXPONENT`.
    """
    (L, H), (T1, T2) = gains, interval
    ratio = exponential(delta * T2)
    family = Sporadic(plant, multiplier, Cp, decay, delta, ratio)
    proved = prove(family.theorem({**values, "mu": rational([[mu]]), "weight": rational([[1]])}, L, H))
    verdict = loop.proved(plant.Dqf, multiplier, values)
    direct = [entry for D in (plant.D, plant.Df) for entry in D.flat]
    checks = (
        *proved,
        Check("r >= exp(delta T2)", bool(arb(delta * T2).exp() <= arb(ratio)), approximate(ratio)),
        Check("delta > 0", delta > 0, approximate(delta)),
        Check("lambda_t >= 0", decay >= 0, approximate(decay)),
        Check("0 < T1 <= T2", 0 < T1 <= T2, approximate(T2 - T1)),
        Check("mu >= 0", mu >= 0, approximate(mu)),
        Check("gamma >= 0", gamma >= 0, approximate(gamma)),
        Check("gamma^2 >= mu", gamma * gamma >= mu, approximate(gamma * gamma - mu)),
        Check("D = 0 and Df = 0", not any(direct), 0.0),
        Check(verdict.sentence, verdict.unique, 1.0 if verdict.unique else -1.0),
    )
    multipliers = {name: value for name, value in values.items() if name not in {"P1", "P2"}}
    return SporadicCertificate(family, L, H, T1, T2, gamma, mu, values["P1"], values["P2"], multipliers, checks)
