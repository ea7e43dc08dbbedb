"""The numbers of a spec that a log may decide on: which these are, and between what they are searched."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from obsdesign.errors import UsageError
from obsdesign.families import FAMILIES
from obsdesign.records import dataclass
from obsdesign.sections.changes import opened
from obsdesign.sections.scalars import Number
from obsdesign.sections.words import nearest
from obsdesign.sections.writing import flow, plain
from obsdesign.spec import Spec

DECADES = 4.0  # up and down, of a noise or a weight
FASTER = 1.5  # decades up and down, of a rate
SLOWEST = 1e-4  # of the largest rate of a range, and 1 - rho
RATES = ("alpha", "decay", "rho")
WEIGHTS = ("Q", "R")  # of white noise in w and in y
NONE = (
    "nothing in this spec can be tuned; write the noise of an output (noise: {y1: 0.01}), the rate (observer.alpha,"
    " decay or rho) or performance.weights as a number, or take a filter with Q and R"
)


@dataclass(frozen=True)
class Free:
    """One key, and its values along a search variable x, a decimal logarithm.

    A noise or a weight is that of the spec times 10^x; alpha and decay are 10^x, and rho is exp(-10^x).
    """

    key: str  # dotted
    value: Any  # as the spec has it: a number, a text, a list or a mapping
    kind: str  # scaled, rate, rho
    low: float
    high: float
    start: float | None  # where it is as in the spec; None of a range

    def at(self, x: float) -> str:
        """Value as it is written, with 4 digits."""
        if self.kind == "scaled":
            return flow(plain(times(self.value, 10**x), (), [], ""))
        return f"{math.exp(-(10**x)):.6g}" if self.kind == "rho" else f"{10**x:.4g}"

    def change(self, x: float) -> str:
        """Change of a spec: KEY=VALUE."""
        return f"{self.key}={self.at(x)}"


def times(value: Any, factor: float) -> Any:
    """Every number of a value times a factor, rounded to 4 digits; what is a formula gets it in front."""
    if isinstance(value, list):
        return [times(entry, factor) for entry in value]
    if isinstance(value, Mapping):
        return {name: times(entry, factor) for name, entry in value.items()}
    if isinstance(value, Number):
        return Number(f"{float(value) * factor:.4g}")
    return f"{factor:.4g}*({value})"


def sections(spec: Spec) -> dict[str, Any]:
    """Sections of the spec as they are written, with its changes."""
    found: dict[str, Any] = opened(spec.text, spec.path, spec.changes).root.plain()
    return found


def chosen(spec: Spec, keys: Sequence[str]) -> tuple[Free, ...]:
    """Keys of these names, or those that are searched where none is named: of one kind, the first that there is.

    R of a filter with Q and R, output by output where R is a mapping; the levels of `noise`, of a design that has them
    in w; the rate; the weights of z, but for the first where every estimate has one, for a common factor is of no
    effect. Raises `UsageError`: there is none, or one is named that cannot be searched.
    """
    kinds = by_kind(spec)
    known = {one.key: one for kind in kinds for one in kind}
    for key in keys:
        if key not in known:
            meant = nearest(key, list(known))
            said = f"{key} cannot be tuned{f'; did you mean {meant}?' if meant else ';'}"
            raise UsageError(f"--free {key}: {said} allowed: {', '.join(known) or 'none'}", id="OBS203")
    if keys:
        return tuple(known[key] for key in dict.fromkeys(keys))
    if not known:
        raise UsageError(NONE, id="OBS961")
    return next(kind for kind in kinds if kind)


def by_kind(spec: Spec) -> list[tuple[Free, ...]]:
    """All keys that can be searched, kind by kind."""
    written = sections(spec)
    observer, family = written.get("observer", {}), FAMILIES[spec.observer.type]
    weighted = all(key in observer for key in WEIGHTS)
    R, Q = (entries(f"observer.{key}", observer[key]) if weighted else () for key in ("R", "Q"))
    levels: list[Free] = []
    for name, level in (written.get("noise", {}) if family.noise_in_w else {}).items():
        part = next((key for key in ("rms", "density") if isinstance(level, dict) and key in level), "")
        levels.append(scaled(f"noise.{name}{part and f'.{part}'}", level[part] if part else level))
    rates = [] if family.equations else [rate(key, observer[key]) for key in RATES if key in observer]
    asked = written.get("performance")
    weights = entries("performance.weights", asked.get("weights", {}) if isinstance(asked, Mapping) else {})
    weights = weights[1:] if len(weights) >= len(spec.H_names) else weights
    return [R, tuple(levels), tuple(one for one in rates if one), weights, Q]


def entries(key: str, value: Any) -> tuple[Free, ...]:
    """A value as a whole, or entry by entry if it is a mapping."""
    if isinstance(value, Mapping):
        return tuple(scaled(f"{key}.{name}", entry) for name, entry in value.items() if not zero(entry))
    return (scaled(key, value),)


def zero(value: Any) -> bool:
    """Whether a number is zero, whatever it is multiplied by."""
    return isinstance(value, Number) and float(value) == 0


def scaled(key: str, value: Any) -> Free:
    """Noise or weight."""
    return Free(key, value, "scaled", -DECADES, DECADES, 0.0)


def rate(key: str, value: Any) -> Free | None:
    """Rate by a number, or by a range that has two ends, within which it stays; None of any other."""
    kind, low, high, start = "rho" if key == "rho" else "rate", 0.0, 0.0, None
    if isinstance(value, Number):
        number = float(value) if kind == "rate" else -math.log(min(max(float(value), 1e-300), 1.0))
        start = math.log10(number) if number > 0 else None
        low, high = (-3.0, 0.0) if start is None else (start - FASTER, start + FASTER)
    elif isinstance(value, Mapping) and all(isinstance(value.get(end), Number) for end in ("min", "max")):
        ends = [float(value[end]) for end in ("min", "max")]
        ends = ends if kind == "rate" else [-math.log(min(max(end, 1e-6), 1 - SLOWEST)) for end in reversed(ends)]
        if not 0 < ends[1] < math.inf:
            return None
        low, high = (math.log10(max(end, SLOWEST * ends[1])) for end in ends)
    else:
        return None
    return Free(f"observer.{key}", value, kind, low, high, start)
