"""Claims of unknown-input observers, as a file holds them and as it is read."""

from collections.abc import Mapping
from typing import Any

from flint import fmpq

from obsdesign.dissipation.certificate import Certificate, certify, read_values
from obsdesign.dissipation.figures import figures
from obsdesign.dissipation.guarantee import Quadratic
from obsdesign.families.incremental.claim import held
from obsdesign.families.incremental.request import posed
from obsdesign.families.incremental.request import request_of as inner_request
from obsdesign.families.outcome import Outcome
from obsdesign.families.poles import require, stated, told
from obsdesign.families.unknown_input import transform
from obsdesign.families.unknown_input.guarantee import Shifted
from obsdesign.families.unknown_input.observer import errors, exact
from obsdesign.families.unknown_input.request import reduced, request_of
from obsdesign.families.unknown_input.theorem import DIRECT, OBSERVER, gain_words
from obsdesign.files import ResultFile
from obsdesign.files import checks as listed
from obsdesign.lmi.formula import Array, Exact, printed
from obsdesign.lmi.proof import Check, Proved
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec
from obsdesign.tables.text import at_least, at_most


@dataclass(frozen=True)
class Claim(Proved):
    """Whatever the cancelled channels are, the error decays, and has a gain from the others.

    Without f it does not depend on them at all; the f of the plant depends on its state, and that on them.
    """

    certificate: Certificate  # of the plant that is left
    E: Exact  # (n, ny)
    cancels: tuple[Check, ...]  # that T B = 0 for these channels
    asked: tuple[Check, ...] = ()  # that a designed gain keeps the bounds of the spec

    @property
    def checks(self) -> tuple[Check, ...]:
        """Every condition."""
        return (*self.certificate.checks, *self.cancels, *self.asked)

    def guarantee(self, spec: Spec) -> Quadratic:
        """Guarantee in doubles."""
        found = self.certificate.guarantee_at(spec.period)
        assert isinstance(found, Shifted)
        return replace(found, shift=self.shift(spec), T=transform.projector(spec.augmented, self.E))

    def shift(self, spec: Spec) -> Exact | None:
        """E D of the other channels, where v is in the estimates at once."""
        found = transform.direct(spec.augmented, request_of(spec).cancel, self.E)
        return found if (found != 0).any() else None

    def headline(self, spec: Spec) -> str:
        """Claim in one line."""
        rate, about = self.certificate.rate, self.certificate.theorem.about
        decay = f"rho {at_most(1 - rate)}" if about.pace.sampled else f"decay rate {at_least(rate)} 1/s"
        meaning = gain_words(direct=self.shift(spec) is not None)
        level = [f"gamma {at_most(self.certificate.gamma)}, {meaning}"] if spec.disturbed else []
        names = ", ".join(spec.cancelled)
        alone = not self.certificate.family.plant.Bf.shape[1]
        free = f"the error does not depend on {names}" if alone else f"whatever {names} is"
        return "; ".join([*level, decay, free, *told(self.certificate)])

    def statement(self, spec: Spec) -> str:
        """Guarantee in words, with the observer written out, and where it holds."""
        g, sampled = self.certificate.guarantee, self.certificate.theorem.about.pace.sampled
        eps = "e" if self.shift(spec) is None else "eps"
        names = ", ".join(spec.cancelled)
        others = [name for name in spec.plant.exogenous if name not in spec.cancelled]
        left = f"{g.rate!r}^k" if sampled else f"exp(-{g.rate!r} t)"
        decay = f"|{eps}| <= sqrt(cond(P)) {left} |{eps}0|"
        parts = [f"whatever {names} is, {decay}" + (" where v = 0" if spec.disturbed else "")]
        if spec.disturbed:
            gain = (
                f"sum |z|^2 <= {eps}0' P {eps}0 / mu1 + {g.gamma!r}^2 sum |v|^2 over any first samples"
                if sampled
                else f"norm2(z) <= sqrt({eps}0' P {eps}0 / mu1) + {g.gamma!r} norm2(v)"
            )
            parts += [f"{gain}, v = ({', '.join(others)})"]
        parts += [DIRECT] if eps != "e" else []
        equations = OBSERVER.format(next="+" if sampled else "'")
        parts += [f"for {equations}, T B = 0 in the columns of {names}"]
        return "; ".join([*parts, *stated(self.certificate), *spec.provisos])

    def written(self, spec: Spec, limits: Mapping[str, Any]) -> dict[str, Any]:
        """What is proved and the limit it is near to, and the witness."""
        g = self.certificate.guarantee
        guarantee = {
            **({"gamma": g.gamma} if spec.disturbed else {}),
            **self.certificate.decay(spec.period),
            **({"mu1": g.mu1, "mu2": g.mu2} if spec.disturbed else {}),
            **(self.certificate.poles.written() if self.certificate.poles else {}),
            **limits,
            "statement": self.statement(spec),
        }
        certificate = self.certificate.written()
        certificate["checks"] += listed((*self.cancels, *self.asked))
        return {"guarantee": guarantee, "certificate": certificate}


def cancelling(spec: Spec, E: Exact) -> tuple[Check, ...]:
    """That T B = 0 in the columns of the cancelled channels, T = I - E C, and that y has no f that E takes, exactly."""
    plant: Plant[Exact] = spec.augmented
    gone = transform.projector(plant, E) @ plant.B[:, list(request_of(spec).cancel)]
    checks = [(f"T B = 0 for {', '.join(spec.cancelled)}, T = I - E C", not (gone != 0).any())]
    if plant.Df.any():
        checks += [("E Df = 0", not (E @ plant.Df != 0).any())]
    return tuple(Check(name, holds, 0.0 if holds else -1.0) for name, holds in checks)


def read(spec: Spec, file: ResultFile) -> Claim:
    """Claim of a file, checked."""
    gains = read_gains(spec, file)
    require_request(spec, file, gains)
    require(file, request_of(spec).bounds.poles)
    E, inner = gains["E"], reduced(spec, gains["E"])
    one = inner_request(inner)
    rate = one.pace.told(file.number("guarantee", one.pace.key))
    family = posed(inner, rate, -gains["L"], one.L2)
    values = read_values(file, family, ("certificate",), one.kept)
    keys = ("gamma", "mu1", "mu2")
    gamma, mu1, mu2 = (file.number("guarantee", key) if spec.disturbed else fmpq(1) for key in keys)
    certificate = certify(family, gamma, mu1, mu2, values, one.kept)
    return Claim(certificate, E, cancelling(spec, E), held(one, gains["L"], certificate.gamma))


def read_gains(spec: Spec, file: ResultFile) -> dict[str, Array]:
    """Exact gains of a file."""
    shape = (spec.augmented.n, len(spec.augmented.C))
    return {name: file.matrix(shape, "observer", name) for name in ("E", "L")}


def require_request(spec: Spec, file: ResultFile, gains: Mapping[str, Array]) -> None:
    """Hold the claim against what the spec asks: the family, the decay, given gains."""
    one = request_of(spec)
    if file.at("observer", "type") != one.type:
        raise file.wrong("observer.type", f"the spec asks for {one.type}", id="OBS707")
    if spec.disturbed:
        file.number("guarantee", "gamma")  # what is missing or no number is told of it first
    if spec.period is not None and file.number("observer", "period") != printed(spec.period):
        raise file.wrong("observer.period", f"the spec says {float(spec.period)!r} s", id="OBS707")
    file.require_asked(inner_request(reduced(spec)).printed().told, "guarantee", one.pace.key)
    known = {name: gain if name == "E" else printed(gain) for name, gain in (one.gains or {}).items()}
    for name, found in gains.items():
        if name in known and (known[name] != found).any():
            raise file.wrong(f"observer.{name}", "differs from the gain that the spec gives", id="OBS707")


def written(spec: Spec, outcome: Outcome) -> dict[str, Any]:
    """Entry `observer` of a result file: gains, and figures of the linear error dynamics."""
    if not outcome.gains:
        return {}
    P = outcome.claim.certificate.P.astype(float) if isinstance(outcome.claim, Claim) else None
    period = {} if spec.period is None else {"period": float(spec.period)}
    E = [[entry(x) for x in row] for row in exact(spec, outcome.gains["E"])]
    return {
        "cancelled": list(spec.cancelled),
        **period,
        "E": E,
        "L": outcome.gains["L"].tolist(),
        **figures(errors(spec, outcome.gains), P),
    }


def entry(x: fmpq) -> float | str:
    """Number that a decimal of a double is, or else p/q."""
    return float(x) if printed(float(x)) == x else str(x)
