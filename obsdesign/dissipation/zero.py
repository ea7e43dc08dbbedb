"""Limits of zero: the least gamma falls without end as the gain grows."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Self

import numpy as np

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.decimals import round_down, round_up, significant
from obsdesign.dissipation.elimination import gain_above
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import DIGITS, gain, limit_of, norm, size_of, sized, sizes
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.shift import shifted_plant
from obsdesign.errors import Problem, UsageError
from obsdesign.lmi.formula import Array, in_floats, printed, rational_number
from obsdesign.lmi.solve import Answer, Status
from obsdesign.records import dataclass, replace

TABLE = (
    1e1,
    1e2,
    1e3,
    1e4,
    1e5,
    1e6,
)  # gains of the table that a limit of zero is answered with, in sizes of the plant
SUSPECT = 1e-3  # a gamma below this, likewise, may be a limit of zero: the table decides
ROUNDED = 1e-7  # share of the gamma of the widest solution that counts as zero
EXACT = 1e-11  # relative, of what is zero but for the rounding of doubles
SHARE = 1e-3  # .. and that is certified in its place
UNRESOLVED = 0.1  # share of what gamma can fall to, below which it is rounding
HALF = -0.4 * math.log(10)  # of log gamma in a decade of gain: |L1| is of the order of 1 / gamma^2 at most
NEAR = 1e-6  # relative, above a limit, where the size of a gain tells whether one attains it
FINITE = 100.0  # .. in sizes of the plant
STEADY = 3  # decades over which gamma must fall, without slowing down, for its limit to be called zero


def falling(engine: Engine, family: Incremental, limit: Answer) -> tuple[tuple[float, float], ...]:
    """Table (largest |L1|, gamma) if gamma falls towards zero as the gain grows; else nothing."""
    largest, least = sizes(family)
    if limit.status is Status.OPTIMAL and limit.objective > (SUSPECT * least) ** 2:
        return ()
    rows = []
    for size in (largest * step for step in TABLE):
        answer = engine.minimise(family.least_gamma(Bounds(L1=rational_number(str(size)))))
        if answer.status is Status.OPTIMAL:
            rows.append((size, math.sqrt(max(answer.objective, 0.0))))
    if limit.gap is not None and rows:
        return tuple(rows)
    fall = np.diff(np.log([gamma for _, gamma in rows[-4:]]))
    if len(fall) < STEADY or fall.max() >= math.log(0.8):
        return ()
    unseen = limit.status is not Status.OPTIMAL and fall[-1] <= HALF
    return tuple(rows) if fall[-1] < 0.9 * fall[0] or unseen else ()


def cancelled(engine: Engine, family: Incremental, limit: Answer) -> float | None:
    """Level to certify where a finite gain cancels the disturbance, so that the limit is zero but for rounding.

    Then gamma can be as small as one likes, and the level is a small share of that of the solution of widest margin.
    """
    least = max(limit.objective, 0.0)
    if limit.status is Status.INFEASIBLE or least > (SUSPECT * sizes(family)[1]) ** 2 or unheard(family):
        return None
    share = share_of_widest(engine, family)
    return share if share is not None and math.sqrt(least) <= ROUNDED / SHARE * share else None


def share_of_widest(engine: Engine, family: Incremental) -> float | None:
    """Small share of the gamma of the solution of widest margin; None if there is none."""
    wide = engine.widest(family.witness(None))
    return SHARE * math.sqrt(wide.values["mu"].item()) if wide.status is Status.OPTIMAL else None


@dataclass(frozen=True)
class Vanishing:
    """How the least gamma over all gains vanishes, if it does."""

    table: tuple[tuple[float, float], ...] = ()  # of `falling`: with a gain that grows without bound
    instead: float | None = None  # of `cancelled`
    attained: bool = False  # by a finite gain, with which v does not act on the error


@dataclass(frozen=True)
class Level:
    """Least gamma over some gains, and where the limit is zero at a finite gain the level to certify in its place."""

    gamma: float
    instead: float | None = None
    attained: bool = False  # the zero, by a finite gain
    table: tuple[tuple[float, float], ...] = ()  # of `falling`

    @classmethod
    def of(cls, answer: Answer, zero: Vanishing) -> Self:
        """Gamma of an optimum, or zero where it vanishes and the rest is rounding."""
        gamma = math.sqrt(max(answer.objective, 0.0))
        vanishes = zero.instead and gamma < SHARE * zero.instead
        return cls(0.0, zero.instead, zero.attained) if vanishes else cls(gamma)

    @classmethod
    def of_all(cls, answer: Answer, zero: Vanishing) -> Self:
        """Least gamma over all gains: zero where it vanishes, whatever is left of it in an optimum."""
        if zero.table or zero.attained:
            return cls(0.0, zero.instead, zero.attained, zero.table)
        return cls.of(answer, zero)

    @classmethod
    def within(cls, answer: Answer, zero: Vanishing, bounds: Bounds) -> Self:
        """Least gamma within bounds; that of a row of the table within them where a solver does not resolve it.

        Gamma falls no faster than 1 / |L1| there: an error that rests has (A + L1 C) e = B v.
        """
        level, largest = cls.of(answer, zero), limit_of(bounds)
        least, size = min(((gamma, size) for size, gamma in zero.table if size <= largest), default=(0.0, 1.0))
        return cls(least) if level.gamma < UNRESOLVED * least * size / largest else level

    def target(self, slack: float) -> float:
        """Gamma to be certified, within the slack of the least, rounded down to 6 digits so that it stays there."""
        if self.instead:
            return round_up(self.instead, 6)
        return max(round_down(self.gamma * (1 + slack), 6), round_up(self.gamma, 6))


def vanishing(engine: Engine, family: Incremental, limit: Answer) -> Vanishing:
    """Whether the least gamma is zero: where a finite gain keeps v from the error that is tried first.

    Gamma falls towards such a gain as well.
    """
    if family.direct or (limit.gap is not None and limit.objective > 0):  # bounded from below by what v does
        return Vanishing()
    if unheard(family):
        return Vanishing()
    silent = kept_out(family)
    attained = silent is not None and engine.widest(silent.feasible()).status is Status.OPTIMAL
    instead = share_of_widest(engine, family) if attained else None
    table = () if instead else falling(engine, family, limit)
    return Vanishing(table, instead if attained or table else cancelled(engine, family, limit), attained and not table)


def unheard(family: Incremental) -> bool:
    """Whether some v moves z while no output tells of it: then no gain keeps gamma below a positive number.

    With D of full row rank, N = null D and v = -D^+ C x + N eta, the output is 0 along x' = (A - B D^+ C) x + B N eta,
    so xhat = 0 whatever the gains, and z = H x: not zero for all eta unless H (A - B D^+ C)^k B N = 0 for all k < n.
    """
    p = shifted_plant(in_floats(family.plant), in_floats(family.multiplier.member))  # f = K q is one of the class
    _, sizes, right = np.linalg.svd(p.D)
    if not len(p.D) or len(sizes) < len(p.D) or sizes[-1] <= EXACT * sizes[0]:
        return False
    reached = p.B @ right[len(p.D) :].T
    A, seen = p.A - p.B @ np.linalg.pinv(p.D) @ p.C, family.H
    size = np.abs(seen) @ np.abs(p.B).max(axis=1, initial=0.0)
    for _ in range(len(A)):
        if (np.abs(seen @ reached).max(axis=1, initial=0.0) > EXACT * size).any():
            return True
        size = np.abs(seen) @ np.abs(A) @ np.abs(p.B).max(axis=1, initial=0.0)
        seen = seen @ A
    return False


def kept_out(family: Incremental) -> Incremental | None:
    """Problem that is left with L1 = Z N - B D^+, N = I - D D^+: v does not act on e; None where B + L1 D is not zero.

    The output is N y then, in which there is no v either.
    """
    p, through = family.plant, family.plant.Dq if family.L2 is None else family.plant.Dq + family.L2 @ family.plant.D
    L, N = annihilators(family)
    rest, size = p.B + L @ p.D, np.abs(p.B).max(axis=1, initial=0.0, keepdims=True)
    if not p.B.any() or (np.abs(rest) > EXACT * size).any() or through.any():
        return None
    A, Bf, C, Df = p.A + L @ p.C, p.Bf + L @ p.Df, N @ p.C, N @ p.Df
    return replace(family, plant=replace(p.undisturbed, A=A, Bf=Bf, C=C, Df=Df))


def annihilators(family: Incremental) -> tuple[Array, Array]:
    """-B D^+ and N = I - D D^+."""
    D, back = family.plant.D, np.linalg.pinv(family.plant.D)
    return -family.plant.B @ back, np.eye(len(D)) - D @ back


def silencing(engine: Engine, family: Incremental, bounds: Bounds) -> Array | None:
    """L1 = Z N - B D^+ within bounds, with which v does not act on e; None if none is found.

    |L1|^2 <= |Z|^2 + |B D^+|^2, since the rows of both are orthogonal.
    """
    silent = None if family.L2 is None or family.direct else kept_out(family)
    if silent is None:
        return None
    L, N = annihilators(family)
    room = math.inf if bounds.L1 is None else limit_of(bounds) ** 2 - size_of(L, bounds) ** 2
    if room <= 0:
        return None
    rank = len(N) if bounds.norm == "frobenius" else 1  # |Z|_F^2 <= ny |Z|^2
    left = bounds if bounds.L1 is None else replace(sized(bounds, math.sqrt(room / rank)), norm="spectral")
    found = engine.widest(silent.least_gamma(left))
    return gain(found.values) @ N + L if found.status is Status.OPTIMAL else None


def silent_gains(engine: Engine, family: Incremental, bounds: Bounds) -> Iterator[Incremental]:
    """A family in rationals with the gain of `silencing`, in more and more digits."""
    L1 = silencing(engine, in_floats(family), bounds)
    if L1 is not None:
        yield from (replace(family, L1=printed(significant(L1, digits))) for digits in DIGITS)


def settled(engine: Engine, family: Incremental, answer: Answer, bounds: Bounds = NO_BOUNDS) -> Answer:
    """Same answer, with the objective 0 where a finite gain cancels the disturbance and the rest is rounding.

    Where there is no answer, such a gain within the bounds is searched; a given gain is no other.
    """
    if family.L1 is not None or family.direct or (answer.gap is not None and answer.objective > 0):
        return answer
    optimal = answer.status is Status.OPTIMAL
    attained = not optimal and silencing(engine, family, bounds) is not None
    if optimal or not bounds.restricted:
        attained = attained or cancelled(engine, family, answer) is not None
    if not attained:
        return answer
    return replace(answer, status=Status.OPTIMAL, objective=0.0)


def reached(engine: Engine, family: Incremental, gamma: float, bounds: Bounds) -> bool:
    """Whether a finite gain attains a positive limit of gamma, in samples, as doubles tell by the size of one near it.

    In continuous time gains grow without bound as gamma comes near its infimum, unless v is kept from the error. Where
    the inequality is strict, it does not hold for the infimum. `bounds`: whose norm of L1 counts.
    """
    strict = family.about.at_rest == "strict" and not family.rate
    if not family.about.pace.sampled or strict:
        return False
    level, largest = gamma * (1 + NEAR), FINITE * sizes(family)[0]
    central = gain_above(engine, family, level)
    if central is not None:
        return size_of(central, bounds) <= largest
    near = engine.widest(family.witness(level))
    return near.status is Status.OPTIMAL and norm(near.values, bounds) <= largest


Noise = Callable[[Array], float | None]  # rms of z for the gains L1, for white noise of density 1 in every output


def loudness(engine: Engine, family: Incremental, rows: Sequence[tuple[float, float]], noise: Noise) -> list[float]:
    """Noise of the gains of each row of a table; empty where that of one is not known."""
    answers = (engine.minimise(family.least_gamma(Bounds(L1=rational_number(str(size))))) for size, _ in rows)
    found = [noise(gain(answer.values)) if answer.status is Status.OPTIMAL else None for answer in answers]
    return [rms for rms in found if rms is not None] if None not in found else []


def unbounded(
    where: str, rows: Sequence[tuple[float, float]], noise: Sequence[float], gain: str = "L1", knee: bool = True
) -> UsageError:
    """Refusal of min-gamma where the infimum is zero; `knee`: whether the family finds it by itself."""
    first = (
        f"the least gamma at {where} is 0, with a gain that grows without "
        f"bound; choose `bounds: {{{gain}: ..}}` or `objective: {{gamma: ..}}` from this table"
    )
    return tabulated(first + ", or `bounds: auto`, its knee" * knee, gain, "gamma", rows, noise)


def tabulated(
    first: str, gain: str, quantity: str, rows: Sequence[tuple[float, float]], noise: Sequence[float] = ()
) -> UsageError:
    """Refusal with a table of a quantity against the norm of a gain, and beside it the noise of z."""
    said = ["   rms of z for white noise of density 1", *[""] * len(rows)]
    loud = [f"   {rms:<8.3g}{more}" for rms, more in zip(noise, said, strict=False)] or [""] * len(rows)
    pairs = zip(rows, loud, strict=True)
    table = [f"  |{gain}| <= {size:<8g} {quantity} = {value:<9.4g}{more}".rstrip() for (size, value), more in pairs]
    return UsageError(Problem(first, key="observer.objective", id="OBS502", rows=tuple(table)))
