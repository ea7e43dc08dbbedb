"""From a request for an observer with sporadic measurements to gains with clock-dependent certificates."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from flint import fmpq

from obsdesign.dissipation.bounds import Range, ends
from obsdesign.dissipation.engine import Engine
from obsdesign.families.finding import hidden_mode
from obsdesign.families.outcome import BEST_FOUND, Outcome, Verdict
from obsdesign.families.sporadic.clock.analysis import Analysis
from obsdesign.families.sporadic.clock.claim import ClockClaim
from obsdesign.families.sporadic.clock.reasons import useless
from obsdesign.families.sporadic.clock.study import fastest, longest, proof_of_longest, system, witnesses
from obsdesign.families.sporadic.gains import LONGER, SHORTER
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.families.sporadic.study import within_slack
from obsdesign.lmi.formula import Array, Exact, in_floats, printed
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant


@dataclass
class ClockDesigner:
    """The steps of one design."""

    plant: Plant[Exact]
    multiplier: Multiplier
    Cp: Array
    request: SporadicRequest
    engine: Engine
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.T1, self.T2, self.decay = self.request.T1, Range(*ends(self.request.T2)), Range(*ends(self.request.decay))
        self.lowest = max(printed(self.T2.low), printed(self.T1)), printed(self.decay.low)

    def outcome(self) -> Outcome:
        """Gates that need no solver, then the objective."""
        member, decay = in_floats(self.multiplier.member), float(self.lowest[1])
        hidden = hidden_mode(self.plant.doubles, member, decay, "lambda_t = ")
        if hidden:
            return Outcome(Verdict.INFEASIBLE, diagnosis=hidden)
        given = self.request.gains
        assert given
        return self.analysed({name: printed(gain) for name, gain in given.items()})

    def analysis(self, gains: Mapping[str, Array]) -> Analysis:
        """Error of gains, in rationals."""
        error = system(self.plant, self.Cp, gains)
        return Analysis(self.engine, error, self.multiplier, printed(self.T1), self.request.shape)

    # Given gains

    def analysed(self, gains: Mapping[str, Array]) -> Outcome:
        """What given gains are proved to achieve, and the T2 that they tolerate.

        For max-T2 and max-decay, within the slack of the largest value for which there is a solution.
        """
        analysis, (T2, decay), slack = self.analysis(gains), self.lowest, self.request.slack
        most = self.tolerated(analysis, T2, decay)
        limit: dict[str, Any] = {}
        if most is None or most < float(T2):
            diagnosis = useless(self.T1, T2, decay, most)
            return Outcome(Verdict.INFEASIBLE, doubles(gains), diagnosis=diagnosis, notes=tuple(self.notes))
        if self.request.objective == "max-T2":
            limit = {"T2": min(most, float(self.T2.high))}
            T2 = within_slack(limit["T2"], float(T2), slack)
        if self.request.objective == "max-decay":
            limit = {"decay": fastest(analysis, T2, decay, float(self.decay.high)) or float(decay)}
            decay = within_slack(limit["decay"], float(decay), slack)
        claim = self.claim(analysis, gains, T2, decay, most)
        if claim is None:
            return Outcome(Verdict.UNCERTIFIED, doubles(gains), notes=tuple(self.notes))
        known = {**limit, "attained": False, **BEST_FOUND} if limit else {}
        verdict = Verdict.CERTIFIED if claim.holds else Verdict.UNCERTIFIED
        return Outcome(verdict, doubles(gains), claim, limit=known, notes=tuple(self.notes))

    def tolerated(self, analysis: Analysis, T2: fmpq, decay: fmpq) -> float | None:
        """Largest T2 for which there is a solution, of T1 or a small part of what is asked for, to ten times that."""
        low = max(float(self.T1), SHORTER * float(T2))
        return longest(analysis, decay, low, max(LONGER * float(T2), float(self.T2.high)))

    def claim(
        self, analysis: Analysis, gains: Mapping[str, Array], T2: fmpq, decay: fmpq, most: float | None = None
    ) -> ClockClaim | None:
        """Claim of gains with a witness of each part; `most`: the longest T2 that they seem to tolerate."""
        found = witnesses(analysis, T2, decay)
        if "gamma" not in found:
            return None
        beyond = None if most is None else proof_of_longest(analysis, most, decay, T2)
        direct = any([*self.plant.D.flat, *self.plant.Df.flat])
        return ClockClaim(analysis.system, self.multiplier, direct, gains, printed(self.T1), T2, decay, found, beyond)


def doubles(gains: Mapping[str, Array]) -> dict[str, Array]:
    """Gains as doubles, which print as the decimals that were proved."""
    return {name: in_floats(gain) for name, gain in gains.items()}
