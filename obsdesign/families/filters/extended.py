"""The extended Kalman filter, as equations (Kalman, 1960; Kalman and Bucy, 1961)."""

from collections.abc import Sequence

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.families.filters.frame import Frame
from obsdesign.families.filters.symbols import ZERO, numbers, times
from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import Array


def of_flow(frame: Frame) -> Observer:
    """Extended Kalman filter in continuous time, of a plant x' = f(t, x, u, w, y), y = h(t, x, u, w) + v.

    xhat' = f(t, xhat, u, 0, y) + K (y - yhat),               yhat = h(t, xhat, u, 0)
    P'    = A P + P A' + B Q B' - K S K',   P(0) = P0,        K = (P C' + B Q D') S^-1,   S = R + D Q D'
    A = df/dx, B = df/dw, C = dh/dx at xhat, D = dh/dw

    A measured y that stands in a right side is known. Raises `UsageError`: D is not constant.
    """
    names, P = frame.covariance()
    at, request = frame.prior, frame.request
    A, B, C = (frame.slopes("A", frame.f, frame.x, at), frame.slopes("B", frame.f, frame.w, at),
               frame.slopes("C", frame.h, frame.x, at))  # fmt: skip
    D = frame.constant(frame.slopes("D", frame.h, frame.w, at))
    S = request.R + D @ request.Q @ D.T
    shared = times(B, numbers(request.Q @ D.T))
    K = frame.signals.matrix("K", frame.x, frame.y, times(times(P, C.T) + shared, numbers(np.linalg.inv(S))))
    F = times(A, P)
    rate = F + F.T + times(B, numbers(request.Q), B.T) - times(K, numbers(S), K.T)
    return frame.of_flow(
        {**corrected(frame, K), **{name: rate[place] for place, name in names.items()}},
        {frame.hats[name]: frame.copy.outputs[frame.hats[name]] for name in frame.y},
        frame.begun(names),
    )


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
        shares = [signals.named(f"gain{k + 1}_{i}", T[i, k] / T[k, k]) for i in range(k + 1, len(T))]
        left = T.copy()
        for i, share in enumerate(shares, start=k + 1):
            for j in range(i, len(T)):
                left[i, j] = left[j, i] = signals.named(f"cov{k + 1}_{i}_{j}", T[i, j] - share * T[j, k])
            r[i] = signals.named(f"change{k + 1}_{i}", r[i] - share * r[k])
        T = left
    return r[ny:], T[ny:, ny:]
