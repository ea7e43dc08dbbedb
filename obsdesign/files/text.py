"""Results as text: JSON, CSV, and exact numbers."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.lmi.proof import Check


def rows(matrix: Array) -> list[list[str]]:
    """Exact entries."""
    return [[str(entry) for entry in row] for row in matrix]


def written(value: Array) -> str | list[list[str]]:
    """Exact value of an unknown: a number, or rows."""
    return str(value.item()) if value.shape == (1, 1) else rows(value)


def checks(found: Iterable[Check]) -> list[dict[str, Any]]:
    """Conditions and whether they hold."""
    return [{"name": c.name, "holds": c.holds, "margin": c.margin if np.isfinite(c.margin) else None} for c in found]


def witness(storage: Mapping[str, Array], multipliers: Mapping[str, Array], found: Iterable[Check]) -> dict[str, Any]:
    """Exact matrices of a storage function and multipliers, and what was checked of them."""
    matrices = {name: rows(P) for name, P in storage.items()}
    scales = {name: written(value) for name, value in multipliers.items()}
    return {"kind": "exact", **matrices, "multipliers": scales, "checks": checks(found)}


def digest(text: str) -> str:
    """SHA-256 of a spec's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def to_json(value: Any) -> str:
    """JSON with one line for each key, row of a matrix, and flat object."""
    return render(value, "") + "\n"


def render(value: Any, indent: str) -> str:
    """JSON of a value whose first line stands at an indentation."""
    flat = json.dumps(value, ensure_ascii=False, allow_nan=False)
    entries = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    nested = any(isinstance(v, dict | list) and v for v in entries)
    if (
        not entries
        or (not nested and indent and len(flat) < 200)
        or (indent and not nested and isinstance(value, list))
    ):
        return flat
    inner = indent + "  "
    if isinstance(value, dict):
        lines = [f"{json.dumps(k)}: {render(v, inner)}" for k, v in value.items()]
    else:
        lines = [render(v, inner) for v in value]
    left, right = "{}" if isinstance(value, dict) else "[]"
    return f"{left}\n{inner}" + f",\n{inner}".join(lines) + f"\n{indent}{right}"


def csv(header: list[str], samples: Array) -> bytes:
    """Table of a run, one row a sample, 12 digits."""
    lines = [",".join(header), *(",".join(f"{x:.12g}" for x in row) for row in samples)]
    return ("\n".join(lines) + "\n").encode()
