"""What is computed of a design in doubles, over frozen members f = K q of the class; nothing of it is proved.

The error of an observer that is a copy of its plant with the injections L1 and L2, measurement noise n and K in place
of f, follows

    e' = (A + L1 C + G F (Cq + L2 C)) e - (B + L1 D + G F (Dq + L2 D)) v - (L1 + G F L2) n,
    G = Bf + L1 Df,    F = (I - K (Dqf + L2 Df))^-1 K,

algebraic loop included; in discrete time e+ does, the error of the next sample, and what differs is in `modes`. The
members are the vertices of the class and points between them; what is said to be the worst is so of these.
"""

from collections.abc import Iterator
from functools import cached_property
from itertools import product
from math import prod
from typing import Any

import numpy as np

from obsdesign.dissipation.areas import largest_area, worst_area
from obsdesign.dissipation.modes import EXPONENTIALS, INSIDE, LARGE, ROUNDING, Modes
from obsdesign.dissipation.residues import Spectrum
from obsdesign.dissipation.steps import exact_step, explicit_steps
from obsdesign.lmi.formula import Array, Float, block_diagonal, in_floats
from obsdesign.model.multiplier import Block, Multiplier
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, field

MOST = 81  # members
ROTATIONS = 6  # of a matrix on the edge of a ball of matrices, and as many of the opposite ones
STEEP = (1.0, 1e2, 1e4, 1e6)  # slopes that are tried, above the least, where there is no upper bound
STARTS = 8  # members from which extreme ones are sought, in as many steps as
ASCENTS = 8


@dataclass(frozen=True)
class Errors:
    """Error systems of given injections for members of a class."""

    plant: Plant[Float]
    multiplier: Multiplier  # in rationals
    H: Array  # (nz, n)
    L1: Array
    L2: Array
    modes: Modes = field(default=EXPONENTIALS, kw_only=True)
    channels: tuple[Array, Array] | None = field(default=None, kw_only=True)  # of v: those at k, those at k + 1

    @classmethod
    def of(
        cls,
        plant: Plant[Array],
        multiplier: Multiplier,
        H: Array,
        L1: Array | None = None,
        L2: Array | None = None,
        **time: Any,
    ) -> "Errors":
        """Of a plant and z = H e; without a gain it is zero. `time`: `modes` and `channels`, if not the usual ones."""
        p = plant.doubles
        L1, L2 = (np.zeros(C.shape) if L is None else in_floats(L) for L, C in ((L1, p.C.T), (L2, p.Cq @ p.C.T)))
        return cls(p, multiplier, in_floats(H), L1, L2, **time)

    @property
    def gap(self) -> float | None:
        """Longest time in s for which the error follows these alone; None: always."""
        return None

    @property
    def sampled(self) -> bool:
        """Whether the noise of y enters at instants, one value at each."""
        return self.modes.sampled

    @property
    def bounded(self) -> bool:
        """Whether the slopes of every block that acts are bounded, and its members known well enough to be sampled.

        Of matrices that satisfy two quadratic forms they are not.
        """
        q = f = 0
        for block in self.multiplier.blocks:
            acts = self.plant.Cq[q : q + block.nq].any() and np.vstack([self.plant.Bf, self.plant.Df])[:, f].any()
            unknown = len(block.generators) > 1 and block.nq * block.nf > 1
            if acts and (unknown or not block.bounded):
                return False
            q, f = q + block.nq, f + block.nf
        return True

    @cached_property
    def through(self) -> list[Array]:
        """F of each member for which the algebraic loop has one solution."""
        sampled = members(self.multiplier)
        extreme = (K for start in sampled[:STARTS] for K in self.extremes(start)) if self.balls else ()
        found = (self.looped(K) for K in (*sampled, *extreme))
        return [F for F in found if F is not None]

    @cached_property
    def distinct(self) -> list[Array]:
        """F of the members, each once: vertices and what is sought from them are often the same."""
        return list({F.tobytes(): F for F in self.through}.values())

    def looped(self, K: Array) -> Array | None:
        """F of a member; None where the algebraic loop has no one solution."""
        loop = np.eye(len(K)) - K @ (self.plant.Dqf + self.L2 @ self.plant.Df)
        return np.linalg.solve(loop, K) if not len(K) or np.linalg.cond(loop) < 1 / INSIDE else None

    @cached_property
    def balls(self) -> list[tuple[slice, slice, Array, Array, Array]]:
        """Rows, columns, center, S and T of each block whose class is a ball of matrices."""
        found, q, f = [], 0, 0
        for block in self.multiplier.blocks:
            ball = ball_of(block) if block.bounded and block.nq * block.nf > 1 else None
            found += [(slice(f, f + block.nf), slice(q, q + block.nq), *ball)] if ball else []
            q, f = q + block.nq, f + block.nf
        return found

    def extremes(self, start: Array) -> Iterator[Array]:
        """Members with a slow, a fast, and a fast oscillating pole, by ascent over the balls of matrices from one.

        For a simple pole d lambda = r dK b with r = w* G (I - K D)^-1 / (w* x), b = (I + D F) (Cq + L2 C) x; on the
        ball center + S U T, |U| <= 1, Re(c* r dK b) is the largest at the polar factor of S' Re(c* r' b') T'.
        """
        from scipy.linalg import eig, polar

        p, D = self.plant, self.plant.Dqf + self.L2 @ self.plant.Df
        G, Q = p.Bf + self.L1 @ p.Df, p.Cq + self.L2 @ p.C
        for c in (1.0, -1.0, 1j):
            K = start.copy()
            for _ in range(ASCENTS):
                F = self.looped(K)
                if F is None:
                    break
                values, left, right = eig(p.A + self.L1 @ p.C + G @ F @ Q, left=True, right=True)  # type: ignore[misc]
                k = int((values / c).real.argmax())
                w, x = left[:, k].conj(), right[:, k]
                r = w @ G @ np.linalg.inv(np.eye(len(K)) - K @ D) / (w @ x or 1.0)
                slope = np.outer(r, (np.eye(len(D)) + D @ F) @ Q @ x) / c
                for rows, columns, center, S, T in self.balls:
                    U, _ = polar(S.T @ slope.real[rows, columns] @ T.T)
                    K[rows, columns] = center + S @ U @ T
                yield K.copy()

    @cached_property
    def systems(self) -> list[tuple[Array, Array, Array]]:
        """A, the input matrix of v and that of n, of each member that is distinct."""
        p, L1, L2 = self.plant, self.L1, self.L2
        G = p.Bf + L1 @ p.Df
        return [
            (
                p.A + L1 @ p.C + G @ F @ (p.Cq + L2 @ p.C),
                -(p.B + L1 @ p.D + G @ F @ (p.Dq + L2 @ p.D)),
                -(L1 + G @ F @ L2),
            )
            for F in self.distinct
        ]

    @cached_property
    def spectra(self) -> list[Spectrum | None]:
        """Modes of each of these, of large ones whose modes are well apart; None of the others."""
        return [Spectrum.of(A) if len(A) >= LARGE else None for A, _, _ in self.systems]

    @cached_property
    def poles(self) -> Array:
        """Poles of each member, (m, n)."""
        known = [one.poles for one in self.spectra if one]
        if known and len(known) == len(self.systems):
            return np.array(known)
        return np.linalg.eigvals(np.array([A for A, _, _ in self.systems]))

    @property
    def worst_pole(self) -> list[float] | None:
        """The slowest pole [re, im] in 1/s, or of samples; None where slopes are not bounded."""
        return self.modes.slowest(self.poles.ravel()) if self.bounded else None

    @cached_property
    def explicit_step(self) -> dict[str, float | None]:
        """Largest step in s with which Euler and Runge-Kutta 4 are stable; samples leave no step to choose."""
        return explicit_steps(self.poles) if self.bounded else {"euler": None, "rk4": None}

    @property
    def largest_step(self) -> dict[str, float | None]:
        """The same, and that with which the exact linear part is, with f held."""
        steps = self.explicit_step
        return {**steps, "exact": self.exact_step(steps["rk4"]) if self.bounded else None}

    def exact_step(self, unit: float | None) -> float | None:
        """Largest step of the discretisation that holds f and is exact otherwise; None: any, as far as was tried."""
        if unit is None or not self.modes.stable(self.poles):
            return None
        p = self.plant
        slopes = np.array([F @ (p.Cq + self.L2 @ p.C) for F in self.distinct])
        return exact_step(p.A + self.L1 @ p.C, p.Bf + self.L1 @ p.Df, slopes, unit)

    def noise_gain(self) -> dict[str, float]:
        """Largest gain over frequency from n to each estimate; empty where a pole is not stable."""
        if not self.modes.stable(self.poles):
            return {}
        known = zip(self.systems, self.spectra, strict=True)
        found = np.max([self.modes.amplitudes(A, N, modes) for (A, _, N), modes in known], axis=0).tolist()
        return dict(zip(self.plant.states, found, strict=False))

    def noise_norms(self, E: Array, held: float | None = None) -> Array | None:
        """H2 norm from each n to each row of E e, (k, n) to (k, ny); None where a pole is not stable or no slope bound.

        That is the rms of the error for white noise n whose two-sided density is 1 unit/sqrt(Hz), or in samples for a
        rms of 1 in each; of each pair the largest over the members. `held`: as of `Modes.norms`.
        """
        if not self.bounded or not self.modes.stable(self.poles):
            return None
        known = zip(self.systems, self.spectra, strict=True)
        return np.asarray(np.max([self.modes.norms(A, N, E, modes, held) for (A, _, N), modes in known], axis=0))

    def energy_gain(self) -> float | None:
        """Largest singular value over frequency from v to z; None where a pole is not stable or slopes not bounded."""
        if not self.bounded or not self.modes.stable(self.poles):
            return None
        known = zip(self.systems, self.spectra, strict=True)
        return max((self.modes.gain(A, B, self.H, modes) for (A, B, _), modes in known), default=0.0)

    def channel_gains(self, *, peaks: bool) -> list[float] | None:
        """Gain from each v alone to z, the worst over the members: of energy, or of peaks; None as in `energy_gain`."""
        if not self.bounded or not self.modes.stable(self.poles):
            return None
        count = self.plant.B.shape[1]
        return [max(self.gain(A, B[:, [k]], peaks=peaks) for A, B, _ in self.systems) for k in range(count)]

    def gain(self, A: Array, B: Array, *, peaks: bool) -> float:
        """Gain of one member from some v to z, of peaks or of energy."""
        return largest_area(*self.modes.impulse(A, B, self.H)) if peaks else self.modes.gain(A, B, self.H)

    def peak_gain(self) -> float | None:
        """Integral of the norm of the impulse response from v to z, or its sum; None as in `energy_gain`."""
        return self.least_peak() if self.bounded and self.modes.stable(self.poles) else None

    def least_peak(self) -> float | None:
        """The same of the members that were tried and are stable, which bounds it from below; None if there is none.

        Of the vectors z it is the largest over directions u of that of |u' h|: the inputs with |v| <= 1 that are
        aligned with it attain it, and it is no more than the gain from sup|v| to sup|z|.
        """
        stable = [
            (A, B, known)
            for (A, B, _), known, poles in zip(self.systems, self.spectra, self.poles, strict=True)
            if self.modes.decay(poles, ROUNDING).all()
        ]
        with np.errstate(all="ignore"):
            if self.plant.n >= LARGE and not self.modes.sampled:
                return worst_area(EXPONENTIALS.impulse, stable, self.H)
            found = [largest_area(*self.impulse(A, B)) for A, B, _ in stable]
        return max((peak for peak in found if np.isfinite(peak)), default=None)

    def impulse(self, A: Array, B: Array) -> tuple[Array, Array]:
        """Response of z to an impulse of each v itself, where some of v is taken at k and some at the next sample.

        What v does at k is seen a sample later than what v does at k + 1.
        """
        h, widths = self.modes.impulse(A, B, self.H)
        if self.channels is None:
            return h, widths
        now, late = self.channels
        soon, h = h[: now.sum()], h[now.sum() :]
        found = np.zeros((len(now), *h.shape[1:]))
        found[now, :, 1:] = np.concatenate([soon[..., :-2], soon[..., -2:].sum(axis=-1, keepdims=True)], axis=-1)
        found[late] += h
        return found, widths


def members(multiplier: Multiplier) -> list[Array]:
    """Frozen members, (nf, nq) each, in doubles; the same in every run.

    Where there are too many to try all: every block at its least or its largest, or all at their least and all at their
    largest ones, and others at random.
    """
    choices = [samples(block) for block in multiplier.blocks]
    if prod(map(len, choices)) <= MOST:
        return [block_diagonal(list(part)) for part in product(*choices)]
    ends = [(min(choice, key=np.sum), max(choice, key=np.sum)) for choice in choices]
    chosen = list(map(list, zip(*ends, strict=True) if 2 ** len(ends) > MOST else product(*ends)))
    random = np.random.default_rng(0)
    chosen += [[c[random.integers(len(c))] for c in choices] for _ in range(MOST - len(chosen))]
    return [block_diagonal(part) for part in chosen]


def samples(block: Block) -> list[Array]:
    """Members of one block."""
    found = [in_floats(K) for K in block.vertices]
    middle = [np.mean(found, axis=0)]
    if not block.bounded:
        return [*found, *(found[0] + k * np.eye(*found[0].shape) for k in STEEP if block.nf == block.nq)]
    if block.nq == block.nf == 1:
        return [*(np.array([[k]]) for k in sorted({K.item() for K in found})), *middle]
    random = np.random.default_rng(0)
    if ball := ball_of(block):
        center, S, T = ball
        for _ in range(ROTATIONS):
            U, _, V = np.linalg.svd(random.normal(size=(block.nf, block.nq)), full_matrices=False)
            found += [center + S @ U @ V @ T, center - S @ U @ V @ T]
    return [*found, *middle]


def ball_of(block: Block) -> tuple[Array, Array, Array] | None:
    """Center, S and T of a class {center + S U T, |U| <= 1}: one quadratic form with M22 < 0; None for others."""
    if len(block.generators) != 1:
        return None
    M11, M12, R = (in_floats(M) for M in (block.generators[0].M11, block.generators[0].M12, -block.generators[0].M22))
    center = np.linalg.solve(R, M12.T)
    values, vectors = np.linalg.eigh(M11 + M12 @ center)
    S = np.linalg.inv(np.linalg.cholesky(R)).T
    return center, S, np.sqrt(np.maximum(values, 0))[:, None] * vectors.T
