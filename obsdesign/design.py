"""From a spec to certified gains: limit, smallest gain, rounding, proof.

The limit is the infimum of the objective over all gains. It is not attained as a rule (P becomes singular and the gain
unbounded), so the gains are those of the smallest norm within the slack of it, rounded to few digits, and
the guarantee is proved for the rounded ones.
"""

import decimal
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.certificate import Certificate, certify, theorem
from obsdesign.diagnosis import why_not
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.lmi.formula import Array, Problem, Values, in_floats, rational, rational_number
from obsdesign.lmi.probe import probe
from obsdesign.lmi.proof import complete, rounded
from obsdesign.lmi.reduce import reduce
from obsdesign.lmi.solve import MARGIN, Answer, Status, minimise, widest
from obsdesign.model.structure import undetectable
from obsdesign.observers.l2 import L2, unshifted
from obsdesign.observers.request import Bounds, Range
from obsdesign.spec.model import Spec

DIGITS = (6, 9, 12, 17)  # of a shipped gain; more only where fewer cannot be proved
BACKOFFS = (1e-4, 1e-3, 1e-2, 1e-1)  # of the least gamma that given gains achieve
KAPPAS = 8  # bounds on |L1| that are tried for the smallest gain
NEAR = 1.15  # ratio of two of them between which the smallest is
SLACK = 0.05  # above a bounded limit, where gamma is not the objective
ROOM = 2e-3  # of gamma, left to the rounding of the gain
WIDENINGS = 3  # attempts at a convex bound on |L1| whose gain comes nearer to the bound asked for
TABLE = (1e1, 1e2, 1e3, 1e4, 1e5, 1e6)  # gains of the table that a limit of zero is answered with
SUSPECT = 1e-3  # a gamma below this may be a limit of zero: the table decides
BISECTIONS = 24

Report = Callable[[float, str], None]  # fraction done, what is being done


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


class Engine:
    """Solves with one solver, and how many."""

    def __init__(self, solver: str = "clarabel", report: Report = lambda *_: None) -> None:
        self.solver = solver
        self.report = report
        self.solves = 0

    def minimise(self, problem: Problem, start: Values | None = None) -> Answer:
        """Optimum of a problem."""
        return self.counted(minimise(problem, self.solver, start))

    def widest(self, problem: Problem, start: Values | None = None) -> Answer:
        """Point of largest margin."""
        return self.counted(widest(problem, self.solver, start))

    def counted(self, answer: Answer) -> Answer:
        """Add to the number of solves."""
        self.solves += answer.solves
        return answer


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
    made = Designer(spec, engine).outcome()
    return replace(made, solves=engine.solves, time_s=time.perf_counter() - started)


class Designer:
    """The steps of one design."""

    def __init__(self, spec: Spec, engine: Engine) -> None:
        self.spec, self.engine = spec, engine
        self.request = spec.observer
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
        hidden = undetectable(in_floats(self.family.plant), in_floats(self.family.multiplier.member), float(self.lowest))
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
        if target < gamma or (self.request.bounds.gamma is not None and gamma > self.request.bounds.gamma):
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
        bounded = self.within(search, self.bounds)
        if bounded.status is Status.INFEASIBLE:
            return {"bounds": "no gain within the bounds satisfies the inequality", **limits}, None
        if bounded.status is not Status.OPTIMAL:
            raise UndecidedError(f"the least gamma within the bounds was not found: {bounded.raw}")
        gamma = math.sqrt(bounded.objective)
        return {**limits, "limit_bounded": {"gamma": gamma, "attained": True}}, gamma

    def within(self, search: L2, bounds: Bounds) -> Answer:
        """Least gamma within bounds; the convex bound on |L1| is widened while the gain it gives stays inside."""
        best = self.engine.minimise(search.least_gamma(bounds))
        if bounds.L1 is None or best.status is not Status.OPTIMAL:
            return best
        size = allowed = float(bounds.L1)
        for _ in range(WIDENINGS):
            size *= allowed / norm(best.values, bounds.norm)
            wider = self.engine.minimise(search.least_gamma(bounded(bounds, size)), best.values)
            if wider.status is not Status.OPTIMAL or norm(wider.values, bounds.norm) > allowed:
                break
            best = wider
        return best

    def target(self, search: L2, gamma: float) -> float:
        """Gamma to be certified, rounded down to 6 digits so that it stays within the slack of the limit.

        Where the objective is not gamma, it is that of the solution of widest margin.
        """
        bounds = self.request.bounds
        if self.request.gamma is not None:
            return float(self.request.gamma)
        if self.request.objective in {"feasibility", "max-alpha"}:
            if bounds.gamma is not None:
                return float(bounds.gamma)
            wide = self.engine.widest(search.witness(None))
            if wide.status is not Status.OPTIMAL:
                raise UndecidedError(f"no solution was found for alpha = {search.alpha:g}: {wide.raw}")
            return max(round_down(math.sqrt(wide.values["mu2"].item()), 6), round_up(gamma * (1 + SLACK), 6))
        return round_down(gamma * (1 + float(self.request.slack)), 6)

    def gains(self, family: L2, gamma: float) -> Design:
        """Gains of small norm that reach gamma, rounded and proved."""
        size = None
        if family.L2 is None:
            values = self.smallest(searchable(family), gamma)
            family, size = replace(family, L2=self.rounded_L2(family, values)), 2 * norm(values)
        values = self.smallest(in_floats(family), gamma, size)
        for digits in DIGITS:
            decimals = significant(gain(values), digits)
            design = self.proved(replace(family, L1=exact(decimals)), gamma, values)
            if design.status == "certified":
                break
        return design

    def smallest(self, search: L2, gamma: float, size: float | None = None) -> Values:
        """P, Y, .. of a gain of small norm that reaches gamma with some room, with mu1 = 1.

        The least gamma under the convex bound |L1| <= kappa falls with kappa: the smallest kappa is found to `NEAR` by
        interpolation in logarithms, from the gain of the widest margin (or a given size) down.
        """
        wide = self.engine.widest(search.witness(gamma))
        if wide.status is not Status.OPTIMAL:
            raise UndecidedError(f"no gain was found for gamma = {gamma:g}: {wide.raw}")
        bounds, goal, values = self.request.bounds, gamma * (1 - ROOM), wide.values
        high = size or norm(values, bounds.norm)
        low = 0.0
        level: float | None = None  # least gamma at high
        start: Values | None = None
        kappa = high
        for _ in range(KAPPAS):
            answer = self.engine.minimise(search.least_gamma(bounded(bounds, kappa)), start)
            found = answer.status is Status.OPTIMAL
            reached = math.sqrt(max(answer.objective, 0.0)) if found else math.inf
            if found and reached <= goal:
                values, high, level, start = answer.values, kappa, reached, answer.values
            else:
                low = kappa
            if low and level is not None and high <= NEAR * low:
                break
            kappa = 2 * kappa if level is None else below(low, high, reached if low == kappa else level, goal)
        return values

    def rounded_L2(self, family: L2, values: Values) -> Array:
        """L2 = R / lambda, back from the loop shift, to 6 digits."""
        plant, K = in_floats(family.plant), in_floats(family.multiplier.member)
        sizes = [len(b.M11) for b in family.multiplier.blocks]
        scales = np.repeat([values[u.name].item() for u in family.multiplier.unknowns()], sizes)
        L2_ = unshifted(values["R"] / scales[:, None], plant, K)
        small = np.abs(L2_) < 1e-6 * np.abs(L2_).max(initial=0)
        return exact(significant(np.where(small, 0.0, L2_), 6))

    # Proof

    def proved(self, family: L2, gamma: float | None, start: Values | None = None) -> Design:
        """Certificate of given gains, for gamma or else for the least that they achieve."""
        gains = {"L1": family.L1.astype(float), "L2": family.L2.astype(float)}
        fixed = in_floats(family)
        claims: Sequence[float | None] = [gamma]
        if gamma is None:
            least = self.engine.minimise(fixed.least_gamma())
            if least.status is not Status.OPTIMAL:
                return Design("uncertified" if least.status is Status.UNDECIDED else "infeasible", gains)
            root = math.sqrt(max(least.objective, 1e-30))
            claims = [round_up(root * (1 + backoff), 6) for backoff in BACKOFFS]
        for claim in claims:
            certificate = self.certificate(family, claim, start)
            if certificate and certificate.holds:
                return Design("certified", gains, certificate)
        return Design("uncertified", gains)

    def certificate(self, family: L2, gamma: float, start: Values | None) -> Certificate | None:
        """Find P and scales by the solver, make them exact, and prove the theorem for them."""
        fixed = in_floats(family)
        problem = fixed.witness(gamma)
        wide = self.engine.widest(problem, start)
        if wide.objective <= MARGIN and start is not None:
            wide = self.engine.widest(problem)
        if wide.objective <= 0:
            return None
        level = rational_number(repr(gamma))
        mu1, mu2 = fmpq(1), level * level
        reduced = reduce(probe(problem))
        formula = theorem(family, mu1, mu2)
        for digits in (12, 17):
            values = rounded({u.name: wide.values[u.name] for u in problem.unknowns}, digits)
            values = complete(formula, problem.unknowns, values, reduced.rows, reduced.pivots)
            certificate = certify(family, level, mu1, mu2, values)
            if certificate.holds:
                return certificate
        return certificate

    # Many alphas

    def curve(self, grid: Sequence[fmpq]) -> Iterator[dict[str, Any]]:
        """Least gamma for each alpha; nothing is solved above an infeasible one."""
        start: Values | None = None
        lost = False
        for i, alpha in enumerate(grid):
            self.engine.report(0.7 * i / len(grid), f"alpha = {float(alpha):.4g}")
            point: dict[str, Any] = {"alpha": float(alpha)}
            if not lost:
                answer = self.engine.minimise(searchable(replace(self.family, alpha=alpha)).least_gamma(self.bounds), start)
                lost = answer.status is Status.INFEASIBLE
                if answer.status is Status.OPTIMAL:
                    start = answer.values
                    point["gamma"] = math.sqrt(max(answer.objective, 0.0))
                point["status"] = str(answer.status)
            else:
                point["status"] = str(Status.INFEASIBLE)
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
            f"the least gamma never decreases with alpha; alpha = {float(grid[best]):g} is the fastest decay of the curve "
            f"whose least gamma is within the slack of that at alpha = {float(grid[0]):g}"
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
            return wide.status is Status.OPTIMAL, False
        return False, answer.status is Status.UNDECIDED

    # Analysis

    def analysis(self, L1: Array) -> Design:
        """Certify given gains, for the least gamma that they achieve."""
        family = replace(self.family, L1=L1)
        made = self.proved(family, None)
        if made.status == "infeasible":
            return replace(self.infeasible(self.lowest, {"gains": "no storage function of Theorem 1 proves these gains"}))
        limit = self.engine.minimise(searchable(self.family).least_gamma())
        known = limit.status is Status.OPTIMAL
        gamma = math.sqrt(max(limit.objective, 0.0)) if known else made.certificate and float(made.certificate.gamma)
        return replace(made, limit={"gamma": gamma, "attained": False}, notes=tuple(self.notes))

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
        falling = len(rows) > 2 and all(b < 0.8 * a for (_, a), (_, b) in zip(rows[-3:], rows[-2:], strict=False))
        return tuple(rows) if falling else ()

    def unbounded(self, alpha: fmpq, rows: Sequence[tuple[float, float]]) -> UsageError:
        """Refusal of min-gamma where the infimum is zero."""
        first = (
            f"observer.objective: the least gamma at alpha = {float(alpha):g} is 0, with a gain that grows without bound; "
            "choose `bounds: {L1: ..}` or `objective: {gamma: ..}` from this table"
        )
        return UsageError(first, *(f"  |L1| <= {size:<8g} gamma = {gamma:.4g}" for size, gamma in rows))


def round_up(x: float, digits: int) -> float:
    """Smallest decimal of so many significant digits that is not below x."""
    return -round_down(-x, digits)


def bounded(bounds: Bounds, size: float) -> Bounds:
    """Bounds with another size of L1."""
    return replace(bounds, L1=rational_number(repr(size)))


def below(low: float, high: float, gamma: float, goal: float) -> float:
    """Next bound between one that is too small (0: none known) and one that will do."""
    if low:
        return math.sqrt(low * high)
    step = math.sqrt(gamma / goal)
    return high * min(max(step, 0.1), 0.8)


def searchable(family: L2) -> L2:
    """Same problem in doubles; where L2 is found, for f - K q."""
    return in_floats(family) if family.L2 is not None else in_floats(family).shifted()


def gain(values: Values) -> Array:
    """L1 = P^-1 Y."""
    return np.linalg.solve(values["P"], values["Y"])


def norm(values: Values, kind: str = "spectral") -> float:
    """Norm of L1, spectral or frobenius."""
    return float(np.linalg.norm(gain(values), 2 if kind == "spectral" else "fro"))


def significant(matrix: Array, digits: int) -> Array:
    """Doubles of so many significant decimal digits."""
    return np.vectorize(lambda x: float(f"{x:.{digits}g}") + 0.0, otypes=[float])(matrix)


def exact(decimals: Array) -> Array:
    """Rationals of doubles read as the shortest decimals that print them."""
    return rational(np.vectorize(lambda x: repr(float(x)), otypes=[object])(decimals))


def round_down(x: float, digits: int) -> float:
    """Largest decimal of so many significant digits that is not above x."""
    if x == 0:
        return 0.0
    with decimal.localcontext(prec=digits, rounding=decimal.ROUND_FLOOR):
        return float(+decimal.Decimal(x))
