"""Gains of one injection: starts from convex problems and neighbours, descent on gamma, and how far they reach.

Nothing says that what is found is the best: a descent ends in a local minimum. A search takes storage functions of a
lower degree, and what is shipped is analysed once more and proved.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from flint import fmpq

from obsdesign.dissipation.engine import Engine
from obsdesign.families.sporadic.clock.analysis import Analysis
from obsdesign.families.sporadic.clock.bernstein import Shape, adapted, of_gain
from obsdesign.families.sporadic.clock.convex import Convex, GapReset, Predictor, Reset
from obsdesign.families.sporadic.clock.descent import BARRIER, Gains, Injection, descend, walled
from obsdesign.families.sporadic.clock.theorem import error_system
from obsdesign.lmi.formula import Array, Exact, Float, in_floats, printed
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant

COARSE = 3  # degree of the storage function of a descent, at most
FINE = 4  # .. and segments of that of a convex problem
WIDER = 4.0  # between bounds on the gain, until gamma settles
SETTLED = 0.03  # relative change of gamma below which it has
MOST = 8  # bounds that are tried
SMALLER = (0.25, 0.5, 0.75)  # parts of a gain within which a smaller one is sought
INSIDE = 0.98  # of a bound: where a descent begins at the latest
RISE = 1.1  # of gamma from one point of a curve to the next, beyond which a search begins anew
STEPS, SOME, FEW = 80, 12, 3  # of a descent, and of one that begins nearby
STRIDES = 8  # first steps from the least value to the largest
NEAR = 1e-3  # relative to the largest value: the last step


@dataclass
class Found:
    """Gains and the least gamma that a search knows of them."""

    gains: Gains
    gamma: float
    B: Float | None = None  # of the descent to them

    @property
    def size(self) -> float:
        """|L| or |K|."""
        return norm(main(self.gains))


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


@dataclass
class Curve:
    """One injection, for any T2 and decay."""

    engine: Engine
    plant: Plant[Exact]
    multiplier: Multiplier
    Cp: Array
    T1: fmpq
    shape: Shape
    name: str  # dynamic, predictor, hold or reset
    kappa: float | None  # bound on |L| or |K|
    gap: bool = False  # whether K of a reset depends on the interval that has just ended

    def __post_init__(self) -> None:
        self.doubles, self.M = driven(self.plant.doubles), in_floats(self.multiplier)
        self.injection = Injection(self.name, self.doubles.C)

    def analysis(self, gains: Gains, shape: Shape | None = None) -> Analysis:
        """Error of gains, in doubles."""
        error = error_system(self.doubles, in_floats(self.Cp), gains)
        clock = of_gain(self.T1, printed(gains["knots"]), gains["K_of_gap"]) if "K_of_gap" in gains else None
        return Analysis(self.engine, error, self.M, self.T1, shape or self.shape, clock)

    # One T2 and decay

    def best(self, T2: fmpq, decay: fmpq, near: Found | None = None) -> Found | None:
        """Gains of the least gamma that is found, within the bound on them; None if none has a gamma.

        With gains for a T2 and decay nearby a few steps from these are made.
        """
        warm = None
        if near is not None and (warm := self.measured(self.inside(near.gains), T2, decay)):
            warm = self.descended(replace(warm, B=near.B), self.kappa or WIDER * warm.size, T2, decay, FEW)
            if warm.gamma < RISE * near.gamma:
                return warm
        if self.kappa is not None:
            cold = self.within(self.kappa, T2, decay)
            return min((f for f in (warm, cold) if f), key=lambda f: f.gamma, default=None)
        best, kappa = warm, self.begin
        for _ in range(MOST):
            found = self.within(kappa, T2, decay)
            settled = found and best and found.gamma > (1 - SETTLED) * best.gamma
            best = min((f for f in (best, found) if f), key=lambda f: f.gamma, default=None)
            if settled:
                break
            kappa *= WIDER
        return best

    def inside(self, gains: Gains) -> Gains:
        """Gains, smaller where they are too near to the bound for a descent to begin."""
        room = INSIDE * (self.kappa or math.inf) / (norm(main(gains)) or 1.0)
        return gains if room >= 1 else scaled(gains, room)

    @property
    def begin(self) -> float:
        """Least bound that is tried where there is none: about that of a gain that moves the fastest mode."""
        seen = float(np.linalg.norm(self.doubles.C, 2)) or 1.0
        return 1 / seen if self.name == "reset" else (float(np.linalg.norm(self.doubles.A, 2)) or 1.0) / seen

    def within(self, kappa: float, T2: fmpq, decay: fmpq) -> Found | None:
        """Gains of the least gamma within a bound on them, by descent from the best start."""
        starts = (self.measured(gains, T2, decay) for gains in self.starts(kappa, T2, decay))
        first = min((f for f in starts if f), key=lambda f: f.gamma, default=None)
        return first and self.descended(first, kappa, T2, decay)

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
        clock = adapted(self.T1, T2, self.shape.degree, self.shape.segments)
        form = GapReset(replace(none, clock=clock).theorem(T2, decay).doubles, self.doubles.C, kappa)
        _, K = form.least(none)
        if K is not None and np.isfinite(K).all():
            yield scaled({"K_of_gap": K, "knots": form.knots}, min(1.0, INSIDE * kappa / (norm(K) or 1.0)))

    def convex(self, form: type[Convex], kappa: float, T2: fmpq, decay: fmpq) -> Iterator[Float]:
        """Gain of a convex problem, if it has a solution, inside the bound."""
        n, ny = self.doubles.n, len(self.doubles.C)
        none = {"K": np.zeros((n, ny))} if form is Reset else {"L": np.zeros((n, ny)), "H": np.zeros((ny, ny))}
        analysis = self.analysis(none, replace(self.shape, segments=FINE, lookahead=1))
        _, gain = form(analysis.theorem(T2, decay).doubles, self.doubles.C, kappa).least(analysis)
        if gain is not None and np.isfinite(gain).all():
            yield gain * min(1.0, INSIDE * kappa / (float(np.linalg.norm(gain, 2)) or 1.0))

    def measured(self, gains: Gains, T2: fmpq, decay: fmpq) -> Found | None:
        """Gains with their least gamma by a coarse storage function; None if it has none."""
        gamma = self.analysis(gains, self.coarse).gamma(T2, decay)
        return Found(gains, gamma) if math.isfinite(gamma) else None

    @property
    def coarse(self) -> Shape:
        """Storage function of a descent."""
        return replace(self.shape, degree=min(COARSE, self.shape.degree), lookahead=1)

    def descended(self, start: Found, kappa: float, T2: fmpq, decay: fmpq, steps: int = STEPS) -> Found:
        """Local minimum of gamma within a bound on the gain, from gains within it on."""
        if not start.gamma or self.gap:
            return start
        x, B = descend(partial(self.value, kappa, T2, decay), self.injection.vector(start.gains), steps, start.B)
        made = self.measured(self.injection.gains(x), T2, decay)
        return replace(made, B=B) if made else start

    def value(self, kappa: float, T2: fmpq, decay: fmpq, x: Float) -> tuple[float, Float]:
        """Logarithm of mu with a barrier at the bound on the gain, and its gradient; infinite where there is no mu."""
        gains = self.injection.gains(x)
        wall, rise = walled(main(gains), kappa)
        slope = self.analysis(gains, self.coarse).slope(T2, decay) if math.isfinite(wall) else None
        if slope is None or not 0 < slope.mu < math.inf:
            return math.inf, 0 * x
        gradient = self.injection.gradient(slope) / slope.mu
        gradient[: rise.size] += BARRIER * rise.ravel()
        return math.log(slope.mu) + BARRIER * wall, gradient

    def smaller(self, found: Found, target: float, T2: fmpq, decay: fmpq) -> Found:
        """Gains of smaller size whose gamma stays below a target."""
        for part in SMALLER:
            while made := self.reduced(found, part, target, T2, decay):
                found = made
        return found

    def reduced(self, found: Found, part: float, target: float, T2: fmpq, decay: fmpq) -> Found | None:
        """Gains within part of the size of others whose gamma is below a target; None if none are found."""
        kappa = part * found.size
        if not kappa:
            return None
        first = self.measured(scaled(found.gains, INSIDE * part), T2, decay)
        if first is None:
            starts = (self.measured(gains, T2, decay) for gains in self.starts(kappa, T2, decay))
            first = min((f for f in starts if f), key=lambda f: f.gamma, default=None)
        made = first and self.descended(first, kappa, T2, decay, SOME)
        return made if made and self.analysis(made.gains).gamma(T2, decay) <= target else None

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
