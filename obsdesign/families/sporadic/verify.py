"""Claims of observers whose measurements arrive sporadically."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace

from flint import fmpq

from obsdesign.dissipation.bounds import Range
from obsdesign.families.sporadic.certificate import LARGEST_EXPONENT, MEANING, SporadicCertificate, certify_sporadic
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.files.read import ResultFile, Verified
from obsdesign.lmi.formula import Array, approximate, printed, rational_number


def verified(file: ResultFile) -> Verified:
    """Certificate of a file that claims a guarantee, checked."""
    certificate = certified(file)
    s = certificate.guarantee
    claim = f"gamma {s.gamma:g}, {MEANING}; decay rate {s.decay:g} 1/s, intervals from {s.T1:g} to {s.T2:g} s"
    return Verified(claim, certificate.checks, certificate, s)


def read_gains(file: ResultFile) -> dict[str, Array]:
    """Exact gains of a file."""
    n, ny = file.spec.augmented.n, len(file.spec.augmented.C)
    return {name: file.matrix(shape, "observer", name) for name, shape in {"L": (n, ny), "H": (ny, ny)}.items()}


def certified(file: ResultFile) -> SporadicCertificate:
    """Certificate of a file with gains for sporadic measurements, checked, and that of the longest T2 with it."""
    gains = read_gains(file)
    claim = {key: file.number("guarantee", key) for key in ("decay", "T1", "T2")}
    require_request(file, file.spec.sporadic, gains, claim)
    certificate = read_certificate(file, gains, claim, ("guarantee",), ("observer", "delta"), ("certificate",))
    if not certificate.holds:
        return certificate
    for key, value in asdict(certificate.constants).items():
        if math.isfinite(value) and file.number("guarantee", key) != rational_number(repr(value)):
            raise file.wrong(f"guarantee.{key}", "does not follow from the certificate")
    if file.at("guarantee", "statement") != certificate.statement():
        raise file.wrong("guarantee.statement", "does not say what the numbers of the guarantee say")
    if "T2_max" not in file.table("guarantee"):
        return certificate
    root = ("certificate", "T2_max")
    claim["T2"] = file.number("guarantee", "T2_max")
    longest = read_certificate(file, gains, claim, root, (*root, "delta"), root)
    more = tuple(replace(check, name=f"T2_max: {check.name}") for check in longest.checks)
    return replace(certificate, checks=(*certificate.checks, *more))


def read_certificate(
    file: ResultFile,
    gains: Mapping[str, Array],
    claim: Mapping[str, fmpq],
    level: Sequence[str],
    exponent: Sequence[str],
    witness: Sequence[str],
) -> SporadicCertificate:
    """Certificate of a claim (T1, T2, decay), with gamma and mu, delta, and P1, P2 and multipliers where they stand."""
    made, plant = file.spec, file.spec.augmented
    n, ny = plant.n, len(plant.C)
    delta = file.number(*exponent)
    if not 0 <= delta * claim["T2"] <= LARGEST_EXPONENT:
        raise file.wrong(".".join(exponent), f"delta T2 is not between 0 and {LARGEST_EXPONENT}")
    values = {"P1": file.matrix((n, n), *witness, "P1"), "P2": file.matrix((ny, ny), *witness, "P2")}
    values |= file.unknowns(made.multiplier.unknowns(), *witness, "multipliers")
    gamma, mu = file.number(*level, "gamma"), file.number(*level, "mu")
    intervals, pair = (claim["T1"], claim["T2"]), (gains["L"], gains["H"])
    return certify_sporadic(plant, made.multiplier, made.H, pair, intervals, claim["decay"], delta, gamma, mu, values)


def require_request(
    file: ResultFile, request: SporadicRequest, gains: Mapping[str, Array], claim: Mapping[str, fmpq]
) -> None:
    """Hold a claim against what the spec asks: the family, T1, T2, the decay, given gains."""
    if file.at("observer", "type") != request.type:
        raise file.wrong("observer.type", f"the spec asks for {request.type}")
    asked = {"T1": request.T1, "T2": request.T2, "decay": request.decay}
    for name, value in asked.items():
        low, high = (value.low, value.high) if isinstance(value, Range) else (value, value)
        if not printed(low) <= claim[name] <= printed(high):
            raise file.wrong(f"guarantee.{name}", f"{approximate(claim[name]):g} is not what the spec asks for")
    for name in ("T1", "T2"):
        if file.number("observer", name) != claim[name]:
            raise file.wrong(f"observer.{name}", "differs from that of the guarantee")
    for name, given in (request.gains or {}).items():
        if (printed(given) != gains[name]).any():
            raise file.wrong(f"observer.{name}", "differs from the gain that the spec gives")
