"""Regions of the s-plane that hold every pole of the error with a constant slope, f = K q, K any member of the class.

A member has f~ = K q~ along e' = A_K e, so that with a multiplier M of the class, which has unknowns of its own for
each region, [q~; f~]' M [q~; f~] >= 0: by the S-procedure an inequality in (e, f~) holds for every member, those with
slopes of several blocks at once included. With W = [P A + Y C, P Bf + Y Df; 0, 0], Y = P L1, of which X are the rows
that are not zero, P e' = X (e, f~), S what M supplies, and P short for [P, 0; 0, 0], these are

    disc    |s + c| <= r        [(c He(W) + (c^2 - r^2) P) / r + S, X'; X, -r P] <= 0
    cone    |Im s| <= k |Re s|  [k He(W) + S, T; T', k He(W) + S] <= 0,    T = W' - W + G,    Re s <= 0

The disc is (A_K + c I)'P (A_K + c I) <= r^2 P by the complement of Schur on -r P, an equivalence for P > 0. The cone is
e* (k (A_K'P + P A_K) + i (A_K'P - P A_K)) e <= 0 for complex e, in its real and its imaginary part: at an eigenvector
k Re s + Im s <= 0, and at its conjugate k Re s - Im s <= 0. Both parts have the multiplier M. Where q and f of a block
are numbers, q~* f~ = K |q~|^2 is real, so that i g (q~* f~ - f~* q~) is zero for any number g: its matrix is G.

A damping ratio d = -Re s / |s| of at least cos(phi) is the cone with k = tan(phi) = sqrt(1 / d^2 - 1); k is a rational
below that, so that the cone is within it.

Euler's method multiplies by 1 + h s in each step of h: the disc c = r = 1 / h, which is strict here. Its inequality is
V+ < V of steps e+ = e + h e', and f~ is the difference of f at any two arguments in it: two runs of the observer in
such steps, on the same y and u, come nearer to each other in V whatever f of the class is, and not for constant K only.

Runge-Kutta 4 multiplies by R(z) = 1 + z + z^2 / 2 + z^3 / 6 + z^4 / 24, z = h s. On the imaginary axis |R|^2 is
1 - y^6 / 72 + y^8 / 576, at most 1 for y^2 <= 8. On the arc |z| = r it is a polynomial of degree 4 in x = Re z / r,
which touches 1 within -1 <= x <= 0 at r = 2.615587.., x = -0.5409.., and stays below it at r = `RK4`. So |R| < 1 for
Re z < 0, |z| <= `RK4`, by the maximum principle, and what is asked of the poles, all of which the dissipation
inequality keeps left of the axis, is |s| <= `RK4` / h: the largest half disc but for 4e-5 of its radius.
"""

from collections.abc import Iterator
from math import isqrt
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array, Inequality, Unknown, Values, he, in_floats, symmetric, zeros
from obsdesign.model.multiplier import Multiplier
from obsdesign.records import dataclass

if TYPE_CHECKING:
    from obsdesign.dissipation.inequality import Incremental

RK4 = fmpq(26155, 10000)
SEEN = 1e-9  # relative, by which a pole is seen to be outside
FINE = 10**18  # parts of a slope k to which it is rounded down
TINY = 1e-300  # what stands for the size of a pole at zero
NAMES = {"euler": "Euler's method", "rk4": "Runge-Kutta 4"}


@dataclass(frozen=True)
class Disc:
    """|s + center| <= radius."""

    label: str  # of its multiplier in a witness
    name: str  # of its inequality
    center: Any
    radius: Any
    strict: bool = False
    skew: ClassVar[bool] = False  # whether G has a part in it

    def beyond(self, poles: Array) -> Array:
        """How far poles are outside, relative to the radius."""
        return np.asarray(np.abs(poles + self.center) / self.radius - 1)

    def form(self, P: Array, W: Array, S: Array, _: Array) -> Array:
        """Matrix that is not positive; W and S are (n + nf) square."""
        c, r, n = self.center, self.radius, P.shape[-1]
        stored = symmetric([[(c * c - r * r) / r * P, 0], [0 * W[..., n:, n:]]])
        return symmetric([[stored + c / r * he(W) + S, W[..., :n, :].mT], [-r * P]])


@dataclass(frozen=True)
class Cone:
    """|Im s| <= slope |Re s|, Re s <= 0."""

    label: str
    name: str
    slope: Any
    strict: ClassVar[bool] = False
    skew: ClassVar[bool] = True

    def beyond(self, poles: Array) -> Array:
        """How far poles are outside, relative to their size."""
        return np.asarray((np.abs(poles.imag) + self.slope * poles.real) / np.maximum(np.abs(poles), TINY))

    def form(self, _: Array, W: Array, S: Array, G: Array) -> Array:
        """Matrix that is not positive; W, S and G are (n + nf) square."""
        part = self.slope * he(W) + S
        return symmetric([[part, W.mT - W + G], [part]])


@dataclass(frozen=True)
class Region:
    """What is asked of the poles of every frozen member; None: nothing."""

    radius: fmpq | None = None  # 1/s
    damping: fmpq | None = None  # in (0, 1)
    period: fmpq | None = None  # s, of the steps in which every member is to be stable
    method: Literal["euler", "rk4"] = "rk4"  # of these

    @property
    def parts(self) -> tuple[Disc | Cone, ...]:
        """Its discs and its cone, in rationals."""
        found: list[Disc | Cone] = []
        if self.radius is not None:
            found.append(Disc("radius", "A_K' P A_K <= radius^2 P", 0, self.radius))
        if self.damping is not None:
            found.append(Cone("damping", "|Im s| <= sqrt(1 / damping^2 - 1) |Re s|", slope_below(self.damping)))
        if self.period is not None and self.method == "euler":
            found.append(Disc("step", "(I + h A_K)' P (I + h A_K) < P", 1 / self.period, 1 / self.period, strict=True))
        elif self.period is not None:
            found.append(Disc("step", f"A_K' P A_K <= ({float(RK4):g} / h)^2 P", 0, RK4 / self.period))
        return tuple(found)

    @property
    def strict(self) -> bool:
        """Whether a design at its edge is outside."""
        return any(part.strict for part in self.parts)

    def outside(self, poles: Array) -> Array:
        """Those of some poles, in doubles, that are not in it, as far as rounding allows."""
        out = np.zeros(poles.shape, dtype=bool)
        for part in in_floats(self.parts):
            out |= part.beyond(poles) > SEEN
        return np.asarray(poles[out])

    def words(self) -> list[str]:
        """What is asked, one phrase for each."""
        said = [] if self.radius is None else [f"|s| <= {float(self.radius):g} 1/s"]
        said += [] if self.damping is None else [f"damping >= {float(self.damping):g}"]
        steps = f"stable steps of {float(self.period or 0):g} s by {NAMES[self.method]}"
        return said + ([] if self.period is None else [steps])

    def unknowns(self, multiplier: Multiplier) -> tuple[Unknown, ...]:
        """Those of a multiplier for each part, and the sizes g of G."""
        found = []
        for part in self.parts:
            found += [Unknown(f"{part.label}_{u.name}", u.shape, u.symmetric) for u in multiplier.unknowns()]
            found += [Unknown(name, (1, 1)) for name in skews(part, multiplier).values()]
        return tuple(found)

    def inequalities(self, family: "Incremental", v: Values) -> Iterator[Inequality]:
        """Every part, and membership of its multiplier, for P, Y and the unknowns of both; L2 is given."""
        p, P, Y = family.plant, v["P"], v["Y"]
        X = np.concatenate([P @ p.A + Y @ p.C, P @ p.Bf + Y @ p.Df], axis=-1)
        W = np.concatenate([X, zeros((*X.shape[:-2], p.Bf.shape[1], X.shape[-1]), [X])], axis=-2)
        for part in self.parts if P.dtype == object else in_floats(self.parts):
            own = {u.name: v[f"{part.label}_{u.name}"] for u in family.multiplier.unknowns()}
            form = part.form(P, W, family.member_supply(own), skewed(family, part, v))
            yield Inequality(part.name, form, part.strict)
            for one in family.multiplier.inequalities(own):
                yield Inequality(f"{part.label}: {one.name}", one.matrix, one.strict)

    def written(self) -> dict[str, Any]:
        """Entries of a guarantee."""
        of_poles = {"radius": self.radius, "damping": self.damping}
        poles = {name: float(value) for name, value in of_poles.items() if value is not None}
        found: dict[str, Any] = {"poles": poles} if poles else {}
        if self.period is not None:
            found["implementation"] = {"period": float(self.period), "method": self.method}
        return found

    def statements(self, members: str) -> list[str]:
        """What is proved of the frozen members, which are described in words."""
        said = [] if self.radius is None else [f"|s| <= {float(self.radius)!r} 1/s"]
        said += [] if self.damping is None else [f"-Re s >= {float(self.damping)!r} |s|"]
        found = [f"every pole s of the error with {members} has {' and '.join(said)}"] if said else []
        if self.period is None:
            return found
        steps = f"in steps of h = {float(self.period)!r} s by {NAMES[self.method]}"
        if self.method == "rk4":
            stable = f"|s| <= {float(RK4):g} / h and Re s < 0, where |R(h s)| < 1"
            return [*found, f"{steps} the error with {members} decays: {stable}; of other f nothing is said in steps"]
        return [
            *found,
            f"{steps} two runs of the observer on the same y and u come nearer to each other in V in each step, for "
            f"every f of the class, and |1 + h s| < 1 for every pole s of the error with {members}",
        ]


def slope_below(damping: fmpq) -> fmpq:
    """Rational just below sqrt(1 / damping^2 - 1), for 0 < damping < 1."""
    square = (1 / (damping * damping) - 1) * FINE * FINE
    return fmpq(isqrt(int(square.p // square.q)), FINE)


def skews(part: Disc | Cone, multiplier: Multiplier) -> dict[tuple[int, int], str]:
    """Name of g of each block whose q and f are numbers, by the places of these."""
    found, q, f = {}, 0, 0
    for label, block in multiplier.labelled():
        if part.skew and block.nq == block.nf == 1:
            found[q, f] = f"{part.label}_g{label}"
        q, f = q + block.nq, f + block.nf
    return found


def skewed(family: "Incremental", part: Disc | Cone, v: Values) -> Array:
    """G = [Ge Gf]' g [0 I] - [0 I]' g' [Ge Gf], q~ = Ge e + Gf f~."""
    p = family.plant
    argument = np.hstack([family.argument(v, p.Cq, p.C), family.argument(v, p.Dqf, p.Df)])
    lead, total = v["P"].shape[:-2], zeros((argument.shape[1],) * 2, [v["P"]])
    for (q, f), name in skews(part, family.multiplier).items():
        unit = zeros((1, argument.shape[1]), [argument])
        unit[0, p.n + f] = unit[0, p.n + f] + 1
        across = argument[q : q + 1].mT @ unit
        total = total + v[name] * (across - across.mT)
    return np.broadcast_to(total, (*lead, *total.shape[-2:]))
