"""From a request for an observer of a Lipschitz system to certified gains.

The limit is the supremum of the Lipschitz constant, or the infimum of gamma or of a weighted sum, over all gains. It is
not attained as a rule (P becomes singular and the gain unbounded), so that the gains are those of the smallest |L|
within the slack of it, rounded to few digits. What is proved of the rounded ones is the s-procedure, which every
relaxation implies.
"""

from obsdesign.design.engine import Engine
from obsdesign.design.lipschitz.designer import Designer
from obsdesign.design.lipschitz.outcome import LipschitzDesign
from obsdesign.lmi.formula import Array
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.observers.request import LipschitzRequest

__all__ = ["LipschitzDesign", "design_lipschitz"]


def design_lipschitz(
    plant: Plant, multiplier: Multiplier, H: Array, request: LipschitzRequest, engine: Engine
) -> LipschitzDesign:
    """Design, or analyze, an observer of a Lipschitz system.

    Parameters
    ----------
    plant, multiplier, H
        The problem, in rationals: Dqf = 0, Dq = 0 and Df = 0; z = H e. Of the multiplier only the sizes of its blocks
        matter: their constants are those of the request.
    request
        Relaxation, objective, decay, weight, bounds, and gains to be analyzed.
    engine
        Solver, report of progress, and the count of solves.

    Raises
    ------
    UsageError
        The limit is infinite, or that of gamma zero, and nothing bounds the gain; bounds that an objective does not
        know; pareto with gains; compare with a range.
    UndecidedError
        The solver found neither a solution nor that there is none.
    """
    return Designer(plant, multiplier, H, request, engine).outcome()
