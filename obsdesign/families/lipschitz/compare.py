"""Relaxation compare: every relaxation of one request, side by side."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families.lipschitz.claim import Claim
from obsdesign.families.lipschitz.relaxations import RELAXATIONS
from obsdesign.families.lipschitz.request import LipschitzRelaxation
from obsdesign.families.outcome import Outcome, Verdict, finite
from obsdesign.lmi.formula import approximate


def compared(design: Callable[[LipschitzRelaxation], Outcome], disturbed: bool) -> Outcome:
    """Design of the tightest relaxation that has one, with a row for each.

    `design`: outcome of a relaxation; `disturbed`: whether there is a w. Raises `UsageError` or `UndecidedError`: no
    relaxation has a design, and for this one that is not because there is none.
    """
    rows, outcomes, notes = [], [], []
    error: UsageError | UndecidedError | None = None
    for relaxation in RELAXATIONS:
        try:
            made = design(relaxation)
        except (UsageError, UndecidedError) as raised:
            error = error or raised
            status = "refused" if isinstance(raised, UsageError) else "undecided"
            said = [" ".join(problem.message.split()) for problem in raised.problems]
            rows.append({"relaxation": relaxation, "status": status, "reason": said[0]})
            notes.append(f"{relaxation} is {status}: {'; '.join(said)}")
            continue
        outcomes.append(made)
        rows.append(row(relaxation, made, disturbed))
    best = next((made for made in outcomes if made.status is Verdict.CERTIFIED), None)
    if best is None and error:
        raise error
    made = best or outcomes[0]
    return replace(made, beyond={**made.beyond, "comparison": rows}, notes=(*made.notes, *notes))


def row(relaxation: str, made: Outcome, disturbed: bool) -> dict[str, Any]:
    """What became of one relaxation; without w its gamma means nothing."""
    found: dict[str, Any] = {"relaxation": relaxation, "status": str(made.status), "limit": finite(made.limit)}
    if isinstance(made.claim, Claim):
        found["certified"] = {
            "lipschitz": approximate(made.claim.lipschitz),
            **({"gamma": approximate(made.claim.certificate.gamma)} if disturbed else {}),
            "L": float(np.linalg.norm(made.gains["L"], 2)),
        }
    if made.diagnosis:
        found["reason"] = made.diagnosis["reason"]
    return found
