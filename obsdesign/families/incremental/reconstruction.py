"""Reconstruction of w: Theorems 2 and 4 of Chakrabarty, Corless, Buzzard, Zak and Rundell (2016).

For a plant without a disturbance model and with B of full column rank, what = pinv(B) L1 (yhat - y) estimates w. Since
what - w = pinv(B) (e' - A e - Bf df), with qd = qhat - q and d = (Df(qhat) - Df(q)) q',

    limsup |what - w| <= c_w |w|_inf + c_w' |w'|_inf + c_x' |x'|_inf

where c_w  = g1 + k1 |pinv(B) Bf| (g2 + |Dq + L2 D|),    g1 = level of pinv(B) A e,   g2 = level of (Cq + L2 C) e,
      c_w' = g3 + g4 k2 |Dq|,    c_x' = g4 k2 |Cq|,      g3, g4 = levels of pinv(B) e' from w' and from d,
      k1 = s1 / (1 - s1 |Dqf|),  k2 = s2 / (1 - s1 |Dqf|),

s1 bounds the slope of f and s2 its variation. Each level is a gamma of the family linf, with a storage function and an
alpha of its own. The paper shares one among all, and takes g3 and g4 together; both are never tighter: the equation of
e' is linear in e', w' and d, with the Jacobian of f along the run in it, so their responses add up. Without f
(Theorem 2) c_w = g1, c_w' = g3, c_x' = 0.

Misprint: block (1, 4) of the second factor of (45a) is D_qn, not zero: d enters q' = (Cq + L2 C) e' + D_qn (J q' + d)
as well; the printed inequality claims less than the true gain. Assumption 2, a bounded slope, fails for q^3: then
nothing is proved of what, and Theorem 1 holds all the same.
"""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import fmpq, fmpq_mat

from obsdesign.dissipation.certificate import Certificate
from obsdesign.families.incremental.guarantee import Reconstruction as Bound
from obsdesign.families.incremental.theorems import Linf
from obsdesign.files import checks as listed
from obsdesign.files import written
from obsdesign.lmi.formula import (
    Array,
    Inequality,
    Unknown,
    Values,
    above,
    approximate,
    identity,
    printed,
    rational,
    symmetric,
    zeros,
)
from obsdesign.lmi.proof import Check, Proved, prove
from obsdesign.lmi.spectrum import extremes, upper
from obsdesign.model.multiplier import Multiplier
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec, arguments

if TYPE_CHECKING:
    from obsdesign.coq.reconstruction import Reconstruction

DRIFT, ARGUMENT = "pinv(B) A e", "(Cq + L2 C) e"
RATE_W, RATE_D = "pinv(B) e' from w'", "pinv(B) e' from d"
SLOPE, VARIATION = "slope of f", "variation of the slope"


@dataclass(frozen=True)
class Slope:
    """|df - K dq| <= bound |dq| for every f of a multiplier set: s1 with K = 0, s2 = 2 bound with any K."""

    multiplier: Multiplier
    centered: bool  # whether K is free

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Those of the multiplier, and K."""
        nf, nq = self.multiplier.member.shape
        return (*self.multiplier.unknowns(), *([Unknown("K", (nf, nq))] if self.centered else []))

    def theorem(self, v: Values) -> tuple[Inequality, ...]:
        """bound^2 |dq|^2 - |df - K dq|^2 >= [dq; df]' M [dq; df], by a Schur complement; v has `square`, bound^2."""
        M11, M12, M22 = self.multiplier.matrix(v)
        nf, nq = self.multiplier.member.shape
        K = v["K"] if self.centered else zeros((nf, nq), [M22])
        eye = identity(nf, M22)
        bounded = symmetric([[M11 - v["square"] * identity(nq, M11), M12, K.mT], [M22, -eye], [-eye]])
        return (Inequality("|df - K dq| <= s |dq|", bounded), *self.multiplier.inequalities(v))


def left_inverse(B: Array) -> Array:
    """pinv(B) = (B'B)^-1 B', exactly; B has full column rank."""
    gram = fmpq_mat((B.T @ B).tolist()).inv()
    return np.array(gram.tolist(), dtype=object) @ B.T


def levels(family: Linf) -> dict[str, Linf]:
    """Families whose gammas the bound is made of; an output or an input that is zero needs none."""
    p, L2 = family.plant, family.L2
    inverse = left_inverse(p.B)
    from_d = replace(p, B=-p.Bf, D=-p.Df, Dq=-p.Dqf)
    made = {DRIFT: replace(family, H=inverse @ p.A), RATE_W: replace(family, H=inverse)}
    if p.Bf.any():
        made[RATE_D] = replace(family, H=inverse, plant=from_d)
    if (inverse @ p.Bf).any():
        made[ARGUMENT] = replace(family, H=p.Cq + L2 @ p.C)
    return {name: level for name, level in made.items() if level.H.any()}


def slopes(multiplier: Multiplier) -> dict[str, Slope]:
    """Bounds on f that Theorem 4 needs."""
    return {SLOPE: Slope(multiplier, centered=False), VARIATION: Slope(multiplier, centered=True)}


def constants(family: Linf, gammas: Mapping[str, fmpq], bounds: Mapping[str, fmpq]) -> tuple[fmpq, fmpq, fmpq]:
    """c_w, c_w' and c_x', in rationals.

    `gammas`: of `levels`; `bounds`: of `slopes`.
    """
    p, zero = family.plant, fmpq(0)
    drift, argument, from_w, from_d = (gammas.get(name, zero) for name in (DRIFT, ARGUMENT, RATE_W, RATE_D))
    if not p.Bf.shape[1]:
        return drift, from_w, zero
    loop = 1 - bounds[SLOPE] * norm_above(p.Dqf)
    k1, k2 = bounds[SLOPE] / loop, 2 * bounds[VARIATION] / loop
    through = norm_above(left_inverse(p.B) @ p.Bf)
    return (
        drift + k1 * through * (argument + norm_above(p.Dq + family.L2 @ p.D)),
        from_w + from_d * k2 * norm_above(p.Dq),
        from_d * k2 * norm_above(p.Cq),
    )


def norm_above(matrix: Array) -> fmpq:
    """Rational that is not below the spectral norm, and hardly above it."""
    if not matrix.any():
        return fmpq(0)
    if matrix.size == 1:
        return abs(matrix.item())
    return printed(upper(extremes(matrix.T @ matrix)[1].sqrt()))


# The proof


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

    def of_a_linear_plant(self) -> "Reconstruction | None":
        """The same as a theorem of Coq has it, where the plant has no f; else None."""
        from obsdesign.coq.reconstruction import Reconstruction

        from_rate = self.levels[RATE_W]
        plant = from_rate.family.plant
        if plant.Bf.shape[1]:
            return None
        inverse = left_inverse(plant.B)
        still = replace(from_rate, mu2=fmpq(0), family=replace(from_rate.family, H=inverse @ plant.A))  # if A is zero
        return Reconstruction(self.levels.get(DRIFT, still), from_rate, inverse, *self.constants[:2])

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
            name: {
                "gamma": approximate(level.gamma),
                "alpha": approximate(level.rate),
                "mu1": approximate(level.mu1),
                "mu2": approximate(level.mu2),
                **level.written(),
            }
            for name, level in self.levels.items()
        }
        slopes = {
            name: {"bound": approximate(slope.bound), "values": {n: written(v) for n, v in slope.values.items()}}
            | {"checks": listed(slope.checks)}
            for name, slope in self.slopes.items()
        }
        return {"levels": levels, "slopes": slopes, "checks": listed(self.checks)}

    @property
    def bound(self) -> Bound:
        """Constants in doubles, rounded up, with the sum of the storage functions and the slowest of their rates."""
        w, w_rate, x_rate = map(above, self.constants)
        storages = [level.guarantee for level in self.levels.values()]
        alpha = min(storage.rate for storage in storages)
        return Bound(w, w_rate, x_rate, alpha, np.sum([storage.doubles for storage in storages], axis=0))


def inapplicable(spec: Spec, slope: fmpq | None) -> str | None:
    """Why no bound on |what - w| can be proved for a spec, whose f has a slope of at most `slope`; None if one can."""
    plant = spec.augmented
    beside = {name for b in spec.nonlinearities for f in b.f or () for name in f.names.difference(arguments(b.nq))}
    if beside:
        return f"Theorem 4 needs f to depend on q only, and it depends on {', '.join(sorted(beside))}"
    if any(term.names for term in spec.gq):
        return "Theorem 4 needs an argument without known terms (gq = 0)"
    if not plant.Bf.shape[1]:
        return None
    if plant.Df.any():
        return "Theorem 4 needs an output without f (Df = 0)"
    if slope is None or slope * norm_above(plant.Dqf) >= 1:
        steep = "types of f have no bounded slope" if slope is None else "slope of f times |Dqf| is not below 1"
        return f"Assumption 2 fails: the {steep}"
    return None


def reconstructed(
    family: Linf, levels: dict[str, Certificate], slopes: dict[str, SlopeProof], claimed: tuple[fmpq, fmpq, fmpq]
) -> Reconstructed:
    """Hold constants against what the levels and slopes prove."""
    gammas = {name: level.gamma for name, level in levels.items()}
    least = constants(family, gammas, {name: slope.bound for name, slope in slopes.items()})
    checks = tuple(
        Check(f"{name} is large enough", c >= bound, approximate(c - bound))
        for name, c, bound in zip(("c_w", "c_w'", "c_x'"), claimed, least, strict=True)
    )
    return Reconstructed(levels, slopes, claimed, checks)
