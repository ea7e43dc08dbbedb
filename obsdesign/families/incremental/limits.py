"""The least gamma at one decay rate, over all gains and within bounds, and the level that is to be certified."""

import math
from collections.abc import Sequence
from typing import Any

from flint import fmpq

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.central import least_proved, proved
from obsdesign.dissipation.certificate import Certificate
from obsdesign.dissipation.decimals import round_up
from obsdesign.dissipation.elimination import LARGE, least_gamma
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import judged, norm, sized, unjudged, within
from obsdesign.dissipation.inequality import Incremental, Theorem
from obsdesign.dissipation.pace import Pace
from obsdesign.dissipation.zero import NEAR, Level, Noise, loudness, reached, settled, unbounded, vanishing
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families.incremental.decay import Point
from obsdesign.families.incremental.request import Request
from obsdesign.families.outcome import BEST_FOUND, bounded_kind
from obsdesign.lmi.formula import Array
from obsdesign.lmi.solve import Status
from obsdesign.records import dataclass

EASY = 2.0  # times the least gamma of a large plant, where gamma is not the objective
UNKNOWN = "the limit is not known, and may be far below the least gamma that is proved so"
SMALL = (
    "the least gamma is 0 but for rounding; that of the gains is a small share of the gamma of the widest margin, and "
    "`objective: {gamma: ..}` or `bounds` ask for another"
)
UNPROVED = "gains near the limit that was found fail in rationals"
FLAT = 1e-5  # relative difference of two gammas that are taken as equal


@dataclass(frozen=True)
class Limits:
    """What is asked, at which rates gamma is known, and what a user is told."""

    engine: Engine
    about: Theorem
    request: Request
    points: Sequence[Point]
    notes: list[str]
    noise: Noise  # of z, for gains L1

    @property
    def pace(self) -> Pace:
        """How the rate is told."""
        return self.about.pace

    def at(self, search: Incremental, rate: fmpq) -> tuple[dict[str, Any], Level | None]:
        """Least gamma over all gains, and over those within the bounds; the latter is None if there are none."""
        answer = unjudged(self.engine, search)
        if answer.status is Status.INFEASIBLE:
            return {}, None
        free = self.request.objective in {"feasibility", "max-alpha"}
        table = (zero := vanishing(self.engine, search, answer)).table
        answer = answer if table or zero.instead else judged(self.engine, search, answer)
        if answer.status is Status.OPTIMAL or table or zero.instead:
            level = Level.of_all(answer, zero)
            gap = {} if answer.gap is None else {"gap": round_up(answer.gap, 2)}
            known = {"gamma": level.gamma, "attained": level.attained, **gap, **self.kind(rate)}
            limits: dict[str, Any] = {"limit": self.best(known)}
        elif free or self.request.bounds.restricted:
            level, limits = Level(0.0), {"limit": {"attained": False}}
            if not free:
                self.notes.append(f"the least gamma over all gains was not found: {answer.reason}")
        else:
            said = f"neither gains nor a proof that there are none were found at {self.pace.said(rate)}"
            raise UndecidedError(f"{said}: {answer.reason}", id="OBS507")
        if not self.request.bounds.restricted:
            if table and self.request.objective in {"min-gamma", "pareto"}:
                raise self.refusal(search, rate, table)
            return self.attained(search, limits), level
        bounded = settled(self.engine, search, within(self.engine, search, self.request.bounds), self.request.bounds)
        if bounded.status is not Status.OPTIMAL:
            if table and self.request.bounds.L1 is None and bounded.status is Status.UNDECIDED:
                raise self.refusal(search, rate, table)
            return self.attained(search, limits), None
        level = Level.within(bounded, zero, self.request.bounds)
        kind = {**self.kind(rate), **bounded_kind(self.request.bounds)}
        limits, closed = self.attained(search, limits, level.gamma), self.request.bounds.closed
        return {**limits, "limit_bounded": self.best({"gamma": level.gamma, "attained": closed, **kind})}, level

    def refusal(self, search: Incremental, rate: fmpq, table: Sequence[tuple[float, float]]) -> UsageError:
        """Refusal of a limit of zero, with what larger gains do, and with the noise that they let through."""
        noise = loudness(self.engine, search, table, self.noise)
        return unbounded(self.pace.said(rate), table, noise, self.about.gain, self.about.feedback)

    def attained(self, search: Incremental, limits: dict[str, Any], bounded: float = math.inf) -> dict[str, Any]:
        """Limits with whether a finite gain attains the one over all gains, in samples, as far as doubles tell.

        In continuous time gains grow without bound as gamma comes near its infimum, unless v is kept from the error.

        `bounded`: least gamma within bounds.
        """
        gamma = limits["limit"].get("gamma")
        if not self.pace.sampled or not gamma:
            return limits
        finite = bounded <= gamma * (1 + NEAR) or reached(self.engine, search, gamma, self.request.bounds)
        return {**limits, "limit": {**limits["limit"], "attained": finite}}

    def best(self, limit: dict[str, Any]) -> dict[str, Any]:
        """Limit at one rate of a search; where it is the best that was found, the least of the whole curve."""
        least = min((p for p in self.points if "gamma" in p), key=lambda point: point["gamma"], default=None)
        if least is None or self.about.monotone or least["gamma"] * (1 + FLAT) >= limit["gamma"]:
            return limit
        return {**limit, "gamma": least["gamma"], "at": self.place(least["rate"])}

    def kind(self, rate: fmpq) -> dict[str, Any]:
        """Where the rate was searched: at which one a limit is; the best found, unless a lower rate has less."""
        found = {} if self.about.monotone else BEST_FOUND
        return {"at": self.place(rate), **found} if self.points else {}

    def place(self, rate: Any) -> dict[str, float]:
        """Alpha of a rate, or rho, by its key."""
        return {self.pace.key: float(self.pace.told(self.pace.found(float(rate))))}

    def target(self, search: Incremental, least: Level) -> float:
        """Gamma to be certified, within the slack of the limit; where the objective is not gamma, it is `moderate`."""
        bounds = self.request.bounds
        if self.request.gamma is not None:
            return float(self.request.gamma)
        if self.request.objective in {"feasibility", "max-alpha"}:
            if bounds.gamma is not None:
                return float(bounds.gamma)
            easy = max(self.moderate(search), least.instead or 0.0)
            least = max(least, Level(easy), key=lambda level: level.gamma)
        if least.attained:
            self.notes.append("a finite gain cancels the disturbance, so gamma can be as small as one likes")
        elif least.instead:
            self.notes.append(SMALL)
        return least.target(float(self.request.slack))

    def proved(self, family: Incremental, why: str) -> tuple[Certificate, dict[str, Any]] | None:
        """Central gain with its certificate, and the least gamma proved so as the limit: where nothing else tells.

        `family`: in rationals, at its rate; `why`: of that gain. None: none is proved, or more is bounded
        than gamma.
        """
        known: dict[str, Any] = {"attained": False}
        request, scales = self.request, dict[str, Array]()
        asked = request.gamma if request.gamma is not None else request.bounds.gamma
        target = float(asked) if asked is not None else 1.0  # without v any gamma will do
        if request.bounds.restricted or request.gains:
            return None
        if family.multiplier.unknowns() or (asked is None and family.plant.B.shape[1]):
            if (found := least_proved(self.engine, family, request.kept)) is None:
                return None
            least, scales = found
            known = {"gamma": least, "attained": False, **BEST_FOUND}
            if asked is None:
                free = request.objective == "feasibility"
                target = EASY * least if free else Level(least).target(float(request.slack))
        made = proved(self.engine, family, target, request.kept, scales)
        if made is None:
            return None
        self.engine.eliminated = True
        self.notes.append(f"the gain is the central one of a Riccati equation: {why}")
        return made, known

    def moderate(self, search: Incremental) -> float:
        """Least gamma of gains up to twice that of the solution of widest margin, or else the gamma of that one.

        Of large plants that is searched no more: `EASY` times the least gamma.
        """
        known = least_gamma(self.engine, search, self.request.bounds) if search.plant.n >= LARGE else None
        if known and known.objective > 0:
            return EASY * math.sqrt(known.objective)
        wide = self.engine.widest(search.witness(None, Bounds(poles=self.request.bounds.poles)))
        if wide.status is not Status.OPTIMAL:
            raise UndecidedError(f"no solution was found for {self.pace.said(search.rate)}: {wide.reason}", id="OBS507")
        size = 2 * norm(wide.values, self.request.bounds)
        answer = self.engine.minimise(search.least_gamma(sized(self.request.bounds, size)))
        level = answer.objective if answer.status is Status.OPTIMAL else wide.values["mu"].item()
        return math.sqrt(max(level, 0.0)) if search.plant.B.shape[1] else 1.0  # without a disturbance any gamma holds
