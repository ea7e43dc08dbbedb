"""What proves a guarantee, and the proof: no solver is needed, or imported, to hold a certificate against its claim."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array, Inequality, Values, approximate, rational
from obsdesign.lmi.proof import Check, prove
from obsdesign.model import loop
from obsdesign.observers.guarantee import Guarantee
from obsdesign.observers.l2 import L2


@dataclass(frozen=True)
class Certificate:
    """Storage function and scales, in rationals, that prove the level gamma, and what was checked of them."""

    alpha: fmpq
    gamma: fmpq
    mu1: fmpq
    mu2: fmpq
    P: Array  # (n, n)
    scales: dict[str, Array]  # 1x1 each
    checks: tuple[Check, ...]

    @property
    def holds(self) -> bool:
        """Whether the guarantee is proved."""
        return all(check.holds for check in self.checks)

    @property
    def guarantee(self) -> Guarantee:
        """Guarantee in doubles."""
        P = np.vectorize(approximate, otypes=[float])(self.P)
        return Guarantee(
            approximate(self.gamma), approximate(self.alpha), approximate(self.mu1), approximate(self.mu2), P
        )


def theorem(family: L2, mu1: fmpq, mu2: fmpq) -> Callable[[Values], tuple[Inequality, ...]]:
    """Inequalities of given gains in rationals, as a function of P and the scales."""
    level = {"mu1": rational([[mu1]]), "mu2": rational([[mu2]])}
    return lambda v: family.theorem({**v, **level})


def certify(family: L2, gamma: fmpq, mu1: fmpq, mu2: fmpq, values: Values) -> Certificate:
    """Check every condition of the claim exactly.

    Parameters
    ----------
    family
        Plant, multiplier, alpha and both gains, in rationals.
    gamma, mu1, mu2
        The claim: |z|_2 <= gamma |v|_2 from zero error, for which mu2 <= gamma^2 mu1.
    values
        P and the scales, in rationals.
    """
    proved = prove(theorem(family, mu1, mu2)(values))
    plant = family.plant
    verdict = loop.proved(plant.Dqf + family.L2 @ plant.Df, family.multiplier, values)
    checks = (
        *proved,
        Check("alpha > 0", family.alpha > 0, approximate(family.alpha)),
        Check("mu1 > 0", mu1 > 0, approximate(mu1)),
        Check("gamma >= 0", gamma >= 0, approximate(gamma)),
        Check("mu2 <= gamma^2 mu1", 0 <= mu2 <= gamma * gamma * mu1, approximate(gamma * gamma * mu1 - mu2)),
        Check(verdict.sentence, verdict.unique, 1.0 if verdict.unique else -1.0),
    )
    scales = {name: value for name, value in values.items() if name != "P"}
    return Certificate(family.alpha, gamma, mu1, mu2, values["P"], scales, checks)
