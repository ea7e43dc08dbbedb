"""How L and H become unknowns of linear matrix inequalities: Propositions 2 to 5, Theorem 3, and what is left of them.

Each relaxation states (28) at s = exp(delta tau), s = 1 and s = r, for a fixed delta. `Reduced` and `Held` are
Propositions 2 and 5 without the unknowns that can be eliminated exactly:

- Proposition 2 loses nothing, (P1, P2, L, H) and (P1, P2, J, Y) correspond one to one; and J and Y exist iff the two
  inequalities hold where theta = 0 (`Sporadic.without_gains`). So `Reduced` is the limit of all observers (4).
- In Proposition 5 the slack variables X5 .. X8 of one inequality multiply C e' - d' = 0 only, so they go by
  substituting d' = C e'.

Propositions 3 and 5 have a solution for delta > 2 lambda_t only.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from obsdesign.lmi.formula import Array, Inequality, Problem, Unknown, Values, block_diagonal, he, symmetric
from obsdesign.lmi.probe import Program
from obsdesign.lmi.reduce import balance, scaled_coordinates
from obsdesign.observers.sporadic import Sporadic

ONE = np.ones((1, 1))
Gains = tuple[Array, Array]  # L (n, ny), H (ny, ny)


@dataclass(frozen=True)
class Relaxation(ABC):
    """Inequalities that imply (28), affine in their unknowns; in doubles."""

    steep: ClassVar[bool] = False  # whether delta > 2 lambda_t is necessary

    family: Sporadic

    @abstractmethod
    def flow(self, v: Values, s: float) -> Array:
        """What must be negative at s = 1 and at s = r."""

    @property
    @abstractmethod
    def further(self) -> tuple[Unknown, ...]:
        """Unknowns besides P1, P2 and the multiplier."""

    def gains(self, values: Values) -> Gains:
        """L and H of a solution."""
        raise NotImplementedError(f"{type(self).__name__} has no gains as unknowns")

    def factor(self, v: Values) -> Array:
        """X with X'L = J."""
        raise NotImplementedError(f"{type(self).__name__} has no gains as unknowns")

    def bounded(self, v: Values, kappa: float, center: Array | None = None) -> Inequality:
        """[S, J; J', kappa^2 I] >= 0 with S <= X'X and J = X'L, which implies L'L <= J'S^-1 J <= kappa^2 I.

        X'X >= X'Z + Z'X - Z'Z for any center Z, with equality for Z = X. Without a center, Z = t I: the matrix is
        divided by t, and t is an unknown; it is smaller than X + X', so that X is regular.
        """
        X, square = self.factor(v), kappa**2 * np.eye(len(self.family.plant.C))
        if center is None:
            S, square = he(X) - v["t"] * np.eye(self.family.plant.n), v["t"] * square
        else:
            S = he(center.T @ X) - center.T @ center
        return Inequality("|L| <= kappa", -symmetric([[S, v["J"]], [square]]))

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

    def least_gamma(self, kappa: float | None = None, center: Array | None = None) -> Problem:
        """Minimise mu = gamma^2, for |L| <= kappa if that is given; P1, P2 >= 0 are closed by the solver."""

        def inequalities(v: Values) -> list[Inequality]:
            rows = self.inequalities({**v, "weight": ONE})
            if not self.family.plant.B.shape[1]:
                rows.append(Inequality("mu >= 0", -v["mu"]))
            return rows if kappa is None else [*rows, self.bounded(v, kappa, center)]

        unknowns = *self.unknowns, *self.scale(kappa is not None and center is None), Unknown("mu", (1, 1))
        return Problem(unknowns, inequalities, lambda v: v["mu"])

    def elastic(self, kappa: float | None = None) -> Problem:
        """Minimise what is missing for the inequalities without w and z (Corollary 1): feasible iff it is negative.

        P1 and P2 have a trace of the order of 1 together, in the units in which they are of the same size.
        """
        root, n = np.sqrt(self.family.ratio), self.family.plant.n
        silent = replace(self, family=self.family.silent)

        def inequalities(v: Values) -> list[Inequality]:
            v = {**v, "weight": 0 * ONE, "mu": 0 * ONE}
            flows, rest = silent.inequalities(v)[:2], silent.family.positive(v)
            relaxed = [Inequality(f.name, f.matrix - v["missing"] * np.eye(f.matrix.shape[-1])) for f in flows]
            size = trace(v["P1"]) + root * trace(v["P2"])
            sizes = Inequality("size >= n", n * ONE - size), Inequality("size <= 2 n", size - 2 * n * ONE)
            gain = [] if kappa is None else [self.bounded(v, kappa)]
            return [*relaxed, *rest, *sizes, *gain]

        unknowns = *self.unknowns, *self.scale(kappa is not None), Unknown("missing", (1, 1))
        return Problem(unknowns, inequalities, lambda v: v["missing"])

    def scaled(self, problem: Problem, program: Program) -> tuple[Program, Array]:  # noqa: ARG002
        """Rows and coordinates of one of the problems in units in which a solver gets far; z = T scaled z."""
        return balance(program)

    def scale(self, needed: bool) -> tuple[Unknown, ...]:
        """The unknown t of `bounded`."""
        return (Unknown("t", (1, 1)),) if needed else ()

    def witness(self, gamma: float) -> Problem:
        """The inequalities for a gamma."""
        return Problem(self.unknowns, lambda v: self.inequalities({**v, "weight": ONE, "mu": gamma**2 * ONE}))


def trace(X: Array) -> Array:
    """Trace as a 1x1 matrix."""
    return np.asarray(np.trace(X, axis1=-2, axis2=-1)[..., None, None])


class Reduced(Relaxation):
    """Proposition 2 without J and Y: the limit of all L and H."""

    further: ClassVar[tuple[Unknown, ...]] = ()

    def flow(self, v: Values, s: float) -> Array:
        """M with theta = 0."""
        return self.family.without_gains(v, s)


class Proposition2(Relaxation):
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

    @property
    def further(self) -> tuple[Unknown, ...]:
        """J."""
        ny, n = self.family.plant.C.shape
        return (Unknown("J", (n, ny)),)

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

    further: ClassVar[tuple[Unknown, ...]] = ()

    def flow(self, v: Values, s: float) -> Array:
        """M of (30)."""
        return self.family.for_gains(v, s, self.L, self.H)

    def gains(self, values: Values) -> Gains:  # noqa: ARG002
        """The given ones."""
        return self.L, self.H


@dataclass(frozen=True)
class Slack:
    """Factor X of the error equations and its product with F_r of (35), both of order n + ny."""

    X: Array
    product: Array  # X' F_r


class Slacked(Relaxation):
    """(36), in which the error equations 0 = -F_l^-1 x' + F_r x + .. are added with factors Xa for x', Xb for x."""

    @abstractmethod
    def factors(self, v: Values, s: float) -> tuple[Slack, Slack]:
        """Xa, Xb."""

    @property
    def rates(self) -> Array:
        """Columns that span the rates (e', d') that are not eliminated: all of them."""
        return np.eye(sum(self.family.plant.C.shape))

    def flow(self, v: Values, s: float) -> Array:
        """(36) in (e', d', e, d, w, f), with 2 lambda_t P1 for the lambda_t P1 and P_T2 for the P that are printed."""
        family, p = self.family, self.family.plant
        (ny, n), T = p.C.shape, self.rates
        error, output = self.selectors
        (ee, ew, ef), w, f = family.supply(v)
        a, b = self.factors(v, s)
        K = np.eye(n + ny) - error.T @ p.C.T @ output  # F_l^-T
        B, Bf = error.T @ p.B, error.T @ p.Bf
        storage = block_diagonal([v["P1"], s * v["P2"]])
        held = block_diagonal([2 * family.decay * v["P1"] + ee, s * (2 * family.decay - family.delta) * v["P2"]])
        return symmetric(
            [
                [
                    -he(T.T @ K @ a.X @ T),
                    T.T @ (a.product - K @ b.X + storage),
                    T.T @ a.X.mT @ B,
                    T.T @ a.X.mT @ Bf,
                ],
                [held + he(b.product), b.X.mT @ B + error.T @ ew, b.X.mT @ Bf + error.T @ ef],
                w,
                f,
            ]
        )

    @property
    def selectors(self) -> tuple[Array, Array]:
        """E and d of (e, d)."""
        ny, n = self.family.plant.C.shape
        return np.eye(n, n + ny), np.eye(ny, n + ny, k=n)

    def slack(self, v: Values, *, output: bool = False) -> Slack:
        """X for e (and U for d), with X'L = J and U'H = W: F_r = [A - L C, L; -H C, H]."""
        e, d = self.selectors
        theta = d - self.family.plant.C @ e
        X = e.T @ v["X"] @ e
        product = e.T @ (v["X"].mT @ self.family.plant.A @ e + v["J"] @ theta)
        if not output:
            return Slack(X, product)
        return Slack(X + d.T @ v["U"] @ d, product + d.T @ v["W"] @ theta)

    @property
    def further(self) -> tuple[Unknown, ...]:
        """X and J."""
        ny, n = self.family.plant.C.shape
        return Unknown("X", (n, n)), Unknown("J", (n, ny))

    def gains(self, values: Values) -> Gains:
        """L = X^-T J, and H = U^-T W or zero."""
        ny = len(self.family.plant.C)
        H = np.linalg.solve(values["U"].T, values["W"]) if "U" in values else np.zeros((ny, ny))
        return np.linalg.solve(values["X"].T, values["J"]), H

    def factor(self, v: Values) -> Array:
        """X."""
        return v["X"]


class Proposition3(Slacked):
    """(44)."""

    steep = True

    @property
    def further(self) -> tuple[Unknown, ...]:
        """X, J, U and W."""
        ny = len(self.family.plant.C)
        return *super().further, Unknown("U", (ny, ny)), Unknown("W", (ny, ny))

    def scaled(self, problem: Problem, program: Program) -> tuple[Program, Array]:
        """Units in which P2, U and W are r^(1/2) times as large, and d in the inequalities r^(-1/4) and r^(1/4)."""
        root, order = float(np.sqrt(self.family.ratio)), sum(self.family.plant.C.shape)
        units = [np.full(u.size, 1 / root if u.name in {"P2", "U", "W"} else 1.0) for u in problem.unknowns]
        flows = program.blocks[:2]
        if sum(map(len, units)) != len(program.cost) or any(flow.order < 2 * order for flow in flows):
            return balance(program)  # some were eliminated
        output = np.arange(flows[0].order) % order >= len(self.family.plant.A)
        output[2 * order :] = False
        rows = {flow.name: np.where(output, root**power, 1.0) for flow, power in zip(flows, (0.5, -0.5), strict=True)}
        rows["P2 > 0"] = np.full(len(self.family.plant.C), np.sqrt(root))
        blocks = tuple(b.scaled(rows.get(b.name, np.ones(b.order))) for b in program.blocks)
        factors = np.concatenate(units)
        return scaled_coordinates(replace(program, blocks=blocks), factors), np.diag(factors)

    def factors(self, v: Values, s: float) -> tuple[Slack, Slack]:  # noqa: ARG002
        """X6 = U, X8 = 0."""
        return self.slack(v, output=True), self.slack(v)


class Proposition4(Proposition3):
    """(45)."""

    steep = False

    def factors(self, v: Values, s: float) -> tuple[Slack, Slack]:  # noqa: ARG002
        """X6 = X8 = U."""
        return (self.slack(v, output=True),) * 2


class Held(Slacked):
    """Proposition 5, H = 0, without its slack variables."""

    steep = True

    @property
    def rates(self) -> Array:
        """D' = C e'."""
        error, output = self.selectors
        return np.asarray(error.T + output.T @ self.family.plant.C)

    def factors(self, v: Values, s: float) -> tuple[Slack, Slack]:  # noqa: ARG002
        """X for e."""
        return (self.slack(v),) * 2


class Proposition5(Slacked):
    """(46)."""

    steep = True

    @property
    def further(self) -> tuple[Unknown, ...]:
        """X and J, and a row of slack variables for each inequality."""
        ny, n = self.family.plant.C.shape
        rows = (Unknown(name, (ny, n + ny)) for name in ("X56", "X78", "Y56", "Y78"))
        return *super().further, *rows

    def factors(self, v: Values, s: float) -> tuple[Slack, Slack]:
        """X5 .. X8 at s = 1, Y5 .. Y8 at s = r."""
        _, d = self.selectors
        base, letter = self.slack(v), "X" if s == 1 else "Y"
        a, b = (Slack(base.X + d.T @ v[f"{letter}{rows}"], base.product) for rows in ("56", "78"))
        return a, b


@dataclass(frozen=True)
class Theorem3(Slacked):
    """(36) for given gains: the slack form of (28)."""

    L: Array
    H: Array

    @property
    def further(self) -> tuple[Unknown, ...]:
        """Both factors, for each inequality."""
        order = sum(self.family.plant.C.shape)
        return tuple(Unknown(name, (order, order)) for name in ("Xa", "Xb", "Ya", "Yb"))

    def factors(self, v: Values, s: float) -> tuple[Slack, Slack]:
        """Full matrices."""
        (e, d), p = self.selectors, self.family.plant
        F = e.T @ p.A @ e + (e.T @ self.L + d.T @ self.H) @ (d - p.C @ e)
        letter = "X" if s == 1 else "Y"
        a, b = (Slack(X, X.mT @ F) for X in (v[f"{letter}a"], v[f"{letter}b"]))
        return a, b

    def gains(self, values: Values) -> Gains:  # noqa: ARG002
        """The given ones."""
        return self.L, self.H
