"""From a spec to certified gains: limit, smallest gain, rounding, proof.

The limit is the infimum of the objective over all gains. It is not attained as a rule (P becomes singular and the gain
unbounded), so the gains are those of the smallest norm within the slack of it, rounded to few digits, and the
guarantee is proved for the rounded ones.
"""

import time
from dataclasses import replace

import numpy as np

from obsdesign.dissipation.engine import Engine, Report
from obsdesign.errors import UndecidedError
from obsdesign.families.incremental.design import Design, design_incremental
from obsdesign.families.lipschitz.design import design_lipschitz
from obsdesign.families.lipschitz.outcome import LipschitzDesign
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.families.sporadic.design import SporadicDesign, design_sporadic
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.spec import Spec

__all__ = ["Design", "LipschitzDesign", "SporadicDesign", "design"]


def design(
    spec: Spec, solver: str = "clarabel", report: Report = lambda *_: None
) -> Design | LipschitzDesign | SporadicDesign:
    """Design, or analyse, the observer that a spec asks for.

    Raises
    ------
    UsageError
        What is asked makes no sense for the family, or nothing bounds a gain that would grow without end.
    UndecidedError
        The solver found neither a solution nor that there is none.
    """
    started = time.perf_counter()
    engine = Engine(solver, report)
    try:
        made = made_for(spec, engine)
    except (OverflowError, ZeroDivisionError, np.linalg.LinAlgError) as error:
        raise UndecidedError(f"the numbers of {spec.path} are beyond what doubles can compute: {error}") from None
    return replace(made, solves=engine.solves, time_s=time.perf_counter() - started)


def made_for(spec: Spec, engine: Engine) -> Design | LipschitzDesign | SporadicDesign:
    """Outcome of the family that a spec asks for."""
    if isinstance(spec.observer, SporadicRequest):
        return design_sporadic(spec.augmented, spec.multiplier, spec.H, spec.observer, engine)
    if isinstance(spec.observer, LipschitzRequest):
        return design_lipschitz(spec.augmented, spec.multiplier, spec.H, spec.observer, engine)
    return design_incremental(spec, engine)
