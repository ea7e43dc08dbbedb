"""What is found of a filter before it runs: nothing that is proved."""

from obsdesign.dissipation.engine import Engine
from obsdesign.families.finding import Finding, finding
from obsdesign.spec import Spec


def check(spec: Spec, engine: Engine) -> list[Finding]:  # noqa: ARG001
    """That there is no guarantee."""
    said = f"{spec.observer.type}: no guarantee; nothing of its error is proved, whatever the weights are"
    return [finding("guarantee", False, said, decides=False, id="OBS505")]
