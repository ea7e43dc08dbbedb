"""Largest Lipschitz constants over all gains: closed forms, and problems without the gain.

With N an orthonormal basis of ker C, M one of its complement, A_b = A + beta I, a = N'A_b N and W = M'A_b N, a gain L
exists iff N'(He(P A_b) + ..) N < 0, for F = P L is free in N'F C = 0 and large elsewhere.

Theorems 1 and 2 (l is the largest constant of f as a whole; P <= I without loss): minimise the largest eigenvalue -2 l
of N' He(P A_b) N. With P = (I + Z) / 2 and |Z| <= 1 only the columns [S; R] = [N'; M'] Z N matter, and these are any
contraction with a symmetric S (Parrott; Davis, Kahan and Weinberger 1982):

    -2 l I >= He((I + S) a + R'W) / 2,    k = dim ker C = 1:   l = (|w| - nu'w) / 2,  w = A_b nu.

S-procedure: V = P N, and further unknowns, are free in the same way. Eliminated one after the other they leave the
plant x' = A x + B f, y = C x + D f, of order k, on the largest subspace on which some f keeps y at zero (weakly
unobservable; `output_nulling`), where D has full row rank; all larger P can be completed. Then f = -D^+ C x + E f' and

    He(P A_z) + P B_z B_z' P + c^2 Q <= K'K,    A_z = A - B D^+ C,  B_z = B E,  K = D^+ C

for one block, Q = Cq'Cq on the subspace; scales enter for several. For k = 1 that is a quadratic in p. The inequality
need not be strict for the supremum: where no mode is undetectable it has a strict solution for a small c and any
scales, and a convex combination with that (in P and the c^2 tau_i) is strict. With tau_i = 0 it is not, so that
several blocks need strict inequalities.

A block whose argument decays on the subspace whatever f does can be left out: on the quotient by what Cq_i does not
see, A_z is stable and B_z = 0, so that He(P_i A_z) = -Q_i there pays for c^2 tau_i Q_i, and a large tau_i keeps f_i at
zero in the rest, which is a smaller problem of the same kind. Every constant will do iff no block is left in the end.
Otherwise, for each block i left, the arguments see a mode that does not decay, or one that f moves: there is a motion
(x, f) exp(s t), Re s >= 0, with y = 0 and q_i != 0, on which c^2 sum_j tau_j |q_j|^2 <= sum_j tau_j |f_j|^2. For the
block of the largest tau_i that leaves c^2 |q_i|^2 <= |f|^2.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import inf, sqrt
from typing import Any

import numpy as np

from obsdesign.families.lipschitz.relaxations import Lipschitz
from obsdesign.lmi.formula import Array, Inequality, Problem, Unknown, Values, block_diagonal, he, symmetric
from obsdesign.model.pencil import System, output_nulling, scaled, split
from obsdesign.records import dataclass, replace

ZERO = 1e-10  # relative size of what is taken for zero after a change of basis
ROUNDED = 1e-5  # eigenvalue of a solution, where 1 is large, that counts as zero
DIP = 1e-10  # relative depth below the least value known at which a lower one is searched for


def arguments(unit: Lipschitz) -> list[Array]:
    """Rows l_i Cq_i of each block."""
    blocks = unit.multiplier.scaled_blocks()
    edges = np.cumsum([0, *(b.nq for b in blocks)])
    rows = [unit.plant.Cq[i:j] for i, j in pairwise(edges)]
    return [np.sqrt(b.M11.diagonal())[:, None] * part for b, part in zip(blocks, rows, strict=True)]


@dataclass(frozen=True)
class Unseen:
    """Dynamics of what y does not see, in orthonormal coordinates: a = N'A_b N and W = M'A_b N up to a rotation."""

    a: Array  # (k, k)
    W: Array  # (r, k)

    @classmethod
    def of(cls, unit: Lipschitz) -> "Unseen":
        """For a family in doubles."""
        return cls.by(unit.plant.A + unit.rate * np.eye(unit.plant.n), unit.plant.C)

    @classmethod
    def by(cls, A: Array, C: Array) -> "Unseen":
        """For A_b and C."""
        rows = np.linalg.norm(C, axis=1, keepdims=True)
        N, M = split(C / np.where(rows > 0, rows, 1))
        return cls(N.T @ A @ N, np.asarray(np.linalg.qr(M.T @ A @ N, mode="r")))

    @property
    def order(self) -> int:
        """Dimension k of ker C."""
        return len(self.a)

    @property
    def closed(self) -> float:
        """Largest l of Theorem 2 for k = 1."""
        a, w = self.a.item(), sqrt(self.a.item() ** 2 + float((self.W**2).sum()))
        return (w - a) / 2 if a < 0 else float((self.W**2).sum()) / (w + a) / 2 if w + a else 0.0

    def problem(self) -> Problem:
        """Theorem 2 without the gain: minimise t = -2 l."""
        k, r = self.order, len(self.W)

        def inequalities(v: Values) -> tuple[Inequality, ...]:
            S, R, eye = v["S"], v["R"], np.eye(k)
            decrease = he((eye + S) @ self.a + R.mT @ self.W) / 2 - v["t"] * eye
            contraction = -symmetric([[eye, S, R.mT], [eye, np.zeros((k, r))], [np.eye(r)]])
            return Inequality("He(P A_b) <= t I", decrease), Inequality("P <= I", contraction)

        unknowns = (Unknown("S", (k, k), symmetric=True), Unknown("R", (r, k)), Unknown("t", (1, 1)))
        return Problem(unknowns, inequalities, lambda v: v["t"])

    def regular(self, values: Values) -> bool:
        """Whether a solution has a P > 0: Z > -I has a completion [S, R'; R, .] with |Z| <= 1."""
        S, R, eye = values["S"], values["R"], np.eye(self.order)
        low, high = eye + S, eye - S
        if np.linalg.eigvalsh(low)[0] <= ROUNDED:
            return False
        rest = 2 * np.eye(len(R)) - R @ np.linalg.solve(low, R.T) - R @ np.linalg.pinv(high, ROUNDED, True) @ R.T
        return bool(np.linalg.eigvalsh(rest).min(initial=1.0) > ROUNDED)


@dataclass(frozen=True)
class Share:
    """One block of f: its number of components, and the rows l Cq of its argument."""

    nf: int
    Cq: Array


@dataclass(frozen=True)
class Core:
    """What the s-procedure comes down to: x' = A x + B f, y = C x + D f, q = Cq x with a D of full row rank.

    The states are balanced, time is scaled, and so are Cq and the columns of B of each block, to norms of at most 1:
    the largest constant of the family is `scale` times that of the core. Without blocks it is infinite.
    """

    system: System
    shares: tuple[Share, ...]  # Cq (nq_i, k)
    scale: float

    @classmethod
    def of(cls, unit: Lipschitz) -> "Core":
        """For a family in doubles; its Df is zero."""
        p, none, blocks = unit.plant, np.zeros, unit.multiplier.scaled_blocks()
        balanced = scaled(System(p.A + unit.rate * np.eye(p.n), none((p.n, 0)), p.C, none((len(p.C), 0))))
        columns = np.split(p.Bf / balanced.states[:, None], np.cumsum([b.nf for b in blocks])[:-1], axis=1)
        sizes = [float(np.linalg.norm(B, 2)) or 1.0 for B in columns]
        rows = [size * part * balanced.states for size, part in zip(sizes, arguments(unit), strict=True)]
        sight = float(np.linalg.norm(np.vstack(rows), 2)) or 1.0
        shares = tuple(Share(b.nf, part / sight) for b, part in zip(blocks, rows, strict=True))
        B = np.hstack([part / size for part, size in zip(columns, sizes, strict=True)])
        return cls.reduced(balanced.system, B, shares, balanced.rate / sight)

    @classmethod
    def reduced(cls, system: System, B: Array, shares: tuple[Share, ...], scale: float) -> "Core":
        """Leave out the blocks whose argument decays whatever f does; without them the rest is smaller."""
        V, inner = output_nulling(System(system.A, B, system.C, np.zeros((len(system.C), B.shape[1]))))
        core = cls(inner, tuple(replace(share, Cq=share.Cq @ V) for share in shares), scale)
        lasting = [
            core.lasts(part.Cq / (np.linalg.norm(share.Cq) or 1))
            for share, part in zip(shares, core.shares, strict=True)
        ]
        if all(lasting):
            return core
        columns = np.repeat(lasting, [share.nf for share in shares])
        left = tuple(share for share, lasts in zip(shares, lasting, strict=True) if lasts)
        return cls.reduced(system, B[:, columns], left, scale)

    def lasts(self, Cq: Array) -> bool:
        """Whether Cq x need not decay while y is zero: a mode that it sees does not decay, or f moves one."""
        A, B, _ = self.hidden
        unseen, _ = output_nulling(System(A, np.zeros((len(A), 0)), Cq, np.zeros((len(Cq), 0))))
        seen = split(unseen.T)[0]
        poles = np.linalg.eigvals(seen.T @ A @ seen)
        return bool((poles.real >= -ZERO).any() or (np.abs(seen.T @ B) > ZERO).any())

    @property
    def hiding(self) -> Array:
        """Map from (x, f') to the (x, f) that keep y at zero: f = -K x + E f'."""
        s = self.system
        E = split(s.D)[0]
        return np.block([[np.eye(len(s.A)), np.zeros((len(s.A), E.shape[1]))], [-np.linalg.pinv(s.D) @ s.C, E]])

    @property
    def hidden(self) -> tuple[Array, Array, Array]:
        """A_z, B_z and K."""
        k, T = len(self.system.A), self.hiding
        flow = np.hstack([self.system.A, self.system.B]) @ T
        return flow[:, :k], flow[:, k:], -T[k:, :k]

    @property
    def closed(self) -> tuple[float, bool]:
        """Largest constant of one block for k = 1, in the units of the family, and whether its p is positive.

        c^2 |Cq|^2 <= |K|^2 - 2 p A_z - p^2 |B_z|^2.
        """
        A, B, K = self.hidden
        a, b, q = A.item(), float((B**2).sum()), float((self.shares[0].Cq ** 2).sum())
        decays = a < -ZERO  # then f moves it, B_z != 0
        return self.scale * sqrt((float((K**2).sum()) + (a * a / b if decays else 0.0)) / q), decays

    def dissipation(self, P: Array, scales: Sequence[Array], c2: Any) -> Array:
        """He(P A) + c^2 Q, P B; ., -diag(tau) on the (x, f) that keep y at zero, Q = sum tau_i Cq_i'Cq_i."""
        s, T = self.system, self.hiding
        Q = np.sum([tau * (share.Cq.T @ share.Cq) for tau, share in zip(scales, self.shares, strict=True)], axis=0)
        cost = block_diagonal([tau * np.eye(share.nf) for tau, share in zip(scales, self.shares, strict=True)])
        return np.asarray(T.T @ symmetric([[he(P @ s.A) + c2 * Q, P @ s.B], [-cost]]) @ T)

    def largest(self, scales: Sequence[Array]) -> Problem:
        """Maximise c^2 for given scales."""

        def inequalities(v: Values) -> tuple[Inequality, ...]:
            dissipation = self.dissipation(v["P"], scales, v["c2"])
            return Inequality("dissipation", dissipation), Inequality("P >= 0", -v["P"])

        P = Unknown("P", self.system.A.shape, symmetric=True)
        return Problem((P, Unknown("c2", (1, 1))), inequalities, lambda v: -v["c2"])

    def constant(self, objective: float) -> float:
        """Constant of the family at an optimum of `largest`."""
        return self.scale * sqrt(max(-objective, 0.0))

    def admissible(self, constant: float) -> Problem:
        """Scales for a constant (of the family)."""
        names, c2 = self.scales, (constant / self.scale) ** 2

        def inequalities(v: Values) -> tuple[Inequality, ...]:
            dissipation = self.dissipation(v["P"], [v[name] for name in names], c2)
            positive = (Inequality(f"{name} > 0", -v[name], strict=True) for name in ("P", *names))
            return Inequality("dissipation", dissipation, strict=True), *positive

        P = Unknown("P", self.system.A.shape, symmetric=True)
        return Problem((P, *(Unknown(name, (1, 1)) for name in names)), inequalities)

    @property
    def scales(self) -> tuple[str, ...]:
        """Names of the scales."""
        return tuple(f"tau{i}" for i in range(1, len(self.shares) + 1))


def regular(P: Array) -> bool:
    """Whether P > 0 but for rounding."""
    values = np.linalg.eigvalsh(P)
    return bool(values[0] > ROUNDED * max(values[-1], ROUNDED))


def unstructured(unit: Lipschitz) -> bool:
    """Whether f is one block, and Bf and Cq are orthogonal up to a factor: then f is any |df| <= l |dx|."""

    def orthogonal(X: Array) -> bool:
        square = X.T @ X
        return bool(X.shape[0] == X.shape[1] and np.allclose(square, square[0, 0] * np.eye(len(X)), rtol=0, atol=ZERO))

    p = unit.plant
    sizes = np.linalg.norm(p.Bf, 2), np.linalg.norm(p.Cq, 2)
    return (
        len(unit.multiplier.blocks) == 1 and all(sizes) and orthogonal(p.Bf / sizes[0]) and orthogonal(p.Cq / sizes[1])
    )


def least_undetecting(unit: Lipschitz) -> float:
    """Size of the smallest linear f = K x that hides a mode with a real eigenvalue s >= -beta, in doubles.

    Of samples |s| >= rho. It is infinite where y shows every state.
    """
    p, end, eye = unit.plant, unit.edge.end, np.eye(unit.plant.n)
    C = p.Df @ np.linalg.inv(p.Bf) if p.Df.any() else p.C  # of filtered estimates C and Df are C A and C Bf
    sides = (1, -1) if unit.edge.sampled else (1,)
    unseen = [Unseen.by(side * p.A - end * eye, C) for side in sides]
    return min((least_hiding(each) for each in unseen if each.order), default=inf)


def least_hiding(unseen: Unseen) -> float:
    """Least singular value of (A_b - s I) N over s >= 0, which is the size |K| of a K that hides the mode s.

    The square of that is the least eigenvalue of G - s He(a) + s^2 I, G = N'A_b'A_b N, and reaches a level where this
    is singular. Levels below the least value known are cut by it at the ends of intervals, in which there are smaller
    ones, until none is cut (Byers 1988).
    """
    a, G = unseen.a, unseen.a.T @ unseen.a + unseen.W.T @ unseen.W
    eye, zero, turn = np.eye(len(a)), np.zeros_like(a), he(a)

    def size(s: float) -> float:
        return sqrt(max(float(np.linalg.eigvalsh(G - s * turn + s * s * eye)[0]), 0.0))

    least = min(size(s) for s in (0.0, *np.linalg.eigvals(a).real.clip(0.0)))
    while least:
        level = (least * (1 - DIP)) ** 2
        roots = np.linalg.eigvals(np.block([[zero, eye], [level * eye - G, turn]]))
        cuts = np.sort(roots.real[(np.abs(roots.imag) <= ROUNDED * np.abs(roots)) & (roots.real > 0)])
        found = min((size((low + high) / 2) for low, high in pairwise(cuts)), default=inf)
        if found >= least * (1 - DIP):
            break
        least = found
    return least
