"""From a request for an observer of a Lipschitz system to certified gains.

The limit is the supremum of the Lipschitz constant, or the infimum of gamma or of a weighted sum, over all gains. It is
not attained as a rule (P becomes singular and the gain unbounded), so that the gains are those of the smallest |L|
within the slack of it, rounded to few digits. What is proved of the rounded ones is the s-procedure, which every
relaxation implies.
"""

from dataclasses import dataclass, replace

from flint import fmpq

from obsdesign.dissipation.bounds import Range, require_agreement
from obsdesign.dissipation.engine import Engine
from obsdesign.families.lipschitz.compare import compared
from obsdesign.families.lipschitz.given_gains import gamma_of, largest_of
from obsdesign.families.lipschitz.max_lipschitz import largest
from obsdesign.families.lipschitz.min_gamma import least_gamma
from obsdesign.families.lipschitz.pareto import scanned, weighed
from obsdesign.families.lipschitz.relaxations import Lipschitz, proportions
from obsdesign.families.lipschitz.request import LipschitzRelaxation, LipschitzRequest, request_of
from obsdesign.families.lipschitz.study import Study
from obsdesign.families.lipschitz.suprema import ceiling
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.lmi.formula import Array, Exact, printed
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.spec import Spec


@dataclass(frozen=True)
class Designer:
    """From a request to its outcome; the plant and H in rationals."""

    plant: Plant[Exact]
    multiplier: Multiplier
    H: Array
    request: LipschitzRequest
    engine: Engine

    def outcome(self) -> Outcome:
        """Design of the relaxation, or of each of them side by side."""
        require_agreement(self.request)
        relaxation = self.request.relaxation
        if relaxation == "compare":
            return compared(self.bounded, bool(self.plant.B.shape[1]))
        return self.bounded(relaxation)

    def bounded(self, relaxation: LipschitzRelaxation) -> Outcome:
        """Outcome of one relaxation, and the constant that no gain can exceed."""
        made = self.of(relaxation)
        most = ceiling(self.unit) if len(self.decays) == 1 else None
        return made if most is None else replace(made, beyond={**made.beyond, "ceiling": most})

    @property
    def decays(self) -> tuple[fmpq, ...]:
        """Decays, as a file holds them."""
        decay = self.request.decay
        return tuple(map(printed, decay.grid() if isinstance(decay, Range) else (decay,)))

    @property
    def unit(self) -> Lipschitz:
        """S-procedure for the constant 1 at the least decay."""
        return Lipschitz.of(self.plant, self.multiplier, proportions(self.request.lipschitz), self.H, self.decays[0])

    def of(self, relaxation: LipschitzRelaxation) -> Outcome:
        """Outcome of one relaxation."""
        request, weight = replace(self.request, relaxation=relaxation), self.request.weight
        require_agreement(request)
        study = Study(self.engine, self.unit, request)
        if isinstance(weight, Range) or isinstance(request.decay, Range):
            weights = weight.grid() if isinstance(weight, Range) else (weight or fmpq(0),)
            return scanned(study, weights, self.decays)
        if request.gains:
            L = printed(request.gains["L"])
            return (largest_of if request.objective == "max-lipschitz" else gamma_of)(study, L)
        blocked = study.obstacle()
        if blocked:
            return Outcome(Verdict.INFEASIBLE, diagnosis=blocked)
        return {"max-lipschitz": largest, "min-gamma": least_gamma, "pareto": weighed}[request.objective](study)


def design_lipschitz(
    plant: Plant[Exact], multiplier: Multiplier, H: Array, request: LipschitzRequest, engine: Engine
) -> Outcome:
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


def design(spec: Spec, engine: Engine) -> Outcome:
    """Design, or analyze, the observer that a spec asks for."""
    return design_lipschitz(spec.augmented, spec.multiplier, spec.H, request_of(spec), engine)
