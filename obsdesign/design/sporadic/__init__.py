"""From a request for an observer with sporadic measurements to certified gains.

The limit is the infimum of gamma over all gains, or the supremum of T2 or of the decay. It is not attained as a rule
(the gain grows without bound), so that the gains are those of the smallest |L| within the slack of it, rounded to few
digits, and the guarantee is proved for the rounded ones, with a delta of its own.
"""

from obsdesign.design.engine import Engine
from obsdesign.design.sporadic.designer import Designer, SporadicDesign
from obsdesign.lmi.formula import Array
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.observers.request import SporadicRequest

__all__ = ["SporadicDesign", "design_sporadic"]


def design_sporadic(
    plant: Plant, multiplier: Multiplier, H: Array, request: SporadicRequest, engine: Engine
) -> SporadicDesign:
    """Design, or analyze, an observer for sporadic measurements.

    Parameters
    ----------
    plant, multiplier, H
        The problem, in rationals: D = 0 and Df = 0; z = H e.
    request
        T1, T2, decay, delta, injections, relaxations, objective, bounds, and gains to be analyzed.
    engine
        Solver, report of progress, and the count of solves.

    Raises
    ------
    UsageError
        The measurement has a direct term, T1 > T2, a range of delta that its relaxation cannot use, gains of the wrong
        shape, a relaxation of another injection, or min-gamma without a disturbance.
    UndecidedError
        The solver found neither a solution nor that there is none.
    """
    return Designer(plant, multiplier, H, request, engine).outcome()
