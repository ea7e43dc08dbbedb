"""What is computed of a design in doubles; entry `analysis` of a result file."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.modes import modes
from obsdesign.families.guarantee import Guarantee
from obsdesign.lmi.formula import Array
from obsdesign.model.disturbance import rows_of
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
    unaided = Errors.of(spec.posed, spec.multiplier, spec.H, modes=modes(spec.period))
    open_loop = unaided.peak_gain() if guarantee and guarantee.norm == "sup" else unaided.energy_gain()
    steps |= noise(spec, errors, None if spec.period is None else float(spec.period))
    found = {**steps, "no_observer": {"zero": open_loop if rests(spec) else None, "open_loop": open_loop}}
    return {name: finite(value) for name, value in found.items()}


def noise(spec: Spec, errors: Errors, period: float | None) -> dict[str, Any]:
    """How much white noise of each output is in the error of each estimate, as rms, of the worst frozen member.

    `noise_density` is for noise whose two-sided density is 1 unit/sqrt(Hz), in samples for a rms of 1; `noise_rms` for
    a rms of 1 that is held over a period h (s), whose density is sqrt(h) where the error is slow against h. Both None
    where a pole is not stable or slopes are not bounded, and the latter without a period.
    """
    rows = estimated(spec)
    norms = errors.noise_norms(np.array([*rows.values()], dtype=float))
    factor = 1.0 if errors.sampled else period and math.sqrt(period)

    def named(sizes: Array) -> dict[str, dict[str, float]]:
        told = (dict(zip(spec.plant.outputs, row, strict=True)) for row in sizes.tolist())
        return dict(zip(rows, told, strict=True))

    return {
        "noise_density": None if norms is None else named(norms),
        "noise_rms": None if norms is None or factor is None else named(factor * norms),
    }


def estimated(spec: Spec) -> dict[str, Array]:
    """Row over the augmented state of each estimate by name: states, and each w that is linear in them."""
    known = rows_of(spec.plant.states, spec.model_states, spec.plant.exogenous, spec.generator)
    return {name: row for name, row in known.items() if row is not None}


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


def useless(gamma: float, found: Mapping[str, Any]) -> str | None:
    """Note that a design is no better than no observer at all; None if it is."""
    gains = {name: gain for name, gain in found["no_observer"].items() if gain is not None}
    if not gains or gamma < min(gains.values()):
        return None
    name = min(gains, key=lambda name: gains[name])
    return (
        f"gamma = {at_most(gamma)} is no better than no observer at all: with {UNAIDED[name]} the gain is "
        f"{gains[name]:.6g}, as far as frozen members of the class show it"
    )
