"""The inequality (13) of a family as the form that a Riccati equation solves, and what comes of it.

That is for L2 given and L1 to be found. Where nonlinearities have one scale each, the least gamma in continuous time is
a search over these; of the least peak gain it is done without any, and of samples with one at most.
"""

import math
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
from obsdesign.riccati.least import Least, least, least_peak
from obsdesign.riccati.samples import (
    central_of_samples,
    gain_near,
    least_of_samples,
    least_over_scale,
    least_peak_of_samples,
)
from obsdesign.riccati.scaled import least_scaled

ROOM = 2e-3  # of gamma, left to the rounding of the gain
DIGITS = (6, 8, 12)  # of a shipped gain
OF_P, OF_SCALES = (12, 15, 17), 8  # of its witness
LARGE = 12  # order from which the smallest gain takes longer to find than it is worth
TURNS = 3  # coordinates in which a limit must be the same
SAME = 2e-5  # relative, of mu
SEARCHED = 8  # order from which the scales of multipliers are found faster so than by inequalities


def form_of(family: Incremental) -> Form | None:
    """Form of a family in doubles; None where it is none that a Riccati equation solves.

    Q is read off the inequality of the family itself, at P = 0 and Y = 0.
    """
    p = family.plant
    rho = per_step(family)
    if not rho or family.L1 is not None or family.L2 is None or not p.B.shape[1]:
        return None
    scales = [unknown.name for unknown in family.multiplier.unknowns() if unknown.shape == (1, 1)]
    if len(scales) < len(family.auxiliary):  # further unknowns are in no such form
        return None
    rows = family.residual.shape[1]
    nothing = {"P": zeros((p.n, p.n), [p.A]), "Y": zeros(p.C.mT.shape, [p.C]), **dict.fromkeys(scales, 0 * ONE)}

    def supply(mu: float, **given: Float) -> Float:
        values = {**nothing, **given, **family.weights(mu * ONE)}
        Q = np.asarray(family.theorem(values)[0].matrix, dtype=float)
        return Q[:rows, :rows]  # without V+ of samples

    Qc = supply(0.0)
    Qs = np.array([supply(0.0, **{name: ONE}) - Qc for name in scales]).reshape(-1, *Qc.shape)
    B, D = np.hstack([p.Bf, -p.B]), np.hstack([p.Df, -p.D])
    A = p.A / rho if family.about.pace.sampled else p.A + family.loss / 2 * np.eye(p.n)
    form = Form(A, B / rho, p.C, D, Qc, supply(1.0) - Qc, Qs)
    return form if separate(form, p.Bf.shape[1]) else None


def per_step(family: Incremental) -> float:
    """Rho of samples, by which their form is divided, and rho^2 P is its P; else 1."""
    return 1 - float(family.rate) if family.about.pace.sampled else 1.0


def separate(form: Form, nf: int) -> bool:
    """Whether the multipliers leave v alone and their part in f is negative: then (f, v) is for all scales and mu."""
    ends = form.n, form.n + nf
    parts = form.Qs[:, slice(*ends), slice(*ends)]
    if form.Qs[:, ends[1] :].any() or (nf and not len(parts)):
        return False
    negative = all(np.linalg.eigvalsh(part)[-1] <= 0 for part in parts) if nf else True
    return negative and (not nf or bool(np.linalg.eigvalsh(parts.sum(axis=0))[-1] < 0))


def solvable(engine: Engine, family: Incremental) -> Form | None:
    """Form of a family in doubles whose least gamma Riccati equations find, and quicker than inequalities do."""
    form, sampled = form_of(family) if engine.eliminates else None, family.about.pace.sampled
    if form is None or not len(form.Qs):
        return form
    many = len(form.Qs) > 1 if sampled else family.about.peak
    return None if many or form.n < SEARCHED else form


def least_gamma(engine: Engine, family: Incremental, bounds: Bounds = NO_BOUNDS) -> Answer | None:
    """Least gamma^2 over all gains by Riccati equations, with its relative gap; None where they do not tell.

    `family`: in doubles; `bounds`: none but on gamma, or else nothing is told either.
    """
    form = solvable(engine, family) if not bounds.restricted else None
    if form is None:
        return None
    key = tuple(part.tobytes() for part in (form.A, form.B, form.C, form.D, form.Qc, form.Qm, form.Qs, family.H))
    if (known := engine.recalled.get(key)) is not None:
        return known
    scales = None
    try:
        if len(form.Qs):
            found, scales = least_over_scale_of(form, family) if family.about.pace.sampled else least_scaled(form)
        else:
            found = unscaled(form, family)
        if not all(abs(mu - found.mu) <= SAME * found.mu for mu in elsewhere(form, family, scales, found.mu)):
            return None  # doubles do not tell
    except (UnclearError, np.linalg.LinAlgError, ValueError, OverflowError):  # of numbers beyond doubles as well
        return None
    engine.eliminated = True
    names = (unknown.name for unknown in family.multiplier.unknowns())
    values = {} if scales is None else {name: scale * ONE for name, scale in zip(names, scales, strict=True)}
    engine.recalled[key] = Answer(Status.OPTIMAL, found.mu, values, gap=found.gap)
    return engine.recalled[key]


def elsewhere(form: Form, family: Incremental, scales: Float | None, known: float) -> Iterator[float]:
    """The same least mu in other coordinates: of an ill-conditioned form it comes out another."""
    form, s = form.balanced()
    for seed in range(TURNS):
        R = np.linalg.qr(np.random.default_rng(seed).normal(size=(form.n, form.n))).Q
        turned = form.turned(R)
        if scales is not None:
            turned = turned.scaled(scales)
        yield unscaled(turned, family, family.H * s @ R.T, known).mu


def least_over_scale_of(form: Form, family: Incremental) -> tuple[Least, Float]:
    """Least mu of samples over the one scale of a family, and that scale. Raises `UnclearError`."""
    weight = float(np.linalg.norm(per_step(family) * family.H, 2)) ** 2
    return least_over_scale(form, weight, lambda scaled, cap: unscaled(scaled, family, cap=cap))


def unscaled(
    form: Form, family: Incremental, H: Float | None = None, known: float | None = None, cap: float = math.inf
) -> Least:
    """Least mu of the form of a family without scales. Raises `UnclearError`.

    `H`: of z, in the coordinates of the form; None: that of the family; `known`: what it is in others; `cap`: of
    samples, what it has to be below.
    """
    output = per_step(family) * (family.H if H is None else H)
    if family.about.pace.sampled:
        return least_peak_of_samples(form, output) if family.about.peak else least_of_samples(form, known, cap)
    return least_peak(form, output) if family.about.peak else least(form)


def central_gains(family: Incremental, gamma: float, scales: Float) -> Iterator[Central]:
    """Central gains that reach gamma for given scales, for a family whose form has one, and P for mu1 = 1."""
    fixed = in_floats(family)
    form = form_of(fixed)
    if form is None:
        return
    form = form.scaled(scales)
    level, rho = (gamma * (1 - ROOM)) ** 2, per_step(fixed)
    output = rho * fixed.H

    def reaches(X: Float) -> bool:
        return not fixed.about.peak or float(np.linalg.eigvalsh(output @ X @ output.T)[-1]) <= level

    mu = 1.0 if fixed.about.peak else level
    if not fixed.about.pace.sampled:
        yield from central(form, float(fixed.rate), mu, reaches)
        return
    yield from (Central(rho * one.L, one.P / rho**2) for one in central_of_samples(form, mu, reaches))


def gain_above(engine: Engine, family: Incremental, gamma: float) -> Float | None:
    """Gain L1 for a gamma that is little above the least, of samples, in doubles; None where no equation tells.

    `family`: in doubles.
    """
    form = solvable(engine, family) if family.about.pace.sampled else None
    told = None if form is None else least_gamma(engine, family)
    if form is None or told is None:
        return None
    scales = np.array([told.values[unknown.name].item() for unknown in family.multiplier.unknowns()])
    found = gain_near(form.scaled(scales), 1.0 if family.about.peak else gamma**2)
    return None if found is None else per_step(family) * found


def proved_central(engine: Engine, family: Incremental, gamma: float, bounds: Bounds) -> Certificate | None:
    """Certificate of the first central gain that is proved to reach gamma; None if none is.

    `family`: in rationals, its scales those of the least gamma; `bounds`: of the spec on P and on the poles.
    """
    scales = {}
    if family.multiplier.unknowns():
        least = least_gamma(engine, in_floats(family))
        if least is None:
            return None
        scales = rounded(least.values, OF_SCALES)
    level = printed(gamma)
    mu = square_below(level)
    for found in central_gains(family, gamma, np.array([float(scale.item()) for scale in scales.values()])):
        for digits, of_P in zip(DIGITS, OF_P, strict=True):
            values = {**rounded({"P": found.P}, of_P), **scales}
            candidate = replace(family, L1=printed(significant(found.L, digits)))
            certificate = certify(candidate, level, fmpq(1), mu, values, bounds)
            if certificate.holds:
                return certificate
    return None
