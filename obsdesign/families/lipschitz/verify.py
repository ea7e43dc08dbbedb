"""Claims of observers of Lipschitz systems."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import Bounds, Range
from obsdesign.dissipation.certificate import Certificate, certify, lipschitz_claim
from obsdesign.families.lipschitz.claim import LipschitzClaim, below, meaning, needed
from obsdesign.families.lipschitz.relaxations import Lipschitz, proportions
from obsdesign.files.read import ResultFile, Verified
from obsdesign.lmi.formula import Array, Inequality, approximate, identity, printed, rational
from obsdesign.lmi.proof import Check, prove

GUARANTEE = ("guarantee",)
CERTIFICATE = ("certificate",)
ADMISSIBLE = ("certificate", "admissible")


def read_gains(file: ResultFile) -> dict[str, Array]:
    """Exact gain of a file."""
    plant = file.spec.augmented
    return {"L": file.matrix((plant.n, len(plant.C)), "observer", "L")}


def verified(file: ResultFile) -> Verified:
    """Certificate of a file that claims a guarantee, checked, and that of the largest constant tolerated with it."""
    L, lipschitz, decay = read_gains(file)["L"], read_constant(file, *GUARANTEE), file.number(*GUARANTEE, "decay")
    require_request(file, L, lipschitz, decay)
    certificate = read_certificate(file, L, lipschitz, decay, GUARANTEE, CERTIFICATE)
    checks, beyond = [*certificate.checks, *within(L, file)], None
    if "admissible" in file.table(*GUARANTEE):
        largest = require_admissible(file, lipschitz)
        more = read_certificate(file, L, largest, decay, ADMISSIBLE, ADMISSIBLE)
        checks += [replace(check, name=f"admissible: {check.name}") for check in more.checks]
        beyond = largest, more.guarantee
    g = certificate.guarantee
    claim = lipschitz_claim(file.spec, lipschitz, g, beyond)
    require_consequences(file, claim)
    level = f", gamma {g.gamma:g}, {meaning(claim.drive)}" if claim.drive else ""
    tolerated = f"; constants up to {approximate(beyond[0]):g} are tolerated" if beyond else ""
    words = f"Lipschitz constant {approximate(lipschitz):g}{level}; decay rate {g.alpha:g} 1/s{tolerated}"
    return Verified(words, tuple(checks), certificate, g if claim.covers else None)


def read_constant(file: ResultFile, *keys: str) -> fmpq:
    """Constant of a claim."""
    found = file.number(*keys, "lipschitz")
    if not 0 <= approximate(found) < math.inf:
        raise file.wrong(f"{'.'.join(keys)}.lipschitz", "no Lipschitz constant")
    return found


def read_certificate(
    file: ResultFile, L: Array, lipschitz: fmpq, decay: fmpq, claim: Sequence[str], witness: Sequence[str]
) -> Certificate:
    """Certificate of a constant and a decay rate, with gamma, mu1 and mu2, P and multipliers where they stand."""
    made, plant = file.spec, file.spec.augmented
    constants = [lipschitz * share for share in proportions(made.lipschitz.lipschitz)]
    family = Lipschitz.of(plant, made.multiplier, constants, made.H, decay, L)
    values = {"P": file.matrix((plant.n, plant.n), *witness, "P")}
    values |= file.unknowns(family.multiplier.unknowns(), *witness, "multipliers")
    gamma, mu1, mu2 = read_levels(file, claim) if made.disturbed else (fmpq(1),) * 3
    return certify(family, gamma, mu1, mu2, values)


def read_levels(file: ResultFile, claim: Sequence[str]) -> tuple[fmpq, fmpq, fmpq]:
    """Gamma, mu1 and mu2, which are 1 and the square of gamma: the statement relies on it."""
    gamma, mu1, mu2 = (file.number(*claim, key) for key in ("gamma", "mu1", "mu2"))
    name = ".".join(claim)
    if not math.isfinite(approximate(gamma * gamma)):
        raise file.wrong(f"{name}.gamma", "beyond the range of doubles")
    for key, found, expected in (("mu1", mu1, fmpq(1)), ("mu2", mu2, printed(below(gamma * gamma)))):
        if found != expected:
            raise file.wrong(f"{name}.{key}", f"{approximate(expected)!r} belongs to this gamma")
    return gamma, mu1, mu2


def within(L: Array, file: ResultFile) -> tuple[Check, ...]:
    """Whether the gain is within the bound of the spec, if it is a designed one."""
    request = file.spec.lipschitz
    if request.bounds.L1 is None or request.gains:
        return ()
    return prove([Inequality("|L| <= kappa", excess(L, request.bounds))])


def excess(L: Array, bounds: Bounds) -> Array:
    """L'L - kappa^2 I, or its trace with the Frobenius norm: what must be <= 0."""
    assert bounds.L1 is not None
    square, product = bounds.L1 * bounds.L1, L.T @ L
    if bounds.norm == "spectral":
        return np.asarray(product - square * identity(len(product), product))
    return rational([[np.trace(product) - square]])


def require_request(file: ResultFile, L: Array, lipschitz: fmpq, decay: fmpq) -> None:
    """Hold a claim against what the spec asks: the family, the decay, the constant, a given gain."""
    request = file.spec.lipschitz
    for key, asked in (("type", request.type), ("relaxation", request.relaxation)):
        if file.at("observer", key) != asked:
            raise file.wrong(f"observer.{key}", f"the spec asks for {asked}")
    low, high = (request.decay.low, request.decay.high) if isinstance(request.decay, Range) else (request.decay,) * 2
    if not printed(low) <= decay <= printed(high):
        raise file.wrong("guarantee.decay", f"{approximate(decay):g} is not what the spec asks for")
    declared = needed(request.lipschitz)
    least = fmpq(0) if request.objective == "max-lipschitz" else declared
    if lipschitz < least or (request.objective == "min-gamma" and lipschitz > declared):
        raise file.wrong("guarantee.lipschitz", f"{approximate(lipschitz):g} is not what the spec asks for")
    if request.gains and (printed(request.gains["L"]) != L).any():
        raise file.wrong("observer.L", "differs from the gain that the spec gives")


def require_admissible(file: ResultFile, lipschitz: fmpq) -> fmpq:
    """Largest constant that is said to be tolerated, as it stands in the guarantee and beside its witness."""
    largest = read_constant(file, *ADMISSIBLE)
    if file.number(*GUARANTEE, "admissible") != file.number(*ADMISSIBLE, "lipschitz"):
        raise file.wrong("guarantee.admissible", "differs from that of the certificate")
    if largest < lipschitz:
        raise file.wrong("guarantee.admissible", "below the constant that is claimed")
    return largest


def require_consequences(file: ResultFile, claim: LipschitzClaim) -> None:
    """Hold what follows from the numbers of a claim against what the file says."""
    if not file.spec.disturbed and "gamma" in file.table(*GUARANTEE):
        raise file.wrong("guarantee.gamma", "the plant has no w")
    expected = {"margin": [claim.margin], **({"constants": claim.constants} if len(claim.declared) > 1 else {})}
    for key, numbers in expected.items():
        if file.numbers(*GUARANTEE, key) != [printed(x) for x in numbers]:
            raise file.wrong(f"guarantee.{key}", "does not follow from the certificate")
    if file.at(*GUARANTEE, "statement") != claim.statement():
        raise file.wrong("guarantee.statement", "does not say what the numbers of the guarantee say")
