"""High-gain observers: a copy of the plant, or of it in other coordinates, with large injections of y - yhat.

The error e obeys e' = M(x, u) e where it is linear in e. M is proved to be Hurwitz, frozen at every point of the
domain; that does not prove that e decays while x and u vary.
"""

from typing import Any

from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.expressions.algebra import simplified
from obsdesign.families.algebraic.estimator import determinant
from obsdesign.families.algebraic.forms import HighGain
from obsdesign.families.algebraic.identity import Identity, Negative
from obsdesign.families.algebraic.scheme import (
    ZERO,
    Plant,
    Scheme,
    Statement,
    added,
    inverses,
    less,
    multiplied,
    scaled,
    values,
)
from obsdesign.families.observer import Observer
from obsdesign.model.equations import Named

Matrix = list[list[Expression]]
POLE = "σ"  # of the characteristic polynomial; like ε, a name that no spec can give to a signal
MOST = 6  # errors that act on each other


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
            statements += values(plant, f"injection into {name}", gain, further)
    statements += frozen(plant, sides, {own[name].text: side for name, side in meaning.items()})
    twins = {} if form.states else {side.text: name for name, side in own.items()}
    observer = Observer(sides, estimates, plant.inputs, tuple(plant.outputs), twins=twins)
    says = ("e = 0 is invariant", "the matrix of e' = M e is Hurwitz, frozen at each point of the domain")
    depends = ("that the error decays while x and u vary is not proved",)
    return Scheme(tuple(statements), observer, numbers(sides), says, depends)


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
    found: list[Statement] = [
        one
        for name, phi in form.states.items()
        for side in (phi, form.dynamics[name])
        for one in values(plant, name, side, form.states)
    ]
    return found + [
        Identity(
            f"{name}: d/dt ({phi}) = {form.dynamics[name]} while u is constant",
            less(plant.along(phi), plant.on(form.dynamics[name], form.states)),
        )
        for name, phi in form.states.items()
    ]


def frozen(plant: Plant, sides: Named, meaning: Named) -> list[Statement]:
    """E' = M e, with M Hurwitz at every point; `meaning`: what each state of the observer estimates."""
    e = {name: Expression.variable(f"ε_{name}") for name in sides}
    near = {name: added([meaning[name], e[name]]) for name in sides}
    still = dict.fromkeys((side.text for side in e.values()), ZERO)
    found: list[Statement] = []
    M: Matrix = []
    for name, side in sides.items():
        moving = less(plant.on(side, near), plant.along(meaning[name]))
        row = [simplified(moving.derivative(f"ε_{other}").substituted(still)) for other in sides]
        linear = [multiplied(c, e[other]) for c, other in zip(row, sides, strict=True)]
        shown = " + ".join(f"({c}) {v}" for c, v in zip(row, e.values(), strict=True) if c.text != "0") or "0"
        found.append(Identity(f"error: ε_{name}' = {shown}", less(moving, *linear)))
        M.append(row)
    for block in blocks(M):
        if len(block) > MOST:
            said = f"the errors of {len(block)} states act on each other; at most {MOST} are looked at"
            raise UsageError(Problem(said, key="observer.injection", id="OBS210"))
        part = [[M[i][j] for j in block] for i in block]
        names = ", ".join(list(sides)[i] for i in block)
        found += [
            Negative(f"the error of {names} is stable: {condition} > 0", scaled(fmpq(-1), condition))
            for condition in hurwitz(part)
        ]
    return found


def blocks(M: Matrix) -> list[list[int]]:
    """Sets of errors that act on each other: strongly connected parts."""
    n = len(M)
    reach = [[i == j or M[i][j].text != "0" for j in range(n)] for i in range(n)]
    for k in range(n):
        for i in range(n):
            for j in range(n):
                reach[i][j] = reach[i][j] or (reach[i][k] and reach[k][j])
    found = {tuple(j for j in range(n) if reach[i][j] and reach[j][i]) for i in range(n)}
    return [list(block) for block in sorted(found)]


def hurwitz(M: Matrix) -> list[Expression]:
    """Functions that are all positive if and only if M is Hurwitz: the leading minors of the matrix of Hurwitz."""
    n, s = len(M), Expression.variable(POLE)
    pencil = [[less(s if i == j else ZERO, M[i][j]) for j in range(n)] for i in range(n)]
    polynomial = determinant(pencil)
    c: list[Expression] = []
    for k in range(n + 1):
        c.insert(0, scaled(fmpq(1, factorial(k)), polynomial.substituted({POLE: ZERO})))
        polynomial = polynomial.derivative(POLE)
    H = [[c[2 * j - i + 1] if 0 <= 2 * j - i + 1 <= n else ZERO for j in range(n)] for i in range(n)]
    return [simplified(determinant([row[: k + 1] for row in H[: k + 1]])) for k in range(n)]


def factorial(k: int) -> int:
    """Return k!."""
    return k * factorial(k - 1) if k else 1
