"""An observer without an LMI as it is proved and as it runs."""

from collections.abc import Mapping, Sequence
from typing import Any

from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.expressions.needs import Need, further, needs
from obsdesign.expressions.tree import Number
from obsdesign.families.algebraic.identity import Identity, Negative, Nonzero, Undecided, short
from obsdesign.families.algebraic.region import Region
from obsdesign.families.observer import Observer
from obsdesign.model.equations import Named, Typed
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, SINCE_ZERO, Ends
from obsdesign.records import dataclass, field

ZERO = Expression.number(0)
OPEN = "not proved: "  # how a clause of a statement begins that says so
INVERTED = "for the left inverse holds on the whole domain"  # why xhat = x
DECAYS = "this error decays, which is not linear"
UNBOUNDED = "a bound on xhat - x, which depends on what the left inverse makes of errors"

Statement = Identity | Negative | Nonzero | Undecided


@dataclass(frozen=True)
class Excitation:
    """Regressors psi, a row of names for each regression, the determinant Delta of DREM, and guarded states.

    `need`: what the estimates need to converge, in words.
    """

    regressors: tuple[Mapping[str, str], ...]  # names of psi by coordinate
    names: tuple[str, ...]  # coordinates whose constants are estimated
    determinant: Expression | None
    guarded: tuple[str, ...]
    need: str = ""


@dataclass(frozen=True)
class Scheme:
    """What an observer rests on, and its equations."""

    statements: tuple[Statement, ...]
    observer: Observer
    numbers: Mapping[str, Any]  # entries of `guarantee`, but for the rates, which the statements give
    says: tuple[str, ...]  # what follows if every statement holds, clause by clause
    depends: tuple[str, ...] = ()  # what is not proved, for it depends on the run
    rates: Mapping[str, str] = field(default_factory=dict)  # statement that gives the rate of a coordinate, by name
    excitation: Excitation | None = None  # of an estimator with regressions


@dataclass(frozen=True)
class Plant:
    """The plant without disturbance and noise, and its derivatives along solutions."""

    dynamics: Named  # of states and inputs and t; the outputs are written out
    outputs: Named
    inputs: tuple[str, ...]
    region: Region

    @classmethod
    def of(cls, typed: Typed) -> "Plant":
        """Plant of a spec; raises `UsageError` if ranges of the same signal have nothing in common."""
        still = typed.undisturbed
        written = still.substituted(still.outputs)
        ranges = {**typed.domain, "t": common("t", "time", typed.domain.get("t", EVERYWHERE), SINCE_ZERO)}
        for y, side in written.outputs.items():
            if side.text in written.dynamics:
                ends = (ranges.get(name, EVERYWHERE) for name in (y, side.text))
                ranges[y] = ranges[side.text] = common(y, side.text, *ends)
        sides = (*written.dynamics.values(), *written.outputs.values())
        return cls(written.dynamics, written.outputs, written.inputs, Region(ranges, written.outputs, sides))

    def along(self, phi: Expression) -> Expression:
        """Derivative of a function of the states and t, with the inputs constant.

        Raises `UsageError`: it has none everywhere.
        """
        rates = [(slope(phi, name), side) for name, side in self.dynamics.items()]
        return added([slope(phi, "t"), *(multiplied(slope, side) for slope, side in rates)])

    def rate(self, y: str) -> Expression:
        """Derivative of an output; raises `UsageError` if it depends on an input, whose derivative is not known."""
        h = self.outputs[y]
        if varying := [name for name in self.inputs if name in h.names]:
            u = varying[0]
            said = (
                f"{y} = {h} is differentiated here, and {u}' is not known; make {u} a parameter if it is constant, or "
                f"a state with its derivative, or use an output without inputs"
            )
            raise UsageError(Problem(said, key=f"system.outputs.{y}", id="OBS504"))
        return self.along(h)

    def driven(self, side: Expression, estimates: Named | None = None) -> Expression:
        """What the outputs add to the derivative of a function of them, with ydot(x), or ydot at estimates of x.

        Raises `UsageError`: one of those that it depends on has no known derivative.
        """
        seen = [y for y in self.outputs if y in side.names]
        rates = [self.rate(y).substituted(estimates or {}) for y in seen]
        return added([multiplied(slope(side, y), rate) for y, rate in zip(seen, rates, strict=True)])

    def differentiable(self, *sides: Expression) -> "list[Statement]":
        """Statements that the outputs on which these depend move as their derivatives say."""
        seen = [y for y in self.outputs if any(y in side.names for side in sides)]
        return [stated(f"output {y}", need) for y in seen for need in further(self.outputs[y])]

    def on(self, expression: Expression, further: Named | None = None) -> Expression:
        """Expression of outputs (and of further signals) in terms of the states."""
        return expression.substituted({**self.outputs, **(further or {})})

    def measured(self) -> dict[str, Expression]:
        """States that an output shows by itself, as the output."""
        return {side.text: Expression.variable(y) for y, side in self.outputs.items() if side.text in self.dynamics}


def common(name: str, other: str, *ends: Ends) -> Ends:
    """Range of a signal that has two; raises `UsageError` if they have nothing in common."""
    low = max((low for low, _ in ends if low is not None), default=None)
    high = min((high for _, high in ends if high is not None), default=None)
    if low is not None and high is not None and low >= high:
        said = f"{name} is {other}, and their ranges have nothing in common; give one range, or two that overlap"
        raise UsageError(Problem(said, key=f"system.domain.{name}", id="OBS208"))
    return low, high


def slope(side: Expression, name: str) -> Expression:
    """Partial derivative of what moves as its derivative says; raises `UsageError` of kinks and jumps."""
    if not side.smooth:
        said = f"{side} has a kink or a jump, where its derivative does not say how it moves; use a smooth function"
        raise UsageError(Problem(said, key="observer", id="OBS307"))
    return side.derivative(name)


def added(parts: Sequence[Expression]) -> Expression:
    """Sum."""
    return Expression.combination([fmpq(1)] * len(parts), parts)


def less(a: Expression, *others: Expression) -> Expression:
    """Difference a - b - c .."""
    return Expression.combination([fmpq(1), *[fmpq(-1)] * len(others)], [a, *others])


def multiplied(*factors: Expression) -> Expression:
    """Product."""
    whole = factors[0].root
    for factor in factors[1:]:
        whole = whole * factor.root
    return Expression(whole)


def scaled(c: fmpq, e: Expression) -> Expression:
    """Multiple."""
    return Expression.combination([c], [e])


def decay(rate: Expression) -> str:
    """What e' = rate e says of an error, in words."""
    if isinstance(rate.root, Number):
        return f"obeys e' = {rate} e, so that e(t) = e(0) exp({multiplied(rate, Expression.variable('t'))})"
    return f"obeys e' = lambda e, lambda = {rate} < 0, so that e(t) = e(0) exp(integral of lambda from 0 to t)"


def unbounded(source: str, target: str, factor: Expression) -> str:
    """What is not proved of an error that acts on another by a factor without a known bound, in words."""
    return f"that {source} acts on {target} by a bounded factor, {short(factor)}"


def inverses(plant: Plant, left_inverse: Named, transformed: Named) -> list[Statement]:
    """Statements that a left inverse gives every state back, and has a value on the whole domain.

    `transformed`: the coordinates in terms of the states.
    """
    found: list[Statement] = []
    for name, side in left_inverse.items():
        back = plant.on(side, transformed)
        found.append(Identity(f"left inverse of {name}: {side} = {name}", less(back, Expression.variable(name))))
        found += values(f"left inverse of {name}", side, transformed)
    return found


def values(what: str, side: Expression, transformed: Named | None = None, leaves: str = "") -> list[Statement]:
    """Statements that an expression has a value at every point of the domain: divisors, roots, logarithms, arcs.

    `transformed`: signals of the observer in terms of the states; `leaves`: as of an `Identity`.
    """
    return [stated(what, need, transformed, leaves) for need in needs(side)]


def smooth(what: str, side: Expression, transformed: Named | None = None, leaves: str = "") -> list[Statement]:
    """Statements that an expression has a value at every point of the domain, and moves as its derivative says."""
    return [stated(what, need, transformed, leaves) for need in (*needs(side), *further(side))]


def stated(what: str, need: Need, transformed: Named | None = None, leaves: str = "") -> Statement:
    """Statement of a need."""
    name, put, leaves = f"{what}: {need.text}", transformed or {}, leaves or need.leaves
    value, branch = need.value.substituted(put), tuple(c.substituted(put) for c in need.branch)
    if need.sign == "is not 0":
        return Nonzero(name, value, branch, leaves)
    return Negative(name, scaled(fmpq(-1), value), need.sign == "> 0", branch, leaves)
