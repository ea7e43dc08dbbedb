"""What comes of a request for an observer of a Lipschitz system."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Self

from flint import fmpq

from obsdesign.dissipation.certificate import Certificate
from obsdesign.families.lipschitz.claim import needed
from obsdesign.families.reasons import Diagnosis
from obsdesign.lmi.formula import Array, in_floats


@dataclass(frozen=True)
class Proved:
    """A Lipschitz constant (the largest of those of the blocks), and the certificate for it."""

    lipschitz: fmpq
    certificate: Certificate


@dataclass(frozen=True)
class LipschitzDesign:
    """Certified or uncertified gains, or why there are none."""

    status: str  # certified | uncertified | infeasible
    gains: dict[str, Array] = field(default_factory=dict)  # L: doubles, to be read as the decimals they print
    proved: Proved | None = None
    admissible: Proved | None = None  # largest constant that the gains are proved to tolerate, if `proved` is for less
    limit: dict[str, Any] = field(default_factory=dict)
    limit_bounded: dict[str, Any] = field(default_factory=dict)
    widened: dict[str, float] = field(default_factory=dict)  # best gamma over all larger constants, and the constant
    comparison: tuple[dict[str, Any], ...] = ()  # a row for each relaxation
    ceiling: float | None = None  # constant that no gain can exceed
    points: tuple[dict[str, Any], ...] = ()  # of a search over the weight, or over weight and decay
    diagnosis: Diagnosis = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    solves: int = 0
    time_s: float = 0.0

    @classmethod
    def of(cls, L: Array, proved: Proved | None, **further: Any) -> Self:
        """Design of a gain, in rationals, with a proof or without."""
        return cls("certified" if proved else "uncertified", {"L": in_floats(L)}, proved, **further)

    def covers(self, declared: Sequence[fmpq]) -> bool:
        """Whether what is proved is about an f with the declared constants."""
        return bool(self.proved and self.proved.lipschitz >= needed(declared))

    @property
    def certificate(self) -> Certificate | None:
        """Certificate of the guarantee."""
        return self.proved.certificate if self.proved else None
