"""Units of states, outputs and time in which gains are searched, from the data alone; proofs are in those of the spec.

What is missing for feasibility, a search that begins at |A|, and the size |L| are numbers of some units; in units that
are far from what fits the plant they mean nothing, and the smallest gain is one that is small in a single entry.
"""

from itertools import pairwise
from typing import Any

import numpy as np

from obsdesign.dissipation.scaling import Factors, powers
from obsdesign.lmi.equilibrate import factors
from obsdesign.lmi.formula import Array, Values
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, replace

TAME = 6.0  # powers of two up to which the units of a spec are kept: the size of a gain is one in these


@dataclass(frozen=True)
class Units:
    """Powers of two: x = units.x times the state that is searched, and so on."""

    x: Array  # (n,)
    y: Array  # (ny,)
    f: Array  # (nf,), by which its rows are measured; it is not scaled
    w: float
    z: float
    time: float  # s
    left: Array  # |diag(left) L diag(right)| is the size of a gain L that is searched
    right: Array

    @property
    def gamma(self) -> float:
        """Unit of a gain from w to z."""
        return self.z / self.w

    def plant(self, p: Plant[Array]) -> Plant[Array]:
        """Plant in these units, in doubles; D = 0 and Df = 0."""
        rate = (self.time / self.x)[:, None]
        A, B, Bf, C = rate * p.A * self.x, rate * p.B * self.w, rate * p.Bf, p.C * self.x / self.y[:, None]
        return replace(p, A=A, B=B, Bf=Bf, C=C, Cq=p.Cq * self.x, Dq=p.Dq * self.w)

    def inside(self, L: Array, H: Array) -> tuple[Array, Array]:
        """Gains of the spec in these units."""
        rate = self.time * self.y
        return L * rate / self.x[:, None], H * rate / self.y[:, None]

    def outside(self, L: Array, H: Array) -> tuple[Array, Array]:
        """Gains in these units in those of the spec."""
        rate = self.time * self.y
        return L / rate * self.x[:, None], H / rate * self.y[:, None]

    def witness(self, values: Values) -> dict[str, Any]:
        """P1, P2 and the multipliers of the spec; V' has the unit of |z|^2."""
        sizes = {"P1": self.time / np.outer(self.x, self.x), "P2": self.time / np.outer(self.y, self.y)}
        return {name: self.z**2 * sizes.get(name, 1.0) * value for name, value in values.items()}

    @property
    def factors(self) -> Factors:
        """Units of states, outputs, disturbances and time, as a file holds them."""
        return powers({"states": self.x, "outputs": self.y, "disturbances": self.w, "time": self.time})

    def told(self) -> str:
        """Note on them."""
        x, y = (", ".join(f"{unit:.3g}" for unit in part) for part in (self.x, self.y))
        small = "" if (self.left != 1).any() else "a gain is small and "
        return (
            f"gains were searched in units that fit the data: states in {x}, outputs in {y} of those of the spec, time "
            f"in {self.time:.3g} s; {small}propositions 3 to 5 tie a state to its rate in these"
        )

    def size(self, L: Array) -> float:
        """Size of a gain in these units."""
        return float(np.linalg.norm(self.left[:, None] * L * self.right, 2))

    def weighed(self, X: Array, J: Array) -> tuple[Array, Array]:
        """X and J = X'L such that X'^-1 J is diag(left) L diag(right)."""
        return X / (self.left[:, None] * self.left), J / self.left[:, None] * self.right


SPEC = Units(*3 * (np.ones(1),), 1.0, 1.0, 1.0, np.ones(1), np.ones(1))  # those of the spec


def units(plant: Plant[Any], Cp: Array, T2: float, *, bounded: bool) -> Units:
    """Units that take all entries of the plant and T2 nearest to 1, or those of the spec where they are near enough.

    `plant`, `Cp`: in doubles; `bounded`: whether |L| is bounded, in the units of the spec. Units of f, of q and of each
    row of w and z are found with them; f and q keep theirs, and w and z, which are measured by norms, have one each.
    """
    ends = np.cumsum([0, plant.n, len(plant.C), plant.B.shape[1], plant.Bf.shape[1], len(plant.Cq), len(Cp), 1])
    x, y, w, f, q, z, time = (np.arange(a, b) for a, b in pairwise(ends))
    maps = [(plant.A, x, x), (plant.B, x, w), (plant.Bf, x, f), (plant.C, y, x)]
    maps += [(plant.Cq, q, x), (plant.Dqf, q, f), (plant.Dq, q, w), (Cp, z, x)]
    found = [(M[M != 0], *(places[at] for places, at in zip((i, j), np.nonzero(M), strict=True))) for M, i, j in maps]
    sizes, into, out_of = (np.concatenate([*part]) for part in zip(*found, strict=True))
    rates = np.append(np.isin(into, x), True)  # entries per unit of time, and 1 / T2
    sizes, into, out_of = np.append(np.abs(sizes), 1 / T2), np.append(into, 0), np.append(out_of, 0)
    u = factors(sizes, [(into, -1.0), (out_of, 1.0), (np.full(len(sizes), time), rates)], ends[-1])
    if np.abs(np.log2(u)).max() <= TAME:
        return SPEC
    left, right = (u[x], 1 / (u[y] * u[time])) if bounded else (np.ones(len(x)), np.ones(len(y)))
    return Units(u[x], u[y], u[f], min(u[w], default=1.0), max(u[z]), u[time].item(), left, right)
