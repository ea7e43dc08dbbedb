"""Claims of observers whose measurements arrive sporadically, as a file holds them and as it is read."""

from collections.abc import Mapping, Sequence
from typing import Any

from flint import fmpq

from obsdesign.families.outcome import Outcome
from obsdesign.families.sporadic import certificate as certificates
from obsdesign.families.sporadic.certificate import (
    CONSTANTS,
    LARGEST_EXPONENT,
    MEANING,
    SporadicCertificate,
    certify_sporadic,
    jitter,
    span,
)
from obsdesign.families.sporadic.clock import file as clocked
from obsdesign.families.sporadic.clock.claim import ClockClaim
from obsdesign.families.sporadic.guarantee import SporadicGuarantee
from obsdesign.families.sporadic.held import held, read_gains, require_asked
from obsdesign.families.sporadic.observer import sampled
from obsdesign.families.sporadic.request import SporadicRequest, request_of
from obsdesign.files import ResultFile
from obsdesign.files import checks as listed
from obsdesign.lmi.formula import Array, Exact, above, approximate, below
from obsdesign.lmi.proof import Check, Proved
from obsdesign.records import dataclass, replace
from obsdesign.sections.scalars import described
from obsdesign.spec import Spec
from obsdesign.tables.text import at_least, at_most


@dataclass(frozen=True)
class Claim(Proved):
    """Gains reach a level gamma at a decay rate for every sequence of measurements that are T1 to T2 apart."""

    certificate: SporadicCertificate
    longest: SporadicCertificate | None = None  # for the largest T2 that given gains are proved to tolerate
    asked: tuple[Check, ...] = ()  # that a designed gain keeps the bound of the spec
    stated: Mapping[str, fmpq] | None = None  # constants of a file; None: those that are proved

    @property
    def checks(self) -> tuple[Check, ...]:
        """Every condition, those of the longest T2 included."""
        more = self.longest.checks if self.longest else ()
        return (
            *self.certificate.checks,
            *self.asked,
            *self.certificate.keep(self.constants),
            *(replace(check, name=f"T2_max: {check.name}") for check in more),
        )

    @property
    def constants(self) -> Mapping[str, fmpq]:
        """Constants of the statement; see `SporadicCertificate.constants`."""
        return self.certificate.constants if self.stated is None else self.stated

    def guarantee(self, spec: Spec) -> SporadicGuarantee:  # noqa: ARG002
        """Guarantee in doubles."""
        return self.certificate.guarantee

    def headline(self, spec: Spec) -> str:  # noqa: ARG002
        """Claim in one line."""
        proof = self.certificate
        gamma, decay = at_most(proof.gamma), at_least(proof.family.decay)
        return f"gamma {gamma}, {MEANING}; decay rate {decay} 1/s, intervals {span(proof.T1, proof.T2)}"

    def statement(self, spec: Spec) -> str:
        """Guarantee in words, with the observer written out, and where it holds."""
        return "; ".join([self.certificate.statement(self.constants), *spec.provisos])

    def theorem(self, spec: Spec) -> str:  # noqa: ARG002
        """None: raises `UnexportedError`."""
        from obsdesign.coq.theorem import UnexportedError

        raise UnexportedError("claims of a proposition are not exported yet, those of relaxation clock are")

    def written(self, spec: Spec, limits: Mapping[str, Any]) -> dict[str, Any]:
        """What is proved, the limit it is near to, and the witnesses."""
        proof, longest = self.certificate, self.longest
        certificate = proof.written()
        certificate["checks"] += listed((*self.asked, *proof.keep(self.constants)))
        if longest:
            numbers = {key: approximate(getattr(longest, key)) for key in ("gamma", "mu")}
            delta = approximate(longest.family.delta)
            certificate["T2_max"] = {**numbers, "delta": delta, **longest.written()}
        guarantee = {
            "kind": "exponential",
            "gamma": above(proof.gamma),
            "decay": below(proof.family.decay),
            **{name: (below if name == "rate" else above)(value) for name, value in self.constants.items()},
            **jitter(proof.T1, proof.T2),
            "T1": above(proof.T1),
            "T2": below(proof.T2),
            **({"T2_max": below(longest.T2)} if longest else {}),
            "mu": approximate(proof.mu),
            **limits,
            "statement": self.statement(spec),
        }
        return {"guarantee": guarantee, "certificate": certificate}


def moved(spec: Spec, claim: "Claim | ClockClaim", gains: Mapping[str, Array], S: Exact) -> Claim | None:
    """Claim of gains in the states of a spec, from that in the states S x; None of certificates of a clock."""
    if not isinstance(claim, Claim):
        return None
    problem, pair = (spec.augmented, spec.multiplier, spec.H), (gains["L"], gains["H"])
    longest = claim.longest and certificates.moved(claim.longest, problem, pair, S)
    asked = held(request_of(spec), {"L": gains["L"]})
    kept = longest if longest and longest.holds else None
    return Claim(certificates.moved(claim.certificate, problem, pair, S), kept, asked)


def read(spec: Spec, file: ResultFile) -> "Claim | ClockClaim":
    """Claim of a file, checked: of its intervals, and of the longest that is tolerated.

    Raises `UsageError`: it is malformed, or not what the spec asks for.
    """
    kind = file.table("guarantee").get("kind", "exponential")
    if kind not in ("clock", "exponential"):
        raise file.wrong("guarantee.kind", f"expected clock or exponential, found {described(kind)}", id="OBS702")
    if kind == "clock":
        return clocked.read(spec, file)
    gains = read_gains(spec, file)
    asked = {key: file.number("guarantee", key) for key in ("decay", "T1", "T2")}
    require_request(file, request_of(spec), gains, asked, spec.augmented.C)
    certificate = read_certificate(spec, file, gains, asked, ("guarantee",), ("observer", "delta"), ("certificate",))
    claim = Claim(certificate, asked=held(request_of(spec), gains))
    known = {*claim.constants, *file.table("guarantee")}
    stated = {key: file.number("guarantee", key) for key in CONSTANTS if key in known}
    claim = replace(claim, stated=stated) if stated != claim.constants else claim
    if "T2_max" not in file.table("guarantee"):
        return claim
    root = ("certificate", "T2_max")
    asked["T2"] = file.number("guarantee", "T2_max")
    return replace(claim, longest=read_certificate(spec, file, gains, asked, root, (*root, "delta"), root))


def read_certificate(
    spec: Spec,
    file: ResultFile,
    gains: Mapping[str, Array],
    claim: Mapping[str, fmpq],
    level: Sequence[str],
    exponent: Sequence[str],
    witness: Sequence[str],
) -> SporadicCertificate:
    """Certificate of a claim (T1, T2, decay), with gamma and mu, delta, and P1, P2 and multipliers where they stand."""
    plant = spec.augmented
    n, ny = plant.n, len(plant.C)
    delta = file.number(*exponent)
    if not 0 <= delta * claim["T2"] <= LARGEST_EXPONENT:
        raise file.wrong(".".join(exponent), f"delta T2 is not between 0 and {LARGEST_EXPONENT}", id="OBS702")
    values = {"P1": file.matrix((n, n), *witness, "P1"), "P2": file.matrix((ny, ny), *witness, "P2")}
    values |= file.unknowns(spec.multiplier.unknowns(), *witness, "multipliers")
    gamma, mu = file.number(*level, "gamma"), file.number(*level, "mu")
    intervals, pair = (claim["T1"], claim["T2"]), (gains["L"], gains["H"])
    return certify_sporadic(plant, spec.multiplier, spec.H, pair, intervals, claim["decay"], delta, gamma, mu, values)


def require_request(
    file: ResultFile, request: SporadicRequest, gains: Mapping[str, Array], claim: Mapping[str, fmpq], C: Array
) -> None:
    """Hold a claim against what the spec asks: the family, T1, T2, the decay, given gains, and delta."""
    require_asked(file, request, gains, claim, C)
    if not request.gains:
        low, high = request.delta.low, request.delta.high
        if low == high:
            file.require_asked((low, high), "observer", "delta")


def written(spec: Spec, outcome: Outcome) -> dict[str, Any]:
    """Entry `observer` of a result file: gains, their intervals, and how the error contracts over one."""
    if isinstance(outcome.claim, ClockClaim):
        return clocked.written(spec, outcome.claim)
    if not isinstance(outcome.claim, Claim):
        return {}
    proof, gains = outcome.claim.certificate, outcome.gains
    return {
        "L": gains["L"].tolist(),
        "H": gains["H"].tolist(),
        "T1": approximate(proof.T1),
        "T2": approximate(proof.T2),
        "delta": approximate(proof.family.delta),
        **sampled(spec, gains, proof.guarantee).figures(),
    }
