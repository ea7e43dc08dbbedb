"""Lipschitz constants of nonlinearities as text."""

from collections.abc import Mapping, Sequence
from typing import Any

from obsdesign.tables.text import aligned, at_least, at_most

Rows = list[tuple[str, str]]


def constants_table(report: Mapping[str, Any]) -> str:
    """Bounds of every constant, and what scaled coordinates make of them."""
    rows = [("problem", report["name"])]
    for block in report["blocks"]:
        rows += bounds(block)
    return aligned(rows + (scalings(report["scaling"]) if "scaling" in report else []))


def bounds(block: Mapping[str, Any]) -> Rows:
    """One nonlinearity."""
    rows = [(block["name"], block["type"])]
    if "region" not in block:
        return [*rows, ("constant", "no f is given, of which there could be one")]
    limits = [f"{name} in {interval(ends)}" for name, ends in block["region"].items() if ends != [None, None]]
    rows += [("region", ", ".join(limits) or "everywhere")]
    if "reason" in block:
        rows += [("constant", "infinite" if block["infinite"] else "no bound is proved")]
    else:
        boxes = f"{block['boxes']} box{'es' if block['boxes'] > 1 else ''}"
        rows += [("constant", f"{within(block)}   proved, gap {block['gap']:.1g}, {boxes}")]
        rows += [
            ("attained", ", ".join(f"{name} = {value:.6g}" for name, value in block["point"].items()) or "anywhere")
        ]
    if "declared" in block:
        said = "proved" if block["proved"] else "NOT proved, the guarantee assumes it"
        rows += [("declared", f"{at_most(block['declared'], 7)}   {said}")]
    return rows


def scalings(found: Mapping[str, Any]) -> Rows:
    """What coordinates T x make of the constant of f as a function of all states, and of the admissible one."""
    pace = f"rho {found['rho']:g}" if "rho" in found else f"decay {found['decay']:g} 1/s"
    rows = [("coordinates", f"f as any function of the states, {found['relaxation']}, {pace}")]
    for key in ("identity", "scaled"):
        case = found[key]
        admissible, margin, ratio = (number(case[name]) for name in ("admissible", "margin", "ratio"))
        rows += [(f"T = {diagonal(case['T'])}", f"constant {within(case)}, admissible {admissible}")]
        rows += [("", f"margin {margin}, ratio {ratio}")]
    if found["edge"]:
        rows += [("note", "the search ended at the largest spread of T that it tries: the ratio may have no limit")]
    return rows


def within(found: Mapping[str, float]) -> str:
    """Both bounds."""
    return f"{at_least(found['lower'], 7)} .. {at_most(found['upper'], 7)}"


def interval(ends: Sequence[float | None]) -> str:
    """Range whose null ends are infinite."""
    low, high = ends
    return f"[{'-inf' if low is None else f'{low:.6g}'}, {'inf' if high is None else f'{high:.6g}'}]"


def diagonal(T: Sequence[float]) -> str:
    """Diagonal matrix."""
    return "I" if set(T) == {1} else f"diag({', '.join(f'{t:g}' for t in T)})"


def number(value: float | None) -> str:
    """Number whose null is infinite."""
    return "inf" if value is None else f"{value:.6g}"
