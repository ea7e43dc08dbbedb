"""The inequality (13) of a family as the form that a Riccati equation solves, and what comes of it.

That is for continuous time, L2 given and L1 to be found. Where nonlinearities have one scale each, the least gamma is a
search over these.
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
from obsdesign.lmi.formula import Array, Float, Values, in_floats, printed, zeros
from obsdesign.lmi.proof import rounded
from obsdesign.lmi.solve import Answer, Status
from obsdesign.riccati.central import Central, central
from obsdesign.riccati.form import Form, UnclearError
from obsdesign.riccati.least import Least, least, least_peak
from obsdesign.riccati.peak import least_peak_scaled
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
    if family.about.pace.sampled or family.L1 is not None or family.L2 is None or not p.B.shape[1]:
        return None
    scales = [unknown.name for unknown in family.multiplier.unknowns() if unknown.shape == (1, 1)]
    if len(scales) < len(family.auxiliary):  # further unknowns are in no such form
        return None
    nothing = {"P": zeros((p.n, p.n), [p.A]), "Y": zeros(p.C.mT.shape, [p.C]), **dict.fromkeys(scales, 0 * ONE)}

    def supply(mu: float, **given: Float) -> Float:
        values = {**nothing, **given, **family.weights(mu * ONE)}
        return np.asarray(family.theorem(values)[0].matrix, dtype=float)

    Qc = supply(0.0)
    Qs = np.array([supply(0.0, **{name: ONE}) - Qc for name in scales]).reshape(-1, *Qc.shape)
    B, D = np.hstack([p.Bf, -p.B]), np.hstack([p.Df, -p.D])
    form = Form(p.A + family.loss / 2 * np.eye(p.n), B, p.C, D, Qc, supply(1.0) - Qc, Qs)
    return form if separate(form, p.Bf.shape[1]) else None


def separate(form: Form, nf: int) -> bool:
    """Whether the multipliers leave v alone and their part in f is negative: then (f, v) is for all scales and mu."""
    ends = form.n, form.n + nf
    parts = form.Qs[:, slice(*ends), slice(*ends)]
    if form.Qs[:, ends[1] :].any() or (nf and not len(parts)):
        return False
    negative = all(np.linalg.eigvalsh(part)[-1] <= 0 for part in parts) if nf else True
    return negative and (not nf or bool(np.linalg.eigvalsh(parts.sum(axis=0))[-1] < 0))


def least_gamma(engine: Engine, family: Incremental, bounds: Bounds = NO_BOUNDS) -> Answer | None:
    """Least gamma^2 over all gains by Riccati equations, with its relative gap; None where they do not tell.

    `family`: in doubles; `bounds`: none but on gamma, or else nothing is told either.
    """
    form = form_of(family) if engine.eliminates and not bounds.restricted else None
    if form is None or (len(form.Qs) and form.n < SEARCHED):
        return None
    key = tuple(part.tobytes() for part in (form.A, form.B, form.C, form.D, form.Qc, form.Qm, form.Qs, family.H))
    if (known := engine.recalled.get(key)) is not None:
        return known
    try:
        found, values = least_of(form, family)
        if not all(abs(mu - found.mu) <= SAME * found.mu for mu in elsewhere(form, family, found.mu, values)):
            return None  # doubles do not tell
    except (UnclearError, np.linalg.LinAlgError, ValueError, OverflowError):  # of numbers beyond doubles as well
        return None
    engine.eliminated = True
    engine.recalled[key] = Answer(Status.OPTIMAL, found.mu, values, gap=found.gap)
    return engine.recalled[key]


def least_of(form: Form, family: Incremental) -> tuple[Least, dict[str, Array]]:
    """Least mu of the form of a family, with scales that have it. Raises `UnclearError`."""
    peak = family.about.peak
    if not len(form.Qs):
        return least_peak(form, family.H) if peak else least(form), {}
    found, scales = least_peak_scaled(form, family.H) if peak else least_scaled(form)
    names = (unknown.name for unknown in family.multiplier.unknowns())
    return found, {name: scale * ONE for name, scale in zip(names, scales, strict=True)}


def of_one(family: Incremental, mu: float, values: Values) -> Values:
    """Scales for mu1 = 1 of those that the solver has for a mu."""
    mu1 = family.weights(mu * ONE)["mu1"]
    return {name: scale / mu1 for name, scale in values.items()}


def elsewhere(form: Form, family: Incremental, mu: float, values: Values) -> Iterator[float]:
    """The same least mu in other coordinates: of an ill-conditioned form it comes out another."""
    if values:
        form = form.scaled(np.array([scale.item() for scale in of_one(family, mu, values).values()]))
    form, s = form.balanced()
    for seed in range(TURNS):
        R = np.linalg.qr(np.random.default_rng(seed).normal(size=(form.n, form.n))).Q
        turned = form.turned(R)
        yield (least_peak(turned, family.H * s @ R.T) if family.about.peak else least(turned)).mu


def central_gains(family: Incremental, gamma: float, scales: Float) -> Iterator[Central]:
    """Central gains that reach gamma for given scales, for a family whose form has one, and P for mu1 = 1."""
    fixed = in_floats(family)
    form = form_of(fixed)
    if form is None:
        return
    form = form.scaled(scales)
    level = (gamma * (1 - ROOM)) ** 2

    def reaches(X: Float) -> bool:
        return not fixed.about.peak or float(np.linalg.eigvalsh(fixed.H @ X @ fixed.H.T)[-1]) <= level

    yield from central(form, float(fixed.rate), 1.0 if fixed.about.peak else level, reaches)


def proved_central(engine: Engine, family: Incremental, gamma: float, bounds: Bounds) -> Certificate | None:
    """Certificate of the first central gain that is proved to reach gamma; None if none is.

    `family`: in rationals, its scales those of the least gamma; `bounds`: of the spec on P and on the poles.
    """
    scales = {}
    if family.multiplier.unknowns():
        known = least_gamma(engine, in_floats(family))
        if known is None:
            return None
        scales = rounded(of_one(family, known.objective, known.values), OF_SCALES)
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
