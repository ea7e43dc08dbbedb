"""What comes of a request, whatever the family: gains with a claim that is proved of them, or why there are none."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol

from obsdesign.families.guarantee import Guarantee
from obsdesign.lmi.formula import Array
from obsdesign.lmi.proof import Check, Proved
from obsdesign.spec import Spec

Diagnosis = dict[str, Any]  # condition, reason, feasible, suggestion, and data of the condition


class Verdict(StrEnum):
    """How a design ends."""

    CERTIFIED = "certified"  # the claim is proved for the very gains
    UNCERTIFIED = "uncertified"  # there are gains, and the proof failed
    INFEASIBLE = "infeasible"
    UNDECIDED = (
        "undecided"  # no gains were found, and nothing says that there are none: no design ends so, but an error
    )


class Claim(Protocol):
    """What is proved of gains, with the witness that proves it; the file of a family that holds it also reads it.

    A claim is about the plant, the multiplier and the gains. What it says of a spec, in numbers and in words, depends
    on more: where the types hold, what drives the plant, which constants are declared.
    """

    @property
    def checks(self) -> tuple[Check, ...]:
        """Every condition that was checked, in rationals."""

    @property
    def holds(self) -> bool:
        """Whether it is proved."""

    def guarantee(self, spec: Spec) -> Guarantee | None:
        """What a run is held against, in doubles; None where the claim says nothing of the plant of the spec."""

    def statement(self, spec: Spec) -> str:
        """Claim in words, with the observer written out."""

    def headline(self, spec: Spec) -> str:
        """Claim in one line."""

    def written(self, spec: Spec, limits: Mapping[str, Any]) -> dict[str, Any]:
        """Entries `guarantee`, which holds the limits beside what is proved, and `certificate` of a result file."""


@dataclass(frozen=True)
class Proof(Proved):
    """What was claimed, in words, the conditions that were checked of it, and what of the file is not proved."""

    claim: str
    checks: tuple[Check, ...]
    numerical: tuple[str, ...] = ()  # dotted paths


@dataclass(frozen=True)
class Search:
    """Points of a search, over one parameter or over several, as one curve or as several side by side."""

    parameter: str
    points: tuple[dict[str, Any], ...]
    parameters: tuple[str, ...] = ()  # where there are several
    curves: tuple[dict[str, Any], ...] = ()  # each with its points; `points` are then those of the first

    def written(self) -> dict[str, Any]:
        """Entry of a result file."""
        return {
            "parameter": self.parameter,
            **({"parameters": list(self.parameters)} if self.parameters else {}),
            "points": [finite(point) for point in self.points],
            **({"curves": list(self.curves)} if self.curves else {}),
        }


@dataclass(frozen=True)
class Outcome:
    """Certified or uncertified gains, or why there are none."""

    status: Verdict
    gains: Mapping[str, Array] = field(
        default_factory=dict
    )  # by name; doubles that print as the decimals that are proved
    claim: Claim | None = None  # what was proved of the gains, or tried to be
    limit: dict[str, Any] = field(default_factory=dict)  # infimum or supremum over all gains, by its name; numerical
    limit_bounded: dict[str, Any] = field(default_factory=dict)  # .. within the bounds of the spec
    beyond: dict[str, Any] = field(default_factory=dict)  # what else is known of the limit, under the names of a file
    search: Search | None = None
    diagnosis: Diagnosis = field(default_factory=dict)  # why there are no gains; empty where there are some
    notes: tuple[str, ...] = ()  # what a user should know, in sentences
    scalars: dict[str, Any] = field(default_factory=dict)  # scalar unknowns of what was solved

    def limits(self) -> dict[str, Any]:
        """Entries of a result file that are not proved."""
        bounded = {"limit_bounded": finite(self.limit_bounded)} if self.limit_bounded else {}
        return {"limit": finite(self.limit or {"attained": False}), **bounded, **self.beyond}


def finite(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers that a file can hold: "unbounded" stands for those that are infinite."""
    kept = {key: value for key, value in numbers.items() if value != math.inf}
    return kept if len(kept) == len(numbers) else {"unbounded": True, **kept, "attained": False}
