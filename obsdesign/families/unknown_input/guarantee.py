"""What is proved of a run of an unknown-input observer: V is that of eps = xi - T x."""

from typing import Any

import numpy as np

from obsdesign.dissipation.guarantee import EnergyGuarantee, EnergyOfSteps
from obsdesign.families.guarantee import Bound, Course
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass, replace

OUTWARD = 1 + 1e-12  # rounding of a norm


@dataclass(frozen=True)
class Shifted(EnergyGuarantee):
    """V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 <= 0 with V = eps' P eps, z = H e and e = eps + E D v."""

    shift: Array | None = None  # E D (n, nv), in rationals; None: e is eps
    T: Array | None = None  # (n, n), in rationals: eps(0) = T e0, with e0 the error of xhat0

    def storage(self, course: Course) -> Array:
        """V(eps(t)), (M,)."""
        return super().storage(self.inside(course))

    def bounds(self, course: Course) -> list[Bound]:
        """Check what the inequality implies, as in the family l2, of eps in place of e."""
        found = super().bounds(self.inside(course))
        if self.shift is None:
            return found
        return [{**one, "name": one["name"].replace("e(", "eps(")} for one in found]

    def inside(self, course: Course) -> Course:
        """The same course with eps as its error."""
        return course if course.inner is None else replace(course, e=course.inner)

    def entering(self, e0: Float) -> Float:
        """Bounds on eps(0) = T e0."""
        assert self.T is not None
        return np.asarray(np.abs(self.T.astype(float)) @ e0 * OUTWARD)

    def peak(self, H: Array) -> float | None:
        """Bound on sup|H e| for sup|v| = 1: that on sup|H eps|, and |H E D|."""
        most = super().peak(H)
        if most is None or self.shift is None:
            return most
        return most + OUTWARD * float(np.linalg.norm((H @ self.shift).astype(float), 2))

    def reach(self, H: Array) -> Array:
        """Bounds on |h e| / sqrt(V); infinite where v is in h e at once."""
        found = super().reach(H)
        if self.shift is None:
            return found
        seen: Any = (H @ self.shift != 0).any(axis=1)
        return np.where(seen, np.inf, found)


@dataclass(frozen=True)
class ShiftedOfSteps(Shifted, EnergyOfSteps):
    """V+ - rho^2 V + mu1 |z|^2 - mu2 |v|^2 <= 0, likewise."""
