"""Plant and observer in discrete time: a recursion, sample by sample, with no integrator."""

from collections.abc import Callable, Sequence

import numpy as np
from flint import fmpq

from obsdesign.families.guarantee import Steps
from obsdesign.lmi.formula import Float, rational_number
from obsdesign.records import dataclass
from obsdesign.simulate.clock import TIMES, Clock
from obsdesign.simulate.definitions import Definitions, rate
from obsdesign.simulate.integrate import Mask, Status, Trajectory, Vector
from obsdesign.simulate.program import Definition, Program
from obsdesign.simulate.switches import Break
from obsdesign.simulate.system import INTEGRALS, V2, Z2, Accumulated, System, Table

ESCAPE = 1e75  # of a state: larger ones have a square, or the square of that, which no double holds
GROWS = "the state grows beyond what doubles can hold"
OUTSIDE = "the model has no finite value"
TOLD = 1000  # samples between two reports of progress


@dataclass(frozen=True)
class Passed(Trajectory):
    """States at the samples, each of which is a step as well."""

    def merged(self) -> tuple[Vector, Vector, Mask, Mask]:
        """Times and states of the samples, once."""
        every = np.ones(len(self.t), dtype=bool)
        return self.t, self.s, every, every


class Recursion(System):
    """A plant with its observer in discrete time: what is called a rate is the value at the next sample.

    b+ = rho^2 b + c |v|^2 from b_0 = 0, so that V_k <= rho^(2 k) V_0 + b_k. The sums of |z|^2 and |v|^2 in the state
    are those of the samples before.
    """

    def integrals(self) -> tuple[Definition, Definition, Definition]:
        """Next values of the sums and of b."""
        rates = self.guarantee.rates() if self.guarantee else Steps(1.0, 0.0, 1.0)
        assert isinstance(rates, Steps)
        rho, (z2, v2, b) = rational_number(rates.rho), INTEGRALS
        added = {V2: rational_number(rates.c), b: rho * rho}
        return {z2: fmpq(1), Z2: fmpq(1)}, {v2: fmpq(1), V2: fmpq(1)}, added

    def build(self, made: Definitions, inputs: tuple[str, ...], outputs: list[str]) -> None:
        """Program of the signals, with the instants of the next samples among its inputs."""
        self.program = Program((*inputs, *TIMES[1:]), made.made, outputs)

    @property
    def clock(self) -> Clock:
        """Instants of the samples."""
        assert self.scenario.clock
        return self.scenario.clock

    def beside(self, t: float | Float) -> Float:
        """Inputs of the program beside t and s: noise and files at a sample and the next, instants of the next."""
        noise = [self.scenario.held(t, ahead) for ahead in (0, 1)]
        known = self.given(t, np.concatenate(noise, axis=-1)[..., : len(self.silent)])
        return np.concatenate((known, self.clock.times(t)), axis=-1)

    def breaks(self) -> list[Break]:
        """None: nothing is between two samples."""
        return []

    def accumulated(self, t: Float, s: Float, now: Table, breaks: Sequence[Break]) -> Accumulated:  # noqa: ARG002
        """Sums up to each sample, itself included, and b of those before it."""
        before_z, before_v, b = s[:, self.end : self.end + 3].T
        z2, v2 = now.of((Z2, V2)).T
        v = np.sqrt(v2)
        return Accumulated(before_z + z2, before_v + v2, np.maximum.accumulate(v), b, v)

    def follow(self, start: Vector, progress: Callable[[float], None] | None = None) -> Trajectory:
        """All samples from the start on.

        Returns
        -------
        Trajectory
            With status "stopped" after the first sample at which an event is true; up to the last sample that has
            finite values, "escape" where the state outgrows the doubles, "stall" where else the model has none.
        """
        t, s = self.clock.instants, np.zeros((self.clock.steps + 1, self.width))
        beside, following = self.beside(t), self.program.places(map(rate, (*self.flowing, *INTEGRALS)))
        s[0], every = start[: self.width], len(t)
        with np.errstate(all="ignore"):
            for k, instant in enumerate(t):
                X, trouble = self.signals_at(instant, s[k], beside[k])
                if trouble:
                    last = f"after t = {t[k - 1]:.6g}"
                    if np.abs(s[k, : self.end]).max(initial=0.0) > ESCAPE:
                        return passed(t[:k], s[:k], "escape", f"{last}: {GROWS}")
                    return passed(t[:k], s[:k], "stall", f"{last}: {trouble}")
                if reason := self.true_event(X):
                    return passed(t[: k + 1], s[: k + 1], "stopped", f"at t = {instant:.6g}: {reason}")
                if k + 1 < every:
                    s[k + 1] = X[following]
                if progress is not None and k % TOLD == 0:
                    progress(float(instant))
        return passed(t, s, "done")

    def signals_at(self, t: float, s: Vector, beside: Vector) -> tuple[Vector, str]:
        """Every signal of a sample, and what is wrong with them, or nothing."""
        try:
            X = self.program.run(t, s, beside)
        except ArithmeticError as error:
            return s, str(error)
        return X, "" if np.isfinite(X).all() else OUTSIDE


def passed(t: Vector, s: Vector, status: Status, reason: str = "") -> Passed:
    """Trajectory up to the last of some samples."""
    return Passed(t, s, t, s, status, float(t[-1]), reason)
