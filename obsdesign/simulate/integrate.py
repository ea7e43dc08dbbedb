"""Integration of a flow through its jumps: LSODA, and Radau where LSODA gives up.

A stretch between two measurements or samples of noise is short, and LSODA begins each at order 1 and takes most of its
time to begin; so a one-step method is tried first there, until the flow is found to be stiff.
"""

import warnings
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
import numpy.typing as npt

from obsdesign.records import dataclass, field, replace
from obsdesign.simulate.switches import RESOLUTION, Watch

if TYPE_CHECKING:
    from scipy.integrate import DOP853, LSODA, RK45, Radau

    RungeKutta = DOP853 | RK45
    Method = RungeKutta | LSODA | Radau

Vector = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Status = Literal["done", "stopped", "escape", "stall"]

FIRST, GROWN = 100, 10  # growth of the state that sets the tolerance anew: at first, and from then on
RESOLVED = 1e-14  # of the state: the least tolerance then, since f(xihat) - f(xi) has no more digits
HUGE = 1e8  # of the state against its size: an escape
GROWS = f"the state grows beyond {HUGE:.0e} times its size"
SMALL = "the steps have become too small"
RESTART = 100  # calls of the right-hand side that are as much work as an event
WINDOW = 20_000  # calls of the right-hand side in which
PACE = 1e-3  # of the rest of a segment must be crossed: else a stall
PATH = 20_000  # accepted steps that are kept
COARSE = 1e-6  # relative tolerance from which on order 5 takes fewer calls than order 8
EFFORT = 600  # calls of the right-hand side in one stretch: it is stiff, or long, and LSODA does better


@dataclass(frozen=True)
class Segment:
    """An interval in which the flow is smooth but for what it watches, how it begins, and its held inputs."""

    start: float
    stop: float
    enter: Callable[[Vector], Vector]  # from the state that the one before it ended with
    held: Vector


@dataclass(frozen=True)
class Flow:
    """The flow s' = rhs(t, s, held) with ds'/ds = jacobian(t, s, held).

    Outside their domain both are not finite, or raise ArithmeticError.
    """

    rhs: Callable[[float, Vector, Vector], Vector]
    jacobian: Callable[[float, Vector, Vector], Vector]
    watched: int  # the leading components of s that must stay bounded; the rest are integrals
    sizes: Vector | float = 1.0  # of these
    watch: Watch | None = None  # its jumps and kinks, but those between segments
    stopped: Callable[[float, Vector, Vector], str] = lambda *_: ""  # at (t, s, held): why the run ends, or nothing


@dataclass(frozen=True)
class Tolerance:
    """How much of each component a step may be wrong by: relative |s| + absolute."""

    relative: float
    absolute: Vector  # (ns,)


@dataclass(frozen=True)
class Trajectory:
    """States at the samples and at the accepted steps, up to where the integration got."""

    t: Vector  # (N,)
    s: Vector  # (N, ns)
    path_t: Vector  # (M,), start and accepted steps; thinned where there are more than 20,000
    path_s: Vector  # (M, ns)
    status: Status
    time: float  # where it ended
    reason: str  # of an end before the horizon

    def merged(self) -> tuple[Vector, Vector, Mask, Mask]:
        """Times and states of steps and samples together, in order, and which of them are steps, and samples."""
        t = np.concatenate((self.path_t, self.t))
        order = np.argsort(t, kind="stable")
        steps = order < len(self.path_t)
        return t[order], np.concatenate((self.path_s, self.s))[order], steps, ~steps


@dataclass
class Recorder:
    """Collects what a solver passes: samples by dense output, and its own steps."""

    samples: Vector
    t: list[float] = field(default_factory=list)
    s: list[Vector] = field(default_factory=list)
    path_t: list[float] = field(default_factory=list)
    path_s: list[Vector] = field(default_factory=list)
    stride: int = 1
    steps: int = 0

    def enter(self, t: float, s: Vector) -> None:
        """Begin a segment: samples up to t take the state after the jump."""
        if self.t and self.t[-1] == t:
            self.s[-1] = s
        while len(self.t) < len(self.samples) and self.samples[len(self.t)] <= t:
            self.t.append(float(self.samples[len(self.t)]))
            self.s.append(s)
        self.keep(t, s)

    def step(self, solver: "Method", t: float, s: Vector) -> None:
        """Take the samples inside the step that the solver has just made, as far as it counts: up to s at t."""
        first = len(self.t)
        last = int(np.searchsorted(self.samples, t, side="right"))
        if last > first:
            inside = self.samples[first:last]
            self.t += inside.tolist()
            self.s += list(solver.dense_output()(inside).T)
        self.keep(t, s)

    def keep(self, t: float, s: Vector) -> None:
        """Keep a step; when there are too many, every second one."""
        if self.steps % self.stride == 0:
            self.path_t.append(t)
            self.path_s.append(s)
        self.steps += 1
        if len(self.path_t) > PATH:
            del self.path_t[1::2], self.path_s[1::2]
            self.stride *= 2

    def trajectory(self, end: "End") -> Trajectory:
        """Everything recorded."""
        t, s, path_t, path_s = map(np.array, (self.t, self.s, self.path_t, self.path_s))
        return Trajectory(t, s, path_t, path_s, **vars(end))


@dataclass(frozen=True)
class End:
    """How the integration ended."""

    status: Status
    time: float
    reason: str = ""


def integrate(
    flow: Flow,
    start: Vector,
    segments: Iterable[Segment],
    samples: Vector,
    tolerance: Tolerance,
    progress: Callable[[float], None] | None = None,
    explicit: bool = False,
) -> Trajectory:
    """Follow the flow from `start`, the state (ns,) before the jump of the first segment, through the segments.

    LSODA takes each segment, in which the flow is smooth, restarted at its start; Radau takes over where LSODA fails or
    works too hard. Where segments are short, `explicit`, a one-step method goes before LSODA until the flow is stiff.
    The state is kept at the samples, increasing times (N,), and `progress` is called with the time reached.

    Returns
    -------
    Trajectory
        With status "escape" where the watched state grows beyond 1e8 times its size, or fast enough to be
        infinite within the resolution of time, "stopped" where the flow says so, and "stall" where neither method gets
        on.
    """
    s, end = start, End("done", float(samples[0]))
    recorder = Recorder(samples)
    crossing = Crossing(flow, tolerance, recorder, progress, explicit)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.filterwarnings("ignore", category=UserWarning, message="lsoda")
        for segment in segments:
            s, end = crossing.cross(segment, segment.enter(s))
            if end.status != "done":
                break
    return recorder.trajectory(end)


Attempt = Callable[[Segment, float, Vector], "Method"]  # at the segment, from t and s


@dataclass
class Crossing:
    """One attempt after the other at a segment."""

    flow: Flow
    tolerance: Tolerance
    recorder: Recorder
    progress: Callable[[float], None] | None
    explicit: bool = False
    calls: int = 0
    effort: int = 0  # calls of the explicit method in a stretch
    former: "RungeKutta | None" = None  # the explicit method before
    outgrown: float = FIRST  # size of the state that sets the tolerance anew

    def cross(self, segment: Segment, s: Vector) -> tuple[Vector, End]:
        """State at the end of the segment, or where it was left and why."""
        t, end, troubles = segment.start, End("done", segment.stop), list[str]()
        nothing = RESOLUTION * float(self.recorder.samples[-1])
        self.recorder.enter(t, s)
        if reason := self.flow.stopped(t, s, segment.held):
            return s, End("stopped", t, f"at t = {t:.6g}: {reason}")
        if self.explicit and segment.stop - t > nothing:
            t, s, end = self.follow(self.one_step, segment, t, s)
            if end.status != "stall":
                return s, end
            self.explicit, self.effort = False, 0
        for attempt in (self.lsoda, self.radau):
            if segment.stop - t <= nothing:
                break
            t, s, end = self.follow(attempt, segment, t, s)
            if end.status != "stall":
                break
            troubles.append(end.reason)
        if end.status == "stall":
            escape = self.exploding(t, s, segment)
            reason = "the state grows without bound" if escape else "; ".join(dict.fromkeys(troubles))
            end = End("escape" if escape else "stall", t, f"at t = {t:.6g}: {reason}")
        return s, end

    def follow(self, attempt: Attempt, segment: Segment, t: float, s: Vector) -> tuple[float, Vector, End]:
        """Step until the segment is crossed, the state escapes, or the method gives up."""
        calls, begin, trouble = self.calls, t, SMALL
        try:
            segment = self.entered(segment, t, s)
            solver = attempt(segment, t, s)
            while solver.status == "running":
                if solver.step():
                    return t, s, End("stall", t, trouble)
                event = self.flow.watch and self.flow.watch.event(solver, segment.held)
                t, s = (event.t, event.s) if event else (float(solver.t), solver.y)
                size = float(np.linalg.norm(s[: self.flow.watched] / self.flow.sizes))
                if not size < HUGE:
                    return t, s, End("escape", t, f"at t = {t:.6g}: {GROWS}")
                self.recorder.step(solver, t, s)
                if self.effort > EFFORT:
                    raise FloatingPointError("stiff")
                if reason := self.flow.stopped(t, s, segment.held):
                    return t, s, End("stopped", t, f"at t = {t:.6g}: {reason}")
                if self.progress is not None and self.recorder.steps % 100 == 0:
                    self.progress(t)
                if event:
                    segment, trouble = replace(segment, held=event.held), event.endless
                    self.calls += RESTART
                grown = size > self.outgrown
                if grown:
                    self.renew(size)
                if (grown or event) and t < segment.stop:
                    solver = attempt(segment, t, s)
                if self.calls > calls + WINDOW:
                    if t - begin < PACE * (segment.stop - begin):
                        return t, s, End("stall", t, trouble)
                    calls, begin, trouble = self.calls, t, SMALL
        except (ArithmeticError, ValueError) as error:  # Radau's solver takes no matrix that is not finite
            return t, s, End("stall", t, str(error))
        return t, s, End("done", t)

    def entered(self, segment: Segment, t: float, s: Vector) -> Segment:
        """Return a segment with the signs of an instant."""
        watch = self.flow.watch
        return replace(segment, held=watch.entered(t, s, segment.held)) if watch else segment

    def renew(self, size: float) -> None:
        """Set the tolerance for a state that has grown to this size."""
        absolute = self.tolerance.absolute.copy()
        absolute[: self.flow.watched] = np.maximum(absolute[: self.flow.watched], RESOLVED * size * self.flow.sizes)
        self.tolerance, self.outgrown = replace(self.tolerance, absolute=absolute), GROWN * size

    def one_step(self, segment: Segment, t: float, s: Vector) -> "RungeKutta":
        """Begin with the step of the segment before; give up after so many calls that the flow must be stiff."""
        from scipy.integrate import DOP853, RK45

        self.effort = 0

        def rhs(t: float, s: Vector) -> Vector:
            self.effort += 1
            return finite(self.flow.rhs(t, s, segment.held))

        rtol, atol = self.tolerance.relative, cast(float, self.tolerance.absolute)
        method = DOP853 if rtol < COARSE else RK45
        first = min(self.former.h_abs, segment.stop - t) if self.former else None
        self.former = method(cast("Any", rhs), t, s, segment.stop, first_step=first, rtol=rtol, atol=atol)
        return self.former

    def lsoda(self, segment: Segment, t: float, s: Vector) -> "LSODA":
        """LSODA cannot step back from a value that is not finite: the attempt ends there."""
        from scipy.integrate import LSODA

        def rhs(t: float, s: Vector) -> Vector:
            self.calls += 1
            return finite(self.flow.rhs(t, s, segment.held))

        rtol, atol = self.tolerance.relative, self.tolerance.absolute
        return LSODA(rhs, t, s, segment.stop, rtol=rtol, atol=atol, jac=self.jacobian(segment))

    def radau(self, segment: Segment, t: float, s: Vector) -> "Radau":
        """Radau halves a step in which a value is not finite."""
        from scipy.integrate import Radau

        def rhs(t: float, s: Vector) -> Vector:
            self.calls += 1
            try:
                return self.flow.rhs(t, s, segment.held)
            except ArithmeticError:
                return np.full_like(s, np.nan)

        first = min(1e-6 * (1 + abs(t)), segment.stop - t)
        rtol, atol = self.tolerance.relative, cast(float, self.tolerance.absolute)  # an array, say scipy's own types
        return Radau(rhs, t, s, segment.stop, rtol=rtol, atol=atol, jac=self.jacobian(segment), first_step=first)

    def jacobian(self, segment: Segment) -> Callable[[float, Vector], Vector]:
        """Jacobian of the flow in this segment."""
        return lambda t, s: finite(self.flow.jacobian(t, s, segment.held))

    def exploding(self, t: float, s: Vector, segment: Segment) -> bool:
        """Whether the state grows by a factor e within 1e-9 of the time that has passed."""
        try:
            held = self.entered(segment, t, s).held
            growth = finite(self.flow.rhs(t, s, held))[: self.flow.watched]
        except ArithmeticError:
            return False
        state = s[: self.flow.watched]
        return bool(state @ growth * max(t, 1e-300) > 1e9 * (state @ state))


def finite(values: Vector) -> Vector:
    """Return values if all are finite.

    Raises `FloatingPointError` if one is not.
    """
    if not np.isfinite(values).all():
        raise FloatingPointError("the model has no finite value")
    return values
