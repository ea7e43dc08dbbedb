"""Objective pareto: gains within the slack of the limit for one weight, or for each point of a curve or surface."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds, Range
from obsdesign.dissipation.decimals import round_down
from obsdesign.dissipation.gain import Solve, least, size_of
from obsdesign.dissipation.pace import DECAY, Pace
from obsdesign.dissipation.zero import ROUNDED, SHARE, SUSPECT
from obsdesign.errors import UndecidedError
from obsdesign.families.lipschitz.claim import Claim
from obsdesign.families.lipschitz.front import Front, Optimum, front, weighted
from obsdesign.families.lipschitz.min_gamma import small_gains
from obsdesign.families.lipschitz.study import Study
from obsdesign.families.outcome import Outcome, Search, Verdict, bounded_kind, limited
from obsdesign.lmi.formula import Array, Values, in_floats, printed
from obsdesign.lmi.solve import Status
from obsdesign.records import dataclass, replace

ROOMY = 2  # times the least gamma, where it has no weight
SAME = 1e-4  # relative difference of two limits that count as one point
ARBITRARY = {0.0: "lipschitz", 1.0: "gamma"}  # what has no weight


def goal(front: Front, optimum: Optimum) -> tuple[fmpq, float]:
    """Constant and gamma to be certified: half of the slack goes into the constant, and the rest into gamma.

    Where gamma has no weight it is twice the least for the constant; where it would be zero, a share of
    that of the solution of widest margin.
    """
    study, weight = front.study, optimum.weight
    half = 1 + (study.slack / 2 if 0 < weight < 1 else study.slack if weight else 0.0)
    constant = max(study.declared, printed(round_down(optimum.lipschitz / half, 6)))
    if weight == 1:
        answer = study.engine.minimise(front.family(float(constant)).least_gamma(front.bounds))
        if answer.status is not Status.OPTIMAL:
            raise UndecidedError(f"no gamma was found for the Lipschitz constant {float(constant):g}", id="OBS507")
        square = answer.objective * ROOMY**2
    else:
        total = (1 + study.slack) * optimum.objective
        square = (total - weighted(weight, float(constant), 0.0)) / (1 - weight)
    gamma = round_down(math.sqrt(max(square, 0.0)), 6)
    return constant, gamma if gamma > SUSPECT else visible(front, constant, gamma)


def visible(front: Front, constant: fmpq, gamma: float) -> float:
    """Gamma, or where it is zero but for rounding a share of that of the solution of widest margin."""
    wide = front.study.engine.widest(front.family(float(constant)).witness(None))
    reference = math.sqrt(wide.values["mu"].item()) if wide.status is Status.OPTIMAL else 0.0
    return gamma if gamma > ROUNDED * reference else round_down(SHARE * reference, 6)


def weighed(study: Study) -> Outcome:
    """Design for one weight: the limit over all gains, the one within the bounds, a small gain and its proof."""
    assert isinstance(study.request.weight, fmpq)
    weight = float(study.request.weight)
    best = certain(front(study, NO_BOUNDS).optimum(weight), weight)
    limits: dict[str, Any] = {"limit": best.numbers}
    inner = front(study, study.bounds)
    if study.restricted:
        inside = inner.optimum(weight)
        if isinstance(inside, Status):
            return study.out_of_bounds(solve_of, decided=inside is Status.INFEASIBLE, **limits)
        best = certain(inside, weight)
        limits["limit_bounded"] = {**best.numbers, "attained": study.closed, **bounded_kind(study.bounds)}
    constant, gamma = goal(inner, best)
    L, claim = study.first(small_gains(study, inner.family(float(constant)), constant, gamma))
    if L is None:
        raise UndecidedError(
            f"no gain was found for lipschitz = {float(constant):g} and gamma = {gamma:g}", id="OBS507"
        )
    return study.outcome(L, claim, notes=arbitrary(weight), **limits)


def certain(found: Optimum | Status, weight: float) -> Optimum:
    """Limit for a weight. Raises `UndecidedError`: it was not found."""
    if isinstance(found, Status):
        raise UndecidedError(f"the least objective for the weight {weight:g} was not found: {found}", id="OBS507")
    return found


def arbitrary(weight: float) -> tuple[str, ...]:
    """Note on what has no weight."""
    if weight not in ARBITRARY:
        return ()
    return (f"at the weight {weight:g} {ARBITRARY[weight]} is arbitrary: the one stated is that of the gain",)


# Curves and surfaces


@dataclass(frozen=True)
class Spot:
    """One point of a curve, and its certified gain."""

    weight: float
    rate: fmpq
    optimum: Optimum | Status = Status.INFEASIBLE
    L: Array | None = None  # in rationals
    proved: Claim | None = None
    corner: bool = False
    pace: Pace = DECAY

    @property
    def place(self) -> dict[str, float]:
        """Weight, and decay or rho."""
        return {"weight": self.weight, self.pace.key: float(self.pace.told(self.rate))}

    def point(self, norm: Bounds) -> dict[str, Any]:
        """Numbers for a result file."""
        if isinstance(self.optimum, Status):
            return {**self.place, "status": str(self.optimum)}
        numbers = {key: value for key, value in self.optimum.numbers.items() if value != math.inf}
        status = "certified" if self.proved else "uncertified"
        known = {**self.place, **numbers, "corner": self.corner, "status": status}
        if self.proved is None or self.L is None:
            return known
        claimed = {"lipschitz": float(self.proved.lipschitz), "gamma": float(self.proved.certificate.gamma)}
        return {**limited(known, claimed), "certified": {**claimed, "L": size_of(in_floats(self.L), norm)}}


def scanned(study: Study, weights: Sequence[fmpq], rates: Sequence[fmpq]) -> Outcome:
    """Certified points for weights and rates; the knee of the curve at the least rate that has one is shipped."""
    if len(rates) == 1:
        blocked = study.obstacle()
        if blocked:
            return Outcome(Verdict.INFEASIBLE, diagnosis=blocked)
    curves = []
    for i, rate in enumerate(rates):
        study.engine.report(i / len(rates), study.unit.about.pace.said(rate, 4))
        curves.append(list(curve(replace(study, unit=replace(study.unit, rate=rate)), weights)))
    search = searched(study, [spot.point(study.bounds) for spots in curves for spot in spots])
    candidates = next((spots for spots in curves if any(spot.proved for spot in spots)), [])
    if not candidates:
        return replace(absent(study, curves), search=search)
    best = knee(candidates)
    assert isinstance(best.optimum, Optimum)
    assert best.L is not None
    note = (
        f"shipped: the knee of the curve at {best.pace.said(best.rate)}, weight {best.weight:g}, where gamma over the "
        "largest of the curve and the least lipschitz of the curve over lipschitz have the least sum"
    )
    limit = {**best.optimum.numbers, "at": best.place}
    return study.outcome(best.L, best.proved, limit=limit, search=search, notes=(note,))


def searched(study: Study, points: Sequence[dict[str, Any]]) -> Search:
    """Points over the weight, over the decay or rho, or over both."""
    searched = {"weight": study.request.weight, study.request.pace.key: study.request.rate}
    ranges = tuple(key for key, value in searched.items() if isinstance(value, Range))
    return Search(ranges[0], tuple(points), ranges if len(ranges) > 1 else ())


def absent(study: Study, curves: Sequence[Sequence[Spot]]) -> Outcome:
    """Answer that no point has a solution. Raises `UndecidedError`: there may be one."""
    decided = all(spot.optimum is Status.INFEASIBLE for spots in curves for spot in spots)
    if blocked := study.obstacle() if decided else {}:
        return Outcome(Verdict.INFEASIBLE, diagnosis=blocked)
    if not study.restricted or any(isinstance(spot.optimum, Optimum) for spots in curves for spot in spots):
        raise UndecidedError("no point was certified", id="OBS507")
    return study.out_of_bounds(solve_of, decided=decided)


def solve_of(study: Study) -> Solve:
    """Least gamma^2 within bounds at the declared constant."""
    return least(study.engine, front(study, study.bounds).family(float(study.declared)))


def curve(study: Study, weights: Sequence[fmpq]) -> Iterator[Spot]:
    """Points of one rate, corners marked."""
    rate, pace = study.unit.rate, study.unit.about.pace
    if study.obstacle():
        yield from (Spot(float(weight), rate, pace=pace) for weight in weights)
        return
    line = front(study, study.bounds)
    spots: list[Spot] = []
    start: Values | None = None
    for weight in map(float, weights):
        study.engine.report(0.5, f"weight = {weight:.4g}, {pace.said(rate, 4)}")
        best = line.optimum(weight, start)
        spot = Spot(weight, rate, best, pace=pace)
        if isinstance(best, Optimum):
            start = best.values or start
            spot = shipped(line, best, spot)
        spots.append(spot)
    same = [alike(one.optimum, other.optimum) for one, other in pairwise(spots)]
    for spot, before, after in zip(spots, [False, *same], [*same, False], strict=True):
        yield replace(spot, corner=before or after)


def alike(one: Optimum | Status, other: Optimum | Status) -> bool:
    """Whether two weights have the same limit point."""
    if isinstance(one, Status) or isinstance(other, Status) or not one.weight or other.weight == 1:
        return False
    return bool(np.allclose((one.lipschitz, one.gamma), (other.lipschitz, other.gamma), rtol=SAME, atol=0))


def shipped(front: Front, optimum: Optimum, spot: Spot) -> Spot:
    """Point with a certified gain, if there is one."""
    try:
        constant, gamma = goal(front, optimum)
    except UndecidedError:
        return spot
    certified = ((L, proved) for L, proved in front.gains(constant, gamma) if proved)
    L, proved = next(certified, (None, None))
    return replace(spot, L=L, proved=proved)


def knee(spots: Sequence[Spot]) -> Spot:
    """Certified point with the least sum of gamma and 1 / lipschitz, each relative to its largest on the curve."""
    known = [(spot, spot.proved) for spot in spots if spot.proved and 0 < spot.weight < 1]
    known = known or [(spot, spot.proved) for spot in spots if spot.proved]
    gamma = max(float(proved.certificate.gamma) for _, proved in known)
    constant = min(float(proved.lipschitz) for _, proved in known)

    def cost(proved: Claim) -> float:
        return float(proved.certificate.gamma) / gamma + constant / float(proved.lipschitz)

    return min(known, key=lambda pair: cost(pair[1]))[0]
