"""What a spec asks of an observer design, in the numbers of the spec."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.lmi.formula import Array, printed

SLACK = fmpq(1, 20)
ZERO = fmpq(0)
INJECTIONS = {  # how the correction evolves between measurements, and its relaxations, the tightest first
    "dynamic": ("proposition-2", "proposition-3", "proposition-4"),
    "predictor": ("proposition-2",),
    "hold": ("proposition-5",),
}

Objective = Literal["min-gamma", "max-alpha", "feasibility", "pareto"]
SporadicObjective = Literal["min-gamma", "max-T2", "max-decay", "pareto", "feasibility"]
LipschitzObjective = Literal["max-lipschitz", "min-gamma", "pareto"]
LipschitzRelaxation = Literal["s-procedure", "norm-bound", "abbaszadeh", "compare"]


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


@dataclass(frozen=True)
class SporadicRequest:
    """The `observer` section of a spec for the family whose measurements arrive sporadically."""

    type: str
    T1: fmpq  # s, shortest interval between measurements
    T2: fmpq | Range  # s, longest
    decay: fmpq | Range  # lambda_t, 1/s
    delta: Range  # where the free exponent of the storage function is searched; a number is a range of itself
    injections: tuple[str, ...]  # of INJECTIONS, a curve each
    relaxations: tuple[str, ...]  # of these injections, a curve each; empty: the tightest of each
    objective: SporadicObjective = "min-gamma"
    slack: fmpq = SLACK
    largest_gain: fmpq | None = None  # bounds.L, spectral
    largest_gamma: fmpq | None = None
    gains: Mapping[str, Array] | None = None  # L (n, ny) and H (ny, ny): analysis of these

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Injection and relaxation of each curve, in the order of the request, each once."""
        wanted = {name: self.relaxations or INJECTIONS[name][:1] for name in self.injections}
        found = ((name, r) for name, relaxations in wanted.items() for r in relaxations if r in INJECTIONS[name])
        return tuple(dict.fromkeys(found))

    def conflicts(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Relaxations that fit none of the injections, or else injections that have none of the relaxations."""
        known = "; ".join(f"{name} takes {', '.join(relaxations)}" for name, relaxations in INJECTIONS.items())
        fitting = {relaxation for _, relaxation in self.pairs}
        strays = [relaxation for relaxation in self.relaxations if relaxation not in fitting]
        for relaxation in strays:
            yield ("relaxation",), f"{relaxation} is for another injection than {', '.join(self.injections)}; {known}"
        for name in self.injections if not strays else ():
            if name not in {injection for injection, _ in self.pairs}:
                yield ("injection",), f"{name} has none of the relaxations that are listed; {known}"


def require_agreement(request: LipschitzRequest | SporadicRequest) -> None:
    """Refuse a request whose keys do not go together.

    Raises
    ------
    UsageError
        One problem for each key, as the reader of a spec reports them with their places.
    """
    problems = [Problem(why, key=".".join(("observer", *keys))) for keys, why in request.conflicts()]
    if problems:
        raise UsageError(*problems)
