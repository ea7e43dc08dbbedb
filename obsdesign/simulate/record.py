"""A finished integration in the terms of the spec."""

from collections.abc import Sequence
from functools import cached_property
from typing import cast

import numpy as np

from obsdesign.families.guarantee import ESTIMATES, Course, Measurements, SampledGuarantee, envelope
from obsdesign.lmi.formula import Array
from obsdesign.simulate.definitions import error, mismatch, rate
from obsdesign.simulate.integrate import Trajectory
from obsdesign.simulate.run import Samples
from obsdesign.simulate.system import INTEGRALS, System, Table
from obsdesign.simulate.validity import Arguments, Leaving, leavings
from obsdesign.spec import Spec

UNPROVED = "no guarantee: nothing is proved of these gains with this plant"
LOST = {"escape": "escaped", "stall": "stalled"}  # what a run did that came to no end, by its status


class Record:
    """Signals and errors of a run, at the samples and at the steps of the integrator together.

    An instant at which the model has no value, as at the end of a run that stalled, is left out. The breaks are those
    of `System.breaks`. `foreign`: why nothing is proved with this plant; empty: it is that of the design.
    """

    def __init__(
        self,
        spec: Spec,
        system: System,
        breaks: Sequence[tuple[float, float]],
        trajectory: Trajectory,
        foreign: str = "",
    ) -> None:
        self.foreign = foreign
        self.spec, self.system, self.breaks, self.trajectory = spec, system, breaks, trajectory
        self.acting, self.guarantee, self.schedule = system.scenario, system.guarantee, system.scenario.schedule
        t, s, steps, samples = trajectory.merged()
        with np.errstate(all="ignore"):
            now = system.table(t, s)
        defined = now.defined & np.isfinite(s).all(axis=1)
        self.t, self.s, self.now = t[defined], s[defined], now.rows(defined)
        self._steps, self._samples = steps[defined], samples[defined]

    def at_steps(self) -> Samples:
        """Return the signals at the start and the accepted steps."""
        return self.signals.rows(self._steps)

    def at_samples(self) -> Samples:
        """Return the signals at the samples."""
        return self.signals.rows(self._samples)

    @property
    def errors(self) -> Array:
        """Errors of all estimates of states, (M, n + nm), also of those that have no true value."""
        return self.now.of(map(error, self.acting.plant.states))

    @cached_property
    def e(self) -> Array:
        """Error; without a true xm only that of the plant's states."""
        return self.errors[:, : self.acting.n] if self.acting.unmodeled else self.errors

    @property
    def z(self) -> Array:
        """Return H e, of what e there is."""
        return np.asarray(self.e @ self.system.H[:, : self.e.shape[1]].T)

    @property
    def v(self) -> Array:
        """What drives the plant, (M, nv)."""
        return self.now.of(self.acting.plant.exogenous)

    @cached_property
    def j(self) -> Array:
        """Number of measurements received, (M,)."""
        if self.schedule is None:
            return np.zeros(len(self.t), dtype=int)
        return np.asarray(np.rint(self.s[:, self.system.width]), dtype=int)

    @cached_property
    def course(self) -> Course:
        """Error and integrals, and what the measurements do to them."""
        up_to = self.system.accumulated(self.t, self.s, self.now, self.breaks)
        b, at = up_to.b, self.measurements
        if at and not np.isfinite(self.system.kicks).all():
            b = np.where(np.isfinite(at.added), b, np.inf)
        z, drive = np.linalg.norm(self.z, axis=1), self.spec.observer.drive
        inner = self.now.of(self.system.followed) if self.system.followed else None
        return Course(self.t, self.e, z, up_to.z2, up_to.v2, up_to.v_sup, b, drive, at, up_to.v, inner)

    @cached_property
    def measurements(self) -> Measurements | None:
        """What the measurements do to the error; None where y is known at all times."""
        schedule, eta = self.schedule, self.acting.eta
        if schedule is None or eta is None:
            return None
        eta_sup = np.maximum.accumulate(np.append(0.0, np.linalg.norm(eta, axis=1)))
        added = np.cumsum(np.append(0.0, self.system.kicks))
        missing = self.now.of(map(mismatch, self.system.corrections))
        clocks = schedule.timer(self.t, self.j), schedule.elapsed(self.t, self.j)
        return Measurements(missing, *clocks, eta_sup[self.j], added[self.j], schedule.crowded)

    @cached_property
    def signals(self) -> Samples:
        """States of the flow in the terms of the spec; V only where the guarantee covers the run."""
        acting, plant = self.acting, self.acting.plant
        xi, w = self.now.of(plant.states), self.now.of(acting.w)
        wanted = [w for w in acting.w if w in self.system.estimated.values()]
        w_error = self.now.of(map(error, wanted))
        guarantee, at = self.guarantee, self.measurements
        V = guarantee.storage(self.course) if guarantee and not self.uncovered else None
        bound = None if V is None or guarantee is None else envelope(guarantee, self.course, V)
        return Samples(
            t=self.t,
            xi=xi[:, : self.e.shape[1]],
            xihat=xi + self.errors,
            e=self.e,
            w=w,
            what=self.now.of(wanted) + w_error,
            w_error=w_error,
            q=self.now.of(plant.algebraic),
            qhat=self.now.of(self.copies),
            u=self.now.of(plant.inputs),
            y=self.s[:, self.system.width + 1 :] if at else self.now.of(self.system.seen),
            y_true=self.now.of(acting.outputs),
            theta=self.now.of(self.system.further),
            v=None if acting.unmodeled else self.v,
            z=self.z if self.has_z else None,
            V=V,
            V_bound=bound,
            j=self.j,
            timer=at.timer if at else np.full(len(self.t), np.inf),
            distance=np.linalg.norm(np.hstack([self.e, at.mismatch]) if at else self.e, axis=1),
            distance_bound=None
            if not at or bound is None
            else cast("SampledGuarantee", guarantee).distance_bound(bound),
        )

    @property
    def copies(self) -> list[str]:
        """Names of the arguments of f in the observer."""
        hats = {twin: hat for hat, twin in self.system.observer.twins.items()}
        return [hats.get(name, name) for name in self.acting.plant.algebraic]

    @property
    def estimated(self) -> tuple[int, ...]:
        """Channels of w that the observer estimates."""
        return tuple(i for i, name in enumerate(self.acting.inputs) if name in self.system.estimated)

    @property
    def has_z(self) -> bool:
        """Whether z = H e has a true value: not if it needs an xm that has none."""
        return not (self.acting.unmodeled and (self.system.H[:, self.acting.n :] != 0).any())

    @cached_property
    def left(self) -> tuple[Leaving, ...]:
        """First leavings of the regions on which the declared types hold."""
        between = self.between if self.acting.clock is None else None
        return leavings(self.spec.nonlinearities, self.arguments(self.t, self.now), between)

    def arguments(self, t: Array, now: Table) -> Arguments:
        """Arguments of f at instants."""
        names = ("t", *self.acting.outputs, *self.spec.inputs)
        known = dict(zip(names, now.of(names).T, strict=True))
        return Arguments(t, now.of(self.acting.plant.algebraic), now.of(self.copies), known)

    def between(self, k: int, shares: Array) -> Arguments:
        """Arguments of f between instants k - 1 and k, where the state is the cubic with its rates at both."""
        two, names = slice(k - 1, k + 1), (*self.system.flowing, *INTEGRALS)
        h, p = self.t[k] - self.t[k - 1], shares[:, None]
        (begin, end), (leaves, arrives) = self.s[two, : self.system.width], h * self.now.of(map(rate, names))[two]
        bent = (1 - p) * (leaves - (end - begin)) + p * ((end - begin) - arrives)
        t, s = self.t[k - 1] + h * shares, begin + p * (end - begin) + p * (1 - p) * bent
        with np.errstate(all="ignore"):
            return self.arguments(t, self.system.table(t, s))

    @property
    def until(self) -> float:
        """Time from which on a guarantee says nothing: a measurement is overdue, or the run has left the region."""
        overdue = self.schedule.until if self.schedule else np.inf
        return min([overdue, *(leaving.time for leaving in self.left)])

    @property
    def cut(self) -> tuple[float, str]:
        """Time up to which bounds are checked, and what the run did then; infinite: they are to its end."""
        end, status = self.trajectory.time, self.trajectory.status
        overdue = self.schedule.until if self.schedule else np.inf
        found = [(leaving.time, "left the region") for leaving in self.left]
        found += [(overdue, "left the intervals between measurements")]
        found += [(end, LOST[status])] if status in LOST else []
        return min([one for one in found if one[0] <= end], default=(np.inf, ""), key=lambda one: one[0])

    @cached_property
    def uncovered(self) -> str:
        """Why no bound can be stated, or nothing."""
        return self.foreign or self.uncheckable

    @cached_property
    def uncheckable(self) -> str:
        """Why no bound has a value, or nothing."""
        if self.guarantee is None and self.system.observer.proved:
            return f"{ESTIMATES} is how it estimates without disturbance and noise, with no bound"
        if self.guarantee is None:
            return UNPROVED
        if self.acting.unmodeled:
            return self.acting.unmodeled
        if self.acting.noise.any() and not self.acting.noises:
            return "the guarantee does not cover simulation.noise"
        if self.impulse is not None:
            return f"w jumps at t = {self.impulse:.6g}, so that the v that generates it is not {self.guarantee.signals}"
        return ""

    @cached_property
    def impulse(self) -> float | None:
        """First instant at which w jumps and its disturbance model does not: v is no function there."""
        steps = (before for before, after in self.breaks if self.acting.steps_of_xm(before, after).any())
        return next(steps, None)
