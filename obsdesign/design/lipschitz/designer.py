"""The steps of one design."""

from dataclasses import dataclass, replace

import numpy as np
from flint import fmpq

from obsdesign.design.engine import Engine
from obsdesign.design.lipschitz.attenuation import least_gamma
from obsdesign.design.lipschitz.compare import compared
from obsdesign.design.lipschitz.largest import largest
from obsdesign.design.lipschitz.limits import ceiling
from obsdesign.design.lipschitz.outcome import LipschitzDesign
from obsdesign.design.lipschitz.pareto import scanned, weighed
from obsdesign.design.lipschitz.reasons import gate
from obsdesign.design.lipschitz.study import Study
from obsdesign.design.lipschitz.tolerance import gamma_of, largest_of
from obsdesign.errors import UsageError
from obsdesign.lmi.formula import Array, printed, rational
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.observers.lipschitz import Lipschitz, lipschitz_multiplier, proportions
from obsdesign.observers.request import LipschitzRequest, Range


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
        refuse(self.request)
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
        sizes = [(block.nq, block.nf) for block in self.multiplier.blocks]
        scaled = lipschitz_multiplier(proportions(self.request.lipschitz), sizes)
        absent = rational(np.zeros((len(self.plant.Cq), len(self.plant.C))))
        return Lipschitz(self.plant, scaled, self.H, self.decays[0], L2=absent)

    def of(self, relaxation: str) -> LipschitzDesign:
        """Outcome of one relaxation."""
        request, weight = self.request, self.request.weight
        study = Study(self.engine, self.unit, request, relaxation)
        if isinstance(weight, Range) or isinstance(request.decay, Range):
            weights = weight.grid() if isinstance(weight, Range) else (weight or fmpq(0),)
            return scanned(study, weights, self.decays)
        if request.gains:
            L = printed(request.gains["L"])
            return (largest_of if request.objective == "max-lipschitz" else gamma_of)(study, L)
        blocked = gate(self.engine, study.unit, request, relaxation)
        if blocked:
            return LipschitzDesign("infeasible", diagnosis=blocked)
        return {"max-lipschitz": largest, "min-gamma": least_gamma, "pareto": weighed}[request.objective](study)


def refuse(request: LipschitzRequest) -> None:
    """Refuse what does not go together."""
    if request.objective != "pareto":
        return
    if request.gains:
        raise UsageError("observer.gains: pareto designs gains; analyze given ones with max-lipschitz or min-gamma")
    if request.bounds.gamma is not None:
        raise UsageError("observer.bounds.gamma: pareto weighs gamma; bound it with min-gamma, or choose a weight")
    if request.relaxation == "compare" and (isinstance(request.weight, Range) or isinstance(request.decay, Range)):
        raise UsageError("observer.relaxation: compare takes one weight and one decay")
