"""What acts on the plant in a simulation: known inputs, disturbance, noise, and when they jump."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, Exact, Float, identity, zeros
from obsdesign.model.disturbance import augment
from obsdesign.model.plant import Plant
from obsdesign.simulate.integrate import Segment, Vector
from obsdesign.simulate.stack import Stack, Term
from obsdesign.spec import Simulation, Spec

SWITCH_GRID = 20_000  # cells in which the sign of a switching function is watched
NOISE_SAMPLES = 1_000_000
JUMP = 1e-9  # of xm against its size: smaller is rounding


@dataclass(frozen=True)
class Scenario:
    """The signals of a simulation, and the plant they act on.

    The disturbance comes in one of three ways.

    - v is given: it drives `plant`, the augmented plant, and xm is integrated with x (`xm` is None).
    - w is given and v follows from it: v drives the augmented plant, whose xm are known functions of time.
    - w is given and no v generates it (w depends on the states, say): it acts on the plant beside the
      disturbance model, whose true state stays zero. `unmodeled` says why.
    """

    plant: Plant[Float]  # in doubles; states (x, xm)
    n: int  # states of the plant alone
    u: tuple[Expression, ...]
    xm: tuple[Expression, ...] | None
    v: tuple[Expression, ...]  # drive of `plant`: v, or w itself where it is unmodeled
    unmodeled: str
    noise: Array  # (K, ny), row k held over [k, k + 1) periods; one row of zeros without noise
    period: float
    horizon: float

    @property
    def integrated(self) -> int:
        """Number of the true states that are integrated."""
        return self.n if self.xm is not None else self.plant.n

    @property
    def known(self) -> tuple[Expression, ...]:
        """The true xm as functions of time, as far as they are not integrated."""
        return () if self.xm is None else self.xm

    def signals(self) -> Stack:
        """(u, xm, v) over the arguments (t, x)."""
        places = {"t": 0} | {name: i for i, name in enumerate(self.plant.states[: self.n], start=1)}
        return Stack([Term(e, places) for e in (*self.u, *self.known, *self.v)], 1 + self.n)

    def held(self, t: float) -> Vector:
        """Noise at an instant, (ny,)."""
        row: Vector = self.noise[min(int(t / self.period), len(self.noise) - 1)]
        return row

    def breaks(self, terms: Sequence[Expression]) -> list[tuple[float, float]]:
        """Instants at which a signal or a term jumps or bends: the last double before, the first after."""
        return switch_times([*self.u, *self.known, *self.v, *terms], self.horizon)

    def steps_of_xm(self, before: float, after: float) -> Vector:
        """Jump of the known xm at a break, (nm,); zero where it is no more than rounding."""
        xm = [e.scalar(["t"]) for e in self.known]
        low, high = (np.array([signal(t) for signal in xm]) for t in (before, after))
        step = high - low
        return np.where(np.abs(step) > JUMP * (1 + np.abs(low)), step, 0.0)

    def segments(self, breaks: list[tuple[float, float]], width: int) -> Iterator[Segment]:
        """Intervals between breaks and noise samples; the error of xm jumps against xm.

        Parameters
        ----------
        breaks
            As `breaks` gives them.
        width
            Length of the state of the flow: (true states, e, integrals).
        """
        ticks = self.period * np.arange(1, len(self.noise))
        edges = sorted([*breaks, *((t, t) for t in ticks.tolist() if t < self.horizon)])
        bounds = [(0.0, 0.0), *edges, (self.horizon, self.horizon)]
        for (before, start), (stop, _) in pairwise(bounds):
            jump = np.zeros(width)
            if before < start and self.known:
                end = self.integrated + self.plant.n
                jump[end - len(self.known) : end] = -self.steps_of_xm(before, start)
            yield Segment(start, max(start, stop), jump, self.held(0.5 * (start + max(start, stop))))


def scenario(spec: Spec, simulation: Simulation) -> Scenario:
    """Signals of the `simulation` section of a spec.

    Raises
    ------
    UsageError
        If a nonlinearity has no f to simulate, or the noise has too many samples.
    """
    missing = [i for i, block in enumerate(spec.nonlinearities, start=1) if block.f is None]
    if missing:
        raise UsageError(f"nonlinearities[{missing[0]}] has no `f`, which a simulation needs (a design does not)")
    xm, v, unmodeled = disturbance(spec, simulation)
    plant = (beside(spec) if unmodeled else spec.augmented).doubles
    noise, period = noise_samples(simulation, len(plant.outputs))
    n, horizon = spec.plant.n, simulation.horizon
    return Scenario(plant, n, simulation.u, xm, v, unmodeled, noise, period, horizon)


def disturbance(
    spec: Spec, simulation: Simulation
) -> tuple[tuple[Expression, ...] | None, tuple[Expression, ...], str]:
    """xm(t) where it is known, the drive, and why the given w has no v if it has none."""
    w = simulation.w
    if w is None:
        return None, simulation.v or (Expression.number(0),) * len(spec.drives), ""
    at_rest = (Expression.number(0),) * len(spec.model_states)
    for name, signal, inverse in zip(spec.plant.exogenous, w, spec.generator.inverse, strict=True):
        if signal.names - {"t"} and inverse != (1,):
            return at_rest, w, f"{name} depends on the states, so that no v of time alone generates it"
    driven = spec.generator.drive(w)
    if driven is None:
        return at_rest, w, "the given w does not determine the v of this disturbance model"
    v, xm = driven
    return xm, v, ""


def beside(spec: Spec) -> Plant[Exact]:
    """Augmented plant with w entering beside the disturbance model, which nothing drives."""
    model, nw = spec.generator, len(spec.plant.exogenous)
    Bm, Dq2 = (zeros((len(M), nw), like=[model.Dm]) for M in (model.Bm, model.Dq2))
    direct = replace(model, Bm=Bm, Dq2=Dq2, Dm=identity(nw, like=model.Dm))
    return augment(spec.plant, direct, spec.model_states, spec.plant.exogenous)


def noise_samples(simulation: Simulation, ny: int) -> tuple[Array, float]:
    """Rows (K, ny) of noise, the same for the same seed, and the time (s) for which each is held."""
    noise = simulation.noise
    if noise is None:
        return np.zeros((1, ny)), simulation.horizon
    count = int(np.ceil(simulation.horizon / noise.period))
    if count > NOISE_SAMPLES:
        raise UsageError(
            f"simulation.noise.period: {count} samples in the horizon; at most {NOISE_SAMPLES} are allowed"
        )
    generator = np.random.default_rng(simulation.seed)
    draw = generator.standard_normal if noise.type == "gaussian" else partial(generator.uniform, -1, 1)
    return noise.amplitude * draw(size=(count, ny)), noise.period


def switch_times(expressions: Sequence[Expression], horizon: float) -> list[tuple[float, float]]:
    """Instants in (0, horizon) at which a switching function of t alone changes its sign.

    Returns
    -------
    list of (before, after)
        Neighboring doubles, increasing. A zero of the function itself lies between two such pairs.
    """
    switches = [s for e in expressions for s in e.switches("t") if s.names == {"t"}]
    found = {pair for s in switches for pair in sign_changes(s, horizon)}
    return sorted(found)


def sign_changes(switch: Expression, horizon: float) -> Iterator[tuple[float, float]]:
    """Neighboring doubles between which a function of t changes its sign: seen on a grid, then bisected."""
    scalar = switch.scalar(["t"])

    def sign(t: float) -> float:
        return float(np.sign(scalar(t)))

    grid = np.linspace(0, horizon, SWITCH_GRID + 1)
    signs = np.sign(switch.function(["t"])(grid))
    for i in np.flatnonzero(signs[1:] != signs[:-1]):
        low, high = float(grid[i]), float(grid[i + 1])
        end = sign(high)
        while sign(low) != end:
            low, after = bisect(sign, low, high)
            yield low, after
            low = after


def bisect(sign: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    """Neighboring doubles in [low, high]: the sign of `low` at the first and another at the second."""
    start = sign(low)
    while low < (middle := 0.5 * (low + high)) < high:
        if sign(middle) == start:
            low = middle
        else:
            high = middle
    return low, high
