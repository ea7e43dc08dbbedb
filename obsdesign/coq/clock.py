"""Storage functions that depend on a clock, for a file of Coq, of an observer with samples at instants.

The clock is the time left to the next sample. The observer and its error are

    xhat' = A xhat + Bf f(qhat) + g + L theta, theta' = H theta between samples,
    xhat+ = xhat + K r, theta+ = G r at a sample, r = y - C xhat,    x = Se (x - xhat) + St theta,

and each storage function V = x' P(tau) x is a polynomial with control values P_k on each segment of the clock. Coq
computes from these numbers the matrices that must not be negative, for each control value: those of

    V' + 2 rate V + weight |z|^2 - mu |w|^2 <= 0 between samples,    V+ <= V + kappa |eta|^2 at one,    V <= roof |x|^2.

Here they are computed to find the T that shows it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array, combined, he, identity, zeros
from obsdesign.model.multiplier import Matrix, Multiplier
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, replace


@dataclass(frozen=True)
class Observer:
    """Plant, observer, and the error x = Se (x - xhat) + St theta whose size is spoken of, in rationals."""

    plant: Plant[Array]
    Cp: Array  # (nz, n), z = Cp e
    L: Array  # (n, nt)
    H: Array  # (nt, nt)
    K: Array  # (n, ny)
    G: Array  # (nt, ny)
    Se: Array  # (m, n)
    St: Array  # (m, nt)
    multiplier: Multiplier
    T1: fmpq
    T2: fmpq

    @property
    def sizes(self) -> dict[str, int]:
        """Numbers of entries of x, theta, f, w, y, q."""
        p, (n, nt) = self.plant, self.L.shape
        return {"n": n, "nt": nt, "nf": p.Bf.shape[1], "nw": p.B.shape[1], "ny": len(p.C), "nq": len(p.Cq)}


@dataclass(frozen=True)
class Storage:
    """A storage function of the time that is left and what it proves, in rationals."""

    rate: fmpq
    weight: fmpq
    mu: fmpq
    kappa: fmpq
    roof: fmpq
    driven: bool  # whether w acts
    noisy: bool  # whether eta acts
    knots: Sequence[fmpq]  # of the segments, (N + 1)
    controls: Array  # of P, (N, d + 1, m, m)
    scales: Mapping[str, Array]  # of the multipliers, (N, d + 1)
    normal: bool  # whether P >= I; P(0) >= 0 at least

    @property
    def degree(self) -> int:
        """Degree d of each segment."""
        return int(self.controls.shape[1]) - 1

    def slope(self, i: int, k: int) -> Array:
        """Control value of P'."""
        P, d, width = self.controls[i], self.degree, self.knots[i + 1] - self.knots[i]
        rise, fall = P[min(k + 1, d)] - P[k], P[k] - P[max(k - 1, 0)]
        return np.asarray((fmpq(k) * fall + fmpq(d - k) * rise) / width)

    def halved(self) -> "Storage":
        """Same polynomials on segments half as long: their control values are closer to them (de Casteljau)."""
        middles = [(a + b) / 2 for a, b in pairwise(self.knots)]
        knots = [*(s for ends in zip(self.knots, middles, strict=False) for s in ends), self.knots[-1]]
        scales = {name: halves(values) for name, values in self.scales.items()}
        return replace(self, knots=knots, controls=halves(self.controls), scales=scales)


def halves(values: Array) -> Array:
    """Control values (2 N, d + 1, ..) on the halves of the segments of those given, (N, d + 1, ..)."""
    levels = [values]
    while levels[-1].shape[1] > 1:
        levels.append((levels[-1][:, :-1] + levels[-1][:, 1:]) / 2)
    left = np.stack([level[:, 0] for level in levels], axis=1)
    right = np.stack([level[:, -1] for level in reversed(levels)], axis=1)
    return np.stack([left, right], axis=1).reshape(2 * len(values), *values.shape[1:])


class Signals(NamedTuple):
    """Rows of signals, over the entries of e, theta, f and w."""

    x: Array
    dx: Array
    q: Array
    f: Array
    w: Array
    z: Array


def parts(*sizes: int) -> list[Array]:
    """Rows that pick the parts of a vector, of these sizes."""
    eye = identity(sum(sizes), zeros((1, 1), [np.array([fmpq(0)])]))
    return np.split(eye, np.cumsum(sizes)[:-1])


def signals(o: Observer, s: Storage) -> Signals:
    """Signals of the flow; without w where it does not act."""
    p, size = o.plant, o.sizes
    e, th, f, w = parts(size["n"], size["nt"], size["nf"], size["nw"])
    if not s.driven:
        e, th, f, w = parts(size["n"], size["nt"], size["nf"], 0)
        p = p.undisturbed
    de = combined((p.A, e), (p.Bf, f), (p.B, w), (-o.L, th))
    return Signals(
        combined((o.Se, e), (o.St, th)),
        combined((o.Se, de), (o.St, combined((o.H, th)))),
        combined((p.Cq, e), (p.Dqf, f), (p.Dq, w)),
        f,
        w,
        combined((o.Cp, e)),
    )


def form(M: Array, a: Array, b: Array | None = None) -> Array:
    """Matrix of the form a' M a, or of 2 a' M b."""
    return a.mT @ M @ a if b is None else he(a.mT @ M @ b)


def flow(o: Observer, s: Storage, i: int, k: int, cone: Mapping[str, Matrix]) -> Array:
    """Matrix that must not be negative between samples, at a control value."""
    v, P = signals(o, s), s.controls[i, k]
    found = form(s.slope(i, k) - 2 * s.rate * P, v.x) - form(P, v.dx, v.x)
    found = found - s.weight * (v.z.mT @ v.z) + s.mu * (v.w.mT @ v.w)
    for name, (M11, M12, M22) in cone.items():
        found = found - s.scales[name][i, k] * (form(M11, v.q) + form(M12, v.q, v.f) + form(M22, v.f))
    return np.asarray(found)


def jump(o: Observer, s: Storage, i: int, k: int) -> Array:
    """Matrix that must not be negative at a sample, over the entries of e, theta and eta."""
    size = o.sizes
    e, th, eta = parts(size["n"], size["nt"], size["ny"] if s.noisy else 0)
    r = combined((o.plant.C, e)) + (eta if s.noisy else 0)
    before = combined((o.Se, e), (o.St, th))
    after = combined((o.Se, e - combined((o.K, r))), (o.St, combined((o.G, r))))
    return np.asarray(form(s.controls[0, 0], before) - form(s.controls[i, k], after) + s.kappa * (eta.mT @ eta))


def asked(o: Observer, s: Storage, i: int, k: int) -> bool:
    """Whether a control value bounds P for an interval in [T1, T2]."""
    last = i == len(s.controls) - 1
    return k == s.degree if last and o.T1 == o.T2 else last or s.knots[i + 1] > o.T1


def forms(o: Observer, s: Storage, cone: Mapping[str, Matrix]) -> Iterator[tuple[str, str, list[list[Array | None]]]]:
    """Names of the T of a storage function, what they stand for, and the matrices, segment by segment.

    `cone`: M11, M12, M22 of each inequality of the class, by the name of its scale.
    """
    e, th = parts(o.sizes["n"], o.sizes["nt"])
    x, eye = combined((o.Se, e), (o.St, th)), identity(len(o.Se), o.Se)

    def everywhere(of: Callable[[int, int], Array | None]) -> list[list[Array | None]]:
        return [[of(i, k) for k in range(s.degree + 1)] for i in range(len(s.controls))]

    yield "TF", "the inequality between samples", everywhere(lambda i, k: flow(o, s, i, k, cone))
    yield "TJ", "the inequality at a sample", everywhere(lambda i, k: jump(o, s, i, k) if asked(o, s, i, k) else None)
    yield "TR", "P <= roof I", everywhere(lambda i, k: form(s.roof * eye - s.controls[i, k], x))
    if s.normal:
        yield "TP", "P >= I", everywhere(lambda i, k: form(s.controls[i, k] - eye, x))
    else:
        yield "T0", "P(0) >= 0", [[form(s.controls[0, 0], x)]]
