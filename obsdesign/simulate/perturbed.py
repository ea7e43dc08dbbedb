"""A single run with noise that is held over many short periods, from the run without noise and what the noise adds."""

from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import numpy as np

from obsdesign.families.guarantee import Guarantee, Rates
from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import Float
from obsdesign.simulate.collocation import NODES, WEIGHTS
from obsdesign.simulate.ensemble import MOST_STEPS, Passage
from obsdesign.simulate.integrate import PATH, Trajectory
from obsdesign.simulate.perturbation import Interval, Perturbation
from obsdesign.simulate.simulation import MANY, along_rows
from obsdesign.simulate.system import System
from obsdesign.spec import Spec


def applies(system: System) -> bool:
    """Whether noise is held over many periods, not along many rows, and no event, jump or kink depends on states."""
    acting = system.scenario
    short = acting.noisy and len(acting.noise) > MANY and acting.clock is None and not along_rows(system)
    return short and not (system.observer.jump or acting.events or system.deciding) and system.constant() is None


def perturbed(spec: Spec, observer: Observer, guarantee: Guarantee | None, samples: Float) -> Trajectory | None:
    """Trajectory of a run with noise, its state at samples (N,); None where steps do not become accurate."""
    assert spec.simulation
    added, parts = Perturbation(spec, observer, (spec.simulation.seed,), guarantee), 1
    while parts * len(added.intervals) <= MOST_STEPS:
        path = Path(added, [step for one in added.intervals for step in one.parts(parts)], samples)
        if path.reference.end < spec.simulation.horizon:
            return None
        if path.follow():
            return path.trajectory()
        parts *= 2
    return None


class Path(Passage):
    """A passage of one run, with its states at samples and at the nodes."""

    def __init__(self, added: Perturbation, steps: Sequence[Interval], samples: Float) -> None:
        super().__init__(added, steps, (0.0, np.inf), samples)
        self.samples, self.sampled = samples, list[Float]()
        self.path_t, self.path_d, self.energy = list[Float](), list[Float](), list[Float]()
        self.before, self.z2 = self.d, 0.0

    def begin(self) -> None:
        """Start."""
        super().begin()
        self.before = self.d

    def keep(self, step: Interval, at: Float, found: Float) -> None:
        """Keep what is added to the state at the start and at the nodes, and the integral of |z|^2 up to there."""
        m, n, w = len(self.d), self.added.acting.n, len(self.added.names)
        errors = found[..., 0] + self.reference.values[m:, self.reference.places(step.nodes)]
        z = self.added.noisy.H @ np.concatenate((errors[:n], errors[w:]))
        more = step.length * float(WEIGHTS @ (z**2).sum(axis=0))
        self.path_t.append(np.append(step.start, step.nodes))
        self.path_d.append(np.hstack([self.before, at[..., 0]]))
        self.energy.append(self.z2 + more * np.append(0.0, NODES))
        while len(self.sampled) < len(self.samples) and self.samples[len(self.sampled)] < step.start + step.length:
            part = (self.samples[len(self.sampled)] - step.start) / step.length
            self.sampled.append(self.inside(step, at, part))
        self.before, self.z2 = self.d, self.z2 + more

    def inside(self, step: Interval, at: Float, part: float) -> Float:
        """What is added after a part of a step, by its collocation, or by a line where there is none."""
        if part <= 0:
            return self.before
        if self.N is not None:
            return self.matrices(step.length).between(self.before, self.N, step.length, part)
        known = np.hstack([self.before, at[..., 0], self.d])
        return np.array([[np.interp(part, [0.0, *NODES, 1.0], row)] for row in known])

    def trajectory(self) -> Trajectory:
        """States at the samples and at the steps."""
        system, last = self.added.noisy, self.steps[-1]
        self.sampled += [self.d] * (len(self.samples) - len(self.sampled))
        t = np.append(np.concatenate(self.path_t), last.start + last.length)
        energy = np.append(np.concatenate(self.energy), self.z2)
        path, samples = self.states(t, [*self.path_d, self.d]), self.states(self.samples, self.sampled)
        path[:, system.end], samples[:, system.end] = energy, np.interp(self.samples, t, energy)
        path[:, system.end + 1 : system.end + 3] += self.driven(t)
        samples[:, system.end + 1 : system.end + 3] += self.driven(self.samples)
        kept = slice(None, None, -(-len(t) // PATH))
        return Trajectory(self.samples, samples, t[kept], path[kept], "done", float(self.samples[-1]), "")

    def driven(self, t: Float) -> Float:
        """What noise in v adds to the integral of |v|^2, and to b of b' = -2 alpha b + c |v|^2, by instants, (N, 2)."""
        system, acting = self.added.noisy, self.added.acting
        rates = system.guarantee.rates() if system.guarantee else Rates(0.0, 0.0)
        power = np.zeros(len(acting.noise))  # |n|^2 in each period
        for output, number in acting.noises.values():
            power += (acting.noise[:, acting.outputs.index(output)] / float(number)) ** 2
        v2, b = (response(power, acting.period, t, alpha) for alpha in (0.0, rates.alpha))
        return np.stack([v2, rates.c * b], axis=1)

    def states(self, t: Float, added: Sequence[Float]) -> Float:
        """States (N, width) of the run without noise at instants, and what is added to them."""
        system = self.added.noisy
        s = self.reference.s[self.reference.places(t)].copy()
        s[:, [system.flowing.index(name) for name in self.added.moving]] += np.hstack(added).T
        return s


def response(power: Float, h: float, t: Float, alpha: float) -> Float:
    """Solution of b' = -2 alpha b + p from b(0) = 0 at instants (N,), with p (K,) constant over each period h."""

    def moved(b: Any, p: Any, after: Any) -> Any:
        share = -np.expm1(-2 * alpha * after) / (2 * alpha) if alpha else after
        return b * np.exp(-2 * alpha * after) + p * share

    begins = np.array([*accumulate(power, lambda b, p: moved(b, p, h), initial=0.0)])
    k = np.minimum(t // h, len(power) - 1).astype(int)
    return np.asarray(moved(begins[k], power[k], t - k * h))
