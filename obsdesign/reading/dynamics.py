"""A plant as equations: its right sides read, split into matrices and nonlinear terms, and the type of each term."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter

from flint import fmpq

from obsdesign.errors import UndecidedError, UsageError
from obsdesign.expressions import Expression, ExpressionError
from obsdesign.model.coefficients import Coefficients
from obsdesign.model.split import Split, Splitter, Term
from obsdesign.nonlinearities.evidence.restriction import Ends
from obsdesign.reading import plant_schema as schema
from obsdesign.reading.blocks import read_range
from obsdesign.reading.noise import channels, in_outputs
from obsdesign.reading.plant import Layout, Names, Reading, W, X, Y, read_matrices, read_names, refuse_outputs
from obsdesign.reading.plant_schema import AUTO
from obsdesign.reading.terms import Typed, Types, over, read_types
from obsdesign.sections.document import Loc, dotted
from obsdesign.sections.scalars import AS_DOUBLE
from obsdesign.sections.values import Entries, Reader
from obsdesign.sections.words import unknown
from obsdesign.trial import Level

UNDECLARED = (
    "a state has a line of its own under system.dynamics, a constant is declared under parameters, "
    "a known input under system.inputs, a disturbance under system.disturbances"
)


def read_sides(reader: Reader, system: schema.Equations, names: Names) -> tuple[dict[str, Expression], ...]:
    """Right sides of the states, and of the outputs in terms of states, inputs, disturbances and t.

    An output that stands in another one is put in; one that depends on itself is refused.
    """
    inner = ("t", *names.states, *names.inputs, *names.w)
    missing = [name for name in names.states if name not in system.dynamics]
    strange = [name for name in system.dynamics if name not in names.states]
    for name in strange:
        said = f"; {missing[0]} has no equation" if missing else ""
        reader.wrong(
            ("system", "dynamics", name), unknown("state", name, names.states, {}) + said, at_key=True, id="OBS203"
        )
    for name in () if strange else missing:
        reader.wrong(
            ("system", "dynamics"), f"{name} has no equation; give {name}: its derivative", at_key=True, id="OBS205"
        )

    def read(key: str, texts: Mapping[str, str]) -> dict[str, Expression]:
        places = {name: ("system", key, name) for name in texts}
        allowed = (*inner, *names.outputs)
        sides = {name: reader.expression(text, places[name], allowed, UNDECLARED) for name, text in texts.items()}
        return {name: in_numbers(reader, side, places[name], (*names.states, *names.w)) for name, side in sides.items()}

    outputs = explicit(reader, read("outputs", system.outputs))
    dynamics = read("dynamics", system.dynamics)
    return {name: dynamics[name] for name in names.states if name in dynamics}, outputs


def in_numbers(reader: Reader, side: Expression, loc: Loc, signals: Sequence[str]) -> Expression:
    """Right side whose irrational coefficients of signals are read as doubles, with a note."""
    coefficients = Coefficients(signals)
    try:
        made = coefficients.in_numbers(side)
    except ExpressionError as error:
        reader.wrong(loc, error.message, id=error.id)
        return side
    for text, value in coefficients.read.items():
        reader.notes.append(f"{text} in {dotted(loc)} {AS_DOUBLE} {value!r}")
    return made


def explicit(reader: Reader, outputs: Mapping[str, Expression]) -> dict[str, Expression]:
    """Outputs with their right sides in place of other outputs; none where they depend on themselves."""
    known: dict[str, Expression] = {}
    try:
        for name in TopologicalSorter(
            {name: side.names & outputs.keys() for name, side in outputs.items()}
        ).static_order():
            known[name] = outputs[name].substituted(known)
    except CycleError as error:
        loop = [name for name in outputs if name in error.args[1]]
        through = "itself" if len(loop) == 1 else f"{', '.join(loop[1:])}, which depend on it"
        said = f"depends on {through}: an algebraic loop; write it in states, inputs and disturbances"
        reader.wrong(("system", "outputs", loop[0]), said, id="OBS305")
    return {name: known[name] for name in outputs if name in known}


def read_domain(reader: Reader, system: schema.Equations, names: Names) -> dict[str, Ends]:
    """Range of each signal that has one."""
    domain: dict[str, Ends] = {}
    allowed = (*names.states, *names.inputs, *names.w, *names.outputs, "t")
    for name, ends in (system.domain or {}).items():
        place: Loc = ("system", "domain", name)
        if name in allowed:
            domain[name] = read_range(reader, ends, place)
        else:
            reader.wrong(place, unknown("signal", name, allowed, {}), at_key=True, id="OBS203")
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
            raise UndecidedError(
                "system.dynamics: that the matrices and terms are these equations could not be proved", id="OBS507"
            )
    except ExpressionError as error:
        reader.wrong(("system", "dynamics"), error.message, id=error.id)
    except UsageError as error:
        for problem in error.problems:
            reader.wrong(
                ("system", "outputs" if problem.key in outputs else "dynamics", problem.key),
                problem.message,
                id=problem.id,
            )
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


def read_equations(
    reader: Reader, system: schema.Equations, noise: Mapping[str, Level], *, sampled: bool, constants: bool
) -> Reading:
    """Plant, known terms and nonlinearities of a plant as equations.

    `noise`: of outputs, which are then no states that are known, as channels of w in the matrices, not in the layout;
    `sampled`: y is known at instants only; `constants`: every term needs a Lipschitz constant.

    Where the equations are wrong, everything else is left open.
    """
    x, y = X.of(len(system.states or system.dynamics)), Y.of(len(system.outputs))
    w = W.of(len(system.disturbances or ()))
    for axis, what in ((x, "states"), (y, "outputs")):
        reader.limit(axis.size, what, ("system", what))
    names = read_names(reader, system, x, y, w)
    if names is None:
        return Reading(Layout())
    dynamics, outputs = read_sides(reader, system, names)
    layout, outputs = Layout(x, y, w, names=names), in_outputs(outputs, noise, names)
    names = replace(names, w=(*names.w, *channels(noise, names)))
    for name, side in dynamics.items() if sampled else ():
        refuse_outputs(reader, ("system", "dynamics", name), side.text, [side], names.outputs, "states and inputs")
    domain = read_domain(reader, system, names)
    if not reader.clean(("system",)) or (found := split(reader, dynamics, outputs, names, sampled=sampled)) is None:
        return Reading(Layout())
    whole, measured = found
    seen = {state: over({y: 1 / c}, domain) for state, (y, c) in measured.items() if y in domain}
    declared = read_types(reader, system.types, whole.terms, names)
    known = layout.known(*(() if sampled else ("outputs",)), "inputs") or ()
    types = Types(reader, names, known, {**seen, **domain}, measured, constants)
    terms: list[Typed] = []
    for i, term in enumerate(whole.terms):
        one = types.typed(*declared.get(i, (term, equation(term, names), AUTO)))
        terms += [one] if one else []
    if len(terms) < len(whole.terms) or not reader.clean(("system",)):
        return Reading(layout)
    made = assembled(reader, replace(layout, w=w.of(len(names.w)), names=names), whole, terms)
    return replace(made, layout=replace(made.layout, w=w, names=layout.names))


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
    return Reading(layout, plant, gx, gy, (Expression.number(0),) * nq, blocks)


def equation(term: Term, names: Names) -> Loc:
    """Where a term first stands."""
    name = next(iter(term.enters))
    return ("system", "outputs" if name in names.outputs else "dynamics", name)
