"""Runs of one observer that differ by their noise alone, together: what the noise of each adds to a run without noise.

    d' = f(t, s + d, n) - f(t, s, 0),    n held over its period

where s is the run without noise, that the LSODA of a single run finds, and s + d each of the others. The plant, its
inputs and s are shared; d, of all runs at once, goes by one step a period, the same for stiff observers.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import Array, Float
from obsdesign.simulate.collocation import NODES, SLOW, WEIGHTS, Step
from obsdesign.simulate.definitions import after, error, noise, rate
from obsdesign.simulate.groups import span
from obsdesign.simulate.integrate import Flow, Segment, integrate
from obsdesign.simulate.program import UNIT, Program, needs, reach
from obsdesign.simulate.scenario import Stretch, measurement_noise, noise_samples
from obsdesign.simulate.simulation import follow, initial, system_of, tolerance
from obsdesign.simulate.sizes import sizes
from obsdesign.spec import Simulation, Spec

ACCURATE = 1e-6  # of the size of d: error of a step, against two of half its length
CHECKS = 8  # steps in which it is looked at
FINEST = 64  # steps in a period, at most
SAME = 1e-9  # relative difference of lengths of steps that are one
RESOLVED = 1e-6  # of the state: the least size of d, since s + d has no more digits
MOST_ALONE = 20  # steps in which each run may go by itself
CHUNK = 4096  # instants in one table


@dataclass(frozen=True)
class Spread:
    """What noise adds to estimates."""

    names: tuple[str, ...]  # of the estimates
    rms: Float  # (runs, estimates), over the window; NaN of a run that has no value
    t: Float  # (N,)
    errors: Float  # (N, estimates), of the first run


@dataclass(frozen=True)
class Interval:
    """One step, between noise samples, breaks and measurements."""

    start: float
    length: float
    tick: int  # number of the noise sample
    measured: int | None  # number of the measurement that begins it

    def parts(self, count: int) -> Iterator["Interval"]:
        """The same in equal steps."""
        length = self.length / count
        for k in range(count):
            yield Interval(self.start + k * length, length, self.tick, None if k else self.measured)

    @property
    def nodes(self) -> Float:
        """Instants at which a step looks at the run without noise, (3,)."""
        return np.asarray(self.start + self.length * NODES)

    @property
    def before(self) -> float:
        """The last instant before the measurement that begins it."""
        return float(np.nextafter(self.start, 0.0))


class Reference:
    """The run without noise at some instants, and signals of it."""

    def __init__(self, ensemble: "Ensemble", instants: Float) -> None:
        system = ensemble.quiet
        start = initial(system, ensemble.simulation, None)
        found = follow(system, start, system.breaks(), instants)
        self.t, self.s, self.end = found.t, found.s[:, : system.width], found.time
        chunks = [slice(i, i + CHUNK) for i in range(0, len(self.t), CHUNK)]
        tables = [ensemble.table(self.t[k], self.s[k].T) for k in chunks]
        self.values, self.given = np.split(np.hstack(tables), [len(ensemble.wanted)])  # (signals, instants)
        self.moving = self.s[:, [system.flowing.index(name) for name in ensemble.moving]].T

    def places(self, instants: Float) -> Array:
        """Numbers of some of the instants."""
        return np.searchsorted(self.t, instants)


class Ensemble:
    """Runs of an observer with the noise of several seeds, of a spec with a `simulation`."""

    def __init__(self, spec: Spec, observer: Observer, seeds: tuple[int, ...]) -> None:
        assert spec.simulation
        self.simulation: Simulation = spec.simulation
        self.noisy, self.quiet = (
            system_of(spec, simulation, observer)
            for simulation in (spec.simulation, replace(spec.simulation, noise=None))
        )
        self.observer, self.acting = observer, self.noisy.scenario
        self.noises = np.stack([self.drawn(seed) for seed in seeds], axis=-1)  # (K, ny, S)
        system = self.noisy
        self.names = (*system.scenario.plant.states[: self.acting.n], *system.estimated)
        self.signals = [
            *map(error, system.scenario.plant.states[: self.acting.n]),
            *map(error, system.estimated.values()),
        ]
        self.definitions, self.inputs = system.program.definitions, system.program.inputs[1:]
        noises = tuple(name for name in map(noise, observer.outputs) if name in self.inputs)
        started = (name for name, side in observer.initial.items() if side.names.intersection(observer.outputs))
        self.moving = self.reached({*noises, *observer.jump, *started})
        self.wanted = (*map(rate, self.moving), *self.signals)
        moved = self.moved({*self.moving, *noises}, self.wanted)
        needed = {name for one in moved for name in needs(self.definitions[one])} | {*self.wanted}
        self.given = tuple(sorted(needed - moved - {*self.moving, *noises, UNIT, "t"}))  # the same in every run
        known = [name for name in (*self.wanted, *self.given) if name in self.definitions]
        self.whole = Program(self.inputs, self.definitions, known)
        definitions = {name: self.definitions[name] for name in moved}
        inputs = ("t", *self.moving, *noises, *self.given)
        self.program = Program(inputs, definitions, [name for name in self.wanted if name in moved])
        self.found = self.program.places(self.wanted)
        self.rates = span(self.found[: len(self.moving)])
        self.X = np.ones((len(self.program.slots), 3, len(seeds)))
        ends = np.cumsum([2, len(self.moving), len(noises), len(self.given)])
        self.rows, self.noise_rows, self.given_rows = (slice(*pair) for pair in pairwise(ends))

    def table(self, t: Float, s: Float, held: Float | None = None) -> Float:
        """What is wanted and given, one row a signal, at instants t (N,) and states s (width, N); by default quiet."""
        noises = np.zeros(len(self.noisy.silent)) if held is None else held
        X = self.whole.table(np.vstack([t, s, np.repeat(noises[:, None], len(t), axis=1)]))
        return np.asarray(X[self.whole.places((*self.wanted, *self.given))])

    def reached(self, sources: set[str]) -> tuple[str, ...]:
        """States that some signals move."""
        states = self.noisy.flowing[len(self.noisy.integrated) :]
        found = [name for name in states if name in sources or rate(name) in self.moved(sources, map(rate, states))]
        return tuple(found) if sources.issuperset(found) else self.reached(sources | {*found})

    def moved(self, sources: set[str], wanted: Iterable[str]) -> set[str]:
        """Signals that depend on some, of those that others need."""
        definitions = self.definitions
        needed = reach(wanted, lambda name: needs(definitions[name]) if name in definitions else ())
        found, before = set[str](), -1
        while before < len(found):
            before = len(found)
            found |= {n for n in needed if n in definitions and not (sources | found).isdisjoint(needs(definitions[n]))}
        return found

    def drawn(self, seed: int) -> Array:
        """Noise of a run, as it has it by itself: (samples or measurements, ny)."""
        simulation, acting = replace(self.simulation, seed=seed), self.acting
        if acting.eta is not None:
            return measurement_noise(simulation, acting.eta.shape)
        return noise_samples(simulation, len(acting.outputs))[0]

    @cached_property
    def intervals(self) -> list[Interval]:
        """Steps of the horizon."""
        acting = self.acting
        return [
            Interval(one.start, one.stop - one.start, int((0.5 * (one.start + one.stop)) / acting.period), one.measured)
            for one in acting.stretches(self.noisy.breaks())
            if one.stop > one.start
        ]

    def spread(self, window: tuple[float, float]) -> Spread:
        """What the noise adds over a window of time.

        Steps are halved until a step, held against two of half its length, is accurate.
        """
        parts = 1
        while True:
            run = Passage(self, parts, window)
            if run.follow() or parts == FINEST:
                return run.spread()
            parts *= 2

    def fill(self) -> None:
        """Compute the slots of X from its inputs."""
        flat, inputs = self.X.reshape(len(self.X), -1), len(self.program.inputs)
        if self.program.loops:
            for column in flat.T:
                column[:] = self.program.run(column[1], column[2:inputs], column[:0])
        else:
            for group in self.program.groups:
                group.fill(flat)

    def jacobian(self, t: float, moving: Float, given: Float) -> Float:
        """Jacobian of the rates of what the noise moves, without noise."""
        still = np.zeros(self.noise_rows.stop - self.noise_rows.start)
        X = self.program.run(t, np.concatenate((moving, still, given)), still[:0])
        return np.asarray(self.program.derivatives(X, self.moving)[self.rates])


class Passage:
    """One passage through all steps, each period in so many parts."""

    def __init__(self, ensemble: Ensemble, parts: int, window: tuple[float, float]) -> None:
        self.ensemble, self.window = ensemble, window
        self.steps = [step for one in ensemble.intervals for step in one.parts(parts)]
        self.checked = {len(self.steps) * (2 * k + 1) // (2 * CHECKS) for k in range(CHECKS)}
        instants = [np.array([step.start, *step.nodes]) for step in self.steps]
        instants += [half.nodes for k in self.checked for half in self.steps[k].parts(2)]
        instants.append(np.array([step.before for step in self.steps if step.measured is not None]))
        self.reference = Reference(ensemble, np.unique(np.concatenate(instants)))
        count = ensemble.X.shape[2]
        self.d = np.zeros((len(ensemble.moving), count))
        self.size = RESOLVED * np.abs(self.reference.moving).max(axis=1, initial=0.0)
        self.squares, self.weight = np.zeros((len(ensemble.names), count)), 0.0
        self.J, self.made = np.zeros((len(self.d), len(self.d))), dict[float, Step]()
        self.slow = True  # with this J
        self.alone = 0  # steps in which each run goes by itself
        self.t, self.errors, self.done = list[float](), list[Float](), False

    def follow(self) -> bool:
        """Whether the steps are accurate."""
        self.begin()
        for k, step in enumerate(self.steps):
            if step.start + step.length > self.reference.end:
                break
            if step.measured is not None:
                self.receive(step, step.measured)
            try:
                if k in self.checked and not self.accurate(step):
                    return False
                self.d, at = self.advance(step, self.d)
            except ArithmeticError:
                self.alone += 1
                if self.alone > MOST_ALONE:
                    return False
                try:
                    self.d, at = self.one_by_one(step, self.d)
                except ArithmeticError:
                    return False
            self.size = np.maximum(self.size, np.abs(self.d).max(axis=1))
            self.keep(step, at)
        self.done = True
        return True

    def begin(self) -> None:
        """Start with what the noise of the first sample adds to initial values that depend on y."""
        ensemble, system = self.ensemble, self.ensemble.noisy
        if not ensemble.observer.initial or ensemble.observer.jump:
            return
        start = initial(ensemble.quiet, ensemble.simulation, None)[: system.width]
        moving = [system.flowing.index(name) for name in ensemble.moving]
        begun = [system.with_initial(start.copy(), held)[moving] for held in (system.silent, *ensemble.noises[0].T)]
        self.d = np.column_stack(begun[1:]) - begun[0][:, None]

    def receive(self, step: Interval, k: int) -> None:
        """Let a measurement make its jump."""
        ensemble, system = self.ensemble, self.ensemble.noisy
        held = ensemble.noises[k]
        s = np.repeat(self.reference.s[self.reference.places(np.array([step.before]))].T, held.shape[1] + 1, axis=1)
        s[[system.flowing.index(name) for name in ensemble.moving], 1:] += self.d
        t = np.full((1, s.shape[1]), step.start)
        X = system.jumps.table(np.vstack([t, s, np.column_stack([np.zeros(len(held)), held])]))
        found = X[system.jumps.places(map(after, ensemble.observer.jump))]
        self.d[[ensemble.moving.index(name) for name in ensemble.observer.jump]] = found[:, 1:] - found[:, :1]

    def accurate(self, step: Interval) -> bool:
        """Whether a step ends where two of half its length do."""
        whole = halves = self.d
        whole, _ = self.advance(step, whole)
        for half in step.parts(2):
            halves, _ = self.advance(half, halves)
        size = np.maximum(self.size, np.abs(halves).max(axis=1))
        return bool((np.abs(whole - halves).max(axis=1) <= ACCURATE * size).all())

    def advance(self, step: Interval, d: Float) -> tuple[Float, Float]:
        """Return what follows d, and errors of estimates less those of the run without noise, (estimates, 3, runs).

        The Jacobian of an earlier step serves as long as the iteration is quick with it.
        """
        ensemble, X, rows, m = self.ensemble, self.ensemble.X, self.ensemble.rows, len(d)
        places = self.reference.places(step.nodes)
        X[1], X[ensemble.given_rows] = step.nodes[:, None], self.reference.given[:, places, None]
        X[ensemble.noise_rows] = self.held(step)[:, None]
        quiet, base = self.reference.values[:, places, None], self.reference.moving[:, places, None]

        def rates(at: Float) -> Float:
            np.add(base, at, out=X[rows])
            ensemble.fill()
            return np.asarray(X[ensemble.rates] - quiet[:m])

        fresh = self.renewed(step, d) if self.slow else False
        try:
            end, count = self.matrices(step.length).advance(d, rates, self.size)
        except ArithmeticError:
            if fresh:
                raise
            self.renewed(step, d)
            end, count = self.matrices(step.length).advance(d, rates, self.size)
        self.slow = count >= SLOW
        return end, X[ensemble.found[m:]] - quiet[m:]

    def one_by_one(self, step: Interval, d: Float) -> tuple[Float, Float]:
        """As `advance`, by LSODA for each run, in steps that change too much for one Jacobian.

        Raises `ArithmeticError` where one has no value.
        """
        ensemble, system, m = self.ensemble, self.ensemble.noisy, len(d)
        start, end = self.reference.s[self.reference.places(np.array([step.start]))[0]], step.start + step.length
        whole, still = np.concatenate((start, system.still)), np.zeros(len(system.silent))
        samples = np.array([step.start, *step.nodes, end])
        flow = Flow(system.rhs, system.jacobian, system.end, sizes(system, whole), system.watch)
        moving = [system.flowing.index(name) for name in ensemble.moving]
        found = []
        for held, added in zip((still, *self.held(step).T), (np.zeros(m), *d.T), strict=True):
            s = whole.copy()
            s[moving] += added
            stretch = Stretch(step.start, end, np.zeros(0), None, held)
            segment = Segment(step.start, end, lambda s: s, system.held(stretch))
            got = integrate(flow, s, [segment], samples, tolerance(whole, system))
            if got.status != "done":
                raise FloatingPointError(got.reason)
            found.append((got.s[-1, moving], ensemble.table(samples[1:-1], got.s[1:-1, : system.width].T, held)))
        ends, signals = (np.stack(part, axis=-1) for part in zip(*found, strict=True))
        signals = signals[m : len(ensemble.wanted)]
        return ends[:, 1:] - ends[:, :1], signals[..., 1:] - signals[..., :1]

    def held(self, step: Interval) -> Float:
        """Noise that acts on each run in a step, (outputs or none, runs)."""
        ensemble = self.ensemble
        quiet = ensemble.observer.jump
        return np.zeros((len(ensemble.noisy.silent), ensemble.X.shape[2])) if quiet else ensemble.noises[step.tick]

    def renewed(self, step: Interval, d: Float) -> bool:
        """Take the Jacobian anew, in the middle of a step."""
        place = self.reference.places(step.nodes)[1]
        moving = self.reference.moving[:, place] + d.mean(axis=1)
        self.J, self.made = self.ensemble.jacobian(step.nodes[1], moving, self.reference.given[:, place]), {}
        return True

    def matrices(self, length: float) -> Step:
        """Matrices of a step of this length."""
        for known, made in self.made.items():
            if abs(known - length) <= SAME * length:
                return made
        return self.made.setdefault(length, Step.of(self.J, length))

    def keep(self, step: Interval, added: Float) -> None:
        """Add to the squares of the window, and to what is drawn."""
        inside = (step.nodes >= self.window[0]) & (step.nodes <= self.window[1])
        weights = step.length * WEIGHTS * inside
        self.squares += np.einsum("k,ekr->er", weights, added**2)
        self.weight += weights.sum()
        self.t.append(float(step.nodes[1]))
        self.errors.append(added[:, 1, 0] + self.reference.values[len(self.d) :, self.reference.places(step.nodes)[1]])

    def spread(self) -> Spread:
        """What was found; nothing of a passage that was not finished."""
        with np.errstate(invalid="ignore"):
            rms = (
                np.sqrt(self.squares / self.weight) if self.done and self.weight else np.full_like(self.squares, np.nan)
            )
        return Spread(self.ensemble.names, rms.T, np.array(self.t), np.array(self.errors))
