"""What is proved of an observer whose measurements arrive sporadically."""

from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
from flint import arb, fmpq

from obsdesign.families.guarantee import (
    Bound,
    Course,
    InputBound,
    Measurements,
    Rates,
    bound,
    envelope,
    largest_output,
    largest_outputs,
    tightest,
)
from obsdesign.families.sporadic.theorem import extent
from obsdesign.lmi.formula import Array, Float, approximate, printed, rational
from obsdesign.lmi.spectrum import lower, upper
from obsdesign.records import dataclass


@dataclass(frozen=True)
class SporadicGuarantee:
    """What holds of an observer whose measurements arrive sporadically, T1 <= t_{k+1} - t_k <= T2.

    With the error e = x - xhat, d = C e - theta, z = Cp e, and the time tau that is left to the next measurement,

        V = e' P1 e + exp(delta tau) d' P2 d

    satisfies V' <= -2 decay V - |z|^2 + gamma^2 |w|^2 between measurements, and V+ <= V + exp(delta tau) eta' P2 eta
    at each, where eta is its noise. This is Theorem 2 of Ferrante, Gouaisbaut, Sanfelice and Tarbouriech on L2 state
    estimation in the presence of sporadic measurements. T1 plays a part in the bound on the effect of noise only.

    Its constants are those of rho1 |(e, d)|^2 <= V <= rho2 |(e, d)|^2.
    """

    norm: ClassVar[Literal["norm2", "sup"]] = "norm2"
    signals: ClassVar[str] = "square integrable"
    symbol: ClassVar[str] = "λ"
    resting: ClassVar[str] = "e"
    ahead: ClassVar[None] = None  # T1 plays a part in the effect of noise only

    gamma: float
    decay: float  # 1/s
    delta: float  # 1/s
    T1: float  # s
    T2: float  # s
    P1: Array  # (n, n), positive definite, in rationals
    P2: Array  # (ny, ny), positive definite, in rationals

    @property
    def reconstruction(self) -> InputBound | None:
        """Nothing: w is not reconstructed."""
        return None

    def peak(self, H: Array) -> float | None:
        """Bound on sup|H e|, H in rationals, for sup|w| = 1 from zero error; None where V need not decay."""
        return largest_output(self.rates(), rational(self.P1), H)

    def reach(self, H: Array) -> Array:
        """Bounds on |h e| / sqrt(V) for the rows h of H, in rationals, (m,): e' P1 e is at most V."""
        return largest_outputs(rational(self.P1), H)

    @cached_property
    def extent(self) -> tuple[float, float, float]:
        """rho1, rho2 and omega2, on the safe side."""
        ratio = arb(printed(self.delta) * printed(self.T2)).exp()
        rho1, rho2, omega2 = extent(rational(self.P1), rational(self.P2), ratio)
        return lower(rho1), upper(rho2), upper(omega2)

    @cached_property
    def doubles(self) -> tuple[Float, Float]:
        """P1 and P2 in doubles."""
        P1, P2 = (np.vectorize(approximate, otypes=[float])(P) for P in (self.P1, self.P2))
        return P1, P2

    def rates(self) -> Rates:
        """V' <= -2 decay V + gamma^2 |w|^2."""
        return Rates(self.decay, self.gamma**2)

    def added(self, eta: Array, timer: Array) -> Array:
        """What the noise (K, ny) of measurements adds to V, exp(delta tau) eta' P2 eta, (K,)."""
        return np.asarray(np.exp(self.delta * timer) * np.einsum("ki,ij,kj->k", eta, self.doubles[1], eta))

    def entering(self, C: Array) -> list[Array]:
        """P1 + exp(delta T2) C' P2 C, for d = C e."""
        ratio = fmpq(printed(upper((arb(printed(self.delta)) * arb(printed(self.T2))).exp())))
        return [rational(self.P1) + ratio * (C.mT @ rational(self.P2) @ C)]

    def lasting(self, t: Array, size: float, w_sup: float, eta_sup: float) -> Array:
        """Bounds on |(e, d)|, as `stays` has them."""
        rho1, rho2, omega2 = self.extent
        found, twice = np.sqrt(rho2 / rho1) * np.exp(-self.decay * t) * size, 2 * self.decay * rho1
        if w_sup:
            found = found + (self.gamma / np.sqrt(twice) * w_sup if twice else np.inf)
        if eta_sup:
            forgotten = -np.expm1(-2 * self.decay * self.T1)
            found = found + (np.sqrt(omega2 / rho1 / forgotten) * eta_sup if forgotten else np.inf)
        return np.asarray(found)

    @property
    def kick(self) -> float:
        """Largest exp(delta tau) eta' P2 eta."""
        return self.extent[2]

    def storage(self, course: Course) -> Array:
        """V along a run, (M,)."""
        at = measurements(course)
        V1 = np.einsum("ti,ij,tj->t", course.e, self.doubles[0], course.e)
        return np.asarray(V1 + self.added(at.mismatch, at.timer))

    def distance_bound(self, V_bound: Array) -> Array:
        """What a bound on V says of |(e, d)|."""
        return np.asarray(np.sqrt(V_bound / self.extent[0]))

    def bounds(self, course: Course) -> list[Bound]:
        """Check what the guarantee implies; a bound for all t is reported at the instant where it is tightest."""
        at, V = measurements(course), self.storage(course)
        size = np.asarray(np.linalg.norm(np.hstack([course.e, at.mismatch]), axis=1))  # |(e, d)|
        zero_input = not course.v2[-1] and not at.eta_sup[-1]
        early = course.t < at.crowded if at.eta_sup[-1] else np.full(len(V), True)
        return [
            self.decreases(course, V),
            *([self.descends(course, V)] if zero_input else []),
            *self.gains(course, V[0], size[0]),
            *(self.stays(course, size, early) if early.sum() > 1 else []),
        ]

    def decreases(self, course: Course, V: Array) -> Bound:
        """Bound V(t) by what is left of V(0) and what w and eta have added since."""
        added = " + gamma^2 integral exp(-2 decay (t-s)) |w(s)|^2 ds" if course.v2[-1] else ""
        noisy = measurements(course).eta_sup[-1]
        added += " + sum exp(-2 decay (t-t_k) + delta tau) eta' P2 eta" if noisy else ""
        limit = envelope(self, course, V)
        return tightest(f"sqrt(V(t)) <= sqrt(exp(-2 decay t) V(0){added})", course.t, np.sqrt(V), np.sqrt(limit))

    def descends(self, course: Course, V: Array) -> Bound:
        """Bound V at zero input by the V of the instant before: V exp(2 decay t) never increases."""
        t, root = course.t, np.sqrt(V)
        limit = np.exp(-self.decay * np.diff(t)) * root[:-1]
        return tightest("sqrt(V) exp(decay t) never increases", t[1:], root[1:], limit, float(root.max()))

    def gains(self, course: Course, V0: float, size: float) -> list[Bound]:
        """Bound norm2(z), by (25) of the paper with noise, and by (ii) of its Theorem 1 with sqrt(rho2) for rho2."""
        at = measurements(course)
        z, w = float(np.sqrt(course.z2[-1])), self.gamma * float(np.sqrt(course.v2[-1]))
        noise = " + sum exp(delta tau) eta' P2 eta" if at.eta_sup[-1] else ""
        name = f"norm2(z) <= sqrt(V(0) + gamma^2 norm2(w)^2{noise})"
        tight = bound(name, z, float(np.sqrt(V0 + w**2 + at.added[-1])))
        if noise:
            return [tight]
        size = float(np.sqrt(self.extent[1]) * size)
        return [tight, bound("norm2(z) <= sqrt(rho2) |(e, d)(0)| + gamma norm2(w)", z, size + w)]

    def stays(self, course: Course, size: Array, early: Array) -> list[Bound]:
        """Bound |(e, d)| by the largest w and eta, by (23) of the paper with 1/rho1 and the tight sum of its Lemma 2.

        `size`: |(e, d)|, (M,); `early`: instants to which the bound applies, (M,).
        """
        t, w_sup, eta_sup = (column[early] for column in (course.t, course.v_sup, measurements(course).eta_sup))
        decay, (rho1, rho2, omega2) = self.decay or np.nan, self.extent  # without it nothing bounds what w and eta add
        limit = np.sqrt(rho2 / rho1) * np.exp(-self.decay * t) * size[0]
        name = "|(e, d)(t)| <= sqrt(rho2/rho1) exp(-decay t) |(e, d)(0)|"
        if w_sup[-1]:
            name += " + gamma/sqrt(2 decay rho1) sup|w|"
            limit = limit + self.gamma / np.sqrt(2 * decay * rho1) * w_sup
        if eta_sup[-1]:
            name += " + sqrt(omega2/rho1/(1 - exp(-2 decay T1))) sup|eta|"
            forgotten = -np.expm1(-2 * decay * self.T1) or np.nan
            limit = limit + np.sqrt(omega2 / rho1 / forgotten) * eta_sup
        return [tightest(name, t, size[early], limit)]


def measurements(course: Course) -> Measurements:
    """What the jumps of a run do; there is no such guarantee without."""
    assert course.measurements
    return course.measurements
