"""Trade-off curves of observers with sporadic measurements by clock-dependent certificates."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from flint import fmpq

from obsdesign.dissipation.bounds import Range
from obsdesign.families.outcome import BEST_FOUND, Outcome, Search
from obsdesign.families.sporadic.clock.design import ROOM, ClockDesigner, in_floats_of
from obsdesign.families.sporadic.clock.search import Curve, Found, main, norm
from obsdesign.families.sporadic.clock.theorem import error_system
from obsdesign.families.sporadic.clock.truth import periodic_gamma
from obsdesign.families.sporadic.clock.witness import GOALS
from obsdesign.lmi.formula import Array, above, in_floats, printed

MOST = 20  # steps of the descent of a first point: shipped curves end 0.9 % lower to 2.1 % higher than with 80
Point = tuple[dict[str, Any], Curve, Found | None]


class ClockTradeoff(ClockDesigner):
    """A curve of each injection, over a range of T2 or of the decay."""

    def curve(self, name: str, gap: bool) -> Curve:
        """Search of one injection, of whose descents each point goes on with that of the last."""
        return replace(super().curve(name, gap), steps=MOST)

    def searched(self) -> Outcome:
        """Trade-off curves, each point with certified gains; ships the farthest point within the slack of the best."""
        name = "decay" if isinstance(self.request.decay, Range) else "T2"
        found = [list(self.points(curve, name)) for curve in self.told(self.curves)]
        named: list[dict[str, Any]] = [
            {"injection": curve.name, "relaxation": "clock", "points": [point for point, _, _ in points]}
            for curve, points in zip(self.curves, found, strict=True)
        ]
        search = Search(name, tuple(named[0]["points"]), curves=tuple(named))
        made = [item for points in found for item in points if item[2] is not None and "certified" in item[0]]
        if not made:
            return replace(self.nothing(*self.lowest), search=search)
        least = min(point["gamma"] for point, _, _ in made) * (1 + float(self.request.slack))
        point, curve, best = max(
            (m for m in made if m[0]["gamma"] <= least), key=lambda item: (item[0][name], -item[0]["gamma"])
        )
        value = printed(point[name])
        T2, decay = (value, self.lowest[1]) if name == "T2" else (self.lowest[0], value)
        self.notes.append(
            f"the gains are those of T2 = {float(T2):g} and decay {float(decay):g}: of the points of relaxation clock "
            "the farthest whose gamma is within the slack of their least"
        )
        assert best
        limit = {"gamma": point["gamma"], "at": {name: point[name]}, "attained": False, **BEST_FOUND}
        return replace(self.shipped(curve, best, T2, decay, limit), search=search)

    def points(self, curve: Curve, name: str) -> Iterator[Point]:
        """Points of a curve over T2 or the decay, each search begun from the last, and again from the next one.

        What holds for a longer T2, or a faster decay, holds for a shorter or a slower one: gamma never falls.
        """
        ranged = self.request.decay if name == "decay" else self.request.T2
        assert isinstance(ranged, Range)
        values, done = [printed(value) for value in ranged.grid()], self.curves.index(curve)
        pairs = [(x, self.lowest[1]) if name == "T2" else (self.lowest[0], x) for x in values]
        found: list[Found | None] = []
        last = None
        for i, (value, at) in enumerate(zip(values, pairs, strict=True)):
            part = (done + i / len(values)) / len(self.curves)
            self.engine.report(0.8 * part, f"injection {curve.name}, {name} = {float(value):g}")
            found.append(curve.best(*at, near=last) or curve.best(*at))
            last = found[-1] or last
        for i in reversed(range(len(found) - 1)):
            found[i] = better(found[i], found[i + 1], partial(curve.best, *pairs[i]))
        for value, at, made in zip(values, pairs, found, strict=True):
            if made is None:
                yield {name: float(value), "status": "undecided"}, curve, None
            else:
                yield self.point(curve, made, name, *at), curve, made

    def point(self, curve: Curve, found: Found, name: str, T2: fmpq, decay: fmpq) -> dict[str, Any]:
        """Gamma that is found, and what is proved of the rounded gains."""
        known = {name: float(T2 if name == "T2" else decay), "gamma": found.gamma, "status": "uncertified"}
        for gains in self.rounded(curve, found):
            analysis = self.analysis(gains)
            least = analysis.least(GOALS["gamma"], T2, decay)
            gamma = math.sqrt(max(least.objective, 0.0))
            if gamma > found.gamma * (1 + ROOM):
                continue
            witness = analysis.prove(GOALS["gamma"], T2, decay, least, quick=True)
            if witness and witness.holds and witness.definite:
                proved, key = above(witness.constants()["gamma"]), "L" if "L" in gains else "K"
                size = norm(main(in_floats_of(gains)))
                certified = {"gamma": proved, "T2": float(T2), "decay": float(decay), key: size}
                return {
                    **known,
                    "gamma": min(gamma, proved),
                    "status": "certified",
                    "certified": certified,
                    **self.beside(gains, T2, decay, gamma),
                }
        return known

    def beside(self, gains: Mapping[str, Array], T2: fmpq, decay: fmpq, near: float) -> dict[str, Any]:
        """Entry `truth` of a point: the gamma that its gains do have for the period T2; empty if it is not known."""
        error = error_system(self.plant.doubles, in_floats(self.Cp), in_floats_of(gains))
        found = None if error.elapsed else periodic_gamma(error, self.members, float(T2), float(decay), near)
        return {} if found is None else {"truth": {"gamma": found}}


def better(found: Found | None, harder: Found | None, near: Callable[[Found], Found | None]) -> Found | None:
    """Gains for a point, or where those of a harder one are better, what a search near these finds."""
    if harder is None or (found and found.gamma <= harder.gamma):
        return found
    made = near(harder)
    return made if made and (found is None or made.gamma < found.gamma) else found
