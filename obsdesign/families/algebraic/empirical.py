"""Numeric Kazantzis-Kravaris-Luenberger coordinates: filters of the outputs, and a fitted left inverse.

z' = lambda z + y and v' = lambda v + u, one of each for every lambda, output and input; the states are regressed on
polynomials of z, v, y and u along simulated runs. Nothing of it is proved: it is judged by runs that were not fitted,
in the transient from the whole domain and on what the plant settles to, and its name says that it is empirical.

Runs begin everywhere in the domain and are used from a few time constants of the filters on: runs that have settled
would teach nothing of the rest. The inputs are filtered too, since z depends on their past.
"""

from collections.abc import Mapping, Sequence
from functools import reduce
from itertools import combinations_with_replacement
from math import comb, prod
from typing import Any

import numpy as np
import numpy.typing as npt
from flint import fmpq

from obsdesign.errors import UndecidedError, UsageError
from obsdesign.expressions import Expression, constant
from obsdesign.expressions.exact import double
from obsdesign.expressions.tree import Variable, number, product
from obsdesign.families.algebraic.find import Finder, Search, explicit
from obsdesign.families.algebraic.region import Domain
from obsdesign.families.algebraic.scheme import added, scaled
from obsdesign.model.equations import Equations, Named, Typed, free
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, outward
from obsdesign.records import dataclass

Array = npt.NDArray[np.float64]
BURN_IN = 10  # time constants of the slowest filter before a run is used
WINDOW = 10  # time constants for which it is
LATE = 50  # time constants after which the plant has settled
STEP = 0.1  # of the Runge-Kutta method, in time constants of the fastest
STARTS = 60  # runs that are fitted, and as many others that judge
SAMPLES = 60  # instants of each
MOST_PRODUCTS = 300


@dataclass(frozen=True)
class Errors:
    """Root mean squares of the error of an estimate, over those of the state about its mean."""

    transient: float
    settled: float


@dataclass(frozen=True)
class Empirical:
    """Filters and a left inverse that was fitted."""

    dynamics: Named  # of the filters, in filters, outputs and inputs
    left_inverse: Named  # of each state that is not measured, in filters, outputs and inputs
    degree: int
    errors: Mapping[str, Errors]

    @property
    def sentence(self) -> str:
        """Test errors, relative to the spread of each state."""
        each = "; ".join(
            f"{name}: {e.transient:.2g} in the transient, {e.settled:.2g} settled" for name, e in self.errors.items()
        )
        return f"empirical, no guarantee: rms error on runs that were not fitted, relative to the spread; {each}"

    def written(self) -> dict[str, Any]:
        """Entry of a diagnosis."""
        return {
            "dynamics": {name: side.text for name, side in self.dynamics.items()},
            "left_inverse": {name: side.text for name, side in self.left_inverse.items()},
            "errors": {name: {"transient": e.transient, "settled": e.settled} for name, e in self.errors.items()},
        }


@dataclass(frozen=True)
class Bank:
    """A plant with filters of its outputs and inputs, to be run from many starts at once."""

    plant: Equations  # explicit, without disturbances; inputs are put in
    inputs: Named  # of t and the states
    filters: Mapping[str, tuple[fmpq, Expression]]  # lambda and what is filtered, in states and t, by name
    dynamics: Named  # of the filters, in filters, outputs and inputs

    @classmethod
    def of(cls, equations: Equations, inputs: Named, rates: Sequence[fmpq]) -> "Bank":
        """Filters of every output and input, for every rate."""
        plant = equations.substituted(inputs)
        taken = {"t", *equations.signals}
        filters: dict[str, tuple[fmpq, Expression]] = {}
        dynamics: dict[str, Expression] = {}
        for kind, signals in (("z", plant.outputs), ("v", inputs)):
            for signal, side in signals.items():
                for rate in rates:
                    name = free(f"{kind}{len(filters) + 1}", taken)
                    filters[name] = (rate, side)
                    dynamics[name] = added([scaled(rate, Expression.variable(name)), Expression.variable(signal)])
        return cls(plant, inputs, filters, dynamics)

    def run(self, begins: Array, starts: Array, ages: Array, step: float) -> dict[str, Array]:
        """Values (ages, runs) of all signals, of runs that begin at given times (runs) and states (states, runs).

        Runge and Kutta's method; the filters begin where they would rest.
        """
        states, n = self.plant.states, len(starts)
        names = ("t", *states)
        rates = [side.function(names) for side in self.plant.dynamics.values()]
        driven = [(double(rate), side.function(names)) for rate, side in self.filters.values()]

        def slope(t: Array, x: Array) -> Array:
            at = (t, *x[:n])
            moved = [rate(*at) for rate in rates]
            return np.array([*moved, *(k * z + side(*at) for (k, side), z in zip(driven, x[n:], strict=True))])

        x = np.vstack([starts, *(side(begins, *starts) / -k for k, side in driven)])
        age, found = 0.0, []
        with np.errstate(all="ignore"):
            for following in ages.tolist():
                count = max(1, int(np.ceil((following - age) / step)))
                h = (following - age) / count
                for t in (begins + age + h * i for i in range(count)):
                    a = slope(t, x)
                    b = slope(t + h / 2, x + h / 2 * a)
                    c = slope(t + h / 2, x + h / 2 * b)
                    x = x + h / 6 * (a + 2 * b + 2 * c + slope(t + h, x + h * c))
                found.append(x)
                age = following
        values = dict(zip((*states, *self.filters), np.moveaxis(np.array(found), 1, 0), strict=True))
        at = (begins + ages[:, None], *(values[name] for name in states))
        return values | {
            name: side.function(names)(*at) for name, side in {**self.plant.outputs, **self.inputs}.items()
        }


@dataclass(frozen=True)
class Polynomials:
    """Products of signals up to a degree."""

    scales: Mapping[str, float]  # of each signal
    products: list[tuple[str, ...]]

    @classmethod
    def of(cls, values: Mapping[str, Array], names: Sequence[str], degree: int) -> "Polynomials":
        """As many degrees as give not too many products."""
        while degree > 1 and comb(len(names) + degree, degree) > MOST_PRODUCTS:
            degree -= 1
        found = [p for k in range(degree + 1) for p in combinations_with_replacement(names, k)]
        return cls({name: float(np.abs(values[name]).max()) or 1.0 for name in names}, found)

    @property
    def degree(self) -> int:
        """Highest degree."""
        return len(self.products[-1])

    def matrix(self, values: Mapping[str, Array]) -> Array:
        """Values of the products, one a column."""
        scaled = {name: values[name] / scale for name, scale in self.scales.items()}
        one = np.ones_like(next(iter(values.values())))
        return np.stack([reduce(np.multiply, [one, *(scaled[name] for name in p)]) for p in self.products], axis=1)

    def expression(self, weights: Array) -> Expression:
        """Their sum with these weights."""
        coefficients = [w / prod(self.scales[name] for name in p) for w, p in zip(weights, self.products, strict=True)]
        powers = [[Variable(name) ** number(p.count(name)) for name in dict.fromkeys(p)] for p in self.products]
        return Expression.combination(
            [constant(repr(float(c)))[0] for c in coefficients], [Expression(product(each)) for each in powers]
        )


def fit(
    typed: Typed,
    inputs: Named,
    rates: Sequence[fmpq] = (),
    degree: int = 5,
    *,
    direct: bool = True,
    seed: int = 0,
) -> Empirical:
    """Fit a left inverse of filters to a plant, its disturbances 0.

    Parameters
    ----------
    typed
        The plant; its domain holds a bounded range of each state, in which the runs begin.
    inputs
        Each input as an expression of t and the states.
    rates
        Values of lambda, 1/s, all negative; default: 2 n - 1 of them, some times faster than the plant.
    degree
        Highest degree of a polynomial; lower where it would have more than 300 terms.
    direct
        Whether polynomials hold y and u beside their filters; without them the noise of the estimates is lower.

    Raises
    ------
    UsageError
        A state has no bounded range.
    UndecidedError
        Too few runs stay finite.
    """
    equations, domain = explicit(typed), typed.domain
    fast = Finder(equations, domain, Search()).rate
    unit = constant(f"{fast:.0e}")[0]
    rates = rates or [-unit * (3 + i) for i in range(2 * len(equations.states) - 1)]
    bank = Bank.of(equations, inputs, rates)
    taught, transient, settled = samples(bank, box_of(equations, domain), fast, np.random.default_rng(seed))
    at_once = (*equations.outputs, *inputs) if direct else ()
    polynomials = Polynomials.of(taught, (*bank.filters, *at_once), degree)
    features, judged = polynomials.matrix(taught), [(polynomials.matrix(part), part) for part in (transient, settled)]
    shown = {side.text for side in equations.outputs.values()}
    inverse, errors = {}, {}
    for name in (name for name in equations.states if name not in shown):
        weights: Array = np.linalg.lstsq(features, taught[name], rcond=1e-13)[0].astype(float)
        inverse[name] = polynomials.expression(weights)
        spread = float(np.std(transient[name])) or 1.0
        rms = [float(np.sqrt(np.mean((matrix @ weights - part[name]) ** 2))) for matrix, part in judged]
        errors[name] = Errors(*(each / spread for each in rms))
    return Empirical(bank.dynamics, inverse, polynomials.degree, errors)


def box_of(equations: Equations, domain: Domain) -> Array:
    """Range of each state, a row each; raises `UsageError` where one is not bounded."""
    box = np.array([outward(domain.get(name, EVERYWHERE)) for name in equations.states])
    for name, ends in zip(equations.states, box, strict=True):
        if not np.isfinite(ends).all():
            raise UsageError(
                f"system.domain: {name} has no bounded range, in which runs could begin; add one", id="OBS205"
            )
    return box


def samples(bank: Bank, box: Array, fast: float, draw: "np.random.Generator") -> list[dict[str, Array]]:
    """Signals of the runs that are fitted, and of others in the transient and once they have settled.

    They begin at different times, so that the inputs are met in every phase.
    """
    slowest, fastest = (f(abs(double(rate)) for rate, _ in bank.filters.values()) for f in (min, max))
    early, late = (np.linspace(first, first + WINDOW, SAMPLES) / slowest for first in (BURN_IN, LATE))
    starts = box[:, :1] + (box[:, 1:] - box[:, :1]) * draw.random((len(box), 2 * STARTS))
    begins = LATE / slowest * draw.random(2 * STARTS)
    runs = bank.run(begins, starts, np.concatenate([early, late]), STEP / max(fastest, fast))
    alive = np.all([np.isfinite(values).all(axis=0) for values in runs.values()], axis=0)
    fitted, others = np.flatnonzero(alive[:STARTS]), STARTS + np.flatnonzero(alive[STARTS:])
    if min(len(fitted), len(others)) < STARTS / 4:
        raise UndecidedError("most runs that begin in system.domain do not stay finite; make it smaller", id="OBS507")
    first, last = slice(0, SAMPLES), slice(SAMPLES, None)
    parts = [(first, fitted), (first, others), (last, others)]
    return [{name: values[rows][:, columns].ravel() for name, values in runs.items()} for rows, columns in parts]
