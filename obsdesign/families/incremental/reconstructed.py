"""Proof of the bound on |what - w|: a certificate for each level, the slopes of f, and the constants that follow."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.dissipation.certificate import Certificate
from obsdesign.families.incremental.guarantee import Reconstruction
from obsdesign.families.incremental.linf import Linf
from obsdesign.families.incremental.reconstruction import Slope, constants, obstacle
from obsdesign.files import checks as listed
from obsdesign.files import written
from obsdesign.lmi.formula import Array, Values, approximate, rational
from obsdesign.lmi.proof import Check, Proved, prove
from obsdesign.spec import Spec, arguments


@dataclass(frozen=True)
class SlopeProof(Proved):
    """Bound on the slope of f, or on half its variation, and the multiplier that proves it."""

    bound: fmpq
    values: dict[str, Array]
    checks: tuple[Check, ...]


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

    def written(self) -> dict[str, Any]:
        """Witness and checks, as a result file holds them."""
        levels = {
            name: {"gamma": approximate(level.gamma), "alpha": approximate(level.alpha), "mu1": approximate(level.mu1)}
            | {"mu2": approximate(level.mu2)}
            | level.written()
            for name, level in self.levels.items()
        }
        slopes = {
            name: {"bound": approximate(slope.bound), "values": {n: written(v) for n, v in slope.values.items()}}
            | {"checks": listed(slope.checks)}
            for name, slope in self.slopes.items()
        }
        return {"levels": levels, "slopes": slopes, "checks": listed(self.checks)}

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
