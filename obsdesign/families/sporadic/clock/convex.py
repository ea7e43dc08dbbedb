"""Gains by convex problems: a predictor, and a reset, by storage functions for which they become unknowns.

Predictor, H = -C L: with P = diag(P1, P2(tau)), P1 constant, and J1 = P1 L, the product P F of (F) is affine,

    P F = [P1 A - J1 C, J1; P2 C A, 0],

and (J) holds whatever T1 is. Reset: V = e' P(s) e of the time s since the last measurement, with +P' in (F), and

    [P(s), 0, P(0) - C'Y'; ., kappa I, -Y'; ., ., P(0)] >= 0 for s in [T1, T2], without the middle row (no noise),

Y = P(0) K, which is P(s) >= (I - K C)' P(0) (I - K C). These are for the design only: what is shipped is proved by the
storage functions of the time left. The least mu is not attained without a bound on the gain as a rule:
t D^2 <= P1 and [P1, J1; J1', t E^-2] >= 0 with diagonal D and E bound |D L E| by 1, and so they do K with P(0) and Y.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np

from obsdesign.families.sporadic.clock.analysis import ONE, Analysis, Found
from obsdesign.families.sporadic.clock.theorem import ClockTheorem, listed
from obsdesign.lmi.formula import (
    Array,
    Float,
    Inequality,
    Problem,
    Unknown,
    Values,
    block_diagonal,
    symmetric,
)
from obsdesign.records import dataclass

LEAST = 1e-9  # of P, relative to its scale, by which a solution is kept away from singular ones


@dataclass(frozen=True)
class Convex(ABC):
    """A convex problem for the gain of a theorem in doubles, whose system has no gain in it yet."""

    theorem: ClockTheorem
    C: Float  # (ny, n)
    left: Float  # (n,)
    right: Float  # (ny,); the spectral norm of diag(left) gain diag(right) is at most 1

    @property
    def n(self) -> int:
        """Order of the plant."""
        return int(self.C.shape[1])

    @property
    @abstractmethod
    def unknowns(self) -> tuple[Unknown, ...]:
        """What is searched, mu excepted."""

    @abstractmethod
    def inequalities(self, v: Values) -> Iterator[Inequality]:
        """The conditions, for the weight of |z|^2 and mu in v."""

    @abstractmethod
    def gain(self, v: Values) -> Float:
        """L or K of a solution."""

    def least(self, analysis: Analysis) -> tuple[float, Float | None]:
        """Least gamma and the gain; infinite and None where nothing is found."""
        problem = Problem(
            (*self.unknowns, *self.theorem.scales, Unknown("t", (1, 1)), Unknown("mu", (1, 1))),
            lambda v: [*self.inequalities({**v, "weight": ONE})],
            lambda v: v["mu"],
        )
        found: Found = analysis.solved(problem)
        if found.values is None:
            return math.inf, None
        return math.sqrt(max(found.objective, 0.0)), self.gain(found.values)

    def bound(self, P: Array, Y: Array, t: Array) -> Iterator[Inequality]:
        """|diag(left) P^-1 Y diag(right)| <= 1, for t diag(left)^2 <= P."""
        yield Inequality("t diag(left)^2 <= P", t * np.diag(self.left**2) - P)
        yield Inequality("the gain is bounded", -symmetric([[P, Y], [t * np.diag(self.right**-2.0)]]))

    def flow(self, P: Array, PF: Array, slope: Array, v: Values) -> Iterator[Inequality]:
        """(F) and the cone of the multiplier, at all control values."""
        M = self.theorem.multipliers(v)
        deep = {name: v[name][..., None, None, :, :] for name in ("weight", "mu")}
        yield from listed("(F)", self.theorem.flow(P, PF, slope, {**M, **deep}))
        for cone in self.theorem.multiplier.inequalities(M):
            yield from listed(cone.name, cone.matrix)


class Predictor(Convex):
    """L of H = -C L."""

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """P1, J1 and the control values of P2."""
        n, ny = self.n, len(self.C)
        P2 = (Unknown(f"P2_{j}", (ny, ny), symmetric=True) for j in range(self.theorem.clock.count))
        return Unknown("P1", (n, n), symmetric=True), Unknown("J", (n, ny)), *P2

    def inequalities(self, v: Values) -> Iterator[Inequality]:
        """(F), P2(0) >= 0 and the bound."""
        theorem, A, clock = self.theorem, self.theorem.system.F[: self.n, : self.n], self.theorem.clock
        P2 = theorem.stacked([v[f"P2_{j}"] for j in range(clock.count)], clock.count)
        P1, J = (v[name][..., None, None, :, :] for name in ("P1", "J"))
        on = clock.on(P2)
        P = block_diagonal([broadcast(P1, on), on])
        slope = block_diagonal([0 * broadcast(P1, on), clock.slope(P2)])
        upper = np.concatenate([broadcast(P1 @ A - J @ self.C, on), broadcast(J, on)], axis=-1)
        lower = np.concatenate([on @ (self.C @ A), 0 * on], axis=-1)
        yield from self.flow(P, np.concatenate([upper, lower], axis=-2), slope, v)
        yield Inequality("P2(0) >= 0", -v["P2_0"])
        yield from self.bound(v["P1"], v["J"], v["t"])

    def gain(self, v: Values) -> Float:
        """L = P1^-1 J."""
        return np.asarray(np.linalg.solve(v["P1"], v["J"]))


class Reset(Convex):
    """K of xhat+ = xhat + K (y - C xhat)."""

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Control values of P, and Y."""
        P = (Unknown(f"P{j}", (self.n, self.n), symmetric=True) for j in range(self.theorem.clock.count))
        return *P, Unknown("Y", (self.n, len(self.C)))

    def inequalities(self, v: Values) -> Iterator[Inequality]:
        """(F) with the time elapsed, the jump and the bound."""
        theorem, clock = self.theorem, self.theorem.clock
        P = theorem.stacked([v[f"P{j}"] for j in range(clock.count)], clock.count)
        on = clock.on(P)
        yield from self.flow(on, on @ theorem.system.F, -clock.slope(P), v)
        after = v["P0"][..., None, None, :, :]
        left = after - self.C.T @ self.corrections(v).mT
        late = P[..., clock.within(theorem.T1, clock.knots[-1]), :, :]
        yield from listed("jump", -symmetric([[late, broadcast(left, late)], [broadcast(after, late)]]))
        yield from self.bounds(v)

    def corrections(self, v: Values) -> Array:
        """Y for every control value of P."""
        return np.asarray(v["Y"][..., None, None, :, :])

    def bounds(self, v: Values) -> Iterator[Inequality]:
        """The bound."""
        yield from self.bound(v["P0"], v["Y"], v["t"])

    def gain(self, v: Values) -> Float:
        """K = P(0)^-1 Y."""
        return np.asarray(np.linalg.solve(v["P0"], v["Y"]))


class GapReset(Reset):
    """Control values of a K that depends on the interval that has just ended, K(s) = P(0)^-1 Y(s)."""

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Control values of P, and those of Y in [T1, T2]."""
        P = (Unknown(f"P{j}", (self.n, self.n), symmetric=True) for j in range(self.theorem.clock.count))
        return *P, *(Unknown(name, (self.n, len(self.C))) for name in self.names)

    @property
    def names(self) -> list[str]:
        """Names of the control values of Y."""
        return [f"Y{j}" for j in self.theorem.clock.within(self.theorem.T1, self.theorem.clock.knots[-1])]

    def corrections(self, v: Values) -> Array:
        """Y for the control values of P in [T1, T2], (.., 1, k, n, ny)."""
        return self.theorem.stacked([v[name] for name in self.names], len(self.names))

    def bounds(self, v: Values) -> Iterator[Inequality]:
        """The bound for every control value."""
        for name in self.names:
            yield from self.bound(v["P0"], v[name], v["t"])

    def gain(self, v: Values) -> Float:
        """Control values, segment by segment, (N, d + 1, n, ny)."""
        K, d = np.stack([np.linalg.solve(v["P0"], v[name]) for name in self.names]), self.theorem.clock.degree
        return np.stack([K[a : a + d + 1] for a in range(0, len(K) - 1, d)])

    @property
    def knots(self) -> Float:
        """Ends of the segments of K, s."""
        return np.array([float(s) for s in self.theorem.clock.knots if s >= self.theorem.T1])


def broadcast(matrix: Array, like: Array) -> Array:
    """Matrix (.., 1, 1, k, l) for every matrix of a stack."""
    lead = np.broadcast_shapes(matrix.shape[:-2], like.shape[:-2])
    return np.broadcast_to(matrix, (*lead, *matrix.shape[-2:]))
