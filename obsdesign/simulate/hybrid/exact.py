"""Linear flows with inputs that are constant between events: by matrix exponentials, exact up to rounding."""

from collections.abc import Iterator

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.simulate.hybrid.sampling import Stretch
from obsdesign.simulate.hybrid.system import Hybrid
from obsdesign.simulate.integrate import HUGE, Status, Trajectory, Vector

TERMS = 20  # of the series of exp(M), |M| <= 1
CHUNK = 2_000_000  # entries of a stack of matrices
FINE, FINEST, ROWS = 8, 64, 100_000  # steps in a stretch, at least, at most, and of a run


def transitions(F: Array, Q: Array, h: Vector) -> tuple[Array, Array]:
    """Return exp(F h) and the integral of exp(F' s) Q exp(F s) over [0, h], each (K, m, m), for h (K,).

    Van Loan's exponential of [-F' Q; 0 F] over a small part of h, then doubled, since exp(-F' h) itself would
    overflow where F is stiff.
    """
    m = len(F)
    M = np.block([[-F.T, Q], [np.zeros((m, m)), F]])
    size = np.abs(M).sum(axis=0).max() * h.max(initial=0.0)
    doublings = max(0, int(np.ceil(np.log2(size)))) if size > 0 else 0
    powers = [np.eye(2 * m)[:, m:]]
    for k in range(1, TERMS):
        powers.append(M @ powers[-1] / k)
    part = (h / 2.0**doublings)[:, None] ** np.arange(TERMS)
    # not a product of matrices, for which BLAS would start threads
    E = np.einsum("kp,pij->kij", part, np.array(powers))
    Phi = E[:, m:]
    W = Phi.mT @ E[:, :m]
    for _ in range(doublings):
        W = W + Phi.mT @ W @ Phi
        Phi = Phi @ Phi
    return Phi, W


class Exact:
    """The flow of a linear plant and its observer, with everything that acts on them constant in each stretch."""

    def __init__(self, system: Hybrid) -> None:
        self.system = system
        n, end, inputs = system.n, system.end, system.nw + len(system.known.terms)
        self.F = np.zeros((end + inputs, end + inputs))  # on (z, eps, theta, w, known terms)
        self.F[:end, : end + system.nw] = system.matrix[:end]
        self.F[:n, end + system.nw :] = system.place[:n]
        self.Q = np.zeros_like(self.F)
        error = slice(n, 2 * n)
        self.Q[error, error] = system.Cp.T @ system.Cp

    def held(self, t: Vector) -> Array:
        """Inputs (w, known terms) at instants, one row each."""
        system = self.system
        signals = system.signals.table(np.column_stack([t, np.zeros((len(t), system.n))]))
        u, w = np.split(signals, [len(system.u)], axis=1)
        return np.hstack([w, system.known.table(np.column_stack([t, u]))])

    def advance(self, s: Array, held: Array, h: Vector) -> Array:
        """Return the states that follow s (K, ns) under constant inputs after times h (K,)."""
        rows = max(1, CHUNK // (4 * self.F.size))
        parts = [self._advance(s[i : i + rows], held[i : i + rows], h[i : i + rows]) for i in range(0, len(h), rows)]
        return np.concatenate(parts) if parts else s

    def _advance(self, s: Array, held: Array, h: Vector) -> Array:
        return self.moved(s, held, h, *transitions(self.F, self.Q, h))

    def moved(self, s: Array, held: Array, h: Vector, Phi: Array, W: Array) -> Array:
        """Return what follows s, given the matrices of `transitions`."""
        system, end = self.system, self.system.end
        X = np.concatenate((s[:, :end], held), axis=1)[:, :, None]
        w2 = (held[:, : system.nw] ** 2).sum(axis=1)
        rate = 2 * system.decay
        share = -np.expm1(-rate * h) / rate if rate else h
        after = s.copy()
        after[:, :end] = (Phi @ X)[:, :end, 0]
        after[:, end] += (X.mT @ W @ X)[:, 0, 0]
        after[:, end + 1] += w2 * h
        after[:, end + 2] = np.exp(-rate * h) * s[:, end + 2] + system.supply * w2 * share
        return after

    def fineness(self, lengths: Vector) -> Array:
        """Steps in each stretch, (N,): several in each time constant and radian."""
        fastest = np.abs(np.linalg.eigvals(self.F)).max()
        steps = np.clip(np.ceil(4 * fastest * lengths), FINE, FINEST)
        return np.asarray(np.minimum(steps, max(1, ROWS // len(lengths))), dtype=int)


def follow(system: Hybrid, start: Vector, stretches: list[Stretch], samples: Vector) -> Trajectory:
    """Follow the flow and its jumps through all stretches.

    Returns
    -------
    Trajectory
        States at the samples and on a grid in each stretch; with status "escape" where the state grows beyond 1e8
        times its start.
    """
    exact = Exact(system)
    begins = np.array([stretch.start for stretch in stretches])
    lengths = np.array([stretch.stop for stretch in stretches]) - begins
    held = exact.held(begins + 0.5 * lengths)
    with np.errstate(all="ignore"):
        states = np.array(list(heads(exact, start, stretches, lengths, held)))
        counts = exact.fineness(lengths)[: len(states)]
        index = np.repeat(np.arange(len(states)), counts + 1)
        part = np.concatenate([np.arange(count + 1) / count for count in counts])
        path_t = begins[index] + part * lengths[index]
        path_s = exact.advance(states[index], held[index], part * lengths[index])
        sampled = np.minimum(np.searchsorted(begins, samples, side="right") - 1, len(states) - 1)
        s = exact.advance(states[sampled], held[sampled], samples - begins[sampled])
        limit = HUGE * max(1.0, float(np.linalg.norm(start[: system.end])))
        beyond = ~(np.linalg.norm(path_s[:, : system.end], axis=1) < limit)
    if not beyond.any():
        return Trajectory(samples, s, path_t, path_s, "done", stretches[-1].stop, "")
    return cut(samples, s, path_t, path_s, int(np.argmax(beyond)), limit)


def cut(samples: Vector, s: Array, path_t: Vector, path_s: Array, first: int, limit: float) -> Trajectory:
    """Trajectory up to the first step of the path at which the state is too large."""
    status: Status = "escape"
    time = float(path_t[first])
    kept = samples < time
    reason = f"at t = {time:.6g}: the state grows beyond {limit:.0e}"
    return Trajectory(samples[kept], s[kept], path_t[:first], path_s[:first], status, time, reason)


def heads(exact: Exact, s: Vector, stretches: list[Stretch], lengths: Vector, held: Array) -> Iterator[Vector]:
    """State at the beginning of each stretch, up to the first that is not finite."""
    chunk = max(1, CHUNK // (4 * exact.F.size))
    for i, stretch in enumerate(stretches):
        if i % chunk == 0:
            Phi, W = transitions(exact.F, exact.Q, lengths[i : i + chunk])
        if not np.isfinite(s).all():
            return
        if stretch.measured:
            s = exact.system.reset(stretch.start, s)
        yield s
        at = slice(i % chunk, i % chunk + 1)
        s = exact.moved(s[None], held[i : i + 1], lengths[i : i + 1], Phi[at], W[at])[0]
