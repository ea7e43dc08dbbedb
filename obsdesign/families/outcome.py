"""What comes of a request, whatever the family: gains with a claim that is proved of them, or why there are none."""

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any, Protocol

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.scaling import Factors
from obsdesign.families.guarantee import Guarantee
from obsdesign.lmi.formula import Array
from obsdesign.lmi.proof import Check, Proved
from obsdesign.records import dataclass, field, replace
from obsdesign.spec import Spec

Diagnosis = dict[str, Any]  # condition, reason, feasible, suggestion, and data of the condition
BEST_FOUND = {"kind": "best-found"}  # of a limit: nothing better is known, and nothing says that there is none
BETTER = {"gamma": -1, "lipschitz": 1, "T2": 1, "alpha": 1, "decay": 1, "rho": -1}  # sense of what has a limit
ACCURACY = 1e-4  # of a limit, relative


class Verdict(StrEnum):
    """How a design ends."""

    CERTIFIED = "certified"  # the claim is proved for the very gains
    UNCERTIFIED = "uncertified"  # there are gains, and the proof failed
    INFEASIBLE = "infeasible"
    NO_GUARANTEE = "no guarantee"  # nothing can be proved of what runs
    REFUTED = "refuted"  # what the observer rests on is false
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
    used: tuple[str, ...] = ()  # keys of the certificate of a diagnosis that it was proved from


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
    limit: dict[str, Any] = field(default_factory=dict)  # over all gains, by its name, with its `kind`; numerical
    limit_bounded: dict[str, Any] = field(default_factory=dict)  # .. within the bounds of the spec
    beyond: dict[str, Any] = field(default_factory=dict)  # what else is known of the limit, under the names of a file
    search: Search | None = None
    diagnosis: Diagnosis = field(default_factory=dict)  # why there are no gains; empty where there are some
    notes: tuple[str, ...] = ()  # what a user should know, in sentences
    scalars: dict[str, Any] = field(default_factory=dict)  # scalar unknowns of what was solved
    scaling: Factors = field(default_factory=dict)  # units that were solved in; none: those of the spec
    form: Any = None  # of an observer that has no gains: its equations, as its family has them

    @property
    def built(self) -> bool:
        """Whether there is an observer that can run."""
        return bool(self.gains) or self.form is not None

    def limits(self) -> dict[str, Any]:
        """Entries of a result file that are not proved."""
        bounded = {"limit_bounded": finite(self.limit_bounded)} if self.limit_bounded else {}
        known = self.limit if self.limit.keys() - {"attained"} else {"attained": False, "kind": "not-computed"}
        return {"limit": finite(known), **bounded, **self.beyond}

    def within_limits(self, spec: Spec) -> "Outcome":
        """Same with limits that nothing that is proved is better than."""
        if self.claim is None or not self.claim.holds:
            return self
        proved = self.claim.written(spec, {})["guarantee"]
        return replace(self, limit=limited(self.limit, proved), limit_bounded=limited(self.limit_bounded, proved))


def bounded_kind(bounds: Bounds) -> dict[str, Any]:
    """Kind of a limit within bounds: a bound on a gain has sufficient conditions only."""
    return {} if bounds.L1 is None else dict(BEST_FOUND)


def limited(limit: Mapping[str, Any], proved: Mapping[str, Any]) -> dict[str, Any]:
    """Limit, or what is proved where that is better in every number of both: it is the best found then."""
    names = [name for name in BETTER if name in limit and name in proved]
    ahead = [BETTER[name] * (proved[name] - limit[name]) for name in names]
    if min(ahead, default=0) < 0 or max(ahead, default=0) <= 0:
        return dict(limit)
    found = {**limit, **{name: proved[name] for name in names}}
    if all(abs(proved[name] - limit[name]) <= ACCURACY * abs(limit[name]) for name in names):
        return found
    reached = {"attained": True} if "attained" in limit else {}
    return {**{name: value for name, value in found.items() if name != "objective"}, **reached, **BEST_FOUND}


def finite(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers that a file can hold: "unbounded" stands for those that are infinite."""
    kept = {key: value for key, value in numbers.items() if value != math.inf}
    return kept if len(kept) == len(numbers) else {"unbounded": True, **kept, "attained": False}
