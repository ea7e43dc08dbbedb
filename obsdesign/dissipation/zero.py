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
class Level:
    """Least gamma over some gains, and where the limit is zero at a finite gain the level to certify in its place."""

    gamma: float
    instead: float | None = None

    @classmethod
    def of(cls, answer: Answer, instead: float | None) -> Self:
        """Gamma of an optimum, or zero where a finite gain cancels the disturbance and it is rounding."""
        gamma = math.sqrt(max(answer.objective, 0.0))
        return cls(0.0, instead) if instead and gamma < SHARE * instead else cls(gamma)

    @property
    def attained(self) -> bool:
        """Whether a finite gain has it, for the limit over all gains."""
        return self.instead is not None

    def target(self, slack: float) -> float:
        """Gamma to be certified, within the slack of the least, rounded down to 6 digits so that it stays there."""
        if self.instead:
            return round_up(self.instead, 6)
        return max(round_down(self.gamma * (1 + slack), 6), round_up(self.gamma, 6))


def vanishing(
    engine: Engine, family: Incremental, limit: Answer
) -> tuple[tuple[tuple[float, float], ...], float | None]:
    """Table of `falling`, and level of `cancelled`; only one of them says something.

    Where B + L1 D = 0 has a solution, a finite gain is tried first: gamma falls towards it as well.
    """
    p = family.plant
    rows = np.vstack([p.D, p.B])
    rows = rows / np.where(rows.any(axis=1), np.abs(rows).max(axis=1, initial=0), 1.0)[:, None]
    solvable = np.linalg.matrix_rank(rows) == np.linalg.matrix_rank(rows[: len(p.D)]) if rows.size else False
    instead = cancelled(engine, family, limit) if solvable else None
    table = () if instead else falling(engine, family, limit)
    return table, instead if solvable or table else cancelled(engine, family, limit)


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
