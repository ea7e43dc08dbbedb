"""What proves the guarantees of an observer for sporadic measurements, and the proof; no solver takes part."""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from flint import arb, ctx, fmpq

from obsdesign.errors import UsageError
from obsdesign.families.sporadic.guarantee import SporadicGuarantee
from obsdesign.families.sporadic.theorem import EQUATIONS, Sporadic, extent
from obsdesign.files import witness
from obsdesign.lmi.formula import Array, Exact, Values, above, approximate, below, printed, rational
from obsdesign.lmi.proof import Check, Proved, prove
from obsdesign.lmi.spectrum import BITS, extremes
from obsdesign.model import loop
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass
from obsdesign.tables.text import at_least, at_most

MEANING = "norm2(z) <= gamma norm2(w) from zero error"  # of gamma
LARGEST_EXPONENT = 100  # of exp(delta T2)
JITTERS = 11  # T2 / T1 from which on nobody speaks of a jitter, in percent
CONSTANTS = ("rate", "overshoot", "initial", "disturbance", "noise")  # less of the first, and more of the others, holds


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

    @cached_property
    def constants(self) -> dict[str, fmpq]:
        """Constants of Theorem 1 with Lemma 2 for every sequence with T1 <= t_{k+1} - t_k <= T2, on the safe side.

        |(e, d)(t)| <= overshoot exp(-rate t) |(e, d)(0)| + disturbance sup|w| + noise sup|eta|, and
        |z|_2 <= initial |(e, d)(0)| + gamma |w|_2 where eta = 0. They are decimals that print doubles. Left out is what
        doubles do not hold, and all where the certificate does not hold.
        """
        if not self.holds:
            return {}
        rate = below(self.fastest)
        found = {"rate": rate, **{name: above(x) for name, x in self.least(printed(rate)).items()}}
        return {name: printed(found[name]) for name in CONSTANTS if math.isfinite(found.get(name, math.inf))}

    @cached_property
    def fastest(self) -> fmpq:
        """Rate that is proved: lambda_t, or where that is zero beta / (2 rho2) of Corollary 2, rounded down."""
        with ctx.workprec(BITS):
            return self.family.decay or (self.slowest() / (2 * self.extent[1])).lower().fmpq()

    @cached_property
    def extent(self) -> tuple[arb, arb, arb]:
        """rho1, rho2 and lmax(P2) exp(delta T2)."""
        with ctx.workprec(BITS):
            return extent(self.P1, self.P2, arb(self.family.ratio))

    def least(self, rate: fmpq) -> dict[str, fmpq]:
        """Least constants, rounded up, that are proved with a rate that is."""
        with ctx.workprec(BITS):
            rho1, rho2, omega2 = self.extent
            forgotten = -arb(-2 * rate * self.T1).expm1()
            found = {
                "overshoot": (rho2 / rho1).sqrt(),
                "initial": rho2.sqrt(),
                "disturbance": arb(self.gamma) / (2 * rate * rho1).sqrt(),
                "noise": (omega2 / (forgotten * rho1)).sqrt(),
            }
            return {name: ball.upper().fmpq() for name, ball in found.items() if ball.is_finite()}

    def keep(self, stated: Mapping[str, fmpq]) -> tuple[Check, ...]:
        """Whether constants that are stated are no better than what is proved, where the certificate holds."""
        if not self.holds:
            return ()
        rate = stated.get("rate", fmpq(0))
        room = {"rate": self.fastest - rate}
        room |= {name: stated[name] - x for name, x in self.least(rate).items() if name in stated}
        found = ((name, room.get(name, fmpq(-1))) for name in stated)
        return tuple(Check(f"{name} is proved", left >= 0, approximate(left)) for name, left in found)

    def statement(self, constants: Mapping[str, fmpq]) -> str:
        """Guarantee in words, with the observer written out, and constants rounded to the safe side."""
        c = {name: at_most(x) for name, x in constants.items()}
        parts = []
        if {"rate", "overshoot"} <= c.keys():
            decays = f"exp(-{below(constants['rate'])!r} t) |(e, d)(0)|"
            parts.append(f"(P1) |(e, d)(t)| <= {c['overshoot']} {decays} where w = 0 and eta = 0")
            if "disturbance" in c:
                noise = f" + {c['noise']} sup|eta|" if "noise" in c else ", where eta = 0"
                parts.append(f"(P2) otherwise plus {c['disturbance']} sup|w|{noise}")
        if "initial" in c:
            parts.append(f"(P3) |z|_2 <= {above(self.gamma)!r} |w|_2 + {c['initial']} |(e, d)(0)| where eta = 0")
        return f"{sequences(self.T1, self.T2)}: " + "; ".join([*parts, f"for {EQUATIONS}"])

    @property
    def guarantee(self) -> SporadicGuarantee:
        """Claim and storage function, which a run is held against; its numbers in doubles."""
        delta, T1, T2 = map(approximate, (self.family.delta, self.T1, self.T2))
        gamma, decay = above(self.gamma), below(self.family.decay)
        return SporadicGuarantee(gamma, decay, delta, T1, T2, self.P1, self.P2)

    def slowest(self) -> arb:
        """Return beta of Corollary 2: minus the largest eigenvalue of M over tau, which one of the ends has."""
        v = {**self.multipliers, "P1": self.P1, "P2": self.P2, "mu": rational([[self.mu]]), "weight": rational([[1]])}
        last, first, *_ = self.family.theorem(v, self.L, self.H)
        return -extremes(last.matrix)[1].max(extremes(first.matrix)[1])


def sequences(T1: fmpq, T2: fmpq) -> str:
    """For which measurements a claim holds, in words; `T1`, `T2`: s."""
    first, last = above(T1), below(T2)
    if not T1:
        return f"for every sequence of measurements that are at most {last!r} apart, the first one included"
    between = f"{first!r} to {last!r} apart{told(' (a jitter of {} %)', T1, T2)}" if T1 < T2 else f"{last!r} apart"
    return f"for every sequence of measurements that are {between}, and a first one no later than {last!r}"


def span(T1: fmpq, T2: fmpq) -> str:
    """Intervals of a claim in a few words; `T1`, `T2`: s."""
    if T1 == T2:
        return f"{at_least(T2)} s"
    return f"{at_most(T1)} to {at_least(T2)} s" if T1 else f"any up to {at_least(T2)} s"


def told(form: str, T1: fmpq, T2: fmpq) -> str:
    """The jitter in words, where it is a number of which people speak."""
    return form.format(at_least(100 * (T2 - T1) / T1, 4)) if T1 < T2 <= JITTERS * T1 else ""


def jitter(T1: fmpq, T2: fmpq) -> dict[str, float]:
    """(T2 - T1) / T1 as an entry of a guarantee; none for T1 = 0."""
    return {"jitter": below((T2 - T1) / T1)} if T1 else {}


def exponential(exponent: fmpq) -> fmpq:
    """Rational that is not below exp(exponent), by ball arithmetic.

    Raises `UsageError`: the exponent is negative or above `LARGEST_EXPONENT`.
    """
    if not 0 <= exponent <= LARGEST_EXPONENT:
        raise UsageError(f"delta T2 = {approximate(exponent):g} is not between 0 and {LARGEST_EXPONENT}", id="OBS208")
    return arb(exponent).exp().upper().fmpq()


def moved(
    certificate: SporadicCertificate,
    problem: tuple[Plant[Exact], Multiplier, Array],
    gains: tuple[Array, Array],
    S: Exact,
) -> SporadicCertificate:
    """Certificate of gains in the states x, from that in the states S x: the storage function is the same.

    `problem`: plant, multiplier and Cp in x, in rationals, as the gains are and S is.
    """
    known = certificate
    values = {"P1": S.T @ known.P1 @ S, "P2": known.P2, **known.multipliers}
    decay, delta = known.family.decay, known.family.delta
    return certify_sporadic(*problem, gains, (known.T1, known.T2), decay, delta, known.gamma, known.mu, values)


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
        Check("0 <= T1 <= T2, T2 > 0", 0 <= T1 <= T2 and T2 > 0, approximate(T2 - T1)),
        Check("mu >= 0", mu >= 0, approximate(mu)),
        Check("gamma >= 0", gamma >= 0, approximate(gamma)),
        Check("gamma^2 >= mu", gamma * gamma >= mu, approximate(gamma * gamma - mu)),
        Check("D = 0 and Df = 0", not any(direct), 0.0),
        Check(verdict.sentence, verdict.unique, 1.0 if verdict.unique else -1.0),
    )
    multipliers = {name: value for name, value in values.items() if name not in {"P1", "P2"}}
    return SporadicCertificate(family, L, H, T1, T2, gamma, mu, values["P1"], values["P2"], multipliers, checks)
