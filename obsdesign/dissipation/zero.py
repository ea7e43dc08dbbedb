"""Limits of zero: the least gamma falls without end as the gain grows."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.decimals import round_down, round_up
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.inequality import Incremental
from obsdesign.errors import Problem, UsageError
from obsdesign.lmi.equilibrate import units
from obsdesign.lmi.formula import rational_number
from obsdesign.lmi.solve import Answer, Status

TABLE = (
    1e1,
    1e2,
    1e3,
    1e4,
    1e5,
    1e6,
)  # gains of the table that a limit of zero is answered with, in sizes of the plant
SUSPECT = 1e-3  # a gamma below this, likewise, may be a limit of zero: the table decides
ROUNDED = 1e-7  # share of the gamma of the widest solution that counts as zero
SHARE = 1e-3  # .. and that is certified in its place
HALF = -0.4 * math.log(10)  # of log gamma in a decade of gain: |L1| is of the order of 1 / gamma^2 at most
STEADY = 3  # decades over which gamma must fall, without slowing down, for its limit to be called zero


def sizes(family: Incremental) -> tuple[float, float]:
    """Sizes of |L1| and gamma by the data of the plant, to the nearest power of 1000: 1 in the usual units."""
    unit = units(family.least_gamma())
    gain = np.linalg.norm(unit["Y"] / np.diag(unit["P"])[:, None])
    return nearest_thousand(float(gain)), nearest_thousand(math.sqrt(unit["mu"].item()))


def nearest_thousand(size: float) -> float:
    """Nearest power of 1000."""
    return 1000.0 ** round(math.log(size, 1000)) if size > 0 else 1.0


def falling(engine: Engine, family: Incremental, limit: Answer) -> tuple[tuple[float, float], ...]:
    """Table (largest |L1|, gamma) if gamma falls towards zero as the gain grows; else nothing."""
    largest, least = sizes(family)
    if limit.status is Status.OPTIMAL and limit.objective > (SUSPECT * least) ** 2:
        return ()
    rows = []
    for size in (largest * step for step in TABLE):
        answer = engine.minimise(family.least_gamma(Bounds(L1=rational_number(str(size)))))
        if answer.status is Status.OPTIMAL:
            rows.append((size, math.sqrt(max(answer.objective, 0.0))))
    fall = np.diff(np.log([gamma for _, gamma in rows[-4:]]))
    if len(fall) < STEADY or fall.max() >= math.log(0.8):
        return ()
    unseen = limit.status is not Status.OPTIMAL and fall[-1] <= HALF
    return tuple(rows) if fall[-1] < 0.9 * fall[0] or unseen else ()


def cancelled(engine: Engine, family: Incremental, limit: Answer) -> float | None:
    """Level to certify where a finite gain cancels the disturbance, so that the limit is zero but for rounding.

    Then gamma can be as small as one likes, and the level is a small share of that of the solution of widest margin.
    """
    least = max(limit.objective, 0.0)
    if limit.status is Status.INFEASIBLE or least > (SUSPECT * sizes(family)[1]) ** 2:
        return None
    wide = engine.widest(family.witness(None))
    if wide.status is not Status.OPTIMAL:
        return None
    reference = math.sqrt(wide.values["mu"].item())
    return SHARE * reference if math.sqrt(least) <= ROUNDED * reference else None


@dataclass(frozen=True)
class Vanishing:
    """How the least gamma over all gains vanishes, if it does."""

    table: tuple[tuple[float, float], ...] = ()  # of `falling`: with a gain that grows without bound
    instead: float | None = None  # of `cancelled`
    attained: bool = False  # by a finite gain, with which v does not act on the error


@dataclass(frozen=True)
class Level:
    """Least gamma over some gains, and where the limit is zero at a finite gain the level to certify in its place."""

    gamma: float
    instead: float | None = None
    attained: bool = False  # the zero, by a finite gain

    @classmethod
    def of(cls, answer: Answer, zero: Vanishing) -> Self:
        """Gamma of an optimum, or zero where it vanishes and the rest is rounding."""
        gamma = math.sqrt(max(answer.objective, 0.0))
        vanishes = zero.instead and gamma < SHARE * zero.instead
        return cls(0.0, zero.instead, zero.attained) if vanishes else cls(gamma)

    def target(self, slack: float) -> float:
        """Gamma to be certified, within the slack of the least, rounded down to 6 digits so that it stays there."""
        if self.instead:
            return round_up(self.instead, 6)
        return max(round_down(self.gamma * (1 + slack), 6), round_up(self.gamma, 6))


def vanishing(engine: Engine, family: Incremental, limit: Answer) -> Vanishing:
    """Whether the least gamma is zero: where a finite gain keeps v from the error that is tried first.

    Gamma falls towards such a gain as well.
    """
    silent = kept_out(family)
    attained = silent is not None and engine.widest(silent.feasible()).status is Status.OPTIMAL
    instead = cancelled(engine, family, limit) if attained else None
    table = () if instead else falling(engine, family, limit)
    return Vanishing(table, instead if attained or table else cancelled(engine, family, limit), attained and not table)


def kept_out(family: Incremental) -> Incremental | None:
    """Problem that is left with L1 = Z N - B D^+, N = I - D D^+: v does not act on e; None where B + L1 D is not zero.

    The output is N y then, in which there is no v either.
    """
    p, through = family.plant, family.plant.Dq if family.L2 is None else family.plant.Dq + family.L2 @ family.plant.D
    back = np.linalg.pinv(p.D)
    L, N = -p.B @ back, np.eye(len(p.D)) - p.D @ back
    rest, size = p.B + L @ p.D, np.abs(p.B).max(axis=1, initial=0.0, keepdims=True)
    if not p.B.any() or (np.abs(rest) > ROUNDED * size).any() or through.any():
        return None
    A, Bf, C, Df = p.A + L @ p.C, p.Bf + L @ p.Df, N @ p.C, N @ p.Df
    return replace(family, plant=replace(p.undisturbed, A=A, Bf=Bf, C=C, Df=Df))


def settled(engine: Engine, family: Incremental, answer: Answer) -> Answer:
    """Same answer, with the objective 0 where a finite gain cancels the disturbance and the rest is rounding."""
    if cancelled(engine, family, answer) is None:
        return answer
    return replace(answer, status=Status.OPTIMAL, objective=0.0)


def unbounded(alpha: fmpq, rows: Sequence[tuple[float, float]]) -> UsageError:
    """Refusal of min-gamma where the infimum is zero."""
    first = (
        f"the least gamma at alpha = {float(alpha):g} is 0, with a gain that grows without "
        "bound; choose `bounds: {L1: ..}` or `objective: {gamma: ..}` from this table"
    )
    return tabulated(first, "L1", "gamma", rows)


def tabulated(first: str, gain: str, quantity: str, rows: Sequence[tuple[float, float]]) -> UsageError:
    """Refusal with a table of a quantity against the norm of a gain."""
    return UsageError(
        Problem(first, key="observer.objective"),
        *(f"  |{gain}| <= {size:<8g} {quantity} = {value:.4g}" for size, value in rows),
    )
