"""What noise adds to a run without noise, as equations of all runs at once.

    d' = f(t, s + d, n) - f(t, s, 0),    n held over its period

where s is the run without noise and s + d each of the others. The plant and its inputs are the same in all of them:
only the states that the noise reaches, and the signals that depend on them, are computed for each.
"""

from collections.abc import Iterable, Iterator
from functools import cached_property
from itertools import pairwise

import numpy as np

from obsdesign.families.guarantee import Guarantee
from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass, replace
from obsdesign.simulate.collocation import NODES
from obsdesign.simulate.definitions import error, noise, rate
from obsdesign.simulate.groups import span
from obsdesign.simulate.program import UNIT, Program, needs, reach
from obsdesign.simulate.scenario import measurement_noise, noise_samples
from obsdesign.simulate.simulation import system_of
from obsdesign.spec import Spec
from obsdesign.trial import Simulation


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


class Perturbation:
    """What the noise of several seeds adds to the runs of an observer, of a spec with a `simulation`."""

    def __init__(
        self, spec: Spec, observer: Observer, seeds: tuple[int, ...], guarantee: Guarantee | None = None
    ) -> None:
        assert spec.simulation
        self.simulation: Simulation = spec.simulation
        self.noisy, self.quiet = (
            system_of(spec, simulation, observer, guarantee)
            for simulation in (spec.simulation, replace(spec.simulation, noise=None))
        )
        self.observer, self.acting = observer, self.noisy.scenario
        self.noises = np.stack([self.drawn(seed) for seed in seeds], axis=-1)  # (K, ny, S)
        system = self.noisy
        self.names = (*system.scenario.plant.states[: self.acting.n], *system.estimated)
        states = tuple(map(error, system.scenario.plant.states))
        self.signals = (*states[: self.acting.n], *map(error, system.estimated.values()), *states[self.acting.n :])
        self.definitions, self.inputs = system.program.definitions, system.program.inputs[1:]
        noises = tuple(name for name in map(noise, observer.outputs) if name in self.inputs)
        started = (name for name, side in observer.initial.items() if side.names.intersection(observer.outputs))
        self.moving = self.reached({*noises, *system.jumping, *started})
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
        X = self.whole.table(np.vstack([t, s, self.noisy.given(t, np.tile(noises, (len(t), 1))).T]))
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
