"""From a spec to certified gains: limit, smallest gain, rounding, proof.

The limit is the infimum of the objective over all gains. It is not attained as a rule (P becomes singular and the gain
unbounded), so the gains are those of the smallest norm within the slack of it, rounded to few digits, and the
guarantee is proved for the rounded ones.
"""

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.certificate import Certificate
from obsdesign.design.claim import best_claim, claim
from obsdesign.design.decimals import round_down, round_up
from obsdesign.design.engine import Engine, Report
from obsdesign.design.gain import norm, searchable, sized, small_gains, within
from obsdesign.diagnosis import why_not
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.lmi.formula import Array, Values, in_floats, rational_number
from obsdesign.lmi.reduce import between
from obsdesign.lmi.solve import Answer, Status, reduction
from obsdesign.model.structure import undetectable
from obsdesign.observers.l2 import L2
from obsdesign.observers.request import Bounds, Range
from obsdesign.spec.model import Spec

TABLE = (1e1, 1e2, 1e3, 1e4, 1e5, 1e6)  # gains of the table that a limit of zero is answered with
SUSPECT = 1e-3  # a gamma below this may be a limit of zero: the table decides
STEADY = 3  # decades over which gamma must fall, without slowing down, for its limit to be called zero
BISECTIONS = 24


@dataclass(frozen=True)
class Design:
    """Outcome for a spec: certified or uncertified gains, or why there are none."""

    status: str  # certified | uncertified | infeasible
    gains: dict[str, Array] = field(default_factory=dict)  # doubles, to be read as the decimals they print
    certificate: Certificate | None = None
    limit: dict[str, Any] = field(default_factory=dict)
    limit_bounded: dict[str, Any] = field(default_factory=dict)
    points: tuple[dict[str, Any], ...] = ()
    diagnosis: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    solves: int = 0
    time_s: float = 0.0


def design(spec: Spec, solver: str = "clarabel", report: Report = lambda *_: None) -> Design:
    """Design, or analyse, the observer that a spec asks for.

    Raises
    ------
    UsageError
        The limit of gamma is zero and nothing bounds the gain; the multiplier does not allow a free L2.
    UndecidedError
        The solver found neither a solution nor that there is none.
    """
    started = time.perf_counter()
    engine = Engine(solver, report)
    try:
        made = Designer(spec, engine).outcome()
    except (OverflowError, ZeroDivisionError, np.linalg.LinAlgError) as error:
        raise UndecidedError(f"the numbers of {spec.path} are beyond what doubles can compute: {error}") from None
    return replace(made, solves=engine.solves, time_s=time.perf_counter() - started)


class Designer:
    """The steps of one design."""

    def __init__(self, spec: Spec, engine: Engine) -> None:
        self.spec, self.engine = spec, engine
        self.request = spec.observer.printed()
        alpha = self.request.alpha
        self.range = alpha if isinstance(alpha, Range) else None
        self.lowest: fmpq = alpha.low if isinstance(alpha, Range) else alpha
        gain_q = self.request.gains["L2"] if self.request.gains else self.request.L2
        self.family = L2(spec.augmented, spec.multiplier, spec.H, self.lowest, None, gain_q)
        self.notes: list[str] = []
        self.points: list[dict[str, Any]] = []

    def outcome(self) -> Design:
        """Gates that need no solver, then the objective."""
        if self.family.plant.B.shape[1] == 0 and self.request.objective in {"min-gamma", "pareto", "gamma"}:
            raise UsageError("observer.objective: no disturbance acts on this plant; choose feasibility or max-alpha")
        hidden = undetectable(
            in_floats(self.family.plant), in_floats(self.family.multiplier.member), float(self.lowest)
        )
        if hidden:
            return self.infeasible(self.lowest)
        if self.request.gains:
            return self.analysis(self.request.gains["L1"])
        if self.request.objective == "max-alpha":
            return self.fastest()
        alpha = self.lowest
        if self.range and self.request.objective in {"min-gamma", "pareto"}:
            self.points = list(self.curve(self.range.grid()))
            alpha = self.chosen()
        return self.at(alpha)

    # One alpha

    def at(self, alpha: fmpq) -> Design:
        """Design for one alpha: the limit, the bounded limit, gains, proof."""
        family = replace(self.family, alpha=alpha)
        search = searchable(family)
        self.engine.report(0.7, "limit")
        limits, gamma = self.limits(search, alpha)
        if gamma is None:
            return self.infeasible(alpha, limits)
        target = self.target(search, gamma)
        if self.request.bounds.gamma is not None:
            target = min(target, float(self.request.bounds.gamma))
        if target < gamma:
            return self.infeasible(alpha, {"gamma": {"asked": target, "least": gamma}, **limits})
        self.engine.report(0.8, "smallest gain")
        made = self.gains(family, target)
        return replace(made, **limits, points=tuple(self.points), notes=tuple(self.notes))

    def limits(self, search: L2, alpha: fmpq) -> tuple[dict[str, Any], float | None]:
        """Least gamma over all gains, and over those within the bounds; the latter is None if there are none."""
        answer = self.engine.minimise(search.least_gamma())
        if answer.status is Status.INFEASIBLE:
            return {}, None
        table = self.zero_limit(search, answer)
        if answer.status is Status.OPTIMAL or table:
            gamma = 0.0 if table else math.sqrt(max(answer.objective, 0.0))
            limits: dict[str, Any] = {"limit": {"gamma": gamma, "attained": False}}
        elif self.request.objective in {"feasibility", "max-alpha"}:
            gamma, limits = 0.0, {"limit": {"attained": False}}
        else:
            raise UndecidedError(f"the least gamma at alpha = {float(alpha):g} was not found: {answer.raw}")
        if self.bounds is None:
            if table and self.request.objective in {"min-gamma", "pareto"}:
                raise self.unbounded(alpha, table)
            return limits, gamma
        bounded = within(self.engine, search, self.bounds)
        if bounded.status is Status.INFEASIBLE:
            return {"bounds": "no gain within the bounds satisfies the inequality", **limits}, None
        if bounded.status is not Status.OPTIMAL:
            raise UndecidedError(f"the least gamma within the bounds was not found: {bounded.raw}")
        gamma = math.sqrt(bounded.objective)
        return {**limits, "limit_bounded": {"gamma": gamma, "attained": True}}, gamma

    def target(self, search: L2, gamma: float) -> float:
        """Gamma to be certified, rounded down to 6 digits so that it stays within the slack of the limit.

        Where the objective is not gamma, it is `moderate`.
        """
        bounds = self.request.bounds
        if self.request.gamma is not None:
            return float(self.request.gamma)
        if self.request.objective in {"feasibility", "max-alpha"}:
            if bounds.gamma is not None:
                return float(bounds.gamma)
            gamma = max(gamma, self.moderate(search))
        return max(round_down(gamma * (1 + float(self.request.slack)), 6), round_up(gamma, 6))

    def moderate(self, search: L2) -> float:
        """Least gamma of gains up to twice that of the solution of widest margin, or else the gamma of that one."""
        wide = self.engine.widest(search.witness(None))
        if wide.status is not Status.OPTIMAL:
            raise UndecidedError(f"no solution was found for alpha = {search.alpha:g}: {wide.raw}")
        size = 2 * norm(wide.values, self.request.bounds)
        answer = self.engine.minimise(search.least_gamma(sized(self.request.bounds, size)))
        level = answer.objective if answer.status is Status.OPTIMAL else wide.values["mu2"].item()
        return math.sqrt(max(level, 0.0))

    def gains(self, family: L2, gamma: float) -> Design:
        """Gains of small norm that reach gamma, rounded and proved."""
        made = Design("uncertified")
        for candidate, values in small_gains(self.engine, family, gamma, self.request.bounds):
            certificate = claim(self.engine, candidate, gamma, values)
            made = Design("uncertified", doubles(candidate), certificate)
            if certificate and certificate.holds:
                return replace(made, status="certified")
        if not made.gains:
            raise UndecidedError(f"no gain was found for gamma = {gamma:g} at alpha = {float(family.alpha):g}")
        return made

    # Many alphas

    def curve(self, grid: Sequence[fmpq]) -> Iterator[dict[str, Any]]:
        """Least gamma for each alpha; nothing is solved above an infeasible one.

        The inequality is affine in alpha, so the reductions at both ends give those between.
        """
        search, low, high = searchable(self.family), float(grid[0]), float(grid[-1])
        first, last = (reduction(replace(search, alpha=a).least_gamma(self.bounds)) for a in (low, high))
        start: Values | None = None
        lost = False
        for i, alpha in enumerate(map(float, grid)):
            self.engine.report(0.7 * i / len(grid), f"alpha = {alpha:.4g}")
            point: dict[str, Any] = {"alpha": alpha, "status": str(Status.INFEASIBLE)}
            if not lost:
                problem = replace(search, alpha=alpha).least_gamma(self.bounds)
                answer = self.engine.minimise(problem, start, between(first, last, (alpha - low) / (high - low)))
                lost = answer.status is Status.INFEASIBLE
                point["status"] = str(answer.status)
                if answer.status is Status.OPTIMAL:
                    start = answer.values
                    point["gamma"] = math.sqrt(max(answer.objective, 0.0))
            yield point

    @property
    def bounds(self) -> Bounds | None:
        """The bounds that restrict a curve."""
        bounds = self.request.bounds
        return bounds if bounds.L1 is not None or bounds.P is not None else None

    def chosen(self) -> fmpq:
        """Alpha of the shipped design: the lowest, or for pareto the largest that costs no more than the slack."""
        grid = self.range.grid() if self.range else ()
        self.notes.append("the least gamma never decreases with alpha, so min-gamma takes the lower end of the range")
        if self.request.objective == "min-gamma":
            return self.lowest
        gammas = [p.get("gamma") for p in self.points]
        if gammas[0] is None:
            return self.lowest
        limit = gammas[0] * (1 + float(self.request.slack))
        best = max(i for i, g in enumerate(gammas) if g is not None and g <= limit)
        self.notes[-1] = (
            f"the least gamma never decreases with alpha; alpha = {float(grid[best]):g} is the fastest decay of the "
            f"curve whose least gamma is within the slack of that at alpha = {float(grid[0]):g}"
        )
        return grid[best]

    def fastest(self) -> Design:
        """Largest alpha by bisection on feasibility; the shipped one is within the slack of it."""
        low, high = self.ends()
        feasible, unknown = self.feasible_alpha(low)
        if not feasible:
            if unknown:
                raise UndecidedError(f"feasibility at alpha = {float(low):g} was not decided")
            return self.infeasible(low)
        attained, _ = self.feasible_alpha(high)
        limit = float(high) if attained else self.largest_alpha(float(low), float(high))
        if attained:
            self.notes.append(f"every alpha of the range is feasible, up to {float(high):g}")
        shipped = max(limit / (1 + float(self.request.slack)), float(low))
        alpha = high if attained and not self.request.slack else rational_number(str(round_down(shipped, 6)))
        made = self.at(max(alpha, low))
        return replace(made, limit={"alpha": limit, "attained": attained} if made.limit else {})

    def ends(self) -> tuple[fmpq, fmpq]:
        """Ends of the range of alpha; a number is a range of itself."""
        return (self.range.low, self.range.high) if self.range else (self.lowest, self.lowest)

    def largest_alpha(self, low: float, high: float) -> float:
        """Edge of feasibility between a feasible and an infeasible alpha, to 1e-5."""
        for i in range(BISECTIONS):
            if high - low <= 1e-5 * high:
                break
            self.engine.report(0.7 * i / BISECTIONS, f"alpha = {low:.5g} .. {high:.5g}")
            middle = math.sqrt(low * high) if high > 4 * low > 0 else (low + high) / 2
            feasible, _ = self.feasible_alpha(rational_number(repr(middle)))
            low, high = (middle, high) if feasible else (low, middle)
        return low

    def feasible_alpha(self, alpha: fmpq) -> tuple[bool, bool]:
        """Whether the inequality has a solution at alpha, and whether that stayed undecided."""
        family = searchable(replace(self.family, alpha=alpha))
        level = self.request.bounds.gamma
        answer = self.engine.minimise(family.least_gamma(self.bounds))
        if answer.status is Status.OPTIMAL:
            return level is None or answer.objective <= float(level) ** 2, False
        if level is None and self.bounds is None:
            wide = self.engine.widest(family.feasible())
            return wide.status is Status.OPTIMAL, wide.status is Status.UNDECIDED
        return False, answer.status is Status.UNDECIDED

    # Analysis

    def analysis(self, L1: Array) -> Design:
        """Certify given gains, for the least gamma that they achieve."""
        family = replace(self.family, L1=L1)
        slowest = in_floats(family).slowest_pole()
        if slowest.real > -float(self.lowest):
            change = f"grows at the rate {slowest.real:.6g}"
            if slowest.real <= 0:
                change = f"decays at the rate {-slowest.real:.6g} only"
            reason = f"for an f that the types allow, an error {change}"
            return self.infeasible(self.lowest, {"gains": reason})
        status, certificate = best_claim(self.engine, family)
        if status is Status.INFEASIBLE:
            return self.infeasible(self.lowest, {"gains": "no storage function of Theorem 1 proves these gains"})
        proved = certificate is not None and certificate.holds
        made = Design("certified" if proved else "uncertified", doubles(family), certificate)
        limit = self.engine.minimise(searchable(self.family).least_gamma())
        known = {"gamma": math.sqrt(max(limit.objective, 0.0))} if limit.status is Status.OPTIMAL else {}
        return replace(made, limit={**known, "attained": False}, notes=tuple(self.notes))

    # Answers without gains

    def infeasible(self, alpha: fmpq, known: dict[str, Any] | None = None) -> Design:
        """Answer with the reason, in the terms of the model."""
        self.engine.report(0.9, "diagnosis")
        found = known or {}
        limits = {name: found[name] for name in ("limit", "limit_bounded") if name in found}
        found = {name: value for name, value in found.items() if name not in limits}
        largest = self.feasible_edge(alpha) if not found else None
        diagnosis = why_not(self.spec, replace(self.family, alpha=alpha), largest, found)
        return Design("infeasible", diagnosis=diagnosis, points=tuple(self.points), notes=tuple(self.notes), **limits)

    def feasible_edge(self, alpha: fmpq) -> float | None:
        """Largest alpha below an infeasible one that is feasible; None if none was found."""
        high = float(alpha)
        for _ in range(4):
            low = high / 10
            if self.feasible_alpha(rational_number(repr(low)))[0]:
                return self.largest_alpha(low, high)
            high = low
        return None

    def zero_limit(self, family: L2, limit: Answer) -> tuple[tuple[float, float], ...]:
        """Table (largest |L1|, gamma) if gamma falls towards zero as the gain grows; else nothing."""
        if limit.status is Status.OPTIMAL and limit.objective > SUSPECT**2:
            return ()
        rows = []
        for size in TABLE:
            answer = self.engine.minimise(family.least_gamma(Bounds(L1=rational_number(str(size)))))
            if answer.status is Status.OPTIMAL:
                rows.append((size, math.sqrt(max(answer.objective, 0.0))))
        fall = np.diff(np.log([gamma for _, gamma in rows[-4:]]))
        steady = len(fall) == STEADY and fall.max() < math.log(0.8) and fall[-1] < 0.9 * fall[0]
        return tuple(rows) if steady else ()

    def unbounded(self, alpha: fmpq, rows: Sequence[tuple[float, float]]) -> UsageError:
        """Refusal of min-gamma where the infimum is zero."""
        first = (
            f"observer.objective: the least gamma at alpha = {float(alpha):g} is 0, with a gain that grows without "
            "bound; choose `bounds: {L1: ..}` or `objective: {gamma: ..}` from this table"
        )
        return UsageError(first, *(f"  |L1| <= {size:<8g} gamma = {gamma:.4g}" for size, gamma in rows))


def doubles(family: L2) -> dict[str, Array]:
    """Both gains as doubles, which print as the decimals that were proved."""
    fixed = in_floats(family)
    assert fixed.L1 is not None
    assert fixed.L2 is not None
    return {"L1": fixed.L1, "L2": fixed.L2}
