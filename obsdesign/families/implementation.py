"""Whether an observer is stable in the steps of its `implementation`, as far as frozen members of the class show it."""

from collections.abc import Mapping
from typing import Any

from obsdesign.spec import Spec
from obsdesign.tables.text import at_least
from obsdesign.trial import Implementation

NUMERICAL = "every f = K q of the class that was tried; computed, not proved"


def remark(spec: Spec, analysis: Mapping[str, Any], *, proved: bool) -> str | None:
    """Note on the steps of a spec, held against the largest that were found; None where there are none to be held.

    Between measurements at instants an observer goes as its plant does, and its steps leave nothing to diverge.
    `proved`: whether what is imposed on a design is.
    """
    steps = spec.implementation
    if steps is None or (steps.impose and proved) or not {"worst_pole", "largest_step"} <= analysis.keys():
        return None
    return f"implementation: {said(steps, analysis['largest_step'], analysis['worst_pole'])}"


def said(steps: Implementation, largest: Mapping[str, float | None], worst: list[float] | None) -> str:
    """The same in words.

    `largest`: step in s by method; None: not bounded where `worst`, the slowest pole, is known, or else not known.
    """
    h, method = float(steps.period), steps.method
    if worst is None:
        return (
            f"no largest step is known for {method}: the slopes of f have no upper bound, so that no step is short "
            "enough for all of them; bound them, on a region if need be, or try runs in steps, simulation.observer: "
            "implementation"
        )
    if worst[0] >= 0:
        return "no step is short enough: an f = K q that the types allow has an error that does not decay"
    most = largest[method]
    if most is None:
        return f"any step of {method} is stable, as far as steps were tried, for {NUMERICAL}"
    if h <= most:
        return f"steps of {h:g} s by {method} are stable, as all up to {at_least(most, 3)} s, for {NUMERICAL}"
    others = [name for name, step in largest.items() if step is None or step >= h]
    instead = [f"a period up to {at_least(most, 3)} s"] + [f"method {name}" for name in others]
    imposed = f", or {{period: {h:g}, method: {method}, impose: true}}, which designs for it" * (method != "exact")
    return (
        f"steps of {h:g} s by {method} are too long: above {at_least(most, 3)} s the error grows in them for an "
        f"f = K q that the types allow; take {' or '.join(instead)}{imposed}"
    )
