"""How much measurement noise is in the errors of an observer, over frozen members f = K q; nothing of it is proved."""

import math
from typing import Any

import numpy as np

from obsdesign.dissipation.analysis import Errors
from obsdesign.families import FAMILIES
from obsdesign.lmi.formula import Array
from obsdesign.model.disturbance import rows_of
from obsdesign.spec import Spec


def period_of(spec: Spec) -> float | None:
    """How long a measurement is held, s, where the spec says so."""
    if spec.period is not None:
        return float(spec.period)
    return None if spec.implementation is None else float(spec.implementation.period)


def heard(spec: Spec, errors: Errors, period: float | None) -> dict[str, Any]:
    """Rms that white noise of each output makes in the error of each estimate, of the worst member.

    `noise_density` is for noise whose two-sided density is 1 unit/sqrt(Hz), in samples for a rms of 1; `noise_rms` for
    a rms of 1 that is held over a period h (s), whose density is sqrt(h) where the error is slow against h; and
    `noise_error` for the noise that the spec declares. None where a pole is not stable, slopes are not bounded, or a
    period is not known that is needed.
    """
    rows = estimated(spec)
    norms = errors.noise_norms(np.array([*rows.values()], dtype=float))
    factor = 1.0 if errors.sampled else period and math.sqrt(period)

    def named(sizes: Array) -> dict[str, dict[str, float]]:
        told = (dict(zip(spec.plant.outputs, row, strict=True)) for row in sizes.tolist())
        return dict(zip(rows, told, strict=True))

    found: dict[str, Any] = {
        "noise_density": None if norms is None else named(norms),
        "noise_rms": None if norms is None or factor is None else named(factor * norms),
    }
    if spec.noise:
        rms = None if norms is None else declared(spec, errors, norms, period)
        found["noise_error"] = None if rms is None else dict(zip(rows, rms, strict=True))
    return found


def noise_of(errors: Errors, H: Array) -> float | None:
    """Rms of |H e| for white noise of density 1, or in samples of rms 1, in every output; None as in `heard`."""
    norms = errors.noise_norms(H)
    return None if norms is None else float(np.linalg.norm(norms))


def declared(spec: Spec, errors: Errors, norms: Array, period: float | None) -> list[float] | None:
    """Rms of each error, (k,), for the noise of the section `noise`: squares of independent outputs add.

    `norms`: (k, ny). None where a rms has no period from which its density follows.
    """
    sizes = np.zeros(len(spec.plant.outputs))
    for i, name in enumerate(spec.plant.outputs):
        if (level := spec.noise.get(name)) is None:
            continue
        size = level.rms(period or 1.0) if errors.sampled else level.density_at(period)
        if size is None:
            return None
        sizes[i] = size
    return [float(rms) for rms in np.linalg.norm(norms * sizes, axis=1)]


def estimated(spec: Spec) -> dict[str, Array]:
    """Row over the augmented state of each estimate by name: states, and each w that is linear in them."""
    known = rows_of(spec.plant.states, spec.model_states, spec.plant.exogenous, spec.generator)
    return {name: row for name, row in known.items() if row is not None}


def channels(spec: Spec) -> tuple[range, range]:
    """Places of the noise that is declared among the channels of w, and among those of v; before those of a defect."""
    count = len(spec.noise) if FAMILIES[spec.observer.type].noise_in_w else 0
    after = spec.plant.n if spec.continuous and spec.continuous.defect else 0
    w, v = len(spec.plant.exogenous) - after, len(spec.drives) - after
    return range(w - count, w), range(v - count, v)


def by_channel(spec: Spec, errors: Errors, *, peaks: bool) -> dict[str, float] | None:
    """Gain of each v alone to z: of energy, or of peaks; noise under its name in w. None as for `energy_gain`."""
    gains = errors.channel_gains(peaks=peaks)
    drives, w = spec.augmented.exogenous, spec.plant.exogenous
    told = dict(zip(drives, w, strict=True)) if not len(spec.generator.Am) else {}
    told |= {drives[j]: w[i] for i, j in zip(*channels(spec), strict=True)}
    names = [told.get(v, v) for v in spec.posed.exogenous]
    return None if gains is None else dict(zip(names, gains, strict=True))
