"""Units of an estimation error in which a solver is asked; proofs are in those of the spec.

With x = S x~, w = w0 w~, z = z0 z~ and t = t0 t~, powers of two from the data alone, P = z0^2 t0 S^-1 P~ S^-1,
mu = (z0 / w0)^2 mu~, kappa = z0^2 t0 kappa~ and M = z0^2 M~.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.families.sporadic.clock.bernstein import Clock
from obsdesign.families.sporadic.clock.theorem import ClockTheorem, ErrorSystem
from obsdesign.families.sporadic.clock.tied import Tied
from obsdesign.lmi.equilibrate import factors
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass, replace

TAME = 3.0  # powers of two up to which the units of the spec are kept
FAR = 1e4  # between the units of two entries


@dataclass(frozen=True)
class ErrorUnits:
    """Powers of two: x = units.x times the error of which a solver knows, and so on."""

    x: Float  # (m,)
    w: float
    z: float
    time: float  # s

    @property
    def V(self) -> float:
        """Unit of V."""
        return self.z**2 * self.time

    @property
    def far(self) -> bool:
        """Whether the units of the entries of x are so far apart that no solver knows |x| of the spec."""
        return bool(self.x.max() > FAR * self.x.min())

    @property
    def unity(self) -> Float:
        """I of the spec as a bound on P, in these units; I in these units where those of the spec are far apart."""
        return np.eye(len(self.x)) if self.far else np.diag(self.x**2 / self.V)

    def number(self, name: str) -> float:
        """Unit of mu, of kappa, or of r, which has none beside `unity`."""
        return {"mu": (self.z / self.w) ** 2, "kappa": self.V}.get(name, 1.0)

    def theorem(self, theorem: ClockTheorem) -> ClockTheorem:
        """Theorem, in doubles, in these units."""
        t, x = self.time, self.x
        tied = theorem.tied and Tied(theorem.tied.basis * np.outer(x, x), theorem.tied.across * x[:, None])
        exact = fmpq(*t.as_integer_ratio())
        clock = Clock(tuple(knot / exact for knot in theorem.clock.knots), theorem.clock.degree)
        system, decay = self.system(theorem.system), theorem.decay * t
        return replace(theorem, system=system, clock=clock, T1=theorem.T1 / exact, decay=decay, tied=tied)

    def system(self, s: ErrorSystem) -> ErrorSystem:
        """Error, in doubles, in these units."""
        t, x = self.time, self.x
        inner = x / x[:, None]
        return ErrorSystem(
            F=t * s.F * inner,
            Bx=t * self.w * s.Bx / x[:, None],
            Bfx=t * s.Bfx / x[:, None],
            J=s.J * inner,
            Jn=s.Jn / x[:, None],
            Cp=s.Cp * x / self.z,
            Cq=s.Cq * x,
            Dq=s.Dq * self.w,
            Dqf=s.Dqf,
            kept=s.kept,
        )

    def storage(self, P: Array) -> Array:
        """P of the spec."""
        return np.asarray(P * (self.V / np.outer(self.x, self.x)))

    def multipliers(self, M: Mapping[str, Array]) -> dict[str, Array]:
        """Unknowns of the multiplier of the spec."""
        return {name: self.z**2 * value for name, value in M.items()}


def error_units(s: ErrorSystem, T2: float, *, weighed: bool) -> ErrorUnits:
    """Units that take all entries of an error, in doubles, and T2 nearest to 1, or those of the spec where they fit.

    `weighed`: whether z counts; where it does not, V has the unit that |x|^2 has in the middle.
    """
    shapes = (s.order, s.Bx.shape[1], s.Bfx.shape[1], len(s.Cq), len(s.Cp), s.Jn.shape[1], 1)
    x, w, f, q, z, eta, time = (np.arange(a, b) for a, b in pairwise(np.cumsum([0, *shapes])))
    flow: list[tuple[Array, Array, Array, float]] = [(s.F, x, x, 1.0), (s.Bx, x, w, 1.0), (s.Bfx, x, f, 1.0)]
    still: list[tuple[Array, Array, Array, float]] = [
        *((s.Cq, q, x, 0.0), (s.Dqf, q, f, 0.0), (s.Dq, q, w, 0.0), (s.Cp, z, x, 0.0)),
        *((s.J, x, x, 0.0), (s.Jn, x, eta, 0.0)),
    ]
    columns: list[list[Any]] = [[1 / T2], [0], [0], [1.0]]
    for M, rows, across, rate in (*flow, *still):
        *_, i, j = np.nonzero(M)
        for column, part in zip(columns, (np.abs(M[M != 0]), rows[i], across[j], np.full(len(i), rate)), strict=True):
            column.extend(part)
    sizes, into, out_of, rates = (np.array(column) for column in columns)
    place = np.full(len(sizes), time[0])
    u = factors(sizes, [(into, -1.0), (out_of, 1.0), (place, rates)], time[0] + 1)
    if np.abs(np.log2(u)).max() <= TAME:
        u = np.ones(len(u))
    unit_z = float(max(u[z], default=1.0))
    t = float(u[time][0])
    if not weighed:
        middle = np.round((2 * np.log2(u[x])).mean() - np.log2(t))
        unit_z = float(np.exp2(middle / 2))
    return ErrorUnits(u[x], float(min(u[w], default=1.0)), unit_z, t)
