"""Coordinates phi with phi' = lambda(y, u) phi + B(t, y, u) along a plant, exactly, among combinations of functions.

With d_j the derivatives along which no output changes, such a B exists iff d_j (L_f phi - lambda phi) = 0 for all j
(Yi, Ortega and Zhang 2018, equation (4)). For phi = sum_k c_k m_k and lambda = k s(y, u) that is (M0 - k M1) c = 0
with rational matrices: one row for each product of signals in the numerators of d_j L_f m_k and s d_j m_k.
"""

from collections.abc import Sequence
from contextlib import suppress
from functools import cached_property, reduce
from itertools import combinations_with_replacement
from math import comb

from flint import fmpq, fmpq_mat, fmpq_mpoly

from obsdesign.expressions import Expression, ExpressionError
from obsdesign.expressions.algebra import Fraction, Symbols, identical
from obsdesign.expressions.tree import Number, number, product
from obsdesign.families.algebraic.forms import Coordinate
from obsdesign.families.algebraic.rational import Vector, independent, table
from obsdesign.families.algebraic.scheme import added, less, multiplied, scaled
from obsdesign.model.equations import Equations, Named
from obsdesign.records import dataclass, field

MAX_FUNCTIONS = 300  # in an ansatz
SPARE = 8  # symbols that derivatives may bring in


def simplified(expression: Expression) -> Expression:
    """Same function, in lowest terms where it is rational."""
    symbols = Symbols.of([expression])
    return symbols.expression(symbols.fraction(expression))


@dataclass(frozen=True)
class Measured:
    """What the outputs tell of the states at an instant."""

    states: Named  # each as a function of outputs, inputs, t and the states that are not measured
    parts: Named  # functions of states alone that are known with t and the inputs, one for each of these
    left: tuple[str, ...]  # states that are not measured
    unused: tuple[str, ...]  # outputs that could not be solved for a state

    @classmethod
    def of(cls, equations: Equations) -> "Measured":
        """Solve each output for a state in which it is linear, plain states first."""
        solved: dict[str, Expression] = {}
        parts: dict[str, Expression] = {}
        unused = []
        for output, side in sorted(equations.outputs.items(), key=lambda item: len(item[1].order)):
            rest = simplified(side.substituted(solved))
            states = [name for name in equations.states if name in rest.names]
            slopes = {name: simplified(rest.derivative(name)).root for name in states}
            state = next((name for name in states if isinstance(slopes[name], Number)), None)
            if state is None:
                unused += [output] if states else []
                continue
            slope = slopes[state]
            assert isinstance(slope, Number)
            gap = scaled(1 / slope.value, less(Expression.variable(output), rest))
            inverse = simplified(added([Expression.variable(state), gap]))
            solved = {name: simplified(e.substituted({state: inverse})) for name, e in solved.items()}
            solved[state] = inverse
            parts[state] = known_part(simplified(side), state, equations.states)
        left = tuple(name for name in equations.states if name not in solved)
        return cls(solved, parts, left, tuple(unused))


def known_part(side: Expression, state: str, states: Sequence[str]) -> Expression:
    """What an output says of the states alone, with 1 as the coefficient of the state; the state, where terms mix."""
    terms = [(c, e) for c, e in side.summands() if not e.names.isdisjoint(states)]
    whole = Expression.combination([c for c, _ in terms], [e for _, e in terms])
    slope = simplified(whole.derivative(state)).root
    if not whole.names <= set(states) or not isinstance(slope, Number):
        return Expression.variable(state)
    return simplified(scaled(1 / slope.value, whole))


@dataclass(frozen=True)
class Term:
    """A function m_k of an ansatz."""

    expression: Expression
    value: Fraction
    hidden: int  # its degree, 0 where it is known with the outputs


@dataclass(frozen=True)
class Derivation:
    """Derivative of functions of signals for given rates of the states."""

    symbols: Symbols
    rates: Named
    known: dict[int, Fraction] = field(default_factory=dict)  # of what a symbol stands for

    def of(self, value: Fraction) -> Fraction:
        """Quotient rule."""
        one = self.symbols.constant(1)
        above, below = (self.polynomial(p) for p in (value.above, value.below))
        loss = Fraction(-value.above, value.below) * below
        return self.symbols.reduced((above + loss) / Fraction(value.below, one.below))

    def polynomial(self, p: fmpq_mpoly) -> Fraction:
        """Chain rule."""
        one, total = self.symbols.constant(1).below, self.symbols.constant(0)
        for index in [i for i, n in enumerate(p.degrees()) if n > 0]:
            total += Fraction(p.derivative(index), one) * self.of_symbol(index)
        return total

    def of_symbol(self, index: int) -> Fraction:
        """Derivative of what a symbol stands for."""
        if index not in self.known:
            meaning, total = self.symbols.terms[index], self.symbols.constant(0)
            for name in sorted(meaning.names & self.rates.keys()):
                parts = (meaning.derivative(name), self.rates[name])
                slope, rate = (self.symbols.fraction(part) for part in parts)
                total += slope * rate
            self.known[index] = self.symbols.reduced(total)
        return self.known[index]


@dataclass(frozen=True)
class Ansatz:
    """Products of states and given functions of them, up to a degree, and how the plant moves them."""

    equations: Equations  # explicit, without disturbances
    measured: Measured
    functions: tuple[Expression, ...]
    most: int  # highest degree, if that gives not more than MAX_FUNCTIONS products
    rates: tuple[Expression, ...]  # s that will be asked for

    @property
    def degree(self) -> int:
        """Highest degree of a product."""
        n, degree = len(self.factors), self.most
        while degree > 1 and comb(n + degree, degree) > MAX_FUNCTIONS:
            degree -= 1
        return degree

    @cached_property
    def factors(self) -> list[Expression]:
        """What products are made of: known parts of states first."""
        known = [self.measured.parts[name] for name in self.equations.states if name in self.measured.parts]
        return [*known, *map(Expression.variable, self.measured.left), *self.functions]

    @cached_property
    def symbols(self) -> Symbols:
        """Room for all that follows, and little more."""
        states, outputs = self.equations.states, self.equations.outputs
        sides = [*self.equations.dynamics.values(), *outputs.values(), *self.measured.states.values(), *self.factors]
        slopes = [side.derivative(name) for side in sides for name in states]
        second = [side.derivative(a).derivative(b) for side in self.functions for a in states for b in states]
        rates = [side.substituted(outputs) for side in self.rates]
        all_of_it = [*map(Expression.variable, self.equations.signals), *sides, *slopes, *second, *rates]
        wide = Symbols.of(all_of_it)
        for side in all_of_it:
            wide.fraction(side)
        return Symbols(len(wide.numbers) + SPARE, parts=wide.parts)

    def fraction(self, expression: Expression) -> Fraction:
        """Expression in lowest terms."""
        return self.symbols.reduced(self.symbols.fraction(expression))

    @cached_property
    def hidden(self) -> list[Derivation]:
        """d_j: for each state that is not measured, its slope with the others such that no output changes."""
        fields = []
        for name in self.measured.left:
            slopes = {state: side.derivative(name) for state, side in self.measured.states.items()}
            rates = {state: slope.substituted(self.equations.outputs) for state, slope in slopes.items()}
            fields.append(Derivation(self.symbols, {**rates, name: Expression.number(1)}))
        return fields

    @cached_property
    def terms(self) -> list[Term]:
        """Functions m_k, those that are known with the outputs first, then by degree; none depends on the others."""
        factors = [self.fraction(factor) for factor in self.factors]
        found = []
        for degree in range(1, self.degree + 1):
            for places in combinations_with_replacement(range(len(factors)), degree):
                value = self.symbols.reduced(reduce(Fraction.__mul__, [factors[i] for i in places]))
                powers = [self.factors[i].root ** number(places.count(i)) for i in dict.fromkeys(places)]
                found.append(Term(Expression(product(powers)), value, 0 if self.is_known(value) else degree))
        found.sort(key=lambda term: term.hidden)
        if not self.functions:
            return found
        values = [self.symbols.constant(1), *(term.value for term in found)]
        return [found[k - 1] for k in independent(table(self.numerators([values])))[1:]]

    def holds(self, phi: Expression) -> bool:
        """Whether a function is a combination of the m_k and a constant."""
        with suppress(ExpressionError):  # one with further functions than there is room for is none
            values = [self.symbols.constant(1), *(term.value for term in self.terms), self.fraction(phi)]
            return len(values) - 1 not in independent(table(self.numerators([values])))
        return False

    def is_known(self, value: Fraction) -> bool:
        """Whether a function is one of outputs, inputs and t."""
        return all(field.of(value).above == 0 for field in self.hidden)

    @cached_property
    def flows(self) -> list[Fraction]:
        """L_f m_k."""
        flow = Derivation(self.symbols, self.equations.dynamics)
        return [flow.of(term.value) for term in self.terms]

    @cached_property
    def moved(self) -> list[tuple[list[Fraction], list[Fraction]]]:
        """d_j L_f m_k and d_j m_k, for each j."""
        values = [term.value for term in self.terms]
        return [([f.of(flow) for flow in self.flows], [f.of(value) for value in values]) for f in self.hidden]

    def numerators(self, rows: Sequence[Sequence[Fraction]]) -> list[dict[object, fmpq]]:
        """Columns: entries of all rows on their common denominators, each by row and product of signals."""
        found: list[dict[object, fmpq]] = [{} for _ in rows[0]] if rows else []
        for j, row in enumerate(rows):
            for column, above in zip(found, self.common(row), strict=True):
                column.update({(j, powers): c for powers, c in above.to_dict().items()})
        return found

    def common(self, values: Sequence[Fraction]) -> list[fmpq_mpoly]:
        """Numerators on a common denominator, in which no power is higher than its relation leaves."""
        while True:
            below = reduce(least_common, [value.below for value in values], self.symbols.constant(1).below)
            if below.is_constant():
                return [value.above / below.leading_coefficient() for value in values]
            one = self.symbols.constant(1).below
            values = [self.symbols.reduced(Fraction(v.above * (below / v.below), one)) for v in values]

    @cached_property
    def given(self) -> list[tuple[Expression, Fraction]]:
        """Products that B may have beside what it is found to be: of outputs that could not be solved for a state."""
        unused = self.measured.unused
        names = [*unused, *(name for name in self.equations.outputs if name not in unused), *self.equations.inputs]
        found: list[tuple[Expression, Fraction]] = []
        for degree in range(1, self.degree + 1):
            for chosen in combinations_with_replacement(names, degree):
                if chosen[0] in unused and len(found) < MAX_FUNCTIONS:
                    term = multiplied(*map(Expression.variable, chosen))
                    found.append((term, self.fraction(term.substituted(self.equations.outputs))))
        return found

    def pencil(self, s: Expression) -> tuple[fmpq_mat, fmpq_mat]:
        """M0 and M1 of lambda = k s, in as few rows as hold what they say together.

        The last columns are those of the products that are given, in which lambda has no part.
        """
        scale, zero, minus = self.fraction(s.substituted(self.equations.outputs)), fmpq(0), self.symbols.constant(-1)
        rows = []
        for d, (first, second) in zip(self.hidden, self.moved, strict=True):
            known = [minus * d.of(value) for _, value in self.given]
            rows.append([*first, *known, *(self.symbols.reduced(scale * each) for each in second)])
        rows.append(self.jumps(scale))
        reduced, rank = table(self.numerators(rows)).rref()
        n, m = len(self.terms), len(self.given)
        M0 = [reduced[i, j] for i in range(rank) for j in range(n + m)]
        M1 = [reduced[i, n + m + j] if j < n else zero for i in range(rank) for j in range(n + m)]
        return fmpq_mat(rank, n + m, M0), fmpq_mat(rank, n + m, M1)

    def jumps(self, scale: Fraction) -> list[Fraction]:
        """What B would hold of jumps such as sign(x2) whose place is not known, which d_j do not see."""
        hidden, states = set(self.measured.left), self.measured.states
        unseen = {
            index
            for index, term in [*self.symbols.terms.items()]
            if not term.names.isdisjoint({*hidden, *states})
            and all(d.of_symbol(index).above == 0 for d in self.hidden)
            and not simplified(term.substituted(states)).names.isdisjoint(hidden)
        }
        minus, one = self.symbols.constant(-1), self.symbols.constant(1).below
        values = [
            *self.flows,
            *(minus * value for _, value in self.given),
            *(scale * term.value for term in self.terms),
        ]
        if not unseen:
            return [Fraction(one * 0, one)] * len(values)
        return [
            Fraction(
                one.context().from_dict({p: c for p, c in above.to_dict().items() if any(p[i] for i in unseen)}), one
            )
            for above in self.common([self.symbols.reduced(value) for value in values])
        ]

    def coordinate(self, name: str, c: Vector, rate: Expression) -> Coordinate | None:
        """The coordinate of a vector in the kernel; None if its equation could not be proved."""
        outputs, n = self.equations.outputs, len(self.terms)
        plain = {Expression.variable(state) for state in self.measured.left}
        parts = zip(c, self.terms, strict=False)
        lead = next((weight for weight, term in parts if weight != 0 and term.expression in plain), fmpq(1))
        weights = [weight / lead for weight in c]
        phi = Expression.combination(weights[:n], [term.expression for term in self.terms])
        given = Expression.combination(weights[n:], [expression for expression, _ in self.given])
        flow = added([multiplied(phi.derivative(state), side) for state, side in self.equations.dynamics.items()])
        residual = less(flow, multiplied(rate.substituted(outputs), phi))
        rest = simplified(less(residual, given.substituted(outputs))).substituted(self.measured.states)
        B = simplified(added([rest, given]))
        proved = B.names.isdisjoint(self.equations.states) and identical(B.substituted(outputs), residual)
        return Coordinate(name, phi, rate, B) if proved else None


def least_common(a: fmpq_mpoly, b: fmpq_mpoly) -> fmpq_mpoly:
    """Least common multiple."""
    return a * (b / a.gcd(b))
