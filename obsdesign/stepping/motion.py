"""How outputs go on while they are not known, where the estimates hold the measured value at once."""

from collections.abc import Callable, Sequence

from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.families.observer import Observer
from obsdesign.model.equations import Equations, Named
from obsdesign.records import dataclass

ZERO = Expression.number(0)


@dataclass(frozen=True)
class Motion:
    """How an output y = g(t, u) + m goes on: by the plant at the estimates, without w.

    m' = dm/dt + dm/dx f(t, xhat, u, 0), or in discrete time m+ = m(f(t, xhat, u, 0)). In a plant with an algebraic loop
    m stays.
    """

    g: Expression
    side: Expression | None  # m' or m+, in signals of the observer; None where it stays


def motions(
    observer: Observer, equations: Callable[[], Equations], expected: Named, *, sampled: bool
) -> dict[str, Motion]:
    """Motions of the outputs that the estimates hold at once, by name; none of what the observer foretells itself."""
    held = [name for name in observer.outputs if knows(observer, expected[name])]
    if observer.jump or observer.following or not held:
        return {}
    plant = equations()
    if not any(knows(observer, observer.estimates[x]) for x in plant.states if x in observer.estimates):
        return {}
    known = {**dict.fromkeys(plant.exogenous, ZERO), **observer.estimates}
    inner = dict(plant.algebraic)
    for _ in inner:
        inner = {name: side.substituted({k: e for k, e in inner.items() if k != name}) for name, side in inner.items()}
    loop = any(not side.names.isdisjoint(inner) for side in inner.values())
    f = {name: side.substituted(inner) for name, side in plant.dynamics.items()}
    found = {}
    for name in held:
        parts = plant.outputs[name].substituted(inner).summands()
        g, m = (combined([p for p in parts if p[1].names.isdisjoint(plant.states) is apart]) for apart in (True, False))
        side = m.substituted(f) if sampled else rate(m, f)
        found[name] = Motion(g.substituted(known), None if loop else side.substituted(known))
    return found


def combined(parts: Sequence[tuple[fmpq, Expression]]) -> Expression:
    """Sum of terms with their coefficients."""
    return Expression.combination([c for c, _ in parts], [e for _, e in parts])


def rate(m: Expression, f: Named) -> Expression:
    """Total derivative dm/dt + dm/dx f."""
    return sum((m.derivative(name) * f[name] for name in f if name in m.names), m.derivative("t"))


def knows(observer: Observer, side: Expression) -> bool:
    """Whether an expression depends on a measured output."""
    found, waiting = set[str](), list(side.names)
    while waiting:
        if (name := waiting.pop()) not in found:
            found.add(name)
            waiting += observer.algebraic[name].names if name in observer.algebraic else ()
    return not found.isdisjoint(observer.outputs)
