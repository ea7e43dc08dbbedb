"""Small gains, the proof for the rounded ones with a delta of their own, and what given gains tolerate."""

import math
from collections.abc import Callable, Iterator

import numpy as np
from flint import fmpq

from obsdesign.dissipation import scan
from obsdesign.dissipation.bounds import Range
from obsdesign.dissipation.decimals import round_down, round_up, significant, square_below
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import DIGITS
from obsdesign.dissipation.scan import Minimum
from obsdesign.families.sporadic.certificate import SporadicCertificate, certify_sporadic
from obsdesign.families.sporadic.landscape import LARGEST, Form, Landscape, Optimum, root, solve_once
from obsdesign.families.sporadic.relaxations import Given, WithGains
from obsdesign.families.sporadic.theorem import Sporadic, tied_gain
from obsdesign.families.sporadic.units import SPEC, Units
from obsdesign.lmi.formula import Array, Exact, Values, in_floats, printed, rational, rational_number
from obsdesign.lmi.proof import complete, rounded
from obsdesign.lmi.reduce import reduce
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, replace

CENTERINGS = 6  # of the bound on |L| about the solution, which makes it tight there
SETTLED = 0.01  # relative change of gamma below which they end
TIGHTER = 0.03  # relative change of gamma by them beyond which delta is searched again
STRIDE = 2.0  # between bounds on |L|, until one will do and another will not
STRIDES = 24
WIDER = 4.0  # .. without a gamma to be reached
AROUND = 0.8  # logarithm of the ratio of two of them, up to which a solution is of use to the other
NEAR = 0.03  # relative, to which the smallest such bound is found
TINY = 1e-300
ROUNDING = 1e-5  # of a bound on |L|, left to the rounding of the gain
BACKOFFS = (1e-4, 1e-3, 1e-2)  # of the least gamma that gains achieve
WITNESS = (12, 17)  # digits
EDGE = 1e-5  # relative, of a largest T2 or decay
SHORTER = 1e-3  # least T2 or decay, relative to the one that is asked for, that an answer looks for
LONGER = 10.0  # largest T2 that is tried for given gains, relative to the one that is asked for
SHORTENED = (1e-4, 1e-3, 3e-3, 1e-2, 3e-2)  # from the largest T2 of given gains to one that is proved
PART = 1 / 7  # of these, to which the longest proof is found
Gains = tuple[Array, Array]  # L, H


@dataclass(frozen=True)
class Setting:
    """The problem, in rationals, and where delta is searched."""

    engine: Engine
    plant: Plant[Exact]
    multiplier: Multiplier
    Cp: Array
    delta: Range
    T1: fmpq
    units: Units = SPEC  # of the search

    def family(self, decay: float) -> Sporadic:
        """The family for a rate, in doubles and in the units of the search, at no delta yet."""
        plant, Cp = self.units.plant(self.plant.doubles), in_floats(self.Cp) * self.units.x / self.units.z
        return Sporadic(plant, in_floats(self.multiplier), Cp, decay * self.units.time, 0.0, 1.0, self.units)

    def landscape(self, form: Form, decay: float, kappa: float | None = None) -> Landscape:
        """A relaxation at one decay."""
        return Landscape(self.engine, self.family(decay), form, self.delta, kappa)

    def analysis(self, gains: Gains, decay: float) -> Landscape:
        """Theorem 2 for given gains, which needs delta > 0 only."""
        L, H = self.units.inside(*in_floats(gains))
        return self.landscape(lambda family: Given(family, L, H), decay)


@dataclass(frozen=True)
class Candidate:
    """A solution of a relaxation with gains in it."""

    gamma: float
    relaxation: WithGains
    values: Values

    @property
    def delta(self) -> float:
        """Delta, 1/s."""
        return float(self.relaxation.family.delta / self.relaxation.family.units.time)

    @property
    def gains(self) -> Gains:
        """L and H."""
        return self.relaxation.family.units.outside(*self.relaxation.gains(self.values))

    @property
    def size(self) -> float:
        """|L|, as it is measured in the units of the search."""
        return self.relaxation.family.units.size(self.relaxation.gains(self.values)[0])


def bounded(engine: Engine, relaxation: WithGains, kappa: float, near: Values | None = None) -> Candidate | None:
    """Least gamma with |L| <= kappa at one delta: the bound is centered about the last solution until that settles.

    It begins about a solution nearby, or else about none.
    """
    best = centered(engine, relaxation, kappa, near)
    if near is not None and not best.found:
        best = centered(engine, relaxation, kappa)
    if not best.found:
        return None
    for _ in range(CENTERINGS):
        better = centered(engine, relaxation, kappa, best.values)
        if not better.found or better.objective > best.objective:
            break
        settled = better.objective > (1 - SETTLED) ** 2 * best.objective
        best = better
        if settled:
            break
    return Candidate(root(best), relaxation, best.values)


def centered(engine: Engine, relaxation: WithGains, kappa: float, about: Values | None = None) -> Optimum:
    """Least gamma with the bound on |L| centered about a solution, by one solve."""
    factor = None if about is None else relaxation.factor(about)
    return solve_once(engine, relaxation, relaxation.least_gamma(relaxation.bound(kappa, factor)))


def within(landscape: Landscape, T2: float, exponent: float | None = None) -> Candidate | None:
    """Least gamma with |L| <= kappa, the bound of the landscape, over delta: searched again with the bound centered."""
    engine, kappa = landscape.engine, landscape.kappa
    if kappa is None:
        return None
    delta, gamma = landscape.least_gamma(T2, exponent)
    first = None if math.isinf(gamma) else bounded(engine, landscape.with_gains(delta, T2), kappa)
    if first is None:
        return None
    landscape.exponent = delta * T2
    if first.gamma > (1 - TIGHTER) * gamma:
        return first
    values = first.values

    def again(delta: float) -> float:
        return root(centered(engine, landscape.with_gains(delta, T2), kappa, values))

    better, gamma = Minimum(again, *landscape.interval, values={delta: first.gamma}).near(delta)
    second = bounded(engine, landscape.with_gains(better, T2), kappa, values) if gamma < first.gamma else None
    return second if second and second.gamma < first.gamma else first


def smallest_at(engine: Engine, relaxation: WithGains, goal: float, near: float) -> Candidate | None:
    """Gains of small norm whose gamma is below a goal at one delta; None if no bound on |L| will do.

    The least gamma falls as the bound grows, and is reliable to compute over many decades; minimizing |L| at a given
    gamma is not.
    """
    known: dict[str, Candidate | None] = {}

    def excess(kappa: float) -> float:
        """Logarithm of gamma / goal."""
        place = f"{kappa:.12g}"
        if place not in known:
            known[place] = bounded(engine, relaxation, kappa, values_near(kappa))
        found = known[place]
        return math.log(max(found.gamma, TINY) / goal) if found else math.inf

    def values_near(kappa: float) -> Values | None:
        """Of the solution for the closest bound, if that is close."""
        found = [(abs(math.log(float(p) / kappa)), c.values) for p, c in known.items() if c]
        distance, values = min(found, key=lambda pair: pair[0], default=(math.inf, None))
        return values if distance < AROUND else None

    begin = STRIDE ** round(math.log(near, STRIDE))  # powers of one number, wherever it begins
    inside, outside = scan.strides(lambda kappa: excess(kappa) < 0, begin, 1 / STRIDE, STRIDES)
    if inside is not None and outside is not None:
        scan.zero(lambda small: excess(math.exp(-small)), -math.log(inside), -math.log(outside), NEAR)
    fitting = [found for found in known.values() if found and found.gamma < goal]
    return min(fitting, key=lambda candidate: candidate.size, default=None)


def smallest(
    landscape: Landscape, T2: float, goal: float, delta: float, kappa: float, *, thorough: bool
) -> Candidate | None:
    """Gains of small norm that reach a gamma: at a delta, and then at the best delta for a bound of that size."""
    first = smallest_at(landscape.engine, landscape.with_gains(delta, T2), goal, kappa)
    if first is None or not first.size or not thorough:
        return first
    sized = replace(landscape, kappa=first.size, pieces=None)
    better, _ = sized.least_gamma(T2, delta * T2)
    second = smallest_at(landscape.engine, landscape.with_gains(better, T2), goal, first.size)
    return second if second and second.size < first.size else first


def closest(
    bounded: Callable[[float], Landscape], T2: float, begin: float, largest: float = math.inf
) -> Iterator[Candidate]:
    """Gains within larger and larger bounds on |L|, up to the largest, until gamma settles; the least gamma first."""
    found: list[Candidate] = []
    for kappa in (float(k) for k in begin * WIDER ** np.arange(STRIDES // 2) if k <= largest):
        candidate = within(bounded(kappa), T2, found[-1].delta * T2 if found else None)
        if candidate is None or candidate.size > kappa * (1 + NEAR):
            continue
        if found and candidate.gamma > (1 - SETTLED) * found[-1].gamma:
            break
        found.append(candidate)
    yield from reversed(found)


def roundings(setting: Setting, candidate: Candidate, kappa: float | None) -> Iterator[Gains]:
    """Gains of a candidate in more and more digits, in rationals; H stays tied to L where it is."""
    L, H = candidate.gains
    for digits in DIGITS:
        rough = significant(L, digits)
        if kappa is None or float(np.linalg.norm(rough, 2)) <= kappa:
            exact = printed(rough)
            tied = tied_gain(candidate.relaxation.injection, exact, setting.plant.C)
            yield exact, printed(significant(H, digits)) if tied is None else tied


def prove(
    setting: Setting, gains: Gains, T2: fmpq, decay: fmpq, near: float | None = None
) -> SporadicCertificate | None:
    """Certificate of nearly the least gamma that gains (in rationals) achieve; the last attempt if none holds."""
    landscape = setting.analysis(gains, float(decay))
    delta, gamma = landscape.least_gamma(float(T2), None if near is None else near * float(T2))
    if math.isinf(gamma):
        return None
    certificate = None
    for backoff in BACKOFFS:
        level = round_up(gamma * (1 + backoff), 6) if setting.plant.B.shape[1] else 0.0
        certificate = claim(setting, gains, T2, decay, rational_number(repr(delta)), printed(level))
        if certificate and certificate.holds:
            break
    return certificate


def claim(
    setting: Setting, gains: Gains, T2: fmpq, decay: fmpq, delta: fmpq, gamma: fmpq
) -> SporadicCertificate | None:
    """Certificate that gains reach gamma, at a delta; the last attempt if none holds."""
    if float(delta * T2) > LARGEST:
        return None
    landscape = setting.analysis(gains, float(decay))
    problem = landscape.relaxation(float(delta), float(T2)).witness(float(gamma))
    wide = setting.engine.widest(problem)
    if wide.objective <= 0:
        return None
    mu, reduced = square_below(gamma), reduce(problem)
    exact = Sporadic(setting.plant, setting.multiplier, setting.Cp, decay, delta, rational_number(math.exp(delta * T2)))
    fixed = {"mu": rational([[mu]]), "weight": rational([[1]])}
    certificate = None
    for digits in WITNESS:
        values = rounded(setting.units.witness({u.name: wide.values[u.name] for u in problem.unknowns}), digits)
        values = complete(
            lambda v: exact.theorem({**v, **fixed}, *gains), problem.unknowns, values, reduced.rows, reduced.pivots
        )
        certificate = certify_sporadic(
            setting.plant,
            setting.multiplier,
            setting.Cp,
            gains,
            (setting.T1, T2),
            decay,
            delta,
            gamma,
            mu,
            values,
        )
        if certificate.holds:
            break
    return certificate


def reaching(
    setting: Setting, candidate: Candidate, T2: fmpq, decay: fmpq, gamma: float, kappa: float | None
) -> tuple[Gains | None, SporadicCertificate | None]:
    """Rounded gains of a candidate with a proof that they reach gamma; or else the best attempt.

    An attempt with a proof is better than one without, whatever gamma is proved; then the least gamma is best.
    """
    made: tuple[Gains | None, SporadicCertificate | None] = (None, None)
    least = math.inf
    for gains in roundings(setting, candidate, kappa):
        certificate = prove(setting, gains, T2, decay, candidate.delta)
        proved = float(certificate.gamma) if certificate and certificate.holds else math.inf
        if proved < least or least == math.inf:
            made, least = (gains, certificate), proved
        if proved <= gamma:
            break
    return made


def tolerated(setting: Setting, gains: Gains, T2: float, highest: float, decay: float) -> float | None:
    """Largest T2 for which Theorem 2 has a solution with given gains, at any gamma; numerical.

    `T2`, `highest`: the T2 that is asked for, and the largest of its range; `decay`: lambda_t, 1/s. Searched from
    `SHORTER` T2 to the larger of `LONGER` T2 and the highest; None if not even the first has one.
    """
    landscape = setting.analysis(gains, decay)
    return scan.zero(landscape.least_missing, SHORTER * T2, max(LONGER * T2, highest), EDGE * T2)


def sustained(setting: Setting, gains: Gains, T2: float, decays: Range) -> float:
    """Largest decay of a range for which it has one, or the lowest; numerical."""

    def missing(decay: float) -> float:
        return setting.analysis(gains, decay).least_missing(T2)

    low, high = float(decays.low), float(decays.high)
    found = scan.zero(missing, low, high, EDGE * high)
    return low if found is None else found


def longest_proof(setting: Setting, gains: Gains, edge: float, decay: fmpq) -> SporadicCertificate | None:
    """Proof for the longest T2 that is found, below the edge where solutions end numerically; None without one."""
    proofs: dict[float, SporadicCertificate] = {}
    above = edge

    def proved(T2: float) -> bool:
        certificate = prove(setting, gains, printed(round_down(T2, 6)), decay)
        if not certificate or not certificate.holds:
            return False
        proofs[T2] = certificate
        return True

    for backoff in SHORTENED if edge else ():
        if proved(edge * (1 - backoff)):
            return proofs[scan.edge(proved, edge * (1 - backoff), above, backoff * PART)]
        above = edge * (1 - backoff)
    return None
