"""The extended Kalman filter, as equations (Kalman, 1960; Kalman and Bucy, 1961)."""

from collections.abc import Mapping, Sequence

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.families.filters.frame import Frame
from obsdesign.families.filters.symbols import ZERO, numbers, times
from obsdesign.families.observer import Correction, Observer, Supposed
from obsdesign.lmi.formula import Array
from obsdesign.model.equations import Named, free


def of_flow(frame: Frame) -> Observer:
    """Extended Kalman filter in continuous time, of a plant x' = f(t, x, u, w, y), y = h(t, x, u, w) + v.

    xhat' = f(t, xhat, u, 0, y) + K (y - yhat),               yhat = h(t, xhat, u, 0)
    P'    = A P + P A' + B Q B' - K S K',   P(0) = P0,        K = (P C' + B Q D') S^-1,   S = R + D Q D'
    A = df/dx, B = df/dw, C = dh/dx at xhat, D = dh/dw

    A measured y that stands in a right side is known. In steps see `in_steps`. Raises `UsageError`: D is not constant.
    """
    names, P = frame.covariance()
    at, request = frame.prior, frame.request
    A, B, C = (frame.slopes("A", frame.f, frame.x, at), frame.slopes("B", frame.f, frame.w, at),
               frame.slopes("C", frame.h, frame.x, at))  # fmt: skip
    D = frame.constant(frame.slopes("D", frame.h, frame.w, at))
    S = request.R + D @ request.Q @ D.T
    shared = times(B, numbers(request.Q @ D.T))
    K = frame.gains(times(times(P, C.T) + shared, numbers(np.linalg.inv(S))))
    F = times(A, P)
    rate = F + F.T + times(B, numbers(request.Q), B.T) - times(K, numbers(S), K.T)
    return frame.of_flow(
        {**corrected(frame, K), **{name: rate[place] for place, name in names.items()}},
        {frame.hats[name]: frame.copy.outputs[frame.hats[name]] for name in frame.y},
        frame.begun(names),
        Supposed(times(C, P, C.T), S),
        None if shared_noise(shared) else in_steps(frame, names, P, S),
    )


def shared_noise(shared: Array) -> bool:
    """Whether a disturbance acts on x and y, B Q D' not being zero: such a filter has no correction of its own."""
    return any(entry != ZERO for entry in shared.flat)


def in_steps(frame: Frame, names: Mapping[tuple[int, int], str], P: Array, S: Array) -> Correction:
    """Extended Kalman filter in steps of h, in each of which y is held and counts as one sample.

    first       xhat = xhat + K (y - yhat),  P = P - K (C P C' + S / h) K',     K = P C' (C P C' + S / h)^-1
    then        xhat' = f(t, xhat, u, 0, y),  Phi' = A Phi,  W' = A W + W A' + B Q B'     over h, Phi from I, W from 0
    last        P = Phi P Phi' + W

    It is the filter in continuous time as h goes to 0, and has no gain that is too large for a step where P is large.
    """
    begin, after = frame.fresh(), frame.fresh()
    prior, span, taken = frame.prior, free("span", frame.signals.taken), frame.signals.taken
    C = begin.slopes("C", frame.h, frame.x, prior)
    PC = times(P, C.T)
    yhat = [frame.h[name].substituted(prior) for name in frame.y]
    change, cov = conditioned(begin, times(C, PC) + held(S, span), PC, P, frame.measured(yhat))
    first = {frame.hats[name]: prior[name] + more for name, more in zip(frame.x, change, strict=True)}
    kept = {name: free(f"kept_{name}", taken) for name in names.values()}  # P as it is corrected, which rests
    phi = {(i, j): free(f"phi_{i}_{j}", taken) for i in frame.x for j in frame.x}
    A, rates, W = grown(frame, after, names, prior)
    Phi = np.array([[Expression.variable(phi[i, j]) for j in frame.x] for i in frame.x], dtype=object)
    resting = np.array([[side.substituted(renamed(kept)) for side in row] for row in P], dtype=object)
    last = times(Phi, resting, Phi.T) + W
    return Correction(
        span,
        {
            **first,
            **{kept[name]: cov[at] for at, name in names.items()},
            **{name: Expression.number(int(i == j)) for (i, j), name in phi.items()},
            **dict.fromkeys(rates, ZERO),
        },
        begin.signals.sides,
        after.flow(
            {
                **frame.copy.dynamics,
                **dict.fromkeys(kept.values(), ZERO),
                **dict(zip(phi.values(), times(A, Phi).flat, strict=True)),
                **rates,
            },
            frame.copy.algebraic,
        ),
        {**{hat: Expression.variable(hat) for hat in first}, **{name: last[at] for at, name in names.items()}},
        {},
        begin.signals.gains,
    )


def renamed(names: Mapping[str, str]) -> dict[str, Expression]:
    """Signals under other names."""
    return {name: Expression.variable(other) for name, other in names.items()}


def grown(
    frame: Frame, after: Frame, names: Mapping[tuple[int, int], str], at: Named
) -> tuple[Array, dict[str, Expression], Array]:
    """Slopes A at some estimates, and W with W' = A W + W A' + B Q B', what w adds to P in a step: rates, and W."""
    own = {place: free(name.replace("P_", "W_", 1), frame.signals.taken) for place, name in names.items()}
    n = range(len(frame.x))
    W = np.array([[Expression.variable(own[min(a, b), max(a, b)]) for b in n] for a in n], dtype=object)
    A, B = (after.slopes(letter, frame.f, by, at) for letter, by in (("A", frame.x), ("B", frame.w)))
    M = times(A, W)
    rate = M + M.T + times(B, numbers(frame.request.Q), B.T)
    return A, {name: rate[place] for place, name in own.items()}, W


def held(S: Array, span: str) -> Array:
    """Covariance S / h of white noise of an intensity S over a time of this name."""
    return np.array([[entry / Expression.variable(span) for entry in row] for row in numbers(S)], dtype=object)


def corrected(frame: Frame, K: Array) -> dict[str, Expression]:
    """Rates of the copy of the plant with K (y - yhat) added."""
    innovation = np.array([[Expression.variable(name) - Expression.variable(frame.hats[name])] for name in frame.y])
    correction = times(K, innovation)[:, 0]
    return {hat: side + more for (hat, side), more in zip(frame.copy.dynamics.items(), correction, strict=True)}


def of_samples(frame: Frame) -> Observer:
    """Extended Kalman filter in discrete time, of a plant x+ = f(t, x, u, w, y), y = h(t, x, u, w) + v.

    corrected   (x, w)(k|k) = (xhat, 0) + K (y - h(t, xhat, u, 0)),     K = [P C'; Q D'] S^-1,  S = C P C' + D Q D' + R
                cov(k|k)    = blkdiag(P, Q) - K S K'                    C = dh/dx, D = dh/dw at xhat
    predicted   xhat+       = f(t, x(k|k), u, w(k|k), y)
                P+          = [A B] cov(k|k) [A B]',    P_0 = P0        A = df/dx, B = df/dw at (x, w)(k|k)

    Q and R are the covariances of w and v of one sample. Its states are xhat and P; predicted estimates are xhat,
    filtered ones x(k|k). A disturbance in both f and h is estimated from y before it is predicted with.
    """
    names, P = frame.covariance()
    prior, both, Q = frame.prior, (*frame.x, *frame.w), numbers(frame.request.Q)
    C, D = (frame.slopes(letter, frame.h, by, prior) for letter, by in (("C", frame.x), ("D", frame.w)))
    yhat = [frame.h[name].substituted(prior) for name in frame.y]
    PC, QD = times(P, C.T), times(Q, D.T)
    none = np.full((len(frame.x), len(Q)), ZERO, dtype=object)
    cov = np.block([[P, none], [none.T, Q]])
    S = times(C, PC) + times(D, QD) + numbers(frame.request.R)
    change, cov = conditioned(frame, S, np.vstack([PC, QD]), cov, frame.measured(yhat))
    posterior = moved(frame, both, prior, change)
    F = frame.slopes("F", frame.f, both, posterior)
    following = times(F, cov, F.T)
    return frame.of_samples(
        {
            **{frame.hats[name]: frame.f[name].substituted(posterior) for name in frame.x},
            **{name: following[at] for at, name in names.items()},
        },
        posterior,
        frame.begun(names),
        S,
    )


def moved(
    frame: Frame, names: Sequence[str], prior: dict[str, Expression], change: Sequence[Expression]
) -> dict[str, Expression]:
    """Estimates after a measurement, under names."""
    return {
        name: frame.signals.named(f"corrected_{name}", prior[name] + more)
        for name, more in zip(names, change, strict=True)
    }


def conditioned(
    frame: Frame, S: Array, cross: Array, cov: Array, missing: Sequence[Expression]
) -> tuple[list[Expression], Array]:
    """Change of the estimates of some signals, and their covariance, by a measurement that differs by yhat - y.

    `S`, `cross`, `cov`: covariances of y, of the signals with y, of the signals. The outputs are eliminated, as Gauss
    does it, from the covariance of both with yhat - y beside it.
    """
    ny, signals = len(S), frame.signals
    T = np.block([[S, cross.T], [cross, cov]])
    r = [*missing, *[ZERO] * len(cov)]
    for k in range(ny):
        shares = [signals.gain(frame.y[k], f"gain{k + 1}_{i}", T[i, k] / T[k, k]) for i in range(k + 1, len(T))]
        left = T.copy()
        for i, share in enumerate(shares, start=k + 1):
            for j in range(i, len(T)):
                left[i, j] = left[j, i] = signals.named(f"cov{k + 1}_{i}_{j}", T[i, j] - share * T[j, k])
            r[i] = signals.named(f"change{k + 1}_{i}", r[i] - share * r[k])
        T = left
    return r[ny:], T[ny:, ny:]
