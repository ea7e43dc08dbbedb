"""What a spec asks of an observer of a Lipschitz system, in the numbers of the spec."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from flint import fmpq

from obsdesign.dissipation.bounds import SLACK, Bounds, Range
from obsdesign.lmi.formula import Array

ZERO = fmpq(0)

LipschitzObjective = Literal["max-lipschitz", "min-gamma", "pareto"]
LipschitzRelaxation = Literal["s-procedure", "norm-bound", "abbaszadeh", "compare"]


@dataclass(frozen=True)
class LipschitzRequest:
    """The `observer` section of a spec for the family of Lipschitz systems.

    The bound L1 is that of L. Only the decay and the weight of `pareto` may be ranges.
    """

    type: str
    lipschitz: tuple[fmpq, ...]  # declared constant of each block of f
    relaxation: LipschitzRelaxation = "s-procedure"
    objective: LipschitzObjective = "max-lipschitz"
    weight: fmpq | Range | None = None  # of 1 / lipschitz against gamma^2, in [0, 1], for pareto
    decay: fmpq | Range = ZERO  # beta, 1/s
    slack: fmpq = SLACK
    bounds: Bounds = field(default_factory=Bounds)
    gains: Mapping[str, Array] | None = None  # L (n, ny): analysis of this

    def conflicts(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Keys that do not go with the objective or the relaxation, and why, with what to do instead."""
        if self.objective == "pareto" and self.gains is not None:
            yield ("gains",), "pareto designs gains; analyze given ones with max-lipschitz or min-gamma"
        if self.objective != "min-gamma" and self.bounds.gamma is not None:
            said = "pareto weighs" if self.objective == "pareto" else "max-lipschitz knows no"
            yield ("bounds", "gamma"), f"{said} gamma; bound it with min-gamma"
        if (self.objective, self.relaxation) == ("max-lipschitz", "s-procedure") and self.bounds.floor is not None:
            said = "the P of max-lipschitz has no scale in the s-procedure; bound L, or choose norm-bound"
            yield ("bounds", "P"), said
        for key, value in (("weight", self.weight), ("decay", self.decay)):
            if self.relaxation == "compare" and isinstance(value, Range):
                yield (key,), "compare takes a number, not a range; choose one relaxation for a curve"
