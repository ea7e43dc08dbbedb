"""The least mu of a form, between a lower bound and a mu that has a solution.

P(mu), the largest solution, is concave and never decreases (the form is affine in P and mu together). So where R R' is
X of a mu with a solution, every smaller mu with one has R^-1 X R^-T >= I, and one without has a negative eigenvalue
there or no X at all: no small number decides. 1 / (largest eigenvalue) is concave and falls through zero at the least
mu, unless eigenvalues of H meet on the axis before.
"""

import math

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass
from obsdesign.riccati.equation import SILENT, Equation, FastError, Signal, Subspace, dying, fast, periodic
from obsdesign.riccati.form import Eliminated, Form, UnclearError, ZeroError, without_exact_outputs

SHARES = (1e-3, 1e-4, 1e-5, 1e-6)  # of the size of v: noise on every state
UNSEEN = 2e-8  # relative: what that noise may add to mu before less of it is tried
FADED = 1e-5  # .. before a least mu is left at it because none is clear with less
QUIET = 1e-2  # rate at which that noise and the noise of the outputs move the error, of the rates of the plant
FAINT = (1e-8, 1e-10)  # .. where the noise of the outputs is small as well
STEP = 16.0  # of mu, down from where there is a solution
FAR = 256.0  # .. whose X is the first reference
RANGE = 1e24  # of mu: beyond it nothing is looked for
CLOSE = 1e-9  # relative, to which the edge is found
NOISE = 1e-6  # .. by which a bound may be wrong
SOON = 3e-5  # .. by which it is looked just above one
WIDER = 8.0  # factor of the step above a bound that did not climb
ABOVE = 1.5  # .. of a reference above an edge that is known
ROUNDS = 60
NEGATIVE = -1e-9  # of the eigenvalues of the first X, relative to the largest
HALF = 0.5  # .. and of those of every other one, relative to its reference: they are above 1 or one is below 0
MOST = 0.9  # share of mu that is due to the noise on the states where there is no mu but for it
FEW, GOLDEN = 12, (5**0.5 - 1) / 2  # frequencies that are looked at at once, and in which order
BELIEVED = 1e-4  # a relative gap of gamma^2 above this is no answer


@dataclass(frozen=True)
class Least:
    """The least mu: `mu` has a solution, and none is below `lower`."""

    mu: float
    lower: float  # .. with a small noise on every state
    added: float  # share of mu that is due to it, to first order
    share: float = 0.0  # that noise, of the size of v; 0: none, or not told

    @property
    def gap(self) -> float:
        """Relative gap of sqrt(mu)."""
        apart = abs(self.mu / self.lower - 1) if self.mu else 0.0
        return math.sqrt((1 + apart) / (1 - self.added)) - 1

    def agrees(self, noisier: "Least") -> bool:
        """Whether it is what is left of a least mu with more noise when most of that is gone."""
        return noisier.mu * (1 - 2 * noisier.added - NOISE) <= self.mu <= noisier.mu * (1 + NOISE)


@dataclass(frozen=True)
class Point:
    """What is known at one mu."""

    mu: float
    equation: Equation | None  # None: the form is not negative for the fastest of signals
    space: Subspace | None  # None: on the axis
    X: Float | None
    level: float  # 1 / (largest eigenvalue of R^-1 X R^-T) > 0; < 0: there is no solution; -inf: on the axis
    c: Float | None = None  # direction in which X is largest, for a bound

    @property
    def solved(self) -> bool:
        """Whether there is a solution."""
        return self.level > 0


class Search:
    """Points of one eliminated form."""

    def __init__(self, form: Eliminated, noises: int) -> None:
        self.form, self.noises = form, noises
        self.R: Float | None = None  # of the reference

    def at(self, mu: float) -> Point:
        """Solve the equation at a mu and hold it against the reference, if there is one."""
        try:
            equation = Equation.of(self.form, mu)
        except FastError:
            return Point(mu, None, None, None, -math.inf)
        space = equation.subspace()
        none = Point(mu, equation, None, None, -math.inf)
        if space is None:
            return none
        try:
            X = space.X
        except np.linalg.LinAlgError:
            return none
        return self.held(mu, equation, space, X) if np.isfinite(X).all() else none

    def held(self, mu: float, equation: Equation, space: Subspace, X: Float) -> Point:
        """Point of a solution of the equation, held against the reference."""
        R = np.diag(space.s) if self.R is None else self.R
        inner = np.linalg.solve(R, np.linalg.solve(R, X).T)
        values, vectors = np.linalg.eigh((inner + inner.T) / 2)
        good = values[0] >= (HALF if self.R is not None else NEGATIVE * max(values[-1], 0.0))
        negative = values[values < 0]
        level = 1 / values[-1] if good and values[-1] > 0 else 1 / negative[-1] if len(negative) else -math.inf
        worst = vectors[:, -1] if good or not len(negative) else vectors[:, len(negative) - 1]
        return Point(mu, equation, space, X, level, self.direction(space, np.linalg.solve(R.T, worst)))

    def direction(self, space: Subspace, vector: Float) -> Float | None:
        """Costate xi with Z1 xi the vector, so that Z2 xi = X vector; normalised."""
        try:
            c = np.linalg.solve(space.Z1, space.s * vector)
        except np.linalg.LinAlgError:
            return None
        length = float(np.linalg.norm(c))
        return np.asarray(c / length) if 0 < length < math.inf else None

    def again(self, point: Point) -> Point:
        """Hold a point against another reference than when it was found."""
        if point.equation is None or point.space is None or point.X is None:
            return point
        return self.held(point.mu, point.equation, point.space, point.X)

    def refer(self, point: Point) -> Point:
        """Make a solved point the reference: its level is 1."""
        assert point.X is not None
        self.R = root(point.X)
        return Point(point.mu, point.equation, point.space, point.X, 1.0, point.c)

    def signal(self, point: Point) -> Signal:
        """Signal that bounds mu from below: of a frequency on the axis, or else dying out where X is largest."""
        if point.equation is None:
            return fast(self.form, point.mu, self.noises)
        if point.space is not None and point.c is not None:
            return dying(self.form, point.equation, point.space, point.c, self.noises)
        return self.oscillating(point.mu, point.equation.frequencies())

    def oscillating(self, mu: float, frequencies: Float) -> Signal:
        """Signal of one of some frequencies (rad/s) that bounds mu, of a few of them if these do."""
        best = SILENT
        spread = np.argsort(np.arange(len(frequencies)) * GOLDEN % 1)
        for begin in range(0, len(frequencies), FEW):
            for omega in frequencies[spread[begin : begin + FEW]]:
                found = periodic(self.form, omega, max(mu, best.bound), self.noises)
                best = max(best, found, key=lambda signal: signal.bound)
            if best.bound > mu:
                break
        return best


def root(X: Float) -> Float:
    """R, nonsingular, with R R' = X >= 0 to within rounding."""
    d = np.sqrt(np.maximum(np.diag(X), 1e-12 * np.diag(X).max(initial=0.0)))
    values, vectors = np.linalg.eigh(X / np.outer(d, d))
    return np.asarray(d[:, None] * (vectors * np.sqrt(np.maximum(values, 1e-13 * values[-1]))))


def least(form: Form) -> Least:
    """Least mu of a form, to `BELIEVED` or better; 0 where any mu can be reached because no order is left.

    Raises `UnclearError`: the numbers do not tell, or the least mu is zero or too small to be told from it.
    """
    reduced, _ = without_exact_outputs(form)
    if not reduced.n or not form.Qc.any():
        return Least(0.0, 0.0, 0.0)
    balanced, _ = reduced.balanced()
    found: Least | None = None
    used = SHARES[0]
    for share in (*SHARES, *FAINT):
        if share in FAINT and found and quiet(balanced, used):
            break
        try:
            closer = of_noisy(balanced, share, found)
        except ZeroError:
            raise
        except UnclearError as error:
            unclear = error
            if found and found.added <= FADED and quiet(balanced, used):
                break
            continue
        if found is None or closer.agrees(found):
            found, used = closer, share
        if (found.added <= UNSEEN and quiet(balanced, share)) or found is not closer:
            break
    if found is None:
        raise unclear
    require_quiet(balanced, used)
    return found


def same(form: Form, known: Least, near: float) -> bool:
    """Whether a form has the least mu that is known of it in other coordinates, to a relative `near`.

    In those where X far above it is 1, which solves large plants, or in its own, which see slow modes of stiff ones.
    """
    reduced, _ = without_exact_outputs(form)
    if not known.share or not reduced.n:
        return False
    noisy = reached(reduced.balanced()[0], known.share)
    search = Search(Eliminated.of(noisy), reduced.n)
    far = search.at(FAR * known.mu)
    if far.X is None or not far.solved:
        return False
    search.refer(far)
    assert search.R is not None
    moved = Search(Eliminated.of(noisy.moved(search.R)), reduced.n)
    moved.R = np.eye(len(far.X))
    return ends(moved, known, near) or ends(search, known, near)


def ends(search: Search, known: Least, near: float) -> bool:
    """Whether there is a solution so far above a least mu, and none so far below nor much above, by a signal."""
    outside, inside = (search.at(known.mu * factor) for factor in (1 - near, 1 + near))
    found = inside.solved and not outside.solved
    return found and bool(abs(search.signal(outside).bound / known.mu - 1) < BELIEVED)


def of_noisy(form: Form, share: float, noisier: Least | None = None) -> Least:
    """Least mu with a small noise on every state, and how much of it that noise adds.

    `noisier`: that with more noise, just below which it is. Raises `UnclearError`.
    """
    search, far = far_above(reached(form, share), form.n, noisier)
    inside, outside = bracket(search, far) if noisier is None else close(search, noisier)
    inside, best = narrowed(search, inside, outside)
    found = Least(inside.mu, best.bound, best.apart, share)
    if found.added > MOST:
        raise ZeroError("the least gamma is zero, or too small to be told from it")
    if not 1 - BELIEVED < found.lower / found.mu < 1 + BELIEVED or found.added > BELIEVED:
        raise UnclearError("the least gamma has no bound from below that is near enough")
    return found


def reached(form: Form, share: float) -> Form:
    """Same with a small noise on every state, a share of the size of v; states are balanced.

    It bounds X from below, which doubles need, and a mode on the axis that nothing reaches is no obstacle with it.
    """
    supplied = np.diag(form.Qm)[form.n :] < 0
    size = np.linalg.norm(form.B[:, supplied], 2) or 1.0
    return form.noisy(np.full(form.n, share * size), np.zeros(len(form.C)))


def quiet(form: Form, share: float) -> bool:
    """Whether a noise on every state moves the error by far less than the noise of the outputs does.

    Beyond that mu does not depend on it any more, to first order, and still is another than without it.
    """
    supplied = np.diag(form.Qm)[form.n :] < 0
    seen = np.linalg.norm(np.linalg.pinv(form.D) @ form.C, 2) if len(form.D) else 0.0
    return bool(share * np.linalg.norm(form.B[:, supplied], 2) * seen <= QUIET * np.linalg.norm(form.A, 2))


def require_quiet(form: Form, share: float) -> None:
    """Refuse a least mu that may be that of the noise on the states. Raises `UnclearError`."""
    if not quiet(form, share):
        raise UnclearError("the noise of the outputs is too small beside what acts on the states")


def first(search: Search) -> Point:
    """A point with a solution far above the least mu. Raises `UnclearError`: there is none."""
    mu, most = 1.0, RANGE
    while mu < most:
        if search.at(mu).solved and (far := search.at(FAR * mu)).solved:
            return far
        mu *= FAR
    raise UnclearError("no gamma was found that can be reached")


def far_above(form: Form, states: int, noisier: Least | None) -> tuple[Search, Point]:
    """A search in the coordinates in which X of some mu far above the least is 1, and that point, its reference.

    There X is at least about 1 for every mu below: rounding is relative to the smallest there is in every direction.
    `noisier`: the least mu of more noise. Raises `UnclearError`: no such mu was found.
    """
    search = Search(Eliminated.of(form), states)
    far = first(search) if noisier is None else search.at(FAR * noisier.mu)
    if far.X is not None and far.solved:
        search = Search(Eliminated.of(form.moved(root(far.X))), states)
        far = search.at(far.mu)
        if far.solved:
            return search, search.refer(far)
    raise UnclearError("the least gamma is not clear in double precision")


def bracket(search: Search, inside: Point) -> tuple[Point, Point]:
    """Neighbours below a point with a solution of which the first has one and the second has none.

    Raises `UnclearError`: no mu was found that has none.
    """
    least = inside.mu / RANGE
    while inside.mu > least:
        point = search.at(inside.mu / STEP)
        if not point.solved:
            return inside, point
        inside = search.refer(point)
    raise ZeroError("the least gamma is zero, or too small to be told from it")


def close(search: Search, noisier: Least) -> tuple[Point, Point]:
    """The same about what is left of a least mu with more noise. Raises `UnclearError`: it is not there."""
    inside = search.at(noisier.mu * ABOVE)
    if inside.solved:
        inside = search.refer(inside)
        outside = search.at(noisier.mu * (1 - 2 * noisier.added - NOISE))
        if not outside.solved:
            return inside, outside
    raise UnclearError("the least gamma is not clear in double precision")


def narrowed(search: Search, inside: Point, outside: Point, near: float = CLOSE) -> tuple[Point, Signal]:
    """Point with a solution relatively near to the edge, and the signal of the best lower bound that was met.

    A point without a solution gives a lower bound, by Newton's method for the level or by the frequencies on the axis,
    and the next point is just above it: the bounds climb to the edge, and one point with a solution ends it.
    Raises `UnclearError`: a bound is above a mu that has a solution.
    """
    best, step = SILENT, near
    for _ in range(ROUNDS):
        found = search.signal(outside)
        if found.bound <= outside.mu * (1 + CLOSE):  # at the edge, or below rounding
            found = max(found, search.signal(inside), key=lambda signal: signal.bound)
        if found.bound > inside.mu * (1 + NOISE):
            raise UnclearError("the least gamma is not clear in double precision")
        best = max(best, found, key=lambda signal: signal.bound)
        if inside.mu <= max(best.bound, outside.mu) * (1 + step):
            break
        if found.bound <= outside.mu * (1 + CLOSE):
            step *= WIDER
            mu = outside.mu * (1 + step) if best.bound > 0 and step < SOON else math.sqrt(outside.mu * inside.mu)
        else:
            mu = min(best.bound * (1 + step), math.sqrt(best.bound * inside.mu))
        point = search.at(mu)
        if point.solved:
            inside = point
        else:
            outside = point
    return inside, max(best, search.signal(inside), key=lambda signal: signal.bound)
