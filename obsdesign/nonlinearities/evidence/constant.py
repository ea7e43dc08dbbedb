"""The Lipschitz constant of a nonlinearity on its region, and where it is seen to have none.

Jacobians or difference quotients that are seen to grow decide nothing of a bound; they tell a pole from a bound that
could not be proved.
"""

from collections.abc import Mapping
from itertools import takewhile
from math import inf

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.nonlinearities.evidence.enclosure import WORK, Doubt, Supremum, doubt, shown
from obsdesign.nonlinearities.evidence.norm import PATIENCE, TIGHT, Matrix, largest_norm
from obsdesign.nonlinearities.evidence.restriction import Range, Restriction
from obsdesign.records import dataclass, field

SCALES = 24  # 4^-k around a finite place, 4^k toward infinity
COUNT = 128  # points at each of them
FAR = 100.0  # of a place in an unbounded region, from where it is looked at toward infinity
GROWTH = 1.5  # of the largest slope over half of the scales: a logarithm doubles


@dataclass(frozen=True)
class Constant:
    """A Lipschitz constant in [lower, upper]; an infinite upper bound has a reason."""

    lower: float  # the 2-norm of the Jacobian at `point`, at least
    upper: float
    point: Mapping[str, float] = field(default_factory=dict)
    boxes: int = 0  # that the bounds took
    reason: str = ""
    infinite: bool = False  # so it is seen to be; otherwise an infinite bound says nothing of the constant

    @property
    def gap(self) -> float:
        """Looseness of the upper bound, relative."""
        return (self.upper - self.lower) / self.upper if self.upper else 0.0


@dataclass(frozen=True)
class Growth:
    """A slope of f that belongs to a growing sequence; None where f has no value."""

    slope: float | None
    point: Mapping[str, float]


def lipschitz_constant(f: Restriction) -> Constant:
    """Bounds of the constant to 1e-6, relative, or why there are none.

    Raises `ExpressionError`: a derivative of f is too large to be written down.
    """
    found = doubt(f)
    if found is not None:
        return without_bound(f, found.place, found)
    norm = patient_norm(f.jacobian, f.box)
    if norm.bound == inf:
        return without_bound(f, norm.place)
    return Constant(norm.attained, norm.bound, norm.point, norm.boxes)


def patient_norm(J: Matrix, box: Mapping[str, Range]) -> Supremum:
    """Supremum of the 2-norm of a matrix, to 1e-6 unless that takes too long."""
    norm = largest_norm(J, box, work=WORK)
    return norm if norm.bound == inf or norm.gap <= TIGHT else largest_norm(J, box, work=PATIENCE)


def without_bound(f: Restriction, place: Mapping[str, Range], jump: Doubt | None = None) -> Constant:
    """Say why there is no bound: what f does at a place, as far as it is seen."""
    seen = growth(f, place)
    if seen is None:
        name = (
            f"{jump.name} may jump or be undefined" if jump else "the Jacobian of f has no bound that could be proved"
        )
        return Constant(
            0.0, inf, reason=f"{name} at {shown(f, place)}; give a smaller region, or write f with abs, sat, .."
        )
    return Constant(0.0, inf, reason=words(f, seen), infinite=True)


def words(f: Restriction, seen: Growth) -> str:
    """What was seen, and where."""
    point = ", ".join(f"{f.shown(name)} = {value:.4g}" for name, value in seen.point.items())
    if seen.slope is None:
        return f"f is undefined at {point}; give a region without that"
    return f"its slope grows without bound: it is {seen.slope:.3g} at {point}; give a smaller region"


def growth(f: Restriction, place: Mapping[str, Range]) -> Growth | None:
    """Look at slopes of f closer and closer to a place, or farther and farther out; None if they do not grow.

    `place`: a box in which they may; it may be unbounded.
    """
    rng = np.random.default_rng(0)
    sequences = [steepest(f, *around(f, place, k, rng)) for k in range(1, SCALES + 1)]
    known = list(takewhile(lambda found: found.slope is not None, sequences))  # until f overflows
    if not known:
        return sequences[0]
    first, middle, last = (found.slope or 0.0 for found in (known[0], known[len(known) // 2], known[-1]))
    return known[-1] if last > GROWTH * middle > GROWTH * GROWTH * first > 0 else None


def around(f: Restriction, place: Mapping[str, Range], k: int, rng: "np.random.Generator") -> tuple[Array, Array]:
    """Pairs of points (variables, COUNT) at the scale k, on two sides of a finite place."""
    first, second = [], []
    for name, region in f.box.items():
        low, high = place.get(name, region)
        u = rng.uniform(-1, 1, COUNT)
        below, above = (np.isinf(end) and abs(limit) > FAR for end, limit in zip(region, (low, high), strict=True))
        if below or above:
            far = 4.0**k * (u if below and above else abs(u) if above else -abs(u))
            sides = far, far
        else:
            size = (region[1] - region[0]) if np.isfinite(region).all() else 1 + abs(low)
            step = max((high - low) / 2, size / 4.0**k) * u
            sides = low / 2 + high / 2 + step, low / 2 + high / 2 - step
        first.append(np.clip(sides[0], *region))
        second.append(np.clip(sides[1], *region))
    return np.array(first), np.array(second)


def steepest(f: Restriction, first: Array, second: Array) -> Growth:
    """Largest 2-norm of the Jacobian and difference quotient at pairs of points."""
    names = tuple(f.box)
    second[f.nq :] = first[f.nq :]
    at = [np.array([g.function(names)(*points) for g in f.f]) for points in (first, second)]
    J = np.array([[g.function(names)(*first) for g in row] for row in f.jacobian])
    nowhere = ~np.isfinite(at[0]).all(axis=0)
    if nowhere.mean() > 1 / 4:
        return Growth(None, dict(zip(names, first[:, np.argmax(nowhere)].tolist(), strict=True)))
    with np.errstate(all="ignore"):
        distance = np.linalg.norm(first[: f.nq] - second[: f.nq], axis=0)
        quotient = np.linalg.norm(at[0] - at[1], axis=0) / distance
        norm = np.linalg.norm(np.where(np.isfinite(J), J, 0.0), axis=(0, 1))  # at most sqrt(nq) times the 2-norm
    slopes = np.where(np.isfinite(quotient), np.maximum(quotient, norm), norm)
    k = int(np.argmax(slopes))
    return Growth(float(slopes[k]), dict(zip(names, first[:, k].tolist(), strict=True)))
