"""Relaxations with slack variables: Theorem 3 and its cases that are linear, Propositions 3 to 5.

`Held` is Proposition 5 without the unknowns that can be eliminated exactly: X5 .. X8 of one inequality, and Y5 .. Y8 of
the other, multiply C e' - d' = 0 only, so they go by substituting d' = C e'.

Propositions 3 and 5 have a solution for delta > 2 lambda_t only.
"""

from abc import abstractmethod

import numpy as np

from obsdesign.families.sporadic.relaxations import Gains, Relaxation, WithGains
from obsdesign.lmi.equilibrate import scaled_coordinates
from obsdesign.lmi.formula import Array, Problem, Unknown, Values, block_diagonal, he, symmetric
from obsdesign.lmi.probe import Program
from obsdesign.lmi.reduce import balance
from obsdesign.records import dataclass, replace


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


class SlackedWithGains(Slacked, WithGains):
    """Factors that are tied to each other so that X'L = J, U'H = W."""

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


class Proposition3(SlackedWithGains):
    """(44)."""

    delta_above_decay = True

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

    delta_above_decay = False

    def factors(self, v: Values, s: float) -> tuple[Slack, Slack]:  # noqa: ARG002
        """X6 = X8 = U."""
        return (self.slack(v, output=True),) * 2


class Held(SlackedWithGains):
    """Proposition 5, H = 0, without its slack variables."""

    injection = "hold"
    delta_above_decay = True

    @property
    def rates(self) -> Array:
        """D' = C e'."""
        error, output = self.selectors
        return np.asarray(error.T + output.T @ self.family.plant.C)

    def factors(self, v: Values, s: float) -> tuple[Slack, Slack]:  # noqa: ARG002
        """X for e."""
        return (self.slack(v),) * 2


class Proposition5(SlackedWithGains):
    """(46)."""

    delta_above_decay = True

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
