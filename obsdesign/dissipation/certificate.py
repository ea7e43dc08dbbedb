"""What proves a guarantee, and the proof: no solver is needed, or imported, to hold a certificate against its claim."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from flint import arb, fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.guarantee import Quadratic, Sampled
from obsdesign.dissipation.inequality import LARGE, SMALL, Incremental
from obsdesign.dissipation.region import Region
from obsdesign.files import ResultFile, witness
from obsdesign.files import written as exactly
from obsdesign.lmi.formula import (
    Array,
    Exact,
    Inequality,
    Values,
    above,
    approximate,
    below,
    identity,
    printed,
    rational,
)
from obsdesign.lmi.proof import Check, Proved, prove
from obsdesign.lmi.spectrum import lower
from obsdesign.model import loop
from obsdesign.records import dataclass, field, replace


@dataclass(frozen=True)
class Certificate(Proved):
    """Storage function and scales, in rationals, that prove the level gamma, and what was checked of them."""

    family: Incremental  # plant, multiplier, rate and gains, in rationals
    gamma: fmpq
    mu1: fmpq
    mu2: fmpq
    P: Array  # (n, n)
    multipliers: dict[str, Array]  # by the names of the unknowns
    checks: tuple[Check, ...]
    poles: Region | None = None  # which holds those of every frozen member
    places: dict[str, Array] = field(default_factory=dict)  # multipliers that prove it, by the names of the unknowns

    @property
    def theorem(self) -> type[Incremental]:
        """Inequalities that are proved."""
        return type(self.family)

    @property
    def rate(self) -> fmpq:
        """Alpha, or 1 - rho, in rationals."""
        return self.family.rate

    def written(self) -> dict[str, Any]:
        """Witness and checks, as a result file holds them."""
        made = witness({"P": self.P}, self.multipliers, self.checks)
        return made | ({"poles": {name: exactly(value) for name, value in self.places.items()}} if self.poles else {})

    @property
    def guarantee(self) -> Quadratic:
        """Guarantee, its numbers in doubles on the safe side."""
        mu1, mu2 = map(approximate, (self.mu1, self.mu2))
        return self.theorem.about.guarantee(above(self.gamma), self.told, mu1, mu2, self.P)

    def guarantee_at(self, period: fmpq | None) -> Quadratic:
        """The same of a plant with samples a period (s) apart."""
        found = self.guarantee
        return replace(found, period=float(period)) if isinstance(found, Sampled) and period is not None else found

    def decay(self, period: fmpq | None) -> dict[str, float]:
        """Alpha by its key; of samples rho, and alpha = -ln(rho) / period unless rho is zero, both on the safe side."""
        if period is None:
            return {self.theorem.about.pace.key: self.told}
        alpha = {"alpha": rate_of(self.told, period)} if self.told else {}
        return {"rho": self.told, **alpha}

    @property
    def told(self) -> float:
        """Alpha, or rho, of the claim in doubles, on the safe side."""
        pace = self.theorem.about.pace
        return above(pace.told(self.rate)) if pace.sampled else below(self.rate)


def certify(
    family: Incremental, gamma: fmpq, mu1: fmpq, mu2: fmpq, values: Values, bounds: Bounds = NO_BOUNDS
) -> Certificate:
    """Check every condition of the claim exactly.

    `family`: plant, multiplier, rate and both gains, in rationals; `gamma`, `mu1`, `mu2`: the claim, such as |z|_2 <=
    gamma |v|_2 from zero error, and the numbers that prove it; `values`: P and the multipliers, in rationals;
    `bounds`: those of the spec on P and on the poles, whose multipliers are among the values.
    """
    P, plant, rate = values["P"], family.plant, family.rate
    eye, largest, floor = identity(len(P), P), bounds.P, bounds.floor
    bounded = [] if largest is None else [Inequality(SMALL, P - largest * eye)]
    bounded += [] if floor is None else [Inequality(LARGE, floor * eye - P)]
    bounded += family.placed(values, bounds)
    proved = prove([*family.theorem({**values, "mu1": rational([[mu1]]), "mu2": rational([[mu2]])}), *bounded])
    margin = family.about.margin(gamma, mu1, mu2)
    verdict = loop.proved(plant.Dqf + family.L2 @ plant.Df, family.multiplier, values)
    conditions = (
        *proved,
        *paced(family, rate),
        Check("mu1 > 0", mu1 > 0, approximate(mu1)),
        Check("gamma >= 0", gamma >= 0, approximate(gamma)),
        Check("mu2 >= 0", mu2 >= 0, approximate(mu2)),
        Check(family.about.level, margin >= 0, approximate(margin)),
        Check(verdict.sentence, verdict.unique, 1.0 if verdict.unique else -1.0),
    )
    places = {unknown.name: values[unknown.name] for unknown in family.placing(bounds)}
    multipliers = {name: value for name, value in values.items() if name != "P" and name not in places}
    return Certificate(family, gamma, mu1, mu2, P, multipliers, conditions, bounds.poles, places)


def moved(certificate: Certificate, family: Incremental, S: Exact) -> Certificate:
    """Certificate of a family whose states are x, from that in the states S x; S rational.

    `family`: plant, multiplier, rate and gains in x; the storage function is the same, P = S' P' S.
    """
    values = {"P": S.T @ certificate.P @ S, **certificate.multipliers}
    return certify(family, certificate.gamma, certificate.mu1, certificate.mu2, values)


def read_values(file: ResultFile, family: Incremental, witness: Sequence[str], bounds: Bounds) -> Values:
    """P and the multipliers of a witness in a file, those of the bounds on the poles included."""
    values = {"P": file.matrix((family.plant.n, family.plant.n), *witness, "P")}
    values |= file.unknowns(family.multiplier.unknowns(), *witness, "multipliers")
    return values | (file.unknowns(family.placing(bounds), *witness, "poles") if bounds.poles else {})


def rate_of(rho: float, period: fmpq) -> float:
    """Alpha = -ln(rho) / period, rounded down (1/s)."""
    return max(lower(-arb(printed(rho)).log() / arb(period)), 0.0)


def paced(family: Incremental, rate: fmpq) -> tuple[Check, ...]:
    """That alpha > 0, or that 0 <= rho < 1, or 1 as well; and >= 0 where a theorem is about no decay as well."""
    pace, rests = family.about.pace, bool(family.about.at_rest)
    holds, told = rate > 0 or (rests and rate == 0), approximate(pace.told(rate))
    if not pace.sampled:
        return (Check(f"{pace.key} {'>=' if rests else '>'} 0", holds, told),)
    return Check("rho >= 0", rate <= 1, told), Check(f"rho {'<=' if rests else '<'} 1", holds, approximate(rate))


def kept(bounds: Bounds, gain: Array, gamma: fmpq | None = None, name: str = "L") -> tuple[Check, ...]:
    """Whether a designed gain, and its gamma, keep the bounds of a spec; that on P is a condition of `certify`.

    |L| <= kappa is L'L - kappa^2 I <= 0, or with the Frobenius norm tr L'L - kappa^2 <= 0, in rationals.
    """
    kappa, product = bounds.L1, gain.T @ gain
    found: tuple[Check, ...] = ()
    if kappa is not None:
        if bounds.norm == "frobenius":
            product = rational([[np.trace(product)]])
        found = prove([Inequality(f"|{name}| <= kappa", product - kappa * kappa * identity(len(product), product))])
    if bounds.gamma is None or gamma is None:
        return found
    return (*found, Check("gamma is what is asked for", gamma <= bounds.gamma, approximate(bounds.gamma - gamma)))
