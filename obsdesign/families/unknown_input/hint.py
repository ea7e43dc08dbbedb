"""What an unknown-input observer could do for specs of other families."""

from flint import fmpq

from obsdesign.families.finding import Finding, finding
from obsdesign.families.unknown_input import transform
from obsdesign.families.unknown_input.request import why_not
from obsdesign.model.edge import Edge
from obsdesign.model.frozen import hidden
from obsdesign.spec import Spec


def hint(spec: Spec) -> list[Finding]:
    """That an exact observer exists which cancels channels of w, or with f that ranks and zeros admit one."""
    if not spec.generator.direct:
        return []
    plant = spec.augmented
    able = [k for k in range(plant.B.shape[1]) if plant.B[:, k].any() and not why_not(plant, k)]
    E = transform.chosen(plant, able) if able else None
    if E is None:
        return []
    left, rest = transform.remaining(plant, able, E), Edge(fmpq(0), spec.period is not None)
    if hidden(left, spec.multiplier, rest):
        return []
    names = ", ".join(spec.plant.exogenous[k] for k in able)
    said = f"an exact unknown-input observer exists that cancels {names}"
    if plant.Bf.shape[1]:
        said = f"ranks and zeros admit an exact unknown-input observer that cancels {names}"
    return [finding("unknown input", True, f"{said}: observer.type: unknown-input", cancels=names, id="OBS953")]
