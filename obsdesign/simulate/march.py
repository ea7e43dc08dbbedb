"""A run through many short stretches, as between the rows of a file: steps of exponential collocation in each.

    s' = J s + N(t, s)

The step is that of `collocation`, so that a stiff observer costs no more than another; it is halved where it is too
long. For that N at its start is held against the polynomial through N at its nodes: h/16 |N(0) - sum_j l_j(0) N_j|,
which is what a cubic part of N adds to s within the step at most, for J = 0, must be below the tolerance.
"""

from collections.abc import Callable, Sequence

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.simulate.collocation import LAGRANGE, NODES, SLOW, SMALL, Step, Steps
from obsdesign.simulate.integrate import HUGE, PATH, Tolerance, Trajectory, Vector
from obsdesign.simulate.scenario import Stretch
from obsdesign.simulate.sizes import sizes
from obsdesign.simulate.system import System

SHARE = 1 / 16  # of c1 c2 c3: the largest integral of (s - c1) (s - c2) (s - c3) over [0, x], x in [0, 1]
AT_START = LAGRANGE[:, 0]  # l_j(0)
ROOM = 1 / 64  # of the tolerance: below, the next step is twice as long
EFFORT = 20, 2000  # steps for each stretch, and as many more: a flow that needs more is left to LSODA
TOLD = 1000  # stretches between two reports of progress


class March:
    """The steps of one run."""

    def __init__(self, system: System, tolerance: Tolerance, samples: Vector, most: int) -> None:
        self.most = most  # steps that are tried
        self.system, self.tolerance, self.samples, self.program = system, tolerance, samples, system.smooth
        self.m = system.width
        self.absolute = tolerance.absolute[: self.m]
        self.X = np.ones((len(self.program.slots), 1 + len(NODES)))
        self.level, self.slow = 0, True  # halvings of a stretch; whether the iteration asks for another J
        self.steps = Steps(self.m)
        self.sampled, self.path_t, self.path_s = list[Vector](), list[float](), list[Vector]()
        self.stride, self.kept, self.tried = 1, 0, 0

    def cross(self, stretch: Stretch, s: Vector) -> Vector:
        """State at the end of a stretch, from its start on. Raises `ArithmeticError` where steps are too many."""
        held, length, k = self.system.held(stretch), stretch.stop - stretch.start, 0
        self.X[2 + self.m : len(self.program.inputs)] = held[:, None]
        self.keep(stretch.start, s)
        while k < 2**self.level and length > 0:
            h = length / 2**self.level
            t, self.tried = stretch.start + k * h, self.tried + 1
            try:
                new, wrong = self.step(t, h, s, held)
            except ArithmeticError:
                new, wrong = s, np.inf
                self.slow = True
            if self.tried > self.most:
                raise FloatingPointError("the steps are too many")
            if not wrong <= 1:
                self.level, k = self.level + 1, 2 * k
                continue
            s, k = new, k + 1
            self.keep(t + h if k < 2**self.level else stretch.stop, s)
            if wrong < ROOM and k % 2 == 0 and self.level:
                self.level, k = self.level - 1, k // 2
        return s

    def step(self, t: float, h: float, s: Vector, held: Vector) -> tuple[Vector, float]:
        """State after a step, and how much of the tolerance its error may be; samples within it are taken."""
        if self.slow:
            self.steps.renew(self.system.jacobian(t, s, held)[: self.m, : self.m])
        made, m, X = self.steps.of(h), self.m, self.X
        X[1], X[2 : 2 + m, 0] = t + h * np.append(0.0, NODES), s[:m]

        def rates(at: Float) -> Float:
            X[2 : 2 + m, 1:] = at[..., 0]
            self.fill()
            return X[self.system.rates, 1:, None]

        end, _, N, count = made.advance(s[:m, None], rates, self.absolute / SMALL)
        self.slow = count >= SLOW
        left_out = X[self.system.rates, 0] - self.steps.J @ s[:m] - N[..., 0] @ AT_START
        new = np.concatenate((end[:, 0], s[m:]))
        scale = self.tolerance.relative * np.maximum(np.abs(s[:m]), np.abs(new[:m])) + self.absolute
        wrong = float((SHARE * h * np.abs(left_out) / scale).max())
        if wrong <= 1:
            self.take(t, h, s, made, N)
        return new, wrong

    def fill(self) -> None:
        """Compute the slots of X from its inputs."""
        if not self.program.loops:
            for group in self.program.groups:
                group.fill(self.X)
            return
        inputs = len(self.program.inputs)
        for column in self.X.T:
            column[:] = self.program.run(column[1], column[2:inputs], column[:0])

    def take(self, t: float, h: float, s: Vector, made: Step, N: Float) -> None:
        """Take the samples in [t, t + h)."""
        last = int(np.searchsorted(self.samples, t + h))
        for at in self.samples[len(self.sampled) : last]:
            part = (at - t) / h
            inside = made.between(s[: self.m, None], N, h, part)[:, 0] if part > 0 else s[: self.m]
            self.sampled.append(np.concatenate((inside, s[self.m :])))

    def keep(self, t: float, s: Vector) -> None:
        """Keep a state; when there are too many, every second one."""
        if self.kept % self.stride == 0:
            self.path_t.append(t)
            self.path_s.append(s)
        self.kept += 1
        if len(self.path_t) > PATH:
            del self.path_t[1::2], self.path_s[1::2]
            self.stride *= 2


def march(
    system: System,
    start: Vector,
    stretches: Sequence[Stretch],
    samples: Vector,
    tolerance: Tolerance,
    progress: Callable[[float], None] | None = None,
) -> Trajectory | None:
    """Trajectory to the horizon, its state at samples (N,); None of a flow that is not smooth in a stretch, or escapes.

    Then an integrator that looks at events tells why. Raises nothing.
    """
    if system.deciding or system.scenario.events:
        return None
    most = EFFORT[0] * len(stretches) + EFFORT[1]
    made, s, bounds = March(system, tolerance, samples, most), start, sizes(system, start)
    try:
        with np.errstate(all="ignore"):
            for k, stretch in enumerate(stretches):
                s = made.cross(stretch, system.enter(stretch, s))
                if not float(np.linalg.norm(s[: system.end] / bounds)) < HUGE:
                    return None
                if progress is not None and k % TOLD == 0:
                    progress(stretch.start)
    except ArithmeticError:
        return None
    made.sampled += [s] * (len(samples) - len(made.sampled))
    path = np.array(made.path_t), np.array(made.path_s)
    return Trajectory(samples, np.array(made.sampled), *path, "done", stretches[-1].stop, "")
