"""From a spec to an observer for sporadic measurements: by clock-dependent certificates, or by those of the paper."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families.outcome import BETTER, Outcome, Search, Verdict
from obsdesign.families.sporadic.clock.design import ClockDesigner
from obsdesign.families.sporadic.clock.tradeoff import ClockTradeoff
from obsdesign.families.sporadic.exponential import design_sporadic
from obsdesign.families.sporadic.request import RANGED, SporadicRequest, request_of
from obsdesign.families.sporadic.trade import trader
from obsdesign.lmi.formula import Array, Exact
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.spec import Spec

Problem = tuple[Plant[Exact], Multiplier, Array]
FALLBACK = "no storage function of the time left to the next measurement was found: the one of the paper serves"


def design(spec: Spec, engine: Engine) -> Outcome:
    """Design, or analyze, the observer that a spec asks for; the best of what its relaxations lead to."""
    request = request_of(spec)
    if request.trade and not request.gains:
        return trader(spec, engine, request.trade, design).outcome()
    made = [by(spec, part, engine) for part in request.parts()]
    return made[0] if len(made) == 1 else best(made, request)


def by(spec: Spec, request: SporadicRequest, engine: Engine) -> Outcome:
    """Outcome of relaxations of one kind; where clock-dependent certificates prove nothing, of the propositions."""
    problem = spec.augmented, spec.multiplier, spec.H
    if not request.clocked:
        return design_sporadic(*problem, request, engine)
    failed: UndecidedError | None = None
    made = None
    try:
        designer = ClockTradeoff if request.objective == "pareto" else ClockDesigner
        made = designer(*problem, request, engine).outcome()
    except UndecidedError as error:
        failed = error
    if made and (made.status is Verdict.CERTIFIED or made.diagnosis.get("condition") not in {None, "gains"}):
        return made
    instead = exponential(problem, request, engine)
    if instead:
        return replace(instead, notes=(*instead.notes, FALLBACK))
    if failed:
        raise failed
    assert made
    return made


def exponential(problem: Problem, request: SporadicRequest, engine: Engine) -> Outcome | None:
    """Certified outcome of the propositions for the same request; None if there is none."""
    older = request.older()
    if older is None or request.objective == "pareto":
        return None
    try:
        made = design_sporadic(*problem, older, engine)
    except (UndecidedError, UsageError):
        return None
    return made if made.status is Verdict.CERTIFIED else None


def best(made: Sequence[Outcome], request: SporadicRequest) -> Outcome:
    """Outcome with the best certified value of what is sought, with the curves of all."""
    searches = [outcome.search for outcome in made if outcome.search]
    certified = [outcome for outcome in made if outcome.status is Verdict.CERTIFIED]
    if not searches:
        name = RANGED.get(request.objective, "gamma")
        sense = BETTER[name]
        return max(certified, key=lambda made: sense * within(made).get(name, -sense * math.inf), default=made[0])
    curves = tuple(curve for search in searches for curve in search.curves)
    search = Search(searches[0].parameter, searches[0].points, curves=curves)
    least = min((within(outcome)["gamma"] for outcome in certified), default=math.inf) * (1 + float(request.slack))
    near = [outcome for outcome in certified if within(outcome)["gamma"] <= least]
    farthest = max(near, key=lambda outcome: outcome.limit["at"][search.parameter], default=made[0])
    return replace(farthest, search=search)


def within(outcome: Outcome) -> dict[str, Any]:
    """Limit within the bounds of the spec."""
    return {**outcome.limit, **outcome.limit_bounded}
