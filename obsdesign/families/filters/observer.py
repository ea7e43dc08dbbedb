"""The extended Kalman filter in continuous time (Kalman and Bucy, 1961), as equations."""

from collections.abc import Mapping, Sequence

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.families.filters.discrete import filter_of_samples
from obsdesign.families.filters.request import FilterRequest
from obsdesign.families.filters.symbols import ZERO, Signals, jacobian, numbers, split, times, written_out
from obsdesign.families.observer import Copy, Observer, Supposed
from obsdesign.lmi.formula import Array
from obsdesign.model.disturbance import with_inputs
from obsdesign.model.equations import Equations, Named, free
from obsdesign.spec import Spec


def observer(spec: Spec, request: FilterRequest) -> Observer:
    """Extended Kalman filter, in the time of the plant."""
    return filter_of_flow(spec, request) if spec.period is None else filter_of_samples(spec, request)


def filter_of_flow(spec: Spec, request: FilterRequest) -> Observer:
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
    K, rate, supposed = riccati(plant, outputs, request, signals, P, hats)
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
        supposed=supposed,
    )


def riccati(
    plant: Equations,
    outputs: Sequence[str],
    request: FilterRequest,
    signals: Signals,
    P: Array,
    hats: Mapping[str, str],
) -> tuple[Array, Array, Supposed]:
    """Gain K (n, ny), P' (n, n), and the covariance of y - yhat at rows of a log: C P C' + S / h."""
    x, v = plant.states, plant.exogenous
    f, h = written_out(plant, outputs)
    at = {name: Expression.variable(hats[name]) for name in x} | dict.fromkeys(v, ZERO)

    def slopes(letter: str, of: Named, by: Sequence[str]) -> Array:
        return signals.matrix(letter, list(of), by, jacobian(of, by, at))

    A, B, C = slopes("A", f, x), slopes("B", f, v), slopes("C", h, x)
    D = constant(slopes("D", h, v), outputs)
    S = request.R + D @ request.Q @ D.T
    shared = times(B, numbers(request.Q @ D.T))
    K = signals.matrix("K", x, outputs, times(times(P, C.T) + shared, numbers(np.linalg.inv(S))))
    F = times(A, P)
    rate = F + F.T + times(B, numbers(request.Q), B.T) - times(K, numbers(S), K.T)
    return K, rate, Supposed(times(C, P, C.T), S)


def constant(D: Array, outputs: Sequence[str]) -> Array:
    """Matrix of numbers."""
    for name, row in zip(outputs, D, strict=True):
        if any(entry.names for entry in row):
            said = f"how w enters {name} depends on the states; this filter takes a constant D"
            raise UsageError(Problem(said, key="observer.type", id="OBS406"))
    return np.array([[entry.scalar([])() for entry in row] for row in D]).reshape(D.shape)
