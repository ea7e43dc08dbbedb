"""What is computed of a design in doubles; entry `analysis` of a result file."""

import math
from collections.abc import Mapping
from typing import Any

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.modes import modes
from obsdesign.families import FAMILIES
from obsdesign.families.guarantee import Guarantee
from obsdesign.families.noise import by_channel, heard, period_of
from obsdesign.model.filtered import gain_of
from obsdesign.spec import Spec, arguments
from obsdesign.tables.text import at_most

UNAIDED = {"zero": "z estimated by 0", "open_loop": "a copy of the plant that uses no y"}


def analysis(spec: Spec, errors: Errors, guarantee: Guarantee | None) -> dict[str, Any]:
    """Worst pole, largest steps, and gains with and without the observer.

    `errors`: of the observer as it runs. Where it runs so between measurements only, its poles say nothing of the
    error, and its steps are told up to the longest time between these; samples leave no step to choose. `peak_gain` is
    that from sup|v| to sup|z|: at least that of the worst frozen member, at most what the guarantee says.
    """
    gap = errors.gap
    steps: dict[str, Any] = {"worst_pole": errors.worst_pole} if gap is None else {}
    if not errors.modes.sampled:
        most = math.inf if gap is None else gap
        steps["largest_step"] = {name: h and min(h, most) for name, h in errors.largest_step.items()}
    steps["peak_gain"] = {"least": errors.least_peak(), "most": most_peak(spec, guarantee)}
    open_loop = None if spec.cancelled else alone(spec, peaks=guarantee is not None and guarantee.norm == "sup")
    steps |= heard(spec, errors, period_of(spec))
    if spec.noise and FAMILIES[spec.observer.type].noise_in_w:
        steps["gain_by_channel"] = by_channel(spec, errors, peaks=guarantee is not None and guarantee.norm == "sup")
    found = {**steps, "no_observer": {"zero": open_loop if rests(spec) else None, "open_loop": open_loop}}
    return {name: finite(value) for name, value in found.items()}


def alone(spec: Spec, *, peaks: bool) -> float | None:
    """Gain from v to z of a copy of the plant that uses no y."""
    unaided = Errors.of(spec.posed, spec.multiplier, spec.H, modes=modes(spec.period))
    return unaided.peak_gain() if peaks else unaided.energy_gain()


def most_peak(spec: Spec, guarantee: Guarantee | None) -> float | None:
    """What a guarantee says of sup|z| for sup|v| = 1, of v itself where estimates are filtered; None: nothing."""
    most = guarantee.peak(spec.H) if guarantee else None
    return most and most * math.sqrt(gain_of(spec.augmented, peaks=True) if spec.observer.filtered else 1)


def finite(value: Any) -> Any:
    """Texts, and numbers that a file can hold; None stands for the others."""
    if isinstance(value, dict):
        return {name: finite(part) for name, part in value.items()}
    if isinstance(value, list):
        return [finite(part) for part in value]
    return value if value is None or isinstance(value, str) or math.isfinite(value) else None


def rests(spec: Spec) -> bool:
    """Whether the plant rests at x = 0 without w, so that zero is an estimate of z with a finite gain."""
    terms = [*spec.gx, *spec.gq]
    for block in spec.nonlinearities:
        if block.f is None or any(part.names - set(arguments(block.nq)) for part in block.f):
            return False
        terms += block.f
    names = {name for term in terms for name in term.names}
    return names <= {name for block in spec.nonlinearities for name in arguments(block.nq)} and not any(
        term.function(sorted(term.names))(*(0.0 for _ in term.names)) for term in terms
    )


def mixed(spec: Spec) -> str | None:
    """Note that z adds errors in several units as they are; None where a spec weighs them, or names no such units."""
    units = [unit for name in spec.H_names if (unit := spec.units.get(name))]
    if not spec.disturbed or spec.weights or len({*units}) < 2:
        return None
    return (
        f"z adds errors in {', '.join(dict.fromkeys(units))} as they are, so that gamma depends on these units; "
        "performance: {weights: ..} or {scales: ..} says what counts"
    )


def useless(gamma: float, found: Mapping[str, Any]) -> str | None:
    """Note that a design is not proved to be better than no observer at all; None if it is."""
    gains = {name: gain for name, gain in found["no_observer"].items() if gain is not None}
    if not gains or gamma < min(gains.values()):
        return None
    name = min(gains, key=lambda name: gains[name])
    return (
        f"gamma = {at_most(gamma)} does not prove that this is better than no observer at all: with {UNAIDED[name]} "
        f"the gain is {gains[name]:.6g}, as far as frozen members of the class show it"
    )
