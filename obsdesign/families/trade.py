"""Gamma against the size of the gain: certified designs within bounds on it, and the knee of their curve.

The knee is the point of the curve of log gamma over log |gain|, both of certified gains, that is the farthest below the
line between its ends. `bounds: auto` goes from the smallest gain that is of use up by factors of 10^(1/4):

    from    the least bound with which gamma is at most half of that of no observer, or, where that has none, or no
            smaller gain has a design, twice the least with which there is a design,
    up to   the first whose gamma is at most 1.1 times the limit over all gains, or 1000 times the first bound.

Where no point is 5 % below the line there is no knee: the first point is shipped whose gamma is as near to the limit,
and without one the middle of the curve. Each point is a design like that of this bound alone, or the best of a smaller
bound where that is better. The numbers of a search prove nothing; the design that is shipped is proved like any other.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.bounds import Trade
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.scan import edge, knee, strides
from obsdesign.errors import UndecidedError
from obsdesign.families.noise import heard, period_of
from obsdesign.families.outcome import BEST_FOUND, Outcome, Search, Verdict
from obsdesign.lmi.formula import Array, printed
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec

HALF = 0.5  # of the gamma of no observer: a gain that does less is of no use
TWICE = 2.0  # times the least size that has a design: at that size itself gamma grows without bound
NEAR = 1.1  # times the limit of gamma: what larger gains have left to win
DECADES, STEPS = 3, 4  # that bounds: auto covers at most, and points in each
STRIDE, FARTHEST = 8.0, 12  # of the search for the first bound, from 1 on
CLOSE = 0.05  # relative, to which it is found
FLAT = math.log(1.05)  # below the line between the ends of the curve: less is no knee
KNEE = "the knee of gamma against it, the farthest below the line between the ends in logarithms"
ENOUGH = "with which gamma is within 10 % of its limit; there is no knee before"
MIDDLE = (
    "the middle of a curve without a knee: gamma falls evenly as the gain grows, and only noise speaks against that"
)
UNITS = "|{gain}| is in the units of the spec, so that a state or an output in another unit may move the knee"


@dataclass(frozen=True)
class Spot:
    """One bound, and what came of it."""

    size: fmpq
    made: Outcome | None  # None: undecided
    gain: float = math.nan  # norm of the certified gain
    gamma: float = math.nan

    @property
    def certified(self) -> bool:
        """Whether there is a gain that is proved."""
        return not math.isnan(self.gamma)

    @property
    def near(self) -> bool:
        """Whether larger gains have little to win, as far as the limit over all gains is known."""
        limit = self.made.limit if self.made else {}
        known = limit.get("kind") != BEST_FOUND["kind"] and limit.get("gamma")
        return self.certified and bool(known) and self.gamma <= NEAR * limit["gamma"]


@dataclass(frozen=True)
class Trader:
    """What a family has to say for its curve."""

    spec: Spec
    engine: Engine
    trade: Trade
    design: Callable[[fmpq], Outcome]  # for the least gamma within a bound on the gain
    least: Callable[[float], float]  # gamma within a bound, numerically; infinite where there is none
    unaided: float | None  # gamma of no observer; None where it has none
    errors: Callable[[Mapping[str, Array]], Errors]

    def outcome(self) -> Outcome:
        """The knee of the curve, with the curve; where no point is certified, what came of the largest bound."""
        spots = list(self.spots())
        search = Search(self.trade.gain, tuple(map(self.point, spots)))
        known = sorted((spot for spot in spots if spot.certified), key=lambda spot: (spot.gain, -spot.gamma))
        if not known:
            return self.nothing(spots, search)
        best, why = chosen(known)
        assert best.made
        where = f"from |{self.trade.gain}| = {known[0].gain:.4g} to {known[-1].gain:.4g}"
        said = f"shipped: |{self.trade.gain}| <= {float(best.size):g}, {why}; the curve goes {where}"
        units = [UNITS.format(gain=self.trade.gain)] if best.made.gains[self.trade.gain].size > 1 else []
        return replace(best.made, search=search, notes=(*best.made.notes, said, *units), **limits(best.made, known))

    def nothing(self, spots: list[Spot], search: Search) -> Outcome:
        """Answer that no bound of the curve has a certified gain."""
        if spots and spots[-1].made is not None:
            return replace(spots[-1].made, search=search)
        raise UndecidedError(f"no bound on |{self.trade.gain}| was found with a certified gain", id="OBS507")

    def spots(self) -> Iterator[Spot]:
        """Designs of the bounds, the smallest first; the best of a smaller bound is one of a larger bound, too."""
        sizes = [*self.trade.sizes.grid()] if self.trade.sizes else self.found()
        best = None
        for i, size in enumerate(sizes):
            self.engine.report(i / len(sizes), f"|{self.trade.gain}| <= {float(size):.4g}")
            spot = self.spot(size)
            if best and not spot.gamma <= best.gamma:
                spot = replace(best, size=size)
            best = spot if spot.certified else None
            yield spot
            if self.trade.sizes is None and spot.near:
                return

    def spot(self, size: fmpq) -> Spot:
        """Design of one bound."""
        try:
            made = self.design(size)
        except UndecidedError:
            return Spot(size, None)
        if made.status is not Verdict.CERTIFIED or made.claim is None:
            return Spot(size, made)
        gamma = made.claim.written(self.spec, {})["guarantee"]["gamma"]
        return Spot(size, made, float(np.linalg.norm(made.gains[self.trade.gain], 2)), gamma)

    def found(self) -> list[fmpq]:
        """Bounds of `bounds: auto`; none where no gain has a design."""
        level = math.inf if self.unaided is None else HALF * self.unaided

        def useful(size: float) -> bool:
            gamma = self.least(size)
            return gamma < math.inf and gamma <= level

        inside, outside = strides(useful, 1.0, 1 / STRIDE, FARTHEST)
        if inside is None:
            return [printed(STRIDE**FARTHEST)]
        first = inside if outside is None else edge(useful, inside, outside, CLOSE)
        if self.least(first / (1 + 2 * CLOSE)) == math.inf:
            first *= TWICE
        steps = range(DECADES * STEPS + 1)
        return [printed(float(f"{first * 10 ** (k / STEPS):.3g}")) for k in steps]

    def point(self, spot: Spot) -> dict[str, Any]:
        """Point of a search: the bound, the least gamma within it, and what its gain achieves, with its noise."""
        known: dict[str, Any] = {self.trade.gain: float(spot.size)}
        if spot.made is None:
            return {**known, "status": str(Verdict.UNDECIDED)}
        limit = {**spot.made.limit, **spot.made.limit_bounded}
        known |= {"gamma": limit["gamma"]} if "gamma" in limit and spot.certified else {}
        known["status"] = str(spot.made.status)
        if not spot.certified:
            return known
        noise = self.noise(spot.made.gains)
        return {**known, **noise, "certified": {"gamma": spot.gamma, self.trade.gain: spot.gain}}

    def noise(self, gains: Mapping[str, Array]) -> dict[str, Any]:
        """Rms of each error: for the noise that the spec declares, or as `noise_density` of all outputs together."""
        found = heard(self.spec, self.errors(gains), period_of(self.spec))
        if found.get("noise_error"):
            return {"noise_error": found["noise_error"]}
        rows = found["noise_density"] or {}
        return {"noise_density": {name: math.hypot(*row.values()) for name, row in rows.items()}}


def limits(made: Outcome, known: Sequence[Spot]) -> dict[str, Any]:
    """Limits of the design that is shipped: where they are the best that was found, the least of the whole curve."""
    if made.limit.get("kind") != BEST_FOUND["kind"] or made.limit_bounded:
        return {}
    found = [spot.made.limit["gamma"] for spot in known if spot.made and "gamma" in spot.made.limit]
    return {"limit": {**made.limit, "gamma": min(found)}, "limit_bounded": made.limit}


def chosen(known: Sequence[Spot]) -> tuple[Spot, str]:
    """Point of certified ones that is shipped, the smallest gain first, and why."""
    x, y = ([math.log(value) for value in column] for column in zip(*((s.gain, s.gamma) for s in known), strict=True))
    if (best := knee(x, y, FLAT)) is not None:
        return known[best], KNEE
    near = next((spot for spot in known if spot.near), None)
    return (near, ENOUGH) if near else (known[len(known) // 2], MIDDLE)
