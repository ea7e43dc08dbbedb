"""A type of nonlinearity: what it assumes of f, what data it takes, and what follows from it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from flint import fmpq

from obsdesign.model.multiplier import Multiplier
from obsdesign.nonlinearities.data import Data
from obsdesign.nonlinearities.evidence.automatic import Choice, slopes_proved
from obsdesign.nonlinearities.evidence.claims import Claim, Quadratic, Worded, generators
from obsdesign.nonlinearities.evidence.restriction import Restriction

Slopes = list[tuple[fmpq, fmpq | None]]


@dataclass(frozen=True)
class Template:
    """A type; only its multiplier is needed. A type of which more is known overrides what is said of it here."""

    multiplier: Callable[[Any, int, int], Multiplier]  # of (data, nq, nf)
    data: Data | None = None  # None: it takes none
    square: bool = True  # nf = nq
    inequalities: tuple[tuple[str, fmpq], ...] = ()  # of each scale: the inequality, as this factor times the form of M
    derive: Callable[[Restriction], Choice] | None = None  # data from f, for `auto`
    f: str | None = None  # the function itself, an expression of q, where the type names one

    def __call__(self, data: Any, nq: int, nf: int) -> Multiplier:
        """Multiplier of f with nf components of an argument with nq; raises `UsageError` if there is none."""
        return self.multiplier(data, nq, nf)

    def claims(self, data: Any, multiplier: Multiplier) -> Iterator[Claim]:  # noqa: ARG002
        """Inequalities that a pair of arguments can violate, for multipliers that are sums of scaled matrices."""
        matrices = list(generators(multiplier))
        if len(self.inequalities) == len(matrices):
            yield from (Worded(M, *words) for M, words in zip(matrices, self.inequalities, strict=True))
        else:
            yield from map(Quadratic, matrices)

    def slopes(self, data: Any, nq: int) -> Slopes:  # noqa: ARG002
        """Bounds of the slope of each f_i that depends on q_i only; none if the type is not about slopes."""
        return []

    def constants(self, data: Any, nq: int) -> tuple[fmpq, ...]:
        """Lipschitz constant of f, or one for each component with a slope of its own; empty if none is known."""
        slopes = self.slopes(data, nq)
        if not all(high is not None for _, high in slopes):
            return ()
        return tuple(max(abs(low), abs(high)) for low, high in slopes if high is not None)

    def proved(self, f: Restriction, data: Any) -> bool:
        """Whether f surely is of this type on its region; False says nothing."""
        return slopes_proved(f, self.slopes(data, f.nq))
