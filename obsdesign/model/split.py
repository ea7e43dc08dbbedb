"""A plant as equations split into matrices and nonlinear terms, exactly.

x' = A x + sum_i Bf_i f_i(t, y, u, q_i) + gx(t, y, u) + B w
y  = C x + sum_i Df_i f_i(t, y, u, q_i) + gy(t, u) + D w,        q_i = Cq_i x + Dq_i w

Every right side is a sum of products. What is linear in x and w, with numbers as coefficients, goes into A, B, C, D;
what is known goes into gx, gy; every other product is a nonlinear term. Its arguments q are the linear combinations of
x and w that it is a function of. Terms with the same arguments that enter the equations in the same ratio are one f_i.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
from flint import fmpq, fmpq_mat

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.expressions.algebra import identical
from obsdesign.expressions.functions import operation
from obsdesign.expressions.tree import Call, Node, Number, Variable, number, postorder, product, quotient, total
from obsdesign.lmi.formula import Array
from obsdesign.model.disturbance import empty
from obsdesign.records import dataclass

MAX_TERMS = 2000  # products of a right side, multiplied out
Row = dict[str, fmpq]  # coefficients of a linear combination of signals, by name; no zeros


@dataclass(frozen=True)
class Term:
    """One nonlinearity f_i, and how it is connected."""

    whole: Expression  # in the names of the plant
    f: Expression  # of q (or q1, q2, ..), t, outputs and inputs
    arguments: tuple[Row, ...]  # q over states and disturbances
    enters: Row  # its coefficient in each right side, by the name of the state or output

    @property
    def text(self) -> str:
        """What it is called."""
        return self.whole.text

    @property
    def negated(self) -> "Term":
        """The same with the other sign of f."""
        whole, f = (Expression.combination([fmpq(-1)], [side]) for side in (self.whole, self.f))
        return Term(whole, f, self.arguments, {name: -c for name, c in self.enters.items()})


@dataclass(frozen=True)
class Split:
    """A plant in matrices: every right side is linear + known + nonlinear terms."""

    linear: Mapping[str, Row]  # in states and disturbances, by the name of the right side
    known: Mapping[str, Expression]  # gx and gy
    terms: tuple[Term, ...]

    def matrix(self, rows: Sequence[str], columns: Sequence[str]) -> Array:
        """Coefficients of some signals in some right sides: A, B, C or D."""
        matrix = empty(len(rows), len(columns))
        for i, j in np.ndindex(matrix.shape):
            matrix[i, j] = self.linear[rows[i]].get(columns[j], fmpq(0))
        return matrix

    def restored(self, name: str) -> Expression:
        """Right side put together again: A x + B w + gx + sum_i Bf_i f_i(Cq_i x + Dq_i w)."""
        whole, weights = [combination(self.linear[name]), self.known[name]], [fmpq(1), fmpq(1)]
        for term in self.terms:
            if name in term.enters:
                q = [combination(row) for row in term.arguments]
                whole.append(term.f.substituted({"q": q[0], **{f"q{i + 1}": each for i, each in enumerate(q)}}))
                weights.append(term.enters[name])
        return Expression.combination(weights, whole)

    def proved(self, sides: Mapping[str, Expression], outputs: Mapping[str, Expression]) -> bool:
        """Whether it is proved to be identical to the right sides, with the outputs written out."""
        return all(
            identical(self.restored(name).substituted(outputs), side.substituted(outputs))
            for name, side in sides.items()
        )


def combination(row: Row) -> Expression:
    """Linear combination of signals, by name."""
    return Expression.combination([*row.values()], [Expression.variable(name) for name in row])


@dataclass(frozen=True)
class Splitter:
    """Names of the signals of a plant, and what is measured of it."""

    states: Sequence[str]
    disturbances: Sequence[str]
    measured: Mapping[str, Expression]  # states that an output shows without noise, as functions of it

    @cached_property
    def unknown(self) -> frozenset[str]:
        """Signals that an argument is a combination of."""
        return frozenset((*self.states, *self.disturbances))

    def split(self, dynamics: Mapping[str, Expression], outputs: Mapping[str, Expression]) -> Split:
        """Matrices, known terms and nonlinear terms of right sides by name.

        Raises `UsageError`, with the name of the right side as key: a product cannot be split, or there are too many.
        """
        linear: dict[str, Row] = {}
        known: dict[str, Expression] = {}
        found: list[tuple[str, fmpq, Node]] = []
        for name, side in (*dynamics.items(), *outputs.items()):
            linear[name], rest = {}, []
            for factor, node in self.products(name, side.root):
                term = node if name in outputs else self.with_measured(node)
                if isinstance(node, Variable) and node.name in self.unknown:
                    linear[name][node.name] = linear[name].get(node.name, fmpq(0)) + factor
                elif self.arguments([term]):
                    found.append((name, factor, term))
                else:
                    rest.append(product((number(factor), self.rewritten(term, [], []))))
            known[name] = Expression(total(rest))

        return Split({name: nonzero(row) for name, row in linear.items()}, known, tuple(self.terms(found)))

    def products(self, name: str, node: Node) -> list[tuple[fmpq, Node]]:
        """Products of a sum, each with its number apart; one is multiplied out unless that gives it more arguments.

        So x*(1 - y) becomes x - x*y, and (a - b)*abs(a - b), of one argument, stays.
        """
        done: list[tuple[fmpq, Node]] = []
        waiting = [node]
        while waiting:
            if len(done) + len(waiting) > MAX_TERMS:
                raise UsageError(
                    Problem(f"has more than {MAX_TERMS} products when it is multiplied out", key=name, id="OBS303")
                )
            factor, parts = factors(waiting.pop())
            summands = next(filter(None, (self.distributed(parts, i) for i in range(len(parts)))), None)
            if summands:
                waiting += [product((number(factor), *summand)) for summand in reversed(summands)]
            else:
                done.append((factor, product(collected(parts))))
        return [(factor, node) for factor, node in done if factor != 0]

    def distributed(self, parts: Sequence[Node], i: int) -> list[list[Node]]:
        """Products with each summand in place of a sum; none if factor i is none, or one would have more arguments."""
        part = parts[i]
        if not (isinstance(part, Call) and part.operation == "+"):
            return []
        found = [[*parts[:i], summand, *parts[i + 1 :]] for summand in part.arguments]
        size = len(self.arguments(parts))
        return found if all(len(self.arguments(each)) <= size for each in found) else []

    def with_measured(self, node: Node) -> Node:
        """Same term with outputs in place of measured states, where it is a product with other signals.

        A function of one argument alone stays one; written with the name of the output it is known.
        """
        replaced = Expression(node).substituted(self.measured).root
        alone = len(self.arguments([node])) == 1 and names(node) <= self.unknown
        return node if alone else replaced

    def affine(self, node: Node) -> tuple[Row, Node] | None:
        """Linear combination of states and disturbances, and what is known beside it; None of a nonlinear function."""
        match node:
            case Variable(name) if name in self.unknown:
                return {name: fmpq(1)}, number(0)
            case Call("+", terms):
                parts = [self.affine(term) for term in terms]
                if None in parts:
                    return None
                row: Row = {}
                for part, _ in parts:  # type: ignore[misc]
                    row = {name: row.get(name, fmpq(0)) + part.get(name, fmpq(0)) for name in {**row, **part}}
                return nonzero(row), total([rest for _, rest in parts])  # type: ignore[misc]
            case Call("*", (Number(value), *others)) if (part := self.affine(product(others))) is not None:
                return {name: value * c for name, c in part[0].items()}, product((number(value), part[1]))
            case Call("/", (above, Number(value))) if value != 0 and (part := self.affine(above)) is not None:
                return {name: c / value for name, c in part[0].items()}, quotient(part[1], number(value))
        return None if names(node) & self.unknown else ({}, node)

    def arguments(self, nodes: Sequence[Node]) -> list[Row]:
        """Linear combinations that a product of these is a function of: as few as there can be, in order of appearance.

        Where they are as many as the signals in them, they are these signals.
        """
        rows: list[Row] = []
        for node in nodes:
            for row in self.combinations(node):
                if coordinates(rows, row) is None:
                    rows.append(row)
        used = [name for name in (*self.states, *self.disturbances) if any(name in row for row in rows)]
        return [{name: fmpq(1)} for name in used] if len(used) == len(rows) else rows

    def combinations(self, node: Node) -> Iterator[Row]:
        """Largest parts of a tree that are linear in states and disturbances, with 1 as their first coefficient."""
        part = self.affine(node)
        if part is None:
            assert isinstance(node, Call)
            for argument in node.arguments:
                yield from self.combinations(argument)
        elif part[0]:
            order = [name for name in (*self.states, *self.disturbances) if name in part[0]]
            yield {name: part[0][name] / part[0][order[0]] for name in order}

    def rewritten(self, node: Node, arguments: Sequence[Row], q: Sequence[Node]) -> Node:
        """Same tree as a function of q."""
        part = self.affine(node)
        if part is None:
            assert isinstance(node, Call)
            return operation(node, [self.rewritten(argument, arguments, q) for argument in node.arguments])
        weights = coordinates(arguments, part[0])
        assert weights is not None
        return total([*(product((number(c), each)) for c, each in zip(weights, q, strict=True)), part[1]])

    def terms(self, found: Sequence[tuple[str, fmpq, Node]]) -> Iterator[Term]:
        """Nonlinearities of products, each with the right side in which it stands and its coefficient."""
        groups: dict[tuple[tuple[tuple[str, fmpq], ...], ...], dict[str, tuple[Node, Node, Row]]] = {}
        for name, factor, node in found:
            arguments = self.arguments([node])
            if all(row.keys() <= set(self.disturbances) for row in arguments):
                self.refuse(name, node)
            key = tuple(tuple(row.items()) for row in arguments)
            q = [Variable("q")] if len(arguments) == 1 else [Variable(f"q{i + 1}") for i in range(len(arguments))]
            f = self.rewritten(node, arguments, q)
            _, _, enters = groups.setdefault(key, {}).setdefault(Expression(f).text, (f, node, {}))
            enters[name] = enters.get(name, fmpq(0)) + factor
        for key, members in groups.items():
            for same in in_ratio([(f, node, nonzero(enters)) for f, node, enters in members.values()]):
                (_, _, enters), weights = same[0], [ratio(each[2], same[0][2]) for each in same]
                f = total([product((number(c), each[0])) for c, each in zip(weights, same, strict=True)])
                whole = total([product((number(c), each[1])) for c, each in zip(weights, same, strict=True)])
                yield Term(Expression(whole), Expression(f), tuple(dict(row) for row in key), enters)

    def refuse(self, name: str, node: Node) -> None:
        """Refuse a term of disturbances alone, which no guarantee covers."""
        said = f"{Expression(node).text} is not linear in the disturbance; write it as a disturbance of its own"
        raise UsageError(Problem(said, key=name, id="OBS306"))


def names(node: Node) -> frozenset[str]:
    """Variables that occur."""
    return frozenset(each.name for each in postorder(node) if isinstance(each, Variable))


def factors(node: Node) -> tuple[fmpq, list[Node]]:
    """Factors of a product or a quotient, with its number apart; a divisor is 1/divisor."""
    match node:
        case Number(value):
            return value, []
        case Call("*", parts):
            found: list[Node] = []
            value = fmpq(1)
            for part in parts:
                c, others = factors(part)
                value, found = value * c, [*found, *others]
            return value, found
        case Call("/", (above, below)) if not (isinstance(below, Number) and below.value == 0):
            value, found = factors(above)
            c, others = factors(below)
            inverse = [quotient(number(1), other) for other in others]
            return value / c, [*found, *inverse]
    return fmpq(1), [node]


def collected(parts: Sequence[Node]) -> list[Node]:
    """Factors in which equal ones are a power."""
    count: dict[str, int] = {}
    by_text: dict[str, Node] = {}
    for part in parts:
        text = Expression(part).text
        by_text[text] = part
        count[text] = count.get(text, 0) + 1
    return [by_text[text] ** number(k) for text, k in count.items()]


def nonzero(row: Row) -> Row:
    """Row without zeros."""
    return {name: c for name, c in row.items() if c != 0}


def coordinates(rows: Sequence[Row], row: Row) -> list[fmpq] | None:
    """Coefficients of a row in others; None if it is none of their combinations."""
    columns = sorted(set().union(*rows, row))
    if not rows or not columns:
        return None if row else [fmpq(0)] * len(rows)
    table = [[each.get(name, fmpq(0)) for each in (*rows, row)] for name in columns]
    reduced, rank = fmpq_mat(table).rref()
    if any(reduced[i, len(rows)] != 0 and all(reduced[i, j] == 0 for j in range(len(rows))) for i in range(rank)):
        return None
    return [reduced[j, len(rows)] for j in range(len(rows))]


def ratio(row: Row, other: Row) -> fmpq:
    """C with row = c other."""
    name = next(iter(other))
    return row[name] / other[name]


def in_ratio(members: Sequence[tuple[Node, Node, Row]]) -> list[list[tuple[Node, Node, Row]]]:
    """Members that enter the equations in the same ratio, together; what cancels is left out."""
    groups: dict[tuple[tuple[str, fmpq], ...], list[tuple[Node, Node, Row]]] = {}
    for member in members:
        if row := member[2]:
            first = row[min(row)]
            key = tuple(sorted((name, c / first) for name, c in row.items()))
            groups.setdefault(key, []).append(member)
    return list(groups.values())
