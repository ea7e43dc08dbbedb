"""An observer as equations: what a simulation, recorded data, exported code and a statement in words all read."""

from collections.abc import Mapping, Sequence

import numpy as np

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, Exact
from obsdesign.model.equations import Equations, Named, free, linear, total
from obsdesign.records import dataclass, field, replace


@dataclass(frozen=True)
class Supposed:
    """Covariance of y - yhat that a filter supposes before it knows y: states + white / h, h the time between rows."""

    states: Array  # (ny, ny) of expressions
    white: Array  # (ny, ny), intensity of what is white in y, unit^2 s; zero in discrete time


@dataclass(frozen=True)
class Correction:
    """How an observer in continuous time takes a y that is held for a time h, where it runs in steps of its own.

    First follows from s and y where the step begins, r = b(t, s, u, y, h); r goes on for h without y, as another
    observer says; and where it ends, s = e(r, h).
    """

    span: str  # name of h, s
    begin: Named  # r, by the names of the states of the flow
    algebraic: Named  # signals that these need
    flow: "Observer"
    end: Named  # s, by the names of the states
    closing: Named  # signals that these need
    silent: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # as of an observer, of `algebraic` here


@dataclass(frozen=True)
class Observer:
    """An observer over named signals, driven by the known inputs u and the measured outputs y of a plant.

    s'    = f(t, s, u, y, a)        or, in discrete time, s+ = f(..)
    a     = g(t, s, u, y, a)
    xhat  = h(t, s, u, y, a)
    s - T x is an error too, of states that follow T x: their dynamics copy those of T x
    s+    = j(t, s, u, y, a, r)     at a measurement, of the states that jump
    r     = k(t, s, u, y, a, gap)   at a measurement, the time `gap` after the one before it, or after the start

    The algebraic signals a, such as yhat and the arguments of nonlinearities, may depend on themselves: the equations
    are implicit then. Where there are jumps, y is known at a measurement only. In discrete time all may depend on t, u
    and y of the next sample too, t+, u+ and y+ (`model.ahead`), where the estimate of a sample knows its y.

    Raises `UsageError`: a right side has a name that is no signal, or needs y between two measurements.
    """

    dynamics: Named  # by the names of the states s
    estimates: Named  # by the names of what they estimate
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    algebraic: Named = field(default_factory=dict)
    jump: Named = field(default_factory=dict)  # by the names of the states that a measurement changes
    received: Named = field(default_factory=dict)  # signals that exist at a measurement only
    gap: str = ""  # name of the time since the measurement before, s, which these may depend on
    initial: Named = field(default_factory=dict)  # of states that copy none, where not 0: of t, u and y at the start
    located: Named = field(default_factory=dict)  # where such states begin at an estimate of x: of its names too
    twins: Mapping[str, str] = field(default_factory=dict)  # signals that copy one of the plant, and which
    follows: Named = field(default_factory=dict)  # states that follow a combination of those of the plant, and which
    following: tuple[str, ...] = ()  # names of what it knows of the next sample: t+, u+, y+
    proved: bool = False  # to estimate, by what bounds no run
    intervals: tuple[float, float] | None = None  # s, shortest and longest between measurements that it is made for
    supposed: Supposed | None = None  # of a filter
    correction: Correction | None = None  # what a step is in place of one of its equations, where it has such
    silent: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # algebraic signals that are 0 where an output
    # is not known, by its name: of a filter, whose covariance takes nothing from it then

    def __post_init__(self) -> None:
        known = {"t", *self.dynamics, *self.inputs, *self.algebraic, *self.following}
        between = known if self.jump else known | set(self.outputs)
        for part in (self.dynamics, self.algebraic, self.estimates):
            self.require(part, between)
        self.require(self.received, known | {*self.outputs, self.gap})
        self.require(self.jump, known | {*self.outputs, *self.received})
        self.require(self.initial, {"t", *self.inputs, *self.outputs})

    def require(self, part: Named, names: set[str]) -> None:
        """Refuse a right side with a name that is none of these."""
        for side in part.values():
            if measured := sorted(side.names.difference(names).intersection(self.outputs)):
                text = f"{side} needs {measured[0]}, which the observer does not know between two measurements"
                raise UsageError(text, id="OBS308")
            if stray := sorted(side.names.difference(names)):
                raise UsageError(f"{stray[0]} in {side} is no signal of the observer", id="OBS203")

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return tuple(self.dynamics)

    @property
    def own(self) -> tuple[str, ...]:
        """Names of the states that copy none of the plant, and follow none."""
        return tuple(name for name in self.dynamics if name not in self.twins and name not in self.follows)

    def following_errors(self, states: Sequence[str], e: Array) -> Array:
        """T e of the states that follow T x, which begin at T xhat0; e (n,) over the named states of the plant."""
        return np.array([side.scalar(states)(*e.tolist()) for side in self.follows.values()], dtype=float)


@dataclass(frozen=True)
class Copy:
    """The equations of a plant in its estimates, with what is not known of it left out, as an observer begins.

    The signal `x` of the plant is `hat_x` here; y in a right side is the measured one.
    """

    dynamics: dict[str, Expression]  # by the names of the estimates, likewise the others
    algebraic: dict[str, Expression]
    outputs: dict[str, Expression]
    twins: dict[str, str]

    @classmethod
    def of(cls, plant: Equations) -> "Copy":
        """Copy of a plant."""
        taken = set(plant.signals)
        hats = {name: free(f"hat_{name}", taken) for name, _ in plant.sides()}
        estimated = {
            **{name: Expression.variable(hats[name]) for name in (*plant.states, *plant.algebraic)},
            **dict.fromkeys(plant.exogenous, Expression.number(0)),
        }

        def copied(part: Named) -> dict[str, Expression]:
            return {hats[name]: side.substituted(estimated) for name, side in part.items()}

        twins = {hat: name for name, hat in hats.items()}
        return cls(copied(plant.dynamics), copied(plant.algebraic), copied(plant.outputs), twins)

    def corrected(self, what: Named, M: Exact, signals: Sequence[str]) -> dict[str, Expression]:
        """Right sides of the copy with a row of M times the named signals added to each."""
        return dict(zip(what, total(list(what.values()), linear(M, signals)), strict=True))


def injected(copy: Copy, L1: Exact, L2: Exact, outputs: tuple[str, ...]) -> Copy:
    """Copy with L1 (yhat - y) added to the rates of its states, and L2 (yhat - y) to the arguments of f."""
    signals = (*copy.outputs, *outputs)
    onto_x, onto_q = (np.hstack([L, -L]) for L in (L1, L2))
    dynamics = copy.corrected(copy.dynamics, onto_x, signals)
    return replace(copy, dynamics=dynamics, algebraic=copy.corrected(copy.algebraic, onto_q, signals))
