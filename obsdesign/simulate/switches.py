"""Jumps and kinks: the functions at whose zeros they are, and all zeros of those of time alone.

Within a stretch between two zeros the sign of each function is held, so that what is integrated is smooth.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression, Interval
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass, field
from obsdesign.simulate.program import Definition

CELLS, PARTS = 256, 4  # intervals of time at first; parts of one in which a sign is open
MOST = 100_000  # intervals in which a sign is open: as many changes of it, or nothing that can be told
RESOLUTION = 2.0**-52  # of the horizon: events that are closer are one
LOOKS = 4  # instants in a step at which signs are looked at

Break = tuple[float, float]  # the last double before an event and the first after it


@dataclass
class Switches:
    """The signs, held, that decide the jumps and kinks of terms."""

    timed: dict[str, Expression] = field(default_factory=dict)  # by the name of its sign: a function of t alone
    others: dict[str, Expression] = field(default_factory=dict)  # of the states too
    smooth: dict[str, Expression] = field(default_factory=dict)  # these, with their own jumps and kinks decided

    def decided(self, side: Definition) -> Definition:
        """Definition without jumps and kinks, in the signs."""
        return side.decided(self.sign) if isinstance(side, Expression) else side

    def sign(self, g: Expression, smooth: Expression) -> Expression:
        """Sign of a switching function, by name."""
        if not g.names:
            return Expression.number(int(np.sign(g.scalar([])())))
        name = f"sign of {g.text}"
        (self.timed if g.names == {"t"} else self.others)[name] = g
        if g.names != {"t"}:
            self.smooth[name] = smooth
        return Expression.variable(name)

    def at(self, t: float) -> Float:
        """Signs of the functions of time alone."""
        return np.sign([g.scalar(["t"])(t) for g in self.timed.values()])

    def breaks(self, horizon: float) -> list[Break]:
        """Events at times that are known before the run, in order."""
        found: set[Break] = set()
        for g in self.timed.values():  # after those in it
            edges = np.unique([*np.linspace(0.0, horizon, CELLS + 1), *(side for pair in found for side in pair)])
            found |= set(sign_changes(g, edges))
        return sorted(found)


@dataclass(frozen=True)
class Event:
    """Time, state and held inputs right after a change of a sign."""

    t: float
    s: Float
    held: Float
    name: str  # of the function

    @property
    def endless(self) -> str:
        """What it means if there is one after the other."""
        return (
            f"the sign of {self.name} changes without end, as in a sliding mode; "
            "a smooth function instead, as tanh of a multiple of it, can be integrated"
        )


@dataclass(frozen=True)
class Watch:
    """Functions (K,) of time and states: their signs, the last K held inputs of a flow, decide its jumps and kinks."""

    names: tuple[str, ...]
    values: Callable[[float, Float, Float], Float]  # at (t, s, held), each with its own jumps and kinks decided
    anew: Callable[[float, Float, Float], Float]  # as the model has them

    def entered(self, t: float, s: Float, held: Float) -> Float:
        """Held inputs with the signs of an instant."""
        return np.concatenate((held[: -len(self.names)], np.sign(self.anew(t, s, held))))

    def event(self, solver: Any, held: Float) -> Event | None:
        """First change of a sign in the step just made; None without one.

        The step is smooth beyond the event, for the signs are held in it.
        """
        path, signs = solver.dense_output(), held[-len(self.names) :]

        def signs_at(t: float) -> Float:
            return np.sign(self.values(t, path(t), held))

        times = [solver.t_old + k / LOOKS * (solver.t - solver.t_old) for k in range(LOOKS)] + [solver.t]
        last = next((k for k in range(1, LOOKS + 1) if (signs_at(times[k]) != signs).any()), None)
        if last is None:
            return None
        before, after = times[last - 1], times[last]
        while RESOLUTION * after < after - before and before < (middle := 0.5 * (before + after)) < after:
            before, after = (before, middle) if (signs_at(middle) != signs).any() else (middle, after)
        s, now = path(after), signs_at(after)
        following = self.entered(after, s, held)
        changed = np.flatnonzero(now != signs)
        following[-len(signs) :][changed] = now[changed]
        return Event(float(after), s, following, self.names[changed[0]])


def sign_changes(g: Expression, edges: Array) -> Iterator[Break]:
    """Neighboring doubles between which a function of t changes its sign, between the first and last of the edges.

    Its jumps and kinks are at edges. A zero that is a double lies between two pairs. Every change is found: an interval
    is left out only if an enclosure of g, or of its derivative and the signs at the ends, says that there is none.

    Raises `UsageError` if there are too many.
    """
    low, high = between_zeros(g, edges)
    values = g.function(["t"])

    def sign(t: Array) -> Array:
        return np.nan_to_num(np.sign(values(t)), nan=2.0)

    while len(low):
        start, end = sign(low), sign(high)
        change = start != end
        low, high, start = low[change], high[change], start[change]
        before, after = low.copy(), high.copy()
        open_ = np.arange(len(low))
        while len(open_):
            middle = 0.5 * (before[open_] + after[open_])
            inside = (before[open_] < middle) & (middle < after[open_])
            open_, middle = open_[inside], middle[inside]
            same = sign(middle) == start[open_]
            before[open_[same]], after[open_[~same]] = middle[same], middle[~same]
        yield from zip(before.tolist(), after.tolist(), strict=True)
        low = after


def between_zeros(g: Expression, edges: Array) -> tuple[Array, Array]:
    """Ends of intervals (K,), in each of which g has one zero at most, or which cannot be divided any more."""
    slope = g.derivative("t")
    low, high = edges[:-1], edges[1:]
    found: list[tuple[Array, Array]] = []
    while len(low):
        value, rate = (e.enclose({"t": Interval(low, high)}) for e in (g, slope))
        narrow = high - low <= RESOLUTION * edges[-1]
        constant = (rate.low == 0) & (rate.high == 0) & ~narrow
        zero = (value.low <= 0) & (value.high >= 0) & ~constant
        settled = (rate.low > 0) | (rate.high < 0) | narrow
        found.append((low[zero & settled], high[zero & settled]))
        low, high = low[zero & ~settled], high[zero & ~settled]
        if len(low) + sum(len(part) for part, _ in found) > MOST:
            said = (
                f"the sign of {g} in t cannot be followed: it changes, or may change, more than {MOST:,} "
                f"times in {edges[-1]:g} s; shorten it, or write a signal without jumps and kinks"
            )
            raise UsageError(Problem(said, key="simulation", id="OBS804"))
        parts = np.linspace(low, high, PARTS + 1)
        low, high = parts[:-1].ravel(), parts[1:].ravel()
    return np.concatenate([part for part, _ in found]), np.concatenate([part for _, part in found])
