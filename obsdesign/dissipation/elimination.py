"""The inequality (13) of a family as the form that a Riccati equation solves, and what comes of it.

That is for continuous time, L2 given, L1 to be found, and no nonlinearity: then (13) is affine in P, Y and mu alone.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.certificate import Certificate, certify
from obsdesign.dissipation.decimals import significant, square_below
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.inequality import ONE, Incremental
from obsdesign.lmi.formula import Float, in_floats, printed, zeros
from obsdesign.lmi.proof import rounded
from obsdesign.lmi.solve import Answer, Status
from obsdesign.riccati.central import Central, central
from obsdesign.riccati.form import Form, UnclearError
from obsdesign.riccati.least import least, least_peak

ROOM = 2e-3  # of gamma, left to the rounding of the gain
DIGITS = (6, 8, 12)  # of a shipped gain
OF_P = (12, 15, 17)  # of its witness


def form_of(family: Incremental) -> Form | None:
    """Form of a family in doubles; None where it is none that a Riccati equation solves.

    Q is read off the inequality of the family itself, at P = 0 and Y = 0.
    """
    p = family.plant
    nonlinear = p.Bf.shape[1] or family.multiplier.unknowns()
    if family.about.pace.sampled or family.L1 is not None or family.L2 is None or nonlinear or not p.B.shape[1]:
        return None
    nothing = {"P": zeros((p.n, p.n), [p.A]), "Y": zeros(p.C.mT.shape, [p.C])}

    def supply(mu: float) -> Float:
        return np.asarray(family.theorem({**nothing, **family.weights(mu * ONE)})[0].matrix, dtype=float)

    Qc = supply(0.0)
    return Form(p.A + family.loss / 2 * np.eye(p.n), -p.B, p.C, -p.D, Qc, supply(1.0) - Qc)


def least_gamma(engine: Engine, family: Incremental, bounds: Bounds = NO_BOUNDS) -> Answer | None:
    """Least gamma^2 over all gains by Riccati equations, with its relative gap; None where they do not tell.

    `family`: in doubles; `bounds`: none but on gamma, or else nothing is told either.
    """
    form = form_of(family) if engine.eliminates and not bounds.restricted else None
    if form is None:
        return None
    try:
        found = least_peak(form, family.H) if family.about.peak else least(form)
    except (UnclearError, np.linalg.LinAlgError):
        return None
    engine.eliminated = True
    return Answer(Status.OPTIMAL, found.mu, gap=found.gap)


def central_gains(family: Incremental, gamma: float) -> Iterator[Central]:
    """Central gains that reach gamma, for a family whose form has one, and P for mu1 = 1."""
    fixed = in_floats(family)
    form = form_of(fixed)
    if form is None:
        return
    level = (gamma * (1 - ROOM)) ** 2

    def reaches(X: Float) -> bool:
        return not fixed.about.peak or float(np.linalg.eigvalsh(fixed.H @ X @ fixed.H.T)[-1]) <= level

    yield from central(form, float(fixed.rate), 1.0 if fixed.about.peak else level, reaches)


def proved_central(family: Incremental, gamma: float, bounds: Bounds) -> Certificate | None:
    """Certificate of the first central gain that is proved to reach gamma; None if none is.

    `family`: in rationals; `bounds`: those of the spec on P and on the poles.
    """
    level = printed(gamma)
    mu = square_below(level)
    for found in central_gains(family, gamma):
        for digits, of_P in zip(DIGITS, OF_P, strict=True):
            values = rounded({"P": found.P}, of_P)
            candidate = replace(family, L1=printed(significant(found.L, digits)))
            certificate = certify(candidate, level, fmpq(1), mu, values, bounds)
            if certificate.holds:
                return certificate
    return None
