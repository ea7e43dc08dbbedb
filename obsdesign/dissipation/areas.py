"""Peaks of z for peaks of v: the integral over time of the norm of an impulse response, in the worst direction of z."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from obsdesign.lmi.formula import Array

DIRECTIONS = 100  # of z in which its peak is sought
AT_ONCE = 512  # of the samples, so that what is computed of them stays near the processor
FEWER = 2  # states for each of which one more of the instants is passed over, to find the worst member and
TOGETHER = 8  # directions that are looked at at once
LEAST = 1e-100  # norm of a response, relative to its largest
ROUNDING = 1e-9
FEW = 4  # the worst directions, in which all are


def largest_area(h: Array, widths: Array) -> float:
    """Largest integral over time of |u' h| for |u| = 1, over directions u; h: (nv, nz, nt), widths: (nt,)."""
    tried = directions(h, widths)
    return 0.0 if not h.size else np.nan if tried is None else float(largest_areas(h, widths, tried, 1)[0].item())


def directions(h: Array, widths: Array) -> Array | None:
    """Unit vectors u in which z may be the largest, (k, nz); None where z is not finite."""
    nz = h.shape[1]
    moment = ((h * widths) @ h.transpose(0, 2, 1)).sum(axis=0)
    if not np.isfinite(moment).all():
        return None
    if nz <= 1:
        return np.eye(nz)
    random = np.random.default_rng(0).normal(size=(DIRECTIONS, nz))
    found = np.concatenate([np.linalg.eigh(moment)[1].T, np.eye(nz), random])
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def areas(h: Array, widths: Array, tried: Array) -> Array:
    """Integral over time of |u' h| for each u, (k,)."""
    found = np.zeros(len(tried))
    for part in (slice(first, first + AT_ONCE) for first in range(0, len(widths), AT_ONCE)):
        found = found + np.sqrt(((tried @ h[:, :, part]) ** 2).sum(axis=0)) @ widths[part]
    return found


def largest_areas(h: Array, widths: Array, tried: Array, count: int) -> tuple[Array, Array]:
    """The so many largest areas, in rising order, and their places among the directions that are tried.

    By Cauchy and Schwarz an area is at most sqrt(S u' M u), with S the integral of g, M that of h h' / g, and g > 0 the
    norm of h: a direction for which that is less than areas of others need not be looked at.
    """
    g = np.sqrt((h**2).sum(axis=(0, 1)))
    if not g.any():
        return np.zeros(1), np.zeros(1, dtype=int)
    g = np.maximum(g, LEAST * g.max())
    M = ((h * (widths / g)) @ h.transpose(0, 2, 1)).sum(axis=0)
    bounds = np.sqrt(np.maximum((g @ widths) * ((tried @ M) * tried).sum(axis=1), 0)) * (1 + ROUNDING)
    order = np.argsort(-bounds)
    sizes = np.zeros(0)
    while len(sizes) < len(tried) and (len(sizes) < count or bounds[order[len(sizes)]] > np.sort(sizes)[-count]):
        sizes = np.append(sizes, areas(h, widths, tried[order[len(sizes) : len(sizes) + TOGETHER]]))
    best = np.argsort(sizes)[-count:]
    return sizes[best], order[best]


def worst_area(
    impulse: Callable[..., tuple[Array, Array]], systems: Sequence[tuple[Any, ...]], H: Array
) -> float | None:
    """Largest area of some systems with z = H e, no more than that of the worst; None where none is finite.

    A few instants tell which one it is of, and in which directions. `systems`: of each A and B, and what else is known
    of it; `impulse`: response of A and B with H, of how many instants one is looked at, and of what else is known.
    """
    worst, found = -1.0, None
    for A, B, *known in systems:
        h, widths = impulse(A, B, H, len(A) // FEWER, *known)
        tried = directions(h, widths) if h.size else None
        if tried is None:
            continue
        sizes, places = largest_areas(h, widths, tried, FEW)
        if sizes[-1] > worst:
            worst, found = float(sizes[-1]), (A, B, known, tried[places])
    if found is None:
        return 0.0 if systems and not (systems[0][1].size and len(H)) else None
    A, B, known, tried = found
    h, widths = impulse(A, B, tried @ H, 1, *known)
    return float(np.sqrt((h**2).sum(axis=0)).dot(widths).max())
