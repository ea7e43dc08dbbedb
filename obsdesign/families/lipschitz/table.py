"""Observers of Lipschitz systems as text."""

from collections.abc import Mapping, Sequence
from typing import Any

from obsdesign.families.incremental.table import linear
from obsdesign.families.lipschitz.claim import meaning
from obsdesign.tables.text import limit_text, matrix_text, spectral_norm

QUANTITIES = ("lipschitz", "gamma")
LONGEST = 60  # points that are listed one by one

Rows = list[tuple[str, str]]


def claim(claimed: Mapping[str, Any]) -> Rows:
    """What is proved of the gain."""
    if "lipschitz" not in claimed:
        return []
    margin = claimed["margin"]
    said = "left for an uncertainty of f" if margin >= 0 else "the declared constant is NOT covered"
    rows = [("lipschitz", f"{claimed['lipschitz']:g}   for every f with this constant")]
    rows += [("margin", f"{margin:.6g}   {said}")]
    if "constants" in claimed:
        rows += [("constants", ", ".join(f"{c:g}" for c in claimed["constants"]) + "   of its blocks")]
    if "admissible" in claimed:
        rows += [("tolerated", f"a Lipschitz constant up to {claimed['admissible']:g}")]
    if "gamma" in claimed:
        drive = "v" if "norm2(v)" in claimed.get("statement", "") else "w"
        rows += [("gamma", f"{claimed['gamma']:g}   {meaning(drive)}")]
    return [*rows, ("decay rate", f"{claimed['decay']:g} 1/s")]


def background(claimed: Mapping[str, Any]) -> Rows:
    """What bounds the limit, and what the relaxations cost."""
    rows = []
    if "widened" in claimed:
        wide = claimed["widened"]
        rows += [("widened", f"gamma {wide['gamma']:.6g} as if the Lipschitz constant were {wide['lipschitz']:.6g}")]
    if "ceiling" in claimed:
        rows += [("ceiling", f"lipschitz {claimed['ceiling']:.6g}   no gain tolerates more")]
    return rows + [("relaxation", compared(row)) for row in claimed.get("comparison", [])]


def compared(row: Mapping[str, Any]) -> str:
    """One relaxation of a comparison."""
    parts = [f"{row['relaxation']:<12}"]
    if row.get("limit"):
        parts.append(f"limit {limit_text(row['limit'])}")
    if "certified" in row:
        parts.append(f"certified {certified(row['certified'])}")
    if row.get("status") in ("refused", "undecided"):
        parts.append(f"{row['status']}, see the note")
    elif "reason" in row:
        parts.append(row["reason"])
    return "   ".join(parts)


def gains(made: Mapping[str, Any]) -> Rows:
    """What an engineer asks first of the gain L."""
    return [("gain", f"|L| = {spectral_norm(made['L']):.4g}"), ("L", matrix_text(made["L"])), *linear(made)]


def is_front(search: Mapping[str, Any]) -> bool:
    """Whether a search is that of this family, over the weight or over the decay or over both."""
    return any("weight" in point for point in search.get("points", []))


def front(search: Mapping[str, Any]) -> Rows:
    """Points of a curve, or a summary of a surface."""
    points, parameters = search["points"], search.get("parameters", [search["parameter"]])
    if len(points) > LONGEST:
        return summary(points, parameters)
    at = (", ".join(f"{key} {point[key]:<7.4g}" for key in parameters) for point in points)
    return [("curve", f"{where} {shown(point)}") for where, point in zip(at, points, strict=True)]


def shown(point: Mapping[str, Any]) -> str:
    """One point."""
    if not solvable(point):
        return str(point["status"])
    parts = [quantities(point)]
    parts += [f"certified {certified(point['certified'])}"] if "certified" in point else [str(point["status"])]
    parts += [] if point.get("attained", True) else ["not attained"]
    return "   ".join([*parts, *(["corner"] if point.get("corner") else [])])


def summary(points: Sequence[Mapping[str, Any]], parameters: Sequence[str]) -> Rows:
    """Many points in a few lines: how many are certified, between what, and where there are none."""
    proved = [point["certified"] for point in points if "certified" in point]
    absent = [point for point in points if not solvable(point)]
    hidden = sum(not point.get("attained", True) for point in points)
    rows = [("surface", f"{len(points)} points, {between(points, parameters)}: {len(proved)} certified")]
    rows += [("certified", between(proved, (*QUANTITIES, "L")))] if proved else []
    rows += [("not attained", f"at {hidden} of them")] if hidden else []
    return rows + ([("no solution", f"at {len(absent)} of them, {between(absent, parameters)}")] if absent else [])


def between(points: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> str:
    """Ranges of what points hold."""
    columns = {key: [point[key] for point in points if key in point] for key in keys}
    return ", ".join(f"{label(key)} {span(min(c), max(c))}" for key, c in columns.items() if c)


def span(low: float, high: float) -> str:
    """Range in words."""
    return f"{low:.4g} to {high:.4g}" if low < high else f"{low:.4g}"


def solvable(point: Mapping[str, Any]) -> bool:
    """Whether a point has a limit: of what has no weight in it there is none."""
    return any(key in point for key in QUANTITIES)


def certified(numbers: Mapping[str, float]) -> str:
    """What a gain is proved to achieve, and its size."""
    return f"{quantities(numbers)}, |L| = {numbers['L']:.4g}"


def quantities(numbers: Mapping[str, float]) -> str:
    """Lipschitz constant and gamma, whichever there are."""
    return ", ".join(f"{key} {numbers[key]:.6g}" for key in QUANTITIES if key in numbers)


def label(key: str) -> str:
    """Name of a quantity in a table."""
    return "|L|" if key == "L" else key
