"""The least peak gain over the scales of multipliers: mu with P >= H'H, in a form that is homogeneous in P, lambda, mu.

For lambda / mu given, the least mu is lmax(H X H') of one equation with mu = 1. A signal that dies out backwards in
time from x(0) says |H x(0)|^2 + slopes lambda <= supplied mu, by P >= H'H: a cut, which the one with x(0) = X H'u, u
the eigenvector, makes tight at that lambda.
"""

from dataclasses import replace

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.riccati.equation import dying
from obsdesign.riccati.form import Eliminated, Form, UnclearError, ZeroError, without_exact_outputs
from obsdesign.riccati.least import BELIEVED, FAR, NOISE, Least, Search, quiet, reached, require_quiet, root
from obsdesign.riccati.scaled import GRID, Best, Scales, closed, sought

PEAK_SHARES = ((1e-4, 1e-5), (1e-7, 1e-8), (1e-10, 1e-11))  # of the size of v: noise on every state
BACK = (1.0, 0.5, 0.25, 0.1, 0.01)  # shares of the way from the best scales to those that the cuts allow


def least_peak(form: Form, H: Float) -> Least:
    """Least mu with P >= H'H for some P, where the form is homogeneous in P and mu: lmax(H X H') for mu = 1.

    X falls with the noise on the states, and no faster than in proportion to its square as that goes to zero.
    Raises `UnclearError`, as `least`.
    """
    reduced, N = without_exact_outputs(form)
    if not reduced.n or not H.any():
        return Least(0.0, 0.0, 0.0)
    balanced, s = reduced.balanced()
    shares = peak_shares(balanced)
    noisier, mu = (with_noise(balanced, H @ N * s, share) for share in shares)
    added = (noisier - mu) / mu if mu > 0 else 1.0
    if not -NOISE < added < BELIEVED:
        raise ZeroError("the least gamma is zero, or too small to be told from it")
    return Least(mu, mu, max(added, 0.0), shares[-1])


def least_peak_again(form: Form, H: Float, known: Least, near: float) -> float:
    """The same in other coordinates, with the noise on the states that was small enough. Raises as `least_peak`.

    `near`: relative, a difference to what is known below which one equation tells.
    """
    if not known.share:
        return least_peak(form, H).mu
    reduced, N = without_exact_outputs(form)
    balanced, s = reduced.balanced()
    noisy, output = reached(balanced, known.share), H @ N * s
    X = solution(noisy, reduced.n)
    mu = size(output, X)
    return mu if abs(mu - known.mu) <= near * known.mu else size(output, closer(noisy, reduced.n, X))


def with_noise(form: Form, output: Float, share: float) -> float:
    """Least mu of a balanced form with a small noise on every state. Raises `UnclearError`."""
    noisy = reached(form, share)
    return size(output, closer(noisy, form.n, solution(noisy, form.n)))


def size(output: Float, X: Float) -> float:
    """Largest eigenvalue of H X H'."""
    return float(np.linalg.eigvalsh(output @ X @ output.T).max(initial=0.0))


def closer(form: Form, states: int, X: Float) -> Float:
    """X of a form for mu = 1 from an equation in coordinates in which it is about 1. Raises `UnclearError`."""
    R = root(X)
    moved = solution(form.moved(R), states, settled=True)
    return np.asarray(R @ moved @ R.T)


def solution(form: Form, states: int, *, settled: bool = False) -> Float:
    """X of a form for mu = 1. Raises `UnclearError`: none is found.

    `settled`: whether X is about 1, so that no other one is asked which solution this is.
    """
    search = Search(Eliminated.of(form), states)
    if not settled and len(form.Qs) and (far := search.at(FAR)).solved:
        search.refer(far)  # without f there is always an X, and none below it
    point = search.at(1.0)
    if not point.solved or point.X is None or (settled and not (point.equation and point.equation.solved_by(point.X))):
        raise UnclearError("no P was found")
    return point.X


def peak_shares(form: Form) -> tuple[float, float]:
    """Sizes of the noise on the states with which a peak is found. Raises `UnclearError`: none is small enough."""
    found = next((shares for shares in PEAK_SHARES if quiet(form, shares[-1])), None)
    if found is None:
        require_quiet(form, PEAK_SHARES[-1][-1])
    assert found
    return found


class PeakScales(Scales):
    """Cuts, and the best scales, of one homogeneous form whose states are balanced and have noise."""

    def __init__(self, form: Form, states: int, output: Float) -> None:
        super().__init__(form, states)
        self.output = output  # H, in the states of the form

    def step(self, scales: Float, level: float) -> None:
        """Look at scales that may have a level; where they have no solution, nearer to the best."""
        assert self.best
        known = self.best
        for share in BACK:
            there = known.scales + share * (scales - known.scales)
            if self.of_one(there / (known.mu + share * (level - known.mu))):
                return

    def of_one(self, scales: Float) -> bool:
        """Least mu in the direction of the scales for mu = 1, kept where it is the best; else what they break."""
        search = Search(Eliminated.of(self.form.scaled(scales)), self.states)
        point = search.at(1.0)
        if not point.solved or point.X is None or point.space is None or point.equation is None:
            self.cuts.add(search.signal(point), scales)
            return False
        values, vectors = np.linalg.eigh(self.output @ point.X @ self.output.T)
        mu = float(values[-1])
        if not 0 < mu < np.inf:
            raise ZeroError("the least gamma is zero, or too small to be told from it")
        c = search.direction(point.space, self.output.T @ vectors[:, -1])
        if c is None:
            raise UnclearError("the least gamma is not clear in double precision")
        signal = dying(search.form, point.equation, point.space, c, self.states)
        seen = self.output @ (point.space.s * (point.space.Z2 @ c))
        self.cuts.add(replace(signal, cost=float(seen @ seen) + float(signal.slopes @ scales)), scales)
        if self.best is None or mu < self.best.mu:
            self.best = Best(scales * mu, mu, signal)
        return True

    def begin(self) -> None:
        """Try a common scale over many sizes. Raises `UnclearError`: none has a solution."""
        form = self.form
        n, f = form.n, np.diag(form.Qm)[form.n :] == 0
        acts, forces = (np.linalg.norm(form.B[:, part], 2) ** 2 or 1.0 for part in (~f, f))
        under = np.array([np.linalg.norm(Q[n:, n:][np.ix_(f, f)], 2) or 1.0 for Q in form.Qs])
        unit = -form.supply * forces / acts / under
        for factor in sorted(GRID, key=lambda factor: abs(np.log(factor))):
            if self.best is None or self.cuts.allowed(factor * unit * self.best.mu) < self.best.mu:
                self.of_one(factor * unit)
        if self.best is None:
            sought(self, unit, 1.0, self.of_one)
        if self.best is None:
            raise UnclearError("no scales with a solution were found")


def least_peak_scaled(form: Form, H: Float) -> tuple[Least, Float]:
    """Least mu over all scales with P >= H'H, with scales that have it. Raises `UnclearError`, as `least_scaled`."""
    reduced, N = without_exact_outputs(form)
    if not reduced.n or not H.any():
        raise UnclearError("the least gamma is zero, or attained at no scales")
    balanced, s = reduced.balanced()
    output = H @ N * s
    search = PeakScales(reached(balanced, peak_shares(balanced)[-1]), reduced.n, output)
    search.begin()
    best = closed(search)
    alone = least_peak(balanced.scaled(best.scales / best.mu), output)
    found = replace(alone, lower=best.lower * (1 - alone.added), added=0.0)
    if not found.lower > 0 or found.gap > BELIEVED:
        raise UnclearError("the search over the scales of the multipliers ended with a gap")
    return found, best.scales * (found.mu / best.mu)
