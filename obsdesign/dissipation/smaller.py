"""Gains of large plants by Riccati equations: the central one, or a smaller one by descent from it, with its proof."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
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
from obsdesign.lmi.formula import Array, in_floats, printed
from obsdesign.lmi.proof import rounded
from obsdesign.riccati.central import Central
from obsdesign.riccati.descent import Peak, descended


@dataclass(frozen=True)
class Proved:
    """Gain of a family that is proved, and sizes in spectral norm."""

    certificate: Certificate
    size: float  # of the gain
    central: float  # of the central one, from which it was found

    def said(self, name: str, why: str) -> str:
        """Note on what gain it is; see `said`."""
        return said(name, why, (self.size, self.central) if self.size < self.central else None)


def said(name: str, why: str, sizes: tuple[float, float] | None = None) -> str:
    """Note on a gain of a Riccati equation.

    `name`: of the gain in a spec; `why`: it is not the smallest; `sizes`: its own and that of the central one, where it
    is another.
    """
    kind = "the gain is the central one of a Riccati equation"
    if sizes:
        own, central = sizes
        told = f"|{name}| from {central:.4g} to {own:.4g}"
        kind = f"the gain was found by descent from the central one of a Riccati equation ({told})"
    return f"{kind}: {why}; bounds.{name} asks for a smaller one"


def proved_small(engine: Engine, family: Incremental, gamma: float, bounds: Bounds) -> Proved | None:
    """Gain that is proved to reach gamma: one smaller than the central, or else the first central one; None if none is.

    `family`: in rationals; `bounds`: of the spec on P and on the poles.
    """
    scales = scales_of(engine, family)
    if scales is None:
        return None
    found = central_gains(family, gamma, array(scales))
    first = next(found, None)
    if first is None:
        return None
    level = printed(gamma)
    mu = square_below(level)
    central = ((one, scales) for one in chain([first], found))
    for gain, its_scales in chain(smaller(family, gamma, first, scales), central):
        for digits, of_P in zip(DIGITS, OF_P, strict=True):
            values = {**rounded({"P": gain.P}, of_P), **its_scales}
            candidate = replace(family, L1=printed(significant(gain.L, digits)))
            certificate = certify(candidate, level, fmpq(1), mu, values, bounds)
            if certificate.holds:
                return Proved(certificate, gain.size, first.size)
    return None


def smaller(
    family: Incremental, gamma: float, first: Central, scales: dict[str, Array]
) -> Iterator[tuple[Central, dict[str, Array]]]:
    """Gain by descent from the central one for some scales, with its scales; none of samples, or if none is found."""
    fixed = in_floats(family)
    form = None if fixed.about.pace.sampled else form_of(fixed)
    if form is None:
        return
    level = (gamma * (1 - ROOM)) ** 2
    peak = Peak(fixed.H, level) if fixed.about.peak else None
    made = descended(form, float(fixed.rate), 1.0 if peak else level, first, array(scales), peak)
    if made:
        values = {name: scale * ONE for name, scale in zip(scales, made[1], strict=True)}
        yield made[0], rounded(values, OF_SCALES)
