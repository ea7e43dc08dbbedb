"""How L and H become unknowns of linear matrix inequalities, or are eliminated: Proposition 2 and Theorem 2.

Each relaxation states (28) at s = exp(delta tau), s = 1 and s = r, for a fixed delta. Proposition 2 loses nothing:
(P1, P2, L, H) and (P1, P2, J, Y) correspond one to one. And J and Y exist iff the two inequalities hold where theta = 0
(`Sporadic.without_gains`), so that `Reduced` is the limit of all observers (4), with half of the unknowns.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from obsdesign.families.sporadic.theorem import Sporadic
from obsdesign.families.sporadic.units import SPEC
from obsdesign.lmi.formula import Array, Formula, Inequality, Problem, Unknown, Values, he, symmetric
from obsdesign.lmi.probe import Program
from obsdesign.lmi.reduce import balance
from obsdesign.records import dataclass, replace

ONE = np.ones((1, 1))
Gains = tuple[Array, Array]  # L (n, ny), H (ny, ny)


@dataclass(frozen=True)
class Bound:
    """A convex bound on |L|, with the unknowns that it needs; or none."""

    inequalities: Callable[[Values], list[Inequality]] = lambda _: []
    unknowns: tuple[Unknown, ...] = ()


UNBOUNDED = Bound()


@dataclass(frozen=True)
class Relaxation(ABC):
    """Inequalities that imply (28), affine in their unknowns; in doubles."""

    delta_above_decay: ClassVar[bool] = False  # whether delta > 2 lambda_t is necessary

    family: Sporadic

    @abstractmethod
    def flow(self, v: Values, s: float) -> Array:
        """What must be negative at s = 1 and at s = r."""

    @property
    def further(self) -> tuple[Unknown, ...]:
        """Unknowns besides P1, P2 and the multiplier; without gains in it, none."""
        return ()

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """P1, P2, the multiplier, and the further ones."""
        ny, n = self.family.plant.C.shape
        storage = Unknown("P1", (n, n), symmetric=True), Unknown("P2", (ny, ny), symmetric=True)
        return (*storage, *self.family.multiplier.unknowns(), *self.further)

    @property
    def scalars(self) -> int:
        """Number of scalar unknowns, as Table I counts them."""
        return sum(u.size for u in self.unknowns)

    def inequalities(self, v: Values) -> list[Inequality]:
        """The inequalities for the weight of |z|^2 and the supply mu |w|^2."""
        return [*self.family.flows(lambda s: self.flow(v, s)), *self.family.positive(v)]

    # Problems

    @property
    def data(self) -> Formula | None:
        """What sets the units of f and of the multipliers, where there are units: all but |z|^2, which may be tiny."""
        if self.family.units is SPEC:
            return None
        return lambda v: self.inequalities({"mu": ONE, **v, "weight": 0 * ONE})

    def least_gamma(self, bound: Bound = UNBOUNDED) -> Problem:
        """Minimise gamma^2, for a bound on |L| if that is given; P1, P2 >= 0 are closed by the solver."""
        scale = self.family.units.gamma**2

        def inequalities(v: Values) -> list[Inequality]:
            least = [] if self.family.plant.B.shape[1] else [Inequality("mu >= 0", -v["mu"])]
            return [*self.inequalities({**v, "weight": ONE}), *least, *bound.inequalities(v)]

        unknowns = *self.unknowns, *bound.unknowns, Unknown("mu", (1, 1))
        return Problem(unknowns, inequalities, lambda v: scale * v["mu"], data=self.data)

    def elastic(self, bound: Bound = UNBOUNDED) -> Problem:
        """Minimise what is missing for the inequalities without w and z (Corollary 1): feasible iff it is negative.

        P1 and P2 have a trace of the order of 1 together, in the units in which they are of the same size.
        """
        root, n = np.sqrt(self.family.ratio), self.family.plant.n
        undisturbed = replace(self, family=replace(self.family, plant=self.family.plant.undisturbed))

        def inequalities(v: Values) -> list[Inequality]:
            v = {**v, "weight": 0 * ONE, "mu": 0 * ONE}
            last, first, *rest = undisturbed.inequalities(v)
            order, f = last.matrix.shape[-1], np.ones(self.family.plant.Bf.shape[1])
            eye = np.diag(np.append(np.ones(order - len(f)), f / self.family.units.f**2))
            relaxed = [Inequality(flow.name, flow.matrix - v["missing"] * eye) for flow in (last, first)]
            size = trace(v["P1"]) + root * trace(v["P2"])
            sizes = Inequality("size >= n", n * ONE - size), Inequality("size <= 2 n", size - 2 * n * ONE)
            return [*relaxed, *rest, *sizes, *bound.inequalities(v)]

        unknowns = *self.unknowns, *bound.unknowns, Unknown("missing", (1, 1))
        return Problem(unknowns, inequalities, lambda v: v["missing"], data=undisturbed.data)

    def scaled(self, problem: Problem, program: Program) -> tuple[Program, Array]:  # noqa: ARG002
        """Rows and coordinates of one of the problems in units in which a solver gets far; z = T scaled z."""
        return balance(program)

    def witness(self, gamma: float) -> Problem:
        """The inequalities for a gamma."""
        mu = (gamma / self.family.units.gamma) ** 2 * ONE
        return Problem(self.unknowns, lambda v: self.inequalities({**v, "weight": ONE, "mu": mu}), data=self.data)


class WithGains(Relaxation):
    """A relaxation whose solutions hold the gains, as L and as J = X'L."""

    injection: ClassVar[str] = "dynamic"

    @abstractmethod
    def gains(self, values: Values) -> Gains:
        """L and H of a solution."""

    @abstractmethod
    def factor(self, v: Values) -> Array:
        """X with X'L = J."""

    def bound(self, kappa: float, center: Array | None = None) -> Bound:
        """[S, J; J', kappa^2 I] >= 0 with S <= X'X and J = X'L, which implies L'L <= J'S^-1 J <= kappa^2 I.

        X'X >= X'Z + Z'X - Z'Z for any center Z, with equality for Z = X. Without a center, Z = t W, I in the units in
        which L is measured: the matrix is divided by t, and t is an unknown, so small that X is regular.
        """
        square = kappa**2 * np.eye(len(self.family.plant.C))
        W = np.eye(self.family.plant.n) / self.family.units.left**2

        def inequalities(v: Values) -> list[Inequality]:
            X, J = self.family.units.weighed(self.factor(v), v["J"])
            if center is None:
                S, right = he(W @ X) - v["t"] * W @ W, v["t"] * square
            else:
                S, right = he(center.T @ X) - center.T @ center, square
            return [Inequality("|L| <= kappa", -symmetric([[S, J], [right]]))]

        return Bound(inequalities, (Unknown("t", (1, 1)),) if center is None else ())


def trace(X: Array) -> Array:
    """Trace as a 1x1 matrix."""
    return np.asarray(np.trace(X, axis1=-2, axis2=-1)[..., None, None])


class Reduced(Relaxation):
    """Proposition 2 without J and Y: the limit of all L and H."""

    def flow(self, v: Values, s: float) -> Array:
        """M with theta = 0."""
        return self.family.without_gains(v, s)


class Proposition2(WithGains):
    """(34), with J = P1 L and Y' = P2 (C L + H)."""

    @property
    def further(self) -> tuple[Unknown, ...]:
        """J and Y."""
        ny, n = self.family.plant.C.shape
        return Unknown("J", (n, ny)), Unknown("Y", (ny, ny))

    def flow(self, v: Values, s: float) -> Array:
        """M of (30)."""
        return self.family.dissipation(v, s)

    def gains(self, values: Values) -> Gains:
        """L = P1^-1 J, H = P2^-1 Y' - C L."""
        L = np.linalg.solve(values["P1"], values["J"])
        return L, np.linalg.solve(values["P2"], values["Y"].T) - self.family.plant.C @ L

    def factor(self, v: Values) -> Array:
        """P1."""
        return v["P1"]


class Predictor(Proposition2):
    """Proposition 2 with Y = 0, that is H = -C L: theta + C xhat, the predicted output, is held (Remark 5)."""

    injection = "predictor"

    @property
    def further(self) -> tuple[Unknown, ...]:
        """J."""
        return super().further[:1]

    def flow(self, v: Values, s: float) -> Array:
        """M of (30)."""
        return self.family.dissipation({**v, "Y": 0 * v["P2"]}, s)

    def gains(self, values: Values) -> Gains:
        """L = P1^-1 J, H = -C L."""
        L = np.linalg.solve(values["P1"], values["J"])
        return L, -self.family.plant.C @ L


@dataclass(frozen=True)
class Given(Relaxation):
    """Theorem 2 for given gains."""

    L: Array
    H: Array

    def flow(self, v: Values, s: float) -> Array:
        """M of (30)."""
        return self.family.for_gains(v, s, self.L, self.H)
