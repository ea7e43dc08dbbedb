"""What the guarantee of an observer with sporadic measurements promises of a run, and whether the run keeps it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from obsdesign.dissipation.guarantee import SporadicGuarantee
from obsdesign.lmi.formula import Array
from obsdesign.simulate.bounds import Errors, bound, tightest


class Course(NamedTuple):
    """What the bounds of a run are made of, up to each instant."""

    errors: Errors  # with e = eps and z = yp
    distance: Array  # (M,): |x|_A
    V: Array  # (M,)
    eta_sup: Array  # (M,): largest |eta|
    kick: Array  # (M,): sum of exp(delta tau) eta' P2 eta

    def before(self, time: float) -> "Course":
        """Return the part before a time."""
        early = self.errors.t < time
        return Course(self.errors.before(time), *(column[early] for column in self[1:]))


@dataclass(frozen=True)
class Sizes:
    """Constants of rho1 |x|_A^2 <= V <= rho2 |x|_A^2, where A is the set of the states with eps = theta~ = 0."""

    guarantee: SporadicGuarantee

    @cached_property
    def rho1(self) -> float:
        """Smallest V of |x|_A = 1."""
        return float(min(np.linalg.eigvalsh(P)[0] for P in (self.guarantee.P1, self.guarantee.P2)))

    @cached_property
    def omega2(self) -> float:
        """Largest V of |theta~| = 1, eps = 0: what a noise of this size adds at most."""
        g = self.guarantee
        return float(np.linalg.eigvalsh(g.P2)[-1] * np.exp(g.delta * g.T2))

    @cached_property
    def rho2(self) -> float:
        """Largest V of |x|_A = 1."""
        return max(float(np.linalg.eigvalsh(self.guarantee.P1)[-1]), self.omega2)


def storage(
    guarantee: SporadicGuarantee, eps: Array, mismatch: Array, timer: Array, t: Array, b: Array
) -> tuple[Array, Array, Array]:
    """V, its bound exp(-2 decay t) V(0) + b, and what that says of |x|_A, (M,) each; mismatch is theta~."""
    V1 = np.einsum("ti,ij,tj->t", eps, guarantee.P1, eps)
    V2 = np.exp(guarantee.delta * timer) * np.einsum("ti,ij,tj->t", mismatch, guarantee.P2, mismatch)
    V = V1 + V2
    V_bound = np.exp(-2 * guarantee.decay * t) * V[0] + b
    return V, V_bound, np.sqrt(V_bound / Sizes(guarantee).rho1)


def bounds(course: Course, guarantee: SporadicGuarantee, crowded: float) -> list[dict[str, Any]]:
    """Check what the guarantee implies; a bound for all t is reported at the instant where it is tightest.

    Parameters
    ----------
    course
        Up to where the guarantee holds.
    crowded
        Time of the first measurement sooner than T1 after another, which ends the bound on the effect of noise.
    """
    zero_input = not course.errors.v2[-1] and not course.eta_sup[-1]
    return [
        decay(course, guarantee),
        *([descent(course, guarantee)] if zero_input else []),
        *gain(course, guarantee),
        *stability(course.before(crowded) if course.eta_sup[-1] else course, guarantee),
    ]


def decay(course: Course, guarantee: SporadicGuarantee) -> dict[str, Any]:
    """Bound V(t) by what is left of V(0) and what w and eta have added since."""
    t, b = course.errors.t, course.errors.b
    added = " + gamma^2 integral exp(-2 decay (t-s)) |w(s)|^2 ds" if course.errors.v2[-1] else ""
    added += " + sum exp(-2 decay (t-t_k) + delta tau) eta' P2 eta" if course.eta_sup[-1] else ""
    limit = np.exp(-2 * guarantee.decay * t) * course.V[0] + b
    return tightest(f"sqrt(V(t)) <= sqrt(exp(-2 decay t) V(0){added})", t, np.sqrt(course.V), np.sqrt(limit))


def descent(course: Course, guarantee: SporadicGuarantee) -> dict[str, Any]:
    """Bound V at zero input by the V of the instant before: V exp(2 decay t) never increases."""
    t, root = course.errors.t, np.sqrt(course.V)
    limit = np.exp(-guarantee.decay * np.diff(t)) * root[:-1]
    return tightest("sqrt(V) exp(decay t) never increases", t[1:], root[1:], limit, float(root.max()))


def gain(course: Course, guarantee: SporadicGuarantee) -> list[dict[str, Any]]:
    """Bound norm2(yp), by (25) of the paper with noise, and by (ii) of its Theorem 1 with sqrt(rho2) for rho2."""
    errors, start = course.errors, course.V[0]
    yp, w = float(np.sqrt(errors.z2[-1])), guarantee.gamma * float(np.sqrt(errors.v2[-1]))
    noise = " + sum exp(delta tau) eta' P2 eta" if course.eta_sup[-1] else ""
    tight = bound(
        f"norm2(yp) <= sqrt(V(0) + gamma^2 norm2(w)^2{noise})", yp, float(np.sqrt(start + w**2 + course.kick[-1]))
    )
    if noise:
        return [tight]
    size = float(np.sqrt(Sizes(guarantee).rho2) * course.distance[0])
    return [tight, bound("norm2(yp) <= sqrt(rho2) |x(0)|_A + gamma norm2(w)", yp, size + w)]


def stability(course: Course, guarantee: SporadicGuarantee) -> list[dict[str, Any]]:
    """Bound |x|_A by the largest w and eta, by (23) of the paper with 1/rho1 and the tight sum of its Lemma 2."""
    if len(course.V) < 2:
        return []
    sizes, rate = Sizes(guarantee), guarantee.decay
    t, w_sup = course.errors.t, course.errors.v_sup
    limit = np.sqrt(sizes.rho2 / sizes.rho1) * np.exp(-rate * t) * course.distance[0]
    name = "|x(t)|_A <= sqrt(rho2/rho1) exp(-decay t) |x(0)|_A"
    if w_sup[-1]:
        name += " + gamma/sqrt(2 decay rho1) sup|w|"
        limit = limit + guarantee.gamma / np.sqrt(2 * rate * sizes.rho1) * w_sup
    if course.eta_sup[-1]:
        name += " + sqrt(omega2/rho1/(1 - exp(-2 decay T1))) sup|eta|"
        limit = limit + np.sqrt(sizes.omega2 / sizes.rho1 / -np.expm1(-2 * rate * guarantee.T1)) * course.eta_sup
    return [tightest(name, t, course.distance, limit)]
