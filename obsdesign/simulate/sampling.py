"""When measurements are sent and received, and whether they keep to the intervals of a guarantee."""

from collections.abc import Iterator
from itertools import accumulate, count
from typing import Any

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass, replace

Vector = Float
MOST = 200_000  # measurements in a run
ROUNDING = 1e-9  # of an interval
SHORTEST = 1000  # parts of T2: the shortest random interval where T1 is zero


@dataclass(frozen=True)
class Sampling:
    """How measurements reach the observer, and what it starts from.

    The law is "periodic", "random" (uniform in [T1, T2]), or an expression of t: the time from a measurement sent at
    t to the next, after a first one at T2. Where a law leaves [T1, T2], the run says from when on no guarantee holds.

    Raises `UsageError` if a number is out of its range, or the law is none of these.
    """

    T1: float  # s, shortest interval that is expected
    T2: float  # s, longest
    law: str | Expression = "periodic"
    period: float | None = None  # s, of the periodic law; None: T2
    dropout: float = 0.0  # share of the measurements that are lost on the way, at random
    theta0: Vector | None = None  # (ny,), theta before the first measurement; None: zero

    def __post_init__(self) -> None:
        if not 0 <= self.T1 <= self.T2 < np.inf or not self.T2:
            raise UsageError(f"the intervals need 0 <= T1 <= T2, not T1 = {self.T1:g}, T2 = {self.T2:g}", id="OBS208")
        if self.period is not None and not 0 < self.period < np.inf:
            raise UsageError(Problem(f"{self.period:g}; it must be positive", key="simulation.period", id="OBS208"))
        if not 0 <= self.dropout < 1:
            raise UsageError(
                Problem(
                    f"{self.dropout:g}; a share in [0, 1) of the measurements can be lost",
                    key="simulation.dropout",
                    id="OBS208",
                )
            )
        if isinstance(self.law, str) and self.law not in {"periodic", "random"}:
            said = f"{self.law!r}; give periodic, random, or a law as an expression of t"
            raise UsageError(Problem(said, key="simulation.sampling", id="OBS202"))
        if isinstance(self.law, Expression) and (others := sorted(self.law.names - {"t"})):
            said = f"the law contains {', '.join(others)}; it may depend on t only"
            raise UsageError(Problem(said, key="simulation.sampling", id="OBS302"))


@dataclass(frozen=True)
class Schedule:
    """Instants at which measurements are received and lost in one run; the observer starts at t = 0."""

    received: Vector  # (K,), increasing
    lost: Vector  # (M,)
    T1: float  # s, limits of the intervals for which the guarantee holds
    T2: float
    horizon: float
    ahead: int | None = None  # intervals to come that the guarantee depends on; None: they may be shorter than T1

    @property
    def intervals(self) -> Vector:
        """Time from each measurement to the next, (K,); the first begins at t = 0."""
        return np.diff(self.received, prepend=0.0)

    @property
    def short(self) -> Array:
        """Which intervals are below T1, (K,); the first one may be."""
        below = self.intervals < self.T1 * (1 - ROUNDING)
        below[:1] = False
        return below

    @property
    def late(self) -> Array:
        """Which intervals exceed T2, (K + 1,); the last one ends with the run."""
        ends = np.append(self.received, self.horizon)
        return np.asarray(np.diff(ends, prepend=0.0) > self.T2 * (1 + ROUNDING))

    @property
    def until(self) -> float:
        """Time from which on no guarantee holds: a measurement is overdue, or one comes too soon; or infinite."""
        late, short, received = np.flatnonzero(self.late), np.flatnonzero(self.short), np.append(0.0, self.received)
        overdue = float(received[late[0]] + self.T2) if len(late) else np.inf
        hasty = float(received[max(short[0] + 1 - self.ahead, 0)]) if len(short) and self.ahead is not None else np.inf
        return min(overdue, hasty)

    @property
    def why(self) -> str:
        """What voids the guarantee, in words."""
        hasty = self.ahead is not None and self.until < replace(self, ahead=None).until
        return "an interval that is too short begins" if hasty else "a measurement is overdue"

    @property
    def crowded(self) -> float:
        """Time of the first measurement that follows another too soon; infinite if none does."""
        short = np.flatnonzero(self.short)
        return float(self.received[short[0]]) if len(short) else np.inf

    def timer(self, t: Array, j: Array) -> Array:
        """Time tau that is left to the next measurement, or to the one that T2 demands, after j are received."""
        last, following = np.append(0.0, self.received)[j], np.append(self.received, np.inf)[j]
        return np.asarray(np.maximum(np.minimum(following, last + self.T2) - t, 0.0))

    def elapsed(self, t: Array, j: Array) -> Array:
        """Time since the last measurement after j are received; the clock is at T1 at the first one, or beyond."""
        begins = np.append(0.0, self.received)
        if len(self.received):
            begins[0] -= max(0.0, self.T1 - self.received[0])
        return np.asarray(t - begins[j])

    def report(self) -> dict[str, Any]:
        """Numbers and intervals of the measurements, and from when on a guarantee is void."""
        outside = int(self.short.sum() + self.late.sum())
        found: dict[str, Any] = {
            "received": len(self.received),
            "lost": len(self.lost),
            "shortest": float(self.intervals[1:].min()) if len(self.received) > 1 else None,
            "longest": float(self.intervals.max()) if len(self.received) else None,
            **({"jitter": (self.T2 - self.T1) / self.T1} if self.T1 else {}),
            "outside": outside,
        }
        if outside:
            found["note"] = self.note()
        return found

    def note(self) -> str:
        """What the intervals outside [T1, T2] mean."""
        if np.isfinite(self.until):
            what = f"{self.why} at t = {self.until:.6g}, nothing is guaranteed from then on"
        else:
            what = f"some are too short from t = {self.crowded:.6g} on, which voids the bound on the effect of noise"
        return f"intervals leave [{self.T1:g}, {self.T2:g}]: {what}"


def schedule(sampling: Sampling, horizon: float, intervals: np.random.Generator, loss: np.random.Generator) -> Schedule:
    """Measurements of a run over [0, horizon).

    Raises `UsageError` if the law gives an interval that is not positive, or more than 200,000 measurements.
    """
    sent: list[float] = []
    for t in instants(sampling, intervals):
        if t >= horizon:
            break
        if len(sent) == MOST:
            raise UsageError(
                Problem(f"more than {MOST:,} measurements in the horizon", key="simulation.sampling", id="OBS210")
            )
        sent.append(t)
    times = np.array(sent)
    lost = loss.uniform(size=len(times)) < sampling.dropout
    return Schedule(times[~lost], times[lost], sampling.T1, sampling.T2, horizon)


def instants(sampling: Sampling, generator: np.random.Generator) -> Iterator[float]:
    """Instants at which measurements are sent, without end."""
    law, T1, T2 = sampling.law, sampling.T1, sampling.T2
    if isinstance(law, Expression):
        yield from following(law, T2)
    elif law == "periodic":
        yield from ((sampling.period or T2) * k for k in count(1))
    else:
        yield from accumulate(generator.uniform(T1 or T2 / SHORTEST, T2) for _ in count())


def following(law: Expression, t: float) -> Iterator[float]:
    """Instants that follow each other by a law of time, from the first on."""
    interval = law.scalar(["t"])
    while True:
        yield t
        wait = interval(t)
        if not 0 < wait < np.inf:
            said = f"the law gives {wait:g} at t = {t:.6g}; the time to the next measurement must be positive"
            raise UsageError(Problem(said, key="simulation.sampling", id="OBS803"))
        t += wait
