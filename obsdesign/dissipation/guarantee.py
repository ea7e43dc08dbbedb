"""Guarantees whose storage function is V = e' P e, and what a dissipation inequality implies of a run."""

from abc import ABC, abstractmethod
from functools import cached_property
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from obsdesign.families.guarantee import (
    Bound,
    Course,
    InputBound,
    Rates,
    Steps,
    bound,
    envelope,
    largest_output,
    largest_outputs,
    tightest,
)
from obsdesign.lmi.formula import Array, Float, approximate, rational
from obsdesign.lmi.spectrum import extremes, lower, upper
from obsdesign.records import dataclass


class Words(NamedTuple):
    """What is left of |e(0)|, of V(0), and what a drive {v} has added, in words."""

    once: str
    twice: str
    added: str


@dataclass(frozen=True)
class Quadratic(ABC):
    """Numbers of an inequality along the error equations, with V = e' P e."""

    norm: ClassVar[Literal["norm2", "sup"]] = "norm2"
    signals: ClassVar[str] = "square integrable"
    symbol: ClassVar[str] = "α"
    resting: ClassVar[str] = "e"
    symbol_in_words: ClassVar[str] = "alpha"

    gamma: float
    rate: float  # alpha in 1/s, or rho of samples
    mu1: float
    mu2: float
    P: Array  # (n, n), positive definite, in rationals
    reconstruction: InputBound | None = None

    @abstractmethod
    def rates(self) -> Rates | Steps:
        """V' <= -2 alpha V + c |v|^2, or V+ <= rho^2 V + c |v|^2."""

    @property
    def words(self) -> Words:
        """How what is left of the start is written; empty where nothing says that it decays."""
        a = self.symbol_in_words
        if not self.rate:
            return Words("", "", "integral |{v}(s)|^2 ds")
        return Words(f"exp(-{a} t) ", f"exp(-2 {a} t) ", f"integral exp(-2 {a} (t-s)) |{{v}}(s)|^2 ds")

    @abstractmethod
    def bounds(self, course: Course) -> list[Bound]:
        """Check what the inequality implies of a run."""

    def peak(self, H: Array) -> float | None:
        """Bound on sup|H e|, H in rationals, for sup|v| = 1 from zero error; None where V need not decay."""
        return largest_output(self.rates(), rational(self.P), H)

    def reach(self, H: Array) -> Array:
        """Bounds on |h e| / sqrt(V) for the rows h of H, in rationals, (m,)."""
        return largest_outputs(rational(self.P), H)

    def entering(self, e0: Float) -> Float:
        """Bounds on what V is of, at first, from those on the errors of the estimates |e_i| <= e0_i, (n,)."""
        return e0

    @cached_property
    def spectrum(self) -> tuple[float, float]:
        """Numbers between which the eigenvalues of P lie, proved."""
        low, high = extremes(rational(self.P))
        return lower(low), upper(high)

    @cached_property
    def doubles(self) -> Float:
        """P in doubles."""
        return np.asarray(np.vectorize(approximate, otypes=[float])(self.P))

    def storage(self, course: Course) -> Array:
        """V(e(t)) = e' P e, (M,)."""
        return np.asarray(np.einsum("ti,ij,tj->t", course.e, self.doubles, course.e))


@dataclass(frozen=True)
class EnergyGuarantee(Quadratic):
    """V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 <= 0, and gamma^2 = mu2 / mu1.

    Where alpha is zero, the inequality is strict.
    """

    weight: ClassVar[str] = "/mu1"  # in words; empty where mu1 = 1

    def rates(self) -> Rates | Steps:
        """V' <= -2 alpha V + mu2 |v|^2."""
        return Rates(self.rate, self.mu2)

    def bounds(self, course: Course) -> list[Bound]:
        """Check the bounds that the inequality implies.

        norm2(z)     <= sqrt(lmax(P) / mu1) |e(0)| + gamma norm2(v)
        norm2(z)     <= sqrt(e(0)' P e(0) / mu1) + gamma norm2(v)
        |e(t)|       <= exp(-alpha t) sqrt(lmax(P) / lmin(P)) |e(0)| + sqrt(mu2 / lmin(P)) norm2(v)   for all t
        V(e(t))      <= exp(-2 alpha t) V(e(0)) + b(t)                                                for all t

        The first and the third are (16) and (17) of Corless and Chakrabarty (2019), (17) with its two ratios the
        right way up.
        """
        size = np.linalg.norm(course.e, axis=1)
        low, high = self.spectrum
        z, v = np.sqrt(course.z2[-1]), np.sqrt(course.v2)
        gain = self.gamma * v[-1]
        V = self.storage(course)
        decay = np.sqrt(self.rates().left(course.t) * high / low) * size[0]
        ultimate = np.sqrt(self.mu2 / low) * v
        weight, drive, words = self.weight, course.drive, self.words
        return [
            bound(
                f"norm2(z) <= sqrt(lmax(P){weight}) |e(0)| + gamma norm2({drive})",
                z,
                np.sqrt(high / self.mu1) * size[0] + gain,
            ),
            bound(f"norm2(z) <= sqrt(e(0)' P e(0){weight}) + gamma norm2({drive})", z, np.sqrt(V[0] / self.mu1) + gain),
            tightest(
                f"|e(t)| <= {words.once}sqrt(lmax(P)/lmin(P)) |e(0)| + sqrt(mu2/lmin(P)) norm2({drive})",
                course.t,
                size,
                decay + ultimate,
            ),
            tightest(
                f"sqrt(V(e(t))) <= sqrt({words.twice}V(e(0)) + mu2 {words.added.format(v=drive)})",
                course.t,
                np.sqrt(V),
                np.sqrt(envelope(self, course, V)),
            ),
        ]


@dataclass(frozen=True)
class Sampled(Quadratic):
    """What is other where time is counted in samples: V+ <= rho^2 V + c |v|^2."""

    symbol: ClassVar[str] = "ρ"
    resting: ClassVar[str] = "z"
    period: float = 1.0  # s

    @property
    def words(self) -> Words:
        """In powers of rho."""
        if self.rate == 1:
            return Words("", "", "sum |{v}_j|^2")
        return Words("rho^k ", "rho^(2 k) ", "sum rho^(2 (k-1-j)) |{v}_j|^2")

    def step(self, course: Course, text: str, mu1: float = 0.0) -> Bound:
        """Check the inequality itself, V+ + mu1 |z|^2 <= rho^2 V + c |v|^2, at each sample; `text` says it."""
        assert course.v is not None
        V, rates = self.storage(course), self.rates()
        supplied = self.rate**2 * V[:-1] + rates.c * course.v[:-1] ** 2
        return tightest(text, course.t[1:], V[1:] + mu1 * course.z[:-1] ** 2, supplied)


@dataclass(frozen=True)
class EnergyOfSteps(Sampled, EnergyGuarantee):
    """V+ - rho^2 V + mu1 |z|^2 - mu2 |v|^2 <= 0, and gamma^2 = mu2 / mu1."""

    def rates(self) -> Steps:
        """V+ <= rho^2 V + mu2 |v|^2."""
        return Steps(self.rate, self.mu2, self.period)

    def bounds(self, course: Course) -> list[Bound]:
        """Check what the inequality implies, as in continuous time, and the inequality itself."""
        said = "at each sample: V+ + mu1 |z|^2 <= {}V + mu2 |v|^2".format("" if self.rate == 1 else "rho^2 ")
        return [*super().bounds(course), self.step(course, said, self.mu1)]
