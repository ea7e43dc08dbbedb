"""Claims of observers with the gains L1 and L2 (families l2 and linf), as a file holds them and as it is read."""

from collections.abc import Mapping, Sequence
from typing import Any

from flint import fmpq

from obsdesign.dissipation import certificate as certificates
from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.certificate import Certificate, certify, kept, read_values
from obsdesign.dissipation.discrete import FILTERED, PREDICTED
from obsdesign.dissipation.figures import figures
from obsdesign.dissipation.guarantee import Quadratic
from obsdesign.dissipation.inequality import Incremental
from obsdesign.families import samples
from obsdesign.families.incremental.defect import at_samples
from obsdesign.families.incremental.observer import errors
from obsdesign.families.incremental.reconstruction import (
    SLOPE,
    Reconstructed,
    inapplicable,
    levels,
    prove_slope,
    reconstructed,
    slopes,
)
from obsdesign.families.incremental.request import Request, posed, request_of
from obsdesign.families.incremental.theorems import Linf
from obsdesign.families.outcome import Outcome
from obsdesign.families.poles import require, stated, told
from obsdesign.files import ResultFile
from obsdesign.files import checks as listed
from obsdesign.lmi.formula import Array, Exact
from obsdesign.lmi.proof import Check, Proved
from obsdesign.model.filtered import gain_of
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec
from obsdesign.tables.text import at_least, at_most

MORE = ", of v one sample more"


@dataclass(frozen=True)
class Claim(Proved):
    """Gains reach a level gamma at a decay rate; and |what - w| is bounded, where that is asked for."""

    certificate: Certificate
    reconstruction: Reconstructed | None = None
    asked: tuple[Check, ...] = ()  # that a designed gain keeps the bounds of the spec

    @property
    def checks(self) -> tuple[Check, ...]:
        """Every condition, those of the bound on the reconstruction of w included."""
        more = self.reconstruction.conditions() if self.reconstruction else ()
        return (*self.certificate.checks, *self.asked, *more)

    def guarantee(self, spec: Spec) -> Quadratic:
        """Guarantee in doubles."""
        bound = self.reconstruction.bound if self.reconstruction else None
        return replace(self.certificate.guarantee_at(spec.period), reconstruction=bound)

    def headline(self, spec: Spec) -> str:
        """Claim in one line."""
        gamma, about, rate = at_most(self.gamma_v(spec)), self.certificate.theorem.about, self.certificate.rate
        decay = f"rho {at_most(1 - rate)}" if about.pace.sampled else f"decay rate {at_least(rate)} 1/s"
        name = "gamma_v" if spec.observer.filtered else "gamma"
        said = "; ".join([f"{name} {gamma}, {about.gamma.replace('gamma', name)}", decay, *told(self.certificate)])
        if spec.continuous is None or spec.continuous.defect is None:
            return said
        error = at_most(at_samples(spec, self.certificate)["error"])
        return f"{said}; at the samples of the continuous plant |z| <= {error}, as guarantee.at_samples says"

    def statement(self, spec: Spec) -> str:
        """Guarantee of the family in words, and where it holds."""
        g = self.certificate.guarantee
        said = self.certificate.theorem.about.statement.format(rate=repr(g.rate), **self.words(spec))
        bound = self.reconstruction.bound if self.reconstruction else None
        if bound:
            rest = f" + {bound.x_rate!r} sup|x'|" if bound.x_rate else ""
            constants = f"{bound.w!r} sup|w| + {bound.w_rate!r} sup|w'|{rest}"
            said += f"; limsup |what - w| <= {constants}, what = pinv(B) L1 (yhat - y)"
        return "; ".join([said, *stated(self.certificate), *spec.provisos])

    def words(self, spec: Spec) -> dict[str, str]:
        """Gamma for v itself and the equations of the observer, of plants in discrete time; else gamma."""
        if spec.period is None:
            return {"gamma": repr(self.certificate.guarantee.gamma)}
        if not spec.observer.filtered:
            return {"gamma": repr(self.certificate.guarantee.gamma), "equations": PREDICTED, "more": "", "times": ""}
        times = "2 " if self.factor(spec) == 2 else ""
        return {"gamma": repr(self.gamma_v(spec)), "equations": FILTERED, "more": MORE, "times": times}

    def factor(self, spec: Spec) -> int:
        """Square of gamma_v over gamma."""
        return gain_of(spec.augmented, peaks=self.certificate.guarantee.norm == "sup")

    def gamma_v(self, spec: Spec) -> float:
        """What gamma of filtered estimates, for v = (v_b at k, v_d at k + 1), says of v itself, rounded up."""
        return samples.gamma_of_v(spec, self.certificate.gamma, self.certificate.guarantee.norm)

    def theorem(self, spec: Spec) -> str:
        """Claim as a file of Coq; raises `UnexportedError`."""
        from obsdesign.coq.theorem import exported

        request = request_of(spec)
        bounds = NO_BOUNDS if request.gains else request.bounds
        more = self.reconstruction.of_a_linear_plant() if self.reconstruction else None
        return exported(self.certificate, spec, self.statement(spec), bounds, reconstruction=more)

    def written(self, spec: Spec, limits: Mapping[str, Any]) -> dict[str, Any]:
        """What is proved and the limit it is near to, and the witness."""
        g = self.certificate.guarantee
        of_v = {"gamma_v": self.gamma_v(spec)} if spec.observer.filtered else {}
        guarantee = {
            "gamma": g.gamma,
            **of_v,
            **self.certificate.decay(spec.period),
            "mu1": g.mu1,
            "mu2": g.mu2,
            **(self.certificate.poles.written() if self.certificate.poles else {}),
            **limits,
        }
        if spec.continuous and spec.continuous.defect is not None:
            guarantee["at_samples"] = at_samples(spec, self.certificate)
        certificate = self.certificate.written()
        certificate["checks"] += listed(self.asked)
        if self.reconstruction:
            bound = self.reconstruction.bound
            guarantee["reconstruction"] = {"w": bound.w, "w_rate": bound.w_rate, "x_rate": bound.x_rate}
            certificate["reconstruction"] = self.reconstruction.written()
        return {"guarantee": {**guarantee, "statement": self.statement(spec)}, "certificate": certificate}


def read(spec: Spec, file: ResultFile) -> Claim:
    """Claim of a file, checked: the guarantee, and the bound on the reconstruction of w if one is claimed."""
    gains = read_gains(spec, file)
    require_request(spec, file, gains)
    require(file, request_of(spec).bounds.poles)
    request = request_of(spec)
    rate = request.pace.told(file.number("guarantee", request.pace.key))
    family = posed(spec, rate, gains["L1"], gains["L2"])
    certificate = read_certificate(file, family, ("guarantee",), ("certificate",), request.kept)
    claim = Claim(certificate, asked=held(request, gains["L1"], certificate.gamma))
    if "reconstruction" in file.table("guarantee"):
        claim = replace(claim, reconstruction=read_reconstruction(spec, file, family))
    return claim


def moved(spec: Spec, claim: Claim, gains: Mapping[str, Array], S: Exact) -> Claim:
    """Claim of gains in the states of a spec, from that in the states S x."""
    family = posed(spec, claim.certificate.rate, gains["L1"], gains["L2"])
    certificate = certificates.moved(claim.certificate, family, S)
    return Claim(certificate, asked=held(request_of(spec), gains["L1"], certificate.gamma))


def held(request: Request, L1: Array, gamma: fmpq) -> tuple[Check, ...]:
    """Whether a designed gain does what is asked, in rationals; of a given one nothing is."""
    return () if request.gains else kept(replace(request.bounds, gamma=request.level), L1, gamma)


def read_gains(spec: Spec, file: ResultFile) -> dict[str, Array]:
    """Exact gains of a file."""
    plant = spec.posed
    shapes = {"L1": (plant.n, len(plant.C)), "L2": (len(plant.Cq), len(plant.C))}
    return {name: file.matrix(shape, "observer", name) for name, shape in shapes.items()}


def read_certificate(
    file: ResultFile, family: Incremental, claim: Sequence[str], witness: Sequence[str], bounds: Bounds = NO_BOUNDS
) -> Certificate:
    """Certificate of a claim (gamma, mu1, mu2) by a witness (P, multipliers), checked."""
    values = read_values(file, family, witness, bounds)
    gamma, mu1, mu2 = (file.number(*claim, key) for key in ("gamma", "mu1", "mu2"))
    return certify(family, gamma, mu1, mu2, values, bounds)


def read_reconstruction(spec: Spec, file: ResultFile, family: Incremental) -> Reconstructed:
    """Bound on |what - w|, with its levels and slopes checked."""
    root = ("certificate", "reconstruction")
    if not spec.observer.reconstruct or not isinstance(family, Linf):
        raise file.wrong("guarantee.reconstruction", "the spec does not ask for it", id="OBS707")
    proofs = {}
    for name, slope in slopes(family.multiplier).items() if family.plant.Bf.shape[1] else ():
        values = file.unknowns(slope.unknowns, *root, "slopes", name, "values")
        proofs[name] = prove_slope(slope, file.number(*root, "slopes", name, "bound"), values)
    reason = inapplicable(spec, proofs[SLOPE].bound if proofs else None)
    if reason:
        raise file.wrong("guarantee.reconstruction", reason, id="OBS503")
    certificates = {}
    for name, level in levels(family).items():
        path = (*root, "levels", name)
        certificates[name] = read_certificate(file, replace(level, rate=file.number(*path, "alpha")), path, path)
    c_w, c_w_rate, c_x_rate = (file.number("guarantee", "reconstruction", key) for key in ("w", "w_rate", "x_rate"))
    return reconstructed(family, certificates, proofs, (c_w, c_w_rate, c_x_rate))


def require_request(spec: Spec, file: ResultFile, gains: Mapping[str, Array]) -> None:
    """Hold the claim against what the spec asks: the family, the decay, given gains, the statement."""
    request = request_of(spec).printed()
    if file.at("observer", "type") != request.type:
        raise file.wrong("observer.type", f"the spec asks for {request.type}", id="OBS707")
    file.number("guarantee", "gamma")  # what is missing or no number is told of it first
    samples.require(spec, file)
    file.require_asked(request.told, "guarantee", request.pace.key)
    given = request.gains or ({"L2": request.L2} if request.L2 is not None else {})
    for name, found in gains.items():
        if name in given and (given[name] != found).any():
            raise file.wrong(f"observer.{name}", "differs from the gain that the spec gives", id="OBS707")


def written(spec: Spec, outcome: Outcome) -> dict[str, Any]:
    """Entry `observer` of a result file: gains, and figures of the linear error dynamics."""
    if not outcome.gains:
        return {}
    P = outcome.claim.certificate.P.astype(float) if isinstance(outcome.claim, Claim) else None
    gains = {name: outcome.gains[name].tolist() for name in ("L1", "L2")}
    return {**samples.written(spec), **gains, **figures(errors(spec, outcome.gains), P)}
