"""High-gain observers: a copy of the plant, or of it in other coordinates, with large injections of y - yhat.

The error e obeys e' = M(x, u) e where it is linear in e. M is proved to be Hurwitz, frozen at every point of the
domain. Of errors that act on each other this proves that they decay where M is constant, or while the inputs are if M
depends on nothing else; of a single one, e' = m(x, u) e, that it decays as exp(integral of m).
"""

import operator
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mpoly

from obsdesign.dissipation.decimals import round_down
from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression, ExpressionError
from obsdesign.expressions.algebra import Fraction, Symbols, simplified
from obsdesign.families.algebraic.forms import HighGain
from obsdesign.families.algebraic.identity import Answer, Identity, Negative, Undecided, short
from obsdesign.families.algebraic.region import Point, Region
from obsdesign.families.algebraic.scheme import (
    DECAYS,
    INVERTED,
    UNBOUNDED,
    ZERO,
    Plant,
    Scheme,
    Statement,
    added,
    decay,
    inverses,
    less,
    multiplied,
    scaled,
    smooth,
    unbounded,
    values,
)
from obsdesign.families.algebraic.seen import Seen
from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import printed
from obsdesign.model.equations import Named
from obsdesign.records import dataclass, field

Matrix = list[list[Expression]]
MOST = 6  # errors that act on each other
MOST_PRODUCTS = 50_000  # of terms, in a product of two polynomials
MOST_OPERATIONS = 1500  # of functions whose sign is looked for, those of a block together
SHARE = 0.99  # of the rate of the slowest pole, which is proved
DIGITS = 3  # of a rate


def scheme(plant: Plant, form: HighGain) -> Scheme:
    """What such an observer rests on, and its equations."""
    own = {name: Expression.variable(f"hat_{name}") for name in plant.dynamics}
    if form.states is None:
        seen = {**own, **plant.measured()} if form.measured else own
        rates = {name: side.substituted(seen) for name, side in plant.dynamics.items()}
        shown = {y: h.substituted(own) for y, h in plant.outputs.items()}
        meaning: Named = {name: Expression.variable(name) for name in plant.dynamics}
        estimates: Named = own
        statements: list[Statement] = []
    else:
        assert form.dynamics is not None
        assert form.left_inverse is not None
        own = {name: Expression.variable(name) for name in form.states}
        rates, meaning = dict(form.dynamics), form.states
        shown = {y: own[name] for y, h in plant.outputs.items() for name, side in form.states.items() if side == h}
        estimates = {**plant.measured(), **form.left_inverse}
        estimates = {name: estimates[name] for name in plant.dynamics}
        statements = [*inverses(plant, form.left_inverse, form.states), *transformed(plant, form)]
    sides = {own[name].text: injected(form, name, side, shown) for name, side in rates.items()}
    further = form.states if form.states is not None else None
    for name in rates:
        for gain in form.injection.get(name, {}).values():
            statements += values(f"injection into {name}", gain, further)
    found, M = linear(plant, sides, {own[name].text: side for name, side in meaning.items()})
    held = {name for side in (form.states or {}).values() for name in side.names} & set(plant.inputs)
    E = sensitivity(plant, estimates, {own[name].text: side for name, side in meaning.items()})
    motions = [motion(M, E, found, block, list(sides), plant, held) for block in blocks(M)]
    statements += [*found, *(one for each in motions for one in each.statements)]
    twins = {} if form.states else {side.text: name for name, side in own.items()}
    observer = Observer(sides, estimates, plant.inputs, tuple(plant.outputs), twins=twins)
    says = [f"the error e of the states of the observer obeys e' = M e{constant(held)}, so that e = 0 stays"]
    says += [each.said for each in motions]
    depends = [each.open for each in motions if each.open]
    depends += [one for block in blocks(M) for one in couplings(M, block, list(sides), plant.region)]
    if form.states is not None:
        says.append(f"xhat = x where e = 0, {INVERTED}")
        depends.append(UNBOUNDED)
    falls = {name: statement for each in motions for name, statement in each.rates.items()}
    return Scheme(tuple(statements), observer, numbers(sides), tuple(says), tuple(depends), falls)


def constant(names: Collection[str]) -> str:
    """Clause on inputs that must not vary."""
    return f" for constant {', '.join(sorted(names))}" if names else ""


def numbers(sides: Named) -> dict[str, Any]:
    """Entry of a result file."""
    return {"dynamics": {name: side.text for name, side in sides.items()}}


def injected(form: HighGain, name: str, side: Expression, shown: Named) -> Expression:
    """Right side with its injections of y - yhat."""
    gains = form.injection.get(name, {})
    for y in gains:
        if y not in shown:
            said = f"no state of the observer is {y}, so that there is no {y} - yhat; add a state with this phi"
            raise UsageError(Problem(said, key=f"observer.injection.{name}.{y}", id="OBS504"))
    errors = {y: less(Expression.variable(y), shown[y]) for y in shown}
    return added([side, *(multiplied(gain, errors[y]) for y, gain in gains.items())])


def transformed(plant: Plant, form: HighGain) -> list[Statement]:
    """Derivatives of the other coordinates, with u constant."""
    assert form.states is not None
    assert form.dynamics is not None
    found: list[Statement] = []
    for name, phi in form.states.items():
        side = form.dynamics[name]
        said = f"{name}: d/dt ({phi}) = {side} while u is constant"
        found.append(Identity(said, less(plant.along(phi), plant.on(side, form.states))))
        found += [*smooth(name, phi), *values(name, side, form.states)]
    return found


def linear(plant: Plant, sides: Named, meaning: Named) -> tuple[list[Identity], Matrix]:
    """E' = M e, with M at every point; `meaning`: what each state of the observer estimates."""
    e = {name: Expression.variable(f"ε_{name}") for name in sides}
    near = {name: added([meaning[name], e[name]]) for name in sides}
    still = dict.fromkeys((side.text for side in e.values()), ZERO)
    found: list[Identity] = []
    M: Matrix = []
    for name, side in sides.items():
        moving = less(plant.on(side, near), plant.along(meaning[name]))
        row = [simplified(moving.derivative(f"ε_{other}").substituted(still)) for other in sides]
        products = [multiplied(c, e[other]) for c, other in zip(row, sides, strict=True)]
        shown = " + ".join(f"({c}) {v}" for c, v in zip(row, e.values(), strict=True) if c.text != "0") or "0"
        found.append(Identity(f"error: ε_{name}' = {shown}", less(moving, *products), f"whether {DECAYS}"))
        M.append(row)
    return found, M


@dataclass(frozen=True)
class Motion:
    """How errors that act on each other move: e' = M e with M Hurwitz at every point."""

    statements: tuple[Statement, ...]
    said: str  # what follows if they hold
    open: str = ""  # what is not proved
    rates: Mapping[str, str] = field(default_factory=dict)  # statement that gives the rate of an error, by its state


def motion(
    M: Matrix,
    E: Matrix,
    rows: Sequence[Identity],
    block: list[int],
    states: list[str],
    plant: Plant,
    held: Collection[str],
) -> Motion:
    """Motion of the errors of a block; where others act on it, once these are 0.

    `E`: of xhat - x = E e; `rows`: statements that e' = M e; `held`: inputs that must not vary for it.
    """
    if len(block) > MOST:
        said = f"the errors of {len(block)} states act on each other; at most {MOST} are looked at"
        raise UsageError(Problem(said, key="observer.injection", id="OBS210"))
    part = [[M[i][j] for j in block] for i in block]
    who = f"the error of {', '.join(states[i] for i in block)}"
    acting = [states[j] for j in range(len(M)) if j not in block and any(M[i][j].text != "0" for i in block)]
    alone = f", where that of {', '.join(acting)} is 0 (otherwise it acts as a disturbance)" if acting else ""
    signs = stable(part, f"{who} is stable", tuple(rows), seen(M, E, block, plant.inputs, reached(M)).unknown)
    open_ = f"that {who} falls for varying "
    if len(block) == 1:
        rates = {} if acting or held else {states[block[0]]: signs[0].name}
        said = f"{who} {decay(part[0][0])}{constant(held)}{alone}"
        return Motion(signs, said, open_ + ", ".join(sorted(held)) if held else "", rates)
    varying = {*held, *(name for row in part for entry in row for name in entry.names)}
    if not varying:
        faster, rate = falling(part, f"{who} falls at least as exp")
        return Motion((*signs, *faster), f"{who} falls exponentially, since M is constant{rate}{alone}")
    said = f"M is Hurwitz for {who}, frozen at each point of the domain"
    if varying <= set(plant.inputs):
        said = f"{who} falls exponentially{constant(varying)}, since M is Hurwitz then"
    return Motion(signs, said + alone, open_ + ", ".join(sorted(varying)))


def couplings(M: Matrix, block: Sequence[int], states: Sequence[str], region: Region) -> list[str]:
    """What is not proved of the errors that act on those of a block: that they do so by a bounded factor."""
    ahead = [(i, j) for i in block for j in range(len(M)) if j not in block and not region.bounds(M[i][j])]
    return [unbounded(f"the error of {states[j]}", f"that of {states[i]}", M[i][j]) for i, j in ahead]


def stable(
    M: Matrix,
    what: str,
    given: tuple[Identity, ...] = (),
    unknown: Callable[[Region, Point], str] | None = None,
) -> tuple[Statement, ...]:
    """Statements that a matrix is Hurwitz; `given`, `unknown`: as of a `Negative`."""
    found: list[Statement] = []
    left = MOST_OPERATIONS
    try:
        for v in hurwitz(M):
            if (left := left - len(v.order)) < 0:
                raise ExpressionError(f"has more than {MOST_OPERATIONS} operations", id="OBS303")
            found.append(Negative(f"{what}: {short(v)} > 0", scaled(fmpq(-1), v), given=given, unknown=unknown))
    except ExpressionError:
        found.append(
            Undecided(f"{what}: leading minor {len(found) + 1} of its matrix of Hurwitz > 0, too large to be decided")
        )
    return tuple(found)


def seen(M: Matrix, E: Matrix, block: Sequence[int], inputs: Collection[str], reach: Sequence[Sequence[bool]]) -> Seen:
    """How the errors of a block, and those on which they act, are seen in xhat - x = E e."""
    all_ = [i for i in range(len(M)) if any(reach[i][j] for j in block)]
    part = [[M[i][j] for j in block] for i in block]
    return Seen(part, [[M[i][j] for j in all_] for i in all_], [[row[j] for j in all_] for row in E], inputs)


def sensitivity(plant: Plant, estimates: Named, meaning: Named) -> Matrix:
    """E of xhat - x = E e for small errors e of some signals; `meaning`: those of the plant, in terms of x."""
    return [[plant.on(side.derivative(name), meaning) for name in meaning] for side in estimates.values()]


def falling(M: Matrix, what: str) -> tuple[tuple[Statement, ...], str]:
    """Statements that M + r I is Hurwitz, for a constant M and an r near the rate of its slowest pole, and in words.

    None where they do not hold: M is not Hurwitz itself, or its poles are not known so well.
    """
    r = slowest(M)
    shift = Expression.number(r)
    shifted = [[added([entry, shift]) if i == j else entry for j, entry in enumerate(row)] for i, row in enumerate(M)]
    statements = stable(shifted, f"{what}(-{float(r):g}*t)")
    if r > 0 and all(one.decided(Region()).answer is Answer.PROVED for one in statements):
        return statements, f": |e(t)| <= c exp(-{float(r):g}*t) |e(0)| for some c"
    return (), ""


def slowest(M: Matrix) -> fmpq:
    """Decimal near the rate of the slowest pole of a constant M, as doubles have it; not positive of an unstable M."""
    poles = np.linalg.eigvals([[entry.scalar([])() for entry in row] for row in M])
    rate: fmpq = printed(round_down(-SHARE * float(poles.real.max()), DIGITS))
    return rate


def reached(M: Matrix) -> list[list[bool]]:
    """Whether the error of a column acts on that of a row, by others or not, or is it."""
    n = len(M)
    reach = [[i == j or M[i][j].text != "0" for j in range(n)] for i in range(n)]
    for k in range(n):
        for i in range(n):
            for j in range(n):
                reach[i][j] = reach[i][j] or (reach[i][k] and reach[k][j])
    return reach


def blocks(M: Matrix) -> list[list[int]]:
    """Sets of errors that act on each other: strongly connected parts."""
    n, reach = len(M), reached(M)
    found = {tuple(j for j in range(n) if reach[i][j] and reach[j][i]) for i in range(n)}
    return [list(block) for block in sorted(found)]


def hurwitz(M: Matrix) -> Iterator[Expression]:
    """Functions that are all positive if and only if M is Hurwitz: the leading minors of the matrix of Hurwitz.

    With M = N/d, d a common denominator, minor k of M is that of N over d^(k(k+1)/2). Raises `ExpressionError`: the
    next one is too large.
    """
    symbols = Symbols.of([entry for row in M for entry in row])
    entries = [[symbols.fraction(entry) for entry in row] for row in M]
    one = symbols.constant(1).above
    d = reduce(lcm, (entry.below for row in entries for entry in row), one)
    c = characteristic([[entry.above * (d / entry.below) for entry in row] for row in entries], one)
    n = len(M)
    H = [[c[2 * j - i + 1] if 0 <= 2 * j - i + 1 <= n else 0 * one for j in range(n)] for i in range(n)]
    for k in range(1, n + 1):
        minor = expanded([row[:k] for row in H[:k]], one)
        yield symbols.expression(Fraction(minor, d ** (k * (k + 1) // 2)))


def lcm(p: fmpq_mpoly, q: fmpq_mpoly) -> fmpq_mpoly:
    """Least common multiple."""
    return times(p, q / p.gcd(q))


def characteristic(N: list[list[fmpq_mpoly]], one: fmpq_mpoly) -> list[fmpq_mpoly]:
    """Coefficients of det(s I - N), that of the highest power first, by the recursion of Faddeev and LeVerrier."""
    n, c = len(N), [one]
    B = [[one * (i == j) for j in range(n)] for i in range(n)]
    for k in range(1, n + 1):
        NB = [[reduce(operator.add, (times(N[i][m], B[m][j]) for m in range(n))) for j in range(n)] for i in range(n)]
        c.append(reduce(operator.add, (NB[i][i] for i in range(n))) * fmpq(-1, k))
        B = [[entry + c[k] * (i == j) for j, entry in enumerate(row)] for i, row in enumerate(NB)]
    return c


def expanded(rows: list[list[fmpq_mpoly]], one: fmpq_mpoly) -> fmpq_mpoly:
    """Determinant of a matrix with many zeros, expanded along its first row."""
    if not rows:
        return one
    first, rest = rows[0], rows[1:]
    parts = [
        (j, expanded([row[:j] + row[j + 1 :] for row in rest], one)) for j, entry in enumerate(first) if entry != 0
    ]
    return reduce(operator.add, (times(first[j], minor) * (-1) ** j for j, minor in parts), 0 * one)


def times(p: fmpq_mpoly, q: fmpq_mpoly) -> fmpq_mpoly:
    """Product; raises `ExpressionError` where it may have too many terms."""
    if len(p) * len(q) > MOST_PRODUCTS:
        raise ExpressionError("is too large to be multiplied out", id="OBS303")
    return p * q
