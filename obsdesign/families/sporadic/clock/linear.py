"""Growth of a linear estimation error over sequences of intervals between measurements, in doubles.

Between measurements x' = A x + B w, z = C x, and at one x+ = U V x. With the intervals
g_1, .., g_k again and again, V x just before measurements obeys

    (V x)+ = M(g_k) .. M(g_1) (V x),    M(g) = V exp(A g) U,

so that this sequence is unstable where the spectral radius of the product is 1 or more. A periodic sequence that is
unstable shows that no certificate for its intervals exists; that none was found shows nothing. A rate lambda is part of
A: x is that of the plant times exp(lambda t).
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from obsdesign.dissipation import scan
from obsdesign.dissipation.modes import powers
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass

SCANNED = 200  # periods up to the longest one that is tried
TURN = 0.4  # rad of the fastest oscillation between two of these, at most
DENSEST = 2000
WITHIN = 17  # periods about each peak of the growth, between its neighbors
CLOSER = 3  # times that a peak is looked at so
ROUNDING = 1e-9  # of the logarithm of a spectral radius, above which it is believed to be positive
SHARP = 1e-6  # relative, of a limit of stability
LETTERS = 32  # intervals of [T1, T2] that sequences consist of
COARSE = np.array([0, 1, 2, 4, 8, 16, 24, 32])  # .. of which they begin to be sought
RUNS = np.array([1, 2, 3, 5, 8])  # times that one of two intervals comes after itself
MOVES = np.array([-4, -1, 1, 4])  # letters by which each interval of a sequence is moved
ROUNDS = 12  # .. and how often
SHORTENED = 0.8  # T2, relative to where a sequence is unstable, for which it is looked at again
TWICE = 4  # .. as often
TRUSTED = 20.0  # logarithm of the growth within one interval up to which doubles are believed

Word = Array  # letters of a sequence, (k,), the first interval first


@dataclass(frozen=True)
class LinearError:
    """Linear error; a measurement leaves V x of it, from which x = U V x goes on."""

    A: Float  # (m, m)
    B: Float  # (m, nw)
    C: Float  # (nz, m)
    U: Float  # (m, r)
    V: Float  # (r, m)

    @classmethod
    def of(cls, A: Array, B: Array, C: Array, J: Array) -> "LinearError":
        """Error with the jump x+ = J x, which is factored as its rank allows."""
        left, sizes, right = np.linalg.svd(J)
        rank = max(1, int((sizes > np.finfo(float).eps * len(J) * sizes.max(initial=0.0)).sum()))
        return cls(A, B, C, left[:, :rank] * sizes[:rank], right[:rank])

    def step(self, T: float) -> Float:
        """M(T), (r, r)."""
        from scipy.linalg import expm

        return np.asarray(self.V @ expm(self.A * T) @ self.U)

    def steps(self, low: float, high: float, count: int) -> Float:
        """M of that many intervals at equal distances, (count, r, r), by powers of one exponential."""
        from scipy.linalg import expm

        across = powers(expm(self.A * ((high - low) / (count - 1))), count)
        return np.asarray(self.V @ across @ (expm(self.A * low) @ self.U))

    @property
    def strength(self) -> float:
        """|B| |C|; 0 where no w acts."""
        return float(np.linalg.norm(self.B, 2) * np.linalg.norm(self.C, 2)) if self.B.size and self.C.size else 0.0

    def growth(self, gaps: Sequence[float]) -> float:
        """Logarithm of the spectral radius of a sequence."""
        return float(logarithms(product(np.array([self.step(T) for T in gaps]))[None])[0])

    @cached_property
    def poles(self) -> Array:
        """Poles of the flow, 1/s."""
        return np.asarray(np.linalg.eigvals(self.A))

    @property
    def longest(self) -> float:
        """Longest interval for which doubles are believed, s."""
        growing = float(self.poles.real.max(initial=0.0))
        return TRUSTED / growing if growing else np.inf

    # Periodic measurements

    def shortest_unstable_period(self, low: float, high: float) -> float | None:
        """Shortest period of an interval that is found to be unstable, to `SHARP`; None if all are stable."""
        turns = float(np.abs(self.poles.imag).max(initial=0.0)) * (high - low) / TURN
        count = int(np.clip(turns, SCANNED, DENSEST))
        periods = np.linspace(low, high, count)
        growth = logarithms(self.steps(low, high, count))
        peaks = 1 + np.flatnonzero((growth[1:-1] >= growth[:-2]) & (growth[1:-1] >= growth[2:]))
        unstable = np.flatnonzero(growth >= ROUNDING)
        end = unstable[0] if len(unstable) else count - 1
        for k in peaks[peaks < end]:
            peak = self.peak(float(periods[k - 1]), float(periods[k + 1]))
            if self.growth([peak]) >= ROUNDING:
                return self.sharper(float(periods[k - 1]), peak)
        if not len(unstable):
            return None
        return low if not end else self.sharper(float(periods[end - 1]), float(periods[end]))

    def peak(self, low: float, high: float) -> float:
        """Period about the largest growth between two."""
        for _ in range(CLOSER):
            periods = np.linspace(low, high, WITHIN)
            k = int(logarithms(self.steps(low, high, WITHIN)).argmax())
            low, high = float(periods[max(k - 1, 0)]), float(periods[min(k + 1, WITHIN - 1)])
        return float(periods[k])

    def sharper(self, stable: float, unstable: float) -> float:
        """Unstable period near to where instability begins between two periods."""
        return scan.edge(lambda T: self.growth([T]) >= ROUNDING, unstable, stable, SHARP)

    # Sequences

    def table(self, T1: float, T2: float) -> Float:
        """M of each letter, (LETTERS + 1, r, r)."""
        return self.steps(*interval(T1, T2), LETTERS + 1)

    def words(self, M: Float) -> tuple[list[Word], Float]:
        """Sequences of one interval again and again, or of two, some times the one and some times the other.

        Beside them the logarithms of their spectral radii. Of two, one is the longest, T2.
        """
        runs = [powers(M[a], int(RUNS[-1]) + 1)[RUNS] for a in COARSE]
        words, products = [np.array([a]) for a in COARSE], [M[COARSE]]
        for a, run in zip(COARSE[:-1], runs[:-1], strict=True):
            words += [np.repeat([a, LETTERS], [i, j]) for i in RUNS for j in RUNS]
            products.append((runs[-1] @ run[:, None]).reshape(-1, *M.shape[1:]))
        return words, logarithms(np.concatenate(products))

    def climbed(self, M: Float, word: Word, lengths: Float) -> Word:
        """Sequence whose growth over its time is the largest as far as its intervals are moved one by one.

        `lengths`: of the letters, s; of equal ones the spectral radius is the largest.
        """
        best = logarithms(product(M[word])[None])[0] / lengths[word].sum()
        for _ in range(ROUNDS):
            k = np.repeat(np.arange(len(word)), len(MOVES))
            tried = np.repeat(word[None], len(k), axis=0)
            tried[np.arange(len(k)), k] = np.clip(word[k] + np.tile(MOVES, len(word)), 0, LETTERS)
            before, after = partial(M[word])
            rates = logarithms(after[k] @ M[tried[np.arange(len(k)), k]] @ before[k]) / lengths[tried].sum(axis=1)
            i = int(rates.argmax())
            if not rates[i] > best + SHARP * abs(best):
                break
            best, word = rates[i], tried[i]
        return word

    def fastest_growth(self, T1: float, T2: float) -> tuple[Float, float]:
        """Intervals of a sequence whose growth over its time, 1/s, is the largest that was found, and this growth."""
        M, gaps = self.table(T1, T2), np.linspace(*interval(T1, T2), LETTERS + 1)
        words, sizes = self.words(M)
        rates = sizes / np.array([gaps[word].sum() for word in words])
        first = int((rates >= rates.max() - SHARP * abs(rates.max())).argmax())  # of equal ones the simplest
        word = self.climbed(M, words[first], gaps)
        return gaps[word], self.growth(gaps[word].tolist()) / float(gaps[word].sum())

    def largest(self, T1: float, T2: float) -> float:
        """Logarithm of the largest spectral radius of the sequences that are tried first."""
        return float(self.words(self.table(T1, T2))[1].max())

    def shortest_unstable(self, T1: float, low: float, high: float) -> tuple[float, Float] | None:
        """Least T2 of an interval for which a sequence is found to be unstable, and its intervals; None if none is."""
        if self.largest(T1, high) < ROUNDING:
            return None
        edge = scan.edge(lambda T2: self.largest(T1, T2) >= ROUNDING, high, low, 1 / LETTERS**2)
        words, sizes = self.words(self.table(T1, edge))
        found = words[int(sizes.argmax())]
        for _ in range(TWICE):
            found = self.climbed(self.table(T1, edge), found, np.ones(LETTERS + 1))

            def unstable(T2: float, word: Word = found) -> bool:
                return self.growth(np.linspace(*interval(T1, T2), LETTERS + 1)[word].tolist()) >= ROUNDING

            below = max(low, SHORTENED * edge)
            edge = below if unstable(below) else scan.edge(unstable, edge, below, SHARP)
        return edge, np.linspace(*interval(T1, edge), LETTERS + 1)[found]


def interval(T1: float, T2: float) -> tuple[float, float]:
    """Ends of the intervals that sequences consist of; for T1 = 0 the shortest is a small part of T2."""
    return T1 or T2 / (LETTERS + 1), T2


def logarithms(products: Float) -> Float:
    """Logarithms of spectral radii (k,) of matrices (k, r, r); of one that is not finite, which shows nothing, -inf."""
    finite = np.isfinite(products).all(axis=(1, 2))
    found = np.full(len(products), -np.inf)
    sizes = np.abs(np.linalg.eigvals(products[finite])).max(axis=1, initial=0.0)
    found[finite] = np.log(sizes)
    return found


def product(factors: Float) -> Float:
    """Product of matrices (k, r, r), the first of which acts first."""
    found = factors[0]
    for factor in factors[1:]:
        found = factor @ found
    return np.asarray(found)


def partial(factors: Float) -> tuple[Float, Float]:
    """Products of all factors before each one, and of all after it, (k, r, r) both."""
    eye = np.eye(factors.shape[1])
    before, after = [eye], [eye]
    for factor, last in zip(factors[:-1], factors[:0:-1], strict=True):
        before.append(factor @ before[-1])
        after.append(after[-1] @ last)
    return np.array(before), np.array(after[::-1])
