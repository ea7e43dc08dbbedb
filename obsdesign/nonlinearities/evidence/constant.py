"""The Lipschitz constant of a nonlinearity on its region."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

from obsdesign.nonlinearities.evidence.enclosure import WORK, Doubt, Supremum, doubt, shown
from obsdesign.nonlinearities.evidence.growth import Growth, growth
from obsdesign.nonlinearities.evidence.norm import PATIENCE, TIGHT, Matrix, largest_norm
from obsdesign.nonlinearities.evidence.restriction import Range, Restriction


@dataclass(frozen=True)
class Constant:
    """A Lipschitz constant in [lower, upper]; an infinite upper bound has a reason."""

    lower: float  # the 2-norm of the Jacobian at `point`, at least
    upper: float
    point: Mapping[str, float] = field(default_factory=dict)
    boxes: int = 0  # that the bounds took
    reason: str = ""
    infinite: bool = False  # so it is seen to be; otherwise an infinite bound says nothing of the constant

    @property
    def gap(self) -> float:
        """Looseness of the upper bound, relative."""
        return (self.upper - self.lower) / self.upper if self.upper else 0.0


def lipschitz_constant(f: Restriction) -> Constant:
    """Bounds of the constant to 1e-6, relative, or why there are none.

    Raises `ExpressionError`: a derivative of f is too large to be written down.
    """
    found = doubt(f)
    if found is not None:
        return without_bound(f, found.place, found)
    norm = patient_norm(f.jacobian, f.box)
    if norm.bound == inf:
        return without_bound(f, norm.place)
    return Constant(norm.attained, norm.bound, norm.point, norm.boxes)


def patient_norm(J: Matrix, box: Mapping[str, Range]) -> Supremum:
    """Supremum of the 2-norm of a matrix, to 1e-6 unless that takes too long."""
    norm = largest_norm(J, box, work=WORK)
    return norm if norm.bound == inf or norm.gap <= TIGHT else largest_norm(J, box, work=PATIENCE)


def without_bound(f: Restriction, place: Mapping[str, Range], jump: Doubt | None = None) -> Constant:
    """Say why there is no bound: what f does at a place, as far as it is seen."""
    seen = growth(f, place)
    if seen is None:
        name = (
            f"{jump.name} may jump or be undefined" if jump else "the Jacobian of f has no bound that could be proved"
        )
        return Constant(
            0.0, inf, reason=f"{name} at {shown(f, place)}; give a smaller region, or write f with abs, sat, .."
        )
    return Constant(0.0, inf, reason=words(f, seen), infinite=True)


def words(f: Restriction, seen: Growth) -> str:
    """What was seen, and where."""
    point = ", ".join(f"{f.shown(name)} = {value:.4g}" for name, value in seen.point.items())
    if seen.slope is None:
        return f"f is undefined at {point}; give a region without that"
    return f"its slope grows without bound: it is {seen.slope:.3g} at {point}; give a smaller region"
