"""Objective max-lipschitz: the largest constant, and a small gain that nearly tolerates it."""

import math
from collections.abc import Iterator
from typing import Any

from flint import fmpq

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.decimals import round_down
from obsdesign.dissipation.gain import ROOM, bounded, descended, rounded_gains
from obsdesign.dissipation.zero import TABLE, tabulated
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families.lipschitz.claim import Claim
from obsdesign.families.lipschitz.study import Study
from obsdesign.families.lipschitz.suprema import largest_constant
from obsdesign.families.outcome import Outcome, bounded_kind
from obsdesign.lmi.formula import Array, printed, rational_number
from obsdesign.lmi.solve import Status
from obsdesign.tables.text import at_least, at_most

DIGITS = 6  # of a shipped constant


def largest(study: Study) -> Outcome:
    """Design for the largest constant within the bounds, and a gamma that its gain has."""
    supremum = largest_constant(study.engine, study.unit, study.relaxation)
    limits: dict[str, Any] = {"limit": {"lipschitz": supremum.value, "attained": supremum.attained}}
    best = supremum.value
    if study.restricted:
        found = bounded(study.stretch().least, study.bounds)
        if found.status is not Status.OPTIMAL:
            decided = found.status is Status.INFEASIBLE
            return study.out_of_bounds(lambda study: study.stretch().least, decided=decided, **limits)
        best = study.stretch().constant(found)
        limits["limit_bounded"] = {"lipschitz": best, "attained": study.closed, **bounded_kind(study.bounds)}
    if best == math.inf:
        raise unlimited(study)
    constant = printed(round_down(best / (1 + study.slack), DIGITS))
    notes = () if constant >= study.declared else (short(study, constant),)
    central = study.central_for(constant)
    notes = notes if central is None else (*notes, central[2])
    L, claim = central[:2] if central else study.first(small_gains(study, constant))
    if L is None:
        raise UndecidedError(f"no gain was found for the Lipschitz constant {float(constant):g}", id="OBS507")
    return study.outcome(L, claim, notes=notes, **limits)


def small_gains(study: Study, constant: fmpq) -> Iterator[tuple[Array, Claim | None]]:
    """Gains of small norm for a constant, in more and more digits, and their proofs."""
    stretch = study.stretch()
    wide = stretch.feasible(float(constant), study.request.placed)
    if wide.status is not Status.OPTIMAL:
        return
    goal = float(constant) * (1 + ROOM)
    for values in descended(stretch.reaching(goal), stretch.objective(goal), wide.values, study.bounds):
        for L1 in rounded_gains(values, study.bounds):
            yield -L1, study.proved(-L1, constant)


def short(study: Study, constant: fmpq) -> str:
    """Warning that the constant of f is beyond what is certified, and what may help."""
    hints = [f"ask for {study.unit.about.pace.weaker}"] if study.unit.rate else []
    hints += ["allow a larger gain"] if study.restricted else []
    hints += ["try relaxation s-procedure"] if study.relaxation != "s-procedure" else []
    return (
        f"warning: the Lipschitz constant {at_least(constant)} that is reached is below the declared "
        f"{at_most(study.declared)}: this f is not covered; it may help to "
        + ", or ".join([*hints, "measure more states"])
    )


def unlimited(study: Study) -> UsageError:
    """Refusal where the constant grows without end, with the gain or without."""
    stretch = study.stretch()
    rows = []
    for size in TABLE:
        answer = stretch.least(Bounds(L1=rational_number(str(size))))
        if answer.status is Status.OPTIMAL and stretch.constant(answer) < math.inf:
            rows.append((size, stretch.constant(answer)))
    return tabulated(
        "there is no largest Lipschitz constant: it grows without bound with the gain; choose "
        "`bounds: {L: ..}` from this table, or objective min-gamma",
        "L",
        "lipschitz",
        rows,
    )
