"""A finished hybrid trajectory in the terms of the spec."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from obsdesign.families.guarantee import Course, Measurements, envelope
from obsdesign.lmi.formula import Array
from obsdesign.simulate.hybrid.run import HybridSamples
from obsdesign.simulate.hybrid.system import Hybrid
from obsdesign.simulate.integrate import Trajectory
from obsdesign.simulate.signals import largest_so_far
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
        guarantee = system.guarantee
        V = guarantee.storage(self.course) if guarantee else None
        V_bound = envelope(guarantee, self.course, V) if guarantee and V is not None else None
        return HybridSamples(
            t=t,
            j=self.j,
            z=z,
            zhat=z - self.eps,
            eps=self.eps,
            theta=theta,
            distance=np.linalg.norm(np.hstack([self.eps, self.mismatch]), axis=1),
            timer=self.timer,
            w=self.now.w,
            y=s[:, system.end + 4 :],
            yp=self.yp,
            V=V,
            V_bound=V_bound,
            distance_bound=guarantee.distance_bound(V_bound) if guarantee and V_bound is not None else None,
        )

    @property
    def timer(self) -> Array:
        """Time that is left to the next measurement, (M,)."""
        return self.system.schedule.timer(self.t, self.j)

    @property
    def yp(self) -> Array:
        """Performance output Cp eps, (M, np)."""
        return np.asarray(self.eps @ self.system.Cp.T)

    @cached_property
    def course(self) -> Course:
        """Error and integrals, with yp for z and w for v."""
        system = self.system
        w_sup = largest_so_far(system.w, self.breaks, self.t, self.now.w)
        yp = np.linalg.norm(self.yp, axis=1)
        yp2, w2, b = self.s[:, system.end : system.end + 3].T
        eta_sup = np.maximum.accumulate(np.append(0.0, np.linalg.norm(system.noise, axis=1)))
        added = np.cumsum(np.append(0.0, system.kicks))
        received = Measurements(self.mismatch, self.timer, eta_sup[self.j], added[self.j], system.schedule.crowded)
        return Course(self.t, self.eps, yp, yp2, w2, w_sup, b, "w", received)

    @cached_property
    def left(self) -> tuple[Leaving, ...]:
        """First leavings of the regions on which the declared types hold."""
        known = {"t": self.t} | dict(zip(self.system.spec.inputs, self.now.u.T, strict=True))
        return leavings(self.system.spec.nonlinearities, self.t, self.now.q, self.now.qhat, known)

    @property
    def until(self) -> float:
        """Time from which on a guarantee says nothing: a measurement is overdue, or the run has left the region."""
        return min([self.system.schedule.until, *(leaving.time for leaving in self.left)])
