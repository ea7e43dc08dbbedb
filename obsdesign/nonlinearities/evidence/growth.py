"""Where f is seen to have no Lipschitz constant: its Jacobian or its difference quotients grow without bound.

This decides nothing of a bound; it tells a pole from a bound that could not be proved.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.nonlinearities.evidence.restriction import Range, Restriction

SCALES = 24  # 4^-k around a finite place, 4^k toward infinity
COUNT = 128  # points at each of them
FAR = 100.0  # of a place in an unbounded region, from where it is looked at toward infinity
GROWTH = 1.5  # of the largest slope over half of the scales: a logarithm doubles


@dataclass(frozen=True)
class Growth:
    """A slope of f that belongs to a growing sequence; None where f has no value."""

    slope: float | None
    point: Mapping[str, float]


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


def around(f: Restriction, place: Mapping[str, Range], k: int, rng: np.random.Generator) -> tuple[Array, Array]:
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
