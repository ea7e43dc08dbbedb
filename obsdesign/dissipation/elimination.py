"""The inequality (13) of a family as the form that a Riccati equation solves, and what comes of it.

That is for L2 given; in continuous time L1 may be given or is to be found. Where nonlinearities have one scale each,
the least gamma is a search over these; of samples there is one at most, and L1 is to be found.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.certificate import Certificate, certify
from obsdesign.dissipation.decimals import square_below
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.inequality import ONE, Incremental
from obsdesign.lmi.formula import Array, Float, Values, in_floats, printed, zeros
from obsdesign.lmi.proof import rounded
from obsdesign.lmi.solve import Answer, Status
from obsdesign.riccati.central import Central, central, storage, storages
from obsdesign.riccati.form import Form, UnclearError
from obsdesign.riccati.least import Least, least, same
from obsdesign.riccati.passive import Passive, reduced
from obsdesign.riccati.peak import least_peak, least_peak_again, least_peak_scaled
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
NEAR = 1e-6  # relative, of mu
AMPLE = 1e6  # times the scale with which f weighs what z does, where there is no v
SAME = 2e-5  # relative, of mu
SEARCHED = 8  # order from which the scales of multipliers are found faster so than by inequalities


def form_of(family: Incremental) -> Form | None:
    """Form of a family in doubles; None where it is none that a Riccati equation solves."""
    form = inequality_of(family)
    return form if form and form.separate(family.plant.Bf.shape[1]) else None


def monotone_form(family: Incremental) -> Passive | None:
    """What is left of a family where some f are known to be monotone only; None where it is no such family.

    Raises `UnclearError`: doubles do not tell.
    """
    other = family.about.peak or family.about.pace.sampled
    form = None if other else inequality_of(family)
    return None if form is None else reduced(form.balanced()[0], family.plant.Bf.shape[1])


def inequality_of(family: Incremental) -> Form | None:
    """Inequality (13) of a family in doubles; None where it has further unknowns or L2 is free.

    Q is read off the inequality of the family itself, at P = 0 and Y = 0.
    """
    p = family.plant
    rho, sampled = per_step(family), family.about.pace.sampled
    if not rho or family.L2 is None or (sampled and (family.L1 is not None or not p.B.shape[1])):
        return None
    scales = [unknown.name for unknown in family.multiplier.unknowns() if unknown.shape == (1, 1)]
    if scales != [unknown.name for unknown in family.auxiliary]:  # further unknowns are in no such form
        return None
    rows = family.residual.shape[1]
    nothing = {"P": zeros((p.n, p.n), [p.A]), "Y": zeros(p.C.mT.shape, [p.C]), **dict.fromkeys(scales, 0 * ONE)}

    def supply(family: Incremental, mu: float, **given: Float) -> Float:
        values = {**nothing, **given, **family.weights(mu * ONE)}
        Q = np.asarray(family.theorem(values)[0].matrix, dtype=float)
        return Q[:rows, :rows]  # without V+ of samples

    Qc = supply(family, 0.0)
    unweighted = replace(family, H=0 * family.H)  # a multiplier in other units is lost beside H'H
    rest = supply(unweighted, 0.0)
    Qs = np.array([supply(unweighted, 0.0, **{name: ONE}) - rest for name in scales]).reshape(-1, *Qc.shape)
    B, D = np.hstack([p.Bf, -p.B]), np.hstack([p.Df, -p.D])
    A = p.A / rho if sampled else p.A + family.loss / 2 * np.eye(p.n)
    form = Form(A, B / rho, p.C, D, Qc, supply(family, 1.0) - Qc, Qs)
    return form if family.L1 is None else form.injected(family.L1)


def per_step(family: Incremental) -> float:
    """Rho of samples, by which their form is divided, and rho^2 P is its P; else 1."""
    return 1 - float(family.rate) if family.about.pace.sampled else 1.0


def solvable(engine: Engine, family: Incremental, smallest: int = SEARCHED) -> Form | None:
    """Inequality of a family in doubles whose least gamma Riccati equations may find, and quicker than inequalities do.

    `smallest`: order from which scales are searched.
    """
    disturbed, sampled = bool(family.plant.B.shape[1]), family.about.pace.sampled
    form = inequality_of(family) if disturbed and engine.eliminates else None
    if form is None or form.n < 2:  # of one state there are no other coordinates in which to look
        return None
    if not len(form.Qs):
        return form
    least_order = SEARCHED if sampled else smallest
    return None if (sampled and len(form.Qs) > 1) or form.n < least_order else form


def least_gamma(
    engine: Engine, family: Incremental, bounds: Bounds = NO_BOUNDS, *, smallest: int = SEARCHED
) -> Answer | None:
    """Least gamma^2 over all gains by Riccati equations, with its relative gap; None where they do not tell.

    `family`: in doubles; `bounds`: none but on gamma, or else nothing is told either; `smallest`: order from which
    scales are searched.
    """
    whole = None if bounds.restricted else solvable(engine, family, smallest)
    if whole is None:
        return None
    key = tuple(part.tobytes() for part in (*vars(whole).values(), family.H))
    if key in engine.recalled:
        return engine.recalled[key]
    try:
        form, passive = (whole if whole.separate(family.plant.Bf.shape[1]) else None), None
        if form is None and (passive := monotone_form(family)):
            form = passive.form
    except (UnclearError, np.linalg.LinAlgError):
        return None
    if form is None:
        return None
    made = told(lambda: least_of(form, family), lambda known, values: elsewhere(form, family, known, values))
    if made and passive and not passive.negative(array(made.values), made.objective * (1 + SAME)):
        return None
    if made and passive:
        made = replace(made, values=named(family, passive.ties @ array(made.values)))
    if made is not None:
        engine.eliminated, engine.recalled[key] = True, made
    return made


def array(values: Values) -> Float:
    """Scales one beside the other, (k,)."""
    return np.array([float(scale.item()) for scale in values.values()])


def told(
    find: Callable[[], tuple[Least, dict[str, Array]]], again: Callable[[Least, Values], Iterable[float]]
) -> Answer | None:
    """Least mu with its gap where it is the same in other coordinates; None where doubles do not tell."""
    try:
        found, values = find()
        if not all(abs(mu - found.mu) <= SAME * found.mu for mu in again(found, values)):
            return None
    except (UnclearError, np.linalg.LinAlgError, ValueError, OverflowError):  # of numbers beyond doubles as well
        return None
    return Answer(Status.OPTIMAL, found.mu, values, gap=found.gap)


def least_supply(engine: Engine, form: Form) -> Answer | None:
    """Least mu of a form without scales, with its gap and a P; None where Riccati equations do not tell.

    P is that of the balanced form whose outputs have noise, just above the least mu: singular where P -> 0 limits mu.
    """

    def found() -> tuple[Least, dict[str, Array]]:
        known = least(form)
        P = None if not known.mu else storage(form, known.mu * (1 + NEAR))
        return known, {} if P is None else {"P": P}

    made = (
        told(
            found,
            lambda known, _: (known.mu if same(other, known, SAME) else least(other).mu for other in others(form)),
        )
        if engine.eliminates
        else None
    )
    engine.eliminated = engine.eliminated or made is not None
    return made


def least_of(form: Form, family: Incremental) -> tuple[Least, dict[str, Array]]:
    """Least mu of the form of a family, with scales that have it. Raises `UnclearError`."""
    if not len(form.Qs):
        return unscaled(form, family), {}
    if family.about.pace.sampled:
        found, scales = least_over_scale_of(form, family)
    else:
        found, scales = least_peak_scaled(form, family.H) if family.about.peak else least_scaled(form)
    return found, named(family, scales)


def named(family: Incremental, scales: Float) -> dict[str, Array]:
    """Scales by their names; where some are tied to each other, there are fewer of them."""
    names = (unknown.name for unknown in family.multiplier.unknowns())
    return {name: scale * ONE for name, scale in zip(names, scales, strict=False)}


def of_one(family: Incremental, mu: float, values: Values) -> Values:
    """Scales for mu1 = 1 of those of a least mu; of samples they are that already."""
    if family.about.pace.sampled:
        return values
    mu1 = family.weights(mu * ONE)["mu1"]
    return {name: scale / mu1 for name, scale in values.items()}


def elsewhere(form: Form, family: Incremental, known: Least, values: Values) -> Iterator[float]:
    """The same least mu in other coordinates: of an ill-conditioned form it comes out another."""
    if values:
        form = form.scaled(array(of_one(family, known.mu, values)))
    balanced, s = form.balanced()
    sampled, peak = family.about.pace.sampled, family.about.peak
    for R in turns(form.n):
        other = balanced.turned(R)
        H = family.H * s @ R.T if peak else None
        if H is not None and not sampled:
            yield least_peak_again(other, H, known, SAME)
        elif not sampled and same(other, known, SAME):
            yield known.mu
        else:
            yield unscaled(other, family, H, known.mu).mu


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


def turns(n: int) -> Iterator[Float]:
    """Orthogonal coordinates in which a limit must be the same."""
    return (np.linalg.qr(np.random.default_rng(seed).normal(size=(n, n))).Q for seed in range(TURNS))


def others(form: Form) -> Iterator[Form]:
    """Form in other coordinates."""
    balanced, _ = form.balanced()
    return (balanced.turned(R) for R in turns(form.n))


def central_gains(family: Incremental, gamma: float, scales: Float) -> Iterator[Central]:
    """Central gains that reach gamma for given scales, for a family whose form has one, and P for mu1 = 1.

    Without v any gamma will do.
    """
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
    known = None if form is None else least_gamma(engine, family)
    if form is None or known is None:
        return None
    found = gain_near(form.scaled(array(known.values)), 1.0 if family.about.peak else gamma**2)
    return None if found is None else per_step(family) * found


def scales_of(engine: Engine, family: Incremental) -> dict[str, Array] | None:
    """Scales of the least gamma, for mu1 = 1 and in rationals; None where Riccati equations do not tell."""
    names = [unknown.name for unknown in family.multiplier.unknowns()]
    if not names:
        return {}
    fixed = in_floats(family)
    if len(names) == 1 and not fixed.plant.B.shape[1]:  # P and the scale may be so large that z does not matter
        form = form_of(fixed)
        return None if form is None else rounded({names[0]: ONE * (AMPLE * form.weight or 1.0)}, OF_SCALES)
    known = least_gamma(engine, fixed)
    return None if known is None else rounded(of_one(fixed, known.objective, known.values), OF_SCALES)


def proved_given(engine: Engine, family: Incremental, gamma: float, bounds: Bounds) -> Certificate | None:
    """Certificate that the gain of a large plant reaches gamma; None where no equation gives one.

    `family`: in rationals, with L1; `bounds`: of the spec on P and on the poles.
    """
    scales = scales_of(engine, family) if engine.eliminates and not bounds.restricted else None
    fixed = in_floats(family)
    form = None if scales is None else form_of(fixed)
    if scales is None or form is None:
        return None
    of_form = array(scales)
    form = form.scaled(of_form)
    level, peak = printed(gamma), fixed.about.peak
    mu = square_below(level)
    size = 1.0 if peak else gamma**2 if fixed.plant.B.shape[1] else of_form.max(initial=1.0)

    def reaches(X: Float) -> bool:
        return not peak or float(np.linalg.eigvalsh(fixed.H @ X @ fixed.H.T)[-1]) <= gamma**2

    for P in storages(form, size, reaches):
        for digits in OF_P:
            certificate = certify(family, level, fmpq(1), mu, {**rounded({"P": P}, digits), **scales}, bounds)
            if certificate.holds:
                return certificate
    return None
