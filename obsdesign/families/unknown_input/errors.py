"""Error systems of unknown-input observers over frozen members f = K q; nothing of it is proved.

With e = eps + E D v + E n for noise n of y: eps' = A_K eps - B_K v + (A_K E + L) n, where A_K and B_K are those of the
plant that is left.
"""

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.areas import largest_area
from obsdesign.dissipation.frequencies import largest
from obsdesign.dissipation.modes import modes
from obsdesign.families.unknown_input import transform
from obsdesign.families.unknown_input.request import reduced, request_of
from obsdesign.lmi.formula import Array, Exact, in_floats, zeros
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec


@dataclass(frozen=True)
class Shifted(Errors):
    """Those of the plant that is left, with L1 = -L."""

    E: Array  # (n, ny)
    Z: Array  # (nz, nv): z = H eps + Z v

    @cached_property
    def systems(self) -> list[tuple[Array, Array, Array]]:
        """A, the input matrix of v and that of n, of each member that is distinct."""
        return [(A, B, A @ self.E + N) for A, B, N in super().systems]

    def noise_gain(self) -> dict[str, float]:
        """Largest gain over frequency from n to each estimate; empty where a pole is not stable."""
        if not self.modes.stable(self.poles):
            return {}
        found = np.max([self.amplitudes(A, N) for A, _, N in self.systems], axis=0).tolist()
        return dict(zip(self.plant.states, found, strict=False))

    def amplitudes(self, A: Array, N: Array) -> Array:
        """Those of one member: |(s I - A)^-1 N + E| by rows, and at infinity |E|."""

        def sizes(omega: Array) -> Array:
            return np.asarray(np.linalg.norm(self.modes.response(A, N, omega) + self.E, axis=2))

        return np.asarray(np.maximum(largest(sizes, self.modes.frequencies(A)), np.linalg.norm(self.E, axis=1)))

    def noise_norms(self, E: Array, held: float | None = None) -> Array | None:
        """H2 norm from each n to each row; None as in `Errors`, and where white noise of continuous time is in one."""
        found, through = super().noise_norms(E, held), E @ self.E
        if found is None or not through.any():
            return found
        return np.hypot(found, through) if self.sampled else None

    def gain(self, A: Array, B: Array, *, peaks: bool) -> float:
        """Gain of one member from all of v to z."""
        return self.gain_of(A, B, self.Z, peaks=peaks)

    def gain_of(self, A: Array, B: Array, Z: Array, *, peaks: bool) -> float:
        """Gain of H (s I - A)^-1 B + Z, of peaks or of energy."""
        if peaks:
            h, widths = self.modes.impulse(A, B, self.H)
            return largest_area(np.concatenate([h, Z.T[..., None]], axis=-1), np.append(widths, 1.0))

        def sizes(omega: Array) -> Array:
            return np.asarray(np.linalg.norm(self.H @ self.modes.response(A, B, omega) + Z, 2, axis=(1, 2)))[:, None]

        at_once = float(np.linalg.norm(Z, 2)) if Z.size else 0.0
        return max(float(largest(sizes, self.modes.frequencies(A)).item()), at_once) if B.size else 0.0

    def energy_gain(self) -> float | None:
        """Largest singular value over frequency from v to z; None as in `Errors`."""
        if not self.bounded or not self.modes.stable(self.poles):
            return None
        return max((self.gain(A, B, peaks=False) for A, B, _ in self.systems), default=0.0)

    def channel_gains(self, *, peaks: bool) -> list[float] | None:
        """Gain from each v alone to z; None as in `Errors`."""
        if not self.bounded or not self.modes.stable(self.poles):
            return None
        count = self.plant.B.shape[1]
        return [
            max(self.gain_of(A, B[:, [k]], self.Z[:, [k]], peaks=peaks) for A, B, _ in self.systems)
            for k in range(count)
        ]

    def impulse(self, A: Array, B: Array) -> tuple[Array, Array]:
        """Response of z to an impulse of each v, that of Z v as one more instant."""
        h, widths = super().impulse(A, B)
        return np.concatenate([h, self.Z.T[..., None]], axis=-1), np.append(widths, 1.0)


def errors(spec: Spec, E: Exact, gains: Mapping[str, Array]) -> Shifted:
    """Error systems of the observer with E and the gain L."""
    inner = reduced(spec, E)
    plant, none = inner.posed, zeros((len(spec.plant.Cq), len(spec.plant.C)), [gains["L"]])
    Z = spec.H @ transform.direct(spec.augmented, request_of(spec).cancel, E)
    found = Errors.of(plant, spec.multiplier, spec.H, -gains["L"], none, modes=modes(spec.period))
    return Shifted(**{**vars(replace(found)), "E": in_floats(E), "Z": in_floats(Z)})
