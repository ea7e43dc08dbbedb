"""From a request for an observer with sporadic measurements to certified gains.

The limit is the infimum of gamma over all gains, or the supremum of T2 or of the decay. It is not attained as a rule
(the gain grows without bound), so that the gains are those of the smallest |L| within the slack of it, rounded to few
digits, and the guarantee is proved for the rounded ones, with a delta of its own.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import Range, ends
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.pace import DECAY
from obsdesign.errors import Problem, UndecidedError, UsageError
from obsdesign.families.finding import UNDISTURBED, hidden_mode
from obsdesign.families.outcome import BEST_FOUND, Diagnosis, Outcome, Search, Verdict
from obsdesign.families.reach import judged
from obsdesign.families.sporadic.advice import lower, wider
from obsdesign.families.sporadic.claim import Claim
from obsdesign.families.sporadic.gains import SHORTER, Gains, Setting, longest_proof, prove, sustained, tolerated
from obsdesign.families.sporadic.held import held
from obsdesign.families.sporadic.landscape import LEAST_DELTA
from obsdesign.families.sporadic.reasons import hiding_interval, missed, out_of_bounds, too_long, useless
from obsdesign.families.sporadic.request import RANGED, SporadicRequest
from obsdesign.families.sporadic.study import Made, Point, Scheme, Study, schemes, within_slack
from obsdesign.families.sporadic.units import SPEC, units
from obsdesign.lmi.formula import Array, Exact, in_floats, printed, rational
from obsdesign.model.edge import Edge
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant


class Designer:
    """The steps of one design."""

    def __init__(
        self, plant: Plant[Exact], multiplier: Multiplier, Cp: Array, request: SporadicRequest, engine: Engine
    ) -> None:
        self.request, self.engine = request, engine
        self.T2, self.decay = Range(*ends(request.T2)), Range(*ends(request.decay))
        self.lowest = printed(max(self.T2.low, request.T1)), printed(self.decay.low)
        own = units(plant.doubles, in_floats(Cp), float(self.T2.low), bounded=request.largest_gain is not None)
        self.setting = Setting(engine, plant, multiplier, Cp, request.delta, printed(request.T1), own)
        self.schemes = schemes(request)
        self.notes = [] if own is SPEC else [own.told()]
        self.require()
        self.studies = [Study(self.setting, scheme, request) for scheme in self.schemes]

    def outcome(self) -> Outcome:
        """Gates that need no solver, then the objective."""
        plant, multiplier = self.setting.plant, self.setting.multiplier
        T2, decay = float(self.T2.low), float(self.decay.low)
        hidden = hidden_mode(plant.doubles, in_floats(multiplier.member), Edge(decay), DECAY, "lambda_t = ")
        if hidden:
            return self.completed(Outcome(Verdict.INFEASIBLE, diagnosis=hidden))
        if hiding := hiding_interval(plant, multiplier, decay, T2):
            return self.completed(self.hidden(hiding, *self.lowest))
        if self.request.gains:
            given = self.request.gains
            return self.completed(self.analysis((printed(given["L"]), printed(given["H"]))))
        if self.request.objective in RANGED:
            return self.completed(self.farthest())
        return self.completed(self.pareto() if self.request.objective == "pareto" else self.single())

    def completed(self, made: Outcome) -> Outcome:
        """Add what every answer has."""
        family = self.setting.family(float(self.decay.low))
        counts = {f"{s.injection} {s.relaxation}": s.counts(family) for s in self.schemes}
        return replace(made, notes=tuple(self.notes), scalars=counts, scaling=self.setting.units.factors)

    # Gates

    def require(self) -> None:
        """Refuse what makes no sense."""
        plant, request = self.setting.plant, self.request
        if any([*plant.D.flat, *plant.Df.flat]):
            raise UsageError(
                Problem("measurements that arrive sporadically need D = 0 and Df = 0", key="system.D", id="OBS406")
            )
        if not 0 <= request.T1 <= self.T2.high:
            T1, T2 = float(request.T1), float(self.T2.high)
            raise UsageError(
                Problem(f"{T1:g} is not between 0 and T2 = {T2:g}; needs 0 <= T1 <= T2", key="observer.T1", id="OBS208")
            )
        if self.decay.low < 0:
            raise UsageError(Problem(f"{float(self.decay.low):g} is negative", key="observer.decay", id="OBS208"))
        if request.objective == "min-gamma" and not plant.B.shape[1]:
            self.notes.append(UNDISTURBED)
        if request.objective == "pareto" and not plant.B.shape[1]:
            said = "no disturbance acts on this plant; choose feasibility, max-T2 or max-decay"
            raise UsageError(Problem(said, key="observer.objective", id="OBS405"))
        for scheme in self.schemes:
            self.require_delta(scheme)
        if request.gains:
            self.require_gains(request.gains["L"], request.gains["H"])

    def require_delta(self, scheme: Scheme) -> None:
        """Refuse a range of delta that is wholly too low, and say where it is cut."""
        bound = scheme.limit(self.setting.family(float(self.decay.low))).delta_above_decay and not self.request.gains
        least = 2 * LEAST_DELTA * float(self.decay.low)
        if bound and float(self.request.delta.high) < least:
            asked = f"needs delta > 2 decay = {2 * float(self.decay.low):g}"
            ends = f"the range ends at {float(self.request.delta.high):g}"
            raise UsageError(Problem(f"{scheme.relaxation} {asked}, and {ends}", key="observer.delta", id="OBS208"))
        if bound and float(self.request.delta.low) < least:
            self.notes.append(f"{scheme.relaxation} needs delta > 2 decay: its range of delta begins at {least:g}")

    def require_gains(self, L: Array, H: Array) -> None:
        """Refuse gains of the wrong shape."""
        ny, n = self.setting.plant.C.shape
        for name, matrix, shape in (("L", L, (n, ny)), ("H", H, (ny, ny))):
            if np.shape(matrix) != shape:
                expected = f"expected a {shape[0]}x{shape[1]} matrix, one column an output"
                raise UsageError(Problem(expected, key=f"observer.gains.{name}", id="OBS209"))

    # One T2 and one decay

    def single(self) -> Outcome:
        """Least gamma, or feasibility, at the lowest T2 and decay that are asked for."""
        if isinstance(self.request.T2, Range) or isinstance(self.request.decay, Range):
            self.notes.append(
                "the least gamma never decreases with T2 or decay: the lower ends of the ranges are taken"
            )
        found = [(study, study.at(*self.lowest)) for study in self.studies]
        study, made = min(found, key=lambda pair: pair[1].level)
        if math.isinf(made.gamma):
            return self.infeasible(study, *self.lowest)
        goal = study.target(made.level)
        proof = made.certificate if self.request.objective == "min-gamma" else None
        if proof and proof.holds and float(proof.gamma) > goal:
            self.notes.append(missed(goal))
        return self.shipped(study, made, self.limit_of(made, *self.lowest), *self.lowest)

    @property
    def kind(self) -> dict[str, Any]:
        """Of a limit: a range of delta is searched, where nothing says that there is one valley only."""
        return BEST_FOUND if self.request.delta.low < self.request.delta.high else {}

    def limit_of(self, made: Made, T2: fmpq, decay: fmpq) -> dict[str, Any]:
        """Limit of gamma, and where it is, if that was searched."""
        values = {"T2": (self.T2, T2), "decay": (self.decay, decay)}
        at = {name: float(value) for name, (searched, value) in values.items() if searched.low < searched.high}
        return {"gamma": made.gamma, "attained": False, **({"at": at} if at else {}), **self.kind}

    def shipped(self, study: Study, made: Made, limit: dict[str, Any], T2: fmpq, decay: fmpq) -> Outcome:
        """Design of what was made, or why not, with what would be possible.

        Raises `UndecidedError`: there is a limit, and no gains were found near it.
        """
        if made.status == "undecided":
            self.undecided(
                study, f"no gain was found with a proof; the limit of gamma seems to be {made.level:g}", T2, decay
            )
        diagnosis = wider(study, made.diagnosis, T2, decay) if made.diagnosis else {}
        if diagnosis.get("condition") == "bounds":
            return judged(diagnosis, decided=False, limit=limit)
        bounded = {} if made.bounded is None else {"gamma": made.bounded, "attained": True, **BEST_FOUND}
        return Outcome(
            Verdict(made.status),
            in_doubles(made.gains),
            Claim(made.certificate, asked=held(self.request, {"L": made.gains[0]}))
            if made.certificate and made.gains
            else None,
            limit=limit,
            limit_bounded=bounded,
            diagnosis=diagnosis,
        )

    def undecided(self, study: Study, reason: str, T2: fmpq, decay: fmpq) -> NoReturn:
        """Answer that nothing is known, with what would be possible."""
        hints = lower(study, {"T2": float(T2), "decay": float(decay)}, T2, decay)
        raise UndecidedError("; ".join([reason, *([said] if (said := ", or ".join(hints)) else [])]), id="OBS507")

    def infeasible(self, study: Study, T2: fmpq, decay: fmpq) -> Outcome:
        """Answer that there are no gains, with what would be feasible."""
        self.engine.report(0.9, "diagnosis")
        values = float(T2), float(decay)
        if study.missing(*values) < 0:
            said = (
                f"the least gamma at T2 = {values[0]:g} with decay {values[1]:g} was not found: without w there is a "
                "solution, as far as a solver tells, and with w none was found at any delta of the range"
            )
            self.undecided(study, said, T2, decay)
        form = f"{study.scheme.relaxation} with injection {study.scheme.injection}"
        edges = self.edges(study, *values)
        return Outcome(Verdict.INFEASIBLE, diagnosis=too_long(*values, edges, [*lower(study, edges, T2, decay)], form))

    def edges(self, study: Study, T2: float, decay: float) -> dict[str, float]:
        """Largest T2, and largest decay, below those that are asked for, at which there are solutions."""
        asked = {"T2": (T2, decay), "decay": (decay, T2)}
        found = {k: study.farthest(k, SHORTER * v, v, other) for k, (v, other) in asked.items() if v}
        return {name: value for name, value in found.items() if value is not None}

    def hidden(self, diagnosis: Diagnosis, T2: fmpq, decay: fmpq) -> Outcome:
        """Answer that an interval hides modes, with a T2 that was tried."""
        study = self.studies[0]
        edges = {"T2": self.edges(study, float(T2), float(decay)).get("T2")}
        hints = [*lower(study, edges, T2, decay), "look at another measurement"]
        return Outcome(Verdict.INFEASIBLE, diagnosis={**diagnosis, "suggestion": ", or ".join(hints)})

    # Largest T2 or decay

    def farthest(self) -> Outcome:
        """Design near the largest T2, or decay, that any scheme reaches, by what is missing for feasibility."""
        name = RANGED[self.request.objective]
        low, other = self.lowest if name == "T2" else self.lowest[::-1]
        high = float(self.T2.high if name == "T2" else self.decay.high)
        interval = float(low), high, float(other)
        if name == "T2" and (blind := self.blind()):
            return blind
        reached = [(study, study.farthest(name, *interval)) for study in self.studies]
        study, limit = max(reached, key=lambda pair: -math.inf if pair[1] is None else pair[1])
        if limit is None:
            return self.infeasible(study, *self.lowest)
        limits: dict[str, Any] = {"limit": {name: limit, "attained": limit == high, **self.kind}}
        if name == "T2" and limit == high:
            self.notes.append(f"every T2 of the range is feasible, up to {high:g}")
        if study.kappa is not None or study.cap is not None:
            limit = study.farthest(name, *interval, bounded=True)
            if limit is None and self.setting.units is not SPEC:
                raise UndecidedError(
                    f"no {name} within the bounds was found, in units that are far from the data", id="OBS507"
                )
            if limit is None:
                bounded = out_of_bounds(name)
                if study.kappa is not None:
                    return judged(wider(study, bounded, *self.lowest), decided=False, **limits)
                return judged(bounded, decided=True, **limits)
            limits["limit_bounded"] = {name: limit, "attained": limit == high, **BEST_FOUND}
        self.engine.report(0.8, "gains")
        near = within_slack(limit, float(low), self.request.slack)
        at = (near, other) if name == "T2" else (other, near)
        found = study.at(*at)
        if math.isinf(found.gamma):
            raise UndecidedError(
                f"solutions seem to end at {name} = {limit:g}, but no gains were found near it", id="OBS507"
            )
        return replace(self.shipped(study, found, {}, *at), **{"limit_bounded": {}, **limits})

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
        proof = Claim(certificate, asked=held(self.request, {"L": nothing[0]}))
        return Outcome(Verdict.CERTIFIED, in_doubles(nothing), claim=proof, limit=limit)

    # Curves

    def pareto(self) -> Outcome:
        """Trade-off curves, each point with certified gains; ships the farthest point within the slack of the best."""
        if not isinstance(self.request.T2, Range) and not isinstance(self.request.decay, Range):
            said = "pareto needs a range of T2 or of decay; give {min: .., max: ..}"
            raise UsageError(Problem(said, key="observer.objective", id="OBS215"))
        found = [(study, study.curve()) for study in self.studies]
        curves = [[point for point, _ in points] for _, points in found]
        named = ({**study.scheme.names, "points": points} for study, points in zip(self.studies, curves, strict=True))
        search = Search("decay" if "decay" in curves[0][0] else "T2", tuple(curves[0]), curves=tuple(named))
        made = [(study, point, m) for study, points in found for point, m in points if m.status == "certified"]
        if made:
            return replace(self.farthest_point(made), search=search)
        tight = [m.diagnosis for _, points in found for _, m in points if m.diagnosis.get("condition") == "bounds"]
        if tight:
            return judged(wider(self.studies[0], tight[0], *self.lowest), decided=False, search=search)
        return replace(self.infeasible(self.studies[0], *self.lowest), search=search)

    def farthest_point(self, made: Sequence[tuple[Study, Point, Made]]) -> Outcome:
        """Design for the farthest point with a gamma within the slack of the least."""
        largest = min(m.gamma for _, _, m in made) * (1 + float(self.request.slack))
        near = [item for item in made if item[2].gamma <= largest]
        study, _, m = max(near, key=lambda item: item[1]["T2"] if "T2" in item[1] else item[1]["decay"])
        assert m.certificate
        T2, decay = m.certificate.T2, m.certificate.family.decay
        self.notes.append(
            f"the gains are those of T2 = {float(T2):g} and decay {float(decay):g}: of the points of propositions the "
            "farthest whose limit of gamma is within the slack of their least"
        )
        again = study.at(T2, decay, (m.delta, m.gamma))
        best = again if again.status == "certified" else m
        return self.shipped(study, best, self.limit_of(best, T2, decay), T2, decay)

    # Analysis

    def analysis(self, gains: Gains) -> Outcome:
        """Certify given gains, for the least gamma that they achieve, and the T2 that they tolerate.

        For max-T2 and max-decay, within the slack of the largest value for which Theorem 2 has a solution.
        """
        T2, decay = self.lowest
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
            diagnosis = useless(float(self.request.T1), float(T2), float(decay), most)
            return Outcome(Verdict.INFEASIBLE, in_doubles(gains), diagnosis=diagnosis)
        if not limit:
            _, gamma = self.studies[0].confirmed(float(T2), float(decay))
            limit = {"gamma": gamma} if math.isfinite(gamma) else {}
        return Outcome(
            Verdict.CERTIFIED if certificate.holds else Verdict.UNCERTIFIED,
            in_doubles(gains),
            Claim(certificate, longest_proof(self.setting, gains, most or 0.0, decay)),
            limit={**limit, "attained": False, **(self.kind if limit else {})},
        )


def in_doubles(gains: Gains | None) -> dict[str, Array]:
    """Both gains as doubles, which print as the decimals that were proved."""
    return dict(zip(("L", "H"), in_floats(gains), strict=True)) if gains else {}


def design_sporadic(
    plant: Plant[Exact], multiplier: Multiplier, H: Array, request: SporadicRequest, engine: Engine
) -> Outcome:
    """Design, or analyze, an observer for sporadic measurements.

    `plant`, `multiplier`, `H`: the problem, in rationals: D = 0 and Df = 0; z = H e.

    Raises `UsageError`: the measurement has a direct term, T1 > T2, a range of delta that its relaxation cannot use,
    gains of the wrong shape, a relaxation of another injection, or min-gamma without a disturbance. Raises
    `UndecidedError`: the solver found neither a solution nor that there is none.
    """
    return Designer(plant, multiplier, H, request, engine).outcome()
