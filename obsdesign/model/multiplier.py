"""Incremental multipliers: what a design may assume of f.

A matrix M is an incremental multiplier of f if, for every pair of arguments,

    [dq; df]' M [dq; df] >= 0,    dq = q1 - q2,  df = f(t, y, q1) - f(t, y, q2).

A template is a convex cone of such matrices, with unknowns of its own. An observer family sees M11, M12, M22 and the
inequalities of the cone, never a type.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from math import isqrt
from string import ascii_lowercase
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.lmi.formula import (
    Array,
    Inequality,
    Unknown,
    Values,
    block_diagonal,
    identity,
    zeros,
)
from obsdesign.lmi.proof import holds
from obsdesign.records import dataclass, replace

Matrix = tuple[Array, Array, Array]  # M11 (nq, nq), M12 (nq, nf), M22 (nf, nf)


@dataclass(frozen=True)
class Block(ABC):
    """A convex cone of multipliers for one part of q and f.

    `member` is a linear map K in the class: df = K dq satisfies the inequality of every M of the cone, that is
    [I; K]' M [I; K] >= 0. The names of the unknowns end in a label, by which blocks of one multiplier differ.
    """

    member: Array  # (nf, nq)

    @property
    def nq(self) -> int:
        """Number of components of q."""
        return int(self.member.shape[1])

    @property
    def nf(self) -> int:
        """Number of components of f."""
        return int(self.member.shape[0])

    @property
    @abstractmethod
    def generators(self) -> "tuple[Scaled, ...]":
        """The inequalities that say what is in the class; empty where it is known by `vertices` only."""

    @property
    @abstractmethod
    def vertices(self) -> tuple[Array, ...]:
        """Linear maps of the class, in rationals: those at its ends, as far as there are finitely many."""

    @property
    def bounded(self) -> bool:
        """Whether all its linear maps are bounded: M22 < 0 for some M."""
        return any(holds(Inequality("M22 < 0", part.M22, strict=True)) for part in self.generators)

    def contains(self, K: Array) -> bool:
        """Whether a linear map is surely in the class, in rationals."""
        if self.generators:
            return all(holds(Inequality("", -replace(g, member=K).shifted().M11)) for g in self.generators)
        return any((vertex == K).all() for vertex in self.vertices)

    @abstractmethod
    def unknowns(self, label: str) -> tuple[Unknown, ...]:
        """What determines M."""

    @abstractmethod
    def matrix(self, v: Values, label: str) -> Matrix:
        """M11, M12, M22 for the unknowns in v."""

    @abstractmethod
    def inequalities(self, v: Values, label: str) -> tuple[Inequality, ...]:
        """Inequalities that say that M is in the cone."""

    def one_scale(self) -> "Scaled | None":
        """A ray with the same member whose M say as much as those of the cone; None if no single one is known to."""
        return None


@dataclass(frozen=True)
class Scaled(Block):
    """The ray {lambda M : lambda >= 0}. The loop shift f -> f - K q takes M to a matrix with M11 >= 0."""

    M11: Array  # (nq, nq)
    M12: Array  # (nq, nf)
    M22: Array  # (nf, nf)

    @classmethod
    def of(cls, M: Array, nq: int, member: Array | None = None) -> "Scaled":
        """Ray of a whole matrix M, (nq + nf) square; without a member K is zero."""
        K = zeros((len(M) - nq, nq), [M]) if member is None else member
        return cls(K, M[:nq, :nq], M[:nq, nq:], M[nq:, nq:])

    @property
    def generators(self) -> "tuple[Scaled, ...]":
        """Itself."""
        return (self,)

    @property
    def vertices(self) -> tuple[Array, ...]:
        """Member, and the multiples of the identity at the ends."""
        return ends(self)

    def form(self, q: Array, f: Array) -> Array:
        """Return [q; f]' M [q; f] for pairs in the columns of q (nq, r) and f (nf, r)."""
        across = q.mT @ self.M12 @ f
        return np.asarray(q.mT @ self.M11 @ q + across + across.mT + f.mT @ self.M22 @ f)

    def unknowns(self, label: str) -> tuple[Unknown, ...]:
        """The scale."""
        return (Unknown(f"lambda{label}", (1, 1)),)

    def matrix(self, v: Values, label: str) -> Matrix:
        """Scaled matrix."""
        scale = v[f"lambda{label}"]
        return scale * self.M11, scale * self.M12, scale * self.M22

    def inequalities(self, v: Values, label: str) -> tuple[Inequality, ...]:
        """The scale is not negative."""
        name = f"lambda{label}"
        return (Inequality(f"{name} >= 0", -v[name]),)

    def one_scale(self) -> "Scaled":
        """The ray itself."""
        return self

    def shifted(self) -> "Scaled":
        """Ray of f - K q: [I 0; K I]' M [I 0; K I]."""
        K = self.member
        M12 = self.M12 + K.mT @ self.M22
        M11 = self.M11 + self.M12 @ K + K.mT @ M12.mT
        return Scaled(0 * K, M11, M12, self.M22)


@dataclass(frozen=True)
class Sum(Block):
    """The cone {sum_j lambda_j M_j : lambda_j >= 0}: several inequalities hold for the same q and f."""

    parts: tuple[Scaled, ...]

    @property
    def generators(self) -> tuple[Scaled, ...]:
        """The parts."""
        return self.parts

    @property
    def vertices(self) -> tuple[Array, ...]:
        """Member, and the multiples of the identity at the ends."""
        return ends(self)

    def named(self, label: str) -> list[tuple[str, Scaled]]:
        """Parts with labels of their own: 3a, 3b, .."""
        return [(f"{label}{letter}", part) for letter, part in zip(ascii_lowercase, self.parts, strict=False)]

    def unknowns(self, label: str) -> tuple[Unknown, ...]:
        """One scale for each part."""
        return tuple(u for name, part in self.named(label) for u in part.unknowns(name))

    def matrix(self, v: Values, label: str) -> Matrix:
        """Sum of the scaled matrices."""
        scaled = [part.matrix(v, name) for name, part in self.named(label)]
        M11, M12, M22 = (np.sum(same, axis=0) for same in zip(*scaled, strict=True))
        return M11, M12, M22

    def inequalities(self, v: Values, label: str) -> tuple[Inequality, ...]:
        """No scale is negative."""
        return tuple(i for name, part in self.named(label) for i in part.inequalities(v, name))


@dataclass(frozen=True)
class Multiplier:
    """Blocks side by side: q = (q_1, .., q_k), f = (f_1, .., f_k), each with unknowns of its own.

    The combined matrix in the order (q, f) is block diagonal in each of M11, M12, M22. (A block-diagonal M
    itself, in the order (q_1, f_1, q_2, f_2), would tie the wrong components together.)
    """

    blocks: tuple[Block, ...]

    @property
    def member(self) -> Array:
        """A linear map (nf, nq) in the class: the class contains df = K dq."""
        return block_diagonal([b.member for b in self.blocks])

    def labelled(self) -> list[tuple[str, Block]]:
        """Blocks with their labels, counted from 1 as a user reads them."""
        return [(str(i), block) for i, block in enumerate(self.blocks, start=1)]

    def unknowns(self) -> tuple[Unknown, ...]:
        """Unknowns of all blocks."""
        return tuple(u for label, block in self.labelled() for u in block.unknowns(label))

    def matrix(self, v: Values) -> Matrix:
        """M11, M12, M22 for the unknowns in v."""
        matrices = [block.matrix(v, label) for label, block in self.labelled()]
        M11, M12, M22 = (block_diagonal([M[k] for M in matrices]) for k in range(3))
        return M11, M12, M22

    def inequalities(self, v: Values) -> tuple[Inequality, ...]:
        """Inequalities that say that every block is in its cone."""
        return tuple(i for label, block in self.labelled() for i in block.inequalities(v, label))

    def scaled_blocks(self) -> tuple[Scaled, ...]:
        """Blocks of one scale each, which a free L2 needs: its unknown is lambda L2.

        Raises `UsageError`: a block has more unknowns than one scale.
        """
        scaled = []
        for label, block in self.labelled():
            ray = block.one_scale()
            if ray is None:
                found = ", ".join(u.name for u in block.unknowns(label))
                needed = "a free L2 needs one scale for each nonlinearity"
                instead = "a ball around it, {ball: {K: .., W: ..}}, or a slope has one; or give L2 as a matrix"
                said = f"{needed}, and the type of f{label} has {found}; {instead}"
                raise UsageError(Problem(said, key="observer.L2", id="OBS501"))
            scaled.append(ray)
        return tuple(scaled)

    def shifted(self) -> "Multiplier":
        """Multiplier of f - K q, K the member: then M11 >= 0.

        Raises `UsageError`: a block has more unknowns than one scale.
        """
        return Multiplier(tuple(block.shifted() for block in self.scaled_blocks()))


def combine(parts: Iterable[Multiplier]) -> Multiplier:
    """Multiplier of f = (f_1, .., f_k), each with its own argument."""
    return Multiplier(tuple(block for part in parts for block in part.blocks))


def ends(block: Block) -> tuple[Array, ...]:
    """Member of a class, and the multiples k I at which one of its inequalities ends; k is rounded to the inside."""
    found = [block.member]
    if block.nf == block.nq:
        sides = [k for g in block.generators for k in roots(g.M11[0, 0], g.M12[0, 0], g.M22[0, 0])]
        found += [k * identity(block.nq, block.member) for k in sorted(set(sides))]
    return tuple(K for i, K in enumerate(found) if block.contains(K) and not any((K == L).all() for L in found[:i]))


def roots(a: Any, b: Any, c: Any) -> list[Any]:
    """Rationals k with a + 2 b k + c k^2 >= 0, next to its zeros or at them; for c < 0 or a line."""
    if c == 0:
        return [-a / (2 * b)] if b else []
    square = (b / c) ** 2 - a / c
    if c > 0 or square < 0:
        return []
    scale = fmpq(10**24 * square.q)
    radius = isqrt(int((square * scale * scale).p)) / scale
    return [-b / c - radius, -b / c + radius]
