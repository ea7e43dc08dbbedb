"""What is proved where measurements stay away for longer than T2.

With P(tau) = P(T2) for tau > T2, V grows there by no more than V' <= 2 growth V if

    He(P(T2) F) - 2 growth P(T2) + .. <= 0, with [dq; df]' M [dq; df] as in (F),

so that V(t) <= exp(-2 lambda (t - X) + 2 growth X) V(0) where w = 0 and eta = 0, X the time with tau > T2 until t: the
error vanishes if the share X / t stays below lambda / (lambda + growth). P and lambda are those of the overshoot.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from flint import fmpq

from obsdesign.dissipation.decimals import round_up
from obsdesign.families.sporadic.clock.analysis import ONE, Analysis, Found
from obsdesign.families.sporadic.clock.theorem import ClockTheorem
from obsdesign.families.sporadic.clock.witness import Witness
from obsdesign.files import ResultFile
from obsdesign.files import written as entry
from obsdesign.lmi.formula import Array, Inequality, Problem, Unknown, Values, approximate, in_floats, printed, rational
from obsdesign.lmi.proof import Check, Proved, prove, with_digits
from obsdesign.records import dataclass, replace

BACKOFFS = (1e-3, 1e-2, 0.1, 1.0)  # of the least growth
DIGITS = 12
LEAST = 1e-3  # growth that is claimed at least, relative to the rate: a growth of zero would be no outage at all


@dataclass(frozen=True)
class Outage(Proved):
    """Growth of V while a measurement is overdue, with the multiplier that proves it, for each part of [T1, T2]."""

    overshoot: Witness
    growth: fmpq  # 1/s
    multipliers: tuple[Mapping[str, Array], ...]  # of each part

    @property
    def share(self) -> fmpq:
        """Share of the time for which measurements may be overdue."""
        rate = self.overshoot.theorem.decay
        return rate / (rate + self.growth)

    @cached_property
    def checks(self) -> tuple[Check, ...]:
        """The growth of every function of the storage function."""
        fixed = {"weight": rational([[0]]), "mu": rational([[0]])}
        found: list[Check] = []
        for P, M in zip(self.overshoot.P[:, -1], self.multipliers, strict=True):
            found += prove(conditions(self.overshoot.theorem, P, self.growth, {**M, **fixed}))
        rate = self.overshoot.theorem.decay
        return (
            *(replace(check, name=f"outage: {check.name}") for check in found),
            Check("outage: growth > 0", self.growth > 0, approximate(self.growth)),
            Check("outage: lambda > 0", rate > 0, approximate(rate)),
        )

    def written(self) -> dict[str, Any]:
        """Entry of a result file."""
        listed = [{name: entry(value) for name, value in M.items()} for M in self.multipliers]
        return {"growth": str(self.growth), "multipliers": {str(i): M for i, M in enumerate(listed, start=1)}}


def conditions(theorem: ClockTheorem, P: Array, growth: Any, v: Values) -> list[Inequality]:
    """V' <= 2 growth V at a P, and the cone of the multiplier."""
    still = replace(theorem, decay=-growth)
    return [
        Inequality("V' <= 2 growth V", still.flow(P, P @ theorem.system.F, 0 * P, v)),
        *theorem.multiplier.inequalities(v),
    ]


def outage(analysis: Analysis, overshoot: Witness) -> Outage | None:
    """Least growth that is proved; None if none is found."""
    theorem = overshoot.theorem.doubles
    found = [least_growth(analysis, theorem, P) for P in in_floats(overshoot.P[:, -1])]
    if any(each.values is None for each in found):
        return None
    least = max(LEAST * float(overshoot.theorem.decay), *(each.objective for each in found))
    names = [u.name for u in theorem.multiplier.unknowns()]
    multipliers = tuple(
        {name: with_digits(each.values[name], DIGITS) for name in names} for each in found if each.values
    )
    for backoff in BACKOFFS:
        claim = Outage(overshoot, printed(round_up(least * (1 + backoff), 4)), multipliers)
        if claim.holds:
            return claim
    return None


def least_growth(analysis: Analysis, theorem: ClockTheorem, P: Array) -> Found:
    """Least growth of one function, in doubles."""
    fixed = {"weight": 0 * ONE, "mu": 0 * ONE}
    problem = Problem(
        (*theorem.multiplier.unknowns(), Unknown("growth", (1, 1))),
        lambda v: conditions(theorem, P, v["growth"], {**v, **fixed}),
        lambda v: v["growth"],
    )
    return analysis.solved(problem)


def read(file: ResultFile, overshoot: Witness, *keys: str) -> Outage:
    """Outage of a file."""
    unknowns = overshoot.theorem.multiplier.unknowns()
    parts = tuple(file.unknowns(unknowns, *keys, "multipliers", str(i + 1)) for i in range(overshoot.theorem.lookahead))
    return Outage(overshoot, file.number(*keys, "growth"), parts)
