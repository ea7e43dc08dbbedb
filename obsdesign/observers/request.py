"""What a spec asks of an observer design, in the numbers of the spec."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array, printed

SLACK = fmpq(1, 20)
ZERO = fmpq(0)


@dataclass(frozen=True)
class Range:
    """An interval that is searched."""

    low: fmpq
    high: fmpq
    points: int = 25
    log: bool = False

    def grid(self) -> tuple[fmpq, ...]:
        """The points, ends included, as the exact values of doubles with 12 digits."""
        low, high = float(self.low), float(self.high)
        inner = (np.geomspace if self.log else np.linspace)(low, high, self.points)[1:-1]
        return (self.low, *(fmpq(*float(f"{x:.12g}").as_integer_ratio()) for x in inner), self.high)


@dataclass(frozen=True)
class Bounds:
    """Largest gain, storage function and performance level that a design may use; None is no bound."""

    L1: fmpq | None = None
    norm: Literal["spectral", "frobenius"] = "spectral"  # of L1
    P: fmpq | None = None  # P <= p I
    gamma: fmpq | None = None
    floor: fmpq | None = None  # P >= t I


@dataclass(frozen=True)
class Request:
    """The `observer` section of a spec for the families whose observer is (12), with gains L1 and L2."""

    type: str
    L2: Array | None  # (nq, ny); None: free
    alpha: fmpq | Range
    objective: Literal["min-gamma", "max-alpha", "feasibility", "pareto", "gamma"] = "min-gamma"
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


@dataclass(frozen=True)
class LipschitzRequest:
    """The `observer` section of a spec for the family of Lipschitz systems.

    The bound L1 is that of L. Only the decay and the weight of `pareto` may be ranges.
    """

    type: str
    lipschitz: tuple[fmpq, ...]  # declared constant of each block of f
    relaxation: Literal["s-procedure", "norm-bound", "abbaszadeh", "compare"] = "s-procedure"
    objective: Literal["max-lipschitz", "min-gamma", "pareto"] = "max-lipschitz"
    weight: fmpq | Range | None = None  # of 1 / lipschitz against gamma^2, in [0, 1], for pareto
    decay: fmpq | Range = ZERO  # beta, 1/s
    slack: fmpq = SLACK
    bounds: Bounds = field(default_factory=Bounds)
    gains: Mapping[str, Array] | None = None  # L (n, ny): analysis of this


@dataclass(frozen=True)
class SporadicRequest:
    """The `observer` section of a spec for the family whose measurements arrive sporadically."""

    type: str
    T1: fmpq  # s, shortest interval between measurements
    T2: fmpq | Range  # s, longest
    decay: fmpq | Range  # lambda_t, 1/s
    delta: Range  # where the free exponent of the storage function is searched; a number is a range of itself
    injections: tuple[str, ...]  # dynamic | predictor | hold, a curve each
    relaxations: tuple[str, ...]  # proposition-2 .. proposition-5, a curve each; empty: the tightest of each injection
    objective: Literal["min-gamma", "max-T2", "max-decay", "pareto", "feasibility"] = "min-gamma"
    slack: fmpq = SLACK
    largest_gain: fmpq | None = None  # bounds.L, spectral
    largest_gamma: fmpq | None = None
    gains: Mapping[str, Array] | None = None  # L (n, ny) and H (ny, ny): analysis of these
