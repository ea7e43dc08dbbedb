"""Incremental multipliers: what a design may assume of f.

A matrix M is an incremental multiplier of f if, for every pair of arguments,

    [dq; df]' M [dq; df] >= 0,    dq = q1 - q2,  df = f(t, y, q1) - f(t, y, q2).

A template is a convex set of such matrices. An observer family sees the blocks M11, M12, M22, never a type.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from obsdesign.lmi.formula import Array, Inequality, Unknown, Values, block_diagonal, zeros


@dataclass(frozen=True)
class Scaled:
    """The set {lambda M : lambda >= 0} for one block of q and f.

    `member` is a linear map K in the class, df = K dq, that is [I; K]' M [I; K] >= 0. The loop shift
    f -> f - K q takes M to a matrix with M11 >= 0.
    """

    M11: Array  # (nq, nq)
    M12: Array  # (nq, nf)
    M22: Array  # (nf, nf)
    member: Array  # (nf, nq)

    @classmethod
    def of(cls, M: Array, nq: int, member: Array | None = None) -> "Scaled":
        """Set of a whole matrix M, (nq + nf) square; without a member K is zero."""
        nf = len(M) - nq
        K = zeros((nf, nq), [M]) if member is None else member
        return cls(M[:nq, :nq], M[:nq, nq:], M[nq:, nq:], K)

    def shifted(self) -> "Scaled":
        """Set of f - K q: [I 0; K I]' M [I 0; K I]."""
        K = self.member
        M12 = self.M12 + K.mT @ self.M22
        M11 = self.M11 + self.M12 @ K + K.mT @ M12.mT
        return Scaled(M11, M12, self.M22, 0 * K)


@dataclass(frozen=True)
class Multiplier:
    """Blocks side by side: q = (q_1, .., q_k), f = (f_1, .., f_k), each with a scale of its own.

    The combined matrix in the order (q, f) is block diagonal in each of M11, M12, M22. (A block-diagonal M
    itself, in the order (q_1, f_1, q_2, f_2), would tie the wrong components together.)
    """

    blocks: tuple[Scaled, ...]

    @property
    def member(self) -> Array:
        """A linear map (nf, nq) in the class: the class contains df = K dq."""
        return block_diagonal([b.member for b in self.blocks])

    def unknowns(self) -> tuple[Unknown, ...]:
        """One scale for each block."""
        return tuple(Unknown(scale_name(i), (1, 1)) for i in range(len(self.blocks)))

    def matrix(self, v: Values) -> tuple[Array, Array, Array]:
        """M11, M12, M22 for the scales in v."""
        scaled = [(v[scale_name(i)], b) for i, b in enumerate(self.blocks)]
        return (
            block_diagonal([s * b.M11 for s, b in scaled]),
            block_diagonal([s * b.M12 for s, b in scaled]),
            block_diagonal([s * b.M22 for s, b in scaled]),
        )

    def inequalities(self, v: Values) -> tuple[Inequality, ...]:
        """Inequalities that say that no scale is negative."""
        names = [scale_name(i) for i in range(len(self.blocks))]
        return tuple(Inequality(f"{name} >= 0", -v[name]) for name in names)


def scale_name(i: int) -> str:
    """Name of the scale of block i (counted from 1, as a user reads it)."""
    return f"lambda{i + 1}"


def combine(parts: Iterable[Multiplier]) -> Multiplier:
    """Multiplier of f = (f_1, .., f_k), each with its own argument."""
    return Multiplier(tuple(block for part in parts for block in part.blocks))
