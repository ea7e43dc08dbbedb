"""What every guarantee says of a run, and the bounds that come of it."""

import math
from dataclasses import fields
from typing import Any, ClassVar, Literal, NamedTuple, NotRequired, Protocol, TypedDict

import numpy as np
from flint import arb, fmpq, fmpq_mat

from obsdesign.lmi.formula import Array, printed
from obsdesign.lmi.spectrum import LARGE, extremes, near_largest_ratio, upper
from obsdesign.records import dataclass, replace
from obsdesign.tables.text import at_least, at_most

ROUNDING = 1e-6  # relative, of a quantity that meets its bound with equality
RESOLVED = 1e-9  # of the largest error: what the integration tells from zero
ESTIMATES = "what is proved of this observer"  # begins what is said of a run of one that no bound is proved of
STEPS = "the observer runs in steps"  # .. of one that runs as it is implemented
LAST = 0.8  # of the run: the limit of an error for t -> infinity is looked for after that
HELD = 0.95  # of the run: an error that is above its level later than that has not been seen to settle


class Bound(TypedDict):
    """A quantity of a run beside what is proved of it."""

    name: str
    value: float
    bound: float
    holds: bool
    accuracy: float  # by how much the value may exceed the bound and keep it: what the integration resolves
    time: NotRequired[float]  # s, of a bound for all t: where it is tightest
    until: NotRequired[float]  # s, up to when it was checked, where that is not the whole run


class Rates(NamedTuple):
    """Numbers of b' = -2 alpha b + c |v|^2, with which V(t) <= exp(-2 alpha t) V(0) + b(t)."""

    alpha: float  # 1/s
    c: float

    @property
    def told(self) -> str:
        """How fast that is, in words; empty where nothing decays."""
        return f"{at_least(self.alpha)} 1/s" if self.alpha else ""

    def left(self, t: Array) -> Array:
        """Part of V(0) that is left at some times at most."""
        return np.asarray(np.exp(-2 * self.alpha * t))

    @property
    def dampened(self) -> fmpq:
        """Part of V that is lost in a unit of time, in rationals: V stays below c over this, for |v| <= 1."""
        return 2 * fmpq(printed(self.alpha))


class Steps(NamedTuple):
    """Numbers of b+ = rho^2 b + c |v|^2, with which V_k <= rho^(2 k) V_0 + b_k."""

    rho: float
    c: float
    period: float  # s

    @property
    def alpha(self) -> float:
        """Rate of decay in 1/s: rho = exp(-alpha period)."""
        return math.inf if self.rho == 0 else abs(math.log(self.rho)) / self.period

    @property
    def told(self) -> str:
        """How fast that is, in words; empty where nothing decays."""
        return f"{at_most(self.rho)} a sample" if self.rho < 1 else ""

    def left(self, t: Array) -> Array:
        """Part of V_0 that is left at most at times of samples."""
        return np.asarray(self.rho ** (2 * np.round(t / self.period)))

    @property
    def dampened(self) -> fmpq:
        """1 - rho^2."""
        rho = fmpq(printed(self.rho))
        return 1 - rho * rho


@dataclass(frozen=True)
class Measurements:
    """What the jumps at measurements do to a run, up to each instant."""

    mismatch: Array  # (M, ny): theta~ = C (x - xhat) - theta; (M, 0) of an observer without theta
    timer: Array  # (M,), s: what is left to the next measurement
    elapsed: Array  # (M,), s: since the last measurement; since max(0, T1 - t_1) before the start until the first one
    eta_sup: Array  # (M,): largest noise |eta|
    added: Array  # (M,): sum of what the noise has added to V
    crowded: float  # s, of the first measurement that follows another sooner than the guarantee expects


@dataclass(frozen=True)
class Course:
    """The error along a run, with what its bounds are made of up to each instant."""

    t: Array  # (M,), s
    e: Array  # (M, n + nm)
    z: Array  # (M,): |z|
    z2: Array  # (M,): integral of |z|^2
    v2: Array  # (M,): integral of |v|^2
    v_sup: Array  # (M,): largest |v|
    b: Array  # (M,), as in `Rates`
    drive: str = "v"  # letter of v
    measurements: Measurements | None = None
    v: Array | None = None  # (M,): |v| of samples, each of which counts
    inner: Array | None = None  # (M, n): errors of states that follow T x, where the estimates know y at once

    def before(self, time: float) -> "Course":
        """Return the part before a time."""
        early = self.t < time
        part = replace(self, **arrays(self, early))
        if self.measurements is None:
            return part
        return replace(part, measurements=replace(self.measurements, **arrays(self.measurements, early)))

    def late(self) -> Array:
        """Which instants belong to the last fifth of the run, (M,)."""
        return np.asarray(self.t >= LAST * self.t[-1])


def arrays(record: Course | Measurements, which: Array) -> dict[str, Any]:
    """Some rows of every array of a record, by the names of its fields."""
    columns = {field.name: getattr(record, field.name) for field in fields(record)}
    return {name: column[which] for name, column in columns.items() if isinstance(column, np.ndarray)}


class InputBound(Protocol):
    """A bound on the error what - w of an unknown input that is reconstructed."""

    def check(
        self, course: Course, limsup: float, rates: tuple[Array, Array], w_rate: float
    ) -> tuple[dict[str, Any], Bound]:
        """Hold the bound against limsup |what - w| of a run, given (x', e') along it, (M, n) each, and sup |w'|.

        Returns what the bound is made of, for the summary, and the bound.
        """


class Guarantee(Protocol):
    """What is proved of the gains of an observer, for every run that it covers; V is its storage function."""

    norm: ClassVar[Literal["norm2", "sup"]]  # of z and v, which gamma relates
    signals: ClassVar[str]  # v that it covers
    symbol: ClassVar[str]  # of alpha
    resting: ClassVar[str]  # what goes to zero without a disturbance where no rate is proved, e or z

    @property
    def gamma(self) -> float:
        """Gain from v to z."""

    @property
    def reconstruction(self) -> InputBound | None:
        """What is proved of an unknown input that is reconstructed, if anything."""

    def rates(self) -> Rates | Steps:
        """Rate at which V decays, and what |v|^2 adds to it."""

    def peak(self, H: Array) -> float | None:
        """Bound on sup|H e| for sup|v| = 1 from zero error; None where V need not decay."""

    def reach(self, H: Array) -> Array:
        """Bounds on |h e| / sqrt(V) for the rows h of H, (m, n) in rationals: h e is within them for all times."""

    def storage(self, course: Course) -> Array:
        """V along a run, (M,)."""

    def bounds(self, course: Course) -> list[Bound]:
        """Check what the guarantee implies; a bound for all t is reported at the instant where it is tightest.

        `course`: up to where the guarantee holds; at least two instants.
        """


class SampledGuarantee(Guarantee, Protocol):
    """A guarantee of an observer that receives measurements T1 to T2 apart."""

    @property
    def T1(self) -> float:
        """Shortest interval between measurements, s."""

    @property
    def T2(self) -> float:
        """Longest interval between measurements, s."""

    @property
    def decay(self) -> float:
        """Rate at which the error is claimed to decay, 1/s."""

    @property
    def ahead(self) -> int | None:
        """How many intervals that are still to come V depends on; None where they may be shorter than T1 as well."""

    def added(self, eta: Array, timer: Array) -> Array:
        """What the noise (K, ny) of measurements adds to V, (K,), for the times to the measurements after them."""

    def entering(self, C: Array) -> list[Array]:
        """Matrices M, in rationals: V before the first measurement is at most the largest e' M e, where theta = 0."""

    def lasting(self, t: Array, size: float, w_sup: float, eta_sup: float) -> Array:
        """Bounds on |(e, d)| at times after a start at which it is within a size; infinite where none is known."""

    @property
    def kick(self) -> float:
        """What |eta| = 1 adds to V at a measurement at most; infinite where nothing is known of it."""

    def distance_bound(self, V_bound: Array) -> Array:
        """What a bound on V says of |(e, d)|, the length of (e, theta~)."""


def largest_output(rates: Rates | Steps, P: Array, H: Array) -> float | None:
    """Bound on |H e| that follows from e' P e <= V <= c / (2 alpha), P and H in rationals; None where there is none."""
    if not rates.dampened or not np.isfinite(rates.c):
        return None
    ratio = near_largest_ratio(P, H) if len(P) >= LARGE else None
    size = extremes(outputs(P, H))[1] if ratio is None else arb(ratio)
    return upper((arb(printed(rates.c) / rates.dampened) * size).sqrt())


def outputs(P: Array, H: Array) -> Array:
    """H P^-1 H', in rationals: |H e|^2 is at most its largest eigenvalue times e' P e."""
    HT = fmpq_mat(H.mT.tolist())
    return np.array((HT.transpose() * fmpq_mat(P.tolist()).solve(HT)).tolist(), dtype=object)


def largest_outputs(P: Array, H: Array) -> Array:
    """Bounds on |h e| for e' P e = 1, for each row h of H, (m,); P and H in rationals."""
    return np.array([upper(arb(size).sqrt()) for size in outputs(P, H).diagonal()])


def envelope(guarantee: Guarantee, course: Course, V: Array) -> Array:
    """Bound on V: exp(-2 alpha t) V(0) + b(t), (M,)."""
    return np.asarray(guarantee.rates().left(course.t) * V[0] + course.b)


def bound(name: str, value: float, limit: float, resolved: float = 0.0) -> Bound:
    """One bound; a value that exceeds it by no more than the integration resolves keeps it."""
    accuracy = limit * ROUNDING + resolved
    return {
        "name": name,
        "value": float(value),
        "bound": float(limit),
        "holds": bool(value <= limit + accuracy),
        "accuracy": float(accuracy),
    }


def tightest(name: str, t: Array, value: Array, limit: Array, peak: float | None = None) -> Bound:
    """Return a bound for all t > 0, at the instant where the value is the largest part of it.

    `peak`: largest value of the run, if it is not among these.
    """
    after = t > 0 if t[-1] > 0 else t >= 0
    t, value, limit = t[after], value[after], limit[after]
    resolved = RESOLVED * (float(value.max()) if peak is None else peak)
    i = int(np.argmax(value / np.maximum(limit + resolved, np.finfo(float).tiny)))
    return {**bound(name, value[i], limit[i], resolved), "time": float(t[i])}
