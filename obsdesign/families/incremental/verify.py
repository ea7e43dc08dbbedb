"""Claims of observers with the gains L1 and L2."""

import math
from collections.abc import Sequence
from dataclasses import replace

from flint import fmpq

from obsdesign.dissipation.bounds import Range
from obsdesign.dissipation.certificate import (
    Certificate,
    Reconstructed,
    certify,
    inapplicable,
    prove_slope,
    reconstructed,
    statement,
)
from obsdesign.dissipation.inequality import Incremental
from obsdesign.families.incremental.absence import refuted
from obsdesign.families.incremental.linf import Linf
from obsdesign.families.incremental.reconstruction import SLOPE, levels, slopes
from obsdesign.families.incremental.request import Request
from obsdesign.families.incremental.theorems import THEOREMS
from obsdesign.files.read import ResultFile, Verified
from obsdesign.lmi.farkas import Refutation
from obsdesign.lmi.formula import Array, approximate


def verified(file: ResultFile) -> Verified:
    """Certificate of a file that claims a guarantee, checked."""
    certificate = certified(file)
    g = certificate.guarantee
    claim = f"gamma {g.gamma:g}, {certificate.theorem.meaning}; decay rate {g.alpha:g} 1/s"
    return Verified(claim, tuple(certificate.conditions()), certificate, g)


def certified(file: ResultFile) -> Certificate:
    """Certificate of the guarantee, and of the bound on the reconstruction of w if one is claimed."""
    made, gains = file.spec, read_gains(file)
    require_request(file, gains["L1"], gains["L2"])
    kind = THEOREMS[made.observer.type]
    family = kind(made.augmented, made.multiplier, made.H, file.number("guarantee", "alpha"), gains["L1"], gains["L2"])
    request = made.incremental
    largest = None if request.gains else request.bounds.P
    certificate = read_certificate(file, family, ("guarantee",), ("certificate",), largest)
    if "reconstruction" in file.table("guarantee"):
        certificate = replace(certificate, reconstruction=read_reconstruction(file, family))
    if file.at("guarantee", "statement") != statement(made, certificate):
        raise file.wrong("guarantee.statement", "does not say what the numbers of the guarantee say")
    return certificate


def read_gains(file: ResultFile) -> dict[str, Array]:
    """Exact gains of a file."""
    plant = file.spec.augmented
    shapes = {"L1": (plant.n, len(plant.C)), "L2": (len(plant.Cq), len(plant.C))}
    return {name: file.matrix(shape, "observer", name) for name, shape in shapes.items()}


def verify_absence(file: ResultFile) -> tuple[str, Refutation]:
    """Prove anew that an infeasible result has no solution, and say what is proved.

    Raises
    ------
    UsageError
        If the file holds no dual certificate: its verdict is numerical or structural; or if it is malformed.
    """
    made, root = file.spec, ("diagnosis", "certificate")
    if "certificate" not in file.table("diagnosis"):
        raise file.wrong("diagnosis", "holds no certificate, so there is nothing to be verified")
    if not isinstance(made.observer, Request):
        raise file.wrong("diagnosis.certificate", f"there is none for type {made.observer.type}")
    request, alpha = made.incremental.printed(), file.number(*root, "alpha")
    require_alpha(file, request, alpha, "diagnosis.certificate.alpha")
    given = {"L1": None, "L2": request.L2} | dict(request.gains or {})
    family = THEOREMS[request.type](made.augmented, made.multiplier, made.H, alpha, given["L1"], given["L2"])
    if family.L2 is None:
        raise file.wrong("diagnosis.certificate", "a certificate is for a given L2, and the spec leaves it free")
    gamma = file.number(*root, "gamma") if "gamma" in file.table(*root) else None
    refutation = refuted(family, gamma, file.matrices(*root, "multipliers"))
    level = "" if gamma is None else f" and gamma = {approximate(gamma):g}"
    return f"Theorem 1 has no solution at alpha = {approximate(alpha):g}{level}, nor at a larger alpha", refutation


def read_certificate(
    file: ResultFile, family: Incremental, claim: Sequence[str], witness: Sequence[str], largest: fmpq | None = None
) -> Certificate:
    """Certificate of a claim (gamma, mu1, mu2) by a witness (P, multipliers), checked."""
    n = family.plant.n
    values = {"P": file.matrix((n, n), *witness, "P")}
    values |= file.unknowns(family.multiplier.unknowns(), *witness, "multipliers")
    gamma, mu1, mu2 = (file.number(*claim, key) for key in ("gamma", "mu1", "mu2"))
    return certify(family, gamma, mu1, mu2, values, largest)


def read_reconstruction(file: ResultFile, family: Incremental) -> Reconstructed:
    """Bound on |what - w|, with its levels and slopes checked."""
    root = ("certificate", "reconstruction")
    if not file.spec.incremental.reconstruct or not isinstance(family, Linf):
        raise file.wrong("guarantee.reconstruction", "the spec does not ask for it")
    proofs = {}
    for name, slope in slopes(family.multiplier).items() if family.plant.Bf.shape[1] else ():
        values = file.unknowns(slope.unknowns, *root, "slopes", name, "values")
        proofs[name] = prove_slope(slope, file.number(*root, "slopes", name, "bound"), values)
    reason = inapplicable(file.spec, proofs[SLOPE].bound if proofs else None)
    if reason:
        raise file.wrong("guarantee.reconstruction", reason)
    certificates = {}
    for name, level in levels(family).items():
        path = (*root, "levels", name)
        certificates[name] = read_certificate(file, replace(level, alpha=file.number(*path, "alpha")), path, path)
    c_w, c_w_rate, c_x_rate = (file.number("guarantee", "reconstruction", key) for key in ("w", "w_rate", "x_rate"))
    return reconstructed(family, certificates, proofs, (c_w, c_w_rate, c_x_rate))


def require_request(file: ResultFile, L1: Array, L2_: Array) -> None:
    """Hold the claim against what the spec asks: the family, alpha, given gains, the statement."""
    request = file.spec.incremental.printed()
    if file.at("observer", "type") != request.type:
        raise file.wrong("observer.type", f"the spec asks for {request.type}")
    alpha, gamma = file.number("guarantee", "alpha"), file.number("guarantee", "gamma")
    require_alpha(file, request, alpha, "guarantee.alpha")
    given = request.gains or ({"L2": request.L2} if request.L2 is not None else {})
    for name, found in (("L1", L1), ("L2", L2_)):
        if name in given and (given[name] != found).any():
            raise file.wrong(f"observer.{name}", "differs from the gain that the spec gives")
    if not math.isfinite(approximate(gamma)):
        raise file.wrong("guarantee.gamma", "beyond the range of doubles")


def require_alpha(file: ResultFile, request: Request, alpha: fmpq, key: str) -> None:
    """Hold a decay rate against the number or the range that the spec asks for."""
    low, high = (request.alpha.low, request.alpha.high) if isinstance(request.alpha, Range) else (request.alpha,) * 2
    if not low <= alpha <= high:
        raise file.wrong(key, f"{approximate(alpha):g} is not what the spec asks for")
