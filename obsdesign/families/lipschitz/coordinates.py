"""Diagonal coordinates that make the Lipschitz constant of a plant small in relation to the admissible one.

With xbar = T x, T diagonal and positive, A becomes T A T^-1, C becomes C T^-1, and the nonlinearity as one function of
all states, Bf f(Cq x), becomes T Bf f(Cq T^-1 xbar) with the Jacobian T Bf J Cq T^-1. T changes its constant, and the
largest constant for which there is a gain. This is the unstructured view, that of `norm-bound` and `abbaszadeh`: where
the s-procedure knows which f_i depends on what, its inequality is the same in all coordinates.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import product
from math import inf, isfinite, log
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.constants import restriction
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.pace import DECAY, RHO
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.expressions import Expression
from obsdesign.families.lipschitz.relaxations import S_PROCEDURE, Lipschitz, lipschitz_multiplier
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.families.lipschitz.suprema import largest_constant
from obsdesign.lmi.formula import Array, in_floats, rational, rational_number
from obsdesign.model.filtered import filtered
from obsdesign.nonlinearities.evidence.constant import patient_norm
from obsdesign.nonlinearities.evidence.enclosure import require_continuous
from obsdesign.nonlinearities.evidence.norm import Matrix
from obsdesign.nonlinearities.evidence.refutation import spread
from obsdesign.nonlinearities.evidence.restriction import Range, with_name
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec

SAMPLES = 400  # Jacobians that stand for all of them in the search
CORNERS = 6  # most variables of which all corners of the region are among them
LARGEST = 1000  # ratio of a diagonal entry to the first one, at most
EVALUATIONS = 60  # of the search, for each free entry
STEP = log(4)  # of its first points


@dataclass(frozen=True)
class Scaling:
    """What coordinates xbar = T x make of the constant of f and of the admissible one."""

    T: tuple[fmpq, ...]  # diagonal
    lower: float  # lower <= constant of T Bf f(Cq T^-1 .) <= upper, proved
    upper: float
    admissible: float  # supremum over all gains, numerical; infinite if every constant will do

    @property
    def ratio(self) -> float:
        """Admissible to actual constant."""
        return self.admissible / self.upper if self.upper else inf

    def report(self) -> dict[str, Any]:
        """Numbers as a result has them; null is infinite."""
        margin = self.admissible - self.upper
        known = {"admissible": self.admissible, "margin": margin, "ratio": self.ratio}
        return {
            "T": [float(t) for t in self.T],
            "lower": self.lower,
            "upper": self.upper,
            **{key: value if isfinite(value) else None for key, value in known.items()},
        }


def scaling(spec: Spec, engine: Engine, T: Sequence[str] | None = None) -> dict[str, Any]:
    """Compare the coordinates of a spec with scaled ones.

    `T`: diagonal of T in decimals; None: the tool searches for the largest ratio of admissible to actual constant.

    Returns `relaxation`, and `decay` or `rho`, for which a constant is admissible, and for `identity` and `scaled` each
    `T`, `lower` <= constant <= `upper`, `admissible`, `margin` = admissible - upper and `ratio` = admissible / upper;
    `edge`: whether the search ended at the largest spread of T that it tries.

    Raises `UsageError`: a block has no f, f may jump or is not one of the states alone, or T has another size or an
    entry that is not positive. Raises `UndecidedError`: no Lipschitz constant of f could be proved.
    """
    view = StateFunction.of(spec, engine)
    ones = (fmpq(1),) * spec.posed.n
    identity = view.scaled(ones)
    chosen = given(T, len(ones)) if T else view.best(identity)
    return {
        "relaxation": view.relaxation,
        view.unit.about.pace.key: float(view.unit.about.pace.told(view.unit.rate)),
        "identity": identity.report(),
        "scaled": view.scaled(chosen).report(),
        "edge": not T and bool(max(max(t, 1 / t) for t in chosen) >= LARGEST),
    }


def given(T: Sequence[str], n: int) -> tuple[fmpq, ...]:
    """Diagonal that a user gives."""
    try:
        exact = tuple(rational_number(t.strip()) for t in T)
    except (ValueError, OverflowError, ZeroDivisionError):
        exact = ()
    if len(exact) != n or min(exact) <= 0:
        raise UsageError(
            f"--T: expected {n} positive numbers separated by commas, one a state, found {','.join(T)}", id="OBS901"
        )
    return exact


@dataclass(frozen=True)
class StateFunction:
    """Bf f(Cq x) of a spec as one function of all states."""

    J: Matrix  # of all blocks, each with its own variables: where they share some, the lower bound may not be attained
    box: Mapping[str, Range]
    unit: Lipschitz  # x' = A x + f(x) or x+ = .., |df| <= |dx|, y = C x
    Bf: Array
    Cq: Array
    relaxation: str
    engine: Engine

    @classmethod
    def of(cls, spec: Spec, engine: Engine) -> "StateFunction":
        """View of a spec."""
        plant, n, pace = spec.augmented, spec.augmented.n, DECAY if spec.period is None else RHO
        if (plant.Dqf != 0).any() or (plant.Df != 0).any() or not plant.Bf.size:
            raise UsageError(
                "f is not of the states alone, or is in y (Dqf, Df), which --scaling cannot take", id="OBS406"
            )
        if any(block.f is None for block in spec.nonlinearities):
            raise UsageError("a nonlinearity has no f, which --scaling needs of each", id="OBS402")
        J, box = whole(spec)
        request = spec.observer
        rate, relaxation = fmpq(0), "s-procedure"
        if isinstance(request, LipschitzRequest):
            rate = request.rates[0]
            relaxation = relaxation if request.relaxation == "compare" else request.relaxation
        eye, none = rational(np.eye(n)), rational(np.zeros((n, n)))
        same = replace(plant, Bf=eye, Cq=eye, Dqf=none, Dq=0 * plant.B, Df=0 * plant.C)
        posed = filtered(same) if request.filtered else same
        unit = S_PROCEDURE[pace].of(posed, lipschitz_multiplier((fmpq(1),), ((n, n),)), (fmpq(1),), spec.H, rate)
        return cls(J, box, unit.undisturbed(), plant.Bf, plant.Cq, relaxation, engine)

    def scaled(self, T: Sequence[fmpq]) -> Scaling:
        """Proved constant and admissible one in the coordinates T x."""
        norm = patient_norm(self.scaled_jacobian(T), self.box)
        if norm.bound == inf:
            raise UndecidedError(
                "the Lipschitz constant of f could not be proved finite; give a smaller region", id="OBS403"
            )
        return Scaling(tuple(T), norm.attained, norm.bound, self.admissible(np.array([float(t) for t in T])))

    def scaled_jacobian(self, T: Sequence[fmpq]) -> Matrix:
        """T Bf J Cq T^-1."""
        left, right = np.array(T, dtype=object)[:, None] * self.Bf, self.Cq / np.array(T, dtype=object)
        zero = Expression.number(0)

        def combined(row: Array, column: Array) -> Expression:
            terms = [(row[a] * column[b], g) for a, line in enumerate(self.J) for b, g in enumerate(line)]
            terms = [(c, g) for c, g in terms if c != 0 and g != zero]
            return Expression.combination([c for c, _ in terms], [g for _, g in terms]) if terms else zero

        return [[combined(row, column) for column in right.T] for row in left]

    def admissible(self, T: Array) -> float:
        """Supremum of the constant over all gains in the coordinates T x."""
        p = in_floats(self.unit.plant)
        plant = replace(p, A=T[:, None] * p.A / T, C=p.C / T, Df=p.Df / T)
        return largest_constant(self.engine, replace(in_floats(self.unit), plant=plant), self.relaxation).value

    @cached_property
    def samples(self) -> Array:
        """Jacobians Bf J Cq at points of the region, (SAMPLES, n, n)."""
        names = tuple(self.box)
        points = spread(self.box, np.random.default_rng(0), SAMPLES)
        ends = [*self.box.values()]
        if len(ends) <= CORNERS and np.isfinite(ends).all():
            points = np.hstack([points, np.array([*product(*ends)]).T])
        J = np.array([[g.function(names)(*points) for g in row] for row in self.J])
        return np.asarray(in_floats(self.Bf) @ np.moveaxis(J, -1, 0) @ in_floats(self.Cq))

    def best(self, identity: Scaling) -> tuple[fmpq, ...]:
        """T with the largest ratio that the search of Nelder and Mead finds from the identity, in 3 digits."""
        from scipy.optimize import minimize

        free = len(identity.T) - 1
        if not free or not 0 < identity.ratio < inf:
            return identity.T

        def loss(exponents: Array) -> float:
            T = np.exp([0.0, *exponents])
            return -log(max(self.sampled_ratio(T), 1e-300))

        found = minimize(
            loss,
            np.zeros(free),
            method="Nelder-Mead",
            bounds=[(-log(LARGEST), log(LARGEST))] * free,
            options={
                "initial_simplex": np.vstack([np.zeros(free), STEP * np.eye(free)]),
                "maxfev": EVALUATIONS * free,
                "xatol": 1e-2,
                "fatol": 1e-3,
            },
        )
        return fmpq(1), *(rational_number(f"{t:.3g}") for t in np.exp(found.x))

    def sampled_ratio(self, T: Array) -> float:
        """Admissible to sampled constant; 0 where the first is not known."""
        actual = np.linalg.norm(T[:, None] * self.samples / T, 2, axis=(1, 2)).max()
        try:
            return float(self.admissible(T) / actual)
        except UndecidedError:
            return 0.0


def whole(spec: Spec) -> tuple[Matrix, dict[str, Range]]:
    """Jacobian of f = (f_1, .., f_k) and the box of its variables."""
    J: list[list[Expression]] = []
    box: dict[str, Range] = {}
    before, zero = 0, Expression.number(0)
    for k, block in enumerate(spec.nonlinearities, start=1):
        f = restriction(block)
        require_continuous(f)
        after = spec.posed.Cq.shape[0] - before - f.nq
        J += [[zero] * before + [renamed(g, f.box, k) for g in row] + [zero] * after for row in f.jacobian]
        box |= {f"f{k}.{name}": limits for name, limits in f.box.items()}
        before += f.nq
    return J, box


def renamed(g: Expression, names: Iterable[str], k: int) -> Expression:
    """Expression with the variables of block k."""
    for name in names:
        g = with_name(g, name, f"f{k}.{name}")
    return g
