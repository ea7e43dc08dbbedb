"""How fast an error decays, as a theorem has it and as it is told.

A theorem has a rate, and a larger one is always harder: alpha (1/s) of V' + 2 alpha V, or 1 - rho of V+ - rho^2 V.
A spec and a file have alpha or rho. 1 - (1 - rho) is rho, so the way to and fro is the same.
"""

from typing import Any

from flint import fmpq

from obsdesign.dissipation.decimals import round_down, round_up
from obsdesign.lmi.formula import rational_number
from obsdesign.records import dataclass
from obsdesign.tables.text import at_least, at_most

DIGITS = 12  # of a rho that is found: 1 - rho of these is exact enough for every 1 - rho above 1e-6


@dataclass(frozen=True)
class Pace:
    """The quantity in which decay is told: alpha or decay in 1/s, or rho, the factor a sample."""

    key: str  # in a spec and in a file
    sampled: bool = False  # whether it is rho

    def told(self, rate: Any) -> Any:
        """Alpha of a rate, or rho; and the rate of alpha, or of rho."""
        return 1 - rate if self.sampled else rate

    def found(self, rate: float) -> fmpq:
        """Rate of a search, in rationals, whose alpha or rho has few digits."""
        told = float(f"{1 - rate:.{DIGITS}g}") if self.sampled else rate
        return fmpq(self.told(rational_number(repr(told))))

    def said(self, rate: Any, digits: int = 6) -> str:
        """That alpha or rho is .. ."""
        return f"{self.key} = {float(self.told(rate)):.{digits}g}"

    def slower(self, rate: float, digits: int = 4) -> str:
        """Alpha at most .., or rho at least .., which is no faster than a rate."""
        return (
            f"{self.key} at least {at_most(1 - rate, digits)}"
            if self.sampled
            else (f"{self.key} at most {at_least(rate, digits)}")
        )

    def rounded(self, rate: float, digits: int) -> float:
        """Rate no faster than another, whose alpha or rho has few digits."""
        return 1 - round_up(1 - rate, digits) if self.sampled else round_down(rate, digits)

    def within(self, rate: float, slack: float) -> float:
        """Rate whose alpha is at least 1 / (1 + slack) of another, or whose rho at most 1 + slack times it."""
        return 1 - (1 - rate) * (1 + slack) if self.sampled else rate / (1 + slack)

    def only(self, rate: float) -> str:
        """What an error does that decays at a rate which is too slow."""
        if self.sampled:
            return f"is multiplied by {1 - rate:.6g} a sample"
        return f"grows at the rate {-rate:.6g}" if rate < 0 else f"decays at the rate {rate:.6g} only"

    def edge(self, rate: float) -> str:
        """Up to alpha = .., or from rho = .. on."""
        return f"from {self.said(rate, 5)} on" if self.sampled else f"up to {self.said(rate, 5)}"

    @property
    def stronger(self) -> str:
        """What asks for more."""
        return f"a smaller {self.key}" if self.sampled else f"a larger {self.key}"

    @property
    def weaker(self) -> str:
        """What asks for less: a smaller alpha, or a larger rho."""
        return f"a larger {self.key}" if self.sampled else f"a smaller {self.key}"

    @property
    def some(self) -> str:
        """Any decay at all."""
        return f"{self.key} {'< 1' if self.sampled else '> 0'}"

    def necessary(self, limit: float) -> str:
        """That a rate has to be below a limit."""
        return f"{self.key} {'above' if self.sampled else 'below'} {self.told(limit):g} is necessary"

    @property
    def bound(self) -> str:
        """Key in `feasible` of a number that alpha must stay below, or rho above."""
        return f"{self.key}_above" if self.sampled else f"{self.key}_below"


ALPHA, DECAY, RHO = Pace("alpha"), Pace("decay"), Pace("rho", sampled=True)
