"""Arbitrary accuracy: gains in closed form for any gamma > 0, where the structure of the plant admits them.

Theorem 2 of Corless and Chakrabarty (2019): suppose P > 0, Y, L2, F, a multiplier M and a rate abar > alpha satisfy

    V' + 2 abar V <= 0 where v = 0                                      (20)
    P B + Y D = C'F'        (25a)        F D = 0, F Df = 0              (25c), in its linear form
    Dq + L2 D = 0           (25b)

Then L1 = P^-1 (Y - zeta C'F'F) makes the term -2 zeta |F C e|^2 absorb -2 (F C e)'v, so that V' + 2 abar V <=
|v|^2 / (2 zeta), and with |z|^2 <= h V the level gamma is reached by

    zeta = h / (4 r gamma^2),    r = abar - alpha for l2 ((26), (27)),    r = alpha for linf.

For linf without f and with D = 0 this is Theorem 3 of Chakrabarty et al. (2016), (34)-(42), where mu is gamma^2 for
the outputs pinv(B) A e and pinv(B) e as well, and (39) becomes an equality. The gain grows as 1 / gamma^2: a search for
the smallest gain finds less, but this one needs a single inequality that does not depend on gamma.

(25c) is printed with C'F'F D = 0, quadratic in F; with C of full row rank it says the same.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from obsdesign.dissipation.decimals import significant
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import DIGITS, with_L2
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.shift import with_usable_scales
from obsdesign.lmi.formula import Array, Inequality, Problem, Unknown, Values, in_floats, printed, symmetric
from obsdesign.lmi.solve import Status
from obsdesign.records import dataclass, replace

FASTER = (2.0, 1.5, 1.1)  # abar / alpha that are tried for a family with a decay rate to spare
BARELY = (1.01,)  # .. and for one whose level gains from alpha itself
LARGEST = 1e8  # |Y| / |P|, above which the solver's tolerance no longer tells (25) from what it forbids
NEAR = 1e-4  # relative, above the least trace of P, for the smallest Y


@dataclass(frozen=True)
class Accurate:
    """A solution of the conditions, from which the gains for every gamma follow; in doubles but for the family."""

    family: Incremental  # with L2, in rationals
    values: Values  # P, Y, F, the multiplier
    spare: float  # r

    def weight(self, H: Array) -> float:
        """Least h with |H e|^2 <= h V."""
        return float(np.linalg.eigvalsh(H @ np.linalg.solve(self.values["P"], H.T)).max(initial=0.0))

    def L1(self, gamma: float, outputs: Sequence[Array]) -> Array:
        """(28), for the level gamma of each output."""
        P, Y, F = self.values["P"], self.values["Y"], self.values["F"]
        zeta = max(self.weight(H) for H in outputs) / (4 * self.spare * gamma**2)
        C = in_floats(self.family).plant.C
        return np.asarray(np.linalg.solve(P, Y - zeta * (F @ C).T @ F))

    def gains(self, gamma: float, outputs: Sequence[Array]) -> Iterator[Incremental]:
        """Families with the gains, in more and more digits."""
        for digits in DIGITS:
            yield replace(self.family, L1=printed(significant(self.L1(gamma, outputs), digits)))


def accurate(engine: Engine, family: Incremental) -> Accurate | None:
    """Solution of the conditions for a family in rationals, with the smallest Y; None if none was found."""
    alpha = float(family.rate)
    for ratio in FASTER if family.about.monotone else BARELY:

        def optimum(search: Incremental, rate: float = ratio * alpha) -> Values | None:
            least = engine.minimise(conditions(search, rate))
            return least.values if least.status is Status.OPTIMAL else None

        for fixed in with_L2(family, optimum):
            values = solution(engine, in_floats(fixed), ratio * alpha)
            if values is not None:
                return Accurate(fixed, values, (ratio - 1) * alpha if family.about.monotone else alpha)
    return None


def solution(engine: Engine, family: Incremental, rate: float) -> Values | None:
    """P of least trace, and then Y of least norm; None where P was not found, or only with a Y that has no limit."""
    least = engine.minimise(conditions(family, rate))
    if least.status is not Status.OPTIMAL:
        return None
    problem, (n, ny) = conditions(family, rate), family.plant.C.mT.shape

    def small(v: Values) -> list[Inequality]:
        rise = np.trace(v["P"], axis1=-2, axis2=-1)[..., None, None] - (1 + NEAR) * least.objective
        norm = -symmetric([[v["s"] * np.eye(n), v["Y"]], [v["s"] * np.eye(ny)]])
        return [*problem.inequalities(v), Inequality("tr P", rise), Inequality("|Y| <= s", norm)]

    smaller = engine.minimise(Problem((*problem.unknowns, Unknown("s", (1, 1))), small, lambda v: v["s"]))
    values = smaller.values if smaller.status is Status.OPTIMAL else least.values
    return values if np.linalg.norm(values["Y"], 2) <= LARGEST * np.linalg.norm(values["P"], 2) else None


def conditions(family: Incremental, rate: float) -> Problem:
    """(20) and (25) for P >= I, minimising its trace; in doubles."""
    p, nv = family.plant, family.plant.B.shape[1]
    undisturbed = replace(family, rate=rate, plant=p.undisturbed)
    none = np.zeros((1, 1))

    def inequalities(v: Values) -> list[Inequality]:
        return [
            *undisturbed.conditions(v, none, none),
            Inequality("P >= I", np.eye(p.n) - v["P"]),
            equation("P B + Y D = C'F'", v["P"] @ p.B + v["Y"] @ p.D - p.C.mT @ v["F"].mT),
            equation("F [D Df] = 0", v["F"] @ np.hstack([p.D, p.Df])),
            equation("Dq + L2 D = 0", family.argument(v, p.Dq, p.D)),
        ]

    free = [] if family.L2 is not None else [Unknown("R", (len(p.Cq), len(p.C)))]
    unknowns = [Unknown("P", (p.n, p.n), symmetric=True), Unknown("Y", (p.n, len(p.C))), *free]
    problem = Problem(
        (*unknowns, *family.multiplier.unknowns(), Unknown("F", (nv, len(p.C)))),
        inequalities,
        lambda v: np.trace(v["P"], axis1=-2, axis2=-1)[..., None, None],
    )
    return problem if family.L2 is not None else with_usable_scales(problem, family.multiplier)


def equation(name: str, X: Array) -> Inequality:
    """X = 0, as an inequality whose diagonal is zero."""
    rows, columns = X.shape[-2:]
    return Inequality(name, symmetric([[np.zeros((rows, rows)), X], [np.zeros((columns, columns))]]))
