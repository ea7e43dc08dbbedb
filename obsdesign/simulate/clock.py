"""Time in samples."""

import numpy as np
from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, printed
from obsdesign.model.ahead import NEXT, later
from obsdesign.records import dataclass
from obsdesign.spec import Spec

TIMES = tuple("t" + NEXT * k for k in range(4))  # of a sample and of those after it, as far as any signal looks ahead
# of v_k of a second-order model w_{k+2}, and of the v of the sample after that, which filtered estimates know, w_{k+3}

ROUNDING = fmpq(1, 10**9)  # of a horizon in periods


@dataclass(frozen=True)
class Clock:
    """The instants k period of a run, k = 0, 1, .., steps."""

    period: fmpq  # s
    steps: int

    @property
    def instants(self) -> Array:
        """Every instant of the run, (steps + 1,), s."""
        return self.at(np.arange(self.steps + 1))

    def at(self, k: Array) -> Array:
        """Instants of samples, s, as the doubles that are nearest to k period."""
        return np.asarray(k * float(self.period.p) / float(self.period.q))

    def number(self, t: float | Array) -> Array:
        """Number of the sample at an instant of the run."""
        return np.asarray(np.rint(t * (float(self.period.q) / float(self.period.p))), dtype=int)

    def times(self, t: float | Array) -> Array:
        """Instants of the samples after that at t, (.., 3), by the names TIMES[1:]."""
        return self.at(self.number(t)[..., None] + np.arange(1, len(TIMES)))

    def named(self, t: float) -> dict[str, float]:
        """Instants of the sample at t and of those after it, by their names."""
        return dict(zip(TIMES, (t, *self.times(t).tolist()), strict=True))


def clock_of(spec: Spec, horizon: float) -> Clock | None:
    """Samples of a run; None in continuous time."""
    return None if spec.period is None else Clock(spec.period, steps_within(horizon, spec.period))


def steps_within(horizon: float, period: fmpq) -> int:
    """Number of whole periods in a horizon, which may be rounded."""
    count = printed(horizon) / period
    nearest = round(float(count))
    return nearest if abs(count - nearest) <= ROUNDING * (1 + nearest) else int(count.floor())


def following(signal: Expression, spec: Spec) -> Expression:
    """Derivative of a signal of time, or in discrete time the signal a sample later."""
    return signal.derivative("t") if spec.period is None else later(signal)
