"""A plant as equations: its right sides read, split into matrices and nonlinear terms, and the type of each term."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from flint import fmpq

from obsdesign.errors import Problem, UndecidedError, UsageError
from obsdesign.expressions import Expression, ExpressionError, parse
from obsdesign.lmi.formula import Array
from obsdesign.model.disturbance import empty
from obsdesign.model.split import Row, Split, Splitter, Term
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, Ends
from obsdesign.reading import schema
from obsdesign.reading.blocks import Block, read_block, read_nonlinearity, read_range
from obsdesign.reading.plant import Layout, Names, Part, Reading, W, X, Y, read_matrices, read_names, refuse_outputs
from obsdesign.reading.schema import AUTO
from obsdesign.sections.document import Loc, dotted
from obsdesign.sections.forms import unknown
from obsdesign.sections.values import Entries, Reader
from obsdesign.spec import Nonlinearity

UNDECLARED = "declare a disturbance under system.disturbances and a known input under system.inputs"
Domain = Mapping[str, Ends]


@dataclass(frozen=True)
class Typed:
    """A term with what the design may assume of it."""

    term: Term
    block: Block
    found: Nonlinearity

    def part(self, names: Names, width: int) -> Part:
        """How it is connected, in a plant of `width` terms."""
        term = self.term

        def over(order: Sequence[str]) -> Array:
            return table([[row.get(name, fmpq(0)) for name in order] for row in term.arguments], len(order))

        matrices = {
            "Bf": table([[term.enters.get(name, fmpq(0))] for name in names.states], 1),
            "Cq": over(names.states),
            "Dqf": table([[fmpq(0)] * width for _ in term.arguments], width),
            "Dq": over(names.w),
            "Df": table([[term.enters.get(name, fmpq(0))] for name in names.outputs], 1),
        }
        return Part(self.block, {key: Entries(self.block.loc, matrix) for key, matrix in matrices.items()}, None)


def read_sides(reader: Reader, system: schema.Equations, names: Names) -> tuple[dict[str, Expression], ...]:
    """Right sides of the states, and of the outputs in terms of states, inputs, disturbances and t.

    An output that stands in another one is put in; one that depends on itself is refused.
    """
    inner = ("t", *names.states, *names.inputs, *names.w)
    for name in names.states:
        if name not in system.dynamics:
            reader.wrong(("system", "dynamics"), f"{name} has no equation; give {name}: its derivative", at_key=True)
    for name in system.dynamics:
        if name not in names.states:
            said = unknown("state", name, names.states, {})
            reader.wrong(("system", "dynamics", name), said, at_key=True)

    def read(key: str, texts: Mapping[str, str]) -> dict[str, Expression]:
        places = {name: ("system", key, name) for name in texts}
        allowed = (*inner, *names.outputs)
        return {name: reader.expression(text, places[name], allowed, UNDECLARED) for name, text in texts.items()}

    outputs = read("outputs", system.outputs)
    for _ in outputs:
        outputs = {name: side.substituted(without(outputs, name)) for name, side in outputs.items()}
    for name, side in outputs.items():
        if loop := sorted(side.names.intersection(outputs)):
            through = "itself" if loop == [name] else f"{loop[0]}, which depends on it"
            said = f"depends on {through}: an algebraic loop; write it in states, inputs and disturbances"
            reader.wrong(("system", "outputs", name), said)
    dynamics = read("dynamics", system.dynamics)
    return {name: dynamics[name] for name in names.states if name in dynamics}, outputs


def without(sides: Mapping[str, Expression], name: str) -> dict[str, Expression]:
    """Every side but one."""
    return {other: side for other, side in sides.items() if other != name}


def read_domain(reader: Reader, system: schema.Equations, names: Names) -> dict[str, Ends]:
    """Range of each signal that has one."""
    domain: dict[str, Ends] = {}
    allowed = (*names.states, *names.inputs, *names.w, *names.outputs)
    for name, ends in (system.domain or {}).items():
        place: Loc = ("system", "domain", name)
        if name in allowed:
            domain[name] = read_range(reader, ends, place)
        else:
            reader.wrong(place, unknown("signal", name, allowed, {}), at_key=True)
    return domain


def split(
    reader: Reader,
    dynamics: Mapping[str, Expression],
    outputs: Mapping[str, Expression],
    names: Names,
    *,
    sampled: bool,
) -> tuple[Split, dict[str, tuple[str, fmpq]]] | None:
    """Split a plant, and say which state is measured by which output, and with which factor; None after an error.

    A plant whose y is known at instants only has no measured state between them.
    """
    measured: dict[str, tuple[str, fmpq]] = {}
    known: dict[str, Expression] = {}
    try:
        if not sampled:
            seen = Splitter(names.states, names.w, {}).split({}, outputs)
            measured = dict(shown(seen, names))
        for state, (output, factor) in measured.items():
            known[state] = Expression.combination([1 / factor], [Expression.variable(output)])
        found = Splitter(names.states, names.w, known).split(dynamics, outputs)
        if not found.proved({**dynamics, **outputs}, outputs):
            raise UndecidedError("system.dynamics: that the matrices and terms are these equations could not be proved")
    except ExpressionError as error:
        reader.wrong(("system", "dynamics"), error.message)
    except UsageError as error:
        for problem in error.problems:
            reader.wrong(("system", "outputs" if problem.key in outputs else "dynamics", problem.key), problem.message)
    else:
        return found, measured
    return None


def shown(seen: Split, names: Names) -> Iterator[tuple[str, tuple[str, fmpq]]]:
    """States that an output is a multiple of, without noise."""
    curved = {name for term in seen.terms for name in term.enters}
    for name in names.outputs:
        row = seen.linear[name]
        if len(row) == 1 and row.keys() <= set(names.states) and name not in curved and seen.known[name].text == "0":
            state, factor = next(iter(row.items()))
            yield state, (name, factor)


def read_types(
    reader: Reader, written: Mapping[str, str | schema.TypeData], terms: Sequence[Term], names: Names
) -> dict[int, tuple[Loc, str | schema.TypeData]]:
    """Types that the spec declares, by the number of the term, which it names by its text, or f1, f2, .."""
    texts = {term.text: i for i, term in enumerate(terms)}
    numbered = {f"f{i + 1}": i for i in range(len(terms))}
    declared: dict[int, tuple[Loc, str | schema.TypeData]] = {}
    signals = ("t", *names.states, *names.inputs, *names.w, *names.outputs)
    for key, value in written.items():
        place: Loc = ("system", "types", key)
        i = numbered.get(key, texts.get(key))
        if i is None:
            try:
                i = texts.get(parse(key, signals, reader.parameters).text)
            except ExpressionError:
                i = None
        if i is None:
            reader.wrong(place, unknown("term", key, tuple(texts), {}), at_key=True)
        elif i in declared:
            reader.wrong(place, f"{terms[i].text} has a type already; give one", at_key=True)
        else:
            declared[i] = place, value
    return declared


def typed(
    reader: Reader,
    term: Term,
    place: Loc,
    declared: str | schema.TypeData,
    known: Sequence[str],
    region: Mapping[str, Ends],
) -> Typed | None:
    """A term with its type: everywhere, if that is as good as on the domain; None after an error.

    The slope of one that only its negative has bounded below is that of the negative.
    """
    trials = []
    signs = (1, -1) if declared == AUTO and len(term.arguments) == 1 else (1,)
    for limits in ({}, region) if region else ({},):
        for sign in signs:
            trial = attempt(reader, term, place, declared, known, limits, sign)
            trials.append(trial)
            if trial.found is not None:
                break
    found = [trial for trial in trials if trial.found is not None]
    if not found:
        last = trials[-len(signs)]
        reader.problems += [renamed(problem, place, term) for problem in last.problems]
        return None
    best = found[0] if same_type(found[0], found[-1]) else found[-1]
    reader.notes += [f"{term.text}: {note.partition(': ')[2]}" for note in best.notes]
    enters = {name: best.sign * c for name, c in term.enters.items()}
    assert best.found
    return Typed(replace(term, enters=enters), best.block, best.found)


@dataclass(frozen=True)
class Trial:
    """A term read with a type on a region, and what is said of it."""

    sign: int
    block: Block
    found: Nonlinearity | None
    problems: Sequence[Problem]
    notes: Sequence[str]


def attempt(
    reader: Reader,
    term: Term,
    place: Loc,
    declared: str | schema.TypeData,
    known: Sequence[str],
    region: Mapping[str, Ends],
    sign: int,
) -> Trial:
    """Read a term as a block of its own; what is wrong is kept apart."""
    trial = Reader(reader.document, [])
    trial.parameters, trial.exact = reader.parameters, reader.exact
    f = Expression.combination([fmpq(sign)], [term.f])
    section = schema.Function(type=declared, f=[f.text], region=written(region, f, len(term.arguments)))
    block = read_block(trial, section, place, len(term.arguments), 1)
    return Trial(sign, block, read_nonlinearity(trial, block, known), trial.problems, trial.notes)


def same_type(everywhere: Trial, local: Trial) -> bool:
    """Whether a type that holds everywhere is the one that is found on the domain, and is known as well there."""
    assert everywhere.found
    assert local.found
    same = everywhere.found.type == local.found.type
    return same and bool(everywhere.found.assumed) <= bool(local.found.assumed)


def written(region: Mapping[str, Ends], f: Expression, nq: int) -> dict[str, list[str]] | None:
    """Limits of the variables of f as a spec has them; those of q are q1, q2, .."""
    names = {"q" if nq == 1 and name == "q1" else name: ends for name, ends in region.items()}
    used = {name: ends for name, ends in names.items() if name in f.names and ends != EVERYWHERE}
    return {name: [limit(low, "-.inf"), limit(high, ".inf")] for name, (low, high) in used.items()} or None


def limit(value: fmpq | None, otherwise: str) -> str:
    """Limit as a spec has it."""
    return otherwise if value is None else str(value)


def renamed(problem: Problem, place: Loc, term: Term) -> Problem:
    """Problem of a block as one of the term, at the equation in which it stands."""
    message = re.sub(r"\bgive (a smaller region|a region without that)\b.*", "", problem.message).rstrip("; ,")
    said = "give system.domain where it stays, or declare its type under system.types"
    return replace(problem, key=dotted(place), message=f"the term {term.text}: {message}; {said}")


def over(row: Row, domain: Domain) -> Ends:
    """Range of a linear combination of signals."""
    low, high = fmpq(0), fmpq(0)
    ends: list[fmpq | None] = [low, high]
    for name, c in row.items():
        limits = domain.get(name, EVERYWHERE)
        if c < 0:
            limits = limits[1], limits[0]
        ends = [
            None if total is None or each is None else total + c * each
            for total, each in zip(ends, limits, strict=True)
        ]
    return ends[0], ends[1]


def region_of(term: Term, domain: Domain, measured: Mapping[str, tuple[str, fmpq]]) -> dict[str, Ends]:
    """Range of every variable of a term: its arguments, inputs, and outputs, which have that of the state they show."""
    found = {f"q{i + 1}": over(row, domain) for i, row in enumerate(term.arguments)}
    seen = {output: over({state: factor}, domain) for state, (output, factor) in measured.items()}
    return {**found, **seen, **{name: ends for name, ends in domain.items() if name in term.f.names}}


def table(rows: Sequence[Sequence[fmpq]], columns: int) -> Array:
    """Rows as a matrix."""
    return np.array(rows, dtype=object).reshape(len(rows), columns) if rows and columns else empty(len(rows), columns)


def read_equations(
    reader: Reader, system: schema.Equations, sections: Sequence[schema.Nonlinearity] | None, *, sampled: bool
) -> Reading:
    """Plant, known terms and nonlinearities of a plant as equations; `sampled`: y is known at instants only."""
    if sections:
        said = "are the terms of system.dynamics, which are found by themselves; leave them out"
        reader.wrong(("nonlinearities",), f"{said} (a type of a term is declared under system.types)", at_key=True)
    x, y, w = (
        X.of(len(system.states or system.dynamics)),
        Y.of(len(system.outputs)),
        W.of(len(system.disturbances or ())),
    )
    for axis, what in ((x, "states"), (y, "outputs")):
        reader.limit(axis.size, what, ("system", what))
    names = read_names(reader, system, x, y, w)
    if names is None:
        return Reading(Layout(x, y, w))
    dynamics, outputs = read_sides(reader, system, names)
    for name, side in dynamics.items() if sampled else ():
        refuse_outputs(reader, ("system", "dynamics", name), side.text, [side], names.outputs)
    domain = read_domain(reader, system, names)
    layout = Layout(x, y, w, names=names)
    if not reader.clean(("system",)) or (found := split(reader, dynamics, outputs, names, sampled=sampled)) is None:
        return Reading(layout)
    whole, measured = found
    declared = read_types(reader, system.types, whole.terms, names)
    known = layout.known(*(() if sampled else ("outputs",)), "inputs")
    terms: list[Typed] = []
    for i, term in enumerate(whole.terms):
        place, kind = declared.get(i, (equation(term, names), AUTO))
        one = typed(reader, term, place, kind, known or (), region_of(term, domain, measured))
        terms += [one] if one else []
    if len(terms) < len(whole.terms):
        return Reading(layout)
    return assembled(reader, layout, whole, terms)


def assembled(reader: Reader, layout: Layout, whole: Split, terms: Sequence[Typed]) -> Reading:
    """The plant in matrices, with its terms side by side."""
    names = layout.names
    assert names
    blocks = tuple(one.found for one in terms)
    nq = sum(block.nq for block in blocks)
    layout = replace(layout, q=layout.q.of(nq), f=layout.f.of(len(terms)))
    for axis, what in ((layout.q, "components of q"), (layout.f, "nonlinear terms")):
        reader.limit(axis.size, what, ("system", "dynamics"))
    sizes = {"A": (names.states, names.states), "B": (names.states, names.w)}
    sizes |= {"C": (names.outputs, names.states), "D": (names.outputs, names.w)}
    matrices = {key: Entries(("system", "dynamics"), whole.matrix(*size)) for key, size in sizes.items()}
    plant = read_matrices(reader, layout, matrices, [one.part(names, len(terms)) for one in terms])
    gx, gy = (tuple(whole.known[name] for name in group) for group in (names.states, names.outputs))
    return Reading(layout, plant, gx, gy, (Expression.number(0),) * nq, blocks, whole)


def equation(term: Term, names: Names) -> Loc:
    """Where a term first stands."""
    name = next(iter(term.enters))
    return ("system", "outputs" if name in names.outputs else "dynamics", name)
