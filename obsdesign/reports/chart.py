"""Charts as numbers of an SVG: scales, ticks, paths, and the samples that the page shows under the pointer."""

import math
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.records import dataclass, field

WIDTH, HEIGHT = 460, 264
LEFT, TOP, RIGHT, BOTTOM = 76, 12, 18, 42  # margins
TICKS = 5  # about
DECADES = 7  # labels on a logarithmic axis, at most
WIDE = 30  # ratio of what a logarithmic axis shows at least
BUCKETS = 110  # of a curve: each keeps its extremes
DEPTH = 1e-14  # of the largest: smaller errors are rounding
FARTHEST, NEAREST = 1e100, 1e-100  # magnitudes that can be drawn; a smaller one is 0
PEAK = 8  # widths of the leading curve: what takes more of a panel leaves it

Look = Literal["line", "dashed", "dotted", "points"]


@dataclass(frozen=True)
class Axis:
    """Values along one side of a chart."""

    label: str
    low: float
    high: float
    log: bool = False

    @classmethod
    def over(cls, label: str, values: Array, *, log: bool = False, tight: bool = False) -> "Axis":
        """Axis that shows all of the values; a linear one with a little room, unless it is tight."""
        seen = values[abs(values) < FARTHEST]
        seen = np.where(abs(seen) < NEAREST, 0.0, seen)
        seen = seen[(seen > 0) | (not log)]
        if not seen.size:
            return cls(label, 0.0, 1.0)
        low, high = float(seen.min()), float(seen.max())
        if log:
            room = (high / low) ** 0.04 if high > low else 2.0
            return cls(label, low / room, high * room, True)
        room = 0.0 if tight and high > low else 0.06 * (high - low) or 0.1 * abs(high) or 1.0
        return cls(label, low - room, high + room)

    def at(self, values: Array) -> Array:
        """Fraction of the axis."""
        with np.errstate(all="ignore"):
            scaled = np.log(np.where(values > 0, values, np.nan)) if self.log else values
            low, high = (math.log(self.low), math.log(self.high)) if self.log else (self.low, self.high)
            return np.asarray((scaled - low) / (high - low))

    @cached_property
    def ticks(self) -> list[tuple[float, str]]:
        """Round values, and how they are written."""
        if self.log:
            first, last = math.ceil(math.log10(self.low)), math.floor(math.log10(self.high))
            if last > first:
                every = 1 + (last - first) // DECADES
                return [(10.0**k, power(k)) for k in range(first, last + 1, every)]
        step = rounded((self.high - self.low) / TICKS)
        count = range(math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9) + 1)
        largest = max((abs(k * step) for k in count), default=0.0)
        return [(k * step, written(k * step, step, largest)) for k in count if not self.log or k > 0]


def rounded(step: float) -> float:
    """1, 2 or 5 times a power of ten, near a step."""
    unit = 10.0 ** math.floor(math.log10(step))
    return unit * min((1, 2, 5, 10), key=lambda k: abs(math.log(step / unit / k)))


def written(value: float, step: float, largest: float) -> str:
    """Tick of a linear axis, with as many digits as the step needs."""
    if largest >= 1e5 or largest < 1e-3:
        return f"{value:.3g}".replace("-", "−").replace("e+0", "e").replace("e−0", "e−")
    return f"{value:.{max(0, -math.floor(math.log10(step) + 1e-9))}f}".replace("-", "−")


def power(k: int) -> str:
    """Power of ten; the three about one as plain numbers."""
    return {-1: "0.1", 0: "1", 1: "10"}.get(k) or "10" + str(k).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


@dataclass(frozen=True)
class Curve:
    """Values of one quantity over the abscissae of its chart, NaN where there are none."""

    name: str
    y: Array
    look: Look = "line"
    color: int = 1  # number of a color of the style


@dataclass(frozen=True)
class Chart:
    """Curves over common abscissae, with their axes."""

    title: str
    x: Array
    curves: tuple[Curve, ...]
    across: Axis
    along: Axis
    note: str = ""
    box: tuple[int, int, int, int] = field(default=(LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM))
    size: tuple[int, int] = (WIDTH, HEIGHT)

    def path(self, curve: Curve) -> str:
        """Line of a curve within the box, with gaps where it has no values."""
        _, _, width, height = self.box
        x, y = self.across.at(self.x) * width, (1 - self.along.at(curve.y)) * height
        y = np.clip(y, -5 * height, 6 * height)
        words, drawn = [], False
        for a, b in zip(x, y, strict=True):
            if finite := bool(np.isfinite(a) and np.isfinite(b)):
                words.append(f"{'L' if drawn else 'M'}{a:.1f} {b:.1f}")
            drawn = finite
        return "".join(words)

    def marks(self, curve: Curve) -> list[tuple[str, str]]:
        """Centers of the points of a curve within the box."""
        _, _, width, height = self.box
        pairs = zip(self.across.at(self.x) * width, (1 - self.along.at(curve.y)) * height, strict=True)
        return [(f"{a:.1f}", f"{b:.1f}") for a, b in pairs if np.isfinite(a) and np.isfinite(b)]

    def ticks(self, which: Literal["across", "along"]) -> list[tuple[str, str]]:
        """Places of ticks within the box, and their labels."""
        axis, (_, _, width, height) = getattr(self, which), self.box
        found = [(float(axis.at(np.array(value))), text) for value, text in axis.ticks]
        return [
            (f"{at * width if which == 'across' else (1 - at) * height:.1f}", text)
            for at, text in found
            if -1e-9 <= at <= 1 + 1e-9
        ]

    @property
    def data(self) -> dict[str, Any]:
        """What the page needs to show values under the pointer."""
        return {
            "x": [short(value) for value in self.x],
            "across": [self.across.low, self.across.high, int(self.across.log)],
            "along": [self.along.low, self.along.high, int(self.along.log)],
            "box": list(self.box),
            "curves": [[short(value) for value in curve.y] for curve in self.curves],
        }

    @property
    def described(self) -> str:
        """What the chart shows, in words."""
        names = ", ".join(curve.name for curve in self.curves)
        return f"{self.title}: {names} over {self.across.label}"


def short(value: float) -> float | None:
    """Number of five digits; None where there is none."""
    return float(f"{value:.5g}") if np.isfinite(value) else None


def thinned(x: Array, *columns: Array) -> Array:
    """Indices of samples that keep the extremes of every column in each of `BUCKETS` parts, and both ends."""
    if len(x) <= 2 * BUCKETS:
        return np.arange(len(x))
    edges = np.linspace(0, len(x), BUCKETS + 1).astype(int)
    kept = {0, len(x) - 1}
    for low, high in pairwise(edges):
        for y in columns:
            part = np.where(np.isfinite(y[low:high]), y[low:high], 0.0)
            kept |= {low + int(part.argmin()), low + int(part.argmax())}
    return np.array(sorted(kept))


def over_time(title: str, label: str, t: Array, curves: Sequence[Curve], note: str = "") -> Chart:
    """Curves over time; one that leaves the range of the first by far is cut, and the chart says so.

    It is not cut where it is in the second half of the time.
    """
    which = thinned(t, *(curve.y for curve in curves))
    kept = tuple(Curve(c.name, c.y[which], c.look, c.color) for c in curves)
    values, lead = np.concatenate([c.y for c in curves]), curves[0].y
    along, width = Axis.over(label, values), float(np.ptp(lead))
    if width > 0 and along.high - along.low > PEAK * width:
        late = np.concatenate([[lead.min() - width, lead.max() + width], *(c.y[len(t) // 2 :] for c in curves)])
        seen = Axis.over(label, late)
        low, high = seen.low, seen.high
        far = values[np.isfinite(values)]
        ends = ", ".join(f"{end:.3g}" for end in (far.min(), far.max()) if not low <= end <= high)
        along, note = seen, f"cut: reaches {ends}" + (f"; {note}" if note else "")
    return Chart(title, t[which], kept, Axis.over("t [s]", t, tight=True), along, note)


def of_errors(title: str, label: str, t: Array, curves: Sequence[Curve], note: str = "") -> Chart:
    """Absolute values over time, on a logarithmic axis where they span decades."""
    sizes = [np.abs(curve.y) for curve in curves]
    largest = max((float(size[np.isfinite(size)].max(initial=0.0)) for size in sizes), default=0.0)
    floored = [np.where(size > DEPTH * largest, size, np.nan) for size in sizes]
    late = [size[-max(1, len(size) // 5) :] for size in floored]
    least = min((float(np.nanmax(part)) for part in late if np.isfinite(part).any()), default=largest)
    log = bool(largest > WIDE * least > 0)
    which = thinned(t, *floored)
    kept = tuple(
        Curve(c.name, (f if log else s)[which], c.look, c.color) for c, s, f in zip(curves, sizes, floored, strict=True)
    )
    values = np.concatenate([curve.y for curve in kept])
    along = Axis.over(label, np.maximum(values, 1e-3 * least) if log else np.append(values, 0.0), log=log)
    return Chart(title, t[which], kept, Axis.over("t [s]", t, tight=True), along, note)
