"""What an observer with sporadic measurements does at best, beside what is proved: entry `truth` of `analysis`.

For the error of a linear plant, and for that of frozen members f = K q of the class, what recurs is known exactly but
for rounding: a period, or a sequence of intervals in [T1, T2], at which the error grows, and the gain from w to z. Each
bounds from the other side what any certificate can prove, and so shows how conservative one is at most. The search for
the worst sequence finds no more than a bad one, and other f of the class may be worse than frozen members.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from obsdesign.families.sporadic.clock.energy import exceeds, gain
from obsdesign.families.sporadic.clock.linear import LETTERS, ROUNDING, LinearError, interval
from obsdesign.families.sporadic.clock.theorem import ErrorSystem
from obsdesign.families.sporadic.clock.units import error_units
from obsdesign.lmi.formula import Array

FEW = 9  # members, those that seem the slowest
SLOWEST = 2  # .. of a point of a curve
LONGER = 10.0  # longest period and T2 that are tried, relative to T2
SHORTER = 1e-3  # .. and the shortest for T1 = 0
BELOW = 1e-3  # relative, from an unstable period, up to which sequences are tried
SHARES = (0, LETTERS // 4, LETTERS // 2)  # letters of the intervals that take turns with T2
RUNS = ((1, 1), (8, 1), (1, 2))  # how often each comes after itself
BETTER = 1e-3  # relative rise of a gain below which a sequence is no worse
OF_PLANT = "the error itself"
OF_MEMBERS = "the worst frozen member f = K q that was found"


@np.errstate(all="ignore")  # what is not finite shows nothing
def truth(system: ErrorSystem, members: Sequence[Array], T1: float, T2: float, decay: float) -> dict[str, Any]:
    """Limits of stability, the worst growth and the gains that are found of an error, in doubles.

    `members`: df = K (Cq x + Dq w), the algebraic loop closed. The entries: `of`, what they belong to; `period_limit`,
    the shortest period from T1 on at which the error does not decay at the rate, s; `pattern_limit`, the least T2 for
    which a sequence of intervals in [T1, T2] is found at which it does not; `pattern`, that of T1 and T2 whose growth,
    in 1/s, is the largest; `gamma`, for periods T1 and T2 and for the worst of some sequences, weighted by the rate as
    in the theorem. What is longer than ten times T2 is not looked for: None. Empty where doubles tell nothing.
    """
    system, unit = balanced(system, T2)
    errors = slowest(system, members, T2, decay)
    if not errors:
        return {}
    low, high = T1 or SHORTER * T2, LONGER * T2
    period = shortest_period(errors, low, high)
    found = {
        "of": OF_MEMBERS if system.Bfx.shape[1] else OF_PLANT,
        "period_limit": period,
        "pattern_limit": shortest_interval(errors, T1, low, period, high),
        "pattern": fastest_growth(errors, T1, T2, decay),
    }
    disturbed = [error for error in errors if error.strength]
    known = gains(disturbed, T1, T2, unit) if disturbed else {}
    return found | ({"gamma": known} if known else {})


@np.errstate(all="ignore")
def periodic_gamma(system: ErrorSystem, members: Sequence[Array], T2: float, decay: float, near: float) -> float | None:
    """Largest gain from w to z at the period T2, in doubles: no gamma is less; None where none is known.

    `near`: a gain that it is near to.
    """
    system, unit = balanced(system, T2)
    disturbed = [error for error in slowest(system, members, T2, decay)[:SLOWEST] if error.strength]
    found = unit * largest(disturbed, [T2], near / unit)
    return found if 0 < found < np.inf else None


def balanced(system: ErrorSystem, T2: float) -> tuple[ErrorSystem, float]:
    """Error in units that fit its data, but for time, and that of a gain from w to z."""
    units = replace(error_units(system, T2, weighed=True), time=1.0)
    return units.system(system), units.z / units.w


def slowest(system: ErrorSystem, members: Sequence[Array], T2: float, decay: float) -> list[LinearError]:
    """Errors of the members that seem the slowest, as far as doubles tell something of them."""
    trusted = (error for error in (frozen(system, K, decay) for K in members) if error.longest >= T2)
    return sorted(trusted, key=lambda error: -error.growth([T2]))[:FEW]


def frozen(system: ErrorSystem, K: Array, decay: float) -> LinearError:
    """Error of a member, times exp(decay t)."""
    A = system.F + system.Bfx @ K @ system.Cq + decay * np.eye(system.order)
    return LinearError.of(A, system.Bx + system.Bfx @ K @ system.Dq, system.Cp, system.J)


def shortest_period(errors: Sequence[LinearError], low: float, high: float) -> float | None:
    """Shortest unstable period of an interval, of any of the errors."""
    found = None
    for error in errors:
        found = error.shortest_unstable_period(low, min(found or high, error.longest)) or found
    return found


def shortest_interval(
    errors: Sequence[LinearError], T1: float, low: float, period: float | None, high: float
) -> dict[str, Any] | None:
    """Least T2 for which a sequence is unstable, at most an unstable period, and its intervals."""
    best = None if period is None else (period, np.array([period]))
    for error in errors:
        below = min((1 - BELOW) * best[0] if best else high, error.longest)
        best = (error.shortest_unstable(T1, low, below) if low < below else None) or best
    return best and {"T2": best[0], "gaps": written(best[1].tolist())}


def fastest_growth(errors: Sequence[LinearError], T1: float, T2: float, decay: float) -> dict[str, Any]:
    """Sequence of the largest growth, and how fast the error grows, 1/s; less than 0 where it decays."""
    gaps, growth = max((error.fastest_growth(T1, T2) for error in errors), key=lambda found: found[1])
    return {"gaps": written(gaps.tolist()), "growth": growth - decay}


def gains(errors: Sequence[LinearError], T1: float, T2: float, unit: float) -> dict[str, Any]:
    """Largest gains at periods T1 and T2, and of the sequences in which T2 takes turns, with the worst of these.

    Empty where none is known to be positive.
    """
    found: dict[str, Any] = {}
    near = None
    for name, T in (("T1", T1), ("T2", T2)):
        if T:
            found[name] = near = largest(errors, [T], near)
    for gaps in turns(T1, T2):
        known = found.get("pattern", 0.0)
        value = largest(errors, gaps, near, known)
        if value > known:
            found |= {"pattern": value, "gaps": written(gaps)}
    known = [name for name in ("T1", "T2", "pattern") if name in found]
    return {**found, **{name: unit * found[name] for name in known}} if any(found[name] for name in known) else {}


def largest(
    errors: Sequence[LinearError], gaps: Sequence[float], near: float | None = None, known: float = 0.0
) -> float:
    """Largest gain of a sequence over the errors, or what is known of others where it is not clearly larger.

    `near`: a gain that it is near to.
    """
    for error in errors:
        least = known * (1 + BETTER)
        if not known or error.growth(gaps) >= ROUNDING or exceeds(error, gaps, least):
            known = gain(error, gaps, least or near)
    return known


def turns(T1: float, T2: float) -> Iterator[list[float]]:
    """Sequences of two intervals, T2 and another one."""
    gaps = np.linspace(*interval(T1, T2), LETTERS + 1)
    for i, j in RUNS if T1 < T2 else ():
        yield from ([float(gaps[share])] * i + [T2] * j for share in SHARES)


def written(gaps: Sequence[float]) -> list[float]:
    """Intervals as a file holds them."""
    return [float(f"{T:.6g}") for T in gaps]
