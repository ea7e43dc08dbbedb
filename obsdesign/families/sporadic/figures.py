"""What an engineer asks first of gains for sporadic measurements."""

from typing import Any

import numpy as np

from obsdesign.families.sporadic.certificate import SporadicCertificate
from obsdesign.lmi.formula import Array, approximate
from obsdesign.spec import Spec


def figures(spec: Spec, L: Array, H: Array, proof: SporadicCertificate) -> dict[str, Any]:
    """Gains, the intervals they are for, and how the error contracts over one interval."""
    return {
        "L": L.tolist(),
        "H": H.tolist(),
        "T1": approximate(proof.T1),
        "T2": approximate(proof.T2),
        "delta": approximate(proof.family.delta),
        "multipliers": multipliers(spec, L, H, (float(proof.T1), float(proof.T2))),
    }


def multipliers(spec: Spec, L: Array, H: Array, intervals: tuple[float, ...]) -> dict[str, list[list[float]]]:
    """Eigenvalues [real, imaginary] of the error from one measurement to the next, without f, for both intervals.

    e' = A e - L d and d' = H d between measurements, d = C e at each: e+ = (E11 + E12 C) e, E = exp([A, -L; 0, H] T).
    """
    from scipy.linalg import expm

    plant = spec.augmented.doubles
    n, ny = L.shape
    flow = np.block([[plant.A, -L], [np.zeros((ny, n)), H]])
    found = {}
    for name, T in zip(("T1", "T2"), intervals, strict=True):
        E = expm(flow * T)
        values = sorted(np.linalg.eigvals(E[:n, :n] + E[:n, n:] @ plant.C), key=lambda z: (-abs(z), z.imag))
        found[name] = [[float(z.real), float(z.imag)] for z in values]
    return found
