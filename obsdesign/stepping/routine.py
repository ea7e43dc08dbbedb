"""Equations in an order in which they can be computed; what depends on itself is solved by Newton's method."""

from collections.abc import Iterator, Mapping, Sequence
from graphlib import TopologicalSorter

from obsdesign.expressions import Expression
from obsdesign.model.equations import Named
from obsdesign.records import dataclass

Edges = Mapping[str, Sequence[str]]  # names that a name needs


@dataclass(frozen=True)
class Let:
    """A signal, computed from what is known: name = value."""

    name: str
    value: Expression


@dataclass(frozen=True)
class Solve:
    """Signals a of an algebraic loop, from r(a) = 0 by Newton's method from a = 0."""

    unknowns: tuple[str, ...]
    residuals: tuple[Expression, ...]
    slopes: tuple[tuple[Expression, ...], ...]  # dr_i / da_j


Statement = Let | Solve


@dataclass(frozen=True)
class Routine:
    """Straight lines that compute results from given signals."""

    given: tuple[str, ...]  # as many of the given signals as are needed
    statements: tuple[Statement, ...]
    results: Named

    def expressions(self) -> Iterator[Expression]:
        """Every expression that is computed."""
        for one in self.statements:
            if isinstance(one, Let):
                yield one.value
            else:
                yield from one.residuals
                for row in one.slopes:
                    yield from row
        yield from self.results.values()


def routine(given: Sequence[str], definitions: Named, results: Named) -> Routine:
    """Routine of results, from definitions that may stand in any order and depend on themselves.

    Of each loop as few signals as one finds are solved for, the others follow from them.
    """
    needed = reached((name for side in results.values() for name in side.names), definitions)
    edges = {name: [other for other in definitions[name].names if other in needed] for name in needed}
    statements = [one for names in components(edges) for one in solved(names, definitions, edges)]
    used = {name for side in (*(definitions[n] for n in needed), *results.values()) for name in side.names}
    return Routine(tuple(name for name in given if name in used), tuple(statements), results)


def reached(names: Iterator[str], definitions: Named) -> list[str]:
    """Names that are defined and needed, in the order of the definitions."""
    found, waiting = set[str](), list(names)
    while waiting:
        if (name := waiting.pop()) in definitions and name not in found:
            found.add(name)
            waiting += definitions[name].names
    return [name for name in definitions if name in found]


def components(edges: Edges) -> Iterator[list[str]]:
    """Sets of names that need each other, each after those that it needs."""
    reach = {name: closure(name, edges) for name in edges}
    home = {name: next(o for o in edges if o == name or (o in reach[name] and name in reach[o])) for name in edges}
    members = {first: [name for name in edges if home[name] == first] for first in dict.fromkeys(home.values())}
    needs = {first: {home[o] for name in names for o in edges[name]} - {first} for first, names in members.items()}
    for first in TopologicalSorter(needs).static_order():
        yield members[first]


def closure(name: str, edges: Edges) -> set[str]:
    """Names that are needed, directly or not."""
    found, waiting = set[str](), list(edges[name])
    while waiting:
        if (other := waiting.pop()) not in found:
            found.add(other)
            waiting += edges[other]
    return found


def solved(names: Sequence[str], definitions: Named, edges: Edges) -> list[Statement]:
    """Statements of names that need each other, and nothing else that is not known."""
    inner = {name: [other for other in edges[name] if other in names] for name in names}
    if not any(inner.values()):
        return [Let(name, definitions[name]) for name in names]
    unknowns = torn(inner)
    rest = {n: [o for o in needs if o not in unknowns] for n, needs in inner.items() if n not in unknowns}
    order = [name for group in components(rest) for name in group]
    known: dict[str, Expression] = {}
    for name in order:
        known[name] = definitions[name].substituted(known)
    residuals = [Expression.variable(name) - definitions[name].substituted(known) for name in unknowns]
    slopes = tuple(tuple(residual.derivative(name) for name in unknowns) for residual in residuals)
    return [Solve(tuple(unknowns), tuple(residuals), slopes), *(Let(name, definitions[name]) for name in order)]


def torn(edges: Edges) -> list[str]:
    """Few names without which no other needs itself."""
    found: list[str] = []
    while cyclic := [name for name in edges if name not in found and name in closure(name, without(edges, found))]:
        cut = [name for name in cyclic if not loops(without(edges, [*found, name]))]
        found.append(cut[0] if cut else max(cyclic, key=lambda name: sum(name in needs for needs in edges.values())))
    return found


def without(edges: Edges, names: Sequence[str]) -> Edges:
    """The same with some names taken out."""
    return {name: [o for o in needs if o not in names] for name, needs in edges.items() if name not in names}


def loops(edges: Edges) -> bool:
    """Whether a name needs itself."""
    return any(name in closure(name, edges) for name in edges)
