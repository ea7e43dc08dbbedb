"""Witnesses of clock-dependent claims: what proves each of them, held exactly, and the constants that follow.

Every claim has a storage function of its own. With P >= I for those on |x|,

    gamma        |z|_2 <= gamma |w|_2 + initial |x(0)| where eta = 0:    mu <= gamma^2, P <= initial^2 I
    energy       |z|_2^2 <= r |x(0)|^2 + mu |w|_2^2 + kappa sum |eta_k|^2:    P <= r I, (N)
    overshoot    |x(t)| <= overshoot exp(-lambda t) |x(0)| where w = 0 and eta = 0:    I <= P <= overshoot^2 I
    disturbance  |x(t)| <= disturbance sup|w| from zero error where eta = 0:    P >= I, mu <= 2 lambda disturbance^2
    noise        |x(t)| <= noise sup|eta| from zero error where w = 0:    P >= I, (N) with a kappa of at most
                 (1 - exp(-2 lambda T1)) noise^2
"""

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from math import isqrt
from typing import Any

import numpy as np
from flint import arb, ctx, fmpq

from obsdesign.families.sporadic.clock.bernstein import LARGEST_DEGREE, MOST_SEGMENTS, Clock
from obsdesign.families.sporadic.clock.theorem import ClockTheorem
from obsdesign.files import ResultFile, rows
from obsdesign.lmi.formula import Array, Inequality, Unknown, approximate, rational
from obsdesign.lmi.proof import Check, Proved, holds, prove
from obsdesign.lmi.spectrum import BITS
from obsdesign.model import loop
from obsdesign.records import dataclass, replace


@dataclass(frozen=True)
class Goal:
    """A kind of claim: whether w acts, whether z counts, and the size of P that is asked; what is minimised."""

    name: str
    least: str  # of mu, r and kappa, the number that is the smaller the better
    also: tuple[str, ...] = ()  # numbers that it needs besides
    disturbed: bool = False
    weighed: bool = False
    normal: bool = True  # P >= I

    def theorem(self, theorem: ClockTheorem) -> ClockTheorem:
        """Theorem of the error that the claim speaks of."""
        system = theorem.system
        if not self.disturbed:
            system = system.undisturbed
        return replace(theorem, system=system)

    def fixed(self, one: Array) -> dict[str, Array]:
        """Numbers that are not searched."""
        known = {"weight": one if self.weighed else 0 * one, "mu": 0 * one}
        return known | ({"floor": one} if self.normal else {})


GOALS = {
    goal.name: goal
    for goal in (
        Goal("gamma", "mu", ("r",), disturbed=True, weighed=True, normal=False),
        Goal("energy", "kappa", ("mu", "r"), disturbed=True, weighed=True, normal=False),
        Goal("overshoot", "r"),
        Goal("disturbance", "mu", disturbed=True),
        Goal("noise", "kappa"),
    )
}
NUMBERS = ("mu", "r", "kappa")
MOST = MOST_SEGMENTS + 2  # knots of a file: a longest T2 has a segment more


@dataclass(frozen=True)
class Witness(Proved):
    """P, the multiplier and the numbers, in rationals, that prove one claim, and what was checked of them."""

    goal: Goal
    theorem: ClockTheorem  # of the error that the claim speaks of, in rationals
    numbers: Mapping[str, fmpq]  # of NUMBERS, those that apply
    P: Array  # control values, (lookahead, N d + 1, m, m)
    multipliers: Mapping[str, Array]  # those of its unknowns, (lookahead, N (d + 1), k, k)

    @cached_property
    def checks(self) -> tuple[Check, ...]:
        """Every condition; the sequences of measurements and the plant are those of the claim that holds it."""
        numbers = {name: rational([[value]]) for name, value in self.numbers.items()}
        given = {**self.goal.fixed(rational([[1]])), **numbers}
        found = [
            *together(prove(self.theorem.conditions(self.P, self.multipliers, given))),
            Check("lambda >= 0", self.theorem.decay >= 0, approximate(self.theorem.decay)),
            *(Check(f"{name} >= 0", x >= 0, approximate(x)) for name, x in self.ordered.items()),
            self.solvable(),
        ]
        return tuple(replace(check, name=f"{self.goal.name}: {check.name}") for check in found)

    @property
    def ordered(self) -> dict[str, fmpq]:
        """Numbers in the order of NUMBERS."""
        return {name: self.numbers[name] for name in NUMBERS if name in self.numbers}

    @property
    def definite(self) -> bool:
        """Whether P(0) > 0, so that V > 0 for every error, and |x| decays with it."""
        return all(holds(Inequality("P(0) > 0", -P[0], strict=True)) for P in self.P)

    def solvable(self) -> Check:
        """Whether q = c + Dqf f(q) has one solution, by the first of the multipliers."""
        first = {name: stack[0, 0] for name, stack in self.multipliers.items()}
        verdict = loop.proved(self.theorem.system.Dqf, self.theorem.multiplier, first)
        return Check(verdict.sentence, verdict.unique, 1.0 if verdict.unique else -1.0)

    def constants(self) -> dict[str, fmpq]:
        """Constants that the numbers give, rounded up."""
        return constants(self.goal, self.numbers, self.theorem.decay, self.theorem.T1)

    def written(self) -> dict[str, Any]:
        """Entry of a result file."""
        clock = self.theorem.clock
        parts = {
            str(i): {
                "P": [[rows(P[j]) for j in places] for places in clock.places],
                "multipliers": {name: by_segment(stack[i - 1], clock) for name, stack in self.multipliers.items()},
            }
            for i, P in enumerate(self.P, start=1)
        }
        return {
            "lambda": str(self.theorem.decay),
            **{name: str(value) for name, value in self.ordered.items()},
            "knots": [str(s) for s in clock.knots],
            **parts.pop("1"),
            **({"parts": parts} if parts else {}),
        }


def together(checks: Iterable[Check]) -> Iterator[Check]:
    """One check for each condition that is asked at several control values, whose names end in their places."""
    by_name: dict[str, list[Check]] = {}
    for check in checks:
        by_name.setdefault(check.name.rpartition(" (")[0], []).append(check)
    for name, found in by_name.items():
        where = f" at {len(found)} control values" if len(found) > 1 else ""
        yield Check(f"{name}{where}", all(c.holds for c in found), min(c.margin for c in found))


def constants(goal: Goal, numbers: Mapping[str, fmpq], decay: fmpq, T1: fmpq) -> dict[str, fmpq]:
    """Constants of a claim that its numbers give at a rate, rounded up; none where the theorem gives none."""
    if goal.name == "gamma":
        return {"gamma": root(numbers["mu"]), "initial": root(numbers["r"])}
    if goal.name == "overshoot":
        return {"overshoot": root(numbers["r"])}
    if goal.name == "disturbance" and decay > 0:
        return {"disturbance": root(numbers["mu"] / (2 * decay))}
    if goal.name == "noise" and decay > 0 and T1 > 0:
        with ctx.workprec(BITS):
            return {"noise": root((numbers["kappa"] / -arb(-2 * decay * T1).expm1()).upper().fmpq())}
    return {}


def root(x: fmpq) -> fmpq:
    """Square root of a number, exact if it is rational, or else a little above."""
    p, q = isqrt(int(x.p)), isqrt(int(x.q))
    if p * p == x.p and q * q == x.q:
        return fmpq(p, q)
    with ctx.workprec(BITS):
        return arb(x).sqrt().upper().fmpq()


def by_segment(values: Array, clock: Clock) -> list[list[Any]]:
    """Control values of the flow, segment by segment: numbers where they are 1x1, else rows."""
    listed = [str(value.item()) if value.shape == (1, 1) else rows(value) for value in values]
    width = clock.degree + 1
    return [listed[a : a + width] for a in range(0, len(listed), width)]


def read(file: ResultFile, goal: Goal, theorem: ClockTheorem, T2: fmpq, *keys: str) -> Witness:
    """Witness of a file for a claim; the clock and the rate are those of the file, all else that of the theorem.

    Raises `UsageError`: it is malformed.
    """
    place, segments = file.table(*keys), file.at(*keys, "knots")
    knots = tuple(file.numbers(*keys, "knots"))
    if not isinstance(segments, list) or not 1 < len(knots) <= MOST or list(knots) != sorted({*knots, fmpq(0), T2}):
        raise file.wrong(".".join((*keys, "knots")), "expected numbers that rise from 0 to T2", id="OBS702")
    roots = [keys, *((*keys, "parts", str(i + 1)) for i in range(1, theorem.lookahead))]
    first = file.at(*keys, "P")
    degree = len(first[0]) - 1 if isinstance(first, list) and first and isinstance(first[0], list) else 0
    if not 1 <= degree <= LARGEST_DEGREE:
        raise file.wrong(".".join((*keys, "P")), "expected a list of matrices for each segment", id="OBS702")
    of_goal = goal.theorem(replace(theorem, clock=Clock(knots, degree), decay=file.number(*keys, "lambda")))
    numbers = {name: file.number(*keys, name) for name in NUMBERS if name in place}
    for name in (goal.least, *goal.also):
        if name not in numbers:
            raise file.wrong(".".join((*keys, name)), "missing", id="OBS702")
    for name, value in numbers.items():
        if value < 0:
            raise file.wrong(".".join((*keys, name)), "negative", id="OBS702")
    P = np.stack([read_storage(file, of_goal, *root, "P") for root in roots])
    M = {
        u.name: np.stack([read_unknown(file, u, of_goal.clock, *root, "multipliers", u.name) for root in roots])
        for u in theorem.multiplier.unknowns()
    }
    return Witness(goal, of_goal, numbers, P, M)


def read_storage(file: ResultFile, theorem: ClockTheorem, *keys: str) -> Array:
    """Control values of one P, (N d + 1, m, m); each segment begins where the last one ends."""
    m, clock = theorem.system.order, theorem.clock
    P = file.stack((*clock.places.shape, m, m), *keys)
    if (P[1:, 0] != P[:-1, -1]).any():
        raise file.wrong(
            ".".join(keys), "a segment does not begin with the matrix that the last one ends with", id="OBS702"
        )
    if (P.swapaxes(-1, -2) != P).any():
        raise file.wrong(".".join(keys), "not symmetric", id="OBS702")
    return np.concatenate([P[:1, 0], *P[:, 1:]])


def read_unknown(file: ResultFile, unknown: Unknown, clock: Clock, *keys: str) -> Array:
    """Control values of an unknown of the multiplier, (N (d + 1), k, l)."""
    shape = clock.places.shape if unknown.shape == (1, 1) else (*clock.places.shape, *unknown.shape)
    values = file.stack(shape, *keys).reshape(clock.places.size, *unknown.shape)
    if unknown.symmetric and (values != values.swapaxes(-1, -2)).any():
        raise file.wrong(".".join(keys), "not symmetric", id="OBS702")
    return values
