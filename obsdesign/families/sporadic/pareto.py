"""Objective pareto: the trade-off of gamma, or of T2, over a range of T2 or of the decay."""

from collections.abc import Sequence
from typing import Any

from flint import fmpq

from obsdesign.dissipation.bounds import Range
from obsdesign.families.outcome import Search
from obsdesign.families.sporadic.study import Made, Point, Study
from obsdesign.lmi.formula import printed


def interval(value: fmpq | Range) -> Range:
    """Number as a range of itself."""
    return value if isinstance(value, Range) else Range(value, value)


def curve(study: Study, T2: fmpq | Range, decay: fmpq | Range) -> list[tuple[Point, Made]]:
    """Points of one scheme over the range; above an infeasible one there is none.

    Where both are ranges, the largest T2 for each decay.
    """
    name = "decay" if isinstance(decay, Range) else "T2"
    both = isinstance(T2, Range) and isinstance(decay, Range)
    lengths, rates = interval(T2), interval(decay)
    grid = [printed(value) for value in (rates if name == "decay" else lengths).grid()]
    points: list[tuple[Point, Made]] = []
    lost = False
    for i, value in enumerate(grid):
        study.setting.engine.report(0.9 * i / len(grid), ", ".join(study.scheme.names.values()))
        if lost:
            points.append(({name: float(value), "status": "infeasible"}, Made()))
        elif both:
            points.append(study.longest_point(value, lengths))
        elif name == "T2":
            points.append(study.point(name, value, value, printed(rates.low)))
        else:
            points.append(study.point(name, value, printed(lengths.low), value))
        lost = lost or points[-1][0]["status"] == "infeasible"
    return points


def farthest(made: Sequence[tuple[Study, Point, Made]], slack: fmpq) -> tuple[Study, Made]:
    """Farthest of certified points with a gamma within the slack of the least."""
    least = min(m.gamma for _, _, m in made) * (1 + float(slack))
    near = [(study, point, m) for study, point, m in made if m.gamma <= least]
    study, _, m = max(near, key=lambda item: item[1]["T2"] if "T2" in item[1] else item[1]["decay"])
    return study, m


def searched(curves: Sequence[dict[str, Any]]) -> Search:
    """Curves of a search over T2 or over the decay."""
    points = curves[0]["points"]
    return Search("decay" if "decay" in points[0] else "T2", tuple(points), curves=tuple(curves))
