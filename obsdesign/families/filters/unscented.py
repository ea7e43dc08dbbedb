"""The unscented Kalman filter, as equations (Julier and Uhlmann, 1997; in continuous time Sarkka, 2007)."""

from collections.abc import Mapping

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.families.filters.extended import conditioned, grown, held, moved, shared_noise
from obsdesign.families.filters.frame import Frame
from obsdesign.families.filters.symbols import ZERO, jacobian, numbers, times
from obsdesign.families.filters.transform import Transform, values
from obsdesign.families.observer import Correction, Observer, Supposed
from obsdesign.lmi.formula import Array
from obsdesign.model.equations import free


def of_flow(frame: Frame) -> Observer:
    """Unscented Kalman filter in continuous time, of a plant x' = f(t, x, u, w, y), y = h(t, x, u, w) + v.

    X_k are the sigma points of (xhat, P), m[.] their weighted mean and c[., .] their weighted covariance:

    xhat' = m[f(X)] + K (y - yhat),   yhat = m[h(X)],            K = (c[X, h(X)] + B Q D') S^-1,   S = R + D Q D'
    P'    = c[X, f(X)] + c[X, f(X)]' + B Q B' - K S K',          P(0) = P0
    B = df/dw at xhat, D = dh/dw

    Raises `UsageError`: D is not constant.
    """
    names, P = frame.covariance()
    at, request = frame.prior, frame.request
    B, D = frame.slopes("B", frame.f, frame.w, at), frame.constant(frame.slopes("D", frame.h, frame.w, at))
    S = request.R + D @ request.Q @ D.T
    transform = Transform(frame.signals, request, sure=False)
    centre = {name: at[name] for name in frame.x}
    quiet = {name: at[name] for name in frame.w}
    points = transform.points(centre, transform.root(P, "L"), "X")
    X = values(points, frame.x)
    F, H = (transform.images(of, [point | quiet for point in points], letter)
            for of, letter in ((frame.f, "F"), (frame.h, "H")))  # fmt: skip
    drift, yhat, mean = transform.mean(F), transform.mean(H), list(centre.values())
    cross = transform.product(X, mean, H, yhat) + times(B, numbers(request.Q @ D.T))
    K = frame.gains(times(cross, numbers(np.linalg.inv(S))))
    M = transform.product(X, mean, F, drift)
    rate = M + M.T + times(B, numbers(request.Q), B.T) - times(K, numbers(S), K.T)
    expected = dict(zip((frame.hats[name] for name in frame.y), yhat, strict=True))
    alone = not shared_noise(times(B, numbers(request.Q @ D.T)))
    missing = np.array([frame.measured([Expression.variable(hat) for hat in expected])], dtype=object).T
    moves = [side - more for side, more in zip(drift, times(K, missing)[:, 0], strict=True)]
    return frame.of_flow(
        {
            **dict(zip((frame.hats[name] for name in frame.x), moves, strict=True)),
            **{name: rate[place] for place, name in names.items()},
        },
        expected,
        frame.begun(names),
        Supposed(transform.product(H, yhat, H, yhat), S),
        in_steps(frame, names, P, S) if alone else None,
    )


def in_steps(frame: Frame, names: Mapping[tuple[int, int], str], P: Array, S: Array) -> Correction:
    """Unscented Kalman filter in steps of h, in each of which y is held and counts as one sample.

    first       xhat = xhat + K (y - yhat),  P = P - K Y K',     K = c[X, h(X)] Y^-1,  Y = c[h(X), h(X)] + S / h
    then        Z_k' = f(t, Z_k, u, 0, y),  W' = A W + W A' + B Q B'     over h, from sigma points of (xhat, P) and 0
    last        xhat = m[Z],  P = c[Z, Z] + W                            A, B: slopes at Z_0
    """
    begin, after, close = frame.fresh(), frame.fresh(), frame.fresh()
    prior, span, taken = frame.prior, free("span", frame.signals.taken), frame.signals.taken
    quiet = {name: prior[name] for name in frame.w}
    transform = Transform(begin.signals, frame.request, sure=True)
    centre = {name: prior[name] for name in frame.x}
    points = transform.points(centre, transform.root(P, "L"), "X")
    H = transform.images(frame.h, [point | quiet for point in points], "H")
    yhat = transform.mean(H)
    cross = transform.product(values(points, frame.x), list(centre.values()), H, yhat)
    Y = transform.product(H, yhat, H, yhat) + held(S, span)
    change, cov = conditioned(begin, Y, cross, P, frame.measured(yhat))
    corrected = moved(begin, frame.x, prior, change)
    start = transform.points(corrected, transform.root(cov, "M"), "Z")
    Z = [{name: free(f"at{k}_{name}", taken) for name in frame.x} for k in range(len(start))]
    known = [{name: Expression.variable(own) for name, own in one.items()} | quiet for one in Z]
    rates = {own: frame.f[name].substituted(at) for one, at in zip(Z, known, strict=True) for name, own in one.items()}
    _, noises, W = grown(frame, after, names, known[0])
    ended = Transform(close.signals, frame.request, sure=True)
    reached = values(known, frame.x)
    mean = [close.signals.named(f"mean_{name}", side) for name, side in zip(frame.x, ended.mean(reached), strict=True)]
    following = ended.product(reached, mean, reached, mean) + W
    return Correction(
        span,
        {
            **{own: at[name] for one, at in zip(Z, start, strict=True) for name, own in one.items()},
            **dict.fromkeys(noises, ZERO),
        },
        begin.signals.sides,
        after.flow({**rates, **noises}, {}),
        {
            **dict(zip((frame.hats[name] for name in frame.x), mean, strict=True)),
            **{name: following[at] for at, name in names.items()},
        },
        close.signals.sides,
        begin.signals.gains,
    )


def of_samples(frame: Frame) -> Observer:
    """Unscented Kalman filter in discrete time, of a plant x+ = f(t, x, u, w, y), y = h(t, x, u, w) + v.

    corrected   s(k|k)      = (xhat, 0) + K (y - yhat),  yhat = m[h(S)],     K = c[S, h(S)] Y^-1,  Y = c[h(S), h(S)] + R
                cov(k|k)    = blkdiag(P, Q) - K Y K'                         S: sigma points of (xhat, 0), blkdiag(P, Q)
    predicted   xhat+       = m[f(S)],  P+ = c[f(S), f(S)],  P_0 = P0        S: sigma points of s(k|k), cov(k|k)

    s is x with those w that act otherwise than by a constant B in f alone, or a constant D in h alone, or are
    correlated with such; of the others B Q B' is added to P+, and D Q D' to R, as it is done where noise is additive.
    Its states are xhat and P; predicted estimates are xhat, filtered ones x(k|k).
    """
    names, P = frame.covariance()
    inner, B, D = additive(frame)
    Q, signals = frame.request.Q, frame.signals
    transform = Transform(signals, frame.request, sure=True)
    both = (*frame.x, *(frame.w[i] for i in inner))
    prior = frame.prior
    outer = {name: prior[name] for name in frame.w if name not in both}
    inside = np.ix_(inner, inner)
    known = numbers(lower(Q[inside]))
    none = np.full((len(frame.x), len(inner)), Expression.number(0), dtype=object)
    begin = {name: prior[name] for name in both}
    points = transform.points(begin, np.block([[transform.root(P, "L"), none], [none.T, known]]), "X")
    H = transform.images(frame.h, [point | outer for point in points], "H")
    yhat = transform.mean(H)
    S = transform.product(H, yhat, H, yhat) + numbers(frame.request.R + D @ Q @ D.T)
    cross = transform.product(values(points, both), list(begin.values()), H, yhat)
    cov = np.block([[P, none], [none.T, numbers(Q[inside])]])
    expected = dict(zip((frame.hats[name] for name in frame.y), yhat, strict=True))
    change, cov = conditioned(frame, S, cross, cov, frame.measured([Expression.variable(hat) for hat in expected]))
    posterior = moved(frame, both, begin, change)
    after = transform.points(posterior, transform.root(cov, "M"), "Z")
    F = transform.images(frame.f, [point | outer for point in after], "F")
    predicted = transform.mean(F)
    mean = [signals.named(f"predicted_{name}", side) for name, side in zip(frame.x, predicted, strict=True)]
    following = transform.product(F, mean, F, mean) + numbers(B @ Q @ B.T)
    return frame.of_samples(
        {
            **dict(zip((frame.hats[name] for name in frame.x), mean, strict=True)),
            **{name: following[at] for at, name in names.items()},
        },
        posterior,
        frame.begun(names),
        S,
        expected,
    )


def additive(frame: Frame) -> tuple[list[int], Array, Array]:
    """Places of the w of which sigma points are taken, and the slopes B, D of f and h by the others, zero by those."""
    slopes = [jacobian(of, frame.w, {}) for of in (frame.f, frame.h)]
    constant = [not any(entry.names for entry in (*b, *d)) for b, d in zip(slopes[0].T, slopes[1].T, strict=True)]
    B, D = (
        np.array([[entry.scalar([])() if keep else 0.0 for entry, keep in zip(row, constant, strict=True)]
                  for row in part], dtype=float).reshape(part.shape)
        for part in slopes
    )  # fmt: skip
    acts = [np.abs(part).sum(axis=0) > 0 for part in (B, D)]
    inner = []
    for group in correlated(frame.request.Q):
        drives, shows = acts[0][group].any(), acts[1][group].any()
        if not all(constant[i] for i in group) or (drives and shows):
            inner += group
    inner.sort()
    B[:, inner], D[:, inner] = 0.0, 0.0
    return inner, B, D


def correlated(Q: Array) -> list[list[int]]:
    """Places of signals that are correlated with each other, directly or not."""
    groups: list[list[int]] = []
    for i in range(len(Q)):
        near = [group for group in groups if (Q[i, group] != 0).any()]
        joined = sorted([*(j for group in near for j in group), i])
        groups = [*(group for group in groups if group not in near), joined]
    return groups


def lower(Q: Array) -> Array:
    """Lower triangular root L L' of a positive semidefinite matrix of numbers."""
    values, vectors = np.linalg.eigh(Q) if len(Q) else (np.zeros(0), np.zeros((0, 0)))
    R = np.asarray(np.linalg.qr((vectors * np.sqrt(np.maximum(values, 0))).T).R)
    return np.asarray(R.T * np.where(np.diag(R) < 0, -1.0, 1.0))
