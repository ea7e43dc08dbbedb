"""What is found of a filter before it runs: nothing that is proved; of a stationary one whether it has a gain."""

from obsdesign.dissipation.engine import Engine
from obsdesign.errors import InfeasibleError
from obsdesign.families.filters.observer import STATIONARY, observer
from obsdesign.families.finding import Finding, finding
from obsdesign.spec import Spec

BESIDE = "`obsdesign compare` runs it beside an observer that is proved"


def check(spec: Spec, engine: Engine) -> list[Finding]:  # noqa: ARG001
    """That there is no guarantee, and no stationary gain where there is none."""
    said = f"{spec.observer.type}: no guarantee; nothing of its error is proved, whatever the weights are"
    found = [finding("guarantee", False, said, advice=BESIDE, id="OBS505")]
    if spec.observer.type == STATIONARY:
        try:
            observer(spec, spec.observer)  # type: ignore[arg-type]
        except InfeasibleError as error:
            found += [finding("riccati", False, p.message, decides=True, id=p.id) for p in error.problems]
    return found
