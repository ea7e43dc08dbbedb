"""What acts on the plant in a simulation: known inputs, disturbance, noise, measurements, and when they jump."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import cast

import numpy as np
from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.families.guarantee import Guarantee, SampledGuarantee
from obsdesign.families.noise import channels as channels_of_noise
from obsdesign.lmi.formula import Array, Float, identity, zeros
from obsdesign.model.ahead import ahead, later
from obsdesign.model.disturbance import augment, with_inputs
from obsdesign.model.equations import Equations
from obsdesign.model.filtered import channels
from obsdesign.records import dataclass, field, replace
from obsdesign.simulate.clock import Clock, clock_of, following
from obsdesign.simulate.recorded import Recordings, recordings
from obsdesign.simulate.sampling import Sampling, Schedule, schedule
from obsdesign.spec import Spec
from obsdesign.trial import Noise, Simulation

Vector = Float
NOISE_SAMPLES = 1_000_000
LAST_TWO = 2  # that of the last sample in discrete time, which horizon / period does not count, and of the one after it
ROW = -2  # in place of the number of a measurement: a row of a file
JUMP = 1e-9  # of xm against its size: smaller is rounding


@dataclass(frozen=True)
class Stretch:
    """An interval in which everything is smooth, and what begins it."""

    start: float
    stop: float
    step: Vector  # jump of the known states of the disturbance model; empty where they do not jump
    measured: int | None  # number of the measurement that is received, from 0
    held: Vector  # noise of the outputs


@dataclass(frozen=True)
class Scenario:
    """The signals of a simulation, and the plant they act on.

    The disturbance comes in one of three ways.

    - v is given: it drives `plant`, the augmented plant, and xm is integrated with x (`known` is empty).
    - w is given and v follows from it: v drives the augmented plant, whose xm are known functions of time.
    - w is given and no v generates it (w depends on the states, say): it acts on the plant beside the
      disturbance model, whose true state stays zero. `unmodeled` says why.

    In discrete time signals are looked at at the instants of the clock, and may stand for those of the samples to come:
    t+ is the next instant (`model.ahead`).
    """

    plant: Equations  # states (x, xm), outputs (y, w)
    n: int  # states of the plant alone
    outputs: tuple[str, ...]  # names of y
    inputs: tuple[str, ...]  # names of w as the user calls it; among the outputs of `plant` it has those of `w`
    u: tuple[Expression, ...]
    known: tuple[Expression, ...]  # the true xm as functions of time, as far as they are not integrated
    v: tuple[Expression, ...]  # drive of `plant`: v, or w itself where it is unmodeled
    unmodeled: str
    horizon: float
    noise: Array  # (K, ny), row k held over [k, k + 1) periods, or of sample k; one row of zeros without noise
    period: float
    drive: tuple[str, ...]  # names of what a guarantee calls v
    clock: Clock | None = None  # of a plant in discrete time
    schedule: Schedule | None = None  # of the measurements, where y is known at instants only
    eta: Array | None = None  # (K, ny), noise of each of them
    noises: Mapping[str, tuple[str, fmpq]] = field(default_factory=dict)  # entries of v that are noise: output, number
    events: Mapping[str, Expression] = field(default_factory=dict)  # what ends the run where it becomes true, by name
    recorded: Recordings = field(default_factory=Recordings)  # signals of u, v that are in files: variables there

    @property
    def w(self) -> tuple[str, ...]:
        """Names of w among the outputs of the plant."""
        return tuple(self.plant.outputs)[len(self.outputs) :]

    @property
    def driving(self) -> tuple[Expression, ...]:
        """Signals of v in continuous time, as far as a guarantee is about them."""
        named = zip(self.plant.exogenous, self.v, strict=True)
        return tuple(signal for name, signal in named if name in self.drive)

    @property
    def integrated(self) -> int:
        """Number of the true states that are integrated."""
        return len(self.plant.states) - len(self.known)

    @property
    def timed(self) -> bool:
        """Whether v is of time alone: an expression of it, or in a file."""
        return not any(signal.names.difference({"t"}, self.recorded.variables) for signal in self.v)

    @property
    def noisy(self) -> bool:
        """Whether any noise acts on the outputs."""
        return bool(self.noise.any()) or (self.eta is not None and bool(self.eta.any()))

    def held(self, t: float | Vector, ahead: int = 0) -> Vector:
        """Noise at an instant, (ny,), or at instants (N,), (N, ny), or so many samples later."""
        tick = np.asarray(t / self.period) if self.clock is None else self.clock.number(t) + ahead
        return np.asarray(self.noise[np.minimum(tick, len(self.noise) - 1).astype(int)])

    def next(self) -> dict[str, Expression]:
        """Every signal of the plant and of what acts on it, a sample later, by its name."""
        plant, known = self.plant, self.plant.states[self.integrated :]
        acting = dict(zip((*known, *plant.inputs, *plant.exogenous), (*self.known, *self.u, *self.v), strict=True))
        now = {**plant.algebraic, **plant.outputs, **acting}
        states = {ahead(name): plant.dynamics[name] for name in plant.states[: self.integrated]}
        return states | {ahead(name): later(side) for name, side in now.items()}

    def xm(self, t: float) -> Vector:
        """Known states of the disturbance model at an instant, (nm,); empty where they are not known."""
        times = self.clock.named(t) if self.clock else {"t": t}
        return np.array([signal.scalar([*times])(*times.values()) for signal in self.known])

    def steps_of_xm(self, before: float, after: float) -> Vector:
        """Jump of the known xm at a break, (nm,); zero where it is no more than rounding."""
        low, high = map(self.xm, (before, after))
        step = high - low
        return np.where(np.abs(step) > JUMP * (1 + np.abs(low)), step, 0.0)

    def stretches(self, breaks: Sequence[tuple[float, float]]) -> Iterator[Stretch]:
        """Intervals between breaks (last double before, first after), rows of files, noise samples, measurements."""
        ticks = (self.period * np.arange(1, len(self.noise))).tolist()
        received = self.schedule.received.tolist() if self.schedule else []
        edges: list[tuple[float, float, int]] = [(before, after, -1) for before, after in breaks]
        edges += [(before, after, ROW) for before, after in self.recorded.edges(self.horizon)]
        edges += [(t, t, -1) for t in ticks if t < self.horizon]
        edges += [(t, t, k) for k, t in enumerate(received)]
        ends = [(0.0, 0.0, -1), *sorted(edges), (self.horizon, self.horizon, -1)]
        for (before, start, k), (stop, _, _) in pairwise(ends):
            step = self.steps_of_xm(before, start) if before < start and k != ROW else np.zeros(0)
            held = self.held(0.5 * (start + max(start, stop)))
            yield Stretch(start, max(start, stop), step, k if k >= 0 else None, held)


def scenario(spec: Spec, simulation: Simulation, sampled: bool) -> Scenario:
    """Signals of the `simulation` section of a spec; no noise is held where y is sampled, known at instants only.

    Raises `UsageError` if a nonlinearity has no f to simulate, or the noise has too many samples.
    """
    xm, v, unmodeled = disturbance(spec, simulation)
    plant = beside(spec) if unmodeled else spec.equations(with_inputs(spec.augmented, spec.generator, spec.reserved))
    outputs, inputs = spec.plant.outputs, spec.plant.exogenous
    still = np.zeros((1, len(outputs))), simulation.horizon
    n, clock = spec.plant.n, clock_of(spec, simulation.horizon)
    noise, period = still if sampled else noise_samples(simulation, len(outputs), 0 if clock is None else LAST_TWO)
    horizon = simulation.horizon if clock is None else float(clock.instants[-1])
    drive = plant.exogenous if unmodeled else drives(spec, plant.exogenous)
    acting = Scenario(plant, n, outputs, inputs, simulation.u, xm, v, unmodeled, horizon, noise, period, drive, clock)
    declared = simulation.noise.channels if simulation.noise else {}
    places = channels_of_noise(spec)[0 if unmodeled else 1] if declared else ()
    noises = {plant.exogenous[k]: each for k, each in zip(places, declared.items(), strict=True)}
    return replace(acting, events=simulation.events, noises=noises, recorded=recordings(spec, simulation))


def drives(spec: Spec, v: tuple[str, ...]) -> tuple[str, ...]:
    """Names of what a guarantee calls v, given those of v: of filtered estimates in part that of the next sample."""
    if spec.cancelled:
        return tuple(name for name, own in zip(v, spec.drives, strict=True) if own in spec.posed.exogenous)
    if not spec.observer.filtered:
        return v
    now, late = channels(spec.augmented)
    here, beyond = (tuple(name for name, one in zip(v, mask, strict=True) if one) for mask in (now, late))
    return (*here, *map(ahead, beyond))


def received(acting: Scenario, simulation: Simulation, sampling: Sampling, guarantee: Guarantee | None) -> Scenario:
    """Return the scenario with y known at instants only, and noise drawn anew at each.

    Whether the measurements keep to the intervals of a guarantee is asked of the schedule.

    Raises `UsageError` if the law gives an interval that is not positive.
    """
    intervals, loss, _ = map(np.random.default_rng, np.random.SeedSequence(simulation.seed).spawn(3))
    planned = schedule(sampling, simulation.horizon, intervals, loss)
    if guarantee is not None:
        proved = cast("SampledGuarantee", guarantee)
        planned = replace(planned, T1=proved.T1, T2=proved.T2, ahead=proved.ahead)
    eta = measurement_noise(simulation, (len(planned.received), len(acting.outputs)))
    return replace(acting, schedule=planned, eta=eta)


def measurement_noise(simulation: Simulation, size: tuple[int, int]) -> Array:
    """Noise of each of K measurements, (K, ny), the same for the same seed."""
    _, _, generator = map(np.random.default_rng, np.random.SeedSequence(simulation.seed).spawn(3))
    return draw(simulation.noise, generator, size)


def disturbance(spec: Spec, simulation: Simulation) -> tuple[tuple[Expression, ...], tuple[Expression, ...], str]:
    """xm(t) as far as it is known, the drive, and why the given w has no v if it has none."""
    w = simulation.w
    if w is None:
        return (), simulation.v or (Expression.number(0),) * len(spec.drives), ""
    at_rest = (Expression.number(0),) * len(spec.model_states)
    for name, signal, inverse in zip(spec.plant.exogenous, w, spec.generator.inverse, strict=True):
        if signal.names - {"t"} and inverse != (1,):
            return at_rest, w, f"{name} depends on the states, so that no v of time alone generates it"
    driven = spec.generator.drive(w, lambda signal: following(signal, spec))
    if driven is None:
        return at_rest, w, "the given w does not determine the v of this disturbance model"
    v, xm = driven
    return xm, v, ""


def beside(spec: Spec) -> Equations:
    """Augmented plant with w entering beside the disturbance model, which nothing drives."""
    model, nw = spec.generator, len(spec.plant.exogenous)
    Bm, Dq2 = (zeros((len(M), nw), like=[model.Dm]) for M in (model.Bm, model.Dq2))
    direct = replace(model, Bm=Bm, Dq2=Dq2, Dm=identity(nw, like=model.Dm))
    plant = augment(spec.plant, direct, spec.model_states, spec.plant.exogenous)
    width, quiet = 0, []
    for block in spec.nonlinearities:
        still = block if width < len(spec.plant.Cq) else replace(block, f=(Expression.number(0),) * len(block.f or ()))
        quiet.append(still)
        width += block.nq
    return replace(spec, nonlinearities=tuple(quiet)).equations(with_inputs(plant, direct, spec.reserved))


def noise_samples(simulation: Simulation, ny: int, more: int = 0) -> tuple[Array, float]:
    """Rows (K, ny) of noise, the same for the same seed, and the time (s) for which each is held; `more` of them."""
    noise = simulation.noise
    if noise is None:
        return np.zeros((1, ny)), simulation.horizon
    if noise.trouble:
        raise UsageError(Problem(noise.trouble, key="noise", id="OBS205"))
    count = int(np.ceil(simulation.horizon / noise.period)) + more
    if count > NOISE_SAMPLES:
        said = f"{count} samples in the horizon; at most {NOISE_SAMPLES} are allowed"
        key = "noise" if noise.channels else "simulation.noise.period"
        raise UsageError(Problem(said, key=key, id="OBS210"))
    return draw(noise, np.random.default_rng(simulation.seed), (count, ny)), noise.period


def draw(noise: Noise | None, generator: np.random.Generator, size: tuple[int, int]) -> Array:
    """Noise at random, (K, ny); zeros without."""
    if noise is None:
        return np.zeros(size)
    gaussian = noise.type == "gaussian"
    return noise.amplitude * (generator.standard_normal(size) if gaussian else generator.uniform(-1, 1, size))
