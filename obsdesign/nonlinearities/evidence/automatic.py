"""The tightest type of the catalogue that a given nonlinearity is proved to have on a region."""

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from itertools import product
from math import inf
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression
from obsdesign.expressions.tree import Number
from obsdesign.lmi.formula import Array
from obsdesign.nonlinearities.evidence.enclosure import (
    DIGITS,
    Enclosure,
    enclosure,
    negative,
    outward,
    shown,
    supremum_of,
)
from obsdesign.nonlinearities.evidence.norm import norm_bound
from obsdesign.nonlinearities.evidence.polytope import MAX_TOGETHER, together
from obsdesign.nonlinearities.evidence.restriction import Restriction, order_free
from obsdesign.records import dataclass
from obsdesign.tables.text import at_least, at_most

MAX_VARYING = 6  # entries of a Jacobian, and so at most 64 vertices
TIGHT = 1e-4  # relative: a looser bound is worth a word


@dataclass(frozen=True)
class Choice:
    """A type that f was proved to have."""

    name: str  # in TEMPLATES
    data: Any  # as its template takes them
    text: str  # as a spec would have it
    reason: str
    brief: str = ""  # what follows from it, in fewer digits; empty: there is none

    @property
    def label(self) -> str:
        """Type as a table has it."""
        return self.brief or self.text


def choose(f: Restriction) -> Choice:
    """Return the tightest type: slopes, else a polytope of Jacobians, else a Lipschitz constant.

    Raises `UsageError`: the Jacobian cannot be bounded, or f may jump.
    """
    if f.decoupled:
        return slopes(f)
    found = bounded(f)
    if len(varying(f, found)) <= MAX_VARYING:
        return polytope(f, found)
    return lipschitz(f)


def slopes(f: Restriction) -> Choice:
    """Slope of each component; an upper bound may be infinite.

    Raises `UsageError`: a component of f depends on another component of q, or a slope has no lower bound.
    """
    if not f.decoupled:
        raise UsageError(
            "slope: auto needs an f with f_i a function of q_i only; use auto, lipschitz or jacobian", id="OBS403"
        )
    found = enclosure(f)
    for i, low in enumerate(np.diag(found.low)):
        if low == -inf:
            hint = "" if found.high[i, i] == inf else ", or write -f and -Bf, so that the slope is bounded below"
            raise UsageError(unbounded(f, i, i, "below") + hint, id="OBS403")
    low, high = np.diagonal(exact(f, found), axis1=1, axis2=2)
    text = f"slope [{listed(low)}, {listed(high)}]"
    brief = f"slope [{listed(low, at_least)}, {listed(high, at_most)}]"
    reason = f"each f_i depends on q_i only{looseness(found.gap)}"
    return Choice("slope", list(zip(low, high, strict=True)), text, reason, brief)


def polytope(f: Restriction, found: Enclosure | None = None) -> Choice:
    """Polytope of Jacobians: in the box of the entries that vary, what values that they take together leave of it.

    Entries that are the same expression are one.

    Raises `UsageError`: more entries vary than a polytope should have, or one cannot be bounded.
    """
    found = bounded(f) if found is None else found
    free = varying(f, found)
    if len(free) > MAX_VARYING:
        raise UsageError(f"jacobian: {len(free)} entries vary, at most {MAX_VARYING} may; use lipschitz", id="OBS403")
    low, high = exact(f, found)
    ranges = [(low[same[0]], high[same[0]]) for same in free]
    corners, share = list(product(*ranges)), 1.0
    if 1 < len(free) <= MAX_TOGETHER:
        corners, share = together(f, [f.jacobian[i][j] for (i, j), *_ in free], ranges)
    vertices = []
    for corner in corners:
        vertices.append(low.copy())
        for x, same in zip(corner, free, strict=True):
            for place in same:
                vertices[-1][place] = x
    gained = f"; together they take {share:.2g} of the box of their ranges at most" if share < 1 else ""
    reason = f"entries of the Jacobian that vary: {len(free)}{gained}{looseness(found.gap)}"
    return Choice("jacobian", vertices, f"jacobian of {len(vertices)} vertices", reason)


def lipschitz(f: Restriction) -> Choice:
    """Bound of the spectral norm of the Jacobian.

    Raises `UsageError`: it cannot be bounded.
    """
    if f.decoupled:
        found = bounded(f)
        bound, gap = float(np.maximum(-np.diag(found.low), np.diag(found.high)).max()), found.gap
    else:
        norm = norm_bound(f)
        bound, gap = norm.bound, norm.gap
        if bound == inf:
            raise UsageError(
                f"the Jacobian of f cannot be bounded at {shown(f, norm.place)}; give a smaller region", id="OBS403"
            )
    k = outward(bound, up=True)
    reason = f"it bounds the norm of the Jacobian{looseness(gap)}"
    return Choice("lipschitz", k, f"lipschitz {decimal(k)}", reason, f"lipschitz {at_most(k)}")


def cocoercive(f: Restriction) -> Choice:
    """Largest slope of an f that is monotone in each component.

    Raises `UsageError`: a component of f depends on another component of q, its slope may be negative, or it cannot be
    bounded.
    """
    if not f.decoupled:
        raise UsageError("cocoercive: auto needs an f with f_i a function of q_i only; give a number > 0", id="OBS403")
    found = bounded(f)
    if found.low.min() < 0:
        raise UsageError(f"cocoercive: f is not proved monotone; its slope may be {found.low.min():.6g}", id="OBS403")
    k = outward(max(float(found.high.max()), 1e-12), up=True)
    reason = f"it bounds the slopes, none is negative{looseness(found.gap)}"
    return Choice("cocoercive", k, f"cocoercive {decimal(k)}", reason, f"cocoercive {at_most(k)}")


def bounded(f: Restriction) -> Enclosure:
    """Enclosure of a Jacobian with finite bounds only."""
    found = enclosure(f)
    for i, j in np.argwhere(~(np.isfinite(found.low) & np.isfinite(found.high))):
        raise UsageError(
            unbounded(f, int(i), int(j), "above" if np.isfinite(found.low[i, j]) else "below"), id="OBS403"
        )
    return found


def unbounded(f: Restriction, i: int, j: int, side: str) -> str:
    """Say which entry of the Jacobian cannot be bounded, and where."""
    entry = f.jacobian[i][j]
    place = supremum_of(entry if side == "above" else negative(entry), f).place
    name = "df/dq" if f.nq == len(f.f) == 1 else f"df{i + 1}/dq{j + 1}"
    return f"{name} cannot be bounded {side} at {shown(f, place)}; give a smaller region"


def varying(f: Restriction, found: Enclosure) -> list[list[tuple[int, int]]]:
    """Places of the entries that vary, those of the same expression together."""
    places: dict[Any, list[tuple[int, int]]] = {}
    for i, j in np.argwhere(np.not_equal(*exact(f, found))).tolist():
        places.setdefault(order_free(f.jacobian[i][j]), []).append((i, j))
    return list(places.values())


def exact(f: Restriction, found: Enclosure) -> Array:
    """Lower and upper bounds (2, nf, nq): exact where the extremes are at corners, else decimals; None is infinite."""
    ends = np.empty((2, *found.low.shape), dtype=object)
    for i, j in np.ndindex(found.low.shape):
        root, low, high = f.jacobian[i][j].root, float(found.low[i, j]), float(found.high[i, j])
        if isinstance(root, Number):
            ends[:, i, j] = root.value
        elif (corners := extremes(f.jacobian[i][j], f)) and low <= fraction(corners[0]) <= fraction(corners[1]) <= high:
            ends[:, i, j] = corners
        else:
            ends[:, i, j] = outward(low, up=False), None if high == inf else outward(high, up=True)
    return ends


def extremes(entry: Expression, f: Restriction) -> tuple[fmpq, fmpq] | None:
    """Least and largest value of an entry of a Jacobian, where they are rational numbers at corners of the box.

    They are at corners if the entry is smooth, and affine or monotone in each variable, the others fixed; None: it is
    not seen to be so.
    """
    used = sorted(entry.names)
    ends = [f.region[name] for name in used]
    if len(used) > MAX_VARYING or any(None in pair for pair in ends) or bends(entry):
        return None
    for name in used:
        slope = entry.derivative(name)
        found = slope.enclose(f.intervals())
        if found.empty.any() or not (np.isfinite(found.low).all() and np.isfinite(found.high).all()):
            return None
        if name in slope.names and not ((found.low >= 0).all() or (found.high <= 0).all()):
            return None
    corners = [value_at(entry, dict(zip(used, corner, strict=True))) for corner in product(*ends)]
    values = [value for value in corners if value is not None]
    return (min(values), max(values)) if values and len(values) == len(corners) else None


def bends(expression: Expression) -> bool:
    """Whether an expression may jump or have a kink."""
    found: list[Expression] = []

    def seen(g: Expression, smooth: Expression) -> Expression:
        found.append(g)
        return smooth

    expression.decided(seen)
    return bool(found)


def fraction(value: fmpq) -> Fraction:
    """The same number, to be compared with doubles."""
    return Fraction(int(value.p), int(value.q))


def value_at(expression: Expression, point: Mapping[str, fmpq]) -> fmpq | None:
    """Exact value at a point; None if it is not seen to be rational."""
    found = expression.substituted({name: Expression.number(x) for name, x in point.items()})
    root = found.root
    return root.value if isinstance(root, Number) else None


def decimal(value: fmpq | None) -> str:
    """Number as a spec has it."""
    return ".inf" if value is None else f"{float(value):.{DIGITS}g}"


def listed(values: Sequence[fmpq | None], written: Callable[[fmpq], str] = decimal) -> str:
    """One number if all are the same, else a list."""
    texts = [decimal(None) if value is None else written(value) for value in values]
    return texts[0] if len(set(texts)) == 1 else f"[{', '.join(texts)}]"


def looseness(gap: float) -> str:
    """What to say of a bound that is not tight."""
    return f"; the bound may be loose by {gap:.1g} of it" if gap > TIGHT else ""
