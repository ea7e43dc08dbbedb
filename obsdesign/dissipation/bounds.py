"""What a request may hold of any family: ranges that are searched, bounds that a design keeps, and the slack."""

from collections.abc import Iterator
from typing import Literal, Protocol

import numpy as np
from flint import fmpq

from obsdesign.dissipation.region import Region
from obsdesign.errors import Problem, UsageError
from obsdesign.records import dataclass

SLACK = fmpq(1, 20)


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


def ends(value: fmpq | Range) -> tuple[fmpq, fmpq]:
    """Ends of a range; a number is a range of itself."""
    return (value.low, value.high) if isinstance(value, Range) else (value, value)


@dataclass(frozen=True)
class Bounds:
    """Largest gain, storage function and level that a design may use, and where its poles lie; None is no bound."""

    L1: fmpq | None = None
    norm: Literal["spectral", "frobenius"] = "spectral"  # of L1
    P: fmpq | None = None  # P <= p I
    gamma: fmpq | None = None
    floor: fmpq | None = None  # P >= t I
    poles: Region | None = None  # of every frozen member
    necessary: bool = False  # what every gain within L1 satisfies, in place of what only such gains do

    @property
    def restricted(self) -> bool:
        """Whether anything but gamma is bounded."""
        return (self.L1, self.P, self.floor, self.poles) != (None, None, None, None)

    @property
    def closed(self) -> bool:
        """Whether a finite gain is at the least objective within them."""
        keeps = (self.L1, self.P, self.floor) != (None, None, None)
        return keeps and not (self.poles is not None and self.poles.strict)

    def words(self, gain: str) -> list[str]:
        """What is bounded besides gamma, one phrase for each."""
        named = {f"|{gain}|{'_F' if self.norm == 'frobenius' else ''} <= {{:g}}": self.L1}
        named |= {"P <= {:g} I": self.P, "P >= {:g} I": self.floor}
        said = [phrase.format(float(bound)) for phrase, bound in named.items() if bound is not None]
        return said + ([] if self.poles is None else self.poles.words())


NO_BOUNDS = Bounds()


@dataclass(frozen=True)
class Trade:
    """Gamma against the size of a gain, whose knee is shipped: over some bounds on it, or over those that are found."""

    gain: str  # L1, L or K
    sizes: Range | None = None  # None: `bounds: auto`


class Conflicting(Protocol):
    """A request whose keys may not go together."""

    def conflicts(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Keys that do not go together, and why, with what to do instead."""


def require_agreement(request: Conflicting) -> None:
    """Refuse a request whose keys do not go together.

    Raises `UsageError`: one problem for each key, as the reader of a spec reports them with their places.
    """
    problems = [Problem(why, key=".".join(("observer", *keys)), id="OBS206") for keys, why in request.conflicts()]
    if problems:
        raise UsageError(*problems)
