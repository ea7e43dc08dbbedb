"""The extended Kalman filter in discrete time (Kalman, 1960): a correction by each measurement, then a prediction."""

from collections.abc import Mapping, Sequence

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.families.filters.request import FilterRequest
from obsdesign.families.filters.symbols import ZERO, Signals, jacobian, numbers, split, times, written_out
from obsdesign.families.observer import Copy, Observer, Supposed
from obsdesign.lmi.formula import Array, printed
from obsdesign.model.disturbance import with_inputs
from obsdesign.model.equations import free
from obsdesign.spec import Spec


def filter_of_samples(spec: Spec, request: FilterRequest) -> Observer:
    """Extended Kalman filter of a plant x+ = f(t, x, u, w, y), y = h(t, x, u, w) + v, with its disturbance model.

    corrected   (x, w)(k|k) = (xhat, 0) + K (y - h(t, xhat, u, 0)),     K = [P C'; Q D'] S^-1,  S = C P C' + D Q D' + R
                cov(k|k)    = blkdiag(P, Q) - K S K'                    C = dh/dx, D = dh/dw at xhat
    predicted   xhat+       = f(t, x(k|k), u, w(k|k), y)
                P+          = [A B] cov(k|k) [A B]',    P_0 = P0        A = df/dx, B = df/dw at (x, w)(k|k)

    Q and R are the covariances of w and v of one sample. Its states are xhat and P; predicted estimates are xhat,
    filtered ones x(k|k). A disturbance in both f and h is estimated from y before it is predicted with.

    Raises `UsageError`: a nonlinearity has no f, or the plant has an algebraic loop.
    """
    outputs = spec.plant.outputs
    plant = spec.equations(with_inputs(spec.augmented, spec.generator, spec.reserved))
    copy, x, v = Copy.of(plant), plant.states, plant.exogenous
    signals = Signals({*plant.signals, *copy.twins})
    hats = {twin: hat for hat, twin in copy.twins.items()}
    names = {(a, b): free(f"P_{i}_{j}", signals.taken) for a, i in enumerate(x) for b, j in enumerate(x) if a <= b}
    P = np.array([[Expression.variable(names[min(a, b), max(a, b)]) for b in range(len(x))] for a in range(len(x))])
    f, h = written_out(plant, outputs)
    prior = {name: Expression.variable(hats[name]) for name in x} | dict.fromkeys(v, ZERO)
    C, D = (signals.matrix(letter, outputs, by, jacobian(h, by, prior)) for letter, by in (("C", x), ("D", v)))
    missing = [h[name].substituted(prior) - Expression.variable(name) for name in outputs]
    change, cov = conditioned(P, C, D, request, missing, signals)
    Q, R = numbers(request.Q), numbers(request.R)
    S = times(C, P, C.T) + times(D, Q, D.T) + R
    corrected = [
        signals.named(f"corrected_{name}", prior[name] + more) for name, more in zip((*x, *v), change, strict=True)
    ]
    posterior = dict(zip((*x, *v), corrected, strict=True))
    F = signals.matrix("F", x, (*x, *v), jacobian(f, (*x, *v), posterior))
    following = times(F, cov, F.T)
    corrects = request.estimate == "filtered"
    known = {hats[name]: posterior[name] for name in x} if corrects else {}
    _, w = split(copy.outputs, len(outputs))
    modeled = zip(spec.plant.exogenous, w.values(), spec.generator.Dm, strict=True)
    return Observer(
        dynamics={
            **{hats[name]: f[name].substituted(posterior) for name in x},
            **{name: following[at] for at, name in names.items()},
        },
        estimates={
            **{name: Expression.variable(hats[name]).substituted(known) for name in x},
            **{name: side.substituted(known) for name, side, direct in modeled if not (direct != 0).any()},
        },
        inputs=spec.inputs,
        outputs=outputs,
        algebraic={**copy.algebraic, **signals.sides},
        initial={
            **(begun(spec, hats) if corrects else {}),
            **{name: numbers(request.P0)[at] for at, name in names.items()},
        },
        twins=twins(copy, (*plant.algebraic, *(() if corrects else x))),
        supposed=Supposed(S, np.zeros(S.shape)),
    )


def conditioned(
    P: Array, C: Array, D: Array, request: FilterRequest, missing: Sequence[Expression], signals: Signals
) -> tuple[list[Expression], Array]:
    """Change of the estimates of (x, w), and their covariance, by a measurement that differs by yhat - y.

    The outputs are eliminated, as Gauss does it, from the covariance of (y, x, w) with yhat - y beside it.
    """
    ny, n = C.shape
    Q, R = numbers(request.Q), numbers(request.R)
    PC, QD = times(P, C.T), times(Q, D.T)
    none = np.full((n, len(Q)), ZERO, dtype=object)
    T = np.block([[times(C, PC) + times(D, QD) + R, PC.T, QD.T], [PC, P, none], [QD, none.T, Q]])
    r = [*missing, *[ZERO] * (n + len(Q))]
    for k in range(ny):
        shares = [signals.named(f"gain{k + 1}_{i}", T[i, k] / T[k, k]) for i in range(k + 1, len(T))]
        left = T.copy()
        for i, share in enumerate(shares, start=k + 1):
            for j in range(i, len(T)):
                left[i, j] = left[j, i] = signals.named(f"cov{k + 1}_{i}_{j}", T[i, j] - share * T[j, k])
            r[i] = signals.named(f"change{k + 1}_{i}", r[i] - share * r[k])
        T = left
    return r[ny:], T[ny:, ny:]


def begun(spec: Spec, hats: Mapping[str, str]) -> dict[str, Expression]:
    """Where the prediction begins of filtered estimates, which are no copy of the state: at xhat0."""
    if spec.simulation is None:
        return {}
    values = zip((*spec.plant.states, *spec.model_states), printed(spec.simulation.xhat0), strict=True)
    return {hats[name]: Expression.number(value) for name, value in values}


def twins(copy: Copy, names: Sequence[str]) -> dict[str, str]:
    """Signals that copy one of some names."""
    return {hat: twin for hat, twin in copy.twins.items() if twin in names}
