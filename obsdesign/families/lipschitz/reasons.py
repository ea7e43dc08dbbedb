"""Why there is no observer of a Lipschitz system, in the terms of the model, and what would be possible."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import inf, isfinite
from typing import Any

import numpy as np

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.elimination import least_gamma
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.pace import DECAY, Pace
from obsdesign.families.finding import enough, hidden_mode
from obsdesign.families.lipschitz.relaxations import RELAXATIONS, Lipschitz
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.families.lipschitz.suprema import ceiling, largest_constant, largest_for_gamma, theorem2
from obsdesign.families.outcome import Diagnosis
from obsdesign.families.reach import too_tight
from obsdesign.lmi.formula import identity, in_floats
from obsdesign.model.pencil import text
from obsdesign.tables.text import at_least, at_most

STATES = 12  # that are tried as measurements
ELSEWHERE = "; s-procedure and norm-bound need no such thing"


def gate(
    engine: Engine,
    unit: Lipschitz,
    request: LipschitzRequest,
    relaxation: str,
    tolerable: Callable[[float], bool] = bool,
) -> Diagnosis:
    """Answer that no gain will do, from closed forms where there are any; empty if nothing stands in the way.

    `engine`: solves for the limits that have no closed form; `unit`: the family for the constant 1, at the least rate
    that is asked for; `request`: objective and declared constants: max-lipschitz needs detectability only;
    `relaxation`: one of `RELAXATIONS`; `tolerable`: whether f may have no larger constant than one.
    """
    fixed = in_floats(unit)  # f = 0 is in the class
    found = hidden_mode(fixed.plant, fixed.multiplier.member, fixed.edge, fixed.about.pace)
    if found or request.objective == "max-lipschitz":
        return found
    declared = float(max(request.lipschitz))
    if relaxation == "abbaszadeh":
        found = without_constant(unit, declared, request.objective) or printed_theorems(engine, unit, declared)
    return found or too_large(engine, unit, request, relaxation, tolerable)


def without_constant(unit: Lipschitz, declared: float, objective: str) -> Diagnosis:
    """Answer that Theorem 3 divides by the constant; empty if it can. In Theorem 4 it is free."""
    if declared * in_floats(unit).lipschitz or objective != "min-gamma":
        return {}
    return {
        "id": "OBS608",
        "condition": "lipschitz",
        "reason": f"the Lipschitz constant of f is 0, and Theorem 3 divides by it{ELSEWHERE}",
        "lipschitz": {"asked": declared},
        "feasible": {},
        "suggestion": "look at relaxation s-procedure or norm-bound, or at a constant above 0",
    }


def printed_theorems(engine: Engine, unit: Lipschitz, declared: float) -> Diagnosis:
    """Answer that Theorems 3 and 4 have no solution for any constant; empty if they have."""
    h, best = in_floats(unit).seen, theorem2(engine, unit).value
    room = 2 * (1 - h) * best
    if h < 1 < room:
        return {}
    found = others(engine, unit, declared, "abbaszadeh")
    if h >= 1:
        return {
            "id": "OBS608",
            "condition": "sigma(H)",
            "reason": f"Theorems 3 and 4 need sigma(H) < 1, and it is {h**0.5:.8g}{ELSEWHERE}",
            "sigma_H": h**0.5,
            "relaxations": found,
            "feasible": {"sigma_H_below": 1.0},
            "suggestion": f"{instead(found)}, or look at a smaller H, in whose unit gamma is",
        }
    return {
        "id": "OBS608",
        "condition": "room",
        "reason": f"Theorems 3 and 4 need 2 (1 - sigma(H)^2) l > 1 for the l = {best:.8g} that Theorem 2 admits, "
        f"and it is {room:.8g}: they have no solution for any Lipschitz constant{ELSEWHERE}",
        "room": room,
        "relaxations": found,
        "feasible": {},
        "suggestion": instead(found),
    }


def too_large(
    engine: Engine, unit: Lipschitz, request: LipschitzRequest, relaxation: str, tolerable: Callable[[float], bool]
) -> Diagnosis:
    """Answer that the declared constant is not below the largest; empty if it is."""
    declared = float(max(request.lipschitz))
    if relaxation == "s-procedure" and least_gamma(engine, in_floats(unit).stretched(declared)):
        return {}  # scales with some gamma
    supremum = largest_for_gamma(engine, unit, relaxation)
    if declared < supremum.value:
        return {}
    most = ceiling(unit)
    form = f": {supremum.closed}" if supremum.closed else ""
    reason = f"the declared Lipschitz constant {declared:.8g} is not below {supremum.value:.8g}, the supremum of "
    found: Diagnosis = {
        "id": "OBS607",
        "condition": "lipschitz",
        "reason": f"{reason}{relaxation} over all gains{form}",
        "lipschitz": {"asked": declared, "supremum": supremum.value},
        "feasible": {"lipschitz_below": supremum.value},
    }
    if most is not None and declared > most:
        found["reason"] += f"; above {at_most(most, 8)} a linear f hides a mode, and no gain of any method can do it"
        found["ceiling"] = most
    rivals = others(engine, unit, declared, relaxation)
    hints = [f"look at a constant below {at_least(supremum.value, 8)}"] if tolerable(supremum.value) else []
    hints += measured(engine, unit, request, relaxation)
    if rivals:
        found["relaxations"] = rivals
        hints.insert(0, instead(rivals))
    eased = largest_for_gamma(engine, replace(unit, rate=0 * unit.rate), relaxation).value if unit.rate else 0.0
    if eased > declared:
        pace = unit.about.pace
        at_rest = f" (for {pace.told(0)} the supremum is {eased:.8g})" if isfinite(eased) else ""
        hints.append(f"look at {pace.weaker}{at_rest}")
    return {**found, "suggestion": ", or ".join(hints) or "f has a larger constant, and one more state will not do"}


def measured(engine: Engine, unit: Lipschitz, request: LipschitzRequest, relaxation: str) -> list[str]:
    """State that would do if it were measured as well, with the supremum then; nothing if none of the first does."""
    p, seen = unit.plant, identity(unit.plant.n, unit.plant.A)
    shown = (p.A, p.Bf, p.B) if request.filtered else (seen, 0 * p.Bf, 0 * p.B)  # of the state, in C, Df and D
    for i in range(min(p.n, STATES)):
        C, Df, D = (np.vstack([X, row[i : i + 1]]) for X, row in zip((p.C, p.Df, p.D), shown, strict=True))
        more = replace(unit, plant=replace(p, C=C, Df=Df, D=D), L2=0 * (p.Cq @ C.mT))
        supremum = largest_for_gamma(engine, more, relaxation).value
        if supremum > float(max(request.lipschitz)):
            said = f"the supremum is {supremum:.8g}" if isfinite(supremum) else "every constant will do"
            return [f"look at {p.states[i]} as another measurement, with which {said}"]
    return []


def others(engine: Engine, unit: Lipschitz, declared: float, relaxation: str) -> dict[str, dict[str, Any]]:
    """Limits of the tighter relaxations that admit the declared constant, the loosest first."""
    tighter = reversed(RELAXATIONS[: RELAXATIONS.index(relaxation)])
    limits = {name: largest_constant(engine, unit, name).value for name in tighter}
    return {
        name: {"unbounded": True} if limit == inf else {"lipschitz_below": limit}
        for name, limit in limits.items()
        if limit > declared
    }


def instead(relaxations: dict[str, dict[str, Any]]) -> str:
    """Suggestion of these relaxations."""
    if not relaxations:
        return "no other relaxation admits the declared constant"
    named = [
        f"{name} ({'any constant' if 'unbounded' in found else 'up to {:.8g}'.format(found['lipschitz_below'])})"
        for name, found in relaxations.items()
    ]
    return f"look at relaxation {' or '.join(named)}"


def out_of_reach(levels: dict[str, float], lipschitz: float, slower: str = "", *, exact: bool = True) -> Diagnosis:
    """Answer that gamma is bounded below what is possible.

    `levels`: of gamma, what is asked and the least, over all gains and if there are bounds within them; `slower`: a
    decay or rho at which it is possible, in words; `exact`: whether the bounds leave the problem convex.
    """
    asked, least = levels["asked"], levels["least"]
    return {
        "id": "OBS604",
        "condition": "gamma",
        "reason": f"gamma at most {asked:g} was asked for, and the least is {least:.6g} for the constant {lipschitz:g}",
        "gamma": levels,
        "feasible": {"gamma": least},
        "suggestion": enough(least, levels.get("bounded"), exact=exact) + (f", or ask for {slower}" if slower else ""),
    }


def too_small(
    bounds: Bounds,
    pace: Pace = DECAY,
    rate: float = 0.0,
    size: float | None = None,
    slower: float | None = None,
    gamma: float | None = None,
    wider: Mapping[str, tuple[float, str]] | None = None,
) -> Diagnosis:
    """Answer that nothing within the bounds on L and P, and on the poles, was found.

    `pace`, `rate`: the decay that is asked for; `size`: a bound on |L| that will do, with a larger `gamma` if there is
    one; `slower`: a rate for which these do; `wider`: what does for the poles.
    """
    asked = {"L": bounds.L1, "P.min": bounds.floor}
    enough = {"L": (size, "allow |L| up to")} if size and not gamma else {}
    if slower is not None:
        end = "least" if pace.sampled else "most"
        enough[pace.key] = pace.told(slower), f"within the bounds ask for {pace.key} at {end}"
    enough |= wider or {}
    together = f"allow |L| up to {size or 0:g} and gamma up to {gamma or 0:g}, with which there is one"
    hints = [together] if size and gamma else []
    found = too_tight(bounds.words("L"), f"for {pace.said(rate)}", enough, hints)
    return {**found, "bounds": {name: float(bound) for name, bound in asked.items() if bound is not None}}


def useless(family: Lipschitz, declared: float, tolerated: float | None) -> Diagnosis:
    """Answer that given gains achieve nothing: too slow without f, or not proved for the declared constant.

    `family`: the problem with the gains; `declared`, `tolerated`: the largest declared constant, and the largest that
    the gains were proved to tolerate, if there is one.
    """
    fixed = in_floats(family)
    pole = fixed.slowest_pole()
    pace, actual = fixed.about.pace, fixed.edge.of(pole)
    slow = fixed.edge.slow(pole)
    if slow:
        short = f"too slow for {pace.said(fixed.rate)}" if actual > 0 else "and does not decay"
        reason = f"without f the slowest pole of the error is {text(pole)}, {short}"
    else:
        reason = f"no storage function was found that proves these gains for the Lipschitz constant {declared:g}"
    smaller = not slow and tolerated
    return {
        "id": "OBS609",
        "condition": "gains",
        "reason": reason,
        "pole": [pole.real, pole.imag],
        "feasible": {"lipschitz": tolerated} if smaller else {pace.bound: pace.told(actual)} if actual > 0 else {},
        "suggestion": (f"declare a constant up to {at_least(tolerated)}, or " if smaller else "")
        + "look at new gains: leave `gains` out",
    }
