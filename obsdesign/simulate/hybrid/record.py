"""A finished hybrid trajectory in the terms of the spec."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.simulate.bounds import Errors, largest_so_far
from obsdesign.simulate.hybrid.bounds import Course, storage
from obsdesign.simulate.hybrid.run import HybridSamples
from obsdesign.simulate.hybrid.system import Hybrid
from obsdesign.simulate.integrate import Trajectory, Vector
from obsdesign.simulate.validity import Leaving, leavings


class Record:
    """Signals of a run, at the samples and at the steps together.

    An instant at which the model has no value, as at the end of a run that stalled, is left out.

    Parameters
    ----------
    system
        What was simulated.
    breaks
        Instants at which signals jump or bend, as `Hybrid.breaks` gives them.
    trajectory
        What the integration gave.
    """

    def __init__(self, system: Hybrid, breaks: Sequence[tuple[float, float]], trajectory: Trajectory) -> None:
        self.system, self.breaks, self.trajectory = system, breaks, trajectory
        t, s, step = trajectory.merged()
        with np.errstate(all="ignore"):
            now = system.instants(t, s)
        defined = np.isfinite(np.hstack([s, *now])).all(axis=1)
        self.t, self.s, self._step = t[defined], s[defined], step[defined]
        self.now = type(now)(*(column[defined] for column in now))

    def at_steps(self) -> HybridSamples:
        """Return the signals at the start and the steps."""
        return self.signals.rows(self._step)

    def at_samples(self) -> HybridSamples:
        """Return the signals at the samples."""
        return self.signals.rows(~self._step)

    @property
    def j(self) -> Array:
        """Number of measurements received, (M,)."""
        return np.asarray(np.rint(self.s[:, self.system.end + 3]), dtype=int)

    @property
    def eps(self) -> Array:
        """Error z - zhat, (M, n)."""
        return np.asarray(self.s[:, self.system.n : 2 * self.system.n])

    @cached_property
    def mismatch(self) -> Array:
        """Return theta~ = C eps - theta, (M, ny)."""
        return np.asarray(self.eps @ self.system.plant.C.T - self.s[:, 2 * self.system.n : self.system.end])

    @cached_property
    def signals(self) -> HybridSamples:
        """States of the flow in the terms of the spec; V only where there is a guarantee."""
        system, t, s, n = self.system, self.t, self.s, self.system.n
        z, theta = s[:, :n], s[:, 2 * n : system.end]
        timer = system.schedule.timer(t, self.j)
        V, V_bound, distance_bound = (
            storage(system.guarantee, self.eps, self.mismatch, timer, t, s[:, system.end + 2])
            if system.guarantee
            else (None, None, None)
        )
        return HybridSamples(
            t=t,
            j=self.j,
            z=z,
            zhat=z - self.eps,
            eps=self.eps,
            theta=theta,
            distance=np.linalg.norm(np.hstack([self.eps, self.mismatch]), axis=1),
            timer=timer,
            w=self.now.w,
            y=s[:, system.end + 4 :],
            yp=self.eps @ system.Cp.T,
            V=V,
            V_bound=V_bound,
            distance_bound=distance_bound,
        )

    @cached_property
    def errors(self) -> Errors:
        """Error and integrals, with yp for z and w for v."""
        w_sup = largest_so_far(self.system.w, self.breaks, self.t, self.now.w)
        yp = np.linalg.norm(self.signals.yp, axis=1)
        yp2, w2, b = self.s[:, self.system.end : self.system.end + 3].T
        return Errors(self.t, self.eps, yp, yp2, w2, w_sup, b)

    def course(self, V: Vector) -> Course:
        """What the bounds are made of."""
        eta_sup = np.maximum.accumulate(np.append(0.0, np.linalg.norm(self.system.noise, axis=1)))
        kick = np.cumsum(np.append(0.0, self.system.kicks))
        return Course(self.errors, self.signals.distance, V, eta_sup[self.j], kick[self.j])

    @cached_property
    def left(self) -> tuple[Leaving, ...]:
        """First leavings of the regions on which the declared types hold."""
        known = {"t": self.t} | dict(zip(self.system.spec.inputs, self.now.u.T, strict=True))
        return leavings(self.system.spec.nonlinearities, self.t, self.now.q, self.now.qhat, known)

    @property
    def until(self) -> float:
        """Time from which on a guarantee says nothing: a measurement is overdue, or the run has left the region."""
        return min([self.system.schedule.until, *(leaving.time for leaving in self.left)])
