"""What proves a guarantee, and the proof: no solver is needed, or imported, to hold a certificate against its claim."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from flint import fmpq

from obsdesign.dissipation.guarantee import Quadratic
from obsdesign.dissipation.inequality import SMALL, Incremental
from obsdesign.families.incremental.guarantee import Reconstruction
from obsdesign.families.incremental.linf import Linf
from obsdesign.families.incremental.reconstruction import Slope, constants, obstacle
from obsdesign.families.lipschitz.claim import LipschitzClaim
from obsdesign.lmi.formula import Array, Inequality, Values, approximate, identity, rational
from obsdesign.lmi.proof import Check, prove
from obsdesign.model import loop
from obsdesign.spec import Spec, arguments


@dataclass(frozen=True)
class Certificate:
    """Storage function and scales, in rationals, that prove the level gamma, and what was checked of them."""

    theorem: type[Incremental]
    alpha: fmpq
    gamma: fmpq
    mu1: fmpq
    mu2: fmpq
    P: Array  # (n, n)
    multipliers: dict[str, Array]  # by the names of the unknowns
    checks: tuple[Check, ...]
    reconstruction: "Reconstructed | None" = None  # also proved of these gains

    @property
    def holds(self) -> bool:
        """Whether the guarantee is proved."""
        return all(check.holds for check in self.conditions())

    def conditions(self) -> Iterator[Check]:
        """Every condition, those of the bound on the reconstruction of w included."""
        yield from self.checks
        if self.reconstruction:
            yield from self.reconstruction.conditions()

    @property
    def guarantee(self) -> Quadratic:
        """Guarantee in doubles."""
        P = np.vectorize(approximate, otypes=[float])(self.P)
        gamma, alpha, mu1, mu2 = map(approximate, (self.gamma, self.alpha, self.mu1, self.mu2))
        bound = self.reconstruction.bound if self.reconstruction else None
        return self.theorem.guarantee(gamma, alpha, mu1, mu2, P, bound)


def certify(
    family: Incremental, gamma: fmpq, mu1: fmpq, mu2: fmpq, values: Values, largest: fmpq | None = None
) -> Certificate:
    """Check every condition of the claim exactly.

    Parameters
    ----------
    family
        Plant, multiplier, alpha and both gains, in rationals.
    gamma, mu1, mu2
        The claim, such as |z|_2 <= gamma |v|_2 from zero error, and the numbers that prove it.
    values
        P and the multipliers, in rationals.
    largest
        Bound on the eigenvalues of P, if the spec has one.
    """
    bounded = (
        [] if largest is None else [Inequality(SMALL, values["P"] - largest * identity(len(values["P"]), values["P"]))]
    )
    proved = prove([*family.theorem({**values, "mu1": rational([[mu1]]), "mu2": rational([[mu2]])}), *bounded])
    plant = family.plant
    room = family.room(gamma, mu1, mu2)
    verdict = loop.proved(plant.Dqf + family.L2 @ plant.Df, family.multiplier, values)
    checks = (
        *proved,
        rate(family),
        Check("mu1 > 0", mu1 > 0, approximate(mu1)),
        Check("gamma >= 0", gamma >= 0, approximate(gamma)),
        Check("mu2 >= 0", mu2 >= 0, approximate(mu2)),
        Check(family.promise, room >= 0, approximate(room)),
        Check(verdict.sentence, verdict.unique, 1.0 if verdict.unique else -1.0),
    )
    multipliers = {name: value for name, value in values.items() if name != "P"}
    return Certificate(type(family), family.alpha, gamma, mu1, mu2, values["P"], multipliers, checks)


def rate(family: Incremental) -> Check:
    """Whether the decay rate is positive, or not negative where the family allows zero."""
    allowed = family.alpha >= 0 if family.still else family.alpha > 0
    return Check("decay >= 0" if family.still else "alpha > 0", allowed, approximate(family.alpha))


@dataclass(frozen=True)
class SlopeProof:
    """Bound on the slope of f, or on half its variation, and the multiplier that proves it."""

    bound: fmpq
    values: dict[str, Array]
    checks: tuple[Check, ...]

    @property
    def holds(self) -> bool:
        """Whether the bound is proved."""
        return all(check.holds for check in self.checks)


def prove_slope(slope: Slope, bound: fmpq, values: Values) -> SlopeProof:
    """Check a bound on the slope exactly."""
    checks = prove(slope.theorem({**values, "square": rational([[bound * bound]])}))
    return SlopeProof(bound, dict(values), (*checks, Check("s >= 0", bound >= 0, approximate(bound))))


@dataclass(frozen=True)
class Reconstructed:
    """Proof of a bound on |what - w|: a certificate for each level, the slopes of f, and the three constants."""

    levels: dict[str, Certificate]
    slopes: dict[str, SlopeProof]
    constants: tuple[fmpq, fmpq, fmpq]  # of |w|_inf, |w'|_inf, |x'|_inf
    checks: tuple[Check, ...]

    @property
    def holds(self) -> bool:
        """Whether the bound is proved."""
        return all(check.holds for check in self.conditions())

    def conditions(self) -> Iterator[Check]:
        """Conditions of the levels, of the slopes and of the constants."""
        parts = {name: level.checks for name, level in self.levels.items()}
        parts |= {name: slope.checks for name, slope in self.slopes.items()}
        for name, checks in parts.items():
            yield from (replace(check, name=f"{name}: {check.name}") for check in checks)
        yield from self.checks

    @property
    def bound(self) -> Reconstruction:
        """Constants in doubles, with the sum of the storage functions and the slowest of their rates."""
        w, w_rate, x_rate = map(approximate, self.constants)
        storages = [level.guarantee for level in self.levels.values()]
        alpha = min(storage.alpha for storage in storages)
        return Reconstruction(w, w_rate, x_rate, alpha, np.sum([storage.P for storage in storages], axis=0))


def inapplicable(spec: Spec, slope: fmpq | None) -> str | None:
    """Why no bound on |what - w| can be proved for a spec, whose f has a slope of at most `slope`; None if one can."""
    beside = {name for b in spec.nonlinearities for f in b.f or () for name in f.names.difference(arguments(b.nq))}
    if beside:
        return f"Theorem 4 needs f to depend on q only, and it depends on {', '.join(sorted(beside))}"
    if any(term.names for term in spec.gq):
        return "Theorem 4 needs an argument without known terms (gq = 0)"
    return obstacle(spec.augmented, slope)


def reconstructed(
    family: Linf,
    levels: dict[str, Certificate],
    slopes: dict[str, SlopeProof],
    claimed: tuple[fmpq, fmpq, fmpq],
) -> Reconstructed:
    """Hold constants against what the levels and slopes prove."""
    gammas = {name: level.gamma for name, level in levels.items()}
    least = constants(family, gammas, {name: slope.bound for name, slope in slopes.items()})
    checks = tuple(
        Check(f"{name} is large enough", c >= bound, approximate(c - bound))
        for name, c, bound in zip(("c_w", "c_w'", "c_x'"), claimed, least, strict=True)
    )
    return Reconstructed(levels, slopes, claimed, checks)


def lipschitz_claim(
    spec: Spec, lipschitz: fmpq, guarantee: Quadratic, admissible: tuple[fmpq, Quadratic] | None
) -> LipschitzClaim:
    """What a Lipschitz constant, and a larger one, that are proved for a gain say of the plant of a spec."""
    drive = spec.observer.drive if spec.disturbed else ""
    return LipschitzClaim(spec.lipschitz.lipschitz, lipschitz, guarantee, admissible, drive, spec.validity)


def statement(spec: Spec, certificate: Certificate) -> str:
    """Guarantee of a spec's family in words, and where it holds."""
    said = certificate.theorem.statement(approximate(certificate.gamma), approximate(certificate.alpha))
    if certificate.reconstruction:
        bound = certificate.reconstruction.bound
        rest = f" + {bound.x_rate!r} sup|x'|" if bound.x_rate else ""
        said += (
            f"; limsup |what - w| <= {bound.w!r} sup|w| + {bound.w_rate!r} sup|w'|{rest}, what = pinv(B) L1 (yhat - y)"
        )
    return f"{said}; local: {spec.validity}" if spec.validity else said
