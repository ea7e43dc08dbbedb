"""What a result holds of an observer whose measurements arrive sporadically."""

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from obsdesign.families.sporadic.certificate import SporadicCertificate
from obsdesign.families.sporadic.design import SporadicDesign
from obsdesign.files.text import checks, rows, written
from obsdesign.lmi.formula import approximate
from obsdesign.spec import Spec


def content(spec: Spec, design: SporadicDesign) -> dict[str, Any]:
    """Observer, guarantee, certificate and search, whichever there are."""
    made: dict[str, Any] = {}
    proof = design.certificate
    if proof and design.gains:
        made["observer"] = observer(spec, design, proof)
        made["guarantee"] = guarantee(design, proof)
        made["certificate"] = certificate(proof)
        if design.longest:
            numbers = {key: approximate(getattr(design.longest, key)) for key in ("gamma", "mu")}
            delta = approximate(design.longest.family.delta)
            made["certificate"]["T2_max"] = {**numbers, "delta": delta, **certificate(design.longest)}
    elif design.limit:
        made["guarantee"] = limits(design)
    if design.curves:
        parameter = "decay" if "decay" in design.curves[0]["points"][0] else "T2"
        made["search"] = {"parameter": parameter, "points": design.curves[0]["points"], "curves": list(design.curves)}
    return made


def observer(spec: Spec, design: SporadicDesign, proof: SporadicCertificate) -> dict[str, Any]:
    """Gains, the intervals they are for, and how the error contracts over one interval."""
    L, H = design.gains["L"], design.gains["H"]
    return {
        "type": spec.observer.type,
        "L": L.tolist(),
        "H": H.tolist(),
        "T1": approximate(proof.T1),
        "T2": approximate(proof.T2),
        "delta": approximate(proof.family.delta),
        "multipliers": multipliers(spec, L, H, (float(proof.T1), float(proof.T2))),
    }


def multipliers(spec: Spec, L: np.ndarray, H: np.ndarray, intervals: tuple[float, ...]) -> dict[str, list[list[float]]]:
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


def guarantee(design: SporadicDesign, proof: SporadicCertificate) -> dict[str, Any]:
    """What is proved, and the limit it is near to."""
    known = {key: value for key, value in asdict(proof.constants).items() if math.isfinite(value)}
    return {
        **known,
        "T1": approximate(proof.T1),
        "T2": approximate(proof.T2),
        **({"T2_max": approximate(design.longest.T2)} if design.longest else {}),
        "mu": approximate(proof.mu),
        **limits(design),
        "statement": proof.statement(),
    }


def limits(design: SporadicDesign) -> dict[str, Any]:
    """Limits of the objective."""
    limit = design.limit or {"attained": False}
    return {"limit": limit, **({"limit_bounded": design.limit_bounded} if design.limit_bounded else {})}


def certificate(proof: SporadicCertificate) -> dict[str, Any]:
    """Witness and checks."""
    return {
        "kind": "exact",
        "P1": rows(proof.P1),
        "P2": rows(proof.P2),
        "multipliers": {name: written(value) for name, value in proof.multipliers.items()},
        "checks": checks(proof.checks),
    }
