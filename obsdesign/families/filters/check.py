"""What is found of a filter before it runs: nothing that is proved."""

from obsdesign.dissipation.engine import Engine
from obsdesign.families.finding import Finding, finding
from obsdesign.spec import Spec

BESIDE = "`obsdesign compare` runs it beside an observer that is proved"


def check(spec: Spec, engine: Engine) -> list[Finding]:  # noqa: ARG001
    """That there is no guarantee."""
    said = f"{spec.observer.type}: no guarantee; nothing of its error is proved, whatever the weights are"
    return [finding("guarantee", False, said, advice=BESIDE, id="OBS505")]
