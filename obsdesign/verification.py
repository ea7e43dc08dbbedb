"""Proves a result file anew: from its spec, its gains and its witness, in rationals, with no solver."""

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from flint import fmpq, fmpz

from obsdesign.certificate import (
    Certificate,
    Reconstructed,
    certify,
    inapplicable,
    prove_slope,
    reconstructed,
    statement,
)
from obsdesign.diagnosis.absence import refuted
from obsdesign.errors import UsageError
from obsdesign.lmi.farkas import Refutation
from obsdesign.lmi.formula import Array, Unknown, approximate, printed, rational, rational_number
from obsdesign.lmi.proof import Check
from obsdesign.observers import FAMILIES, Incremental
from obsdesign.observers.guarantee import Guarantee, SporadicGuarantee
from obsdesign.observers.linf import Linf
from obsdesign.observers.reconstruction import SLOPE, levels, slopes
from obsdesign.observers.request import Range, Request, SporadicRequest
from obsdesign.observers.sporadic_certificate import LARGEST_EXPONENT, MEANING, SporadicCertificate, certify_sporadic
from obsdesign.spec import loads
from obsdesign.spec.model import Spec

LARGEST = 64 * 2**20  # bytes
LONGEST = 100_000  # characters of one number
LARGEST_POWER = 400  # of ten
NUMBER = re.compile(r"-?\d+/0*[1-9]\d*|-?\d+(\.\d+)?([eE][-+]?\d{1,9})?", re.ASCII)


class ResultFile:
    """A result file, read exactly.

    Raises
    ------
    UsageError
        If it is unreadable, no result of this format, or holds what is no number where one must stand.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        self.content = self.read()
        if self.content.get("obsdesign") != "1":
            raise self.wrong("obsdesign", "not a result of format 1")
        self.spec = self.embedded()

    def read(self) -> dict[str, Any]:
        """JSON with every number kept as the text that was written."""
        try:
            raw = Path(self.path).read_bytes()
        except OSError as error:
            raise UsageError(f"{self.path}: cannot be read: {error.strerror}") from None
        if len(raw) > LARGEST:
            raise UsageError(f"{self.path}: larger than {LARGEST} bytes")
        try:
            content = json.loads(raw, parse_float=str, parse_int=str, parse_constant=self.no_number)
        except (ValueError, RecursionError) as error:
            raise UsageError(f"{self.path}: not JSON: {error}") from None
        if not isinstance(content, dict):
            raise UsageError(f"{self.path}: not a result file: an object is expected")
        return content

    def no_number(self, text: str) -> None:
        """Refuse NaN and infinities."""
        raise UsageError(f"{self.path}: {text} is no number; a result holds finite numbers only")

    def wrong(self, key: str, message: str) -> UsageError:
        """Error about one key."""
        return UsageError(f"{self.path}: {key}: {message}")

    def at(self, *keys: str) -> Any:
        """Entry at a path of keys, which must exist."""
        value: Any = self.content
        for i, key in enumerate(keys):
            if not isinstance(value, dict) or key not in value:
                raise self.wrong(".".join(keys[: i + 1]), "missing")
            value = value[key]
        return value

    def embedded(self) -> Spec:
        """Spec that travels in the file, if its hash is right."""
        from obsdesign.artifacts import digest

        text, found = self.at("spec", "text"), self.at("spec", "sha256")
        try:
            right = isinstance(text, str) and digest(text) == found
        except UnicodeEncodeError:
            raise self.wrong("spec.sha256", "not the hash of spec.text, which is not valid Unicode") from None
        if not right:
            raise self.wrong("spec.sha256", "not the hash of spec.text: the spec in the file was altered")
        return loads(text, f"{self.path} (spec.text)")

    def number(self, *keys: str) -> fmpq:
        """Exact value of one number."""
        return self.exact(self.at(*keys), ".".join(keys))

    def matrix(self, shape: tuple[int, int], *keys: str) -> Array:
        """Exact matrix of a given shape."""
        rows, name = self.at(*keys), ".".join(keys)
        regular = isinstance(rows, list) and all(isinstance(r, list) and len(r) == shape[1] for r in rows)
        if not regular or len(rows) != shape[0]:
            raise self.wrong(name, f"expected a {shape[0]}x{shape[1]} matrix")
        entries = [[self.exact(x, name) for x in row] for row in rows]
        return rational(np.array(entries, dtype=object).reshape(shape))

    def unknowns(self, unknowns: Iterable[Unknown], *keys: str) -> dict[str, Array]:
        """Exact values of unknowns: a number for a 1x1 one, else rows."""
        values = {}
        for unknown in unknowns:
            path = (*keys, unknown.name)
            if unknown.shape == (1, 1):
                values[unknown.name] = rational([[self.number(*path)]])
                continue
            values[unknown.name] = matrix = self.matrix(unknown.shape, *path)
            if unknown.symmetric and (matrix != matrix.T).any():
                raise self.wrong(".".join(path), "not symmetric")
        return values

    def matrices(self, *keys: str) -> dict[str, Array]:
        """Exact square matrices by name, of whatever size they have."""
        made = {}
        for name, rows in self.table(*keys).items():
            size = len(rows) if isinstance(rows, list) else 0
            made[name] = self.matrix((size, size), *keys, name)
        return made

    def table(self, *keys: str) -> dict[str, Any]:
        """Object at a path of keys."""
        found = self.at(*keys)
        if not isinstance(found, dict):
            raise self.wrong(".".join(keys), "expected an object")
        return found

    def exact(self, text: Any, name: str) -> fmpq:
        """Rational of a decimal or of "p/q"."""
        try:
            if not isinstance(text, str) or len(text) > LONGEST or not NUMBER.fullmatch(text):
                raise ValueError
            if "/" in text:
                return fmpq(*(fmpz(part) for part in text.split("/")))
            decimal = Decimal(text)
            if abs(decimal.adjusted()) > LARGEST_POWER:
                raise ValueError
            return rational_number(Fraction(decimal))
        except (ValueError, ArithmeticError):
            raise self.wrong(name, f"{str(text)[:40]!r} is no finite number") from None


def opened(path: str, spec: Spec | None) -> ResultFile:
    """Read a result file, which must belong to the spec if one is given."""
    file = ResultFile(path)
    if spec is not None and spec.text != file.spec.text:
        raise file.wrong("spec.sha256", f"these gains belong to another spec than {spec.path}")
    return file


@dataclass(frozen=True)
class Proof:
    """What a file claims, in words, and the conditions that were checked of it."""

    claim: str
    checks: tuple[Check, ...]

    @property
    def holds(self) -> bool:
        """Whether the claim is proved."""
        return all(check.holds for check in self.checks)


def prove(path: str, spec: Spec | None = None) -> Proof:
    """Prove the claim of a result file anew: its guarantee, or that there is no solution.

    Raises
    ------
    UsageError
        If the file claims nothing that can be proved, is malformed, or belongs to another spec.
    """
    file = opened(path, spec)
    if file.at("status") == "infeasible":
        claim, refutation = verify_absence(file)
        return Proof(claim, refutation.checks)
    certificate = certified(file)
    if isinstance(certificate, SporadicCertificate):
        s = certificate.guarantee
        claim = f"gamma {s.gamma:g}, {MEANING}; decay rate {s.decay:g} 1/s, intervals from {s.T1:g} to {s.T2:g} s"
        return Proof(claim, certificate.checks)
    g = certificate.guarantee
    claim = f"gamma {g.gamma:g}, {FAMILIES[g.family].meaning}; decay rate {g.alpha:g} 1/s"
    return Proof(claim, tuple(certificate.conditions()))


def verify(path: str, spec: Spec | None = None) -> tuple[ResultFile, Certificate | SporadicCertificate]:
    """Prove the guarantee of a result file anew.

    Parameters
    ----------
    path
        The result file.
    spec
        The spec that it must belong to; without one, the spec in the file is believed.

    Raises
    ------
    UsageError
        If the file is no certified result, is malformed, or belongs to another spec.
    """
    file = opened(path, spec)
    return file, certified(file)


def certified(file: ResultFile) -> Certificate | SporadicCertificate:
    """Certificate of a file that claims a guarantee, checked."""
    if file.at("status") != "certified":
        raise file.wrong("status", f"{file.at('status')!r} claims nothing; only a certified result can be verified")
    made = file.spec
    if isinstance(made.observer, SporadicRequest):
        return certified_sporadic(file, made.observer)
    gains = read_gains(file)
    require_request(file, gains["L1"], gains["L2"])
    kind = FAMILIES[made.observer.type]
    family = kind(made.augmented, made.multiplier, made.H, file.number("guarantee", "alpha"), gains["L1"], gains["L2"])
    request = made.incremental
    largest = None if request.gains else request.bounds.P
    certificate = read_certificate(file, family, ("guarantee",), ("certificate",), largest)
    if "reconstruction" in file.table("guarantee"):
        certificate = replace(certificate, reconstruction=read_reconstruction(file, family))
    if file.at("guarantee", "statement") != statement(made, certificate.guarantee):
        raise file.wrong("guarantee.statement", "does not say what the numbers of the guarantee say")
    return certificate


def read_gains(file: ResultFile) -> dict[str, Array]:
    """Exact gains of a file."""
    plant = file.spec.augmented
    n, ny, nq = plant.n, len(plant.C), len(plant.Cq)
    sporadic = isinstance(file.spec.observer, SporadicRequest)
    shapes = {"L": (n, ny), "H": (ny, ny)} if sporadic else {"L1": (n, ny), "L2": (nq, ny)}
    return {name: file.matrix(shape, "observer", name) for name, shape in shapes.items()}


def certified_sporadic(file: ResultFile, request: SporadicRequest) -> SporadicCertificate:
    """Certificate of a file with gains for sporadic measurements, checked, and that of the longest T2 with it."""
    gains = read_gains(file)
    claim = {key: file.number("guarantee", key) for key in ("decay", "T1", "T2")}
    require_sporadic(file, request, gains, claim)
    certificate = read_sporadic(file, gains, claim, ("guarantee",), ("observer", "delta"), ("certificate",))
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
    longest = read_sporadic(file, gains, claim, root, (*root, "delta"), root)
    more = tuple(replace(check, name=f"T2_max: {check.name}") for check in longest.checks)
    return replace(certificate, checks=(*certificate.checks, *more))


def read_sporadic(
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


def require_sporadic(
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
    if isinstance(made.observer, SporadicRequest):
        raise file.wrong("diagnosis.certificate", "there is none for type sporadic")
    request, alpha = made.incremental.printed(), file.number(*root, "alpha")
    require_alpha(file, request, alpha, "diagnosis.certificate.alpha")
    given = {"L1": None, "L2": request.L2} | dict(request.gains or {})
    family = FAMILIES[request.type](made.augmented, made.multiplier, made.H, alpha, given["L1"], given["L2"])
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


def recorded(path: str, spec: Spec | None) -> tuple[Spec, dict[str, Array], Guarantee | SporadicGuarantee | None]:
    """Spec, gains in doubles, and guarantee of a result file; None where nothing is claimed, or proved.

    Raises
    ------
    UsageError
        If the file is malformed, has no gains, or belongs to another spec.
    """
    file = opened(path, spec)
    if file.at("status") == "infeasible":
        raise file.wrong("status", "infeasible: this result has no gains")
    gains = read_gains(file)
    guarantee: Guarantee | SporadicGuarantee | None = None
    if file.at("status") == "certified":
        proof = certified(file)
        if proof.holds:
            guarantee = proof.guarantee
    doubles = {name: np.vectorize(approximate, otypes=[float])(gain) for name, gain in gains.items()}
    for name, gain in doubles.items():
        if not np.isfinite(gain).all():
            raise file.wrong(f"observer.{name}", "beyond the range of doubles")
    return file.spec, doubles, guarantee
