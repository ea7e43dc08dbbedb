"""What a clock-dependent certificate says of a run."""

from collections.abc import Mapping
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from obsdesign.families.guarantee import (
    Bound,
    Course,
    InputBound,
    Rates,
    bound,
    envelope,
    largest_output,
    largest_outputs,
    tightest,
)
from obsdesign.families.sporadic.clock.witness import Witness
from obsdesign.families.sporadic.guarantee import measurements
from obsdesign.lmi.formula import Array, Float, Inequality, above, below, identity, zeros
from obsdesign.lmi.proof import holds
from obsdesign.lmi.spectrum import extremes, lower, upper
from obsdesign.records import dataclass

HALVINGS = 8  # of the segments of P, at most, until its smallest eigenvalue is known to be positive


@dataclass(frozen=True)
class ClockGuarantee:
    """What holds of an observer whose measurements arrive sporadically, T1 <= t_{k+1} - t_k <= T2.

    With the error x, (e, d) or e alone, and the time tau that is left to the next measurement, V = x' P(tau) x of the
    witness satisfies V' <= -2 lambda V - |z|^2 + mu |w|^2 between measurements, and at each of them
    V+ <= V + kappa |eta|^2.
    """

    norm: ClassVar[Literal["norm2", "sup"]] = "norm2"
    signals: ClassVar[str] = "square integrable"
    symbol: ClassVar[str] = "λ"
    resting: ClassVar[str] = "e"

    gamma: float
    decay: float  # 1/s
    T1: float  # s
    T2: float  # s
    witness: Witness  # of the energy of z with noise, or else of gamma
    rate: float  # 1/s, of |x|
    constants: Mapping[str, float]
    adds: bool  # whether the bounds on |x| add

    @property
    def reconstruction(self) -> InputBound | None:
        """Nothing: w is not reconstructed."""
        return None

    @property
    def ahead(self) -> int | None:
        """Intervals to come that V depends on, where there is a shortest one."""
        return self.witness.theorem.ahead if self.T1 else None

    def rates(self) -> Rates:
        """V' <= -2 lambda V + mu |w|^2."""
        return Rates(below(self.witness.theorem.decay), above(self.witness.numbers["mu"]))

    @cached_property
    def positive(self) -> Array:
        """Matrices (k, m, m) in rationals, positive definite, of which P(tau) is a convex combination; or none."""
        clock, P = self.witness.theorem.clock, self.witness.P
        for _ in range(HALVINGS):
            found = P.reshape(-1, *P.shape[-2:])
            if all(holds(Inequality("P > 0", -matrix, strict=True)) for matrix in found):
                return found
            clock, P = clock.halved(P)
        return P[:0, 0]

    def widened(self, H: Array) -> Array:
        """H of e as one of x, in rationals."""
        return np.hstack([H, zeros((len(H), self.witness.theorem.system.order - H.shape[1]), [H])])

    def peak(self, H: Array) -> float | None:
        """Bound on sup|H e|, H in rationals, for sup|w| = 1 from zero error; None where V need not decay."""
        found = [largest_output(self.rates(), P, self.widened(H)) for P in self.positive]
        known = [max(x for x in found if x is not None)] if found and None not in found else []
        if "disturbance" in self.constants:  # of |e|
            known.append(np.nextafter(self.constants["disturbance"] * upper(extremes(H @ H.T)[1].sqrt()), np.inf))
        return min(known, default=None)

    def reach(self, H: Array) -> Array:
        """Bounds on |h e| / sqrt(V) for the rows h of H, in rationals, (m,): P^-1 is convex in P."""
        found = [largest_outputs(P, self.widened(H)) for P in self.positive]
        return np.asarray(np.max(found, axis=0)) if found else np.full(len(H), np.inf)

    @cached_property
    def doubles(self) -> Float:
        """Control values of P in doubles."""
        return np.asarray(self.witness.P.astype(float))

    @cached_property
    def kappa(self) -> float:
        """What |eta|^2 adds to V at most, beside it; infinite where nothing is known of it."""
        found = self.witness.numbers.get("kappa")
        return float("inf") if found is None else above(found)

    def entering(self, C: Array) -> list[Array]:
        """Matrices of V at the error (e, C e), or e, whatever the clock says."""
        n = self.witness.theorem.system.order - C.shape[1]
        onto = np.vstack([identity(C.shape[1], C), C]) if n else identity(C.shape[1], C)
        return [onto.mT @ P @ onto for P in self.positive]

    def lasting(self, t: Array, size: float, w_sup: float, eta_sup: float) -> Array:
        """Bounds on |x|, as `stays` has them."""
        parts = {"overshoot": np.exp(-self.rate * t) * size, "disturbance": w_sup + 0 * t, "noise": eta_sup + 0 * t}
        acting = [name for name, part in parts.items() if part.any()]
        if not self.constants.keys() >= set(acting) or (len(acting) > 1 and not self.adds):
            return np.full(len(t), np.inf)
        return np.asarray(sum((self.constants[name] * parts[name] for name in acting), 0 * t))

    @property
    def kick(self) -> float:
        """The constant kappa."""
        return self.kappa

    @cached_property
    def floor(self) -> float:
        """Smallest eigenvalue of P that is known, on the safe side; 0 where none is."""
        return min((lower(extremes(P)[0]) for P in self.positive), default=0.0)

    def added(self, eta: Array, timer: Array) -> Array:  # noqa: ARG002
        """What the noise (K, ny) of measurements adds to V at most, kappa |eta|^2, (K,)."""
        square = np.einsum("ki,ki->k", eta, eta)
        return np.asarray(np.where(square > 0, self.kappa * np.maximum(square, np.finfo(float).tiny), 0.0))

    def errors(self, course: Course) -> Array:
        """Error x along a run, (M, m), with e = x - xhat; that of a course has the other sign."""
        return np.hstack([-course.e, measurements(course).mismatch])

    def storage(self, course: Course) -> Array:
        """V along a run, (M,): with a look further ahead the least of its functions, and at the start the largest."""
        x, at, theorem = self.errors(course), measurements(course), self.witness.theorem
        time = at.elapsed if theorem.system.elapsed else at.timer
        values = [np.einsum("ti,tij,tj->t", x, theorem.clock.at(P, time), x) for P in self.doubles]
        least, largest = np.min(values, axis=0), np.max(values, axis=0)
        return np.append(largest[:1], least[1:])

    def distance_bound(self, V_bound: Array) -> Array:
        """What a bound on V says of |x|."""
        return np.asarray(np.sqrt(V_bound / self.floor)) if self.floor > 0 else np.full(len(V_bound), np.inf)

    def bounds(self, course: Course) -> list[Bound]:
        """Check what the guarantee implies; a bound for all t is reported at the instant where it is tightest."""
        at, V = measurements(course), self.storage(course)
        size = np.asarray(np.linalg.norm(self.errors(course), axis=1))
        early = course.t < at.crowded if at.eta_sup[-1] else np.full(len(V), True)
        single = len(self.doubles) == 1
        return [
            *([self.decreases(course, V)] if single and np.isfinite(course.b).all() else []),
            *self.gains(course, V[0], size[0]),
            *(self.stays(course, size, early) if early.sum() > 1 else []),
        ]

    def decreases(self, course: Course, V: Array) -> Bound:
        """Bound V(t) by what is left of V(0) and what w and eta have added since."""
        w = course.drive
        added = f" + mu integral exp(-2 decay (t-s)) |{w}(s)|^2 ds" if course.v2[-1] else ""
        added += " + sum exp(-2 decay (t-t_k)) kappa |eta|^2" if measurements(course).eta_sup[-1] else ""
        limit = envelope(self, course, V)
        return tightest(f"sqrt(V(t)) <= sqrt(exp(-2 decay t) V(0){added})", course.t, np.sqrt(V), np.sqrt(limit))

    def gains(self, course: Course, V0: float, size: float) -> list[Bound]:
        """Bound norm2(z)."""
        at = measurements(course)
        z, w = float(np.sqrt(course.z2[-1])), self.gamma * float(np.sqrt(course.v2[-1]))
        noisy = at.eta_sup[-1] > 0
        found = []
        if len(self.doubles) == 1 and np.isfinite(at.added[-1]):
            noise = " + kappa sum |eta|^2" if noisy else ""
            given = above(self.witness.numbers["mu"]) * course.v2[-1]
            name = f"norm2(z) <= sqrt(V(0) + mu norm2({course.drive})^2{noise})"
            found = [bound(name, z, float(np.sqrt(V0 + given + at.added[-1])))]
        if noisy:
            return found
        length = self.witness.theorem.system.size
        name = f"norm2(z) <= initial {length}(0) + gamma norm2({course.drive})"
        return [*found, bound(name, z, self.constants["initial"] * size + w)]

    def stays(self, course: Course, size: Array, early: Array) -> list[Bound]:
        """Bound |x| by the initial error, the largest w and the largest eta, where each has a constant.

        `size`: |x|, (M,); `early`: instants to which the bound applies, (M,).
        """
        t, w_sup, eta_sup = (column[early] for column in (course.t, course.v_sup, measurements(course).eta_sup))
        length = self.witness.theorem.system.size
        acting = {"overshoot": size[0] > 0, "disturbance": w_sup[-1] > 0, "noise": eta_sup[-1] > 0}
        names = [name for name, acts in acting.items() if acts]
        if not self.constants.keys() >= set(names) or (len(names) > 1 and not self.adds):
            return []
        terms = {
            "overshoot": (f"overshoot exp(-rate t) {length}(0)", np.exp(-self.rate * t) * size[0]),
            "disturbance": (f"disturbance sup|{course.drive}|", w_sup),
            "noise": ("noise sup|eta|", eta_sup),
        }
        limit = np.sum([self.constants[name] * terms[name][1] for name in names], axis=0) if names else 0 * t
        said = " + ".join(terms[name][0] for name in names) or "0"
        return [tightest(f"{length}(t) <= {said}", t, size[early], limit)]
