"""Functions of one variable whose difference quotients are known on an interval: by their derivative, for Coq.

The derivative of a rational function is a quotient of polynomials, and bounds on it are inequalities p(s) >= 0 on the
interval. In pieces of it the coefficients of p in (s - l)^k (h - s)^(n-k), those of Bernstein, are not negative.
"""

from collections.abc import Sequence
from math import comb, isqrt

import numpy as np
from flint import fmpq, fmpq_poly

from obsdesign.coq.decimals import number
from obsdesign.coq.functions import Function, Limits, real
from obsdesign.expressions.expression import Expression
from obsdesign.expressions.tree import Call, Node, Number, fold
from obsdesign.records import dataclass, replace

MAX_DEGREE = 12
MAX_PIECES = 32
PLACES = 10**12  # of a number that is rounded
Fraction = tuple[fmpq_poly, fmpq_poly]  # numerator and denominator


class UnprovedError(Exception):
    """Why no bound was found, in words."""


@dataclass(frozen=True)
class Piece:
    """An interval, and the coefficients of a polynomial in (s - l)^k (h - s)^(n-k) there."""

    low: fmpq
    high: fmpq
    coefficients: tuple[fmpq, ...]

    @classmethod
    def of(cls, p: fmpq_poly, low: fmpq, high: fmpq) -> "Piece":
        """Polynomial on an interval."""
        n, width = max(p.degree(), 0), high - low
        powers = p(fmpq_poly([low, width])).coeffs()  # of (s - l) / (h - l)
        powers += [fmpq(0)] * (n + 1 - len(powers))
        control = [sum((comb(k, i) * powers[i] / comb(n, i) for i in range(k + 1)), fmpq(0)) for k in range(n + 1)]
        return cls(low, high, tuple(comb(n, k) * b / width**n for k, b in enumerate(control)))

    def tactic(self) -> str:
        """Proof that the polynomial is not negative for s in the interval."""
        n, terms = len(self.coefficients) - 1, []
        for k, b in enumerate(self.coefficients):
            from_low, to_high = f"(s - {signed(self.low)})^{k}", f"({signed(self.high)} - s)^{n - k}"
            factors = [real(b), *([from_low] if k else []), *([to_high] if n > k else [])]
            terms += [" * ".join(factors)] * (b != 0)
        return f"by_bernstein ({' + '.join(terms) or '0'})"


def signed(x: fmpq) -> str:
    """Literal of a real number, in parentheses where it has a sign."""
    return f"(- {real(-x)})" if x < 0 else real(x)


def root(limits: Limits) -> Function | None:
    """The square root on an interval of positive numbers; its slopes are rounded outward if they are no rationals."""
    low, high = limits
    if low <= 0:
        return None
    least, most = rounded_root(1 / (4 * high), up=False), rounded_root(1 / (4 * low), up=True)
    lemma = f"(sqrt_secants {number(low)} {number(high)} {number(least)} {number(most)} eq_refl)"
    return Function("sqrt {}", lemma, least, most, limits)


def rounded_root(x: fmpq, *, up: bool) -> fmpq:
    """Square root of a positive rational, rounded where it is none."""
    p, q = isqrt(int(x.p)), isqrt(int(x.q))
    if (p * p, q * q) == (int(x.p), int(x.q)):
        return fmpq(p, q)
    return fmpq(isqrt(int(x.p) * PLACES**2 // int(x.q)) + up, PLACES)


def rational_function(name: str, f: Expression, limits: Limits, slopes: tuple[fmpq, fmpq | None]) -> Function:
    """F on an interval as a function of its own, whose quotients are between two numbers; None is infinite.

    Raises `UnprovedError`: f is no quotient of polynomials and magnitudes there, or its slope was not shown to be
    between the numbers.
    """
    low, high = slopes
    top, bottom = slope(f, limits)
    proofs = [cases(pieces(top - low * bottom, limits)), "exact I"]
    if high is not None:
        proofs[1] = cases(pieces(high * bottom - top, limits))
    least = abs(bottom(limits[0])) / 10**6
    proved = Function(f"{name} {{}}", f"{name}_secants", low, high, limits)
    lines = (
        f"Definition {name} (s : R) : R := {text(f, None)}.",
        f"Lemma {name}_secants : secants_on {' '.join(map(number, limits))} {proved.bounds} {name}.",
        f"Proof. apply (secants_on_equal _ _ _ _ _ (fun s => {text(f, limits)})).",
        f" {{ intros s K. between K. unfold {name}. by_signs. }}",
        f" apply (secants_on_derivative _ _ _ _ _ (fun s => ({polynomial(top)}) / ({polynomial(bottom)})));",
        "  intros s K; between K;",
        f"  assert (D : 0 < {polynomial(bottom)}) by ({cases(pieces(bottom - least, limits))}).",
        " - derived.",
        " - apply quotient_of; [exact D| |].",
        *(f"   + {proof}." for proof in proofs),
        "Qed.",
    )
    return replace(proved, lines=lines)


def slope(f: Expression, limits: Limits) -> Fraction:
    """Derivative of a quotient of polynomials, with a denominator that is positive at the lower end."""
    numerator, denominator = fraction(f, limits)
    top = numerator.derivative() * denominator - numerator * denominator.derivative()
    bottom = denominator * denominator
    common = top.gcd(bottom)
    top, bottom = divmod(top, common)[0], divmod(bottom, common)[0]
    if max(top.degree(), bottom.degree()) > MAX_DEGREE:
        raise UnprovedError(f"its slope has a degree above {MAX_DEGREE}")
    if bottom(limits[0]) == 0:
        raise UnprovedError("it has no value at an end of its region")
    return (top, bottom) if bottom(limits[0]) > 0 else (-top, -bottom)


def fraction(f: Expression, limits: Limits) -> Fraction:
    """Quotient of polynomials that f is on an interval."""
    one = fmpq_poly([1])

    def call(node: Call, values: list[Fraction]) -> Fraction:
        (a, b), *others = values
        match node.operation, node.arguments:
            case "+", _:
                for c, d in others:
                    a, b = a * d + c * b, b * d
            case "*", _:
                for c, d in others:
                    a, b = a * c, b * d
            case "/", _:
                ((c, d),) = others
                a, b = a * d, b * c
            case "**", (_, Number(e)) if e.q == 1 and abs(e) <= MAX_DEGREE:
                a, b = (a ** int(e), b ** int(e)) if e > 0 else (b ** int(-e), a ** int(-e))
            case "abs", (x,):
                a *= sign(x, (a, b), limits)
            case _:
                raise UnprovedError(f"it is no quotient of polynomials: {Expression(node)}")
        if not b:
            raise UnprovedError("it divides by zero")
        if max(a.degree(), b.degree()) > 4 * MAX_DEGREE:
            raise UnprovedError(f"it has a degree above {4 * MAX_DEGREE}")
        return a, b

    return fold(f.order, lambda c: (fmpq_poly([c]), one), lambda _: (fmpq_poly([0, 1]), one), call)


def sign(node: Node, value: Fraction, limits: Limits) -> int:
    """Sign of an affine function on an interval; raises `UnprovedError` if it has none."""
    a, b = value
    ends = [a(x) / b(x) for x in limits] if b.degree() == 0 and a.degree() <= 1 else []
    if not ends or min(ends) < 0 < max(ends):
        raise UnprovedError(f"the sign of {Expression(node)} is not known")
    return 1 if min(ends) >= 0 else -1


def text(f: Expression, limits: Limits | None) -> str:
    """F of s in Coq; on an interval, with the signs that magnitudes have there in their place."""

    def call(node: Call, values: list[Term]) -> Term:
        match node.operation, node.arguments:
            case "abs", (x,):
                known = limits and sign(x, fraction(Expression(x), limits), limits)
                return values[0].with_sign(known) if known else Term(f"Rabs {values[0].within(ATOM)}", POWER)
            case "**", (_, Number(e)):
                power = Term(f"{values[0].within(ATOM)} ^ {abs(int(e.p))}", POWER)
                return power if e > 0 else Term(f"/ {power.within(ATOM)}", PRODUCT)
        return combined(node.operation, values)

    def literal(c: fmpq) -> Term:
        return Term(real(c), ATOM) if c >= 0 else literal(-c).with_sign(-1)

    return fold(f.order, literal, lambda _: Term("s", ATOM), call).text


SUM, SIGNED, PRODUCT, POWER, ATOM = range(5)


@dataclass(frozen=True)
class Term:
    """Text in Coq, and how tightly its outermost operation binds."""

    text: str
    level: int

    def within(self, level: int) -> str:
        """The text as an operand of an operation that binds as tightly."""
        return self.text if self.level >= level else f"({self.text})"

    def with_sign(self, sign: int) -> "Term":
        """The term itself, or its negative."""
        return self if sign > 0 else Term(f"- {self.within(PRODUCT)}", SIGNED)


def combined(operation: str, terms: Sequence[Term]) -> Term:
    """Sum, product or quotient of terms."""
    first, *others = terms
    if operation == "+":
        signs = [f" - {x.text[2:]}" if x.level == SIGNED else f" + {x.text}" for x in others]
        return Term(first.text + "".join(signs), SUM)
    if operation == "*" and first.text == "- 1":
        return (others[0] if len(others) == 1 else combined("*", others)).with_sign(-1)
    right = f" {operation} ".join(["", *(x.within(POWER) for x in others)])
    if first.level == SIGNED:
        return Term(f"{first.text}{right}", SIGNED)
    return Term(f"{first.within(PRODUCT)}{right}", PRODUCT)


def polynomial(p: fmpq_poly) -> str:
    """Polynomial of s in Coq."""
    terms = [f"{signed(c)} * s ^ {k}" if k else signed(c) for k, c in enumerate(p.coeffs()) if c != 0]
    return " + ".join(terms) or "0"


def pieces(p: fmpq_poly, limits: Limits) -> list[Piece]:
    """Pieces of an interval in which the coefficients of a polynomial are not negative; raises `UnprovedError`."""
    waiting, found = [limits], list[Piece]()
    while waiting:
        low, high = waiting.pop()
        piece = Piece.of(p, low, high)
        if min(piece.coefficients) >= 0:
            found.append(piece)
            continue
        if p(low) < 0 or p(high) < 0 or len(waiting) + len(found) >= MAX_PIECES:
            raise UnprovedError("its slope was not shown to be within its bounds")
        middle = lowest(p, low, high)
        waiting += [(middle, high), (low, middle)]
    return found


def lowest(p: fmpq_poly, low: fmpq, high: fmpq) -> fmpq:
    """Near the point within an interval where a polynomial is stationary and lowest; the middle if there is none."""
    rates = [float(c.p) / float(c.q) for c in p.derivative().coeffs()]
    roots = [x.real for x in np.roots(rates[::-1]) if abs(x.imag) <= 1e-6 * abs(x)]
    stationary = [fmpq(round(x * PLACES), PLACES) for x in roots]
    inner = [x for x in stationary if low < x < high]
    return min(inner, key=p) if inner else (low + high) / 2


def cases(found: Sequence[Piece]) -> str:
    """Tactic for s in one of several intervals in a row."""
    if len(found) == 1:
        return found[0].tactic()
    half = len(found) // 2
    return f"destruct (Rle_or_lt s {signed(found[half].low)}); [{cases(found[:half])}|{cases(found[half:])}]"
