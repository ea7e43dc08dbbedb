"""From a request for an observer with the gains L1 and L2 (families l2, linf) to certified gains."""

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import Range
from obsdesign.dissipation.certificate import Certificate, rate_of
from obsdesign.dissipation.claim import best_claim, claim
from obsdesign.dissipation.decimals import round_up
from obsdesign.dissipation.elimination import LARGE, least_gamma
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import doubles, searchable, small_gains, within
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.monotone import proved_monotone
from obsdesign.dissipation.scaling import scaling
from obsdesign.dissipation.smaller import proved_small
from obsdesign.dissipation.zero import silent_gains
from obsdesign.errors import UndecidedError
from obsdesign.families.finding import UNDISTURBED
from obsdesign.families.incremental.absence import covers, impossible, ruled_out, slower_helps, why_not
from obsdesign.families.incremental.accuracy import accurate
from obsdesign.families.incremental.claim import Claim, held
from obsdesign.families.incremental.decay import Decay, Point, apart
from obsdesign.families.incremental.instead import beyond, remedied
from obsdesign.families.incremental.limits import FLAT, UNKNOWN, UNPROVED, Limits
from obsdesign.families.incremental.observer import errors
from obsdesign.families.incremental.reconstruct import reconstruct
from obsdesign.families.incremental.reconstruction import left_inverse
from obsdesign.families.incremental.request import posed, request_of
from obsdesign.families.incremental.samples import at_the_edge
from obsdesign.families.incremental.theorems import Linf
from obsdesign.families.incremental.trade import trader
from obsdesign.families.noise import noise_of
from obsdesign.families.outcome import Outcome, Search, Verdict
from obsdesign.families.poles import missed
from obsdesign.families.reach import judged
from obsdesign.lmi.formula import Array, Values, in_floats
from obsdesign.lmi.solve import Status
from obsdesign.spec import Spec


class Designer:
    """The steps of one design."""

    def __init__(self, spec: Spec, engine: Engine) -> None:
        self.spec, self.engine = spec, engine
        self.request = request_of(spec).printed()
        rate = self.request.rate
        self.range = rate if isinstance(rate, Range) else None
        self.lowest: fmpq = rate.low if isinstance(rate, Range) else rate
        self.family = posed(spec)
        self.decay = Decay(engine, self.family, replace(self.request.bounds, gamma=self.request.level))
        self.pace = self.family.about.pace
        self.notes: list[str] = []
        self.points: list[Point] = []

    @property
    def limits(self) -> Limits:
        """The least gamma over all gains and within the bounds."""
        return Limits(self.engine, self.family.about, self.request, self.points, self.notes, self.noise)

    def noise(self, L1: Array) -> float | None:
        """Rms of z for white noise of density 1 in every output, of the worst member; None: not known."""
        if self.request.L2 is None or not self.family.about.feedback:
            return None
        return noise_of(errors(self.spec, {"L1": L1, "L2": in_floats(self.request.L2)}), in_floats(self.spec.H))

    def outcome(self) -> Outcome:
        """Gates that need no solver, then the objective."""
        if not self.family.plant.B.shape[1] and self.request.objective in {"min-gamma", "pareto"}:
            self.notes.append(UNDISTURBED)
            self.request = replace(self.request, objective="feasibility")
        fixed = in_floats(self.family)
        if ruled_out(self.spec, fixed):
            return self.infeasible(self.lowest)
        at_the_edge(fixed)
        if self.request.gains:
            return self.analysis(self.searched())
        if self.request.objective == "max-alpha":
            return self.fastest()
        return self.accurate() or self.provable(self.searched())

    def accurate(self) -> Outcome | None:
        """Gains in closed form for `objective: {gamma: ..}`, where nothing bounds them and the plant admits them."""
        gamma, outputs = self.request.gamma, [in_floats(self.family).H]
        if gamma is None or self.request.bounds.restricted or self.pace.sampled or self.family.direct:
            return None
        if self.request.reconstruct:
            inverse = left_inverse(self.family.plant.B)
            outputs += [in_floats(inverse @ self.family.plant.A), in_floats(inverse)]
        known = None if self.range or self.family.plant.n < LARGE else least_gamma(self.engine, in_floats(self.family))
        if known and known.objective > 0:  # no gamma below it
            return None
        grid = self.range.grid() if self.range else (self.lowest,)
        found = [solution for rate in grid if (solution := accurate(self.engine, replace(self.family, rate=rate)))]
        if not found:
            return None
        best = min(found, key=lambda solution: float(np.linalg.norm(solution.L1(float(gamma), outputs), 2)))
        made = self.proved(((family, None) for family in best.gains(float(gamma), outputs)), float(gamma))
        if made.status is not Verdict.CERTIFIED:
            return None
        size, name = float(np.linalg.norm(made.gains["L1"], 2)), self.family.about.gain
        self.notes.append(
            f"any gamma can be reached, at |{name}| of the order of 1 / gamma^2 at most: in closed form |{name}| = "
            f"{size:.4g} for gamma = {float(gamma):g}; where the spec limits {name}, smaller gains are searched"
        )
        return replace(made, limit={"gamma": 0.0, "attained": False}, notes=tuple(self.notes))

    def provable(self, rate: fmpq) -> Outcome:
        """Design at the rate of a search; where its proof fails, at points of the curve with clearly larger gammas."""
        first, known, failed = self.at(rate), self.notes, f"the gains at {self.pace.said(rate)} fail in rationals"
        for other in map(self.pace.found, apart(self.points) if first.status is Verdict.UNCERTIFIED else ()):
            self.notes = [*known, f"{failed}; {self.pace.said(other)} is the next with some that hold"]
            with suppress(UndecidedError):
                if (made := self.at(other)).status is Verdict.CERTIFIED:
                    return made
        return first

    # One rate

    def at(self, rate: fmpq) -> Outcome:
        """Design for one rate: the limit, the bounded limit, gains, proof."""
        family = replace(self.family, rate=rate)
        search = searchable(family)
        self.engine.report(0.7, "limit")
        limits, level = self.limits.at(search, rate)
        if level is None and not limits:
            return self.infeasible(rate)
        if level is None:
            return self.out_of_bounds(rate, limits)
        target = self.limits.target(search, level)
        if self.request.bounds.gamma is not None:
            target = min(target, float(self.request.bounds.gamma))
        if target < level.gamma:
            most, restricted = limits["limit"].get("gamma", 0.0), self.request.bounds.restricted
            if target >= most and restricted:
                return self.out_of_bounds(rate, limits, level.gamma)
            levels = {"asked": target, "least": most, **({"bounded": level.gamma} if restricted else {})}
            return self.infeasible(rate, {"gamma": levels, **limits})
        self.engine.report(0.8, "smallest gain")
        made = self.gains(family, target)
        return replace(made, **limits, search=self.search, notes=tuple(self.notes))

    def gains(self, family: Incremental, gamma: float) -> Outcome:
        """Gains of small norm that reach gamma, or else one that keeps v from the error, rounded and proved."""
        bounds, large = self.request.bounds, family.plant.n >= LARGE
        if large and (central := self.central(family, gamma, "the smallest takes long to find for so large a plant")):
            return central
        silent = ((found, None) for found in silent_gains(self.engine, family, bounds))
        made = self.proved(chain(small_gains(self.engine, family, gamma, bounds), silent), gamma)
        if made.status is Verdict.UNCERTIFIED and not large:
            made = self.central(family, gamma, "no smaller one was proved") or made
        if not made.gains:
            said = f"no gain was found for gamma = {gamma:g} at {self.pace.said(family.rate)}"
            raise UndecidedError(said, id="OBS507")
        return made

    def proved(self, candidates: Iterable[tuple[Incremental, Values | None]], gamma: float) -> Outcome:
        """Return the first of some candidates that is proved to reach gamma; or else the last of them, uncertified."""
        made = Outcome(Verdict.UNCERTIFIED)
        for candidate, values in candidates:
            certificate = claim(self.engine, candidate, gamma, values, self.request.kept)
            made = self.claimed(candidate, certificate)
            if made.status is Verdict.CERTIFIED:
                return self.completed(candidate, made)
        return made

    def claimed(self, candidate: Incremental, certificate: Certificate | None) -> Outcome:
        """Gains with a certificate, and whether it holds, the bounds of the request included."""
        assert candidate.L1 is not None
        proof = Claim(certificate, asked=held(self.request, candidate.L1, certificate.gamma)) if certificate else None
        status = Verdict.CERTIFIED if proof and proof.holds else Verdict.UNCERTIFIED
        return Outcome(status, doubles(candidate), proof)

    def central(self, family: Incremental, gamma: float, why: str) -> Outcome | None:
        """Gain of a Riccati equation that is proved, and a note on it; None where none is, or bounds ask for others."""
        if not self.engine.eliminates or self.request.bounds.restricted:
            return None
        asked = self.engine, family, gamma, self.request.kept
        found = proved_small(*asked) or proved_monotone(*asked)
        made = found and self.claimed(found[0].family, found[0])
        if not found or not made or made.status is not Verdict.CERTIFIED:
            return None
        self.notes.append(found[1].said(family.about.gain, why))
        return self.completed(found[0].family, made)

    def completed(self, family: Incremental, made: Outcome) -> Outcome:
        """Design with the bound on the reconstruction of w, if it is asked for and can be proved."""
        if not self.request.reconstruct or not isinstance(made.claim, Claim) or not isinstance(family, Linf):
            return made
        self.engine.report(0.9, "reconstruction of w")
        bound = reconstruct(self.engine, self.spec, family)
        if isinstance(bound, str):
            self.notes.append(f"nothing is said of |what - w|: {bound}; gamma holds all the same")
            return made
        if any(block.f is None for block in self.spec.nonlinearities):
            self.notes.append("what is said of |what - w| takes f to depend on q only, since it is not given")
        return replace(made, claim=replace(made.claim, reconstruction=bound))

    def instead(self, why: str) -> Outcome | None:
        """Central gain with the least gamma that is proved of one."""
        found = None if self.range else self.limits.proved(replace(self.family, rate=self.lowest), why)
        made = found and self.completed(found[0].family, self.claimed(found[0].family, found[0]))
        return replace(made, limit=found[1], notes=tuple(self.notes)) if found and made else None

    @property
    def search(self) -> Search | None:
        """Points that were looked at, if any were."""
        if not self.points:
            return None
        told = ({**self.limits.place(point["rate"]), **point} for point in self.points)
        return Search(self.pace.key, tuple({k: v for k, v in point.items() if k != "rate"} for point in told))

    # Many rates

    def searched(self) -> fmpq:
        """Rate of the shipped design: the number that is asked for, or one of the range.

        Where the least gamma never decreases with it, min-gamma takes the lower end; where the rate competes with it,
        the minimum of the curve, or the fastest decay where the curve is flat there. Pareto takes the fastest decay
        within the slack of the least gamma.
        """
        objective, monotone = self.request.objective, self.family.about.monotone
        if self.range is None or (monotone and (objective in {"feasibility", "gamma"} or self.request.gains)):
            return self.lowest
        self.points = list(self.decay.curve(self.range.grid()))
        if not monotone and objective != "pareto":
            self.points = sorted([*self.points, *self.decay.lowest(self.points)], key=lambda point: point["rate"])
        if not any("gamma" in point for point in self.points):
            return self.lowest
        best = self.points[0]["rate"]
        if objective == "pareto" or not monotone:
            best = self.decay.fastest(self.points, float(self.request.slack) if objective == "pareto" else FLAT)
        self.notes.append(self.decay.choice(self.points, best, pareto=objective == "pareto"))
        return self.pace.found(best)

    def fastest(self) -> Outcome:
        """Largest rate by bisection on feasibility; the shipped one is within the slack of it."""
        low, high = (self.range.low, self.range.high) if self.range else (self.lowest, self.lowest)
        feasible, unknown = self.decay.feasible(low)
        if not feasible:
            if unknown and not self.request.bounds.restricted:
                raise UndecidedError(f"feasibility at {self.pace.said(low)} was not decided", id="OBS507")
            gamma = in_floats(self.request.bounds).gamma
            return self.out_of_bounds(low, {}, gamma) if unknown else self.infeasible(low)
        attained, _ = self.decay.feasible(high)
        limit = float(high) if attained else self.decay.largest(float(low), float(high))
        if attained:
            self.notes.append(f"the whole range is feasible, up to {self.pace.said(high)}")
        slack = self.request.slack
        shipped = max(self.pace.within(limit, float(slack)), float(low))
        rate = high if attained and not slack else self.pace.found(self.pace.rounded(shipped, 6))
        made = self.at(max(rate, low))
        return replace(made, limit={**self.told(limit), "attained": attained} if made.limit else {})

    def told(self, rate: float) -> dict[str, float]:
        """Alpha of a limit; of samples rho, and alpha that follows from it."""
        place, period = self.limits.place(rate), self.spec.period
        return {**place, "alpha": rate_of(place["rho"], period)} if period and place["rho"] > 0 else place

    # Analysis

    def analysis(self, rate: fmpq) -> Outcome:
        """Certify given gains, for the least gamma that they achieve."""
        family = replace(self.family, rate=rate)
        slowest = in_floats(family).slowest_pole()
        if family.edge.of(slowest) < float(rate):
            change = f"for an f that the types allow, an error {self.pace.only(family.edge.of(slowest))}"
            return self.infeasible(rate, {"gains": change})
        kept = self.request.kept
        said = kept.poles and missed(errors(self.spec, doubles(family)).poles, kept.poles)
        if said:
            return self.infeasible(rate, {"gains": said})
        status, certificate = best_claim(self.engine, family, kept)
        if status is Status.INFEASIBLE:
            theorem = "" if self.pace.sampled else " of Theorem 1"
            return self.infeasible(rate, {"gains": f"no storage function{theorem} was found that proves these gains"})
        proved = certificate is not None and certificate.holds
        verdict = Verdict.CERTIFIED if proved else Verdict.UNCERTIFIED
        made = Outcome(verdict, doubles(family), Claim(certificate) if certificate else None)
        made = self.completed(family, made)
        limit = within(self.engine, searchable(replace(family, L1=None)))
        known = {"gamma": math.sqrt(max(limit.objective, 0.0))} if limit.status is Status.OPTIMAL else {}
        known |= {} if limit.gap is None else {"gap": round_up(limit.gap, 2)}
        limits = (
            self.limits.best({**known, "attained": False, **self.limits.kind(rate)}) if known else {"attained": False}
        )
        return replace(made, limit=limits, search=self.search, notes=tuple(self.notes))

    # Answers without gains

    def absent(self) -> Outcome | None:
        """Answer that there are no gains, where that is proved at every rate that is asked for."""
        family = replace(self.family, rate=self.lowest)
        return self.infeasible(self.lowest) if covers(self.request, family, None) and impossible(family) else None

    def infeasible(self, rate: fmpq, known: dict[str, Any] | None = None) -> Outcome:
        """Answer with the reason, in the terms of the model, and what else would do, as far as a solver tells."""
        self.engine.report(0.9, "diagnosis")
        none = known and not self.request.gains and impossible(replace(self.family, rate=rate))
        found = {} if none or not known else dict(known)
        limits = {name: found.pop(name) for name in ("limit", "limit_bounded") if name in found}
        sought = "gamma" in found or (not found and slower_helps(self.spec, replace(self.family, rate=rate)))
        largest = self.decay.trusting.largest_below(rate) if sought else None
        diagnosis = why_not(self.spec, replace(self.family, rate=rate), largest, found)
        if not found and diagnosis["condition"] != "detectability":
            diagnosis = remedied(self.spec, self.decay.trusting, rate, largest, diagnosis)
        return Outcome(Verdict.INFEASIBLE, diagnosis=diagnosis, search=self.search, notes=tuple(self.notes), **limits)

    def out_of_bounds(self, rate: fmpq, limits: dict[str, Any], reached: float | None = None) -> Outcome:
        """Answer that nothing within the bounds was found, with what would do instead.

        `reached`: least gamma within the bounds, where a smaller one is asked for.
        """
        if impossible(replace(self.family, rate=rate)):
            return self.infeasible(rate)
        self.engine.report(0.9, "diagnosis")
        decided, found = beyond(self.decay, rate, limits.get("limit", {}).get("gamma"), reached)
        decided = decided and covers(self.request, replace(self.family, rate=rate), self.decay.bounds.gamma)
        return judged(found, decided=decided, search=self.search, notes=tuple(self.notes), **limits)


def design(spec: Spec, engine: Engine) -> Outcome:
    """Design, or analyze, an observer with the gains L1 and L2.

    Raises `UsageError`: the limit of gamma is zero and nothing bounds the gain; the multiplier does not allow a free
    L2. Raises `UndecidedError`: the solver found neither a solution nor that there is none.
    """
    if (request := request_of(spec)).trade and not request.gains:
        return trader(spec, engine, request.trade, design).outcome()
    designer = Designer(spec, engine)
    try:
        made = designer.outcome()
    except UndecidedError:
        if engine.distrust():  # gains are not where a Riccati equation has them: inequalities decide
            return design(spec, engine)
        if not (other := designer.absent() or designer.instead(UNKNOWN)):
            raise
        made = other
    if made.status is Verdict.UNCERTIFIED and not designer.request.gains:
        made = designer.absent() or designer.instead(UNPROVED) or made
    return replace(made, scaling=scaling(searchable(designer.family)) if engine.solves else {})
