"""Gains of one injection: starts from convex problems and neighbours, descent on gamma, and how far they reach.

Nothing says that what is found is the best: a descent ends in a local minimum. A search takes storage functions of a
lower degree, and what is shipped is analysed once more and proved.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial

import numpy as np
from flint import fmpq

from obsdesign.dissipation.engine import Engine
from obsdesign.families.sporadic.clock.analysis import Analysis
from obsdesign.families.sporadic.clock.bernstein import Shape, adapted, of_gain
from obsdesign.families.sporadic.clock.convex import Convex, GapReset, Predictor, Reset
from obsdesign.families.sporadic.clock.descent import BARRIER, Gains, Injection, descend, walled
from obsdesign.families.sporadic.clock.theorem import error_system
from obsdesign.families.sporadic.clock.witness import GOALS
from obsdesign.families.sporadic.units import SPEC, Units
from obsdesign.lmi.formula import Array, Exact, Float, in_floats, printed
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, replace

COARSE = 3  # degree of the storage function of a descent, at most
FINE = 4  # .. and segments of that of a convex problem
WIDER = 4.0  # between bounds on the gain, until gamma settles
NEARLY = 1.2  # gamma of convex problems, relative to the least that they reach, from which on descents begin
SETTLED = 0.03  # relative change of gamma below which it has
MOST = 8  # .. and bounds that are tried
SMALLER = (0.25, 0.5, 0.75)  # parts of a gain within which a smaller one is sought
SMALLEST = 1e-3  # part of a gain below which none is sought: a plant that is stable needs no gain at all
INSIDE = 0.98  # of a bound: where a descent begins at the latest
RISE = 1.1  # of gamma from one point of a curve to the next, beyond which a search begins anew
STEPS, SOME, FEW = 80, 12, 2  # of a descent, and of those that begin nearby
STRIDES = 8  # first steps from the least value to the largest
NEAR = 1e-3  # relative to the largest value: the last step


@dataclass
class Found:
    """Gains, in the units of a search, and the least gamma that it knows of them, in that of the spec."""

    gains: Gains
    gamma: float
    B: Float | None = None  # of the descent to them


def driven(plant: Plant[Float]) -> Plant[Float]:
    """Plant with a disturbance of every state where it has none: gains for it are searched as if there were one."""
    if plant.B.shape[1]:
        return plant
    n = plant.n
    return replace(plant, B=np.eye(n), D=np.zeros((len(plant.C), n)), Dq=np.zeros((len(plant.Cq), n)))


def main(gains: Gains) -> Float:
    """The gain whose size counts: L or K, or all control values of K."""
    return next(gains[name] for name in ("K_of_gap", "K", "L") if name in gains)


def norm(gain: Float) -> float:
    """Spectral norm of a gain, or the largest of its control values."""
    return float(np.linalg.norm(gain, 2, axis=(-2, -1)).max())


def scaled(gains: Gains, factor: float) -> Gains:
    """Gains that are multiplied by a factor."""
    return {name: gain if name == "knots" else factor * gain for name, gain in gains.items()}


def least(found: Iterable[Found]) -> Found | None:
    """Gains of the least gamma."""
    return min(found, key=lambda f: f.gamma, default=None)


@dataclass
class Curve:
    """One injection, for any T2 and decay.

    Gains are searched in units that fit the data: in others a first step, the smallest gain and a gain that is not
    bounded would mean nothing. A bound on a gain is one on that of the spec, whatever the units.
    """

    engine: Engine
    plant: Plant[Exact]
    multiplier: Multiplier
    Cp: Array
    T1: fmpq
    shape: Shape
    name: str  # dynamic, predictor, hold or reset
    kappa: float | None  # bound on |L| or |K|
    gap: bool = False  # whether K of a reset depends on the interval that has just ended
    units: Units = SPEC
    steps: int = STEPS  # of a descent, at most

    def __post_init__(self) -> None:
        self.doubles, self.M = driven(self.units.plant(self.plant.doubles)), in_floats(self.multiplier)
        self.H = in_floats(self.Cp) * self.units.x / self.units.z
        self.time = fmpq(*self.units.time.as_integer_ratio())  # s
        self.shortest = self.T1 / self.time
        resets = self.name == "reset" and self.kappa is not None
        self.left = np.ones(self.doubles.n) * self.units.left
        self.right = np.ones(len(self.doubles.C)) * self.units.right * (self.units.time if resets else 1.0)
        turn = self.sizes["H"] if self.kappa is not None else np.ones(1)
        self.injection = Injection(self.name, self.doubles.C, self.left, self.right, np.asarray(turn))

    def analysis(self, gains: Gains, shape: Shape | None = None) -> Analysis:
        """Error of gains, in doubles."""
        error = error_system(self.doubles, self.H, gains)
        clock = of_gain(self.shortest, printed(gains["knots"]), gains["K_of_gap"]) if "K_of_gap" in gains else None
        return Analysis(self.engine, error, self.M, self.shortest, shape or self.shape, clock)

    @property
    def sizes(self) -> dict[str, Array | float]:
        """Units of gains."""
        x, y, time = self.units.x[:, None], self.units.y, self.units.time
        return {"L": x / (y * time), "H": y[:, None] / (y * time), "K": x / y, "K_of_gap": x / y, "knots": time}

    def outside(self, found: Found) -> Gains:
        """Gains in the units of the spec."""
        return {name: gain * self.sizes[name] for name, gain in found.gains.items()}

    def size(self, gains: Gains) -> float:
        """|L| or |K|: in the units of the spec where it is bounded."""
        return norm(self.injection.weighed(main(gains)))

    def gamma(self, gains: Gains, T2: fmpq, decay: fmpq) -> float:
        """Least gain from w to z of gains in the units of the spec, in its units; infinite if none is found."""
        inside = {name: gain / self.sizes[name] for name, gain in gains.items()}
        return self.units.gamma * self.analysis(inside).gamma(T2 / self.time, decay * self.time)

    # One T2 and decay

    def best(self, T2: fmpq, decay: fmpq, near: Found | None = None) -> Found | None:
        """Gains of the least gamma that is found, within the bound on them; None if none has a gamma.

        `T2`, `decay`: s and 1/s. With gains for a T2 and decay nearby a few steps from these are made.
        """
        return self.found(T2 / self.time, decay * self.time, near)

    def found(self, T2: fmpq, decay: fmpq, near: Found | None) -> Found | None:
        """The same for a T2 and decay in the units of the search, as all below."""
        warm = None
        if near is not None:
            begin = replace(near, gains=self.eased(near.gains))
            kappa, steps = (self.kappa, FEW) if self.kappa else (WIDER * self.size(begin.gains), SOME)
            warm = self.descended(begin, kappa, T2, decay, steps)
            if warm and warm.gamma < RISE * near.gamma:
                return warm
        cold = self.within(self.kappa, T2, decay) if self.kappa is not None else self.unbounded(T2, decay)
        return least(f for f in (warm, cold) if f)

    def unbounded(self, T2: fmpq, decay: fmpq) -> Found | None:
        """Gains of the least gamma within bounds that grow, until gamma settles or is not proved any more.

        Where the gains of convex problems come near to the least gamma that they reach, descents begin.
        """
        firsts = list(self.firsts(T2, decay))
        lowest = least(first for _, first in firsts if first)
        if lowest is None:
            return None
        k = next(k for k, (_, first) in enumerate(firsts) if first and first.gamma <= NEARLY * lowest.gamma)
        best: Found | None = None
        for kappa, first in self.wider(firsts[k:], T2, decay):
            found = self.descended(first, kappa, T2, decay) or first
            if not self.proved(found, T2, decay):
                break
            settled = best and found.gamma > (1 - SETTLED) * best.gamma
            best = least(f for f in (best, found) if f)
            if settled:
                break
        return best or self.narrower(firsts[:k], T2, decay) or lowest

    def narrower(self, firsts: list[tuple[float, Found | None]], T2: fmpq, decay: fmpq) -> Found | None:
        """Gains within the largest of some bounds for which gamma is proved."""
        for kappa, first in reversed(firsts):
            made = first and (self.descended(first, kappa, T2, decay) or first)
            if made and self.proved(made, T2, decay):
                return made
        return None

    def firsts(self, T2: fmpq, decay: fmpq) -> Iterator[tuple[float, Found | None]]:
        """Bounds that grow with the best gains of convex problems within each, until their gamma settles."""
        before, kappa = math.inf, self.begin
        for _ in range(MOST):
            first = self.first(kappa, T2, decay)
            yield kappa, first
            if first and first.gamma > (1 - SETTLED) * before:
                break
            before, kappa = first.gamma if first else before, WIDER * kappa

    def wider(self, firsts: list[tuple[float, Found | None]], T2: fmpq, decay: fmpq) -> Iterator[tuple[float, Found]]:
        """These with gains, and as many more as are tried at most."""
        yield from ((kappa, first) for kappa, first in firsts if first)
        kappa = firsts[-1][0]
        while (kappa := WIDER * kappa) < self.begin * WIDER**MOST:
            if first := self.first(kappa, T2, decay):
                yield kappa, first

    def proved(self, found: Found, T2: fmpq, decay: fmpq) -> bool:
        """Whether gamma is proved of gains: not where they are so large that doubles do not find a proof."""
        gains = {name: printed(gain) for name, gain in self.outside(found).items()}
        clock = of_gain(self.T1, gains["knots"], gains["K_of_gap"]) if "K_of_gap" in gains else None
        error = error_system(self.plant, self.Cp, gains)
        exact = Analysis(self.engine, error, self.multiplier, self.T1, self.shape, clock)
        witness = exact.prove(GOALS["gamma"], T2 * self.time, decay / self.time)
        return witness is not None and witness.holds

    def eased(self, gains: Gains) -> Gains:
        """Gains, smaller where they are too near to the bound for a descent to begin."""
        room = INSIDE * (self.kappa or math.inf) / (self.size(gains) or 1.0)
        return gains if room >= 1 else scaled(gains, room)

    @property
    def begin(self) -> float:
        """Least bound that is tried where there is none: about that of a gain that moves the fastest mode."""
        seen = float(np.linalg.norm(self.doubles.C, 2)) or 1.0
        return 1 / seen if self.name == "reset" else (float(np.linalg.norm(self.doubles.A, 2)) or 1.0) / seen

    def within(self, kappa: float, T2: fmpq, decay: fmpq) -> Found | None:
        """Gains of the least gamma within a bound on them, by descent from the best start."""
        first = self.first(kappa, T2, decay)
        return first and (self.descended(first, kappa, T2, decay) or first)

    def first(self, kappa: float, T2: fmpq, decay: fmpq) -> Found | None:
        """Best of the gains within a bound from convex problems."""
        starts = (self.measured(gains, T2, decay) for gains in self.starts(kappa, T2, decay))
        return least(f for f in starts if f)

    def starts(self, kappa: float, T2: fmpq, decay: fmpq) -> Iterator[Gains]:
        """Gains within a bound from convex problems: a predictor, or a reset and what acts like it between samples."""
        C, zero = self.doubles.C, np.zeros((len(self.doubles.C),) * 2)
        T = float(T2)
        if self.gap:
            yield from self.adapted(kappa, T2, decay)
            return
        if self.name == "reset":
            yield from ({"K": K} for K in self.convex(Reset, kappa, T2, decay))
            return
        for L in self.convex(Predictor, kappa, T2, decay):
            yield {"L": L, "H": zero if self.name == "hold" else -C @ L}
        for K in self.convex(Reset, kappa * T, T2, decay) if self.name != "predictor" else ():
            yield {"L": K / T, "H": zero}

    def adapted(self, kappa: float, T2: fmpq, decay: fmpq) -> Iterator[Gains]:
        """Gain that depends on the interval."""
        none = self.analysis({"K": np.zeros((self.doubles.n, len(self.doubles.C)))})
        clock = adapted(self.shortest, T2, self.shape.degree, self.shape.segments)
        form = GapReset(replace(none, clock=clock).theorem(T2, decay).doubles, self.doubles.C, *self.within_size(kappa))
        _, K = form.least(none)
        if K is not None and np.isfinite(K).all():
            made = {"K_of_gap": K, "knots": form.knots}
            yield scaled(made, min(1.0, INSIDE * kappa / (self.size(made) or 1.0)))

    def convex(self, form: type[Convex], kappa: float, T2: fmpq, decay: fmpq) -> Iterator[Float]:
        """Gain of a convex problem, if it has a solution, inside the bound."""
        n, ny = self.doubles.n, len(self.doubles.C)
        none = {"K": np.zeros((n, ny))} if form is Reset else {"L": np.zeros((n, ny)), "H": np.zeros((ny, ny))}
        analysis = self.analysis(none, replace(self.shape, segments=FINE, lookahead=1))
        _, gain = form(analysis.theorem(T2, decay).doubles, self.doubles.C, *self.within_size(kappa)).least(analysis)
        if gain is not None and np.isfinite(gain).all():
            yield gain * min(1.0, INSIDE * kappa / (self.size({"K": gain}) or 1.0))

    def within_size(self, kappa: float) -> tuple[Float, Float]:
        """What a convex problem is told of a bound on the gain."""
        return self.left, self.right / kappa

    def measured(self, gains: Gains, T2: fmpq, decay: fmpq) -> Found | None:
        """Gains with their least gamma by a coarse storage function; None if it has none."""
        gamma = self.units.gamma * self.analysis(gains, self.coarse).gamma(T2, decay)
        return Found(gains, gamma) if math.isfinite(gamma) else None

    @property
    def coarse(self) -> Shape:
        """Storage function of a descent."""
        return replace(self.shape, degree=min(COARSE, self.shape.degree), lookahead=1)

    def descended(self, start: Found, kappa: float, T2: fmpq, decay: fmpq, steps: int = STEPS) -> Found | None:
        """Local minimum of gamma within a bound on the gain, from gains within it on; None where they have no gamma."""
        if not start.gamma or self.gap:
            return self.measured(start.gains, T2, decay)
        begin = self.injection.vector(start.gains)
        x, value, B = descend(partial(self.value, kappa, T2, decay), begin, min(steps, self.steps), start.B)
        if not math.isfinite(value):
            return None
        gains = self.injection.gains(x)
        wall, _ = walled(self.injection.bounded(x), kappa)
        return Found(gains, self.units.gamma * math.exp((value - BARRIER * wall) / 2), B)

    def value(self, kappa: float, T2: fmpq, decay: fmpq, x: Float) -> tuple[float, Float]:
        """Logarithm of mu with a barrier at the bound on the gain, and its gradient; infinite where there is no mu."""
        gains = self.injection.gains(x)
        wall, rise = walled(self.injection.bounded(x), kappa)
        slope = self.analysis(gains, self.coarse).slope(T2, decay) if math.isfinite(wall) else None
        if slope is None or not 0 < slope.mu < math.inf:
            return math.inf, 0 * x
        gradient = self.injection.gradient(slope) / slope.mu
        gradient[: rise.size] += BARRIER * rise.ravel()
        return math.log(slope.mu) + BARRIER * wall, gradient

    def smaller(self, found: Found, target: float, T2: fmpq, decay: fmpq) -> Found:
        """Gains of smaller size whose gamma stays below a target; `T2`, `decay`: s and 1/s."""
        least = SMALLEST * self.size(found.gains)
        for part in SMALLER:
            while self.size(found.gains) > least and (
                made := self.reduced(found, part, target, T2 / self.time, decay * self.time)
            ):
                found = made
        return found

    def reduced(self, found: Found, part: float, target: float, T2: fmpq, decay: fmpq) -> Found | None:
        """Gains within part of the size of others whose gamma is below a target; None if none are found."""
        kappa = part * self.size(found.gains)
        if not kappa:
            return None
        first = self.measured(scaled(found.gains, INSIDE * part), T2, decay)
        first = first or self.first(kappa, T2, decay)
        made = first and self.descended(first, kappa, T2, decay, SOME)
        return made if made and self.gamma(self.outside(made), T2 * self.time, decay / self.time) <= target else None

    # How far

    def farthest(
        self, at: Callable[[float], tuple[fmpq, fmpq]], low: float, high: float, accept: Callable[[Found], bool]
    ) -> tuple[float, Found] | None:
        """Largest value of an interval for which gains are found, each search begun from the last; or None.

        `at`: T2 and decay of a value; `accept`: whether gains do.
        """
        found = self.best(*at(low))
        if found is None or not accept(found):
            return None
        value, step = low, (high - low) / STRIDES
        while step > NEAR * high and value < high:
            tried = min(value + step, high)
            made = self.best(*at(tried), near=found)
            if made and accept(made):
                value, found, step = tried, made, 2 * step
            else:
                step /= 2
        return value, found
