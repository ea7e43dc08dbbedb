"""Statements on the errors of a run in Coq, and the tactics that prove them.

Of each error e Coq derives e' along the run, and shows by `field` that it is rate e, as far as other errors are zero.
"""

from collections.abc import Sequence
from functools import reduce

from flint import fmpq

from obsdesign.coq.identities import Fall, Identities, Inverse, Law, Resolved, factors
from obsdesign.coq.signals import ATOM, along, bounds, derivable, literal, operand, quotient_of, text, vanishes
from obsdesign.coq.theorem import UnexportedError
from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, identity, rational_number
from obsdesign.records import dataclass
from obsdesign.tables.text import at_least

TIME = "forall t, 0 <= t <= T ->"
ZERO, ONE = Expression.number(0), Expression.number(1)


def facts(claim: Identities, *functions: Expression) -> str:
    """Tactics that put into the context what linear arithmetic needs of functions at the time t."""
    found: dict[str, None] = {}
    for f in functions:
        known = bounds(f, claim.run.ranges)
        found |= {f"assert (R' := range_{claim.names[name]}' t K')": None for name in known.signals}
        for lemma, argument, half in known.facts:
            inner = text(argument, claim.names) if argument else ""
            power = f"(R' : 0 <= ({inner}) ^ {2 * half}) by exact ({lemma} ({inner}) {half})"
            plain = f"(R' := {lemma} ({inner}))"
            found[f"assert {power if half else plain}"] = None
    return "".join(one.replace("(R'", f"(R{i}'") + ". " for i, one in enumerate(found, start=1))


@dataclass(frozen=True)
class Stated:
    """A law in Coq."""

    claim: Identities
    law: Law

    def __post_init__(self) -> None:
        """Hold it against what `field` proves; raises `UnexportedError`."""
        claim, law, run = self.claim, self.law, self.claim.run
        value = claim.whole(claim.defined[law.error])
        rates = {**run.states, **run.observer, **dict.fromkeys(run.held, ZERO), "t": ONE}
        if stray := sorted(value.names - rates.keys()):
            raise UnexportedError(f"{law.what} takes the derivative of {stray[0]}, of which no equation is known")
        if not derivable(value):
            raise UnexportedError(f"{law.what} has a function that the library in Coq does not derive")
        moving = along(value, rates)
        for name, rate in law.rates.items():
            moving = moving - rate * claim.defined[name]
        for solved in self.solutions:
            moving = claim.whole(moving).substituted({solved.signal: claim.whole(solved.value)})
        if not vanishes(claim.whole(moving)):
            raise UnexportedError(f"{law.what} is no identity that ring and field of Coq prove")

    @property
    def solutions(self) -> list[Resolved]:
        """What the errors before it give; raises `UnexportedError`."""
        missing = [name for name in self.law.before if name not in self.claim.solved]
        if missing:
            raise UnexportedError(f"{self.law.what} holds where {missing[0]} = 0, which is not solved for a signal")
        return [self.claim.solved[name] for name in self.law.before]

    @property
    def premise(self) -> str:
        """That the errors before it are zero."""
        return "".join(f"vanishes T {self.claim.names[name]} -> " for name in self.law.before)

    @property
    def moving(self) -> Expression:
        """Derivative of the error, over errors."""
        terms = [rate * Expression.variable(name) for name, rate in self.law.rates.items()]
        return reduce(Expression.__add__, terms, ZERO)

    @property
    def bound(self) -> fmpq | None:
        """Decay that linear arithmetic shows; None where it does not."""
        most = bounds(self.whole, self.claim.run.ranges).high
        if self.law.bound is None:
            return rational_number(at_least(-most)) if most is not None and most < 0 else None
        told = self.law.bound
        return told if (most is not None and most <= -told) or self.parts(told) else None

    @property
    def whole(self) -> Expression:
        """Rate of the error, over the signals that have equations."""
        return self.claim.whole(self.law.rates[self.law.error])

    def parts(self, c: fmpq) -> tuple[Expression, Expression] | None:
        """Polynomials a and b with rate = a / b, b > 0 and a + c b <= 0; None where that is not shown."""
        ranges = self.claim.run.ranges
        if (found := quotient_of(self.whole)) is None:
            return None
        for sign in (Expression.number(1), Expression.number(-1)):
            a, b = (sign * side for side in found)
            most = bounds(a + Expression.number(c) * b, ranges).high
            if bounds(b, ranges).shows("> 0") and most is not None and most <= 0:
                return a, b
        return None

    @property
    def statement(self) -> str:
        """What is stated."""
        e, law = self.claim.names[self.law.error], self.law
        if not law.rates:
            return f"({self.premise}still T {e})"
        if not law.alone:
            return f"({self.premise}{TIME} is_derive {e} t {operand(self.moving, self.claim.names)})"
        rate = self.claim.names[f"rate {law.error}"]
        if self.bound is not None:
            return f"({self.premise}obeys T {e} {rate} /\\ decays T {e} {literal(self.bound).within(ATOM)})"
        every = f"(forall c, below T {rate} c -> decays T {e} c)"
        return f"({self.premise}obeys T {e} {rate} /\\ {every})"

    def derived(self) -> list[str]:
        """Tactics that show how the error moves at the time t, once it is said that those before it are zero."""
        claim = self.claim
        lets, found = unfolded(claim), list[str]()
        for i, solved in enumerate(self.solutions):
            signal, value = claim.names[solved.signal], text(claim.whole(solved.value), claim.names)
            inner = f"assert (E' := Z{i}' t K'); unfold {lets} in E'; lra"
            found.append(f"assert (V{i}' : {signal} t = {value}) by ({inner}).")
        rewrites = "".join(f"rewrite ?V{i}'; " for i in range(len(found)))
        return [*found, f"unfold {lets}. moves K'.", f"{rewrites}algebra K'."]

    @property
    def given(self) -> str:
        """Tactic that takes its premises."""
        return "".join(f"intros Z{i}'. " for i in range(len(self.law.before)))

    def proof(self) -> list[str]:
        """Tactics that show it."""
        claim, law = self.claim, self.law
        e, rate = claim.names[law.error], claim.names[f"rate {law.error}"]
        if not law.rates:
            return [f"{self.given}apply constant. intros t K'.", *self.derived()]
        if not law.alone:
            return [f"{self.given}intros t K'.", *self.derived()]
        *first, last = self.derived()
        lines = [
            f"{self.given}assert (O' : obeys T {e} {rate}).",
            f"{{ intros t K'. unfold {rate}.",
            *first,
            f"{last} }}",
        ]
        if self.bound is None:
            return [*lines, f"split; [exact O'|]. intros c' B'. exact (decay T {e} {rate} c' O' B')."]
        lines += [f"split; [exact O'|]. apply (decay T {e} {rate} _ O'). intros t K'. unfold {rate}."]
        if (parts := self.parts(self.bound)) is None:
            return [*lines, f"{facts(claim, self.whole)}lra."]
        a, b = parts
        lines += [f"apply (quotient_below _ ({text(a, claim.names)}) ({text(b, claim.names)}))."]
        return [*lines, f"+ {facts(claim, b)}lra.", "+ algebra K'.", f"+ {facts(claim, a, b)}lra."]


@dataclass(frozen=True)
class Falling:
    """That errors which act on each other fall, in Coq."""

    claim: Identities
    fall: Fall

    @property
    def own(self) -> list[str]:
        """Names of the errors in Coq."""
        return [self.claim.names[law.error] for law in self.fall.laws]

    def size(self, time: str) -> str:
        """Sum of their squares."""
        return " + ".join(f"{e} {time} ^ 2" for e in self.own)

    @property
    def numbers(self) -> tuple[str, str]:
        """The rate and the constant."""
        return literal(self.fall.r).within(ATOM), literal(self.fall.most).within(ATOM)

    @property
    def statement(self) -> str:
        """What is stated."""
        r, most = self.numbers
        said = f"{TIME} {self.size('t')} <= {most} * exp (- (2 * {r} * t)) * ({self.size('0')})"
        return f"({Stated(self.claim, self.fall.laws[0]).premise}{said})"

    def proof(self) -> list[str]:
        """Tactics that show it: the derivative of V, and squares whose sum is what each inequality leaves."""
        names, fall, (r, most) = self.claim.names, self.fall, self.numbers
        stated = [Stated(self.claim, law) for law in fall.laws]
        lines = [stated[0].given]
        for i, one in enumerate(stated):
            *first, last = one.derived()
            lines.append(f"assert (D{i}' : {TIME} is_derive {self.own[i]} t {operand(one.moving, names)}).")
            lines += ["{ intros t K'.", *first, f"{last} }}"]
        e = [Expression.variable(law.error) for law in fall.laws]
        V, slope = quadratic(fall.P, e, e), quadratic(2 * fall.P, e, [one.moving for one in stated])
        functions = (text(V, names), text(slope, names), self.size("t"))
        eye = identity(len(e), fall.P)
        gaps = [fall.dissipation, fall.P - eye, fall.most * eye - fall.P]
        known = [squares(gap, self.own) for gap in gaps]
        return [
            *lines,
            f"apply (falling T {r} {most} {' '.join(f'(fun t => {f})' for f in functions)}); intros t K'.",
            "+ moves K'. algebra K'.",
            f"+ {known[0]}lra.",
            f"+ split. {{ {known[1]}lra. }} {known[2]}lra.",
        ]


def quadratic(P: Array, a: Sequence[Expression], b: Sequence[Expression]) -> Expression:
    """Form a' P b."""
    terms = [Expression.number(P[i, j]) * x * y for i, x in enumerate(a) for j, y in enumerate(b) if P[i, j] != 0]
    return reduce(Expression.__add__, terms)


def squares(S: Array, names: Sequence[str]) -> str:
    """Tactics that put squares at the time t into the context, a sum of multiples of which x' S x is."""
    found = ""
    for i, row in enumerate(factors(S), start=1):
        inner = " + ".join(f"{literal(c).within(ATOM)} * {e} t" for c, e in zip(row, names, strict=True) if c != 0)
        found += f"assert (Q{i}' := pow2_ge_0 ({inner})). "
    return found


def unfolded(claim: Identities, kept: frozenset[str] = frozenset()) -> str:
    """Names of what is defined, the last first, for a tactic."""
    return ", ".join(claim.names[name] for name in reversed([*claim.defined]) if name not in kept)


@dataclass(frozen=True)
class Back:
    """That the left inverse gives the states, in Coq."""

    claim: Identities
    inverse: Inverse

    def __post_init__(self) -> None:
        """Hold it against what `field` proves; raises `UnexportedError`."""
        claim = self.claim
        for name, side in self.inverse.states.items():
            residual = claim.whole(side, self.kept) - Expression.variable(name)
            for one in self.solved:
                residual = residual.substituted({one.signal: claim.whole(one.value)})
            if not vanishes(claim.whole(residual)):
                said = f"the left inverse of {name} is no identity that ring and field of Coq prove"
                raise UnexportedError(said)

    @property
    def solved(self) -> list[Resolved]:
        """What follows where the errors are zero."""
        return [self.claim.known[name] for name in self.inverse.right]

    @property
    def kept(self) -> frozenset[str]:
        """Signals that are given then."""
        return frozenset(one.signal for one in self.solved)

    @property
    def statement(self) -> str:
        """What is stated."""
        names, states = self.claim.names, self.inverse.states
        told = " /\\ ".join(f"{names[name]} t = {text(side, names)}" for name, side in states.items())
        premises = "".join(f"{names[name]} t = 0 -> " for name in self.inverse.right)
        return f"({TIME} {premises}{told})"

    def proof(self) -> list[str]:
        """Tactics that show it."""
        claim, names, other = self.claim, self.claim.names, unfolded(self.claim, self.kept)
        zeros = "".join(f" Z{i}'" for i in range(len(self.solved)))
        lines = [f"intros t K'{zeros}."]
        for i, one in enumerate(self.solved):
            value = text(claim.whole(one.value, self.kept), names)
            lines.append(f"assert (V{i}' : {names[one.signal]} t = {value}) by (unfold {other} in Z{i}'; lra).")
        rewrites = "".join(f"rewrite ?V{i}'; " for i in range(len(self.solved)))
        return [*lines, f"repeat split; unfold {other}; {rewrites}algebra K'."]
