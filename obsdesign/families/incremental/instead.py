"""What would do where a design is impossible: tried against the whole request, its level and bounds, before it is said.

A `Decay` holds what is asked: the family, the bounds and, as the bound on gamma, the level.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from flint import fmpq

from obsdesign.dissipation.decimals import round_up
from obsdesign.dissipation.gain import ROOM, excluded, least, least_size, searchable, unplaced
from obsdesign.errors import UsageError
from obsdesign.families.finding import smaller_class
from obsdesign.families.incremental.absence import CLOSE, LARGE, impossible, within_bounds
from obsdesign.families.incremental.decay import Decay
from obsdesign.families.incremental.extent import largest_class
from obsdesign.families.incremental.stiffness import QUIET
from obsdesign.families.outcome import Diagnosis
from obsdesign.families.poles import BOUND, eased, endless
from obsdesign.families.reach import too_tight
from obsdesign.lmi.formula import printed
from obsdesign.model.multiplier import Multiplier
from obsdesign.spec import Spec

MORE = 0.05  # relative, above the least gamma over all gains, of a level that is tried with larger gains


def beyond(decay: Decay, rate: fmpq, limit: float | None, reached: float | None) -> tuple[bool, Diagnosis]:
    """Answer that nothing within bounds was found at a rate, and whether that is decided.

    `limit`: least gamma over all gains, if it is known; `reached`: least gamma within the bounds, which is too large.
    """
    bounds, level = decay.bounds, None if decay.bounds.gamma is None else float(decay.bounds.gamma)
    search = searchable(replace(decay.family, rate=rate))
    solve = least(decay.engine, search)
    above = level is not None and limit is not None and limit > level
    raised = round_up(limit * (1 + MORE), 4) if above and limit else level
    size = least_size(solve, bounds, np.inf if raised is None else (raised * (1 - ROOM)) ** 2)
    slower, enough, hints, name = decay.largest_below(rate), {}, [], decay.family.about.gain
    if size and above:
        hints = [f"allow |{name}| up to {size:g} and ask for gamma at least {raised:g}, with which there is one"]
    elif size:
        enough[name] = size, f"allow |{name}| up to"
    inside = "within the bounds ask for"
    if reached:
        enough["gamma"] = round_up(reached * (1 + CLOSE), 4), f"{inside} gamma at least"
    if slower:
        pace, side = decay.pace, "least" if decay.pace.sampled else "most"
        enough[pace.key] = pace.told(pace.rounded(slower * (1 - CLOSE), 4)), f"{inside} {pace.key} at {side}"
    enough |= eased(bounds, lambda wider: replace(decay, bounds=wider).feasible(rate)[0])
    steep = endless(decay.family, bounds.poles)
    hints += [BOUND] if steep else []
    where = f"at {decay.pace.said(rate)}" + ("" if level is None else f" for gamma = {level:g}")
    found = too_tight(bounds.words(name), where, enough, hints)
    if size and above:
        found["feasible"]["together"] = {name: size, "gamma": raised}
    found["reason"] += f"; {steep}" if steep else ""
    goal = np.inf if level is None else level**2
    return above or excluded(solve, bounds, goal) or unplaced(decay.engine, search, bounds), found


def remedied(spec: Spec, decay: Decay, rate: fmpq, largest: float | None, diagnosis: Diagnosis) -> Diagnosis:
    """Diagnosis with what was tried and would do: other noise where that is in the way, and a smaller class of f."""
    if decay.family.plant.n >= LARGE:
        return diagnosis
    within = within_bounds(spec)
    quiet = diagnosis["suggestion"] == QUIET
    hints = list(quieter(decay, rate, largest, within)) if quiet else [diagnosis["suggestion"]]

    def feasible(multiplier: Multiplier) -> bool:
        return solvable(replace(decay, family=replace(decay.family, multiplier=multiplier)), rate)

    found = {**largest_class(spec, feasible), "within": within}
    if "nonlinearity" in found:
        hints.append(smaller_class(spec.nonlinearities, found, decay.pace.key))
        more = {**diagnosis["feasible"], **found["feasible"]}
        diagnosis = {**diagnosis, "nonlinearity": found["nonlinearity"], "within": within, "feasible": more}
    if quiet and largest:
        diagnosis = {**diagnosis, "feasible": {**diagnosis["feasible"], decay.pace.key: decay.pace.told(largest)}}
    others = "D = 0 and `L2: free`" if decay.family.about.feedback else "and D = 0"
    return {**diagnosis, "suggestion": "; ".join(hints) or f"{decay.pace.weaker}, {others} will not do{within}"}


def quieter(decay: Decay, rate: fmpq, largest: float | None, within: str) -> Iterator[str]:
    """What would do where noise in y forbids the injection that a steep f needs.

    `largest`: the largest rate with a solution, if one was found.
    """
    if largest and solvable(decay, decay.pace.found(largest)):
        yield f"ask for {decay.pace.slower(largest * (1 - CLOSE))}, with which there is a solution{within}"
    plant = decay.family.plant
    silent = replace(decay.family, plant=replace(plant, D=printed(np.zeros(plant.D.shape))))
    free = [(replace(silent, L2=None), " with `L2: free`")] if silent.about.feedback else []
    for family, words in ((silent, ""), *free):
        if solvable(replace(decay, family=family), rate):
            yield f"leave noise out of y (D = 0){words}, with which there is a solution{within}"
            return


def solvable(decay: Decay, rate: fmpq) -> bool:
    """Whether there is a solution: a solver finds one, and it is not proved that there is none.

    None where the class does not allow a free L2.
    """
    family = replace(decay.family, rate=rate)
    try:
        return decay.feasible(rate)[0] and not impossible(family)
    except UsageError:
        return False
