"""Observers of Lipschitz systems: three relaxations of one problem.

Abbaszadeh and Marquez, Robust H-infinity filtering for Lipschitz nonlinear systems via multiobjective optimization
(2010). The observer of x' = A x + Bf f(Cq x) + g + B w, y = C x + D w, |df| <= l |dq|, is

    xhat' = A xhat + Bf f(Cq xhat) + g + L (y - C xhat)

and e = x - xhat. With V = e' P e, F = P L and X = He(P A - F C) + 2 beta P every relaxation implies

    V' + 2 beta V + |z|^2 - mu |w|^2 <= 0,    z = H e,    gamma^2 = mu,

strict for beta = 0, for every f with that constant. Hence |z|_2 <= sqrt(e0' P e0) + gamma |w|_2, and e decays at the
rate beta where w = 0. The relaxations, each of which implies the ones above it in this list:

    s-procedure  [X + H'H + sum_i tau_i l_i^2 Cqi'Cqi, P Bf, P B - F D; ., -diag(tau), 0; ., ., -mu I] <= 0
    norm-bound   X < -a I, P <= p I, [H'H + (2 l p - a) I, P B - F D; ., -mu I] <= 0               (40), (62)
    abbaszadeh   X < -a I, P <= (1 - h) / (2 l) I,
                 [H'H + ((l + 1 / l) / 2 - a) I, P B - F D; ., -mu I] <= 0, h = sigma(H)^2         (40) - (42)

The last two know f by one constant only, l = |Bf| max_i l_i |Cq| at most. They take 2 e'P df <= 2 l lmax(P) |e|^2 for
the first with tau = lmax(P) / l. In Theorem 3 l is given; in Theorem 4 it is 1 / xi with xi unknown, and xi <= 1 / l is
added, without which the result need not cover the plant. `gamma` is here the gain mu of the paper, and `lipschitz` its
gamma.

Misprints and slips: C is p x n in (2); (34) and (47) need the term -2 beta V; (50) has the wrong direction, and (40)
gives what (55) needs; (62) is a linear matrix inequality for a given l, with the unknown p; (41) is stricter than (18);
alpha > 1 and eps are redundant; the matrices of order 2 n in (8), (20), (41), (72) say P <= r I; Theorem 3 is not
monotone in l.

Of plants x+ = A x + Bf f(Cq x) + g + B w there is the s-procedure only, by our own derivation: `DiscreteLipschitz`.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.discrete import Discrete
from obsdesign.dissipation.guarantee import EnergyGuarantee, EnergyOfSteps
from obsdesign.dissipation.inequality import ONE
from obsdesign.dissipation.pace import DECAY, RHO, Pace
from obsdesign.families.incremental.theorems import L2
from obsdesign.lmi.formula import (
    Array,
    Exact,
    Inequality,
    Problem,
    Unknown,
    Values,
    block_diagonal,
    he,
    identity,
    rational,
    symmetric,
)
from obsdesign.model.multiplier import Multiplier, combine
from obsdesign.model.plant import Plant
from obsdesign.nonlinearities.lipschitz import lipschitz
from obsdesign.records import dataclass, replace

if TYPE_CHECKING:
    from obsdesign.families.lipschitz.request import LipschitzRelaxation

CONVERGES = "X < -a I"
ATTENUATES = "[H'H + c I, P B - F D; ., -mu I] <= 0"


@dataclass(frozen=True)
class LipschitzGuarantee(EnergyGuarantee):
    """V' + 2 decay V + |z|^2 - gamma^2 |v|^2 <= 0: that of the energy, with mu1 = 1, in the words of the paper."""

    symbol_in_words: ClassVar[str] = "decay"
    weight: ClassVar[str] = ""
    symbol: ClassVar[str] = "decay"


@dataclass(frozen=True)
class LipschitzOfSteps(EnergyOfSteps):
    """V+ - rho^2 V + |z|^2 - gamma^2 |v|^2 <= 0: that of the energy of samples, with mu1 = 1; strict for rho = 1."""

    weight: ClassVar[str] = ""
    resting: ClassVar[str] = "e"


class Lipschitz(L2):
    """The s-procedure, with a scale for each block. L1 = -L, and L2 = 0; `Claim` states what it proves."""

    about = replace(
        L2.about,
        name="lipschitz",
        guarantee=LipschitzGuarantee,
        decrease="V' + 2 decay V + |z|^2 - mu |w|^2 <= 0",
        level="mu <= gamma^2",
        pace=DECAY,
        at_rest="strict",
    )
    power: ClassVar[int] = 2  # xi of `converging` is the constant to minus this

    @classmethod
    def of(
        cls,
        plant: Plant[Exact],
        multiplier: Multiplier,
        constants: Sequence[fmpq],
        H: Array,
        rate: fmpq,
        L: Array | None = None,
    ) -> Self:
        """Problem for constants of the blocks, in rationals.

        `plant`: with Dqf = 0, Dq = 0 and, but for filtered estimates, Df = 0; `multiplier`: of any type: only the sizes
        of its blocks matter; `constants`: of each block; `H`, `rate`, `L`: z = H e; 1/s, or 1 - rho of samples; the
        gain, or None if it is to be found.
        """
        sizes = [(block.nq, block.nf) for block in multiplier.blocks]
        absent = rational(np.zeros((len(plant.Cq), len(plant.C))))
        return cls(plant, lipschitz_multiplier(constants, sizes), H, rate, None if L is None else -L, absent)

    def undisturbed(self) -> Self:
        """Same problem without w and z: what Theorems 1 and 2 are about."""
        return replace(self, plant=self.plant.undisturbed, H=self.H[:0])

    def stretched(self, factor: Any) -> Self:
        """Same problem with every Lipschitz constant multiplied by a factor, in the numbers of the problem."""
        blocks = tuple(replace(b, M11=factor * factor * b.M11) for b in self.multiplier.scaled_blocks())
        return replace(self, multiplier=Multiplier(blocks))

    @property
    def lipschitz(self) -> float:
        """Constant l = |Bf| |diag(l_i) Cq|, by which f as a whole is known; in doubles."""
        root = np.sqrt(block_diagonal([b.M11 for b in self.multiplier.scaled_blocks()]))  # diagonal: l_i^2 I
        return float(np.linalg.norm(self.plant.Bf, 2) * np.linalg.norm(root @ self.plant.Cq, 2))

    @property
    def seen(self) -> float:
        """Return h = sigma(H)^2, in doubles."""
        return float(np.linalg.norm(self.H, 2)) ** 2 if self.H.size else 0.0

    def converging(self, v: Values) -> list[Inequality]:
        """[X + Cq'M11 Cq, P Bf; ., -xi I] <= 0, of one block."""
        (block,) = self.multiplier.scaled_blocks()
        Cq = self.plant.Cq
        forced = self.stretched(0.0).dissipation({**v, "lambda1": v["xi"]}, Cq.mT @ block.M11 @ Cq, ONE)
        decrease = Inequality(self.about.decrease, forced, strict=not self.rate)
        return [decrease, Inequality("P > 0", -v["P"], strict=True)]


class DiscreteLipschitz(Discrete, Lipschitz):
    """The s-procedure for plants x+ = A x + Bf f(Cq x) + g + B w, by our own derivation.

        V+ - rho^2 V + |z|^2 - mu |w|^2 <= 0,    z = H e,    gamma^2 = mu,    0 < rho <= 1,

    strict for rho = 1, for every f with that constant. Hence sum |z|^2 <= e0' P e0 + gamma^2 sum |w|^2 over any first
    samples, and |e_k| <= sqrt(cond P) rho^k |e_0| where w = 0; for rho = 1 e_k -> 0.

    With Nf = Bf + L1 Df, rho^2 P >= tau_i l_i^2 Cqi'Cqi and Nf_i' P Nf_i <= tau_i I leave l_i |Cqi Nf_i| <= rho: Nf is
    Bf of predicted estimates, whatever the gain. This is so of the problem itself for f(k, q), which may turn from
    sample to sample so that |Cq e+| >= l |Cq Nf| |Cq e|.
    """

    about = replace(
        Lipschitz.about,
        guarantee=LipschitzOfSteps,
        decrease="V+ - rho^2 V + |z|^2 - mu |w|^2 <= 0",
        pace=RHO,
    )


class Unstructured(Lipschitz):
    """What knows f by one constant l, |Bf df| <= l |e|; in doubles."""

    power = 1
    further: ClassVar[tuple[str, ...]]  # scalar unknowns besides P and the gain

    @property
    def auxiliary(self) -> tuple[Unknown, ...]:
        """The scalars."""
        return tuple(Unknown(name, (1, 1)) for name in self.further)

    @property
    def place_of_v(self) -> tuple[int, int]:
        """Which of the inequalities has rows of v, and the first of these."""
        return 1, self.plant.n

    @property
    def injection(self) -> None:
        """None: the gain enters two inequalities."""
        return

    def converging(self, v: Values) -> list[Inequality]:
        """X < -I and 0 < P <= xi / (2 l) I."""
        small = Inequality("2 l P <= xi I", 2 * self.lipschitz * v["P"] - v["xi"] * self.eye)
        return [self.convergence(v, ONE), small, Inequality("P > 0", -v["P"], strict=True)]

    def convergence(self, v: Values, a: Array) -> Inequality:
        """X < -a I."""
        p, P, Y = self.plant, v["P"], self.injected(v)  # Y = -F
        return Inequality(CONVERGES, he(P @ p.A + Y @ p.C) + 2 * self.rate * P + a * self.eye, strict=True)

    def attenuation(self, v: Values, c: Array) -> Inequality:
        """[H'H + c I, P B - F D; ., -mu I] <= 0, for the weight mu1 of H'H and the supply mu2."""
        p, P, Y = self.plant, v["P"], self.injected(v)
        seen = v["mu1"] * (self.H.mT @ self.H) + c * self.eye
        supply = -v["mu2"] * identity(p.B.shape[1], p.B)
        return Inequality(ATTENUATES, symmetric([[seen, P @ p.B + Y @ p.D], [supply]]))

    def below(self, v: Values, largest: Array) -> list[Inequality]:
        """0 < P <= largest I."""
        small = Inequality("P <= p I", v["P"] - largest * self.eye)
        return [small, Inequality("P > 0", -v["P"], strict=True)]


class NormBound(Unstructured):
    """(40) and (62) with lmax(P) <= p as an unknown."""

    further = ("p", "a")

    def theorem(self, v: Values) -> tuple[Inequality, ...]:
        """(40), (62) and P <= p I."""
        c = 2 * self.lipschitz * v["p"] - v["a"]
        return self.convergence(v, v["a"]), self.attenuation(v, c), *self.below(v, v["p"])


class Theorem3(Unstructured):
    """(40) to (42) for a given constant l > 0."""

    further = ("a",)

    def theorem(self, v: Values) -> tuple[Inequality, ...]:
        """(40), (41) and (42)."""
        l = self.lipschitz  # noqa: E741
        c = (l + 1 / l) / 2 - v["a"]
        return self.convergence(v, v["a"]), self.attenuation(v, c), *self.below(v, (1 - self.seen) / (2 * l) * ONE)


class Theorem4(Unstructured):
    """(71) to (73) with xi = 1 / l unknown, and 1 / l at least the constant that is declared.

    (73) has c = xi / 2 + u - a with u >= 1 / (2 xi).
    """

    further = ("a", "xi", "u")

    def theorem(self, v: Values) -> tuple[Inequality, ...]:
        """(71), (72), (73) and xi <= 1 / l."""
        xi, one = v["xi"], ONE
        return (
            self.convergence(v, v["a"]),
            self.attenuation(v, xi / 2 + v["u"] - v["a"]),
            *self.below(v, (1 - self.seen) / 2 * xi),
            Inequality("[u, 1; 1, 2 xi] >= 0", -symmetric([[v["u"], one], [2 * xi]])),
            Inequality("l xi <= 1", self.lipschitz * xi - one),
        )

    def pareto(self, weight: float, ratio: float = 1.0, bounds: Bounds = NO_BOUNDS) -> Problem:
        """Minimise weight ratio xi + (1 - weight) mu, where 1 / (ratio xi) is the constant that is weighed."""
        least = self.least_gamma(bounds)
        return replace(least, minimise=lambda v: weight * ratio * v["xi"] + (1 - weight) * v["mu"])


S_PROCEDURE: dict[Pace, type[Lipschitz]] = {DECAY: Lipschitz, RHO: DiscreteLipschitz}
KINDS: "dict[LipschitzRelaxation, type[Lipschitz]]" = {"norm-bound": NormBound, "abbaszadeh": Theorem3}  # the others
RELAXATIONS: "tuple[LipschitzRelaxation, ...]" = ("s-procedure", *KINDS)  # the tightest first


def proportions(declared: Sequence[fmpq]) -> tuple[fmpq, ...]:
    """Constants of the blocks where the largest is 1: as they are declared, or equal if all of those are zero."""
    largest = max(declared)
    return tuple(k / largest if largest else fmpq(1) for k in declared)


def lipschitz_multiplier(constants: Sequence[fmpq], sizes: Sequence[tuple[int, int]]) -> Multiplier:
    """|df_i| <= l_i |dq_i| for each block, in rationals; sizes are (nq_i, nf_i)."""
    return combine(lipschitz(k, *size) for k, size in zip(constants, sizes, strict=True))
