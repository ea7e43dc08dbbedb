"""An observer without an LMI as it is proved and as it runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.expressions.tree import Number
from obsdesign.families.algebraic.identity import Domain, Identity, Negative, Verdict, nonzero
from obsdesign.families.observer import Observer
from obsdesign.model.equations import Named, Typed
from obsdesign.nonlinearities.evidence.restriction import SINCE_ZERO

ZERO = Expression.number(0)
OPEN = "not proved: "  # how a clause of a statement begins that says so
INVERTED = "for the left inverse holds on the whole domain"  # why xhat = x
UNBOUNDED = "a bound on xhat - x, which depends on what the left inverse makes of errors"


@dataclass(frozen=True)
class Nonzero:
    """A divisor that must not vanish on the domain."""

    name: str
    value: Expression

    def decided(self, domain: Domain) -> Verdict:
        """Whether it does not."""
        return nonzero(self.name, self.value, domain)


Statement = Identity | Negative | Nonzero


@dataclass(frozen=True)
class Excitation:
    """Regressors psi, a row of names for each regression, the determinant Delta of DREM, and guarded states."""

    regressors: tuple[Mapping[str, str], ...]  # names of psi by coordinate
    names: tuple[str, ...]  # coordinates whose constants are estimated
    determinant: Expression | None
    guarded: tuple[str, ...]


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
    domain: Domain

    @classmethod
    def of(cls, typed: Typed) -> "Plant":
        """Plant of a spec."""
        still = typed.undisturbed
        written = still.substituted(still.outputs)
        shown = {y: typed.domain[side.text] for y, side in written.outputs.items() if side.text in typed.domain}
        return cls(written.dynamics, written.outputs, written.inputs, {"t": SINCE_ZERO, **shown, **typed.domain})

    def along(self, phi: Expression) -> Expression:
        """L_f phi, the derivative of a function of the states; raises `UsageError` if it has none everywhere."""
        rates = [(slope(phi, name), side) for name, side in self.dynamics.items()]
        return added([multiplied(slope, side) for slope, side in rates])

    def on(self, expression: Expression, further: Named | None = None) -> Expression:
        """Expression of outputs (and of further signals) in terms of the states."""
        return expression.substituted({**self.outputs, **(further or {})})

    def output_rates(self, estimates: Named) -> dict[str, Expression]:
        """Return ydot at an estimate."""
        return {y: self.along(h).substituted(estimates) for y, h in self.outputs.items()}

    def measured(self) -> dict[str, Expression]:
        """States that an output shows by itself, as the output."""
        return {side.text: Expression.variable(y) for y, side in self.outputs.items() if side.text in self.dynamics}


def slope(side: Expression, name: str) -> Expression:
    """Partial derivative of what moves as its derivative says; raises `UsageError` of kinks and jumps."""
    if not side.smooth:
        said = f"{side} has a kink or a jump, where its derivative does not say how it moves; use a smooth function"
        raise UsageError(Problem(said, key="observer"))
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


def inverses(plant: Plant, left_inverse: Named, transformed: Named) -> list[Statement]:
    """Statements that a left inverse gives every state back, and has a value on the whole domain.

    `transformed`: the coordinates in terms of the states.
    """
    found: list[Statement] = []
    for name, side in left_inverse.items():
        back = plant.on(side, transformed)
        found.append(Identity(f"left inverse of {name}: {side} = {name}", less(back, Expression.variable(name))))
        found += values(plant, f"left inverse of {name}", side, transformed)
    return found


def values(plant: Plant, what: str, side: Expression, transformed: Named | None = None) -> list[Statement]:
    """Statements that an expression has a value at every point of the domain: divisors, roots, logarithms, arcs."""
    found: list[Statement] = [
        Nonzero(f"{what}: {divisor} is not 0", plant.on(divisor, transformed)) for divisor in side.divisors()
    ]
    for least, strict in side.requirements():
        value = scaled(fmpq(-1), plant.on(least, transformed))
        found.append(Negative(f"{what}: {least} {'>' if strict else '>='} 0", value, strict))
    return found
