"""The steps of one design."""

from dataclasses import dataclass, replace

from flint import fmpq

from obsdesign.design.engine import Engine
from obsdesign.design.lipschitz.attenuation import least_gamma
from obsdesign.design.lipschitz.compare import compared
from obsdesign.design.lipschitz.largest import largest
from obsdesign.design.lipschitz.limits import ceiling
from obsdesign.design.lipschitz.outcome import LipschitzDesign
from obsdesign.design.lipschitz.pareto import scanned, weighed
from obsdesign.design.lipschitz.study import Study
from obsdesign.design.lipschitz.tolerance import gamma_of, largest_of
from obsdesign.lmi.formula import Array, printed
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.observers.lipschitz import Lipschitz, proportions
from obsdesign.observers.request import LipschitzRelaxation, LipschitzRequest, Range, require_agreement


@dataclass(frozen=True)
class Designer:
    """From a request to its outcome; the plant and H in rationals."""

    plant: Plant
    multiplier: Multiplier
    H: Array
    request: LipschitzRequest
    engine: Engine

    def outcome(self) -> LipschitzDesign:
        """Design of the relaxation, or of each of them side by side."""
        require_agreement(self.request)
        relaxation = self.request.relaxation
        made = compared(self.of) if relaxation == "compare" else self.of(relaxation)
        return replace(made, ceiling=ceiling(self.unit) if len(self.decays) == 1 else None)

    @property
    def decays(self) -> tuple[fmpq, ...]:
        """Decays, as a file holds them."""
        decay = self.request.decay
        return tuple(map(printed, decay.grid() if isinstance(decay, Range) else (decay,)))

    @property
    def unit(self) -> Lipschitz:
        """S-procedure for the constant 1 at the least decay."""
        return Lipschitz.of(self.plant, self.multiplier, proportions(self.request.lipschitz), self.H, self.decays[0])

    def of(self, relaxation: LipschitzRelaxation) -> LipschitzDesign:
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
            return LipschitzDesign("infeasible", diagnosis=blocked)
        return {"max-lipschitz": largest, "min-gamma": least_gamma, "pareto": weighed}[request.objective](study)
