"""Piecewise polynomials of a clock in Bernstein form: their control values bound them and their derivative.

On a segment [s_i, s_i + h] of the clock, with x = (tau - s_i) / h,

    P(tau) = sum_k b_k(x) P_k,    b_k(x) = binomial(d, k) x^k (1 - x)^(d - k),    k = 0 .. d.

The weights b_k are nonnegative and have the sum 1, so that P(tau) lies in the convex hull of P_0 .. P_d: whatever
affine inequality holds for all of these holds on the segment. The derivative, raised to the same degree, has the
control values

    R_k = (k (P_k - P_{k-1}) + (d - k) (P_{k+1} - P_k)) / h,

so that the same is true of inequalities that are affine in P and P'. The last control value of a segment is the first
one of the next: P is continuous.
"""

from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from math import comb

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array, Float, rational_number, zeros
from obsdesign.records import dataclass


@dataclass(frozen=True)
class Shape:
    """Degree and segments of a storage function, and how many parts of [T1, T2] it tells apart."""

    degree: int = 4
    segments: int = 2
    lookahead: int = 1


SHAPE = Shape()
LARGEST_DEGREE, MOST_SEGMENTS, FARTHEST = 12, 32, 8  # of shapes: what is more takes too long


@dataclass(frozen=True)
class Clock:
    """Segments of the time left to the next measurement, and the degree on each."""

    knots: tuple[fmpq, ...]  # s, from 0 to T2
    degree: int

    @property
    def segments(self) -> int:
        """Number of segments N."""
        return len(self.knots) - 1

    @property
    def count(self) -> int:
        """Number of control values of P: N d + 1."""
        return self.segments * self.degree + 1

    @cached_property
    def places(self) -> Array:
        """Which control value of P is the k-th of a segment, (N, d + 1)."""
        return np.asarray(self.degree * np.arange(self.segments)[:, None] + np.arange(self.degree + 1))

    def rates(self, like: Array) -> Array:
        """Weights of the control values of P in those of P', (N (d + 1), N d + 1), in the numbers of P."""
        d, k = self.degree, np.arange(self.degree + 1)
        steps = np.zeros((d + 1, d + 1), dtype=int)
        steps[k[1:], k[:-1]], steps[k, k], steps[k[:-1], k[1:]] = -k[1:], 2 * k - d, d - k[:-1]
        weights = zeros((self.segments, d + 1, self.count), like=[like])
        for own, places, (a, b) in zip(weights, self.places, pairwise(self.knots), strict=True):
            own[:, places] = steps / (b - a)
        return weights.reshape(-1, self.count)

    def on(self, P: Array) -> Array:
        """Control values of P (.., N d + 1, m, m) segment by segment, (.., N (d + 1), m, m)."""
        return np.asarray(P[..., self.places.ravel(), :, :])

    def slope(self, P: Array) -> Array:
        """Control values of P', segment by segment, (.., N (d + 1), m, m), in the numbers of P."""
        weights = self.rates(P)
        flat = P.reshape(*P.shape[:-2], -1)
        return np.asarray((weights @ flat).reshape(*P.shape[:-3], -1, *P.shape[-2:]))

    def within(self, low: fmpq, high: fmpq) -> Array:
        """Control values of the segments that an interval of the clock meets in more than a point, or of the point."""
        ends = list(pairwise(self.knots))
        if low == high:
            return np.array([self.places[self.knots.index(low) - 1, -1]] if low else [0])
        met = [i for i, (a, b) in enumerate(ends) if a < high and b > low]
        return np.unique(self.places[met])

    def segments_within(self, T1: fmpq) -> Array:
        """Control values of the segments of [T1, T2], one segment after the other; of the point T2 for T1 = T2."""
        late = self.places[[a >= T1 for a in self.knots[:-1]]].ravel()
        return late if len(late) else self.places[-1, -1:]

    def halved(self, P: Array) -> "tuple[Clock, Array]":
        """Same polynomial on segments half as long: its control values are closer to it (de Casteljau)."""
        knots, values = [self.knots[0]], [P[..., :1, :, :]]
        for (a, b), places in zip(pairwise(self.knots), self.places, strict=True):
            level = [P[..., j, :, :] for j in places]
            left, right = [level[0]], [level[-1]]
            while len(level) > 1:
                level = [(x + y) / 2 for x, y in pairwise(level)]
                left.append(level[0])
                right.append(level[-1])
            knots += [(a + b) / 2, b]
            values += [np.stack(left[1:], axis=-3), np.stack(right[::-1][1:], axis=-3)]
        return Clock(tuple(knots), self.degree), np.concatenate(values, axis=-3)

    def at(self, P: Float, tau: Float) -> Float:
        """P (N d + 1, m, m) at values (K,) of the clock, in doubles, (K, m, m); beyond T2 that of T2."""
        knots, d = np.array([float(s) for s in self.knots]), self.degree
        tau = np.clip(tau, 0.0, knots[-1])
        i = np.clip(np.searchsorted(knots, tau, side="right") - 1, 0, self.segments - 1)
        x = ((tau - knots[i]) / np.diff(knots)[i])[:, None]
        k = np.arange(d + 1)
        weights = np.array([comb(d, j) for j in k]) * x**k * (1 - x) ** (d - k)
        return np.asarray(np.einsum("tk,tkij->tij", weights, P[self.places[i]]))


def clock(T1: fmpq, T2: fmpq, degree: int, segments: int, bins: int = 1) -> Clock:
    """Segments of [0, T2] of which T1 is a knot where it is inside and there is more than one.

    [T1, T2] is divided into bins of the same length, each of whole segments; what is left of the number of segments is
    shared between [0, T1] and [T1, T2] as their lengths are.
    """
    if (segments == 1 and bins == 1) or not 0 < T1 < T2:
        return Clock((fmpq(0), *divided(fmpq(0), T2, segments)), degree)
    each = min(round(segments * float((T2 - T1) / T2) / bins), (segments - 1) // bins)
    late = bins * max(1, each)
    return Clock((fmpq(0), *divided(fmpq(0), T1, max(segments - late, 1)), *divided(T1, T2, late)), degree)


def adapted(T1: fmpq, T2: fmpq, degree: int, segments: int) -> Clock:
    """Segments of the time elapsed: [0, T1], and the others of [T1, T2]; their inner ends are decimals."""
    *inner, end = divided(T1, T2, max(segments - 1, 1))
    return Clock((fmpq(0), T1, *(rational_number(f"{float(s):.6g}") for s in inner), end), degree)


def of_gain(T1: fmpq, knots: Array, K: Array) -> Clock:
    """Segments of the time elapsed on which a gain K(s) is a polynomial: [0, T1], and those of its knots."""
    return Clock((fmpq(0), T1, *knots[1:].tolist()), K.shape[1] - 1)


def divided(low: fmpq, high: fmpq, parts: int) -> Iterator[fmpq]:
    """Ends of the parts of an interval."""
    return (low + (high - low) * fmpq(i, parts) for i in range(1, parts + 1))
