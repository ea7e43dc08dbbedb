"""What one injection and relaxation can do: limits, edges of feasibility, and certified gains."""

import math
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import Range, ends, require_agreement
from obsdesign.dissipation.decimals import round_down
from obsdesign.dissipation.gain import CLOSELY
from obsdesign.dissipation.scan import edge, strides, zero
from obsdesign.families.outcome import Diagnosis, limited
from obsdesign.families.sporadic.certificate import SporadicCertificate
from obsdesign.families.sporadic.gains import (
    EDGE,
    ROUNDING,
    WIDER,
    Candidate,
    Gains,
    Setting,
    closest,
    reaching,
    smallest,
    within,
)
from obsdesign.families.sporadic.landscape import Form, Landscape
from obsdesign.families.sporadic.reasons import out_of_reach, too_small
from obsdesign.families.sporadic.relaxations import Predictor, Proposition2, Reduced
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.families.sporadic.slack import Held, Proposition3, Proposition4, Proposition5
from obsdesign.families.sporadic.theorem import Sporadic
from obsdesign.families.sporadic.units import SPEC
from obsdesign.lmi.formula import in_floats, printed, rational_number
from obsdesign.lmi.solve import Status
from obsdesign.records import dataclass, field, replace

MODERATE = 2.0  # gamma of gains that only have to be feasible, relative to the least
ROOM = 2e-3  # of gamma, left to the rounding of the gains
STRIDES = 10  # between bounds on |L|, from one that does not do, until one does
LEAST = 1e-6  # gamma that gains are searched for, where it is zero, beside its size by the data
Point = dict[str, Any]
Attempt = tuple[Gains | None, SporadicCertificate | None]
NONE: Attempt = None, None


@dataclass(frozen=True)
class Made:
    """Gains for one T2 and decay, or why there are none."""

    gamma: float = math.inf  # the limit over all gains
    delta: float = 0.0
    bounded: float | None = None  # the limit within a bound on |L|
    gains: Gains | None = None
    certificate: SporadicCertificate | None = None
    diagnosis: Diagnosis = field(default_factory=dict)

    @property
    def status(self) -> str:
        """Whether there are gains, and whether they are proved."""
        if self.diagnosis or math.isinf(self.gamma):
            return "infeasible"
        if self.certificate is None:
            return "undecided"
        return "certified" if self.certificate.holds else "uncertified"

    @property
    def level(self) -> float:
        """Least gamma of the gains that are allowed."""
        return self.gamma if self.bounded is None else self.bounded

    @property
    def size(self) -> float:
        """|L|."""
        return float(np.linalg.norm(in_floats(self.gains)[0], 2)) if self.gains else math.inf


@dataclass(frozen=True)
class Scheme:
    """One curve: the limit, by inequalities without the gains where there are such, and the gains."""

    injection: str
    relaxation: str
    limit: Form
    gains: Form
    printed: Form  # what Table I counts

    @property
    def names(self) -> dict[str, str]:
        """What tells it from other curves."""
        return {"injection": self.injection, "relaxation": self.relaxation}

    def counts(self, family: Sporadic) -> dict[str, int]:
        """Scalar unknowns of the printed inequalities, and of those that the limit takes."""
        return {"printed": self.printed(family).scalars, "solved": self.limit(family).scalars}


SCHEMES = (
    Scheme("dynamic", "proposition-2", Reduced, Proposition2, Proposition2),
    Scheme("dynamic", "proposition-3", Proposition3, Proposition3, Proposition3),
    Scheme("dynamic", "proposition-4", Proposition4, Proposition4, Proposition4),
    Scheme("predictor", "proposition-2", Predictor, Predictor, Predictor),
    Scheme("hold", "proposition-5", Held, Held, Proposition5),
)


def schemes(request: SporadicRequest) -> tuple[Scheme, ...]:
    """Schemes of a request, in its order, each once.

    Raises `UsageError`: a relaxation fits none of the injections, or an injection none of the relaxations.
    """
    require_agreement(request)
    return tuple(s for pair in request.pairs for s in SCHEMES if (s.injection, s.relaxation) == pair)


class Study:
    """One scheme, whose searches remember where the last one ended."""

    def __init__(self, setting: Setting, scheme: Scheme, request: SporadicRequest) -> None:
        self.setting, self.scheme, self.request = setting, scheme, request
        self.landscapes: dict[tuple[Form, float, float | None], Landscape] = {}
        self.exponent: float | None = None  # delta T2 of the last optimum
        self.around: float | None = None  # and of that with |L| bounded
        self.size: float | None = None  # |L| of the last gains

    @property
    def kappa(self) -> float | None:
        """Largest |L| before it is rounded."""
        bound = self.request.largest_gain
        return None if bound is None else float(bound) * (1 - ROUNDING)

    @property
    def cap(self) -> float | None:
        """Largest gamma."""
        bound = self.request.largest_gamma
        return None if bound is None else float(bound)

    def landscape(self, form: Form, decay: float, kappa: float | None = None) -> Landscape:
        """A relaxation at one decay."""
        key = form, decay, kappa
        if key not in self.landscapes:
            self.landscapes[key] = self.setting.landscape(form, decay, kappa)
        return self.landscapes[key]

    # Limits

    def least_gamma(self, T2: float, decay: float) -> tuple[float, float]:
        """Best delta and the infimum of gamma over all gains; infinite if there is none."""
        landscape = self.landscape(self.scheme.limit, decay)
        delta, gamma = landscape.least_gamma(T2, self.exponent)
        if math.isfinite(gamma) and landscape.missing(delta, T2) >= 0:  # only with a singular P1
            if landscape.least_missing(T2) >= 0 or landscape.exponent is None:
                return delta, math.inf
            delta = landscape.exponent / T2
            gamma = landscape.gamma(delta, T2)
        if math.isfinite(gamma):
            self.exponent = delta * T2 if delta < landscape.interval[1] else math.inf
            gamma = gamma if self.setting.plant.B.shape[1] else 0.0
        return delta, gamma

    def confirmed(self, T2: float, decay: float) -> tuple[float, float]:
        """Same, by solves in different scalings that agree."""
        delta, gamma = self.least_gamma(T2, decay)
        if math.isfinite(gamma) and self.setting.plant.B.shape[1]:
            relaxation = self.landscape(self.scheme.limit, decay).relaxation(delta, T2)
            answer = self.setting.engine.minimise(relaxation.least_gamma())
            if answer.status is Status.OPTIMAL:
                gamma = math.sqrt(max(answer.objective, 0.0))
        return delta, gamma

    def missing(self, T2: float, decay: float, *, bounded: bool = False) -> float:
        """Negative where there are gains, of any size and for any gamma, or else within the bounds.

        The search begins where the last one ended.
        """
        kappa = self.kappa if bounded else None
        landscape = self.landscape(self.scheme.limit if kappa is None else self.scheme.gains, decay, kappa)
        if bounded and self.cap is not None:
            _, gamma = landscape.least_gamma(T2, self.exponent)
            return math.log(gamma / self.cap) if math.isfinite(gamma) and gamma > 0 else gamma - 1.0
        landscape.exponent = self.exponent
        value = landscape.least_missing(T2)
        self.exponent = landscape.exponent
        return value

    def farthest(self, name: str, low: float, high: float, other: float, *, bounded: bool = False) -> float | None:
        """Largest T2 in an interval at a decay, or largest decay at a T2, whichever is named; None if there is none."""
        self.exponent = None

        def missing(value: float) -> float:
            return self.missing(*((value, other) if name == "T2" else (other, value)), bounded=bounded)

        return zero(missing, low, high, EDGE * high)

    # Gains

    def at(self, T2: fmpq, decay: fmpq, limit: tuple[float, float] | None = None) -> Made:
        """Gains for one T2 and decay.

        With the best delta and the least gamma there given, for a point of a curve, the gains are allowed to be larger
        than necessary within the bound on them.
        """
        report = self.setting.engine.report if limit is None else lambda *_: None
        report(0.3, f"limit for T2 = {float(T2):g}")
        delta, gamma = limit or self.confirmed(float(T2), float(decay))
        made, start, cap = Made(gamma, delta), None, math.inf if self.cap is None else self.cap
        if math.isinf(gamma) or gamma > cap:
            return replace(made, diagnosis={} if math.isinf(gamma) else out_of_reach(cap, gamma))
        if self.kappa is not None:
            landscape = self.landscape(self.scheme.gains, float(decay), self.kappa)
            start = within(landscape, float(T2), self.exponent if limit and self.around is None else self.around)
            if start is None and self.setting.units is not SPEC:
                return made  # |L| is in the units of the spec, in which this search decides nothing
            if start is None:
                return replace(made, diagnosis=too_small(float(self.kappa), float(T2), float(decay)))
            self.around = landscape.exponent
            made = replace(made, bounded=max(start.gamma, gamma))
        if made.level > cap:
            return replace(made, diagnosis=too_small(float(self.kappa or 0), float(T2), float(decay), cap, made.level))
        target = self.target(made.level)
        report(0.7, f"gains for T2 = {float(T2):g}")
        chosen = start if start and limit else self.small(made, start, float(T2), float(decay), target, limit is None)
        gains, certificate = self.proved(chosen, T2, decay, target)
        proved = float(certificate.gamma) if certificate and certificate.holds else target
        if proved > target and limit is None and (lower := target**2 / proved) > made.level:
            again = self.small(made, start, float(T2), float(decay), lower, True)  # a solve has overstated its gains
            second = reaching(self.setting, again, T2, decay, target, self.kappa) if again else (None, None)
            if second[1] and second[1].holds and float(second[1].gamma) < proved:
                gains, certificate = second
        return replace(made, gains=gains, certificate=certificate)

    def proved(self, chosen: Candidate | None, T2: fmpq, decay: fmpq, target: float) -> Attempt:
        """Chosen gains with their proof; where there are none, or it fails, the nearest with one, or any attempt."""
        first = [reaching(self.setting, chosen, T2, decay, target, self.kappa)] if chosen else []
        size, most = float(np.linalg.norm(self.setting.family(0.0).plant.A, 2)) or 1.0, self.kappa or math.inf
        others = closest(partial(self.landscape, self.scheme.gains, float(decay)), float(T2), min(size, most), most)
        made, least = NONE, math.inf
        for attempt in chain(first, (reaching(self.setting, c, T2, decay, c.gamma, self.kappa) for c in others)):
            found = float(attempt[1].gamma) if attempt[1] and attempt[1].holds else math.inf
            if found < least or not made[0]:
                made, least = attempt, found
            if least < MODERATE * target or (not first and least < math.inf):
                break
        return made

    def enough(self, T2: float, decay: float) -> float | None:
        """Bound on |L| within which gains were found that do what is asked, about the least, if there is one."""
        asked, cap = float(self.request.largest_gain or 0), math.inf if self.cap is None else self.cap

        def reaches(kappa: float) -> bool:
            found = within(self.landscape(self.scheme.gains, decay, kappa), T2, self.exponent)
            return found is not None and found.gamma <= cap

        inside, outside = strides(reaches, asked, 1 / WIDER, STRIDES)
        return None if inside is None or outside is None else edge(reaches, inside, outside, CLOSELY)

    def small(
        self, made: Made, start: Candidate | None, T2: float, decay: float, target: float, thorough: bool
    ) -> Candidate | None:
        """Gains of small norm that reach a gamma."""
        room = min(ROOM, max(target / made.level - 1, 0.0) / 3) if made.level else 0.0
        delta = start.delta if start else made.delta
        landscape = self.landscape(self.scheme.gains, decay)
        size = self.kappa or self.size or float(np.linalg.norm(landscape.family.plant.A, 2)) or 1.0
        found = smallest(landscape, T2, target * (1 - room), delta, size, thorough=thorough)
        if found is None or (self.kappa is not None and found.size > self.kappa):
            found = start
        self.size = found.size if found else self.size
        return found

    def target(self, base: float) -> float:
        """Gamma to be certified: within the slack of the least, or a moderate one where gamma is not the objective.

        Without w any will do.
        """
        if not self.setting.plant.B.shape[1]:
            return 1.0
        least = 0.0 if self.request.objective in {"min-gamma", "pareto"} else MODERATE
        wanted = max(1 + float(self.request.slack), least)
        target = max(base * wanted, LEAST * self.setting.units.gamma)
        return target if self.cap is None else min(target, self.cap)

    # Curves

    def curve(self) -> list[tuple[Point, Made]]:
        """Points over the range of T2 or of the decay; above an infeasible one there is none.

        Where both are ranges, the largest T2 for each decay.
        """
        T2, decay = self.request.T2, self.request.decay
        name, ranged = ("decay", decay) if isinstance(decay, Range) else ("T2", T2)
        assert isinstance(ranged, Range)
        grid = [printed(value) for value in ranged.grid()]
        points: list[tuple[Point, Made]] = []
        for i, value in enumerate(grid):
            self.setting.engine.report(0.9 * i / len(grid), ", ".join(self.scheme.names.values()))
            if points and points[-1][0]["status"] == "infeasible":
                points.append(({name: float(value), "status": "infeasible"}, Made()))
            elif name == "T2":
                points.append(self.point(name, value, value, printed(ends(decay)[0])))
            elif isinstance(T2, Range):
                points.append(self.longest_point(value, T2))
            else:
                points.append(self.point(name, value, printed(T2), value))
        return points

    def point(self, name: str, value: fmpq, T2: fmpq, decay: fmpq) -> tuple[Point, Made]:
        """Limit and certified gains of one point of a curve of gamma."""
        delta, gamma = self.least_gamma(float(T2), float(decay))
        if math.isinf(gamma):
            status = "infeasible" if self.missing(float(T2), float(decay)) >= 0 else "undecided"
            return {name: float(value), "status": status}, Made()
        made = self.at(T2, decay, (delta, gamma))
        return {name: float(value), "gamma": gamma, "delta": delta} | described(made, {"gamma": gamma}), made

    def longest_point(self, decay: fmpq, interval: Range) -> tuple[Point, Made]:
        """Largest T2 for one decay, and certified gains for one within the slack of it."""
        low, high = float(interval.low), float(interval.high)
        limit = self.farthest("T2", low, high, float(decay), bounded=self.cap is not None)
        if limit is None:
            lost = self.cap is None or self.kappa is None  # a bound on |L| has sufficient conditions only
            return {"decay": float(decay), "status": "infeasible" if lost else "undecided"}, Made()
        T2 = within_slack(limit, low, self.request.slack)
        made = self.at(T2, decay)
        return {"decay": float(decay), "T2": limit, "delta": made.delta} | described(made, {"T2": limit}), made


def within_slack(limit: float, low: float, slack: fmpq) -> fmpq:
    """Decimal within the slack of a largest value, and not below the lowest."""
    return rational_number(repr(max(round_down(limit / (1 + float(slack)), 6), low)))


def described(made: Made, limit: Point) -> Point:
    """Certified gains of a point, and its limit, which they are not better than."""
    if made.diagnosis:
        return {"status": "optimal", "reason": made.diagnosis["reason"]}
    known: Point = {"status": made.status}
    if made.certificate and made.certificate.holds:
        c = made.certificate
        known["certified"] = {
            "gamma": float(c.gamma),
            "T2": float(c.T2),
            "decay": float(c.family.decay),
            "delta": float(c.family.delta),
            "L": made.size,
        }
        known |= limited(limit, known["certified"])
    return known
