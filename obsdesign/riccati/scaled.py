"""The least mu over the scales lambda > 0 of scalar multipliers, with a bound from below.

The least mu is convex in lambda. Every signal that no P can do with says base + slopes lambda <= supplied mu for all
lambda and mu: a cut. The least mu that all the cuts allow bounds it from below, and the level method goes on from the
best lambda: to the nearest one where the cuts allow a share of what is left between the two.
(Lemarechal, Nemirovskii and Nesterov, New variants of bundle methods, 1995.)
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.riccati.equation import Signal
from obsdesign.riccati.form import Eliminated, Form, UnclearError, ZeroError, without_exact_outputs
from obsdesign.riccati.least import (
    ABOVE,
    BELIEVED,
    FAR,
    Least,
    Point,
    Search,
    least,
    narrowed,
    quiet,
    reached,
    require_quiet,
    root,
)

SHARES = (1e-4, 1e-5, 1e-6)  # of the size of v: noise on every state
UNSEEN = 1e-5  # relative: what that noise may add to mu before less of it is tried
GRID = tuple(float(factor) for factor in np.exp(3.0 * np.arange(-8, 9)))  # factors of a common scale, to begin with
HIGH = (1e3, 1e6)  # of the size of mu: where it is tried whether scales have a solution at all
HIGHER = (1e9, 1e12)  # .. where the gain is given
LEVELS = (0.3, 0.6, 0.9, 0.99)  # shares of the way from the lower bound to the best, where the box allows one
BOX = 30.0  # factor by which a scale changes at most in one step
LARGE = 24  # order from which equations are so few as can be
WIDE = 1e8  # .. and from the best to the lower bound
ENOUGH = 1e-5  # relative gap of mu at which the search ends
NEARBY = 1 + 1e-4  # factor below what the cuts allow at which there is no solution, unless they are wrong
LOOSE = 1e-4  # of mu: its bound is nearer but for rounding
SAME = 1e-9  # .. to which scales are no others
STEPS = 80
STALLED, SLOW = 10, 0.9  # steps after which the gap must be so much smaller
SOUGHT = 30  # scales, where no common one has a solution


@dataclass(frozen=True)
class Cut:
    """What a signal says: base + slopes lambda <= supplied mu."""

    base: float
    slopes: Float
    supplied: float

    @classmethod
    def of(cls, signal: Signal, scales: Float) -> "Cut | None":
        """Cut of a signal that was found for some scales; None where it says nothing."""
        if not np.isfinite([signal.cost, signal.supplied, *signal.slopes]).all() or len(signal.slopes) != len(scales):
            return None
        return cls(signal.cost - float(signal.slopes @ scales), signal.slopes, max(signal.supplied, 0.0))


@dataclass(frozen=True)
class Best:
    """Scales with the least mu that they have, and the signal that says that they have none below it."""

    scales: Float
    mu: float
    signal: Signal
    lower: float = 0.0  # of mu over all scales


class Scales:
    """Cuts, and the best scales, of one form whose states are balanced and have noise."""

    def __init__(self, form: Form, states: int) -> None:
        self.form, self.states = form, states
        self.cuts: list[Cut] = []
        self.best: Best | None = None
        self.settled = False  # whether the coordinates are those in which some X far above the least mu is 1

    def cut(self, signal: Signal, scales: Float) -> None:
        """Keep what a signal says."""
        made = Cut.of(signal, scales)
        if made is not None:
            self.cuts.append(made)

    def allowed(self, scales: Float) -> float:
        """Least mu that the cuts allow at some scales; infinite where they allow none."""
        values = [0.0]
        for cut in self.cuts:
            need = cut.base + float(cut.slopes @ scales)
            values.append(need / cut.supplied if cut.supplied > 0 else np.inf if need > 0 else 0.0)
        return max(values)

    def look(self, scales: Float, cap: float) -> bool:
        """Least mu at some scales, kept where it is below a cap and the best; else what the cap is refuted by."""
        search, far = self.far(scales, cap)
        inside = search.at(cap)
        if not far.solved or not inside.solved:
            self.cut(search.signal(far if not far.solved else inside), scales)
            return False
        inside = search.refer(inside)
        below = min(max(self.allowed(scales) * (1 - ENOUGH / 10), cap * 1e-12), cap / (1 + ENOUGH))
        outside, further = search.at(below), NEARBY
        while outside.solved:
            inside = search.refer(outside)
            outside, further = search.at(inside.mu / further), FAR
            if outside.mu < cap * 1e-20:
                raise ZeroError("the least gamma is zero, or too small to be told from it")
        inside, signal = narrowed(search, inside, outside, ENOUGH / 4)
        if not inside.mu < signal.bound * (1 + LOOSE):
            raise UnclearError("the least gamma is not clear in double precision")
        self.cut(signal, scales)
        if self.best is None or inside.mu < self.best.mu:
            self.best = Best(scales, inside.mu, signal)
        return True

    def far(self, scales: Float, cap: float) -> tuple[Search, Point]:
        """Points at some scales, and the one far above a cap; the first that has a solution sets the coordinates."""
        search = Search(Eliminated.of(self.form.scaled(scales)), self.states)
        far = search.at(FAR * cap)
        if far.X is None or not far.solved:
            return search, far
        if self.settled:
            return search, search.refer(far)
        self.form, self.settled = self.form.moved(root(far.X)), True
        return self.far(scales, cap)

    def step(self, scales: Float, level: float) -> None:  # noqa: ARG002 - a level, where mu is not free
        """Look at scales that may have a level."""
        assert self.best
        self.look(scales, self.best.mu)

    def lower(self) -> float:
        """Least mu that the cuts allow at any scales."""
        from scipy.optimize import linprog

        assert self.best
        rows, right = self.rows()
        k = len(self.best.scales)
        found = linprog(np.eye(k + 1)[-1], rows, right, bounds=[(0, WIDE)] * k + [(0, None)], method="highs")
        return 0.0 if found.status or found.x is None else float(found.x[-1]) * self.best.mu

    def rows(self) -> tuple[Float, Float]:
        """Cuts a x <= b in x = (lambda / best, mu / best), each of unit size."""
        assert self.best
        rows = np.array([[*(cut.slopes * self.best.scales), -cut.supplied * self.best.mu] for cut in self.cuts])
        right = -np.array([cut.base for cut in self.cuts])
        sizes = np.maximum(np.abs(rows).max(axis=1), np.abs(right))
        return rows / sizes[:, None], right / sizes

    def middle(self, about: Float, mu: float) -> Float | None:
        """Scales in the middle of those where the cuts allow a mu, relative to some scales; None if there are none."""
        from scipy.optimize import linprog

        rows = np.array([cut.slopes * about for cut in self.cuts])
        right = np.array([cut.supplied * mu - cut.base for cut in self.cuts])
        sizes = np.linalg.norm(rows, axis=1)
        kept = sizes > 0
        rows, right, k = rows[kept] / sizes[kept, None], right[kept] / sizes[kept], len(about)
        within = np.vstack([np.hstack([rows, np.ones((len(rows), 1))]), np.hstack([-np.eye(k), np.ones((k, 1))])])
        bounds = [(1 / BOX, BOX)] * k + [(0, None)]
        found = linprog(-np.eye(k + 1)[-1], within, [*right, *([0.0] * k)], bounds=bounds, method="highs")
        return None if found.status or found.x is None else about * found.x[:-1]

    def nearest(self, level: float) -> Float | None:
        """Nearest scales to the best, relative to them, where the cuts allow a level; None if there are none."""
        assert self.best
        rows, right = self.rows()
        k = len(self.best.scales)
        G = np.vstack([-rows[:, :k], np.eye(k), -np.eye(k)])
        h = np.concatenate([rows[:, :k].sum(axis=1) + rows[:, k] * level / self.best.mu - right, np.zeros(2 * k)])
        h[len(rows) :] = [*([1 / BOX - 1] * k), *([1 - BOX] * k)]
        step = least_distance(G, h)
        return None if step is None else self.best.scales * (1 + step)


def least_distance(G: Float, h: Float) -> Float | None:
    """Shortest y with G y >= h (Lawson and Hanson 1974, ch. 23); None if there is none."""
    from scipy.optimize import nnls

    E = np.vstack([G.T, h])
    f = np.eye(len(E))[-1]
    try:
        u, _ = nnls(E, f)
    except RuntimeError:
        return None
    r = E @ u - f
    y = -r[:-1] / r[-1] if r[-1] < -1e-12 else None
    return y if y is not None and np.isfinite(y).all() else None


def least_scaled(form: Form) -> tuple[Least, Float]:
    """Least mu over all scales, with scales that have it. Raises `UnclearError`, also where no scales were found."""
    reduced, _ = without_exact_outputs(form)
    if not reduced.n or not form.Qc.any():
        raise UnclearError("the least gamma is zero, or attained at no scales")
    balanced, _ = reduced.balanced()
    found: Best | None = None
    for share in SHARES:
        found = searched(balanced, share, found)
        if found.signal.apart <= UNSEEN and quiet(balanced, share):
            break
    assert found
    require_quiet(balanced, share)
    return alone(balanced, found, share)


def alone(form: Form, best: Best, share: float) -> tuple[Least, Float]:
    """Least mu at the best scales without most of the noise of the search, and the lower bound without all of it.

    `share`: that noise. Of a large form it is left as it is where it adds less than `UNSEEN`.
    """
    mu, noise = best.mu, share
    enough = form.n >= LARGE and best.signal.apart <= UNSEEN
    try:
        closer = None if enough else least(form.scaled(best.scales))
    except UnclearError:
        closer = None
    if closer and best.lower * (1 - 2 * best.signal.apart) <= closer.mu <= mu:
        mu, noise = closer.mu, closer.share
    found = Least(mu, best.lower * (1 - best.signal.apart), 0.0, noise)
    if not found.lower > 0 or found.gap > BELIEVED:
        raise UnclearError("the search over the scales of the multipliers ended with a gap")
    return found, best.scales


def searched(form: Form, share: float, known: Best | None) -> Best:
    """Search with a small noise on every state, from scales that are known. Raises `UnclearError`."""
    search = Scales(reached(form, share), form.n)
    if known is None or not search.look(known.scales, known.mu * ABOVE):
        begin(search, form)
    return closed(search)


def closed(search: Scales) -> Best:
    """The best scales once nothing is left between them and the lower bound. Raises `UnclearError`: something is."""
    assert search.best
    lower, last = 0.0, None
    gaps: list[float] = []
    for _ in range(STEPS):
        lower = max(lower, min(search.lower(), search.best.mu))
        if search.best.mu <= lower * (1 + ENOUGH):
            return replace(search.best, lower=lower)
        gaps.append(search.best.mu - lower)
        if len(gaps) > STALLED and gaps[-1] > SLOW * gaps[-1 - STALLED]:
            break
        levels = (lower + share * (search.best.mu - lower) for share in LEVELS)
        found = next(((near, level) for level in levels if (near := search.nearest(level)) is not None), None)
        if found is None or (last is not None and np.allclose(found[0], last, rtol=SAME, atol=0)):
            break
        search.step(*found)
        last = found[0]
    raise UnclearError("the search over the scales of the multipliers ended with a gap")


def begin(search: Scales, form: Form) -> None:
    """Try a common scale over many sizes. Raises `UnclearError`: none has a solution."""
    n = form.n
    f = np.diag(form.Qm)[n:] == 0
    weight = np.linalg.norm(form.Qc[:n, :n], 2)
    unit = weight / np.array([size_of(Q[:n, :n], Q[:n, n:][:, f], Q[n:, n:][np.ix_(f, f)]) for Q in form.Qs])
    seen = np.linalg.norm(np.linalg.pinv(form.D) @ form.C, 2) ** 2 or 1.0
    acts = np.linalg.norm(form.B[:, ~f], 2) / (np.linalg.norm(form.A, 2) or 1.0)
    highs = [high / seen for high in (HIGH if len(form.D) else HIGH + HIGHER)]
    for high in sorted({*highs, max(*highs, HIGH[0] * acts**2)}):
        cap = float(high * weight)
        for factor in sorted(GRID, key=lambda factor: abs(np.log(factor))):
            cap = cap if search.best is None else search.best.mu
            if search.allowed(factor * unit) < cap:
                search.look(factor * unit, cap)
        if search.best is None:
            sought(search, unit, cap, partial(search.look, cap=cap))
        if search.best is not None:
            return
    raise UnclearError("no scales with a solution were found")


def sought(search: Scales, unit: Float, mu: float, look: Callable[[Float], bool]) -> None:
    """Look at scales in the middle of what the cuts allow for a mu, until some have a solution."""
    about = unit
    for _ in range(SOUGHT):
        scales = search.middle(about, mu)
        if scales is None or look(scales):
            return
        about = scales


def size_of(ee: Float, ef: Float, ff: Float) -> float:
    """Size of what a multiplier adds to the weight of e, with its f eliminated."""
    across = float(np.linalg.norm(ef, 2)) ** 2 if ef.size else 0.0
    under = float(np.linalg.norm(ff, 2)) if ff.size else 0.0
    return max(float(np.linalg.norm(ee, 2)), across / under if under else 0.0) or 1.0
