"""How a plant as equations was split: matrices, known terms and nonlinear terms, as text and as a file has them."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.expressions.tree import written_number
from obsdesign.lmi.formula import Array, Exact, rational_number
from obsdesign.model.discretise import Continuous
from obsdesign.model.plant import Plant
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, Ends
from obsdesign.spec import Nonlinearity, Spec, arguments
from obsdesign.tables.text import aligned

EXACTLY = "the equations exactly, proved"
MODEL = "a model: nothing that is proved of it is proved of the continuous plant"
LARGEST = 2**53  # integer that every reader of JSON takes exactly


def entry(spec: Spec) -> dict[str, Any]:
    """Entry `split` of a file: that of a plant as equations, as a spec in matrices would have it; else no entry.

    A number is a decimal where that is exact, else a text "p/q".
    """
    before = spec.continuous
    samples = {"discretised": in_samples(spec, before)} if before else {}
    return {**({"split": matrices_of(spec, before or spec)} if spec.as_equations else {}), **samples}


def matrices_of(spec: Spec, view: Spec | Continuous) -> dict[str, Any]:
    """A plant as a spec in matrices has it."""
    matrices = {key: rows(getattr(view.plant, key)) for key in ("A", "B", "C", "D")}
    known = {"gx": [e.text for e in view.gx], "gy": [e.text for e in view.gy]}
    return {**matrices, **known, "nonlinearities": [term(view.plant, *each) for each in blocks(spec)]}


def in_samples(spec: Spec, before: Continuous) -> dict[str, Any]:
    """Plant in samples that stands for a continuous one, and what is claimed of that."""
    assert spec.period is not None
    head = {"period": number(spec.period), "method": before.method}
    said = MODEL if before.defect is None else f"{MODEL}, but for guarantee.at_samples"
    return {**head, **matrices_of(spec, spec), "statement": said}


def blocks(spec: Spec) -> Iterator[tuple[Nonlinearity, int, int]]:
    """Terms of the plant, each with its first component of f and that of q."""
    f = q = 0
    for block in spec.nonlinearities:
        if q == len(spec.plant.Cq):
            return
        yield block, f, q
        f, q = f + block.multiplier.member.shape[0], q + block.nq


def term(plant: Plant[Exact], block: Nonlinearity, i: int, first: int) -> dict[str, Any]:
    """One nonlinearity, and the `term` of the equations that it is, if it is one."""
    q, f = slice(first, first + block.nq), slice(i, i + block.multiplier.member.shape[0])
    written = [side.text for side in block.f or ()]
    enters = {key: getattr(plant, key)[:, f] for key in ["Bf", "Df"]}
    one = f.stop - f.start == 1
    sides = {key: column(M[:, 0]) if one else rows(M) for key, M in enters.items()}
    own = dict(zip(arguments(block.nq)[-block.nq :] if block.nq > 1 else ("q",), block.region or (), strict=False))
    region = {name: ends(limits) for name, limits in {**own, **block.others}.items() if limits != EVERYWHERE}
    return {
        **({"term": block.term} if block.term else {}),
        **({"f": written[0] if one else written} if written else {}),
        "type": plain(block.entry),
        **({"region": region} if region else {}),
        "Bf": sides["Bf"],
        "Cq": rows(plant.Cq[q]),
        "Dqf": rows(plant.Dqf[q]),
        "Dq": rows(plant.Dq[q]),
        "Df": sides["Df"],
    }


def ends(limits: Ends) -> list[Any]:
    """Range as a spec has it."""
    return [otherwise if end is None else number(end) for end, otherwise in zip(limits, ("-.inf", ".inf"), strict=True)]


def plain(value: Any) -> Any:
    """Value with exact numbers as JSON has them."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return number(value) if isinstance(value, fmpq) else value


def rows(matrix: Array) -> list[list[int | float | str]]:
    """Matrix as rows."""
    return [column(row) for row in matrix]


def column(entries: Iterable[fmpq]) -> list[int | float | str]:
    """List of numbers."""
    return [number(x) for x in entries]


def number(value: fmpq) -> int | float | str:
    """Decimal where that is exact as it is printed, else "p/q"."""
    if value.q == 1 and abs(value) <= LARGEST:
        return int(value.p)
    double = float(value)
    return double if abs(double) < float("inf") and rational_number(repr(double)) == value else str(value)


def printed(spec: Spec) -> str:
    """The split as `check` prints it, before anything else, and what plant in samples is meant in what follows."""
    rows = split_rows(spec) if spec.as_equations else []
    if spec.continuous and spec.period:
        said = f"{spec.continuous.method}, {float(spec.period):g} s apart: what follows is of this model"
        rows.append(("samples", said))
    return f"{aligned(rows)}\n\n" if rows else ""


def split_rows(spec: Spec) -> list[tuple[str, str]]:
    """The form, each matrix, each known term and each nonlinear term."""
    view = spec.continuous or spec
    plant = view.plant
    signals = {"A": plant.states, "B": plant.exogenous, "C": plant.states, "D": plant.exogenous}
    found = [("plant", form(spec))]
    for key, over in signals.items():
        if over:
            found += lined(key, getattr(plant, key), f"over {', '.join(over)}")
    for key, names, sides in (("gx", plant.states, view.gx), ("gy", plant.outputs, view.gy)):
        found += [(key, f"{name}: {e.text}") for name, e in zip(names, sides, strict=True) if e.text != "0"]
    for block, i, first in blocks(spec):
        found.append((f"f{i + 1}", f"{block.term}   {block.type}{located(block)}"))
        entered = [*zip(plant.states, plant.Bf[:, i], strict=True), *zip(plant.outputs, plant.Df[:, i], strict=True)]
        where = ", ".join(f"{shown(c)} in {name}" for name, c in entered if c != 0)
        own = arguments(block.nq)[-block.nq :] if block.nq > 1 else ("q",)
        of = ", ".join(f"{q} = {linear(plant.Cq[first + k], plant.Dq[first + k], plant)}" for k, q in enumerate(own))
        assert block.f
        found.append(("", f"= {block.f[0].text}, {of}; enters as {where}"))
    return found


def form(spec: Spec) -> str:
    """The form that the equations have."""
    view = spec.continuous or spec
    plant = view.plant
    f, w = ("Bf f(q)", "Df f(q)") if len(plant.Cq) else ("", ""), plant.B.shape[1]
    x = ["A x", f[0], "gx" if any(e.text != "0" for e in view.gx) else "", "B w" if w else ""]
    y = ["C x", f[1] if plant.Df.any() else "", "gy" if any(e.text != "0" for e in view.gy) else "", "D w" if w else ""]
    next_x = "x+" if spec.period and not spec.continuous else "x'"
    exactly = "the equations exactly, but for numbers read as doubles, proved" if spec.rounded else EXACTLY
    return f"{next_x} = {' + '.join(filter(None, x))},  y = {' + '.join(filter(None, y))}: {exactly}"


def located(block: Nonlinearity) -> str:
    """Where the type holds, if that is not everywhere."""
    own = [(block.arguments[k], limits) for k, limits in enumerate(block.region or ())]
    limited = {name: limits for name, limits in (*own, *block.others.items()) if limits != EVERYWHERE}
    where = (f"{name} in [{', '.join(map(str, ends(limits)))}]" for name, limits in limited.items())
    return f"   for {', '.join(where)}" if limited else ""


def lined(key: str, matrix: Array, of: str) -> list[tuple[str, str]]:
    """Matrix with its columns one below the other."""
    cells = [[shown(x) for x in row] for row in matrix]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in cells]
    lines[0] += f"   {of}"
    return [(key if i == 0 else "", line) for i, line in enumerate(lines)]


def shown(value: fmpq) -> str:
    """Number in full where it is short, else in 6 digits, marked."""
    exact = written_number(value)[0]
    return exact if len(exact) <= 10 else f"{float(value):.6g}.."


def linear(on_x: Sequence[fmpq], on_w: Sequence[fmpq], plant: Plant[Exact]) -> str:
    """Linear combination of states and disturbances."""
    names = (*plant.states, *plant.exogenous)
    pairs = [(c, name) for c, name in zip((*on_x, *on_w), names, strict=True) if c != 0]
    return Expression.combination([c for c, _ in pairs], [Expression.variable(name) for _, name in pairs]).text
