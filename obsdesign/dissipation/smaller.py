"""Gains of large plants by Riccati equations: the central one, or a smaller one by descent from it, with its proof."""

from collections.abc import Iterator
from itertools import chain

from flint import fmpq

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.certificate import Certificate, certify
from obsdesign.dissipation.decimals import significant, square_below
from obsdesign.dissipation.elimination import (
    DIGITS,
    OF_P,
    OF_SCALES,
    ROOM,
    array,
    central_gains,
    form_of,
    scales_of,
)
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.inequality import ONE, Incremental
from obsdesign.lmi.formula import Array, Values, in_floats, printed
from obsdesign.lmi.proof import margin, rounded
from obsdesign.records import dataclass, replace
from obsdesign.riccati.central import Central
from obsdesign.riccati.descent import Peak, descended

DOUBT = 1e-9  # margin of an inequality in doubles, with a unit diagonal, below which it is taken for wrong
LESS = 0.99  # of the central gain, at most, for one that is found by descent from it


@dataclass(frozen=True)
class Candidate:
    """Gain of a Riccati equation, with scales that prove it in rationals, and the size of the central one."""

    gain: Central
    scales: dict[str, Array]
    central: float

    def said(self, name: str, why: str) -> str:
        """Note on what gain it is; `name`: of the gain in a spec; `why`: it is not the smallest."""
        kind = "the gain is the central one of a Riccati equation"
        if self.gain.size < self.central:
            sizes = f"|{name}| from {self.central:.4g} to {self.gain.size:.4g}"
            kind = f"the gain was found by descent from the central one of a Riccati equation ({sizes})"
        return f"{kind}: {why}; bounds.{name} asks for a smaller one"


def proved_small(
    engine: Engine, family: Incremental, gamma: float, bounds: Bounds
) -> tuple[Certificate, Candidate] | None:
    """Certificate of the first gain of a Riccati equation that is proved to reach gamma; None if none is.

    `family`: in rationals; `bounds`: of the spec on P and on the poles.
    """
    scales = scales_of(engine, family)
    if scales is None:
        return None
    level = printed(gamma)
    mu = square_below(level)
    for found in candidates(family, gamma, scales):
        for digits, of_P in zip(DIGITS, OF_P, strict=True):
            values = {**rounded({"P": found.gain.P}, of_P), **found.scales}
            candidate = replace(family, L1=printed(significant(found.gain.L, digits)))
            if digits < DIGITS[-1] and doubted(candidate, mu, values):
                continue
            certificate = certify(candidate, level, fmpq(1), mu, values, bounds)
            if certificate.holds:
                return certificate, found
    return None


def doubted(family: Incremental, mu: fmpq, values: Values) -> bool:
    """Whether doubles say that a gain of so few digits does not reach gamma, which an exact proof is slow to find out.

    `family`: with the gain; `mu`: gamma^2 below its square; `values`: P and the multipliers, all in rationals.
    """
    given = {name: in_floats(matrix) for name, matrix in values.items()}
    found = in_floats(family).theorem({**given, "mu1": ONE, "mu2": float(mu) * ONE})
    return any(margin(inequality.matrix) < -DOUBT for inequality in found)


def candidates(
    family: Incremental, gamma: float, scales: dict[str, Array], *, smaller: bool = True
) -> Iterator[Candidate]:
    """Gains that reach gamma: one by descent from the first central one, or else the central ones for some scales.

    `smaller`: whether one by descent will do.
    """
    found = central_gains(family, gamma, array(scales))
    first = next(found, None)
    if first is None:
        return
    if smaller and (made := by_descent(family, gamma, first, scales)):
        yield made
    yield from (Candidate(one, scales, one.size) for one in chain([first], found))


def by_descent(family: Incremental, gamma: float, first: Central, scales: dict[str, Array]) -> Candidate | None:
    """Gain by descent from a central one; None of samples, or where none is found that is clearly smaller."""
    fixed = in_floats(family)
    form = None if fixed.about.pace.sampled else form_of(fixed)
    if form is None:
        return None
    level = (gamma * (1 - ROOM)) ** 2
    peak = Peak(fixed.H, level) if fixed.about.peak else None
    made = descended(form, float(fixed.rate), 1.0 if peak else level, first, array(scales), peak)
    if not made or made[0].size > LESS * first.size:
        return None
    values = {name: scale * ONE for name, scale in zip(scales, made[1], strict=True)}
    return Candidate(made[0], rounded(values, OF_SCALES), first.size)
