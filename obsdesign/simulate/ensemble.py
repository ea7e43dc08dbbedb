"""Runs of one observer that differ by their noise alone, together: what the noise of each adds to a run without noise.

The run without noise is that of LSODA, as for a single run. What is added, of all runs at once, goes by one step a
period, the same for stiff observers (`collocation`).
"""

from collections.abc import Sequence

import numpy as np

from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass, replace
from obsdesign.simulate.collocation import SLOW, WEIGHTS, Step
from obsdesign.simulate.definitions import error
from obsdesign.simulate.integrate import Flow, Segment, integrate
from obsdesign.simulate.perturbation import Interval, Perturbation
from obsdesign.simulate.scenario import Stretch
from obsdesign.simulate.simulation import follow, initial, system_of, tolerance
from obsdesign.simulate.sizes import balanced, sizes
from obsdesign.spec import Spec
from obsdesign.trial import Simulation

ACCURATE = 1e-6  # of the size of d: error of a step, against two of half its length
CHECKS = 8  # steps in which it is looked at
MOST_STEPS = 200_000  # after which they are not halved any more
SAME = 1e-9  # relative difference of lengths of steps that are one
RESOLVED = 1e-6  # of the state: the least size of d, since s + d has no more digits
MOST_ALONE = 20  # steps in which each run may go by itself
CHUNK = 4096  # instants in one table
EMPTY = np.zeros(0)


@dataclass(frozen=True)
class Spread:
    """What noise adds to estimates."""

    names: tuple[str, ...]  # of the estimates
    rms: Float  # (runs, estimates), over the window; NaN where it was not found
    t: Float  # (N,)
    errors: Float  # (N, estimates), of the first run


def spread(spec: Spec, observer: Observer, seeds: tuple[int, ...], window: tuple[float, float]) -> Spread:
    """What the noise of each seed adds to the estimates, over a window of time; of a spec with a `simulation`.

    Steps are halved until a step, held against two of half its length, is accurate to 1e-6 of what the noise adds. In
    discrete time each run is a recursion.
    """
    if spec.period is not None:
        return spread_of_samples(spec, observer, seeds, window)
    added, parts = Perturbation(spec, observer, seeds), 1
    while True:
        passage = Passage(added, [step for one in added.intervals for step in one.parts(parts)], window)
        if passage.follow() or 2 * len(passage.steps) > MOST_STEPS:
            return passage.spread()
        parts *= 2


def spread_of_samples(spec: Spec, observer: Observer, seeds: tuple[int, ...], window: tuple[float, float]) -> Spread:
    """What noise adds to the estimates in discrete time: each run less that without noise, sample by sample."""
    assert spec.simulation
    trials = [replace(spec.simulation, noise=None), *(replace(spec.simulation, seed=seed) for seed in seeds)]
    runs = [errors_of(spec, observer, trial) for trial in trials]
    (names, t, quiet), found = runs[0], [errors for _, _, errors in runs[1:]]
    inside = (t >= window[0]) & (t <= window[1])
    rms = [
        np.sqrt(np.mean((errors - quiet)[inside] ** 2, axis=0))
        if errors.shape == quiet.shape and inside.any()
        else np.full(len(names), np.nan)
        for errors in found
    ]
    return Spread(names, np.array(rms), t[: len(found[0])], found[0])


def errors_of(spec: Spec, observer: Observer, simulation: Simulation) -> tuple[tuple[str, ...], Float, Float]:
    """Names of the estimates, samples (N,) up to where the run got, and errors (N, estimates)."""
    system = system_of(spec, simulation, observer)
    acting, start = system.scenario, initial(system, simulation, None)
    found = follow(system, start, [], EMPTY)
    estimated = dict(zip(acting.w, acting.inputs, strict=True))
    wanted = [*acting.plant.states[: acting.n], *system.estimated.values()]
    with np.errstate(all="ignore"):
        table = system.table(found.t, found.s)
    return tuple(estimated.get(name, name) for name in wanted), found.t, table.of(map(error, wanted))


class Reference:
    """The run without noise at some instants, and signals of it."""

    def __init__(self, added: Perturbation, instants: Float) -> None:
        system = added.quiet
        start = initial(system, added.simulation, None)
        found = follow(system, start, system.breaks(), instants)
        self.t, self.s = found.t, found.s[:, : system.width]
        self.end = min(found.time, float(self.t[-1]))  # of a run that escapes, the last instant before
        chunks = [slice(i, i + CHUNK) for i in range(0, len(self.t), CHUNK)]
        tables = [added.table(self.t[k], self.s[k].T) for k in chunks]
        self.values, self.given = np.split(np.hstack(tables), [len(added.wanted)])  # (signals, instants)
        self.moving = self.s[:, [system.flowing.index(name) for name in added.moving]].T

    def places(self, instants: Float) -> Array:
        """Numbers of some of the instants."""
        return np.searchsorted(self.t, instants)


class Passage:
    """One passage through all steps."""

    def __init__(
        self, added: Perturbation, steps: Sequence[Interval], window: tuple[float, float], samples: Float = EMPTY
    ) -> None:
        self.added, self.steps, self.window = added, steps, window
        self.checked = {len(self.steps) * (2 * k + 1) // (2 * CHECKS) for k in range(CHECKS)}
        instants = [np.array([step.start, *step.nodes]) for step in self.steps]
        instants.append(np.append(samples, self.steps[-1].start + self.steps[-1].length))
        instants += [half.nodes for k in self.checked for half in self.steps[k].parts(2)]
        instants.append(np.array([step.before for step in self.steps if step.measured is not None]))
        self.reference = Reference(added, np.unique(np.concatenate(instants)))
        count = added.X.shape[2]
        self.d = np.zeros((len(added.moving), count))
        self.size = RESOLVED * np.abs(self.reference.moving).max(axis=1, initial=0.0)
        self.squares, self.weight = np.zeros((len(added.names), count)), 0.0
        self.J, self.made = np.zeros((len(self.d), len(self.d))), dict[float, Step]()
        self.unit = np.ones(len(self.d))  # in which it is balanced
        self.slow = True  # with this J
        self.N: Float | None = None  # at the nodes of the last step; None where it went one by one
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
                self.d, at, found = self.advance(step, self.d)
            except ArithmeticError:
                self.alone, self.N = self.alone + 1, None
                if self.alone > MOST_ALONE:
                    return False
                try:
                    self.d, at, found = self.one_by_one(step, self.d)
                except ArithmeticError:
                    return False
            self.size = np.maximum(self.size, np.abs(self.d).max(axis=1))
            self.keep(step, at, found)
        self.done = True
        return True

    def begin(self) -> None:
        """Start with what the noise of the first sample adds to initial values that depend on y."""
        added, system = self.added, self.added.noisy
        if not added.observer.initial or added.observer.jump:
            return
        start = initial(added.quiet, added.simulation, None)[: system.width]
        moving = [system.flowing.index(name) for name in added.moving]
        begun = [
            system.with_initial(start.copy(), system.given(0.0, noises))[moving]
            for noises in (system.silent, *added.noises[0].T)
        ]
        self.d = np.column_stack(begun[1:]) - begun[0][:, None]

    def receive(self, step: Interval, k: int) -> None:
        """Let a measurement make its jump."""
        added, system = self.added, self.added.noisy
        held = added.noises[k]
        s = np.repeat(self.reference.s[self.reference.places(np.array([step.before]))].T, held.shape[1] + 1, axis=1)
        s[[system.flowing.index(name) for name in added.moving], 1:] += self.d
        t = np.full((1, s.shape[1]), step.start)
        X = system.jumps.table(np.vstack([t, s, system.arriving(k, np.column_stack([np.zeros(len(held)), held]))]))
        found = X[system.landing[: len(system.jumping)]]
        self.d[[added.moving.index(name) for name in system.jumping]] = found[:, 1:] - found[:, :1]

    def accurate(self, step: Interval) -> bool:
        """Whether a step ends where two of half its length do."""
        whole = halves = self.d
        whole, _, _ = self.advance(step, whole)
        for half in step.parts(2):
            halves, _, _ = self.advance(half, halves)
        size = np.maximum(self.size, np.abs(halves).max(axis=1))
        return bool((np.abs(whole - halves).max(axis=1) <= ACCURATE * size).all())

    def advance(self, step: Interval, d: Float) -> tuple[Float, Float, Float]:
        """Return what follows d, and at the nodes d (m, 3, runs) and errors less those without noise (errors, 3, runs).

        The Jacobian of an earlier step serves as long as the iteration is quick with it.
        """
        added, X, rows, m = self.added, self.added.X, self.added.rows, len(d)
        places = self.reference.places(step.nodes)
        X[1], X[added.given_rows] = step.nodes[:, None], self.reference.given[:, places, None]
        X[added.noise_rows] = self.held(step)[:, None]
        quiet, base = self.reference.values[:, places, None], self.reference.moving[:, places, None]

        def rates(at: Float) -> Float:
            np.add(base, at, out=X[rows])
            added.fill()
            return np.asarray(X[added.rates] - quiet[:m])

        fresh = self.renewed(step, d) if self.slow else False
        try:
            end, at, self.N, count = self.matrices(step.length).advance(d, rates, self.size)
        except ArithmeticError:
            if fresh:
                raise
            self.renewed(step, d)
            end, at, self.N, count = self.matrices(step.length).advance(d, rates, self.size)
        self.slow = count >= SLOW
        return end, at, X[added.found[m:]] - quiet[m:]

    def one_by_one(self, step: Interval, d: Float) -> tuple[Float, Float, Float]:
        """As `advance`, by LSODA for each run, in steps that change too much for one Jacobian.

        Raises `ArithmeticError` where one has no value.
        """
        added, system, m = self.added, self.added.noisy, len(d)
        start, end = self.reference.s[self.reference.places(np.array([step.start]))[0]], step.start + step.length
        whole, still = np.concatenate((start, system.still)), np.zeros(len(system.silent))
        samples = np.array([step.start, *step.nodes, end])
        flow = Flow(system.rhs, system.jacobian, system.end, sizes(system, whole), system.watch)
        moving = [system.flowing.index(name) for name in added.moving]
        found = []
        for held, more in zip((still, *self.held(step).T), (np.zeros(m), *d.T), strict=True):
            s = whole.copy()
            s[moving] += more
            stretch = Stretch(step.start, end, np.zeros(0), None, held)
            segment = Segment(step.start, end, lambda s: s, system.held(stretch))
            got = integrate(flow, s, [segment], samples, tolerance(whole, system))
            if got.status != "done":
                raise FloatingPointError(got.reason)
            table = added.table(samples[1:-1], got.s[1:-1, : system.width].T, held)
            found.append((got.s[-1, moving], got.s[1:-1, moving].T, table[m : len(added.wanted)]))
        parts = [np.stack(part, axis=-1) for part in zip(*found, strict=True)]
        ends, at, signals = (part[..., 1:] - part[..., :1] for part in parts)
        return ends, at, signals

    def held(self, step: Interval) -> Float:
        """Noise that acts on each run in a step, (outputs or none, runs)."""
        added = self.added
        quiet = added.observer.jump
        return np.zeros((len(added.noisy.silent), added.X.shape[2])) if quiet else added.noises[step.tick]

    def renewed(self, step: Interval, d: Float) -> bool:
        """Take the Jacobian anew, in the middle of a step."""
        place = self.reference.places(step.nodes)[1]
        moving = self.reference.moving[:, place] + d.mean(axis=1)
        self.J, self.made = self.added.jacobian(step.nodes[1], moving, self.reference.given[:, place]), {}
        self.unit = balanced(self.J)
        return True

    def matrices(self, length: float) -> Step:
        """Matrices of a step of this length."""
        for known, made in self.made.items():
            if abs(known - length) <= SAME * length:
                return made
        return self.made.setdefault(length, Step.of(self.J, length, self.unit))

    def keep(self, step: Interval, at: Float, found: Float) -> None:  # noqa: ARG002
        """Add to the squares of the window, and to what is drawn."""
        inside = (step.nodes >= self.window[0]) & (step.nodes <= self.window[1])
        weights = step.length * WEIGHTS * inside
        count = len(self.added.names)
        self.squares += np.einsum("k,ekr->er", weights, found[:count] ** 2)
        self.weight += weights.sum()
        self.t.append(float(step.nodes[1]))
        quiet = self.reference.values[len(self.d) :, self.reference.places(step.nodes)[1]]
        self.errors.append((found[:, 1, 0] + quiet)[:count])

    def spread(self) -> Spread:
        """What was found; nothing of a passage that was not finished."""
        found = self.squares / self.weight if self.done and self.weight else np.full_like(self.squares, np.nan)
        errors = np.array(self.errors).reshape(len(self.t), len(self.added.names))
        return Spread(self.added.names, np.sqrt(found).T, np.array(self.t), errors)
