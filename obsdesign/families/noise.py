"""How much measurement noise is in the errors of an observer, over frozen members f = K q; nothing of it is proved."""

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
    a rms of 1 that is held over a period h (s), the rms over time; and `noise_error` for the noise that the spec
    declares. None where a pole is not stable, slopes are not bounded, or a period is not known that is needed.
    """
    rows = estimated(spec)
    E = np.array([*rows.values()], dtype=float)
    norms = errors.noise_norms(E)
    held = norms if errors.sampled else None if period is None else errors.noise_norms(E, period)

    def named(sizes: Array) -> dict[str, dict[str, float]]:
        told = (dict(zip(spec.plant.outputs, row, strict=True)) for row in sizes.tolist())
        return dict(zip(rows, told, strict=True))

    found: dict[str, Any] = {
        "noise_density": None if norms is None else named(norms),
        "noise_rms": None if held is None else named(held),
    }
    if spec.noise:
        rms = None if norms is None else declared(spec, errors, E, period)
        found["noise_error"] = None if rms is None else dict(zip(rows, rms, strict=True))
    return found


def noise_of(errors: Errors, H: Array) -> float | None:
    """Rms of |H e| for white noise of density 1, or in samples of rms 1, in every output; None as in `heard`."""
    norms = errors.noise_norms(H)
    return None if norms is None else float(np.linalg.norm(norms))


def declared(spec: Spec, errors: Errors, E: Array, period: float | None) -> list[float] | None:
    """Rms of each error E e, (k,), for the noise of the section `noise`: squares of independent outputs add.

    None where a rms has no period for which it is held, and as in `heard`.
    """
    squares = np.zeros(len(E))
    for i, name in enumerate(spec.plant.outputs):
        if (level := spec.noise.get(name)) is None:
            continue
        held = None if errors.sampled or level.density else level.held(period)
        if held is None and not (errors.sampled or level.density):
            return None
        if (norms := errors.noise_norms(E, held)) is None:
            return None
        size = level.rms(period or 1.0) if errors.sampled else float(level.number)
        squares += (size * norms[:, i]) ** 2
    return [float(rms) for rms in np.sqrt(squares)]


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
