"""What every filter is made of: the plant written out, its copy, a covariance by names, the observer around them."""

from collections.abc import Mapping, Sequence

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.families.filters.request import FilterRequest
from obsdesign.families.filters.symbols import ZERO, Signals, jacobian, numbers, written_out
from obsdesign.families.observer import Copy, Correction, Observer, Supposed
from obsdesign.lmi.formula import Array, printed
from obsdesign.model.disturbance import with_inputs
from obsdesign.model.equations import Equations, Named, free
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec


@dataclass(frozen=True)
class Frame:
    """A plant with its disturbance model, x' = f(t, x, u, w, y) or x+ = f(..), y = h(t, x, u, w) + v, to be filtered.

    Raises `UsageError`: a nonlinearity has no f, or the plant has an algebraic loop.
    """

    spec: Spec
    request: FilterRequest
    plant: Equations
    copy: Copy
    signals: Signals
    f: Named  # by the names of the states
    h: Named  # by the names of the outputs
    hats: Mapping[str, str]  # names of estimates, by those of what they estimate

    @classmethod
    def of(cls, spec: Spec, request: FilterRequest) -> "Frame":
        """Frame of a spec."""
        plant = spec.equations(with_inputs(spec.augmented, spec.generator, spec.reserved))
        copy = Copy.of(plant)
        f, h = written_out(plant, spec.plant.outputs)
        hats = {twin: hat for hat, twin in copy.twins.items()}
        return cls(spec, request, plant, copy, Signals({*plant.signals, *copy.twins}), f, h, hats)

    @property
    def x(self) -> tuple[str, ...]:
        """States, with those of the disturbance model."""
        return self.plant.states

    @property
    def w(self) -> tuple[str, ...]:
        """What drives them."""
        return self.plant.exogenous

    @property
    def y(self) -> tuple[str, ...]:
        """Measured outputs."""
        return self.spec.plant.outputs

    @property
    def prior(self) -> dict[str, Expression]:
        """Estimates of (x, w) before a measurement: xhat and 0."""
        return {name: Expression.variable(self.hats[name]) for name in self.x} | dict.fromkeys(self.w, ZERO)

    def slopes(self, letter: str, of: Named, by: Sequence[str], at: Named) -> Array:
        """Derivatives at some estimates, each that is no number under a name."""
        return self.signals.matrix(letter, list(of), by, jacobian(of, by, at))

    def gains(self, K: Array) -> Array:
        """Gains K (n, ny) of what each output tells, by names."""
        named = [
            [self.signals.gain(y, f"K_{x}_{y}", K[a, b]) for b, y in enumerate(self.y)] for a, x in enumerate(self.x)
        ]
        return np.array(named, dtype=object).reshape(len(self.x), len(self.y))

    def covariance(self) -> tuple[dict[tuple[int, int], str], Array]:
        """Names of the upper triangle of P, by their places, and P (n, n)."""
        taken, x = self.signals.taken, self.x
        names = {(a, b): free(f"P_{i}_{j}", taken) for a, i in enumerate(x) for b, j in enumerate(x) if a <= b}
        n = range(len(x))
        return names, np.array([[Expression.variable(names[min(a, b), max(a, b)]) for b in n] for a in n])

    def begun(self, names: Mapping[tuple[int, int], str]) -> dict[str, Expression]:
        """P at first."""
        return {name: numbers(self.request.P0)[at] for at, name in names.items()}

    def measured(self, yhat: Sequence[Expression]) -> list[Expression]:
        """What is expected less what is measured, yhat - y."""
        return [hoped - Expression.variable(name) for hoped, name in zip(yhat, self.y, strict=True)]

    def constant(self, D: Array) -> Array:
        """Slopes of y by w as numbers, which they are for a filter in continuous time; raises `UsageError`."""
        for name, row in zip(self.y, D, strict=True):
            if any(entry.names for entry in row):
                said = f"how w enters {name} depends on the states; this filter takes a constant D"
                raise UsageError(Problem(said, key="observer.type", id="OBS406"))
        return np.array([[entry.scalar([])() for entry in row] for row in D]).reshape(D.shape)

    def modeled(self, known: Named) -> dict[str, Expression]:
        """Estimates of the disturbances that follow from the states of their model, where these are known."""
        shown = list(self.copy.outputs.items())[len(self.y) :]
        pairs = zip(self.spec.plant.exogenous, shown, self.spec.generator.Dm, strict=True)
        return {name: side.substituted(known) for name, (_, side), direct in pairs if not (direct != 0).any()}

    def fresh(self) -> "Frame":
        """The same with no signals yet, whose names are others."""
        return replace(self, signals=Signals(self.signals.taken))

    def flow(self, rates: Named, algebraic: Named) -> Observer:
        """What goes on in a step, without y: rates of its states, and signals that these need beside those here."""
        return Observer(rates, {}, self.spec.inputs, self.y, {**algebraic, **self.signals.sides})

    def of_flow(
        self, rates: Named, yhat: Named, initial: Named, supposed: Supposed, correction: Correction | None = None
    ) -> Observer:
        """Observer in continuous time with these rates of its states and these expected outputs, by their copies."""
        shown = {hat for hat, twin in self.copy.twins.items() if twin in self.w_shown}
        return Observer(
            dynamics=rates,
            estimates={
                **{name: Expression.variable(self.hats[name]) for name in self.x[: self.spec.plant.n]},
                **self.modeled({}),
            },
            inputs=self.spec.inputs,
            outputs=self.y,
            algebraic={**self.copy.algebraic, **yhat, **self.signals.sides},
            initial=initial,
            twins={hat: twin for hat, twin in self.copy.twins.items() if hat not in shown},
            correction=correction,
            supposed=supposed,
            silent=self.signals.gains,
        )

    @property
    def w_shown(self) -> tuple[str, ...]:
        """Outputs of the equations that are disturbances and not measured."""
        return tuple(name for name in self.plant.outputs if name not in self.y)

    def of_samples(
        self, steps: Named, corrected: Named, initial: Named, S: Array, yhat: Named | None = None
    ) -> Observer:
        """Observer in discrete time with these next states; filtered estimates are the corrected ones, (x, w)(k|k).

        `S`: covariance of y - yhat that is supposed; `yhat`: expected outputs, by their copies, where they are others
        than h at xhat.
        """
        filtered = self.request.estimate == "filtered"
        known = {self.hats[name]: corrected[name] for name in self.x} if filtered else {}
        copied = (*self.plant.algebraic, *(() if filtered else self.x), *(self.y if yhat else ()))
        return Observer(
            dynamics=steps,
            estimates={
                **{name: Expression.variable(self.hats[name]).substituted(known) for name in self.x},
                **self.modeled(known),
            },
            inputs=self.spec.inputs,
            outputs=self.y,
            algebraic={**self.copy.algebraic, **(yhat or {}), **self.signals.sides},
            initial={**(self.located if filtered else {}), **initial},
            twins={hat: twin for hat, twin in self.copy.twins.items() if twin in copied},
            supposed=Supposed(S, np.zeros(S.shape)),
            silent=self.signals.gains,
        )

    @property
    def located(self) -> dict[str, Expression]:
        """Where the prediction begins of filtered estimates, which are no copy of the state: at xhat0."""
        if self.spec.simulation is None:
            return {}
        values = zip(self.x, printed(self.spec.simulation.xhat0), strict=True)
        return {self.hats[name]: Expression.number(value) for name, value in values}
