"""States from coordinates and outputs, by linear equations solved one after another."""

from collections.abc import Sequence

from obsdesign.expressions import Expression, Interval
from obsdesign.expressions.algebra import identical
from obsdesign.expressions.tree import Number, quotient
from obsdesign.families.algebraic.ansatz import Measured, simplified
from obsdesign.families.algebraic.forms import Coordinate
from obsdesign.families.algebraic.region import Domain
from obsdesign.families.algebraic.scheme import ZERO, less
from obsdesign.model.equations import Equations, Named
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, SINCE_ZERO, outward
from obsdesign.records import dataclass, replace


def enclosure(value: Expression, equations: Equations, domain: Domain) -> Interval:
    """Values that a function of outputs, states, inputs and t takes on the domain, enclosed."""
    inside = value.substituted(equations.outputs)
    given = {"t": SINCE_ZERO, **domain}
    ranges = {name: outward(given.get(name, EVERYWHERE)) for name in inside.names}
    return inside.enclose({name: Interval(*ends) for name, ends in ranges.items()})  # type: ignore[arg-type]


@dataclass(frozen=True)
class Inverse:
    """Which of some coordinates give states, and how."""

    chosen: tuple[Coordinate, ...]
    states: Named  # left inverse: each state, in outputs, inputs, t and coordinates
    missing: tuple[str, ...]  # states that they do not give


def inverted(found: Sequence[Coordinate], equations: Equations, measured: Measured, domain: Domain) -> Inverse:
    """Left inverse of outputs and the first of these coordinates that give something new."""
    solved: dict[str, Expression] = {}
    chosen: list[Coordinate] = []
    curved = [Coordinate(name, equations.outputs[name], ZERO, ZERO) for name in measured.unused]
    waiting = [*curved, *found]
    phi = {each.name: each.phi for each in waiting}
    seen = replace(equations, outputs={**equations.outputs, **phi})
    while waiting and len(solved) < len(measured.left):
        step = next(filter(None, (pivot(each, solved, seen, measured, domain) for each in waiting)), None)
        if step is None:
            break
        coordinate, state, value = step
        solved = {name: simplified(side.substituted({state: value})) for name, side in solved.items()}
        solved[state] = value
        chosen.append(coordinate)
        waiting.remove(coordinate)
    return proved(chosen, solved, equations, measured)


def pivot(
    coordinate: Coordinate, solved: Named, equations: Equations, measured: Measured, domain: Domain
) -> tuple[Coordinate, str, Expression] | None:
    """A state that a coordinate gives in terms of the others, with a coefficient that is nowhere 0; None of none."""
    value = simplified(coordinate.phi.substituted(measured.states).substituted(solved))
    open_states = [name for name in measured.left if name in value.names and name not in solved]
    for name in open_states:
        slope = simplified(value.derivative(name))
        if slope.names.isdisjoint(measured.left) and nowhere_zero(slope, equations, domain):
            rest = value.substituted({name: ZERO})
            gap = less(Expression.variable(coordinate.name), rest)
            return coordinate, name, simplified(Expression(quotient(gap.root, slope.root)))
    return None


def nowhere_zero(value: Expression, equations: Equations, domain: Domain) -> bool:
    """Whether a function has one sign on the domain, by interval arithmetic."""
    if isinstance(value.root, Number):
        return bool(value.root.value != 0)
    inside = enclosure(value, equations, domain)
    return bool(inside.low.min() > 0 or inside.high.max() < 0)


def proved(chosen: Sequence[Coordinate], solved: Named, equations: Equations, measured: Measured) -> Inverse:
    """The inverse, of those states for which it is proved to be one."""
    sides = {name: simplified(side.substituted(solved)) for name, side in measured.states.items()} | dict(solved)
    back = {each.name: each.phi for each in chosen} | dict(equations.outputs)
    states = {}
    for name in equations.states:
        known = name in sides and sides[name].names.isdisjoint(equations.states)
        if known and identical(sides[name].substituted(back), Expression.variable(name)):
            states[name] = sides[name]
    used = {name for side in states.values() for name in side.names}
    missing = tuple(name for name in equations.states if name not in states)
    needed = tuple(each for each in chosen if each.name in used and each.name not in equations.outputs)
    return Inverse(needed, states, missing)
