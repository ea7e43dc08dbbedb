"""Gains smaller than a central one, by descent within the gains that have a solution for a given mu.

With the gain L given, the form has a largest solution P+ and a smallest P-, and D = P+ - P- > 0 becomes singular where
gains end that have one. So -log det D is a barrier: what is minimised over L and the scales of multipliers is

    WEIGHT log |L| - log det D,    |L| the Schatten norm of order `ORDER`, smooth and little above the spectral norm,

by a quasi-Newton method that never leaves these gains. With A+ = A + B K(P+), unstable, and A- = A + B K(P-), stable,

    A+ Z + Z A+' = G,  Z = D^-1,    A+ S+ + S+ A+' = Z,    A- S- + S- A-' = -Z,

the barrier changes by tr(S+ N+) + tr(S- N-), N the change of the inequality at P+ or P-, its inputs u = K e eliminated:
two Lyapunov equations in the Schur form that P+ comes with. All of it is the same in other units of the states.
The smallest gain need not be found: the set of gains is not convex.
"""

import math
from collections.abc import Callable

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass, replace
from obsdesign.riccati.central import FASTER, Central, sizes
from obsdesign.riccati.equation import Equation, FastError, Subspace
from obsdesign.riccati.form import Eliminated, Form, UnclearError

WEIGHT = 200.0  # of log |L| beside the barrier
ORDER = 8  # of the norm
ON_STATES = (1e-3, 1e-4, 1e-5, 1e-6)  # noise on every state, of the size of v: the first that the central gain allows
EVALUATIONS, FEWEST = 150, 10  # of the barrier
LARGE, FEWER = 40, 2  # order from which there are fewer, by this power of it: a design takes little longer for them
ENDED = 0.05  # change of what is minimised that a step still promises
STEP = 1.0  # longest, where about 1 leads to the edge
BACK = 0.4  # factor of a step that leaves the gains which have a solution
SUFFICIENT, STEEP = 1e-4, 0.9  # of the slope: decrease and what may be left of it (Wolfe)
TRIALS = 25  # of one step
NEAR = 1e-3  # difference of log scales, beside the distance from the edge
FAINT = 1e-3  # share of the error in an output that counts as its noise
FLAT = 1e-12  # of eigenvalues of a metric, beside the largest


@dataclass(frozen=True)
class Peak:
    """What a peak asks of P beside the inequality: output P^-1 output' <= most."""

    output: Float  # (nz, n)
    most: float

    def holds(self, P: Float) -> bool:
        """Whether a P is large enough."""
        return bool(np.linalg.eigvalsh(self.output @ np.linalg.solve(P, self.output.T))[-1] <= self.most)


@dataclass(frozen=True)
class Inside:
    """The barrier at a gain and scales that have a solution, and the largest and the smallest P of it."""

    value: float
    by_gain: Float  # its gradient, (n, p)
    by_scales: Float  # (k,)
    largest: Float  # P+, (n, n)
    smallest: Float  # P-

    def middle(self, peak: Peak | None) -> Float:
        """P between the two, in the middle where a peak allows it; every one between them solves the inequality."""
        P = (self.largest + self.smallest) / 2
        while peak and not peak.holds(P) and np.abs(P - self.largest).max() > FLAT * np.abs(P).max():
            P = (P + self.largest) / 2
        return P


@dataclass(frozen=True)
class Solutions:
    """P+ and D of one equation, in the states e = V x of the Schur form T."""

    equation: Equation
    V: Float
    inverse: Float  # of V
    T: Float  # stable; A+ = -V T V^-1
    P: Float  # V' P+ V
    Z: Float  # V^-1 D^-1 V^-T

    @classmethod
    def of(cls, equation: Equation, space: Subspace) -> "Solutions":
        """Solutions from the stable subspace; raises `LinAlgError` where P+ > 0 and D > 0 do not hold."""
        s = space.s[:, None]
        V = s * space.Z2
        inverse, P = inverted(V), symmetric(V.T @ (space.Z1 / s))
        np.linalg.cholesky(P)
        Z = lyapunov(space.T, -inverse @ equation.G @ inverse.T)
        np.linalg.cholesky(Z)
        return cls(equation, V, inverse, space.T, P, Z)


class Barrier:
    """-log det (P+ - P-), and of a peak -log det (most - output X output') beside it, over gains and scales."""

    def __init__(self, form: Form, mu: float, peak: Peak | None = None) -> None:
        self.form, self.mu, self.peak = form, mu, peak
        self.evaluations = 0

    def at(self, L: Float, scales: Float) -> Inside | None:
        """Value and gradient; None where there is no solution."""
        self.evaluations += 1
        if not (np.isfinite(L).all() and np.isfinite(scales).all()):
            return None
        form = self.form.injected(L).scaled(scales)
        given = Eliminated(form.A, form.B, form.Qc, form.Qm, form.Qs, np.eye(len(form.Qc)), form.supply)
        try:
            equation = Equation.of(given, self.mu)
            space = equation.subspace()
            return None if space is None else self.inside(Solutions.of(equation, space))
        except (FastError, UnclearError, np.linalg.LinAlgError):
            return None

    def inside(self, found: Solutions) -> Inside:
        """Barrier of solutions; raises `LinAlgError` where the peak is too large."""
        V, Z, D = found.V, found.Z, symmetric(inverted(found.Z))
        value, right = float(np.linalg.slogdet(Z)[1] + 2 * np.linalg.slogdet(V)[1]), Z
        if self.peak:
            across = self.peak.output @ V @ inverted(found.P)
            left = self.peak.most * np.eye(len(across)) - across @ (self.peak.output @ V).T
            R = np.linalg.cholesky(left)
            value -= 2 * float(np.log(np.diag(R)).sum())
            apart = np.linalg.solve(R, across)
            right = symmetric(Z + np.asarray(apart.T @ apart, dtype=float))
        signals = (
            (found.P, lyapunov(found.T, -right)),
            (found.P - D, symmetric(Z @ lyapunov(found.T, -D, transposed=True) @ Z)),
        )
        by_gain, by_scales = np.zeros((self.form.n, len(self.form.C))), np.zeros(len(self.form.Qs))
        for P, S in signals:
            moved = found.equation.back @ np.vstack([V, found.inverse.T @ P])  # (e, u) of the states
            y = self.form.C @ V + self.form.D @ moved[self.form.n :]
            by_gain += 2 * found.inverse.T @ P @ S @ y.T
            by_scales += [float(np.sum((moved @ S) * (Q @ moved))) for Q in self.form.Qs]
        largest, smallest = (symmetric(found.inverse.T @ P @ found.inverse) for P in (found.P, found.P - D))
        return Inside(value, by_gain, by_scales, largest, smallest)


class Descent:
    """What is minimised, in coordinates x, y about a gain and scales: L0 + left x right, scales0 exp(turned y)."""

    def __init__(self, barrier: Barrier, units: Float, L: Float, scales: Float, at: Inside) -> None:
        self.barrier, self.units, self.L, self.scales = barrier, units, L, scales
        self.left, self.right = metric(barrier, L, scales, at)
        self.turned = curvature(barrier, L, scales, at)

    def point(self, x: Float) -> tuple[Float, Float]:
        """Gain and scales of coordinates."""
        size = self.L.size
        L = self.L + self.left @ x[:size].reshape(self.L.shape) @ self.right
        return L, self.scales * np.exp(self.turned @ x[size:])

    def __call__(self, x: Float) -> tuple[float, Float] | None:
        """Value and gradient; None where there is no solution."""
        L, scales = self.point(x)
        found = self.barrier.at(L, scales)
        if found is None:
            return None
        size, slope = smooth_size(self.units[:, None] * L)
        by_gain = self.left.T @ (found.by_gain + WEIGHT * self.units[:, None] * slope) @ self.right.T
        return found.value + WEIGHT * size, np.concatenate(
            [by_gain.ravel(), self.turned.T @ (found.by_scales * scales)]
        )


def descended(
    form: Form,
    rate: float,
    mu: float,
    start: Central,
    scales: Float,
    peak: Peak | None = None,
    of: Callable[[Form, float, Peak | None], Barrier] = Barrier,
) -> tuple[Central, Float] | None:
    """Smaller gain than a central one for a mu, with a P and the scales that prove it; None where none was found.

    `rate`: the decay rate that is in the form already; `scales`: those of the start; `of`: barrier of a form.
    """
    balanced, s = form.balanced()
    fast, (acts, _) = balanced.faster(FASTER * rate), sizes(balanced)
    turned = peak and replace(peak, output=peak.output * s)
    L = start.L / s[:, None]
    for share in ON_STATES:
        barrier = of(fast.noisy(np.full(form.n, share * acts), np.zeros(len(form.C))), mu, turned)
        at = barrier.at(L, scales)
        if at is not None:
            break
    else:
        return None
    descent = Descent(barrier, s, L, scales, at)
    with np.errstate(all="ignore"):  # of steps so long that numbers overflow
        x = minimised(descent, L.size + len(scales), evaluations(form.n))
    L, scales = descent.point(x)
    end = barrier.at(L, scales)
    made = end and Central(s[:, None] * L, end.middle(turned) / np.outer(s, s))
    return (made, scales) if made and made.size < start.size else None


def evaluations(n: int) -> int:
    """How often the barrier is evaluated for a form of an order."""
    return max(FEWEST, int(EVALUATIONS * min(1.0, LARGE / n) ** FEWER))


def metric(barrier: Barrier, L: Float, scales: Float, at: Inside) -> tuple[Float, Float]:
    """Factors left and right of steps: a unit of x is about as far as the edge.

    For the P in the middle the gains that it proves are Lc + P^-1 Delta^(1/2) Theta R^(-1/2), |Theta| <= 1, with Delta
    the Schur complement and R = D W^-1 D'. These are few directions where noise is small: the metric is the geometric
    mean of that of these gains and of one in proportion to P^-1; and R has a little of C P^-1 C' / |A|.
    """
    n, form = barrier.form.n, barrier.form.injected(L).scaled(scales)
    Q, P = form.at(barrier.mu), at.middle(None)
    W, across = -Q[n:, n:], P @ form.B + Q[:n, n:]
    delta = -symmetric(P @ form.A + form.A.T @ P + Q[:n, :n] + across @ np.linalg.solve(W, across.T))
    values, vectors = np.linalg.eigh(P)
    root = vectors / np.sqrt(np.maximum(values, FLAT * values[-1]))  # root root' = P^-1
    values, vectors = np.linalg.eigh(symmetric(root.T @ delta @ root))
    values = np.maximum(values, FLAT * values[-1])
    left = root @ vectors * (values * values.mean()) ** 0.25
    C, D = barrier.form.C @ root, barrier.form.D
    faint = FAINT * C @ C.T / max(float(np.linalg.norm(form.A, 2)), np.finfo(float).tiny)
    values, vectors = np.linalg.eigh(symmetric(D @ np.linalg.solve(W, D.T) + faint))
    return left, (vectors / np.sqrt(np.maximum(values, FLAT * values[-1]))).T


def curvature(barrier: Barrier, L: Float, scales: Float, at: Inside) -> Float:
    """Directions of log scales in which a unit is about as far as the edge, (k, k), by differences of the gradient."""
    slope = at.by_scales * scales
    step = NEAR / (1 + np.abs(slope).max(initial=0.0))
    second = np.eye(len(scales))
    for j in range(len(scales)):
        other = scales.copy()
        other[j] *= math.exp(step)
        found = barrier.at(L, other)
        if found is not None:
            second[j] += (found.by_scales * other - slope) / step
    values, vectors = np.linalg.eigh(symmetric(second))
    return np.asarray(vectors / np.sqrt(np.maximum(np.abs(values), 1.0)))


def minimised(f: Callable[[Float], tuple[float, Float] | None], size: int, evaluations: int) -> Float:
    """Point of the least value that a quasi-Newton method (BFGS) comes to from 0 in so many evaluations.

    `f`: value and gradient, None outside of its domain, 0 inside.
    """
    x, now = np.zeros(size), f(np.zeros(size))
    H, counted, first = np.eye(size), 1, True  # H: inverse of the second derivative
    while now and counted < evaluations:
        d = -H @ now[1]
        promised = float(-now[1] @ d)
        if promised < ENDED:
            break
        step, trials = stepped(f, x, d, now, min(evaluations - counted, TRIALS))
        counted += trials
        if step is None:
            break
        length, new = step
        moved, bent = length * d, new[1] - now[1]
        curved = float(moved @ bent)
        if curved > 0:
            H, first = (H * curved / float(bent @ bent) if first else H), False
            bend = H @ bent
            H = H + (1 + bent @ bend / curved) * np.outer(moved, moved) / curved
            H = H - (np.outer(bend, moved) + np.outer(moved, bend)) / curved
        x, now = x + moved, new
    return x


def stepped(
    f: Callable[[Float], tuple[float, Float] | None], x: Float, d: Float, now: tuple[float, Float], trials: int
) -> tuple[tuple[float, tuple[float, Float]] | None, int]:
    """Length of a step along d with what f is there, None where no lower value was found; and how many were tried."""
    slope = float(now[1] @ d)
    low, high, length = 0.0, math.inf, min(1.0, STEP / float(np.linalg.norm(d)))
    best: tuple[float, tuple[float, Float]] | None = None
    for trial in range(trials):
        new = f(x + length * d)
        if new is None or new[0] > now[0] + SUFFICIENT * length * slope:
            high = length
        else:
            best = (length, new)
            if float(new[1] @ d) >= STEEP * slope:
                return best, trial + 1
            low = length
        length = 2 * length if math.isinf(high) else (low + high) / 2 if low else BACK * high
    return best, trials


def smooth_size(L: Float) -> tuple[float, Float]:
    """Logarithm of the Schatten norm of order `ORDER` of a gain, and its gradient."""
    U, singular, Vt = np.linalg.svd(L, full_matrices=False)
    largest = singular[0]
    parts = (singular / largest) ** ORDER
    slopes = parts / np.maximum(singular, FLAT * largest) / parts.sum()
    return float(np.log(largest) + np.log(parts.sum()) / ORDER), (U * slopes) @ Vt


def lyapunov(T: Float, right: Float, *, transposed: bool = False) -> Float:
    """Solution of T Z + Z T' = right, or T' Z + Z T = right, for a real Schur form."""
    from scipy.linalg.lapack import dtrsyl

    ways = ("T", "N") if transposed else ("N", "T")
    Z, scale, _ = dtrsyl(T, T, right, trana=ways[0], tranb=ways[1])
    if not scale > 0:
        raise np.linalg.LinAlgError
    return symmetric(Z / scale)


def symmetric(X: Float) -> Float:
    """Symmetric part."""
    return np.asarray((X + X.T) / 2)


def inverted(X: Float) -> Float:
    """Inverse; raises `LinAlgError` where there is none."""
    return np.asarray(np.linalg.inv(X), dtype=float)
