"""Nonlinear flows between measurements: a method of order 8 while they are not stiff, LSODA from then on.

A stretch between two measurements is short, and LSODA, which begins each at order 1, makes about twice as many calls.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from obsdesign.simulate.hybrid.sampling import Stretch
from obsdesign.simulate.hybrid.system import Hybrid
from obsdesign.simulate.integrate import (
    HUGE,
    Attempt,
    Crossing,
    End,
    Recorder,
    Segment,
    Tolerance,
    Trajectory,
    Vector,
    finite,
)

if TYPE_CHECKING:
    from scipy.integrate import LSODA

EFFORT = 600  # calls of the right-hand side in one stretch: it is stiff, or long, and LSODA does better
RTOL = 1e-8
RTOL_NOISE = 1e-6  # more digits would be digits of the noise
ATOL = 1e-12  # of the size of a state at the start


def integrate(
    system: Hybrid,
    start: Vector,
    stretches: Sequence[Stretch],
    samples: Vector,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Follow the flow and its jumps through all stretches.

    Returns
    -------
    Trajectory
        As `obsdesign.simulate.integrate.integrate` gives it; a sample at a jump takes the state after it.
    """
    s, end, still = start, End("done", 0.0), np.zeros(0)
    recorder = Recorder(samples)
    limit = HUGE * max(1.0, float(np.linalg.norm(start[: system.end])))
    explicit = True
    crossing = Crossing(system.flow(), tolerance(system, start), recorder, limit, progress)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.filterwarnings("ignore", category=UserWarning, message="lsoda")
        for stretch in stretches:
            if stretch.measured:
                s = system.reset(stretch.start, s)
                if recorder.t and recorder.t[-1] == stretch.start:
                    recorder.s[-1] = s
            segment = Segment(stretch.start, stretch.stop, still, still)
            if explicit:
                recorder.enter(segment.start, s)
                t, s, end = crossing.follow(dop853(crossing), segment, segment.start, s)
                explicit = end.status != "stall"
                segment = replace(segment, start=t)
            if not explicit:
                s, end = crossing.cross(segment, s)
            if end.status != "done":
                break
    return recorder.trajectory(len(start), end)


def dop853(crossing: Crossing) -> Attempt:
    """Attempt that gives up after so many calls that the flow must be stiff."""

    def attempt(segment: Segment, t: float, s: Vector) -> "LSODA":
        from scipy.integrate import DOP853

        effort = 0

        def rhs(t: float, s: Vector) -> Vector:
            nonlocal effort
            effort += 1
            if effort > EFFORT:
                raise FloatingPointError("stiff")
            return finite(crossing.flow.rhs(t, s, segment.held))

        rtol, atol = crossing.tolerance.relative, cast(float, crossing.tolerance.absolute)
        return cast("LSODA", DOP853(rhs, t, s, segment.stop, rtol=rtol, atol=atol))  # any solver steps alike

    return attempt


def tolerance(system: Hybrid, start: Vector) -> Tolerance:
    """Tolerance of a step; the absolute one goes by the size of each state and its error at the start."""
    n, ny, end = system.n, system.ny, system.end
    state = np.maximum(np.abs(start[:n]), np.abs(start[n : 2 * n]))
    nonzero = state[state > 0]
    state[state == 0] = nonzero.min() if len(nonzero) else 1.0
    size = np.concatenate((state, state, np.full(ny, state.max()), np.full(len(start) - end, state.max() ** 2)))
    return Tolerance(RTOL_NOISE if system.noise.any() else RTOL, ATOL * size)
