"""Where the modes of an error lie that decays as it must: left of -alpha, or within the circle of radius rho."""

from itertools import zip_longest
from math import inf
from typing import Any

from flint import arb, fmpq, fmpq_mat, fmpq_poly

from obsdesign.lmi.formula import Array, identity
from obsdesign.records import dataclass

NEARLY = 1 - fmpq(1, 10**9)  # part of a rate that a mode must not reach: at the rate itself an inequality may hold


@dataclass(frozen=True)
class Edge:
    """The rate at which an error has to decay, alpha in 1/s, or 1 - rho of one that is multiplied by rho a sample."""

    rate: Any
    sampled: bool = False
    weak: bool = False  # whether an inequality may hold with a mode at the very edge, where z does not show it

    @classmethod
    def none(cls, *, sampled: bool) -> "Edge":
        """A rate that no mode reaches."""
        return cls(1.0 if sampled else inf, sampled)

    @property
    def end(self) -> Any:
        """Largest real number that a mode may be: -alpha, or rho."""
        return 1 - self.rate if self.sampled else -self.rate

    def of(self, mode: complex) -> float:
        """Rate at which a mode lambda decays: -Re lambda of exp(lambda t), 1 - |lambda| of lambda^k."""
        return 1 - abs(mode) if self.sampled else -mode.real

    def slow(self, mode: complex, slack: float = 0.0) -> bool:
        """Whether a mode decays no faster than it must, up to some slack, to which it is known.

        Where that is more than a mode may differ from the edge, as of stiff plants, or the edge is weak: surely slower.
        """
        known = self.sampled or not self.rate or slack <= float(1 - NEARLY) * float(self.rate)
        return self.of(mode) + (-slack if known and not self.weak else slack) <= float(self.rate)

    @property
    def nearly(self) -> fmpq:
        """Rate that a mode which is in the way does not reach, in rationals."""
        return fmpq(NEARLY * self.rate) if self.rate or not self.weak else NEARLY - 1

    def kept(self, S: Array) -> bool:
        """Whether every eigenvalue of a rational matrix decays nearly as it must, proved."""
        if not self.sampled:
            return hurwitz(polynomial(S + self.nearly * identity(len(S), S)))
        return schur(polynomial(S), 1 - self.nearly)

    def broken(self, mode: arb) -> bool:
        """Whether a real mode does surely not."""
        return bool(abs(mode) >= 1 - self.nearly if self.sampled else mode + self.nearly >= 0)


def hurwitz(p: fmpq_poly) -> bool:
    """Whether all roots have negative real parts, by the table of Routh."""
    falling = p.coeffs()[::-1]
    upper, lower = falling[0::2], falling[1::2]
    while lower:
        if upper[0] * lower[0] <= 0:
            return False
        ratio = upper[0] / lower[0]
        rest = [a - ratio * b for a, b in zip_longest(upper[1:], lower[1:], fillvalue=fmpq(0))]
        upper, lower = lower, rest
    return True


def schur(p: fmpq_poly, radius: fmpq) -> bool:
    """Whether all roots have an absolute value below a radius > 0: with lambda = r (1 + s)/(1 - s), Re s < 0.

    (1 - s)^n p(r (1 + s)/(1 - s)) has the degree n unless -r is a root.
    """
    n, up, down = p.degree(), fmpq_poly([1, 1]), fmpq_poly([1, -1])
    powers = (c * radius**k * up**k * down ** (n - k) for k, c in enumerate(p.coeffs()))
    q = sum(powers, fmpq_poly([]))
    return q.degree() == n and hurwitz(q)


def polynomial(S: Array) -> fmpq_poly:
    """Characteristic polynomial."""
    p: fmpq_poly = fmpq_mat(*S.shape, S.ravel().tolist()).charpoly()
    return p
