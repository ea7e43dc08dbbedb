"""From a request for an observer with sporadic measurements to gains with clock-dependent certificates.

No method knows the least gamma over all gains: the limit is the best that is found. The gains that are shipped are the
smallest that were found within the slack of it, rounded to few digits, and every claim is proved for the rounded ones.
"""

import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any

from flint import fmpq

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.bounds import Range, ends
from obsdesign.dissipation.decimals import significant
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import DIGITS
from obsdesign.dissipation.pace import DECAY
from obsdesign.errors import UndecidedError
from obsdesign.families.finding import UNDISTURBED, hidden_mode
from obsdesign.families.outcome import BEST_FOUND, Outcome, Verdict
from obsdesign.families.sporadic.clock.analysis import Analysis
from obsdesign.families.sporadic.clock.bernstein import of_gain
from obsdesign.families.sporadic.clock.claim import ClockClaim
from obsdesign.families.sporadic.clock.outage import outage
from obsdesign.families.sporadic.clock.reasons import above_bound, nothing_found, undecided, unstable
from obsdesign.families.sporadic.clock.search import Curve, Found, main, norm
from obsdesign.families.sporadic.clock.study import fastest, longest, proof_of_longest, witnesses
from obsdesign.families.sporadic.clock.theorem import error_system
from obsdesign.families.sporadic.clock.truth import truth
from obsdesign.families.sporadic.gains import LONGER, SHORTER
from obsdesign.families.sporadic.held import held
from obsdesign.families.sporadic.reasons import hiding_interval, missed
from obsdesign.families.sporadic.request import RANGED, SporadicRequest
from obsdesign.families.sporadic.study import within_slack
from obsdesign.families.sporadic.theorem import tied_gain
from obsdesign.families.sporadic.units import units
from obsdesign.lmi.formula import Array, Exact, in_floats, printed
from obsdesign.model.edge import Edge
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, field, replace

CONSTANT = "a constant K has a smaller gamma than what was found of one that depends on the interval"
TIGHT = ("min-gamma", "pareto")  # objectives for which gamma counts
MODERATE = 2.0  # gamma of gains that only have to be feasible, relative to the least that is found
SHORT = 1000  # parts of T2: the T1 of a search for K where it is zero
FARTHER = (fmpq(1), fmpq(3), fmpq(6))  # slacks within which of a largest T2, or decay, a proof is tried
ROOM = 5e-3  # of gamma, left to the rounding of the gains
Point = tuple[dict[str, Any], Curve, Found | None]


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
        request = self.request
        self.T1, self.T2, self.decay = printed(request.T1), Range(*ends(request.T2)), Range(*ends(request.decay))
        self.lowest = max(printed(self.T2.low), self.T1), printed(self.decay.low)
        self.curves = [self.curve(name, gap) for name, _ in request.pairs for gap in self.gaps(name)]

    def gaps(self, name: str) -> tuple[bool, ...]:
        """Whether the gain of an injection depends on the interval; it may then be constant too."""
        if name != "reset" or not self.request.gap:
            return (False,)
        return (True,) if self.request.objective == "pareto" else (True, False)

    def curve(self, name: str, gap: bool) -> Curve:
        """Search of one injection, within the bound on its gain; `gap`: whether it depends on the interval."""
        request, resets = self.request, name == "reset"
        bound = request.largest_reset if resets else request.largest_gain
        kappa = None if bound is None else float(bound)
        problem = self.engine, self.plant, self.multiplier, self.Cp
        shortest = self.T1 or (self.lowest[0] / SHORT if resets else self.T1)  # where T1 = 0 ties P(0) to K
        own = units(self.plant.doubles, in_floats(self.Cp), float(self.lowest[0]), bounded=kappa is not None)
        return Curve(*problem, shortest, request.shape, name, kappa, gap, own)

    def outcome(self) -> Outcome:
        """Gates that need no solver, then the objective."""
        member, (T2, decay) = in_floats(self.multiplier.member), self.lowest
        if hidden := hidden_mode(self.plant.doubles, member, Edge(float(decay)), DECAY, "lambda_t = "):
            return Outcome(Verdict.INFEASIBLE, diagnosis=hidden)
        hiding = hiding_interval(self.plant, self.multiplier, float(decay), float(T2))
        if hiding and hiding["interval"] >= float(self.T1):
            return Outcome(Verdict.INFEASIBLE, diagnosis=hiding)
        if not self.plant.B.shape[1] and self.request.objective == "min-gamma":
            self.notes.append(UNDISTURBED)
        if given := self.request.gains:
            made = self.analysed({name: printed(gain) for name, gain in given.items()})
        else:
            made = self.searched()
        return replace(made, notes=(*made.notes, *self.notes))

    def searched(self) -> Outcome:
        """Gains for what is asked."""
        return self.farthest() if self.request.objective in RANGED else self.single()

    def analysis(self, gains: Mapping[str, Array]) -> Analysis:
        """Error of gains, in rationals."""
        error = error_system(self.plant, self.Cp, gains)
        clock = of_gain(self.T1, gains["knots"], gains["K_of_gap"]) if "K_of_gap" in gains else None
        return Analysis(self.engine, error, self.multiplier, self.T1, self.request.shape, clock)

    # Given gains

    def analysed(self, gains: Mapping[str, Array]) -> Outcome:
        """What given gains are proved to achieve, and the T2 that they tolerate.

        For max-T2 and max-decay, within the slack of the largest value for which there is a solution.
        """
        analysis, (T2, decay), slack = self.analysis(gains), self.lowest, self.request.slack
        most = self.tolerated(analysis, T2, decay)
        limit: dict[str, Any] = {}
        if most is None or most < float(T2):
            claim = self.claim(gains, T2, decay)  # the edge is numerical, and a proof is not
            if claim is None or not claim.holds:
                return self.useless(gains, T2, decay, most)
            most = float(T2)
        if self.request.objective == "max-T2":
            limit = {"T2": min(most, float(self.T2.high))}
            T2 = within_slack(limit["T2"], float(T2), slack)
        if self.request.objective == "max-decay":
            limit = {"decay": fastest(analysis, T2, decay, float(self.decay.high)) or float(decay)}
            decay = within_slack(limit["decay"], float(decay), slack)
        claim = self.claim(gains, T2, decay, most)
        if not limit and (least := analysis.gamma(T2, decay)) < math.inf:
            limit = {"gamma": least}
        return Outcome(
            Verdict.CERTIFIED if claim and claim.holds else Verdict.UNCERTIFIED,
            in_floats_of(gains),
            claim,
            limit={**limit, "attained": False, **BEST_FOUND} if limit else {},
        )

    def useless(self, gains: Mapping[str, Array], T2: fmpq, decay: fmpq, most: float | None) -> Outcome:
        """Answer that given gains achieve nothing, where intervals are found for which the error does not decay.

        Raises `UndecidedError`: none are found.
        """
        error = error_system(self.plant.doubles, in_floats(self.Cp), in_floats_of(gains))
        found = {} if error.elapsed else truth(error, self.members, float(self.T1), float(T2), float(decay))
        if (found.get("pattern_limit") or {}).get("T2", math.inf) > float(T2):
            raise UndecidedError(undecided(self.T1, T2, decay, most, self.request.shape), id="OBS507")
        return Outcome(Verdict.INFEASIBLE, in_floats_of(gains), diagnosis=unstable(found, self.T1, T2, decay, most))

    def tolerated(self, analysis: Analysis, T2: fmpq, decay: fmpq) -> float | None:
        """Largest T2 for which there is a solution, of T1 or a small part of what is asked for, to ten times that."""
        low = max(float(self.T1), SHORTER * float(T2))
        return longest(self.finer(analysis), decay, low, max(LONGER * float(T2), float(self.T2.high)))

    def finer(self, analysis: Analysis) -> Analysis:
        """Analysis with another segment, for a T2 that is much longer than T1, where the last segment begins."""
        return replace(analysis, shape=replace(analysis.shape, segments=analysis.shape.segments + 1))

    def claim(self, gains: Mapping[str, Array], T2: fmpq, decay: fmpq, most: float | None = None) -> ClockClaim | None:
        """Claim of gains with a witness of each part; `most`: the longest T2 that they seem to tolerate."""
        analysis = self.analysis(gains)
        found = witnesses(analysis, T2, decay)
        if "gamma" not in found:
            return None
        beyond = None if most is None else proof_of_longest(self.finer(analysis), most, decay, T2)
        direct = any([*self.plant.D.flat, *self.plant.Df.flat])
        asked = held(self.request, gains)
        overdue = outage(analysis, found["overshoot"]) if "overshoot" in found else None
        return ClockClaim(
            analysis.system, self.multiplier, direct, gains, self.T1, T2, decay, found, beyond, overdue, asked
        )

    # One T2 and one decay

    def single(self) -> Outcome:
        """Least gamma, or feasibility, at the lowest T2 and decay that are asked for."""
        T2, decay = self.lowest
        found = [(curve, curve.best(T2, decay)) for curve in self.told(self.curves)]
        curve, best = min(found, key=lambda pair: pair[1].gamma if pair[1] else math.inf)
        if best is None:
            return self.nothing(T2, decay)
        gamma = curve.gamma(curve.outside(best), T2, decay) if self.plant.B.shape[1] else 0.0
        if self.request.gap and curve.name == "reset" and not curve.gap:
            self.notes.append(CONSTANT)
        return self.shipped(curve, best, T2, decay, {"gamma": gamma, "attained": False, **BEST_FOUND})

    def told(self, curves: list[Curve]) -> Iterator[Curve]:
        """Curves one after the other, with the progress."""
        for i, curve in enumerate(curves):
            self.engine.report(0.7 * i / len(curves), f"gains of injection {curve.name}")
            yield curve

    def shipped(self, curve: Curve, best: Found, T2: fmpq, decay: fmpq, limit: dict[str, Any]) -> Outcome:
        """Small gains within the slack of the best, with what is proved of them."""
        least = curve.gamma(curve.outside(best), T2, decay)
        wanted = 1 + float(self.request.slack)
        if (cap := self.request.largest_gamma) is not None and float(cap) < least:
            raise UndecidedError(above_bound(least, float(cap), bounded=curve.kappa is not None), id="OBS507")
        target = least * (wanted if self.request.objective in TIGHT else max(wanted, MODERATE))
        if cap is not None:
            target = min(target, float(cap))
        self.engine.report(0.8, f"small gains for T2 = {float(T2):g}")
        enough = self.request.objective == "pareto" and curve.kappa is not None  # as large as its point on the curve
        small = best if enough else curve.smaller(best, target * (1 - ROOM), T2, decay)
        self.engine.report(0.9, "proof")
        nearest, reached = None, math.inf if cap is None else math.nextafter(float(cap), math.inf)
        for gains in self.roundings(curve, small, target, T2, decay):
            claim = self.claim(gains, T2, decay)
            if claim and claim.holds and float(claim.gamma) < reached:
                nearest, reached = claim, float(claim.gamma)
            if nearest and reached <= target:
                break
        if nearest:
            counts = self.request.objective == "min-gamma" and self.plant.B.shape[1]
            self.notes += [missed(target)] if counts and reached > target else []
            return Outcome(Verdict.CERTIFIED, in_floats_of(nearest.gains), nearest, limit=limit)
        raise UndecidedError(
            f"gains were found, and no proof for them; gamma seems to be about {least:g}; try `clock: {{segments: 4}}`",
            id="OBS507",
        )

    def roundings(self, curve: Curve, found: Found, target: float, T2: fmpq, decay: fmpq) -> Iterator[dict[str, Array]]:
        """Gains in more and more digits, in rationals, whose gamma stays below a target."""
        for exact in self.rounded(curve, found):
            if curve.gamma(in_floats_of(exact), T2, decay) <= target:
                yield exact

    def rounded(self, curve: Curve, found: Found) -> Iterator[dict[str, Array]]:
        """Gains in more and more digits, in rationals, within the bound on them."""
        for digits in DIGITS:
            gains = curve.outside(found).items()
            rough = {name: gain if name == "knots" else significant(gain, digits) for name, gain in gains}
            exact = {name: printed(gain) for name, gain in rough.items()}
            if "L" in exact and (tied := tied_gain(curve.name, exact["L"], self.plant.C)) is not None:
                exact["H"] = tied
            if curve.kappa is None or norm(main(rough)) <= curve.kappa:
                yield exact

    def nothing(self, T2: fmpq, decay: fmpq) -> Outcome:
        """Answer that no gains were found, with a T2 for which there are some.

        Raises `UndecidedError`: nothing says that there are none.
        """
        shorter = None
        for curve in self.curves:
            low = max(float(self.T1), SHORTER * float(T2))
            reached = curve.farthest(lambda value: (printed(value), decay), low, float(T2), lambda _: True)
            shorter = max((x for x in (shorter, reached[0] if reached else None) if x), default=None)
        raise UndecidedError(nothing_found(self.curves, T2, decay, shorter), id="OBS507")

    # Largest T2 or decay

    def farthest(self) -> Outcome:
        """Gains near the largest T2, or decay, that is found of any injection, for a gamma within its bound."""
        name, cap = RANGED[self.request.objective], self.request.largest_gamma
        low, other = self.lowest if name == "T2" else self.lowest[::-1]
        high = float(self.T2.high if name == "T2" else self.decay.high)
        accept = lambda found: cap is None or found.gamma <= float(cap)  # noqa: E731

        def at(value: float | fmpq) -> tuple[fmpq, fmpq]:
            return (printed(value), other) if name == "T2" else (other, printed(value))

        reached = [(c, r) for c in self.told(self.curves) if (r := c.farthest(at, float(low), high, accept))]
        if not reached:
            return self.nothing(*self.lowest)
        curve, (limit, found) = max(reached, key=lambda pair: pair[1][0])
        known = {name: limit, "attained": limit == high, **BEST_FOUND}
        failed: UndecidedError | None = None
        for factor in FARTHER:
            near = within_slack(limit, float(low), factor * self.request.slack)
            T2, decay = at(near)
            try:
                return self.shipped(curve, curve.best(T2, decay, near=found) or found, T2, decay, known)
            except UndecidedError as error:
                failed = failed or error
        assert failed
        raise failed

    @cached_property
    def members(self) -> list[Array]:
        """Frozen members f = K q of the class."""
        return Errors.of(self.plant, self.multiplier, self.Cp).through


def in_floats_of(gains: Mapping[str, Array]) -> dict[str, Array]:
    """Gains in doubles, which print as the decimals that are proved."""
    return {name: in_floats(gain) for name, gain in gains.items()}
