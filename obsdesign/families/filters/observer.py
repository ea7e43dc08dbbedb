"""The extended Kalman filter in continuous time (Kalman and Bucy, 1961), as equations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.families.filters.request import FilterRequest
from obsdesign.families.observer import Copy, Observer
from obsdesign.lmi.formula import Array, printed
from obsdesign.model.disturbance import with_inputs
from obsdesign.model.equations import Equations, Named, free
from obsdesign.spec import Spec

ZERO = Expression.number(0)


@dataclass
class Signals:
    """Algebraic signals of an observer, under names that are free."""

    taken: set[str]
    sides: dict[str, Expression] = field(default_factory=dict)

    def matrix(self, letter: str, rows: Sequence[str], columns: Sequence[str], entries: Array) -> Array:
        """Matrix of expressions, each that is no number by a name."""
        return np.array(
            [
                [self.named(f"{letter}_{i}_{j}", entries[a, b]) for b, j in enumerate(columns)]
                for a, i in enumerate(rows)
            ],
            dtype=object,
        ).reshape(len(rows), len(columns))

    def named(self, name: str, side: Expression) -> Expression:
        """Variable of an expression; a number is itself."""
        if not side.names:
            return side
        name = free(name, self.taken)
        self.sides[name] = side
        return Expression.variable(name)


def observer(spec: Spec, request: FilterRequest) -> Observer:
    """Extended Kalman filter of a plant x' = f(t, x, u, w, y), y = h(t, x, u, w) + v, with its disturbance model.

    xhat' = f(t, xhat, u, 0, y) + K (y - yhat),               yhat = h(t, xhat, u, 0)
    P'    = A P + P A' + B Q B' - K S K',   P(0) = P0,        K = (P C' + B Q D') S^-1,   S = R + D Q D'
    A = df/dx, B = df/dw, C = dh/dx at xhat, D = dh/dw

    A measured y that stands in a right side is known. Raises `UsageError`: a nonlinearity has no f, D is not constant,
    or the plant has an algebraic loop.
    """
    outputs = spec.plant.outputs
    plant = spec.equations(with_inputs(spec.augmented, spec.generator, spec.reserved))
    copy = Copy.of(plant)
    y, w = split(copy.outputs, len(outputs))
    signals = Signals({*plant.signals, *copy.twins})
    x, hats = plant.states, {twin: hat for hat, twin in copy.twins.items()}
    names = {(a, b): free(f"P_{i}_{j}", signals.taken) for a, i in enumerate(x) for b, j in enumerate(x) if a <= b}
    P = np.array([[Expression.variable(names[min(a, b), max(a, b)]) for b in range(len(x))] for a in range(len(x))])
    K, rate = riccati(plant, outputs, request, signals, P, hats)
    innovation = np.array([[Expression.variable(name) - Expression.variable(hats[name])] for name in outputs])
    correction = times(K, innovation)[:, 0]
    modeled = zip(spec.plant.exogenous, w.values(), spec.generator.Dm, strict=True)
    return Observer(
        dynamics={
            **{hat: side + more for (hat, side), more in zip(copy.dynamics.items(), correction, strict=True)},
            **{name: rate[at] for at, name in names.items()},
        },
        estimates={
            **{name: Expression.variable(hats[name]) for name in x[: spec.plant.n]},
            **{name: side for name, side, direct in modeled if not (direct != 0).any()},
        },
        inputs=spec.inputs,
        outputs=outputs,
        algebraic={**copy.algebraic, **y, **signals.sides},
        initial={name: numbers(request.P0)[at] for at, name in names.items()},
        twins={hat: twin for hat, twin in copy.twins.items() if hat not in w},
    )


def riccati(
    plant: Equations,
    outputs: Sequence[str],
    request: FilterRequest,
    signals: Signals,
    P: Array,
    hats: Mapping[str, str],
) -> tuple[Array, Array]:
    """Gain K (n, ny), and P' (n, n)."""
    x, v = plant.states, plant.exogenous
    f, h = written_out(plant, outputs)
    at = {name: Expression.variable(hats[name]) for name in x} | dict.fromkeys(v, ZERO)

    def jacobian(letter: str, of: Named, by: Sequence[str]) -> Array:
        slopes = [side.derivative(name).substituted(at) for side in of.values() for name in by]
        return signals.matrix(letter, list(of), by, np.array(slopes, dtype=object).reshape(len(of), len(by)))

    A, B, C = jacobian("A", f, x), jacobian("B", f, v), jacobian("C", h, x)
    D = constant(jacobian("D", h, v), outputs)
    S = request.R + D @ request.Q @ D.T
    shared = times(B, numbers(request.Q @ D.T))
    K = signals.matrix("K", x, outputs, times(times(P, C.T) + shared, numbers(np.linalg.inv(S))))
    F = times(A, P)
    return K, F + F.T + times(B, numbers(request.Q), B.T) - times(K, numbers(S), K.T)


def split(sides: Named, count: int) -> tuple[dict[str, Expression], dict[str, Expression]]:
    """The first so many entries, and the rest."""
    pairs = list(sides.items())
    return dict(pairs[:count]), dict(pairs[count:])


def written_out(plant: Equations, outputs: Sequence[str]) -> tuple[Mapping[str, Expression], Mapping[str, Expression]]:
    """Rates in terms of states, inputs, w and measured outputs, and outputs in terms of states, inputs and w.

    Raises `UsageError`: an algebraic signal depends on itself.
    """
    inner = dict(plant.algebraic)
    for _ in inner:
        inner = {name: side.substituted({k: e for k, e in inner.items() if k != name}) for name, side in inner.items()}
    if any(not side.names.isdisjoint(inner) for side in inner.values()):
        raise UsageError(
            Problem("this filter takes no plant with an algebraic loop (Dqf)", key="observer.type", id="OBS406")
        )
    f = {name: side.substituted(inner) for name, side in plant.dynamics.items()}
    h = {name: plant.outputs[name].substituted(inner) for name in outputs}
    for _ in h:
        h = {name: side.substituted({k: e for k, e in h.items() if k != name}) for name, side in h.items()}
    return f, h


def constant(D: Array, outputs: Sequence[str]) -> Array:
    """Matrix of numbers."""
    for name, row in zip(outputs, D, strict=True):
        if any(entry.names for entry in row):
            said = f"how w enters {name} depends on the states; this filter takes a constant D"
            raise UsageError(Problem(said, key="observer.type", id="OBS406"))
    return np.array([[entry.scalar([])() for entry in row] for row in D]).reshape(D.shape)


def numbers(M: Array) -> Array:
    """Matrix of doubles as expressions."""
    entries = [Expression.number(entry) for entry in printed(M).ravel()]
    return np.array(entries, dtype=object).reshape(M.shape)


def times(*matrices: Array) -> Array:
    """Product of matrices of expressions."""

    def pair(M: Array, N: Array) -> Array:
        entries = [sum(map(Expression.__mul__, row, column), ZERO) for row in M for column in N.T]
        return np.array(entries, dtype=object).reshape(len(M), N.shape[1])

    return reduce(pair, matrices)
