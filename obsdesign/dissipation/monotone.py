"""Gains of large plants with f that are known to be monotone only, by Riccati equations, and their proof."""

from dataclasses import replace

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
from obsdesign.lmi.formula import in_floats, printed
from obsdesign.lmi.proof import rounded
from obsdesign.riccati.form import Form, UnclearError
from obsdesign.riccati.passive import gains


def proved_monotone(engine: Engine, family: Incremental, gamma: float, bounds: Bounds) -> Certificate | None:
    """Certificate of the first central gain that is proved to reach gamma; None where none is, or without such f.

    `family`: in rationals; `bounds`: of the spec on P and on the poles.
    """
    form = unseparated(in_floats(family))
    scales = None if form is None else scales_of(engine, family)
    if form is None or scales is None:
        return None
    level = printed(gamma)
    mu, nf = square_below(level), family.plant.Bf.shape[1]
    known, rate = array(tied(family, scales)), float(family.rate)
    for found, of_form in gains(form, nf, known, rate, (gamma * (1 - ROOM)) ** 2):
        exact = tied(family, rounded(named(family, of_form), OF_SCALES))
        for digits, of_P in zip(DIGITS, OF_P, strict=True):
            values = with_equality(family, {**rounded({"P": found.P}, of_P), **exact})
            candidate = replace(family, L1=printed(significant(found.L, digits)))
            certificate = certify(candidate, level, fmpq(1), mu, values, bounds)
            if certificate.holds:
                return certificate
    return None


def unseparated(family: Incremental) -> Form | None:
    """Inequality of a family in doubles, with such f; None where it has none, or none that is solved so."""
    try:
        return inequality_of(family) if monotone_form(family) else None
    except (UnclearError, np.linalg.LinAlgError):
        return None
