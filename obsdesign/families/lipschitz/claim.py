"""Claims of observers of Lipschitz systems, as a file holds them and as it is read."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from flint import fmpq

from obsdesign.dissipation import certificate as certificates
from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.certificate import Certificate, certify, kept, read_values
from obsdesign.dissipation.decimals import square_below
from obsdesign.dissipation.figures import figures
from obsdesign.dissipation.guarantee import Quadratic
from obsdesign.families import samples
from obsdesign.families.lipschitz.observer import errors
from obsdesign.families.lipschitz.relaxations import S_PROCEDURE, proportions
from obsdesign.families.lipschitz.request import LipschitzRequest, request_of
from obsdesign.families.lipschitz.words import meaning, pace, words
from obsdesign.families.outcome import Outcome
from obsdesign.families.poles import MEMBERS, require, stated, told
from obsdesign.files import ResultFile
from obsdesign.files import checks as listed
from obsdesign.lmi.formula import Array, Exact, approximate, below, printed
from obsdesign.lmi.proof import Check, Proved
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec
from obsdesign.tables.text import at_least, at_most

GUARANTEE = ("guarantee",)
CERTIFICATE = ("certificate",)
ADMISSIBLE = ("certificate", "admissible")


@dataclass(frozen=True)
class Claim(Proved):
    """What a gain is proved to achieve for every f whose blocks have Lipschitz constants within those claimed.

    Proposition 1 of Abbaszadeh and Marquez (2010): f + h has constants of at most those of f and h together. So what
    the gain tolerates beyond the declared constants is left for an uncertainty h that enters through the same Bf and
    Cq.
    """

    lipschitz: fmpq  # proved, the largest of those of the blocks
    certificate: Certificate  # at this constant
    admissible: "Claim | None" = None  # for the largest constant that the gain is proved to tolerate, if that is larger
    bound: tuple[Check, ...] = ()  # that the gain is within the bound of the spec, as a file is held against it

    @property
    def checks(self) -> tuple[Check, ...]:
        """Every condition, those of the largest constant included."""
        beyond = self.admissible.checks if self.admissible else ()
        named = (replace(check, name=f"admissible: {check.name}") for check in beyond)
        return (*self.certificate.checks, *self.bound, *named)

    def covers(self, spec: Spec) -> bool:
        """Whether the declared constants are within those that are proved."""
        return bool(self.lipschitz >= needed(request_of(spec).lipschitz))

    def guarantee(self, spec: Spec) -> Quadratic | None:
        """Guarantee in doubles; None where the declared constants are not covered."""
        return self.certificate.guarantee_at(spec.period) if self.covers(spec) else None

    def gamma(self, spec: Spec) -> float:
        """Gamma of w itself, or of v."""
        return samples.gamma_of_v(spec, self.certificate.gamma, "norm2")

    def headline(self, spec: Spec) -> str:
        """Claim in one line."""
        level = f", gamma {at_most(self.gamma(spec))}, {meaning(spec.observer.drive)}" if spec.disturbed else ""
        more = f"; constants up to {at_least(self.admissible.lipschitz)} are tolerated" if self.admissible else ""
        known = "; ".join([pace(self.certificate.told, spec), *told(self.certificate)])
        return f"Lipschitz constant {at_least(self.lipschitz)}{level}; {known}{more}"

    def spare(self, spec: Spec) -> fmpq:
        """What is tolerated beyond the largest declared constant; negative where not even that is."""
        return (self.admissible or self).lipschitz - needed(request_of(spec).lipschitz)

    def margin(self, spec: Spec) -> float:
        """Largest double within what is spare."""
        return below(self.spare(spec))

    def statement(self, spec: Spec) -> str:
        """Claim in words, with norms over [0, T] for every T or over first samples, and the observer written out."""
        drive, phrases = spec.observer.drive if spec.disturbed else "", words(spec)
        told = self.certificate.told
        decays = phrases.decays.format(rate=told) if self.certificate.rate else phrases.converges
        level = phrases.level.format(gamma=self.gamma(spec), drive=drive)
        said = f"{level}, and {decays} where {drive} = 0" if drive else decays
        every = f"for every f with {bounds('f', shared(self.lipschitz, spec))}"
        constant = f"{MEMBERS} of these constants"
        parts = [f"{said}; for {phrases.equations}", every, *self.beyond(spec), *stated(self.certificate, constant)]
        return "; ".join([*parts, *spec.provisos])

    def beyond(self, spec: Spec) -> list[str]:
        """Clause on what is left for an uncertainty, or on what is missing."""
        if not self.covers(spec):
            return [f"the spec declares {float(needed(request_of(spec).lipschitz))!r}, of which this says nothing"]
        if self.margin(spec) <= 0:
            return []
        more = self.admissible
        level = f" and gamma = {more.gamma(spec)!r}" if more and spec.disturbed else ""
        same = f"with another P{level} the same" if more else "the same"
        left = bounds("h", shared(self.spare(spec), spec))
        return [f"Proposition 1: {same} for f + h, for every h through the same Bf and Cq with {left}"]

    def theorem(self, spec: Spec) -> str:
        """Claim as a file of Coq; raises `UnexportedError`."""
        from obsdesign.coq.theorem import exported

        request = request_of(spec)
        kept_bounds = NO_BOUNDS if request.gains else request.bounds
        larger = self.admissible.certificate if self.admissible else None
        return exported(self.certificate, spec, self.statement(spec), kept_bounds, larger)

    def written(self, spec: Spec, limits: Mapping[str, Any]) -> dict[str, Any]:
        """What is proved, what that leaves for an uncertainty, the limit it is near to, and the witnesses."""
        g, more, constants = self.certificate.guarantee, self.admissible, shared(self.lipschitz, spec)
        guarantee = {
            "lipschitz": below(self.lipschitz),
            **({"constants": constants} if len(constants) > 1 else {}),
            **({"gamma": g.gamma} if spec.disturbed else {}),
            **({"gamma_v": self.gamma(spec)} if spec.disturbed and spec.observer.filtered else {}),
            **self.certificate.decay(spec.period),
            **({"mu1": g.mu1, "mu2": g.mu2} if spec.disturbed else {}),
            **(self.certificate.poles.written() if self.certificate.poles else {}),
            **({"admissible": below(more.lipschitz)} if more else {}),
            "margin": self.margin(spec),
            **limits,
            "statement": self.statement(spec),
        }
        certificate = self.certificate.written()
        certificate["checks"] += listed(self.bound)
        if more:
            level = more.certificate
            numbers = {key: approximate(getattr(level, key)) for key in ("gamma", "mu1", "mu2") if spec.disturbed}
            certificate["admissible"] = {"lipschitz": approximate(more.lipschitz), **numbers, **level.written()}
        return {"guarantee": guarantee, "certificate": certificate}


def shared(largest: fmpq, spec: Spec) -> list[float]:
    """Constants of the blocks in proportion to the declared ones."""
    return [below(largest * share) for share in proportions(request_of(spec).lipschitz)]


def needed(declared: Sequence[fmpq]) -> fmpq:
    """Smallest decimal of a double that is not below the largest of the declared constants."""
    return printed(-below(-max(declared)))


def bounds(name: str, constants: Sequence[float]) -> str:
    """Lipschitz conditions of the blocks of a function."""
    if len(constants) == 1:
        return f"|d{name}| <= {constants[0]!r} |dq|"
    return ", ".join(f"|d{name}{i}| <= {c!r} |dq{i}|" for i, c in enumerate(constants, start=1))


def read(spec: Spec, file: ResultFile) -> Claim:
    """Claim of a file, checked: of its constant, and of the largest constant that is tolerated."""
    L, lipschitz = read_gains(spec, file)["L"], read_constant(file, *GUARANTEE)
    told = request_of(spec).pace
    rate = told.told(file.number(*GUARANTEE, told.key))
    require_request(spec, file, L, lipschitz)
    require(file, request_of(spec).bounds.poles)
    storage = request_of(spec).storage if spec.disturbed else request_of(spec).placed
    certificate = read_certificate(spec, file, L, lipschitz, rate, GUARANTEE, CERTIFICATE, storage)
    claim = Claim(lipschitz, certificate, bound=held(request_of(spec), L, certificate, disturbed=spec.disturbed))
    if "admissible" in file.table(*GUARANTEE):
        largest = require_admissible(file, lipschitz)
        more = read_certificate(spec, file, L, largest, rate, ADMISSIBLE, ADMISSIBLE)
        claim = replace(claim, admissible=Claim(largest, more))
    return claim


def moved(spec: Spec, claim: Claim, gains: Mapping[str, Array], S: Exact) -> Claim:
    """Claim of a gain in the states of a spec, from that in the states S x."""
    request, rate = request_of(spec), claim.certificate.rate
    unit = S_PROCEDURE[request.pace].of(
        spec.posed, spec.multiplier, proportions(request.lipschitz), spec.H, rate, gains["L"]
    )
    certificate = certificates.moved(claim.certificate, unit.stretched(claim.lipschitz), S)
    more = claim.admissible and moved(spec, claim.admissible, gains, S)
    bound = held(request, gains["L"], certificate, disturbed=spec.disturbed)
    return Claim(claim.lipschitz, certificate, replace(more, bound=()) if more and more.holds else None, bound)


def held(request: LipschitzRequest, L: Array, certificate: Certificate, *, disturbed: bool) -> tuple[Check, ...]:
    """Whether a designed gain does what is asked, in rationals; of a given one nothing is."""
    return () if request.gains else kept(request.bounds, L, certificate.gamma if disturbed else None)


def read_gains(spec: Spec, file: ResultFile) -> dict[str, Array]:
    """Exact gain of a file."""
    plant = spec.posed
    return {"L": file.matrix((plant.n, len(plant.C)), "observer", "L")}


def read_constant(file: ResultFile, *keys: str) -> fmpq:
    """Constant of a claim."""
    found = file.number(*keys, "lipschitz")
    if not 0 <= approximate(found) < math.inf:
        raise file.wrong(f"{'.'.join(keys)}.lipschitz", "no Lipschitz constant", id="OBS702")
    return found


def read_certificate(
    spec: Spec,
    file: ResultFile,
    L: Array,
    lipschitz: fmpq,
    rate: fmpq,
    claim: Sequence[str],
    witness: Sequence[str],
    bounds: Bounds = NO_BOUNDS,
) -> Certificate:
    """Certificate of a constant and a rate, with gamma, mu1 and mu2, P and multipliers where they stand."""
    plant, request = spec.posed, request_of(spec)
    constants = [lipschitz * share for share in proportions(request.lipschitz)]
    family = S_PROCEDURE[request.pace].of(plant, spec.multiplier, constants, spec.H, rate, L)
    values = read_values(file, family, witness, bounds)
    gamma, mu1, mu2 = read_levels(file, claim) if spec.disturbed else (fmpq(1),) * 3
    return certify(family, gamma, mu1, mu2, values, bounds)


def read_levels(file: ResultFile, claim: Sequence[str]) -> tuple[fmpq, fmpq, fmpq]:
    """Gamma, mu1 and mu2, which are 1 and the square of gamma: the statement relies on it."""
    gamma, mu1, mu2 = (file.number(*claim, key) for key in ("gamma", "mu1", "mu2"))
    name = ".".join(claim)
    if not math.isfinite(approximate(gamma * gamma)):
        raise file.wrong(f"{name}.gamma", "beyond the range of doubles", id="OBS508")
    for key, found, expected in (("mu1", mu1, fmpq(1)), ("mu2", mu2, square_below(gamma))):
        if found != expected:
            raise file.wrong(f"{name}.{key}", f"{approximate(expected)!r} belongs to this gamma", id="OBS705")
    return gamma, mu1, mu2


def require_request(spec: Spec, file: ResultFile, L: Array, lipschitz: fmpq) -> None:
    """Hold a claim against what the spec asks: the family, the decay, the constant, a given gain."""
    request = request_of(spec)
    for key, asked in (("type", request.type), ("relaxation", request.relaxation)):
        if file.at("observer", key) != asked:
            raise file.wrong(f"observer.{key}", f"the spec asks for {asked}", id="OBS707")
    samples.require(spec, file)
    file.require_asked(request.told, "guarantee", request.pace.key)
    declared = needed(request.lipschitz)
    least = fmpq(0) if request.objective == "max-lipschitz" else declared
    if lipschitz < least or (request.objective == "min-gamma" and lipschitz > declared):
        raise file.unasked((least, declared if request.objective == "min-gamma" else None), "guarantee", "lipschitz")
    if request.gains and (printed(request.gains["L"]) != L).any():
        raise file.wrong("observer.L", "differs from the gain that the spec gives", id="OBS707")


def require_admissible(file: ResultFile, lipschitz: fmpq) -> fmpq:
    """Largest constant that is said to be tolerated, as it stands in the guarantee and beside its witness."""
    largest = read_constant(file, *ADMISSIBLE)
    if file.number(*GUARANTEE, "admissible") != file.number(*ADMISSIBLE, "lipschitz"):
        raise file.wrong("guarantee.admissible", "differs from that of the certificate", id="OBS705")
    if largest < lipschitz:
        raise file.wrong("guarantee.admissible", "below the constant that is claimed", id="OBS705")
    return largest


def written(spec: Spec, outcome: Outcome) -> dict[str, Any]:
    """Entry `observer` of a result file: the gain, and figures of the linear error dynamics."""
    if not outcome.gains:
        return {}
    L = outcome.gains["L"]
    P = outcome.claim.certificate.P.astype(float) if isinstance(outcome.claim, Claim) else None
    made = {"relaxation": request_of(spec).relaxation, **samples.written(spec), "L": L.tolist()}
    return {**made, **figures(errors(spec, outcome.gains), P)}
