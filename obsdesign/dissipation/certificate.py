"""What proves a guarantee, and the proof: no solver is needed, or imported, to hold a certificate against its claim."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.guarantee import Quadratic
from obsdesign.dissipation.inequality import LARGE, SMALL, Incremental
from obsdesign.files import witness
from obsdesign.lmi.formula import Array, Inequality, Values, above, approximate, below, identity, rational
from obsdesign.lmi.proof import Check, Proved, prove
from obsdesign.model import loop


@dataclass(frozen=True)
class Certificate(Proved):
    """Storage function and scales, in rationals, that prove the level gamma, and what was checked of them."""

    theorem: type[Incremental]
    alpha: fmpq
    gamma: fmpq
    mu1: fmpq
    mu2: fmpq
    P: Array  # (n, n)
    multipliers: dict[str, Array]  # by the names of the unknowns
    checks: tuple[Check, ...]

    def written(self) -> dict[str, Any]:
        """Witness and checks, as a result file holds them."""
        return witness({"P": self.P}, self.multipliers, self.checks)

    @property
    def guarantee(self) -> Quadratic:
        """Guarantee, its numbers in doubles on the safe side."""
        mu1, mu2 = map(approximate, (self.mu1, self.mu2))
        return self.theorem.about.guarantee(above(self.gamma), below(self.alpha), mu1, mu2, self.P)


def certify(
    family: Incremental, gamma: fmpq, mu1: fmpq, mu2: fmpq, values: Values, bounds: Bounds = NO_BOUNDS
) -> Certificate:
    """Check every condition of the claim exactly.

    `family`: plant, multiplier, alpha and both gains, in rationals; `gamma`, `mu1`, `mu2`: the claim, such as |z|_2 <=
    gamma |v|_2 from zero error, and the numbers that prove it; `values`: P and the multipliers, in rationals;
    `bounds`: those of the spec on P.
    """
    P, plant, alpha, zero = values["P"], family.plant, family.alpha, family.about.zero_decay
    eye, largest, floor = identity(len(P), P), bounds.P, bounds.floor
    bounded = [] if largest is None else [Inequality(SMALL, P - largest * eye)]
    bounded += [] if floor is None else [Inequality(LARGE, floor * eye - P)]
    proved = prove([*family.theorem({**values, "mu1": rational([[mu1]]), "mu2": rational([[mu2]])}), *bounded])
    margin = family.about.margin(gamma, mu1, mu2)
    verdict = loop.proved(plant.Dqf + family.L2 @ plant.Df, family.multiplier, values)
    conditions = (
        *proved,
        Check("decay >= 0" if zero else "alpha > 0", alpha > 0 or (zero and alpha == 0), approximate(alpha)),
        Check("mu1 > 0", mu1 > 0, approximate(mu1)),
        Check("gamma >= 0", gamma >= 0, approximate(gamma)),
        Check("mu2 >= 0", mu2 >= 0, approximate(mu2)),
        Check(family.about.level, margin >= 0, approximate(margin)),
        Check(verdict.sentence, verdict.unique, 1.0 if verdict.unique else -1.0),
    )
    multipliers = {name: value for name, value in values.items() if name != "P"}
    return Certificate(type(family), alpha, gamma, mu1, mu2, P, multipliers, conditions)


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
