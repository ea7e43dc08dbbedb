"""What a spec asks of an observer with the gains L1 and L2, in the numbers of the spec."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from flint import fmpq

from obsdesign.dissipation.bounds import SLACK, Bounds, Range
from obsdesign.lmi.formula import Array, printed

Objective = Literal["min-gamma", "max-alpha", "feasibility", "pareto"]


@dataclass(frozen=True)
class Request:
    """The `observer` section of a spec for the families whose observer is (12), with gains L1 and L2."""

    type: str
    L2: Array | None  # (nq, ny); None: free
    alpha: fmpq | Range
    objective: Objective | Literal["gamma"] = "min-gamma"
    gamma: fmpq | None = None  # the level to reach, for objective "gamma"
    slack: fmpq = SLACK
    bounds: Bounds = field(default_factory=Bounds)
    gains: Mapping[str, Array] | None = None  # analysis of these instead of a design
    reconstruct: bool = False  # w by pinv(B) L1 (yhat - y)

    def printed(self) -> "Request":
        """Same request with every number that a result file repeats as the decimal that it will hold."""
        alpha = self.alpha
        if isinstance(alpha, Range):
            alpha = replace(alpha, low=printed(alpha.low), high=printed(alpha.high))
        else:
            alpha = printed(alpha)
        return replace(
            self,
            alpha=alpha,
            L2=None if self.L2 is None else printed(self.L2),
            gamma=None if self.gamma is None else printed(self.gamma),
            gains=self.gains and {name: printed(matrix) for name, matrix in self.gains.items()},
        )
