"""What a Lipschitz constant that is proved for a gain says of the plant: constants, margin, and a sentence."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from flint import fmpq

from obsdesign.dissipation.guarantee import Quadratic
from obsdesign.families.lipschitz.relaxations import EQUATIONS, proportions
from obsdesign.lmi.formula import printed


@dataclass(frozen=True)
class LipschitzClaim:
    """What a gain is proved to achieve for every f whose blocks have Lipschitz constants within those claimed.

    Proposition 1 of Abbaszadeh and Marquez (2010): f + h has constants of at most those of f and h together. So what
    the gain tolerates beyond the declared constants is left for an uncertainty h that enters through the same Bf and
    Cq.
    """

    declared: tuple[fmpq, ...]  # constant of each block of f
    lipschitz: fmpq  # proved, the largest of those of the blocks
    guarantee: Quadratic  # at this constant
    admissible: tuple[fmpq, Quadratic] | None  # a larger constant that the gain tolerates too, and the guarantee there
    drive: str  # letter of what drives the plant with its disturbance model; empty if nothing does
    validity: str | None  # where the declared constants hold; None: everywhere

    @property
    def covers(self) -> bool:
        """Whether the declared constants are within those that are proved."""
        return bool(self.lipschitz >= needed(self.declared))

    @property
    def spare(self) -> fmpq:
        """What is tolerated beyond the largest declared constant; negative where not even that is."""
        return (self.admissible[0] if self.admissible else self.lipschitz) - needed(self.declared)

    @property
    def margin(self) -> float:
        """Largest double within what is spare."""
        return below(self.spare)

    @property
    def constants(self) -> list[float]:
        """Constants of the blocks that are proved."""
        return self.shared(self.lipschitz)

    def shared(self, largest: fmpq) -> list[float]:
        """Constants of the blocks in proportion to the declared ones."""
        return [below(largest * share) for share in proportions(self.declared)]

    def statement(self) -> str:
        """Claim in words, with norms over [0, T] for every T, and with the observer written out."""
        g = self.guarantee
        level = f"norm2(z) <= sqrt(e0' P e0) + {g.gamma!r} norm2({self.drive}), and "
        decays = f"|e(t)| <= sqrt(cond(P)) exp(-{g.alpha!r} t) |e0|" if g.alpha else "e(t) -> 0"
        said = f"{level}{decays} where {self.drive} = 0" if self.drive else decays
        parts = [f"{said}; for {EQUATIONS}", f"for every f with {bounds('f', self.constants)}", *self.beyond()]
        return "; ".join([*parts, f"local: {self.validity}"] if self.validity else parts)

    def beyond(self) -> list[str]:
        """Clause on what is left for an uncertainty, or on what is missing."""
        if not self.covers:
            return [f"the spec declares {float(needed(self.declared))!r}, of which this says nothing"]
        if self.margin <= 0:
            return []
        level = f" and gamma = {self.admissible[1].gamma!r}" if self.admissible and self.drive else ""
        same = f"with another P{level} the same" if self.admissible else "the same"
        left = bounds("h", self.shared(self.spare))
        return [f"Proposition 1: {same} for f + h, for every h through the same Bf and Cq with {left}"]


def needed(declared: Sequence[fmpq]) -> fmpq:
    """Smallest decimal of a double that is not below the largest of the declared constants."""
    return printed(-below(-max(declared)))


def meaning(drive: str) -> str:
    """What gamma is, for the letter of what drives the plant with its disturbance model."""
    return f"norm2(z) <= gamma norm2({drive}) from zero error"


def bounds(name: str, constants: Sequence[float]) -> str:
    """Lipschitz conditions of the blocks of a function."""
    if len(constants) == 1:
        return f"|d{name}| <= {constants[0]!r} |dq|"
    return ", ".join(f"|d{name}{i}| <= {c!r} |dq{i}|" for i, c in enumerate(constants, start=1))


def below(x: fmpq) -> float:
    """Largest double, read as the decimal that prints it, that is not above x."""
    double = float(x)
    while printed(double) > x:
        double = math.nextafter(double, -math.inf)
    return double
