"""An observer as it is implemented: routines that run it in steps of a period."""

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import Array
from obsdesign.model.ahead import ahead
from obsdesign.model.equations import Equations, Named, free
from obsdesign.records import dataclass, field
from obsdesign.spec import Spec
from obsdesign.stepping.method import step as step_of
from obsdesign.stepping.method import taken_by
from obsdesign.stepping.motion import Motion, knows, motions
from obsdesign.stepping.routine import Routine, routine
from obsdesign.stepping.sharing import shared
from obsdesign.trial import Implementation

T_NEXT = ahead("t")


@dataclass(frozen=True)
class Implemented:
    """Routines of an observer, over its signals t, s, u and y by their names.

    step        s(t + period) from s(t), with u and y held from t on; of measurements at instants, without y
    part        the same over a time `dt`, s, of at most a period; none in discrete time
    jump        s after a measurement y
    estimate    what is estimated, from s, u and y at t
    predict     y as it is expected
    arguments   arguments of f in the observer, where it has a copy of them
    begin       s at the start, of states that begin at a function of t, u and y then
    locate      the same of states that begin at a function of an estimate of x
    regain      states at a row some outputs of which may not be known (`open_loop`)

    In discrete time a step is that of the plant; where estimates know y of their sample, it takes u and y of the sample
    that it reaches, t+, u+ and y+. A state `gap`, where there is one, is the time since the measurement before.
    """

    observer: Observer
    period: fmpq  # s
    method: str  # empty in discrete time
    plant_states: tuple[str, ...]  # names of x, which an estimate xhat0 at the start is over
    xhat0: Array  # where the estimate begins if nothing else is said, (n + nm,)
    expected: Named = field(default_factory=dict)  # y as it is expected before it is known, by the names of the outputs
    watched: Named = field(default_factory=dict)  # arguments of f that the types restrict, in the observer
    motions: Mapping[str, Motion] = field(default_factory=dict)  # of outputs that the estimates hold at once
    known: tuple[str, ...] = ()  # inputs that say of each output whether it is known, where some may not be
    regained: Named = field(default_factory=dict)  # states that depend on these at a row

    def __post_init__(self) -> None:
        if self.observer.following and any(name in self.observer.outputs for name in self.step.given):
            said = "a right side has y of the sample before the one that a step reaches, which it does not know"
            raise UsageError(f"{said}: this observer is not written in steps", id="OBS920")

    @property
    def width(self) -> tuple[int, int, int]:
        """Numbers of estimates, outputs, and arguments of f that are watched."""
        return len(self.observer.estimates), len(self.observer.outputs), len(self.watched)

    @property
    def foresees(self) -> bool:
        """Whether what is expected of y does not depend on it, so that it can stand for what is missing."""
        return not any(name in self.observer.outputs for name in self.predict.given)

    @property
    def begins_with(self) -> tuple[str, ...]:
        """Outputs without which no estimate begins: those that a start depends on, or that estimates hold at once."""
        needed = {*self.motions, *(self.begin.given if self.begin else ())}
        return tuple(name for name in self.observer.outputs if name in needed)

    @cached_property
    def dt(self) -> str:
        """Name of the time of a part of a step."""
        return free("dt", taken_by(self.observer))

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        gap = self.observer.gap
        return (*self.observer.states, gap) if gap else self.observer.states

    @property
    def begins(self) -> tuple[float, ...]:
        """Value of each state at the start; of those in `begin`, none that counts."""
        known = dict(zip((*self.plant_states, *self.model_states), map(float, self.xhat0), strict=False))
        twins, numbers = self.observer.twins, self.fixed
        return tuple(numbers.get(name, known.get(twins.get(name, ""), 0.0)) for name in self.states)

    @property
    def copied(self) -> tuple[tuple[int, int], ...]:
        """Places of the states that copy one of x, and the places of these in x."""
        twins = ((i, self.observer.twins.get(name)) for i, name in enumerate(self.states))
        return tuple((i, self.plant_states.index(twin)) for i, twin in twins if twin in self.plant_states)

    @cached_property
    def model_states(self) -> tuple[str, ...]:
        """Names of the states that are copied beside x: of the disturbance model."""
        copied = [self.observer.twins[name] for name in self.observer.states if name in self.observer.twins]
        return tuple(name for name in copied if name not in self.plant_states)

    @cached_property
    def fixed(self) -> Mapping[str, float]:
        """States that begin at a number."""
        return {name: side.scalar([])() for name, side in self.observer.initial.items() if not side.names}

    @cached_property
    def begin(self) -> Routine | None:
        """States that begin at a function of t, u and y; None where there are none."""
        moving = {name: side for name, side in self.observer.initial.items() if side.names}
        return self.routine((), {}, moving) if moving else None

    @cached_property
    def locate(self) -> Routine | None:
        """States that begin at a function of an estimate of x as well; None where there are none."""
        located = self.observer.located
        return self.routine(self.plant_states, {}, located) if located else None

    @cached_property
    def step(self) -> Routine:
        """Step of a period."""
        if not self.method:
            t, h = Expression.variable("t"), Expression.number(self.period)
            return self.routine((), {**self.observer.algebraic, T_NEXT: t + h}, self.observer.dynamics)
        return self.flowing(Expression.number(self.period))

    @cached_property
    def part(self) -> Routine | None:
        """Step over a time dt; None in discrete time."""
        return self.flowing(Expression.variable(self.dt)) if self.method else None

    def flowing(self, h: Expression) -> Routine:
        """Step over a time."""
        algebraic, following = step_of(self.observer, self.method, h, self.period)
        gap = self.observer.gap
        since = {gap: Expression.variable(gap) + h} if gap else {}
        return self.routine((self.dt,), algebraic, {**following, **since})

    @cached_property
    def jump(self) -> Routine | None:
        """What a measurement changes; None where y is known at all times."""
        if not self.observer.jump:
            return None
        gap = {self.observer.gap: Expression.number(0)} if self.observer.gap else {}
        known = {**self.observer.algebraic, **self.observer.received}
        return self.routine((), known, {**self.observer.jump, **gap})

    @cached_property
    def regain(self) -> Routine | None:
        """What a row changes by which outputs are known in it; None where that changes no state."""
        return self.routine((), self.observer.algebraic, self.regained) if self.regained else None

    @cached_property
    def estimate(self) -> Routine:
        """Estimates."""
        return self.routine((), self.observer.algebraic, self.observer.estimates)

    @cached_property
    def predict(self) -> Routine:
        """Outputs as they are expected before they are known; where a step waits for y, those at its end."""
        t, h = Expression.variable("t"), Expression.number(self.period)
        late = {T_NEXT: t + h} if self.observer.following else {}
        return self.routine((), {**self.observer.algebraic, **late}, self.expected)

    @cached_property
    def arguments(self) -> Routine:
        """Arguments of f."""
        return self.routine((), self.observer.algebraic, self.watched)

    def routine(self, further: tuple[str, ...], definitions: Named, results: Named) -> Routine:
        """Routine over the signals of the observer, and further ones."""
        given = ("t", *self.states, *self.observer.inputs, *self.observer.outputs)
        late = tuple(name for name in self.observer.following if name != T_NEXT)
        known = tuple(dict.fromkeys((*given, *late, *further)))
        return shared(routine(known, definitions, results), {*known, *definitions})


def implemented(spec: Spec, observer: Observer, steps: Implementation | None = None) -> Implemented:
    """Observer of a spec in steps: those of the plant in discrete time, else the given ones or those of the spec.

    Raises `UsageError`: there are no steps, or these cannot be written.
    """
    xhat0 = spec.simulation.xhat0 if spec.simulation else np.zeros(spec.augmented.n)
    steps = steps or spec.implementation
    if spec.period is not None:
        period, method = spec.period, ""
    elif steps is not None:
        period, method = steps.period, str(steps.method)
    else:
        said = "is missing; write implementation: {period: 1.0e-3, method: rk4}"
        raise UsageError(Problem(said, key="implementation", id="OBS801"))
    hoped = expected(spec, observer)
    return Implemented(
        observer,
        period,
        method,
        spec.plant.states,
        xhat0,
        expected=hoped,
        watched=watched(spec, observer),
        motions=motions(observer, lambda: equations(spec), hoped, sampled=not method),
    )


def equations(spec: Spec) -> Equations:
    """Equations of the plant, without its disturbance model."""
    return spec.typed.equations if spec.typed else spec.equations(spec.plant)


def expected(spec: Spec, observer: Observer) -> Named:
    """Outputs as the observer expects them before it knows them: its own yhat, where it has one; else h, without w.

    h is taken at its estimates, and at its states where the estimates know y already. A disturbance that it estimates
    counts with its estimate. Where a step waits for y, it is the y at its end that is expected.
    """
    late = bool(observer.following)
    hats = {twin: hat for hat, twin in observer.twins.items()}
    own = {name: hats.get(ahead(name) if late else name) for name in observer.outputs}
    if all(hat in observer.algebraic for hat in own.values()):
        return {name: Expression.variable(str(hat)) for name, hat in own.items()}
    plant = equations(spec)
    known = {**dict.fromkeys(plant.exogenous, Expression.number(0)), **observer.estimates}
    known |= {
        name: Expression.variable(f"hat_{name}")
        for name in plant.states
        if f"hat_{name}" in observer.states and knows(observer, known[name])
    }
    inner = {name: side.substituted(known) for name, side in plant.algebraic.items()}
    return {name: plant.outputs[name].substituted(inner).substituted(known) for name in observer.outputs}


def watched(spec: Spec, observer: Observer) -> Named:
    """Arguments q of f in the observer, in the order of the spec; none where it has no copy of them."""
    hats = {twin: hat for hat, twin in observer.twins.items()}
    names = tuple(spec.equations(spec.augmented).algebraic) if spec.typed is None else ()
    if not all(hats.get(name) in observer.algebraic for name in names):
        return {}
    return {name: Expression.variable(hats[name]) for name in names}
