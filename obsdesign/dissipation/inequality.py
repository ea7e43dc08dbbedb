"""Observers that are copies of their plant with two corrections, for plants with incremental multipliers.

The observer of the plant (10) of Corless and Chakrabarty (2019) is a copy of it with two correction terms,

    xihat' = A xihat + Bf f(t, y, qhat) + g + L1 (yhat - y)
    qhat   = Cq xihat + Dqf f(t, y, qhat) + gq + L2 (yhat - y)
    yhat   = C xihat + Df f(t, y, qhat) + gy.

With e = xihat - xi, V = e' P e and Y = P L1, the inequality (13) says that along the error equations

    V' + 2 alpha V + z' W z - m |v|^2 <= 0,    z = H e,

and a family says what W, m and P have to be. `discrete.Discrete` reads the same for plants x+ = A x + ..
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Literal, Self

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.guarantee import Quadratic
from obsdesign.dissipation.pace import ALPHA, Pace
from obsdesign.dissipation.shift import free_factor, shifted_plant, square_root, with_usable_scales
from obsdesign.lmi.formula import (
    Array,
    Inequality,
    Injection,
    Problem,
    Unknown,
    Values,
    block_diagonal,
    he,
    identity,
    in_floats,
    product,
    symmetric,
    zeros,
)
from obsdesign.model.edge import Edge
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, replace

ONE = np.ones((1, 1))
EQUATIONS = (
    "xihat' = A xihat + Bf f(t, y, qhat) + gx + L1 (yhat - y), "
    "qhat = Cq xihat + Dqf f(t, y, qhat) + gq + L2 (yhat - y), "
    "yhat = C xihat + Df f(t, y, qhat) + gy, e = xihat - xi, z = H e"
)
POSITIVE = "P > 0"
SMALL = "P <= p I"
LARGE = "P >= t I"


@dataclass(frozen=True)
class Theorem:
    """What is constant of a family, as the tableau is of a Runge-Kutta method."""

    name: str  # of the family in a spec
    guarantee: type[Quadratic]  # what it says of a run
    decrease: str  # the dissipation inequality in words
    gamma: str  # what gamma bounds, in words
    level: str  # when mu1 and mu2 prove gamma, in words
    margin: Callable[[fmpq, fmpq, fmpq], fmpq]  # .. in numbers: what must be >= 0 for gamma, mu1 and mu2
    statement: str  # guarantee in words for {gamma} and {rate}, with the observer written out
    monotone: bool  # whether the least gamma never decreases with the rate
    pace: Pace = ALPHA
    peak: bool = False  # whether (13) is homogeneous in P and mu, and gamma the least with P >= H'H
    at_rest: Literal["", "strict", "weak"] = ""  # how (13) holds for the rate zero, if it may be: strict, e converges
    gain: str = "L1"  # what the injection is called in a spec
    feedback: bool = True  # whether L2 is a gain of the observer; else it is zero


@dataclass(frozen=True)
class Incremental(ABC):
    """One instance of a family's inequalities: fixed rate, and each gain given or (None) to be found.

    Where L2 is found, the unknown is R = lambda L2, block by block; this needs M11 >= 0, which the loop shift
    f -> f - K q provides (`shifted`).
    """

    about: ClassVar[Theorem]

    plant: Plant[Array]
    multiplier: Multiplier
    H: Array  # (nz, n)
    rate: Any  # alpha, 1/s; of samples 1 - rho
    L1: Array | None = None  # (n, ny)
    L2: Array | None = None  # (nq, ny)
    still: bool = False  # whether the rate is taken as zero: what is left of (13) sets the units of the unknowns

    @abstractmethod
    def theorem(self, v: Values) -> tuple[Inequality, ...]:
        """The inequalities of the family for P, Y (or L1), the multiplier, mu1, mu2 (and R where L2 is free)."""

    @abstractmethod
    def weights(self, mu: Array) -> Values:
        """Return mu1 and mu2 as the solver has them, for gamma^2 = mu and P of a size that does not depend on mu.

        The claim has mu1 = 1: its P and multiplier are those of the solver over mu1.
        """

    def storage_bound(self, P: Array, mu: Array, largest: Any) -> Inequality:
        """The P of the claim is at most `largest` I."""
        return Inequality(SMALL, P - largest * self.weights(mu)["mu1"] * self.eye)

    def conditions(self, v: Values, weight: Array, supply: Array) -> list[Inequality]:
        """(13) for the weight of |z|^2 and the supply m, P > 0, and membership of the multiplier."""
        v = {**v, "Y": self.injected(v)}
        rises = self.dissipation(v, weight * product(self.H.mT, self.H), supply)
        strict = self.about.at_rest == "strict" and not self.rate
        return [
            Inequality(self.about.decrease, rises, strict=strict),
            Inequality(POSITIVE, -v["P"], strict=True),
            *self.multiplier.inequalities(v),
        ]

    def injected(self, v: Values) -> Array:
        """Y = P L1, which is an unknown where L1 is."""
        return v["Y"] if self.L1 is None else np.asarray(v["P"] @ self.L1)

    def dissipation(self, v: Values, Q: Array, m: Array) -> Array:
        """V' + 2 alpha V + e' Q e - m |v|^2 in (e, f, v), and in u as well where L2 is free."""
        p, P, Y = self.plant, v["P"], v["Y"]
        none = zeros((p.Bf.shape[1] + p.B.shape[1],) * 2, [P])
        rise = np.concatenate([P @ p.Bf + Y @ p.Df, -(P @ p.B + Y @ p.D)], axis=-1)
        stored = symmetric([[he(product(P, p.A) + Y @ p.C) + (0 if self.still else self.loss) * P, rise], [none]])
        return stored_and_supplied(stored, self.supplied(v, Q, m))

    @property
    def direct(self) -> bool:
        """Whether v is in z beside H e, so that no gain keeps it from z."""
        return False

    @property
    def loss(self) -> Any:
        """Coefficient of V in (13), in which it is affine: 2 alpha."""
        return 2 * self.rate

    def supplied(self, v: Values, Q: Array, m: Array) -> Array:
        """E' Q e - m |v|^2 + [q; f]' M [q; f] in (e, f, v), with q = Ge e + Gf f + Gv v."""
        if self.L2 is None:
            return self.supplied_with_free_L2(v, Q, m)
        p = self.plant
        M11, M12, M22 = self.multiplier.matrix(v)
        Ge, Gf, Gv = (self.argument(v, *pair) for pair in ((p.Cq, p.C), (p.Dqf, p.Df), (-p.Dq, -p.D)))
        return symmetric(
            [
                [Q + Ge.mT @ M11 @ Ge, Ge.mT @ (M11 @ Gf + M12), Ge.mT @ M11 @ Gv],
                [Gf.mT @ M11 @ Gf + he(Gf.mT @ M12) + M22, (Gf.mT @ M11 + M12.mT) @ Gv],
                [Gv.mT @ M11 @ Gv - m * identity(p.B.shape[1], p.B)],
            ]
        )

    def supplied_with_free_L2(self, v: Values, Q: Array, m: Array) -> Array:
        """Same in (e, f, v, u), Remark 3: lambda q = Ge e + Gf f + Gv v, M11 = lambda U U' by a Schur complement."""
        p, P = self.plant, v["P"]
        blocks = self.multiplier.scaled_blocks()
        scale = [v[u.name] for u in self.multiplier.unknowns()]
        M12 = block_diagonal([b.M12 for b in blocks])
        M22 = block_diagonal([s * b.M22 for s, b in zip(scale, blocks, strict=True)])
        U = free_factor(self.multiplier)
        tau = block_diagonal([s * np.eye(square_root(b.M11).shape[1]) for s, b in zip(scale, blocks, strict=True)])
        Ge, Gf, Gv = (self.argument(v, *pair) for pair in ((p.Cq, p.C), (p.Dqf, p.Df), (-p.Dq, -p.D)))
        return symmetric(
            [
                [Q + zeros(P.shape[-2:], [P]), Ge.mT @ M12, 0, Ge.mT @ U],
                [he(Gf.mT @ M12) + M22, M12.mT @ Gv, Gf.mT @ U],
                [-m * identity(p.B.shape[1], p.B), Gv.mT @ U],
                [-tau],
            ]
        )

    def member_supply(self, v: Values) -> Array:
        """[q; f]' M [q; f] in (e, f) of an error without v, for a multiplier of its own."""
        none = zeros((self.plant.n,) * 2, [self.plant.A])
        return replace(self, plant=self.plant.undisturbed).supplied(v, none, none[:1, :1])

    def placed(self, v: Values, bounds: Bounds) -> list[Inequality]:
        """What keeps the poles of every frozen member where the bounds want them, by the same P and Y."""
        return [] if bounds.poles is None else [*bounds.poles.inequalities(self, {**v, "Y": self.injected(v)})]

    def argument(self, v: Values, direct: Array, output: Array) -> Array:
        """How a signal reaches q: direct + L2 output; where L2 is free, lambda times that."""
        if self.L2 is not None:
            return np.asarray(direct + self.L2 @ output)
        blocks = zip(self.multiplier.unknowns(), self.multiplier.scaled_blocks(), strict=True)
        scales = block_diagonal([v[unknown.name] * np.eye(len(block.M11)) for unknown, block in blocks])
        return np.asarray(scales @ direct + v["R"] @ output)

    @property
    def edge(self) -> Edge:
        """What the rate asks of the modes of the error."""
        sampled = self.about.pace.sampled
        return Edge(self.rate, sampled, sampled and self.about.at_rest != "strict")

    def slowest_pole(self) -> complex:
        """Slowest pole of the error for given gains and f = K q, K the member of the class; in doubles.

        A + L1 C + (Bf + L1 Df) F with f~ = F e = (I - K D)^-1 K (Cq + L2 C) e, D = Dqf + L2 Df.
        """
        p, K = self.plant, self.multiplier.member
        assert self.L1 is not None
        assert self.L2 is not None
        F = np.linalg.solve(np.eye(len(K)) - K @ (p.Dqf + self.L2 @ p.Df), K @ (p.Cq + self.L2 @ p.C))
        poles = np.linalg.eigvals(p.A + self.L1 @ p.C + (p.Bf + self.L1 @ p.Df) @ F)
        return complex(min(poles, key=self.edge.of))

    def least_gamma(self, bounds: Bounds = NO_BOUNDS) -> Problem:
        """Minimise mu = gamma^2; P >= 0 is closed by the solver, so that the optimum is the infimum.

        With bounds, also P <= p I, and `within`: where these say more of Y, it is not projected out.
        """

        def bounded(v: Values) -> list[Inequality]:
            largest = [] if bounds.P is None else [self.storage_bound(v["P"], v["mu"], float(bounds.P))]
            # without a disturbance nothing else bounds mu
            undisturbed = [] if self.plant.B.shape[1] else [Inequality("mu >= 1", ONE - v["mu"])]
            return [*largest, *undisturbed, *self.within(v, bounds)]

        unknowns = [Unknown("mu", (1, 1)), *self.gain_unknowns(bounds)]
        injection = self.injection if bounds.L1 is None and bounds.poles is None else None
        return self.problem(unknowns, self.weighted, bounded, minimise="mu", injection=injection)

    def feasible(self) -> Problem:
        """The theorem for some gamma."""
        return self.problem([Unknown("mu", (1, 1))], self.weighted, injection=self.injection)

    def witness(self, gamma: float | None, bounds: Bounds = NO_BOUNDS) -> Problem:
        """The theorem for a gamma, or for some gamma, with nothing projected out; and the bounds on P and the poles."""
        further = self.placing(bounds)
        if gamma is None:
            free = [Unknown("mu", (1, 1)), *further]
            return self.problem(free, self.weighted, lambda v: self.placed(v, bounds))
        mu = gamma**2 * ONE

        def bounded(v: Values) -> list[Inequality]:
            rows = [] if bounds.P is None else [self.storage_bound(v["P"], mu, float(bounds.P))]
            if bounds.floor is not None:
                rows.append(Inequality(LARGE, float(bounds.floor) * self.weights(mu)["mu1"] * self.eye - v["P"]))
            return [*rows, *self.placed(v, bounds)]

        return self.problem(further, lambda v: {**v, **self.weights(mu)}, bounded)

    def weighted(self, v: Values) -> Values:
        """Complete unknowns by mu1 and mu2."""
        return {**v, **self.weights(v["mu"])}

    def problem(
        self,
        unknowns: Sequence[Unknown],
        complete: Callable[[Values], Values],
        bounded: Callable[[Values], Sequence[Inequality]] = lambda _: (),
        minimise: str | None = None,
        injection: Injection | None = None,
    ) -> Problem:
        """The theorem, with what `complete` derives from the unknowns and with further inequalities."""
        p = self.plant
        gains = [] if self.L1 is not None else [Unknown("Y", p.C.mT.shape)]
        gains += [] if self.L2 is not None else [Unknown("R", (p.Cq.shape[0], p.C.shape[0]))]
        still = replace(self, still=True)
        problem = Problem(
            (Unknown("P", p.A.shape, symmetric=True), *gains, *self.auxiliary, *unknowns),
            lambda v: (*self.theorem(complete(v)), *bounded(v)),
            (lambda v: v[minimise]) if minimise else None,
            injection,
            lambda v: (*still.theorem(complete(v)), *bounded(v)),
        )
        return problem if self.L2 is not None else with_usable_scales(problem, self.multiplier)

    @property
    def auxiliary(self) -> tuple[Unknown, ...]:
        """Unknowns besides P and the gains: what determines the multiplier."""
        return self.multiplier.unknowns()

    @property
    def place_of_v(self) -> tuple[int, int]:
        """Which of the inequalities has rows of v, and the first of these."""
        return 0, self.plant.n + self.plant.Bf.shape[1]

    def within(self, v: Values, bounds: Bounds) -> list[Inequality]:
        """P >= floor I, `placed`; and for |L1| <= kappa, t I <= P and [P, Y; Y', W] >= 0 with s = kappa^2 t.

        Then t L1'L1 <= L1'P L1 <= W, with W = s I or, for the Frobenius norm, tr W <= s. What is necessary for it is
        the same with P <= t I: L1'P L1 <= t L1'L1.
        """
        rows = [] if bounds.floor is None else [Inequality(LARGE, float(bounds.floor) * self.eye - v["P"])]
        rows += self.placed(v, bounds)
        if bounds.L1 is None:
            return rows
        gap = v["t"] * self.eye - v["P"]
        rows.append(Inequality(SMALL, -gap) if bounds.necessary else Inequality(LARGE, gap))
        square = float(bounds.L1) ** 2 * v["t"]
        if bounds.norm == "spectral":
            W = square * np.eye(self.plant.C.shape[0])
            return [*rows, Inequality("[P, Y; Y', s I] >= 0", -symmetric([[v["P"], v["Y"]], [W]]))]
        trace = np.trace(v["W"], axis1=-2, axis2=-1)[..., None, None]
        return [
            *rows,
            Inequality("[P, Y; Y', W] >= 0", -symmetric([[v["P"], v["Y"]], [v["W"]]])),
            Inequality("tr W <= s", trace - square),
        ]

    def gain_unknowns(self, bounds: Bounds) -> list[Unknown]:
        """Unknowns t and W of a bound on L1, and those of `placed`."""
        ny = self.plant.C.shape[0]
        found = [Unknown("t", (1, 1)), Unknown("W", (ny, ny), symmetric=True)]
        sizes = [] if bounds.L1 is None else found if bounds.norm == "frobenius" else found[:1]
        return [*sizes, *self.placing(bounds)]

    def placing(self, bounds: Bounds) -> tuple[Unknown, ...]:
        """Unknowns of `placed`."""
        return () if bounds.poles is None else bounds.poles.unknowns(self.multiplier)

    @property
    def eye(self) -> Array:
        """Identity of the order of P."""
        return np.eye(self.plant.n)

    @property
    def injection(self) -> Injection | None:
        """Y enters (13) as He([I; 0] Y [C Df -D]), where it is unknown."""
        output = self.residual
        return None if self.L1 is not None else Injection("Y", np.eye(output.shape[1], self.plant.n), output)

    @property
    def residual(self) -> Array:
        """[C Df -D], and nothing of u."""
        p = self.plant
        extra = 0 if self.L2 is not None else free_factor(self.multiplier).shape[1]
        return np.hstack([p.C, p.Df, -p.D, np.zeros((p.C.shape[0], extra))])

    def shifted(self) -> Self:
        """Same problem in doubles for f - K q, K the member of the class: then M11 >= 0, exactly zero where it is.

        With W = (I - K Dqf)^-1, f = (I - K Dqf)^-1 (K Cq x + f~ + K Dq w).
        """
        p, K = in_floats(self.plant), in_floats(self.multiplier.member)
        return replace(in_floats(replace(self, multiplier=self.multiplier.shifted())), plant=shifted_plant(p, K))


def stored_and_supplied(stored: Array, supplied: Array) -> Array:
    """Sum of a change of V in (e, f, v) and of what is supplied in these and further rows."""
    further = supplied.shape[-1] - stored.shape[-1]
    return np.asarray(supplied + symmetric([[stored, 0], [zeros((further, further), [stored])]]))
