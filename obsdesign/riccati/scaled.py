"""The least mu over the scales lambda > 0 of scalar multipliers, with a bound from below.

The least mu is convex in lambda. Every signal that no P can do with says base + slopes lambda <= supplied mu for all
lambda and mu: a cut. The least mu that all the cuts allow bounds it from below, and the level method goes on from the
best lambda: to the nearest one where the cuts allow a share of what is left between the two.
(Lemarechal, Nemirovskii and Nesterov, New variants of bundle methods, 1995.)
"""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass, replace
from obsdesign.riccati.cuts import Cuts
from obsdesign.riccati.equation import Signal
from obsdesign.riccati.form import Eliminated, Form, UnclearError, ZeroError, size_of, without_exact_outputs
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
LARGE = 24  # order from which equations are so few as can be
ENOUGH = 1e-5  # relative gap of mu at which the search ends
NEARBY = 1 + 1e-4  # factor below what the cuts allow at which there is no solution, unless they are wrong
LOOSE = 1e-4  # of mu: its bound is nearer but for rounding
SAME = 1e-9  # .. to which scales are no others
STEPS = 80
STALLED, SLOW = 10, 0.9  # steps after which the gap must be so much smaller
SOUGHT = 30  # scales, where no common one has a solution


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
        self.cuts = Cuts()
        self.best: Best | None = None
        self.R: Float | None = None  # of an X far above the least mu, once the states are those in which one is 1

    def look(self, scales: Float, cap: float) -> bool:
        """Least mu at some scales, kept where it is below a cap and the best; else what the cap is refuted by."""
        search, inside = self.start(scales, cap)
        if not inside.solved:
            self.cuts.add(search.signal(inside), scales)
            return False
        inside = search.refer(inside)
        if not self.cuts.allowed(scales):
            self.cuts.add(search.signal(inside), scales)
        below = min(max(self.cuts.allowed(scales) * (1 - ENOUGH / 10), cap * 1e-12), cap / (1 + ENOUGH))
        outside, further = search.at(below), NEARBY
        while outside.solved:
            inside = search.refer(outside)
            outside, further = search.at(inside.mu / further), FAR
            if outside.mu < cap * 1e-20:
                raise ZeroError("the least gamma is zero, or too small to be told from it")
        inside, signal = narrowed(search, inside, outside, ENOUGH / 4)
        if not inside.mu < signal.bound * (1 + LOOSE):
            raise UnclearError("the least gamma is not clear in double precision")
        self.cuts.add(signal, scales)
        if self.best is None or inside.mu < self.best.mu:
            self.best = Best(scales, inside.mu, signal)
        return True

    def start(self, scales: Float, cap: float) -> tuple[Search, Point]:
        """Search at some scales and its point at a cap, or the one far above it where that has no solution.

        That one judges the other, and is only asked where the other may have a solution. Of a large form it is that of
        scales nearby, where it says that there is one.
        """
        search = self.at(scales)
        if self.R is None:
            far = search.at(FAR * cap)
            if far.X is None or not far.solved:
                return search, far
            self.form, self.R = self.form.moved(root(far.X)), np.eye(self.form.n)
            search = self.at(scales)
        inside = search.at(cap)
        if not inside.solved:
            return search, inside
        if self.form.n >= LARGE:
            search.R = self.R
            if (again := search.again(inside)).solved:
                return search, again
            search.R = None
        far = search.at(FAR * cap)
        if not far.solved:
            return search, far
        search.refer(far)
        self.R = search.R
        return search, search.again(inside)

    def at(self, scales: Float) -> Search:
        """Search at some scales."""
        return Search(Eliminated.of(self.form.scaled(scales)), self.states)

    def step(self, scales: Float, level: float) -> None:  # noqa: ARG002 - a level, where mu is not free
        """Look at scales that may have a level."""
        assert self.best
        self.look(scales, self.best.mu)


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
        best = search.best
        lower = max(lower, min(search.cuts.lower(best.scales, best.mu), best.mu))
        if best.mu <= lower * (1 + ENOUGH):
            return replace(best, lower=lower)
        gaps.append(best.mu - lower)
        if len(gaps) > STALLED and gaps[-1] > SLOW * gaps[-1 - STALLED]:
            break
        found = next((found for found in hopeful(search.cuts, best, lower) if not alike(found[0], last)), None)
        if found is None:
            break
        search.step(*found)
        last = found[0]
    raise UnclearError("the search over the scales of the multipliers ended with a gap")


def hopeful(cuts: Cuts, best: Best, lower: float) -> Iterator[tuple[Float, float]]:
    """Scales where the cuts allow a lower mu, and that: near the best ones, then the best in a box about them."""
    levels = (lower + share * (best.mu - lower) for share in LEVELS)
    reached = ((cuts.nearest(best.scales, best.mu, level), level) for level in levels)
    yield from next(([(near, level)] for near, level in reached if near is not None), [])
    if (edge := cuts.lowest(best.scales, best.mu)) is not None:
        yield edge, cuts.allowed(edge)


def alike(scales: Float, last: Float | None) -> bool:
    """Whether scales are those that were looked at last."""
    return last is not None and np.allclose(scales, last, rtol=SAME, atol=0)


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
            if search.cuts.allowed(factor * unit) < cap:
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
        scales = search.cuts.middle(about, mu)
        if scales is None or look(scales):
            return
        about = scales
