"""From gains to a proved claim: the solver proposes P and the scales, rationals decide."""

import math

from flint import fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.certificate import Certificate, certify
from obsdesign.dissipation.decimals import round_up, square_below
from obsdesign.dissipation.elimination import LARGE, least_gamma, proved_given
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.monotone import proved_given_monotone
from obsdesign.lmi.formula import Values, in_floats, printed, rational
from obsdesign.lmi.proof import complete, rounded
from obsdesign.lmi.reduce import reduce
from obsdesign.lmi.solve import MARGIN, Status

BACKOFFS = (1e-4, 1e-3, 1e-2, 1e-1)  # of the least gamma that given gains achieve
DIGITS = (12, 17)  # of the witness


def claim(
    engine: Engine, family: Incremental, gamma: float, start: Values | None = None, bounds: Bounds = NO_BOUNDS
) -> Certificate | None:
    """Certificate that the gains of a family (in rationals) reach gamma; the last attempt where none holds.

    `bounds`: those on P and on the poles.
    """
    if family.plant.n >= LARGE and (known := by_riccati(engine, family, gamma, bounds)):
        return known
    problem = in_floats(family).witness(gamma, bounds)
    wide = engine.widest(problem, start)
    if wide.objective <= MARGIN and start is not None:
        wide = engine.widest(problem)
    if wide.objective <= 0 or not (gamma**2):  # a level whose square is none has no claim
        return None
    level = printed(gamma)
    mu = square_below(level)
    solved = {name: rational(value) for name, value in family.weights(rational([[mu]])).items()}
    reduced = reduce(problem)
    certificate = None
    for digits in DIGITS:
        values = rounded({u.name: wide.values[u.name] for u in problem.unknowns}, digits)
        values = complete(
            lambda v: [*family.theorem({**v, **solved}), *family.placed(v, bounds)],
            problem.unknowns,
            values,
            reduced.rows,
            reduced.pivots,
        )
        values = {name: value / solved["mu1"].item() for name, value in values.items()}
        certificate = certify(family, level, fmpq(1), mu, values, bounds)
        if certificate.holds:
            break
    return certificate


def by_riccati(engine: Engine, family: Incremental, gamma: float, bounds: Bounds) -> Certificate | None:
    """Certificate that the gain of a large plant reaches gamma by a Riccati equation; None where none gives one."""
    asked = engine, family, gamma, bounds
    return proved_given(*asked) or proved_given_monotone(*asked)


def best_claim(engine: Engine, family: Incremental, bounds: Bounds = NO_BOUNDS) -> tuple[Status, Certificate | None]:
    """Whether given gains achieve anything, and the certificate of nearly the least gamma that they achieve.

    `bounds`: those on the poles.
    """
    known = least_gamma(engine, in_floats(family), bounds) if family.plant.n >= LARGE else None
    if known:
        levels = (round_up(math.sqrt(known.objective) * (1 + backoff), 6) for backoff in BACKOFFS)
        tried = (by_riccati(engine, family, level, bounds) for level in levels)
        if certificate := next((made for made in tried if made), None):
            return known.status, certificate
    least = known or engine.minimise(in_floats(family).least_gamma(bounds))
    if least.status is not Status.OPTIMAL:
        return least.status, None
    root = math.sqrt(max(least.objective, 0.0)) or 1e-9
    certificate = None
    for backoff in BACKOFFS:
        certificate = claim(engine, family, round_up(root * (1 + backoff), 6), bounds=bounds)
        if certificate and certificate.holds:
            break
    return least.status, certificate
