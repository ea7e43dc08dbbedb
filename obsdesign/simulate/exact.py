"""Linear flows with inputs that are constant between events: by matrix exponentials, exact up to rounding."""

from collections.abc import Iterator

import numpy as np

from obsdesign.families.guarantee import Rates
from obsdesign.lmi.formula import Array
from obsdesign.simulate.integrate import GROWS, HUGE, Trajectory, Vector
from obsdesign.simulate.scenario import Stretch
from obsdesign.simulate.sizes import balanced, sizes
from obsdesign.simulate.system import V2, Affine, System

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

    def __init__(self, system: System, affine: Affine) -> None:
        self.system, self.affine = system, affine
        end, width = system.end, affine.F.shape[1]
        self.F = np.zeros((width, width))  # on (flowing states, held signals)
        self.F[:end] = affine.F
        self.Q = np.zeros_like(self.F)
        error = slice(len(system.integrated), len(system.integrated) + len(system.copied))
        self.Q[error, error] = system.H.T @ system.H
        self.unit = balanced(self.F)  # of each state and held signal
        self.F *= self.unit / self.unit[:, None]
        self.Q *= self.unit * self.unit[:, None]
        sizes = np.abs(self.Q).max(initial=0.0), np.abs(self.F).max(initial=0.0)
        self.weight = 2.0 ** round(float(np.log2(sizes[1] / sizes[0]))) if all(sizes) else 1.0
        self.Q *= self.weight
        rates = system.guarantee.rates() if system.guarantee else Rates(0.0, 0.0)
        self.alpha, self.supply = rates.alpha, rates.c

    def held(self, t: Vector) -> Array:
        """Held signals, and |v|^2, at instants, one row each."""
        return self.system.table(t, np.zeros((len(t), self.system.width))).of((*self.affine.held, V2))

    def advance(self, s: Array, held: Array, h: Vector) -> Array:
        """Return the states that follow s (K, ns) under constant inputs after times h (K,)."""
        rows = max(1, CHUNK // (4 * self.F.size))
        chunks = [slice(i, i + rows) for i in range(0, len(h), rows)]
        parts = [self.moved(s[k], held[k], h[k], *transitions(self.F, self.Q, h[k])) for k in chunks]
        return np.concatenate(parts) if parts else s

    def moved(self, s: Array, held: Array, h: Vector, Phi: Array, W: Array) -> Array:
        """Return what follows s, given the matrices of `transitions`."""
        end, v2, rate = self.system.end, held[:, -1], 2 * self.alpha
        X = (np.concatenate((s[:, :end], held[:, :-1]), axis=1) / self.unit)[:, :, None]
        share = -np.expm1(-rate * h) / rate if rate else h
        after = s.copy()
        after[:, :end] = (Phi @ X)[:, :end, 0] * self.unit[:end]
        after[:, end] += (X.mT @ W @ X)[:, 0, 0] / self.weight
        after[:, end + 1] += v2 * h
        after[:, end + 2] = np.exp(-rate * h) * s[:, end + 2] + self.supply * v2 * share
        return after

    def fineness(self, lengths: Vector) -> Array:
        """Steps in each stretch, (N,): several in each time constant and radian."""
        fastest = np.abs(np.linalg.eigvals(self.F)).max()
        steps = np.clip(np.ceil(4 * fastest * lengths), FINE, FINEST)
        return np.asarray(np.minimum(steps, max(1, ROWS // len(lengths))), dtype=int)


def follow(system: System, affine: Affine, start: Vector, stretches: list[Stretch], samples: Vector) -> Trajectory:
    """Follow the flow and its jumps through all stretches.

    Returns
    -------
    Trajectory
        States at the samples and on a grid in each stretch; with status "escape" where the state grows beyond 1e8
        times its size.
    """
    exact = Exact(system, affine)
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
        beyond = ~(np.linalg.norm(path_s[:, : system.end] / sizes(system, start), axis=1) < HUGE)
    if not beyond.any():
        return Trajectory(samples, s, path_t, path_s, "done", stretches[-1].stop, "")
    first = int(np.argmax(beyond))
    time = float(path_t[first])
    kept = samples < time
    reason = f"at t = {time:.6g}: {GROWS}"
    return Trajectory(samples[kept], s[kept], path_t[:first], path_s[:first], "escape", time, reason)


def heads(exact: Exact, s: Vector, stretches: list[Stretch], lengths: Vector, held: Array) -> Iterator[Vector]:
    """State at the beginning of each stretch, up to the first that is not finite."""
    chunk = max(1, CHUNK // (4 * exact.F.size))
    for i, stretch in enumerate(stretches):
        if i % chunk == 0:
            Phi, W = transitions(exact.F, exact.Q, lengths[i : i + chunk])
        if not np.isfinite(s).all():
            return
        s = exact.system.enter(stretch, s)
        yield s
        at = slice(i % chunk, i % chunk + 1)
        s = exact.moved(s[None], held[i : i + 1], lengths[i : i + 1], Phi[at], W[at])[0]
