"""Gains of large plants with f that are known to be monotone only, by Riccati equations, and their proof."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain

import numpy as np
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
    inequality_of,
    monotone_form,
    named,
    scales_of,
)
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.equality import tied, with_equality
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.smaller import LESS, Candidate
from obsdesign.lmi.formula import Array, Float, in_floats, printed
from obsdesign.lmi.proof import rounded
from obsdesign.riccati.descent import descended
from obsdesign.riccati.form import Form, UnclearError
from obsdesign.riccati.passive import gains, storages
from obsdesign.riccati.silent import SilentBarrier, untied


def proved_monotone(
    engine: Engine, family: Incremental, gamma: float, bounds: Bounds
) -> tuple[Certificate, Candidate] | None:
    """Certificate of the first gain that is proved to reach gamma; None where none is, or without such f.

    `family`: in rationals; `bounds`: of the spec on P and on the poles.
    """
    form = unseparated(in_floats(family))
    scales = None if form is None else scales_of(engine, family)
    if form is None or scales is None:
        return None
    level = printed(gamma)
    mu = square_below(level)
    for found in candidates(form, family, gamma, array(tied(family, scales))):
        for digits, of_P in zip(DIGITS, OF_P, strict=True):
            values = with_equality(family, {**rounded({"P": found.gain.P}, of_P), **found.scales})
            candidate = replace(family, L1=printed(significant(found.gain.L, digits)))
            certificate = certify(candidate, level, fmpq(1), mu, values, bounds)
            if certificate.holds:
                return certificate, found
    return None


def candidates(form: Form, family: Incremental, gamma: float, known: Float) -> Iterator[Candidate]:
    """Gains that reach gamma: one by descent from the first central one, or else the central ones.

    `known`: scales of the least gamma.
    """
    level, nf, rate = (gamma * (1 - ROOM)) ** 2, family.plant.Bf.shape[1], float(family.rate)

    def exact(scales: Float) -> dict[str, Array]:
        return tied(family, rounded(named(family, scales), OF_SCALES))

    found = gains(form, nf, known, rate, level)
    first = next(found, None)
    if first is None:
        return
    central, scales = first
    with suppress(UnclearError):  # of a form in units far apart, which is not balanced here
        free, start, ties = untied(form, nf, scales)
        made = descended(free, rate, level, central, start, of=partial(SilentBarrier, nf=nf))
        if made and made[0].size < LESS * central.size:
            yield Candidate(made[0], exact(ties @ made[1]), central.size)
    yield from (Candidate(one, exact(of_one), one.size) for one, of_one in chain([first], found))


def proved_given_monotone(engine: Engine, family: Incremental, gamma: float, bounds: Bounds) -> Certificate | None:
    """Certificate that a gain that is given reaches gamma; None where no equation gives one, or without such f.

    `family`: in rationals, with L1; `bounds`: of the spec on P and on the poles.
    """
    form = unseparated(in_floats(family)) if engine.eliminates and not bounds.restricted else None
    scales = None if form is None else scales_of(engine, family)
    if form is None or scales is None:
        return None
    exact, level = tied(family, scales), printed(gamma)
    mu = square_below(level)
    for P in storages(form, family.plant.Bf.shape[1], array(exact), gamma**2):
        for digits in OF_P:
            values = with_equality(family, {**rounded({"P": P}, digits), **exact})
            certificate = certify(family, level, fmpq(1), mu, values, bounds)
            if certificate.holds:
                return certificate
    return None


def unseparated(family: Incremental) -> Form | None:
    """Inequality of a family in doubles, with such f; None where it has none, or none that is solved so."""
    try:
        return inequality_of(family) if monotone_form(family) else None
    except (UnclearError, np.linalg.LinAlgError):
        return None
