"""From a request for an observer with sporadic measurements to certified gains.

The limit is the infimum of gamma over all gains, or the supremum of T2 or of the decay. It is not attained as a rule
(the gain grows without bound), so that the gains are those of the smallest |L| within the slack of it, rounded to few
digits, and the guarantee is proved for the rounded ones, with a delta of its own.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import Range
from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.families.reasons import hidden_mode
from obsdesign.families.sporadic.claim import Claim
from obsdesign.families.sporadic.gains import Gains, Setting, prove
from obsdesign.families.sporadic.given_gains import SHORTER, longest_proof, sustained, tolerated
from obsdesign.families.sporadic.landscape import LEAST_DELTA
from obsdesign.families.sporadic.pareto import curve, farthest, interval, searched
from obsdesign.families.sporadic.reasons import hiding_interval, too_long, useless
from obsdesign.families.sporadic.request import SporadicRequest, request_of
from obsdesign.families.sporadic.scheme import Scheme, schemes
from obsdesign.families.sporadic.study import Made, Point, Study, within_slack
from obsdesign.lmi.formula import Array, Exact, in_floats, printed, rational
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.spec import Spec


class Designer:
    """The steps of one design."""

    def __init__(
        self, plant: Plant[Exact], multiplier: Multiplier, Cp: Array, request: SporadicRequest, engine: Engine
    ) -> None:
        self.request, self.engine = request, engine
        self.T2, self.decay = interval(request.T2), interval(request.decay)
        self.setting = Setting(engine, plant, multiplier, Cp, request.delta, printed(request.T1))
        self.schemes = schemes(request)
        self.notes: list[str] = []
        self.require()
        self.studies = [Study(self.setting, scheme, request) for scheme in self.schemes]

    def outcome(self) -> Outcome:
        """Gates that need no solver, then the objective."""
        plant, multiplier = self.setting.plant, self.setting.multiplier
        T2, decay = float(self.T2.low), float(self.decay.low)
        hidden = hidden_mode(plant.doubles, in_floats(multiplier.member), decay, "lambda_t = ")
        blocked = hidden or hiding_interval(plant, multiplier, decay, T2)
        if blocked:
            return self.completed(Outcome(Verdict.INFEASIBLE, diagnosis=blocked))
        if self.request.gains:
            given = self.request.gains
            return self.completed(self.analysis((printed(given["L"]), printed(given["H"]))))
        objectives: dict[str, Callable[[], Outcome]] = {
            "max-T2": self.longest,
            "max-decay": self.fastest,
            "pareto": self.pareto,
        }
        return self.completed(objectives.get(self.request.objective, self.single)())

    def completed(self, made: Outcome) -> Outcome:
        """Add what every answer has."""
        family = self.setting.family(float(self.decay.low))
        counts = {f"{s.injection} {s.relaxation}": s.counts(family) for s in self.schemes}
        return replace(made, notes=tuple(self.notes), scalars=counts)

    # Gates

    def require(self) -> None:
        """Refuse what makes no sense."""
        plant, request = self.setting.plant, self.request
        if any([*plant.D.flat, *plant.Df.flat]):
            raise UsageError("system.D: measurements that arrive sporadically need D = 0 and Df = 0")
        if not 0 < request.T1 <= self.T2.high:
            T1, T2 = float(request.T1), float(self.T2.high)
            raise UsageError(f"observer.T1: {T1:g} is not between 0 and T2 = {T2:g}; needs 0 < T1 <= T2")
        if self.decay.low < 0:
            raise UsageError(f"observer.decay: {float(self.decay.low):g} is negative")
        if request.objective in {"min-gamma", "pareto"} and not plant.B.shape[1]:
            raise UsageError(
                "observer.objective: no disturbance acts on this plant; choose feasibility, max-T2 or max-decay"
            )
        for scheme in self.schemes:
            self.require_delta(scheme)
        if request.gains:
            self.require_gains(request.gains["L"], request.gains["H"])

    def require_delta(self, scheme: Scheme) -> None:
        """Refuse a range of delta that is wholly too low, and say where it is cut."""
        bound = scheme.limit(self.setting.family(float(self.decay.low))).delta_above_decay and not self.request.gains
        least = 2 * LEAST_DELTA * float(self.decay.low)
        if bound and float(self.request.delta.high) < least:
            raise UsageError(
                f"observer.delta: {scheme.relaxation} needs delta > 2 decay = {2 * float(self.decay.low):g}, "
                f"and the range ends at {float(self.request.delta.high):g}"
            )
        if bound and float(self.request.delta.low) < least:
            self.notes.append(f"{scheme.relaxation} needs delta > 2 decay: its range of delta begins at {least:g}")

    def require_gains(self, L: Array, H: Array) -> None:
        """Refuse gains of the wrong shape."""
        ny, n = self.setting.plant.C.shape
        for name, matrix, shape in (("L", L, (n, ny)), ("H", H, (ny, ny))):
            if np.shape(matrix) != shape:
                raise UsageError(
                    f"observer.gains.{name}: expected a {shape[0]}x{shape[1]} matrix, one column an output"
                )

    # One T2 and one decay

    def single(self) -> Outcome:
        """Least gamma, or feasibility, at the lowest T2 and decay that are asked for."""
        if isinstance(self.request.T2, Range) or isinstance(self.request.decay, Range):
            self.notes.append(
                "the least gamma never decreases with T2 or decay: the lower ends of the ranges are taken"
            )
        T2, decay = printed(max(self.T2.low, self.request.T1)), printed(self.decay.low)
        found = [study.at(T2, decay) for study in self.studies]
        best = self.best(found, lambda made: made.level)
        if math.isinf(found[best].gamma):
            return self.infeasible(self.studies[best], float(T2), float(decay))
        made, goal = found[best], self.studies[best].target(found[best].level)
        if made.certificate and made.certificate.holds and float(made.certificate.gamma) > goal:
            self.notes.append(
                f"no gain was proved to reach gamma = {goal:g}, all that the slack allows; this is nearest"
            )
        return self.shipped(made, {"gamma": made.gamma, "attained": False})

    def shipped(self, made: Made, limit: dict[str, Any]) -> Outcome:
        """Design of what was made.

        Raises
        ------
        UndecidedError
            There is a limit, and no gains were found near it.
        """
        if made.status == "undecided":
            raise UndecidedError(f"no gain was found near the limit of gamma, {made.level:g}")
        bounded = {} if made.bounded is None else {"gamma": made.bounded, "attained": True}
        return Outcome(
            Verdict(made.status),
            in_doubles(made.gains),
            Claim(made.certificate) if made.certificate else None,
            limit=limit,
            limit_bounded=bounded,
            diagnosis=made.diagnosis,
        )

    def best(self, found: Sequence[Any], size: Callable[[Any], float]) -> int:
        """Index of the least, the first if several are."""
        return min(range(len(found)), key=lambda i: size(found[i]))

    def infeasible(self, study: Study, T2: float, decay: float) -> Outcome:
        """Answer that there are no gains, with what would be feasible."""
        self.engine.report(0.9, "diagnosis")
        if study.missing(T2, decay) < 0:
            raise UndecidedError(f"the least gamma at T2 = {T2:g} with decay {decay:g} was not found")
        largest = study.longest(SHORTER * T2, T2, decay)
        fastest = study.fastest(T2, SHORTER * decay, decay) if decay else None
        form = f"{study.scheme.relaxation} with injection {study.scheme.injection}"
        return Outcome(Verdict.INFEASIBLE, diagnosis=too_long(T2, decay, largest, fastest, form))

    # Largest T2 or decay

    def longest(self) -> Outcome:
        """Largest T2, by what is missing for feasibility."""
        decay = float(self.decay.low)
        low, high = float(max(self.T2.low, self.request.T1)), float(self.T2.high)
        blind = self.blind()
        if blind:
            return blind
        made = self.farthest(
            "T2",
            low,
            high,
            lambda study, bounded: study.longest(low, high, decay, bounded=bounded),
            lambda T2: (T2, printed(self.decay.low)),
        )
        if made.limit.get("attained"):
            self.notes.append(f"every T2 of the range is feasible, up to {high:g}")
        return made

    def fastest(self) -> Outcome:
        """Largest decay, likewise."""
        T2 = printed(max(self.T2.low, self.request.T1))
        low, high = float(self.decay.low), float(self.decay.high)
        return self.farthest(
            "decay",
            low,
            high,
            lambda study, bounded: study.fastest(float(T2), low, high, bounded=bounded),
            lambda decay: (T2, decay),
        )

    def farthest(
        self,
        name: str,
        low: float,
        high: float,
        search: Callable[[Study, bool], float | None],
        place: Callable[[fmpq], tuple[fmpq, fmpq]],
    ) -> Outcome:
        """Design near the largest value that any of the schemes reaches."""
        reached = [search(study, False) for study in self.studies]
        best = self.best(reached, lambda value: -math.inf if value is None else -value)
        study, limit = self.studies[best], reached[best]
        if limit is None:
            T2, decay = place(printed(low))
            return self.infeasible(study, float(T2), float(decay))
        limits: dict[str, Any] = {"limit": {name: limit, "attained": limit == high}}
        if study.kappa is not None or study.cap is not None:
            limit = search(study, True)
            if limit is None:
                diagnosis = {
                    "condition": "bounds",
                    "reason": f"no {name} of the range can be reached within the bounds",
                    "feasible": {},
                    "suggestion": "allow larger bounds",
                }
                return Outcome(Verdict.INFEASIBLE, diagnosis=diagnosis, **limits)
            limits["limit_bounded"] = {name: limit, "attained": limit == high}
        self.engine.report(0.8, "gains")
        found = study.at(*place(within_slack(limit, low, self.request.slack)))
        if math.isinf(found.gamma):
            raise UndecidedError(f"solutions seem to end at {name} = {limit:g}, but no gains were found near it")
        return replace(self.shipped(found, {}), **{"limit_bounded": {}, **limits})

    def blind(self) -> Outcome | None:
        """L = 0 and H = 0 for the largest T2, where the error decays without any measurement; None if it does not."""
        T2, decay = printed(self.T2.high), printed(self.decay.low)
        nothing = (
            rational(np.zeros(self.setting.plant.C.mT.shape)),
            rational(np.zeros((len(self.setting.plant.C),) * 2)),
        )
        exponents = Range(2 * decay + 1 / (10 * T2), 2 * decay + 10 / T2)
        certificate = prove(replace(self.setting, delta=exponents), nothing, T2, decay)
        if not certificate or not certificate.holds:
            return None
        self.notes.append(
            "the error decays at this rate without any measurement: T2 is unbounded, and no gain is needed"
        )
        limit = {"T2": float(T2), "attained": True, "unbounded": True}
        return Outcome(Verdict.CERTIFIED, in_doubles(nothing), Claim(certificate), limit)

    # Curves

    def pareto(self) -> Outcome:
        """Trade-off curves, each point with certified gains; ships the farthest point within the slack of the best."""
        T2, decay = self.request.T2, self.request.decay
        if not isinstance(T2, Range) and not isinstance(decay, Range):
            raise UsageError("observer.objective: pareto needs a range of T2 or of decay; give {min: .., max: ..}")
        curves, made = [], []
        for study in self.studies:
            points = curve(study, T2, decay)
            curves.append({**study.scheme.names, "points": [point for point, _ in points]})
            made += [(study, point, m) for point, m in points if m.status == "certified"]
        if not made:
            return replace(
                self.infeasible(self.studies[0], float(self.T2.low), float(self.decay.low)), search=searched(curves)
            )
        return replace(self.farthest_point(made), search=searched(curves))

    def farthest_point(self, made: Sequence[tuple[Study, Point, Made]]) -> Outcome:
        """Design for the farthest point with a gamma within the slack of the least."""
        study, m = farthest(made, self.request.slack)
        assert m.certificate
        T2, decay = m.certificate.T2, m.certificate.family.decay
        self.notes.append(
            f"the gains are those of T2 = {float(T2):g} and decay {float(decay):g}: the largest of all points whose "
            "limit of gamma is within the slack of the least"
        )
        again = study.at(T2, decay, (m.delta, m.gamma))
        best = again if again.status == "certified" else m
        return self.shipped(best, {"gamma": best.gamma, "attained": False})

    # Analysis

    def analysis(self, gains: Gains) -> Outcome:
        """Certify given gains, for the least gamma that they achieve, and the T2 that they tolerate.

        For max-T2 and max-decay, within the slack of the largest value for which Theorem 2 has a solution.
        """
        decay, T2 = printed(self.decay.low), printed(max(self.T2.low, self.request.T1))
        most = tolerated(self.setting, gains, float(T2), float(self.T2.high), float(decay))
        objective = self.request.objective
        limit: dict[str, Any] = {}
        if objective == "max-T2" and most is not None:
            limit = {"T2": min(most, float(self.T2.high))}
            T2 = within_slack(limit["T2"], float(T2), self.request.slack)
        if objective == "max-decay" and most is not None:
            limit = {"decay": sustained(self.setting, gains, float(T2), self.decay)}
            decay = within_slack(limit["decay"], float(decay), self.request.slack)
        certificate = prove(self.setting, gains, T2, decay)
        if certificate is None:
            diagnosis = useless(float(T2), float(decay), most)
            return Outcome(Verdict.INFEASIBLE, in_doubles(gains), diagnosis=diagnosis)
        if not limit:
            _, gamma = self.studies[0].confirmed(float(T2), float(decay))
            limit = {"gamma": gamma} if math.isfinite(gamma) else {}
        return Outcome(
            Verdict.CERTIFIED if certificate.holds else Verdict.UNCERTIFIED,
            in_doubles(gains),
            Claim(certificate, longest_proof(self.setting, gains, most or 0.0, decay)),
            limit={**limit, "attained": False},
        )


def in_doubles(gains: Gains | None) -> dict[str, Array]:
    """Both gains as doubles, which print as the decimals that were proved."""
    return dict(zip(("L", "H"), in_floats(gains), strict=True)) if gains else {}


def design_sporadic(
    plant: Plant[Exact], multiplier: Multiplier, H: Array, request: SporadicRequest, engine: Engine
) -> Outcome:
    """Design, or analyze, an observer for sporadic measurements.

    Parameters
    ----------
    plant, multiplier, H
        The problem, in rationals: D = 0 and Df = 0; z = H e.
    request
        T1, T2, decay, delta, injections, relaxations, objective, bounds, and gains to be analyzed.
    engine
        Solver, report of progress, and the count of solves.

    Raises
    ------
    UsageError
        The measurement has a direct term, T1 > T2, a range of delta that its relaxation cannot use, gains of the wrong
        shape, a relaxation of another injection, or min-gamma without a disturbance.
    UndecidedError
        The solver found neither a solution nor that there is none.
    """
    return Designer(plant, multiplier, H, request, engine).outcome()


def design(spec: Spec, engine: Engine) -> Outcome:
    """Design, or analyze, the observer that a spec asks for."""
    return design_sporadic(spec.augmented, spec.multiplier, spec.H, request_of(spec), engine)
