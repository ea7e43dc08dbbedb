"""The estimation problem of a spec as formulas: signals, equations, matrices, nonlinearities."""

from collections.abc import Iterator, Sequence
from itertools import accumulate

from markupsafe import Markup

from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array
from obsdesign.model.equations import Typed, linear
from obsdesign.records import dataclass
from obsdesign.reports import mathml
from obsdesign.spec import Nonlinearity, Spec, arguments
from obsdesign.tables.split import shown

LARGEST = 12  # rows or columns of a matrix that is written out at once
MOST = 60  # .. that is written out at all


@dataclass(frozen=True)
class Signal:
    """Names of the components of a vector."""

    symbol: Markup
    meaning: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class Matrix:
    """A matrix with its symbol; `formula` is None where it is too large to be of use."""

    symbol: Markup
    size: str
    formula: Markup | None
    folded: bool


@dataclass(frozen=True)
class Block:
    """A nonlinearity: what it computes, and what the design takes it for."""

    formula: Markup | None
    argument: Markup
    type: str
    region: str
    known: str  # whether the type is proved


@dataclass(frozen=True)
class DesignProblem:
    """What is to be estimated, of which plant."""

    signals: tuple[Signal, ...]
    equations: tuple[Markup, ...]
    matrices: tuple[Matrix, ...]
    blocks: tuple[Block, ...]
    ranges: tuple[str, ...]  # of the signals of a plant as equations

    @classmethod
    def of(cls, spec: Spec) -> "DesignProblem":
        """Write the problem of a spec."""
        if spec.typed:
            return cls(tuple(signals(spec)), tuple(typed(spec.typed)), (), (), tuple(ranges(spec.typed)))
        return cls(tuple(signals(spec)), tuple(equations(spec)), tuple(matrices(spec)), tuple(blocks(spec)), ())


def signals(spec: Spec) -> Iterator[Signal]:
    """Every vector that has components."""
    plant = spec.plant
    modelled = len(spec.generator.Am) > 0
    known = (
        ("x", "states", plant.states),
        ("u", "known inputs", spec.inputs),
        ("w", "unknown inputs: disturbance and noise", plant.exogenous),
        ("x_m", "states of the disturbance model", spec.model_states),
        ("v", "what drives the disturbance model", spec.drives if modelled else ()),
        ("y", "measured outputs", plant.outputs),
        ("z", "error that counts", () if spec.typed else spec.H_names),
    )
    for letter, meaning, names in known:
        if names:
            units = tuple(f"{name} [{spec.units[name]}]" if name in spec.units else name for name in names)
            yield Signal(mathml.inline(mathml.indexed(*letter.split("_"))), meaning, units)


Term = tuple[Markup, bool]  # what is written, and whether it is there


def side(left: Markup, *terms: Term) -> Markup:
    """Equation of the terms that are there."""
    return mathml.block(mathml.equation(left, mathml.total([term for term, there in terms if there])))


def times(letter: str, index: str, factor: Markup) -> Markup:
    """Matrix times a vector."""
    return mathml.row(mathml.indexed(letter, index), mathml.INVISIBLE, factor)


def moved(spec: Spec, letter: str, index: str = "") -> Markup:
    """What the dynamics give: the derivative of a state, or in discrete time its next sample."""
    if spec.period is None:
        return mathml.indexed(letter, index, mathml.DOT)
    return mathml.ahead(mathml.indexed(letter, index))


def equations(spec: Spec) -> Iterator[Markup]:
    """The plant in matrices, without the terms that are zero; what generates w; the error that counts."""
    plant, model = spec.plant, spec.generator
    x, w, v, xm = mathml.symbol("x"), mathml.symbol("w"), mathml.symbol("v"), mathml.indexed("x", "m")
    f = mathml.applied("f", [mathml.symbol("q")])
    yield side(
        moved(spec, "x"),
        (times("A", "", x), True),
        (times("B", "f", f), bool(plant.Bf.any())),
        (mathml.indexed("g", "x"), known(spec.gx)),
        (times("B", "", w), bool(plant.B.any())),
    )
    yield side(
        mathml.symbol("y"),
        (times("C", "", x), True),
        (times("D", "f", f), bool(plant.Df.any())),
        (mathml.indexed("g", "y"), known(spec.gy)),
        (times("D", "", w), bool(plant.D.any())),
    )
    if len(plant.Cq):
        yield side(
            mathml.symbol("q"),
            (times("C", "q", x), bool(plant.Cq.any())),
            (times("D", "qf", f), bool(plant.Dqf.any())),
            (mathml.indexed("g", "q"), known(spec.gq)),
            (times("D", "q", w), bool(plant.Dq.any())),
        )
    if len(model.Am):
        f2 = mathml.symbol("f2")
        forms = ((times("B", "mf", f2), bool(model.Bmf.any())), (times("B", "m", v), bool(model.Bm.any())))
        yield side(moved(spec, "x", "m"), (times("A", "m", xm), bool(model.Am.any())), *forms)
        output = ((times("D", "wf", f2), bool(model.Dwf.any())), (times("D", "m", v), bool(model.Dm.any())))
        yield side(w, (times("C", "m", xm), bool(model.Cm.any())), *output)
    yield side(mathml.symbol("z"), (times("H", "", mathml.symbol("e")), True))


def known(terms: Sequence[Expression]) -> bool:
    """Whether there are known terms."""
    return any(term.text != "0" for term in terms)


def matrices(spec: Spec) -> Iterator[Matrix]:
    """Every matrix of these equations that is not zero, and the known terms."""
    plant, model = spec.plant, spec.generator
    found: list[tuple[str, str, Array]] = [("A", "", plant.A)]
    found += [("B", "f", plant.Bf), ("B", "", plant.B), ("C", "", plant.C), ("D", "f", plant.Df), ("D", "", plant.D)]
    found += [("C", "q", plant.Cq), ("D", "qf", plant.Dqf), ("D", "q", plant.Dq)]
    if len(model.Am):
        found += [("A", "m", model.Am), ("B", "m", model.Bm), ("C", "m", model.Cm), ("D", "m", model.Dm)]
        found += [("B", "mf", model.Bmf), ("D", "wf", model.Dwf)]
    found.append(("H", "", spec.H))
    for letter, index, M in found:
        if M.any() or (letter, index) == ("A", ""):
            large = max(M.shape) > LARGEST
            formula = mathml.block(mathml.matrix(M)) if max(M.shape) <= MOST else None
            size = "{} × {}".format(*M.shape)
            yield Matrix(mathml.inline(mathml.indexed(letter, index)), size, formula, large)
    for index, terms in (("x", spec.gx), ("y", spec.gy), ("q", spec.gq)):
        if known(terms):
            content = mathml.block(mathml.column(map(mathml.expression, terms)))
            yield Matrix(mathml.inline(mathml.indexed("g", index)), str(len(terms)), content, len(terms) > LARGEST)


def blocks(spec: Spec) -> Iterator[Block]:
    """Nonlinearities in order, each with its argument in the names of the plant."""
    several, plant = len(spec.nonlinearities) > 1, spec.augmented
    firsts = accumulate((block.nq for block in spec.nonlinearities), initial=0)
    for i, (block, first) in enumerate(zip(spec.nonlinearities, firsts, strict=False), start=1):
        name = mathml.symbol(f"f{i}" if several else "f")
        own = [mathml.symbol(q) for q in (arguments(block.nq)[-block.nq :] if block.nq > 1 else ("q",))]
        columns = plant.Cq[first : first + block.nq], plant.Dq[first : first + block.nq]
        reads = [mathml.expression(e) for e in parts(columns, plant.states, plant.exogenous)]
        argued = [mathml.equation(q, e) for q, e in zip(own, reads, strict=True)]
        yield Block(
            formula(name, own, block),
            Markup(", ").join(map(mathml.inline, argued)),
            block.type,
            " and ".join(spec.limits(i - 1)),
            block.assumed,
        )


def parts(columns: tuple[Array, Array], states: Sequence[str], exogenous: Sequence[str]) -> list[Expression]:
    """Arguments of f as linear combinations of states and of what drives the plant."""
    on_x, on_w = (linear(M, names) for M, names in zip(columns, (states, exogenous), strict=True))
    return [a + b for a, b in zip(on_x, on_w, strict=True)]


def formula(name: Markup, own: Sequence[Markup], block: Nonlinearity) -> Markup | None:
    """What a nonlinearity computes, if that is known."""
    if block.f is None:
        return None
    sides = [mathml.expression(e) for e in block.f]
    right = sides[0] if len(sides) == 1 else mathml.column(sides)
    left = mathml.row(name, mathml.parenthesised(own))
    return mathml.block(mathml.equation(left, right))


def typed(plant: Typed) -> Iterator[Markup]:
    """A plant as it was typed."""
    for name, right in plant.equations.dynamics.items():
        yield mathml.block(mathml.equation(mathml.symbol(name, mathml.DOT), mathml.expression(right)))
    for name, right in plant.equations.outputs.items():
        yield mathml.block(mathml.equation(mathml.symbol(name), mathml.expression(right)))


def ranges(plant: Typed) -> Iterator[str]:
    """Where each signal stays."""
    for name, (low, high) in plant.domain.items():
        if (low, high) != (None, None):
            ends = ["−∞" if low is None else shown(low), "∞" if high is None else shown(high)]
            yield f"{name} in [{', '.join(ends)}]"
