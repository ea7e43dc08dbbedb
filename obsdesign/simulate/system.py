"""Plant and observer as one flow with jumps, in the coordinates (state, estimation error)."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import cast

import numpy as np
from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.families.guarantee import Guarantee, Rates, SampledGuarantee
from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import Array, Float, rational_number
from obsdesign.model.ahead import ahead
from obsdesign.records import dataclass
from obsdesign.simulate.definitions import Definitions, after, error, event, measured, mismatch, noise, rate
from obsdesign.simulate.groups import is_zero
from obsdesign.simulate.integrate import Vector
from obsdesign.simulate.program import UNIT, Definition, Program, needs, reach
from obsdesign.simulate.scenario import Scenario, Stretch
from obsdesign.simulate.signals import largest_so_far
from obsdesign.simulate.switches import Break, Switches, Watch

INTEGRALS = ("integral of |z|^2", "integral of |v|^2", "bound on V")
Z2, V2 = "|z|^2", "|v|^2"


@dataclass(frozen=True)
class Affine:
    """Rates F (flowing states, held signals), where the held signals are constant between breaks."""

    F: Float
    held: tuple[str, ...]


def zero(sign: str) -> str:
    """Name of the function whose sign is held."""
    return f"function of the {sign}"


class System:
    """A plant with its observer and all that acts on them.

    The flow has the state

        s = (integrated true states, errors, further states of the observer, integral of |z|^2, integral of |v|^2, b)

    with b' = -2 alpha b + c |v|^2, so that V(t) <= exp(-2 alpha t) V(0) + b(t). Where measurements arrive at instants,
    s goes on with their number j and the last y, and b jumps by what the noise of each adds to V; without a guarantee b
    stays zero. A measurement changes further states, or errors where it corrects a copy of the plant, which itself goes
    on. z = H e, over all states of the plant. The signals of the observer have the same names as the plant's.
    """

    def __init__(self, scenario: Scenario, observer: Observer, H: Float, guarantee: Guarantee | None) -> None:
        self.scenario, self.observer, self.guarantee, self.H = scenario, observer, guarantee, H
        plant = scenario.plant
        noisy = bool(observer.jump) or scenario.noisy
        known = scenario.next() if observer.following else {}
        made = Definitions(plant, observer, noisy, added=not scenario.noises, next=known)
        made.made |= self.signals(made)
        self.z = tuple(f"z {k + 1}" for k in range(len(H)))
        for name, row in zip(self.z, H, strict=True):
            weights = zip(map(error, plant.states), map(rational_number, row), strict=True)
            made.made[name] = {signal: c for signal, c in weights if c != 0}
        made.define(Z2, Expression.squares(self.z))
        made.define(V2, Expression.squares(scenario.drive))
        made.made |= {event(name): condition for name, condition in scenario.events.items()}
        made.made |= dict(zip(map(rate, INTEGRALS), self.integrals(), strict=True))
        self.estimated = {
            name: w for name, w in zip(scenario.inputs, scenario.w, strict=True) if name in observer.estimates
        }
        for name, w in self.estimated.items():
            made.made[error(w)] = made.difference(observer.estimates[name], Expression.variable(w))
        self.integrated = plant.states[: scenario.integrated]
        self.copied, self.further, self.jumping = made.copied, made.further, made.jumping
        self.followed = made.followed
        self.corrections = tuple(name for name in self.further if name in observer.jump)
        self.flowing = (*self.integrated, *self.copied, *self.followed, *self.further)
        self.end = len(self.flowing)
        self.width = self.end + len(INTEGRALS)
        self.seen = tuple(map(measured, observer.outputs)) if noisy else observer.outputs  # y as it is measured
        self.silent = np.zeros(len(made.measurable) if noisy else 0)
        self.steady = (*(map(noise, observer.outputs) if noisy else ()), *scenario.recorded.inputs)
        self.still = np.zeros(1 + len(observer.outputs) if observer.jump else 0)
        states = (*self.flowing, *INTEGRALS)
        inputs = ("t", *states, *(noise(name) for name in made.measurable if noisy), *scenario.recorded.inputs)
        self.build(made, inputs, [*map(rate, states), *self.recorded(made), *map(event, scenario.events)])

    def build(self, made: Definitions, inputs: tuple[str, ...], outputs: list[str]) -> None:
        """Programs of the signals, of the flow with the signs held that decide its jumps, and of the measurements."""
        observer = self.observer
        self.switches = Switches()
        flow = reach(outputs, lambda name: needs(made.made[name]) if name in made.made else ())
        smooth = {name: self.switches.decided(side) for name, side in made.made.items() if name in flow}
        signs, deciding = (*self.switches.timed, *self.switches.others), tuple(map(zero, self.switches.others))
        smooth |= {zero(name): side for name, side in self.switches.smooth.items()}
        made.made |= {zero(name): side for name, side in self.switches.others.items()}
        self.program = Program(inputs, made.made, [*outputs, *deciding])
        rates = tuple(map(rate, (*self.flowing, *INTEGRALS)))
        self.smooth, self.turning = (Program((*inputs, *signs), smooth, wanted) for wanted in (rates, deciding))
        self.rates, self.deciding = self.smooth.places(rates), deciding
        jumps = (*map(after, self.jumping), *self.seen) if observer.jump else ()
        self.jumps = Program((*inputs, *filter(None, [observer.gap])), made.made, jumps)
        self.landing = self.jumps.places(jumps)
        self.leaping = [self.flowing.index(name) for name in self.jumping]

    def integrals(self) -> tuple[Definition, Definition, Definition]:
        """Rates of INTEGRALS."""
        rates = self.guarantee.rates() if self.guarantee else Rates(0.0, 0.0)
        b = {V2: rational_number(rates.c), INTEGRALS[2]: rational_number(-2 * rates.alpha)}
        return {Z2: fmpq(1)}, {V2: fmpq(1)}, b

    def signals(self, made: Definitions) -> dict[str, Definition]:
        """Known inputs, known states of the disturbance model, the drive, and what of these is in files."""
        acting, plant = self.scenario, self.scenario.plant
        known = zip(plant.states[acting.integrated :], acting.known, strict=True)
        pairs = (*zip(plant.inputs, acting.u, strict=True), *known, *zip(plant.exogenous, acting.v, strict=True))
        pairs = (*pairs, *acting.recorded.definitions.items())
        return {name: made.weights(signal) for name, signal in pairs} | dict(self.noises(made.measurable))

    def noises(self, measurable: Collection[str]) -> Iterator[tuple[str, Definition]]:
        """Entries of the drive that are noise of outputs, at a sample and where they are known at the next."""
        for name, (output, number) in self.scenario.noises.items():
            yield name, {noise(output): 1 / number}
            if ahead(output) in measurable:
                yield ahead(name), {noise(ahead(output)): 1 / number}

    def recorded(self, made: Definitions) -> list[str]:
        """Names of what a record of a run holds beside the rates of the flow, as far as they are no inputs."""
        plant, observer = self.scenario.plant, self.observer
        signals = (*plant.states, *plant.algebraic, *plant.outputs)
        wanted = [
            Z2, V2, *plant.inputs, *plant.exogenous, *signals, *map(rate, plant.states), *map(error, signals), *self.z,
            *map(rate, map(error, plant.states)), *map(measured, observer.outputs),
            *map(mismatch, made.further),
            *(hat for hat, twin in observer.twins.items() if twin in plant.algebraic),
        ]  # fmt: skip
        return [name for name in dict.fromkeys(wanted) if name in made.made]

    def rhs(self, t: float, s: Vector, held: Vector) -> Vector:
        """Rate of s, with jumps and kinks as the signs have it that are held."""
        return np.concatenate((self.smooth.run(t, s[: self.width], held)[self.rates], self.still))

    def jacobian(self, t: float, s: Vector, held: Vector) -> Float:
        """Jacobian of `rhs` with respect to s."""
        X = self.smooth.run(t, s[: self.width], held)
        J = np.zeros((len(s), len(s)))
        names = self.smooth.inputs[2 : 2 + self.width]
        J[: self.width, : self.width] = self.smooth.derivatives(X, names)[self.rates]
        return J

    def held(self, stretch: Stretch) -> Vector:
        """Inputs held in a stretch: noise, rows of files, signs of time alone, and of the states, not known as yet."""
        middle = 0.5 * (stretch.start + stretch.stop)
        return np.concatenate((
            self.given(middle, stretch.held[: len(self.silent)]),
            self.switches.at(middle),
            np.zeros(len(self.deciding)),
        ))  # fmt: skip

    @property
    def watch(self) -> Watch | None:
        """The jumps and kinks that depend on the states; None without any."""
        now, anew = (program.places(self.deciding) for program in (self.turning, self.program))

        def values(t: float, s: Vector, held: Vector) -> Vector:
            return self.turning.run(t, s[: self.width], held)[now]

        def true_values(t: float, s: Vector, held: Vector) -> Vector:
            return self.program.run(t, s[: self.width], held[: self.beside_states])[anew]

        names = tuple(g.text for g in self.switches.others.values())
        return Watch(names, values, true_values) if names else None

    def start(self, x0: Vector, xhat0: Vector, further: Vector) -> Vector:
        """Return the initial s for x0, (n,) or (n + nm,), for xhat0, (n + nm,), and for further states of the observer.

        The y of before the first measurement is the one at which nothing would jump.
        """
        acting = self.scenario
        x = np.zeros(len(acting.plant.states))
        x[: len(x0)] = x0
        x[acting.integrated :] = acting.xm(0.0)
        copied = [i for i, name in enumerate(acting.plant.states) if error(name) in self.copied]
        errors = np.concatenate([(xhat0 - x)[copied], self.observer.following_errors(acting.plant.states, xhat0 - x)])
        s = np.concatenate((x[: acting.integrated], errors, further, np.zeros(len(INTEGRALS))))
        if not self.observer.jump:
            return self.with_initial(s, self.beside(0.0))
        X, outputs = self.program.run(0.0, s, self.quiet(0.0)), self.observer.outputs
        errors, missing, y = map(self.program.places, (map(error, outputs), map(mismatch, self.corrections), outputs))
        supposed = -X[missing] if self.corrections else X[errors]  # yhat + theta, or yhat, less y
        return np.concatenate((s, [0.0], X[y] + supposed))

    def with_initial(self, s: Vector, held: Vector) -> Vector:
        """State with the further states of the observer where they begin: at functions of u and noisy y at t = 0."""
        if not self.observer.initial:
            return s
        X = self.program.run(0.0, s, held)
        known = {"t": 0.0, **dict(zip(self.observer.outputs, X[self.program.places(self.seen)], strict=True))}
        known |= dict(zip(self.observer.inputs, X[self.program.places(self.observer.inputs)], strict=True))
        own = {name: side for name, side in self.observer.initial.items() if name not in self.observer.follows}
        for name, side in own.items():
            s[self.flowing.index(name)] = side.scalar([*known])(*known.values())
        return s

    @cached_property
    def kicks(self) -> Vector:
        """What the noise of each measurement adds to V, (K,); infinite, and left out of b, where nothing bounds it."""
        schedule, eta = self.scenario.schedule, self.scenario.eta
        if self.guarantee is None or schedule is None or eta is None:
            return np.zeros(0 if eta is None else len(eta))
        timer = schedule.timer(schedule.received, np.arange(1, len(eta) + 1))
        return cast("SampledGuarantee", self.guarantee).added(eta, timer)

    def enter(self, stretch: Stretch, s: Vector) -> Vector:
        """Return the state with which a stretch begins: the error of xm jumps against xm, a measurement is received."""
        new, end = s.copy(), len(self.integrated) + len(self.copied)
        new[end - len(stretch.step) : end] -= stretch.step
        return new if stretch.measured is None else self.receive(stretch.measured, stretch.start, new)

    def receive(self, k: int, t: float, s: Vector) -> Vector:
        """Return the state after the measurement of number k, from 0, at t."""
        eta = self.scenario.eta
        assert eta is not None
        X = self.jumps.run(t, s[: self.width], self.arriving(k, eta[k]))[self.landing]
        s[self.leaping] = X[: len(self.leaping)]
        s[self.width - 1] += self.kicks[k] if np.isfinite(self.kicks[k]) else 0.0
        s[self.width] += 1
        s[self.width + 1 :] = X[len(self.leaping) :]
        return s

    def arriving(self, k: int, eta: Vector) -> Vector:
        """Inputs of a jump beside t and s: the noise (ny,) or (ny, N), files, the time since the measurement before."""
        schedule = self.scenario.schedule
        assert schedule
        known = [
            *self.scenario.recorded.held(float(schedule.received[k])),
            *[schedule.intervals[k]] * bool(self.observer.gap),
        ]
        return np.concatenate((eta, *(np.full((1, *eta.shape[1:]), value) for value in known)))

    def stopped(self, t: float, s: Vector, held: Vector) -> str:
        """Condition that is true at an instant and ends the run; empty if none is."""
        if not self.scenario.events:
            return ""
        return self.true_event(self.program.run(t, s[: self.width], held[: self.beside_states]))

    @property
    def beside_states(self) -> int:
        """Number of the inputs of the program beside the number 1, t and s."""
        return len(self.program.inputs) - self.width - 2

    def true_event(self, X: Vector) -> str:
        """Condition that is true, given the slots of the program; empty if none is."""
        if not (events := self.scenario.events):
            return ""
        true = X[self.program.places(map(event, events))] != 0
        return next((f"{n}: {e}" for (n, e), holds in zip(events.items(), true, strict=True) if holds), "")

    def constant(self) -> Affine | None:
        """The flow of a linear plant, with everything that acts on it constant between breaks; None of any other."""
        if self.scenario.events:
            return None
        definitions = self.program.definitions
        rows = [definitions[rate(name)] for name in self.flowing]
        linear = [row for row in rows if isinstance(row, Mapping)]
        held = tuple(dict.fromkeys(name for row in linear for name in row if name not in self.flowing))
        exactly = self.copied == tuple(map(error, self.scenario.plant.states))
        varying = [name for name in (*held, V2) if not is_constant(name, definitions, self.steady)]
        if len(linear) < len(rows) or not exactly or varying:
            return None
        columns = (*self.flowing, *held)
        F = np.array([[float(row.get(name, 0)) for name in columns] for row in linear])
        return Affine(F, held)

    def beside(self, t: float | Float) -> Float:
        """Inputs of the program beside t and s, at an instant, (m,), or at instants (N,), (N, m)."""
        return self.given(t, self.scenario.held(t)[..., : len(self.silent)])

    def quiet(self, t: float | Float) -> Float:
        """The same without noise."""
        return self.given(t, np.zeros((*np.shape(t), len(self.silent))))

    def given(self, t: float | Float, noises: Float) -> Float:
        """The same with some noise, (.., m)."""
        return np.concatenate((noises, self.scenario.recorded.held(t)), axis=-1)

    def accumulated(self, t: Float, s: Float, now: "Table", breaks: Sequence[Break]) -> "Accumulated":
        """What states (N, ns) at times t, with their signals, say of all that was up to each."""
        acting = self.scenario
        z2, v2, b = s[:, self.end : self.end + 3].T
        return Accumulated(z2, v2, largest_so_far(acting, breaks, t, now.of(acting.drive)), b, None)

    def table(self, t: Float, s: Float) -> "Table":
        """Signals along states s (N, ns) at times t; NaN outside the model's domain."""
        return Table(self.program, self.program.table(np.vstack([t, s[:, : self.width].T, self.beside(t).T])))

    def amplification(self) -> float:
        """How much larger than the errors of the states the error of an estimate of w is; at least 1."""
        made = [self.program.definitions[error(w)] for w in self.estimated.values()]
        weights = [pair for linear in made if isinstance(linear, Mapping) for pair in linear.items()]
        return max([1.0, *(abs(float(c)) for name, c in weights if name in self.copied)])

    def breaks(self) -> list[Break]:
        """Instants at which a signal or a term jumps or bends: the last double before, the first after."""
        return self.switches.breaks(self.scenario.horizon)


def is_constant(name: str, definitions: Mapping[str, Definition], steady: Collection[str]) -> bool:
    """Whether a signal is made of terms, and of inputs, that are constant between breaks."""
    if name == UNIT or name in steady:
        return True
    made = definitions.get(name)
    term = isinstance(made, Expression)
    if made is None or (isinstance(made, Expression) and not is_zero(made.derivative("t"))):
        return False
    return all(is_constant(other, definitions, steady) for other in needs(made) if other != "t" or not term)


@dataclass(frozen=True)
class Accumulated:
    """What a run has come to at each of its instants, as `Course` has it."""

    z2: Float
    v2: Float
    v_sup: Float
    b: Float
    v: Float | None  # |v| of samples


@dataclass(frozen=True)
class Table:
    """Signals of a program, by name, at many instants."""

    program: Program
    X: Float  # (slots, N)

    def of(self, names: Iterable[str]) -> Float:
        """Signals one beside the other, (N, names)."""
        return np.asarray(self.X[self.program.places(names)].T)

    def rows(self, which: Array) -> "Table":
        """Return the same at some of the instants."""
        return Table(self.program, self.X[:, which])

    @property
    def defined(self) -> Array:
        """Instants at which every signal has a value, (N,)."""
        return np.asarray(np.isfinite(self.X).all(axis=0))
