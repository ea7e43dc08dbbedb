"""Coordinates of a plant, found: those that with the outputs give every state, and in words what was searched.

For each s(y, u), all numbers k such that lambda = k s has a coordinate in the ansatz are known exactly: every one, or
the roots of a polynomial. Those with lambda < 0 on the whole domain come first; one with lambda = 0 needs an estimator.
Where states are missing, the search goes on with the coordinates that were found taken as known (a cascade).
"""

from collections.abc import Iterator
from functools import cached_property
from math import isfinite

import numpy as np
from flint import fmpq, fmpq_mat

from obsdesign.errors import Problem, UndecidedError, UsageError
from obsdesign.expressions import Expression, ExpressionError, constant
from obsdesign.expressions.exact import double
from obsdesign.expressions.tree import Number, quotient
from obsdesign.families.algebraic.ansatz import MAX_FUNCTIONS, Ansatz, Measured, simplified
from obsdesign.families.algebraic.forms import Coordinate
from obsdesign.families.algebraic.inverse import enclosure, inverted
from obsdesign.families.algebraic.rational import Eigenvalues, Vector, columns, eigenvalues, kernel
from obsdesign.families.algebraic.region import Domain
from obsdesign.families.algebraic.scheme import ZERO, less, scaled
from obsdesign.families.algebraic.sylvester import Sylvester, linear
from obsdesign.model.equations import Equations, Named, Typed, free
from obsdesign.records import dataclass, replace

SLOW = 10  # a rate is slow where it is so many times below that of the plant
MOST = 12  # remarks

ONE = Expression.number(1)


@dataclass(frozen=True)
class Search:
    """What is searched."""

    degree: int = 3
    lambdas: tuple[Expression, ...] = ()  # of outputs and inputs, tried as they are; none: those of `shapes`
    functions: tuple[Expression, ...] = ()  # of the states
    negative: bool = True  # whether lambda < 0 is wanted
    zero: bool = True  # whether lambda = 0 is wanted


@dataclass(frozen=True)
class Found:
    """Coordinates that were found, and what they give."""

    coordinates: tuple[Coordinate, ...]
    left_inverse: Named  # each state that they give and that is no output by itself, in outputs and coordinates
    missing: tuple[str, ...]  # states that are not reached
    others: tuple[Coordinate, ...]  # which solve the equation too, and are not needed
    searched: str
    remarks: tuple[str, ...]
    sylvester: Sylvester | None  # of a linear plant

    @property
    def sentence(self) -> str:
        """What was found, and where it was searched."""
        names = " and ".join([", ".join(each.name for each in self.coordinates), "the outputs"]).removeprefix(" and ")
        if self.missing:
            return f"no coordinate was found that gives {', '.join(self.missing)}; {self.searched}"
        return f"{names} give every state; {self.searched}"


@dataclass(frozen=True)
class Candidate:
    """A coordinate that solves the equation, and how well it suits."""

    coordinate: Coordinate
    zero: bool  # whether lambda is 0
    slow: bool  # whether the plant is much faster
    degree: int  # of its highest product that is not known with the outputs
    size: int  # how many products it has
    shape: int  # place of s among those that are offered

    @property
    def key(self) -> tuple[int, ...]:
        """Order in which candidates are taken."""
        return (self.zero, self.slow, self.degree, self.size, self.shape)


@dataclass(frozen=True)
class Offer:
    """All numbers k at which lambda = k s has coordinates."""

    place: int
    s: Expression
    M0: fmpq_mat
    M1: fmpq_mat
    found: Eigenvalues
    simple: tuple[fmpq, ...] = ()  # where it has some that hold no known function


@dataclass(frozen=True)
class Finder:
    """A plant, and what is searched of it."""

    equations: Equations  # explicit, without disturbances
    domain: Domain
    search: Search
    earlier: tuple[Coordinate, ...] = ()  # taken as known

    @cached_property
    def seen(self) -> Equations:
        """The plant with earlier coordinates among its outputs."""
        return replace(self.equations, outputs={**self.equations.outputs, **{c.name: c.phi for c in self.earlier}})

    @cached_property
    def measured(self) -> Measured:
        """What the outputs tell at an instant."""
        return Measured.of(self.seen)

    @cached_property
    def linear(self) -> bool:
        """Whether the plant is linear with constant coefficients, but for known terms."""
        return linear(self.equations)

    @cached_property
    def shapes(self) -> list[Expression]:
        """Functions s of lambda = k s: 1, u, 1 - u, y, y^2 for each input and output; 1 alone for a linear plant."""
        found = [ONE]
        if not self.linear:
            for name in self.equations.inputs:
                u = Expression.variable(name)
                found += [u, less(ONE, u)]
            for name in self.equations.outputs:
                found += [Expression.variable(name), Expression.squares([name])]
        return found

    @cached_property
    def ansatz(self) -> Ansatz:
        """Functions that phi is a combination of."""
        degree, functions = (1, ()) if self.linear else (self.search.degree, self.search.functions)
        return Ansatz(self.seen, self.measured, functions, degree, (*self.shapes, *self.search.lambdas))

    def value_at_middle(self, value: Expression) -> float:
        """Value in the middle of the domain."""
        inside = value.substituted(self.equations.outputs)
        names = sorted(inside.names)
        return float(inside.function(names)(*(middle(*self.domain.get(name, (None, None))) for name in names)))

    @cached_property
    def rate(self) -> float:
        """How fast the plant is: largest |eigenvalue| of its Jacobian in the middle of the domain, 1/s."""
        states = self.equations.states
        sides = self.equations.dynamics.values()
        J = np.array([[self.value_at_middle(side.derivative(name)) for name in states] for side in sides])
        if not np.isfinite(J).all():
            return 1.0
        largest = float(np.abs(np.linalg.eigvals(J)).max())
        return largest if largest > 0 else 1.0

    def found(self) -> Found:
        """Solve for the candidates, and take those that give every state, or as many as they can."""
        offers = [self.offer(place, s) for place, s in enumerate(self.search.lambdas or self.shapes)]
        candidates = sorted((c for offer in offers for c in self.candidates(offer)), key=lambda c: c.key)
        inverse = inverted([c.coordinate for c in candidates], self.seen, self.measured, self.domain)
        taken, first = {"t", *self.seen.signals}, len(self.earlier) + 1
        names = {each.name: free(f"xi{i}", taken) for i, each in enumerate(inverse.chosen, first)}
        renamed = {name: Expression.variable(new) for name, new in names.items()}
        chosen = (*self.earlier, *(replace(each, name=names[each.name]) for each in inverse.chosen))
        if inverse.missing and inverse.chosen:
            return replace(self, earlier=chosen).found()
        shown = {side.text for side in self.equations.outputs.values()}
        states = {name: side.substituted(renamed) for name, side in inverse.states.items() if name not in shown}
        others = tuple(c.coordinate for c in candidates if c.coordinate not in inverse.chosen)
        remarks = [*self.curved()]
        if inverse.missing:
            remarks += [remark for offer in offers for remark in self.remarks(offer)][:MOST]
        suited = Sylvester.of(self.equations, chosen) if self.linear else None
        return Found(chosen, states, inverse.missing, others, self.searched, tuple(remarks), suited)

    def holds(self, coordinate: Coordinate) -> bool:
        """Whether a coordinate is among what is searched: sign and form of its lambda, and phi in the ansatz."""
        rate, lambdas = coordinate.rate, self.search.lambdas
        wanted = self.search.zero if rate == ZERO else self.search.negative
        if lambdas:
            known = rate in lambdas
        else:
            ratios = (simplified(Expression(quotient(rate.root, s.root))).root for s in self.shapes)
            known = any(isinstance(ratio, Number) for ratio in ratios)
        return wanted and known and self.ansatz.holds(coordinate.phi)

    def offer(self, place: int, s: Expression) -> Offer:
        """What is known of one s."""
        M0, M1 = self.ansatz.pencil(s)
        if self.search.lambdas:
            return Offer(place, s, M0, M1, Eigenvalues(every=False, rational=(fmpq(1),)))
        found = eigenvalues(M0, M1)
        simple: tuple[fmpq, ...] = ()
        if found.every:  # and where no known function is needed
            known = [k for k, term in enumerate(self.ansatz.terms) if not term.hidden]
            hidden = [k for k in range(M0.ncols()) if k not in known]
            simple = eigenvalues(columns(M0, hidden), columns(M1, hidden)).rational
        return Offer(place, s, M0, M1, found, simple)

    def numbers(self, offer: Offer) -> list[fmpq]:
        """Numbers k at which lambda = k s is tried: those that are special, and some of all others."""
        tried = [*offer.found.rational, *offer.simple]
        if offer.found.every:
            unit = abs(self.value_at_middle(offer.s))
            usual = self.rate / unit if unit > 0 and isfinite(unit) else self.rate
            k = -constant(f"{usual:.0e}")[0]
            tried += [k * (1 + fmpq(i, 2)) for i in range(len(self.measured.left))]
            tried.append(fmpq(0))
        return sorted(set(tried), reverse=True)

    def suits(self, k: fmpq, s: Expression, place: int) -> bool:
        """Whether k s is wanted: 0, or negative on the whole domain."""
        if k == 0 or s == ZERO:
            return self.search.zero and (place == 0 or s == ZERO)
        return self.search.negative and self.negative(k, s)

    def negative(self, k: fmpq, s: Expression) -> bool:
        """Whether k s is proved to be negative on the domain."""
        return bool(enclosure(scaled(k, s), self.equations, self.domain).high.max() < 0)

    def candidates(self, offer: Offer) -> Iterator[Candidate]:
        """Coordinates of one s, for every number k that is tried and suits."""
        for k in self.numbers(offer):
            if not self.suits(k, offer.s, offer.place):
                continue
            rate = scaled(k, offer.s)
            slow = 0 < abs(self.value_at_middle(rate)) < self.rate / SLOW
            for i, (c, degree) in enumerate(self.kernel(offer, k)):
                coordinate = self.ansatz.coordinate(f"xi_{offer.place}_{k}_{i}", c, rate)
                if coordinate:
                    size = sum(weight != 0 for weight in c)
                    yield Candidate(coordinate, k == 0 or offer.s == ZERO, slow, degree, size, offer.place)

    def kernel(self, offer: Offer, k: fmpq) -> Iterator[tuple[Vector, int]]:
        """Vectors whose phi is not known with the outputs, with the degree of their highest hidden product."""
        for c in kernel(offer.M0 - k * offer.M1):
            used = [term.hidden for weight, term in zip(c, self.ansatz.terms, strict=False) if weight != 0]
            degree = max(used, default=0)
            if degree > 0:
                yield c, degree

    def curved(self) -> Iterator[str]:
        """Outputs that no state could be solved for."""
        for name in self.measured.unused:
            yield f"{name} is linear in no state; B was searched among products with it up to the same degree"

    def remarks(self, offer: Offer) -> Iterator[str]:
        """What was found of one s and is not used."""
        s, found = offer.s, offer.found
        if self.search.lambdas:
            if not self.suits(fmpq(1), s, offer.place):
                yield f"lambda = {s} {self.unsuited(s)}, and was not tried"
            return
        signs = [self.negative(fmpq(sign), s) for sign in (1, -1)]
        if found.every and self.search.negative and not any(signs):
            yield f"lambda = k*({s}) has some for every k, but {s} is not proved to keep one sign on the domain"
        elif found.every and self.search.negative:
            tried = [str(k) for k in self.numbers(offer) if k != 0 and self.suits(k, s, offer.place)]
            yield f"lambda = k*({s}) has some for every k; tried were k = {', '.join(tried)}"
        for k in sorted({*found.rational, *offer.simple}):
            if not self.suits(k, s, offer.place) and (k != 0 or offer.place == 0):
                yield from self.refused(offer, k)
        for p in found.others:
            if roots := [float(root.real.mid()) for root, _ in p.complex_roots() if root.imag == 0 and root.real < 0]:
                near = ", ".join(f"{root:.4g}" for root in roots)
                yield f"lambda = k times {s} has more at the roots k of {p}, near {near}, which are not rational"

    def unsuited(self, rate: Expression) -> str:
        """Why a lambda is not used."""
        wanted = self.search.zero if rate == ZERO else self.search.negative
        return "is not proved to be negative on the domain" if wanted else "is not wanted"

    def refused(self, offer: Offer, k: fmpq) -> Iterator[str]:
        """Coordinates whose lambda does not suit."""
        rate = scaled(k, offer.s)
        for c, _ in self.kernel(offer, k):
            if coordinate := self.ansatz.coordinate("xi", c, rate):
                yield f"phi = {coordinate.phi} solves its equation, but its lambda, {rate}, {self.unsuited(rate)}"

    @property
    def searched(self) -> str:
        """The ansatz in words."""
        factors = ", ".join([*self.equations.states, *(each.text for each in self.ansatz.functions)])
        if self.search.lambdas:
            rates = f"lambda = {', '.join(each.text for each in self.search.lambdas)}"
        else:
            rates = f"lambda = k s for every rational k and s = {', '.join(s.text for s in self.shapes)}"
        known = f", with {', '.join(each.name for each in self.earlier)} taken as known" if self.earlier else ""
        used, most = self.ansatz.degree, self.ansatz.most
        lowered = f" (not {most}: there would be more than {MAX_FUNCTIONS})" if used < most else ""
        products = f"products of {factors} up to degree {used}{lowered}"
        return f"searched: sums of {products}, {rates}{known}"


def find(typed: Typed, search: Search) -> Found:
    """Find coordinates of a plant, its disturbances 0.

    Raises
    ------
    UsageError
        A function has kinks or jumps.
    UndecidedError
        Products are too large to be multiplied out.
    """
    for each in search.functions:
        if not each.smooth:
            said = f"{each} has a kink or a jump; phi must be smooth; leave it out"
            raise UsageError(Problem(said, key="observer.functions", id="OBS307"))
    try:
        return Finder(explicit(typed), typed.domain, search).found()
    except ExpressionError as error:
        said = f"the equations of products up to degree {search.degree}: {error.message}; lower observer.degree"
        raise UndecidedError(said, id="OBS507") from None


def explicit(typed: Typed) -> Equations:
    """Plant without disturbances, with its outputs written out in states, inputs and t."""
    still = typed.undisturbed
    return still.substituted(still.outputs)


def middle(low: fmpq | None, high: fmpq | None) -> float:
    """Middle of a range, its end where it has one, else 0."""
    ends = [double(end) for end in (low, high) if end is not None]
    return sum(ends) / len(ends) if ends else 0.0
