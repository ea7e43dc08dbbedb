"""A finished integration in the terms of the spec."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from obsdesign.families.guarantee import Course, Guarantee, envelope
from obsdesign.lmi.formula import Array, in_floats
from obsdesign.simulate.coupled import Coupled, Instant
from obsdesign.simulate.integrate import Trajectory
from obsdesign.simulate.run import Samples
from obsdesign.simulate.signals import largest_so_far
from obsdesign.simulate.validity import Leaving, leavings
from obsdesign.spec import Spec


class Record:
    """Signals and errors of a run, at the samples and at the steps of the integrator together.

    An instant at which the model has no value, as at the end of a run that stalled, is left out.

    Parameters
    ----------
    spec, system, guarantee
        What was simulated, and what is proved of it, if anything.
    breaks
        Instants at which signals or terms jump or bend, as `Scenario.breaks` gives them.
    trajectory
        What the integration gave.
    """

    def __init__(
        self,
        spec: Spec,
        system: Coupled,
        guarantee: Guarantee | None,
        breaks: Sequence[tuple[float, float]],
        trajectory: Trajectory,
    ) -> None:
        self.spec = spec
        self.system = system
        self.acting = system.scenario
        self.guarantee = guarantee
        self.breaks = breaks
        self.trajectory = trajectory
        self.model = in_floats(spec.generator)
        t, states, steps = trajectory.merged()
        with np.errstate(all="ignore"):
            now = system.instants(t, states)
        defined = np.isfinite(np.hstack(now)).all(axis=1)
        self.t, self.s, self.now = t[defined], states[defined], Instant(*(column[defined] for column in now))
        self._step = steps[defined]

    def at_steps(self) -> Samples:
        """Return the signals at the start and the accepted steps."""
        return self.signals.rows(self._step)

    def at_samples(self) -> Samples:
        """Return the signals at the samples."""
        return self.signals.rows(~self._step)

    @cached_property
    def course(self) -> Course:
        """Error and integrals; without a true xm only the error of the plant's states."""
        width = self.acting.n if self.acting.unmodeled else self.acting.plant.n
        e = self.s[:, self.system.ns : self.system.ns + width]
        z = np.linalg.norm(e @ self.system.H[:, :width].T, axis=1)
        v_sup = largest_so_far(self.acting.v, self.breaks, self.t, self.now.v)
        return Course(self.t, e, z, self.s[:, -3], self.s[:, -2], v_sup, self.s[:, -1], self.spec.observer.drive)

    @cached_property
    def signals(self) -> Samples:
        """States of the flow in the terms of the spec; V only where the guarantee covers the run."""
        now, e = self.now, self.course.e
        w = self.modeled(now.xi, now.phi) + self.direct
        what, w_error = self.estimates(w)
        V = self.guarantee.storage(self.course) if self.guarantee and not self.uncovered else None
        outputs = len(self.acting.plant.outputs)
        return Samples(
            t=self.t,
            xi=now.xi[:, : e.shape[1]],
            xihat=now.xi + self.s[:, self.system.ns : self.system.end],
            e=e,
            w=w,
            what=what,
            w_error=w_error,
            q=now.a[:, outputs:],
            qhat=now.ahat[:, outputs:],
            y=now.a[:, :outputs] + self.system.noise(self.t),
            v=None if self.acting.unmodeled else now.v,
            z=e @ self.system.H[:, : e.shape[1]].T if self.has_z else None,
            V=V,
            V_bound=None if V is None or self.guarantee is None else envelope(self.guarantee, self.course, V),
        )

    @property
    def direct(self) -> Array:
        """Part of w that v is, past the disturbance model, (M, nw)."""
        return self.now.v if self.acting.unmodeled else self.now.v @ self.model.Dm.T

    def modeled(self, xi: Array, phi: Array) -> Array:
        """Output of the disturbance model without the direct v, (M, nw)."""
        return np.asarray(
            xi[:, self.acting.n :] @ self.model.Cm.T + phi[:, self.system.model_blocks] @ self.model.Dwf.T
        )

    def estimates(self, w: Array) -> tuple[Array, Array]:
        """Return what and what - w, each (M, len(estimated))."""
        now, e = self.now, self.s[:, self.system.ns : self.system.end]
        if self.spec.observer.reconstruct:
            what = self.system.reconstructed(self.t, self.s, now)
            return what, what - w
        channels = list(self.estimated)
        what, error = self.modeled(now.xi + e, now.phihat), self.modeled(e, now.phihat - now.phi) - self.direct
        return what[:, channels], error[:, channels]

    @property
    def estimated(self) -> tuple[int, ...]:
        """Channels of w that the observer estimates: those without a direct v, or all by reconstruction."""
        direct = (self.model.Dm != 0).any(axis=1) & (not self.spec.observer.reconstruct)
        return tuple(np.flatnonzero(~direct).tolist())

    @property
    def has_z(self) -> bool:
        """Whether z = H e has a true value: not if it needs an xm that has none."""
        return not (self.acting.unmodeled and (self.spec.H[:, self.acting.n :] != 0).any())

    @cached_property
    def left(self) -> tuple[Leaving, ...]:
        """First leavings of the regions on which the declared types hold."""
        signals, outputs = self.signals, self.acting.plant.outputs
        known = {"t": self.t} | dict(zip(outputs, self.now.a.T, strict=False))
        known |= dict(zip(self.spec.inputs, self.now.u.T, strict=True))
        return leavings(self.spec.nonlinearities, self.t, signals.q, signals.qhat, known)

    @cached_property
    def uncovered(self) -> str:
        """Why no bound can be stated, or nothing."""
        if self.guarantee is None:
            return "no guarantee: the gains are not certified"
        if self.acting.unmodeled:
            return self.acting.unmodeled
        if self.acting.noise.any():
            return "the guarantee does not cover simulation.noise, which no v generates"
        steps = (after for before, after in self.breaks if self.acting.steps_of_xm(before, after).any())
        if (impulse := next(steps, None)) is not None:
            return f"w jumps at t = {impulse:.6g}, so that the v that generates it is not {self.guarantee.signals}"
        return ""
