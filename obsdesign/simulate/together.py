"""Runs of one plant and observer that differ by where they start and by their noise, in steps that all share.

    s_k' = J s_k + N(t, s_k, n_k),    k = 1, .., S

The step is that of `collocation`, with one J for all runs, so that a stiff observer costs no more than another; how
wrong a step is, is asked as in `march`, of the run for which it is most. Kinks are not located: a step that holds one
is wrong, and is halved. What does not go this way, each run goes by itself.
"""

from collections.abc import Sequence

import numpy as np

from obsdesign.lmi.formula import Array, Float
from obsdesign.simulate.collocation import NODES, SLOW, SMALL, Step, Steps
from obsdesign.simulate.definitions import rate
from obsdesign.simulate.integrate import HUGE, Trajectory, Vector
from obsdesign.simulate.march import AT_START, ROOM, SHARE
from obsdesign.simulate.program import Program
from obsdesign.simulate.scenario import Stretch
from obsdesign.simulate.simulation import tolerance
from obsdesign.simulate.sizes import sizes
from obsdesign.simulate.system import INTEGRALS, System

ACCURATE = 1e-6  # of the largest of a state in all runs: the error of a step
WORN = 2  # iterations more than with a new J, from which on it is renewed: the runs differ, whatever J is
EFFORT = 40, 20_000  # steps for each stretch, and as many more
SHORTEST = 1e-11  # of the horizon: a step that has to be shorter is that of a run that escapes, or slides
MOST = 30_000_000  # samples of noise that are held
PATH = 4000  # steps that are kept


def applies(system: System) -> bool:
    """Whether runs of a system may go together: in continuous time, with y known at all times, and no event."""
    return not (system.scenario.clock or system.observer.jump or system.scenario.events or system.program.loops)


def together(systems: Sequence[System], starts: Sequence[Vector], samples: Vector) -> list[Trajectory | None]:
    """Trajectories of runs whose systems differ by their noise alone, from their starts, at samples (N,).

    None of a run that grows beyond bounds, and of all where steps do not become accurate: these go by themselves.
    """
    nothing: list[Trajectory | None] = [None] * len(systems)
    noise = systems[0].scenario.noise
    if not applies(systems[0]) or noise.size * len(systems) > MOST:
        return nothing
    made = Together(systems, starts, samples)
    try:
        with np.errstate(all="ignore"):
            for stretch in systems[0].scenario.stretches(systems[0].breaks()):
                made.cross(stretch)
                if not len(made.alive):
                    return nothing
    except ArithmeticError:
        return nothing
    return made.trajectories()


class Together:
    """The steps of some runs."""

    def __init__(self, systems: Sequence[System], starts: Sequence[Vector], samples: Vector) -> None:
        self.system = system = systems[0]
        self.samples, self.m, self.count = samples, system.width, len(systems)
        rates = [rate(name) for name in (*system.flowing, *INTEGRALS)]
        self.program = Program(system.program.inputs[1:], system.program.definitions, rates)
        self.rates = self.program.places(rates)
        self.noise = np.stack([one.scenario.noise for one in systems], axis=-1)  # (K, ny, S)
        self.alive = np.arange(self.count)
        self.s = np.array(starts).T[: self.m]  # (m, S)
        self.bounds = np.array([sizes(one, start) for one, start in zip(systems, starts, strict=True)]).T
        allowed = [tolerance(start, one).absolute[: self.m] for one, start in zip(systems, starts, strict=True)]
        self.absolute = np.max(allowed, axis=0)
        self.reserve()
        self.level, self.tried, self.allowed = 0, 0, EFFORT[1]
        self.slow, self.fresh = True, 0  # whether J is to be renewed; iterations of a step right after that
        self.steps = Steps(self.m)
        self.sampled, self.path_t, self.path_s = list[Float](), list[float](), list[Float]()
        self.stride, self.kept, self.held = 1, 0, np.zeros((0, self.count))

    def reserve(self) -> None:
        """Room for the slots of all runs, at the start and at the nodes of a step."""
        self.X = np.ones((len(self.program.slots), 1 + len(NODES), len(self.alive)))

    def cross(self, stretch: Stretch) -> None:
        """Follow all runs through a stretch. Raises `ArithmeticError` where steps are too many."""
        length, k = stretch.stop - stretch.start, 0
        end = len(self.system.integrated) + len(self.system.copied)
        self.s[end - len(stretch.step) : end] -= stretch.step[:, None]
        self.hold(stretch)
        self.keep(stretch.start)
        self.allowed += EFFORT[0]
        while k < 2**self.level and length > 0:
            h = length / 2**self.level
            t, self.tried = stretch.start + k * h, self.tried + 1
            try:
                new, wrong = self.step(t, h)
            except ArithmeticError:
                new, wrong, self.slow = self.s, np.inf, True
            if self.tried > self.allowed:
                raise FloatingPointError("the steps are too many")
            if not wrong <= 1:
                self.level, k = self.level + 1, 2 * k
                if h < SHORTEST * self.samples[-1]:
                    self.let_go(self.size() < self.size().max())
                if not len(self.alive):
                    return
                continue
            self.s, k = new, k + 1
            if not (fine := self.size() < HUGE).all():
                self.let_go(fine)
            if not len(self.alive):
                return
            self.keep(t + h if k < 2**self.level else stretch.stop)
            if wrong < ROOM and k % 2 == 0 and self.level:
                self.level, k = self.level - 1, k // 2

    def hold(self, stretch: Stretch) -> None:
        """Inputs of the program that are held over a stretch: noise of each run, and rows of files."""
        middle = 0.5 * (stretch.start + stretch.stop)
        acting = self.system.scenario
        tick = min(int(middle / acting.period), len(self.noise) - 1)
        noises = self.noise[tick][: len(self.system.silent), self.alive]
        known = self.system.given(middle, np.zeros(len(self.system.silent)))[len(self.system.silent) :]
        self.held = np.concatenate((noises, np.repeat(known[:, None], len(self.alive), axis=1)))
        self.X[2 + self.m : len(self.program.inputs)] = self.held[:, None]

    def step(self, t: float, h: float) -> tuple[Float, float]:
        """States after a step, and how much of the tolerance the largest error may be; samples within it are taken."""
        if self.slow:
            self.renew(t)
        made, m, X, s = self.steps.of(h), self.m, self.X, self.s
        X[1], X[2 : 2 + m, 0] = (t + h * np.append(0.0, NODES))[:, None], s

        def rates(at: Float) -> Float:
            X[2 : 2 + m, 1:] = at
            flat = X.reshape(len(X), -1)
            for group in self.program.groups:
                group.fill(flat)
            return X[self.rates, 1:]

        new, _, N, iterations = made.advance(s, rates, self.absolute / SMALL)
        self.fresh = iterations if self.slow else self.fresh
        self.slow = iterations >= max(SLOW, self.fresh + WORN)
        left_out = X[self.rates, 0] - self.steps.J @ s - np.einsum("inS,n->iS", N, AT_START)
        scale = ACCURATE * np.maximum(np.abs(s), np.abs(new)).max(axis=1) + self.absolute
        wrong = float((SHARE * h * np.abs(left_out).max(axis=1) / scale).max())
        if wrong <= 1:
            self.take(t, h, made, N)
        return new, wrong

    def renew(self, t: float) -> None:
        """Take the Jacobian anew, at the mean of all runs."""
        X = self.program.run(t, self.s.mean(axis=1), self.held.mean(axis=1))
        self.steps.renew(self.program.derivatives(X, self.program.inputs[2 : 2 + self.m])[self.rates])

    def size(self) -> Float:
        """Size of the state of each run, as `integrate` has it."""
        return np.asarray(np.linalg.norm(self.s[: self.system.end] / self.bounds, axis=0))

    def let_go(self, fine: Array) -> None:
        """Keep some of the runs, by a mask: the others go by themselves."""
        self.alive, self.s = self.alive[fine], self.s[:, fine]
        self.bounds, self.held = self.bounds[:, fine], self.held[:, fine]
        for kept in (self.sampled, self.path_s):
            kept[:] = [states[:, fine] for states in kept]
        self.reserve()
        self.X[2 + self.m : len(self.program.inputs)] = self.held[:, None]

    def take(self, t: float, h: float, made: Step, N: Float) -> None:
        """Take the samples in [t, t + h)."""
        last = int(np.searchsorted(self.samples, t + h))
        for at in self.samples[len(self.sampled) : last]:
            part = (at - t) / h
            self.sampled.append(made.between(self.s, N, h, part) if part > 0 else self.s)

    def keep(self, t: float) -> None:
        """Keep the states; when there are too many, every second one."""
        if self.kept % self.stride == 0:
            self.path_t.append(t)
            self.path_s.append(self.s)
        self.kept += 1
        if len(self.path_t) > PATH:
            del self.path_t[1::2], self.path_s[1::2]
            self.stride *= 2

    def trajectories(self) -> list[Trajectory | None]:
        """Trajectory of each run; None of those that were let go."""
        found: list[Trajectory | None] = [None] * self.count
        self.sampled += [self.s] * (len(self.samples) - len(self.sampled))
        samples, path, t = np.array(self.sampled), np.array(self.path_s), np.array(self.path_t)
        for column, k in enumerate(self.alive):
            states: Array = samples[:, :, column]
            found[k] = Trajectory(self.samples, states, t, path[:, :, column], "done", float(self.samples[-1]), "")
        return found
