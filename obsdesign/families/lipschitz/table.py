"""Observers of Lipschitz systems as text."""

from collections.abc import Mapping
from typing import Any

from obsdesign.families.incremental.table import levels, linear, timing
from obsdesign.families.lipschitz.words import meaning
from obsdesign.tables.text import at_least, decay_rows, matrix_text, spectral_norm

Rows = list[tuple[str, str]]


def proved(_: Mapping[str, Any], claimed: Mapping[str, Any]) -> Rows:
    """What is proved of the gain."""
    if "lipschitz" not in claimed:
        return []
    margin = claimed["margin"]
    said = "left for an uncertainty of f" if margin >= 0 else "the declared constant is NOT covered"
    rows = [("lipschitz", f"{at_least(claimed['lipschitz'])}   for every f with this constant")]
    rows += [("margin", f"{at_least(margin)}   {said}")]
    if "constants" in claimed:
        rows += [("constants", ", ".join(at_least(c) for c in claimed["constants"]) + "   of its blocks")]
    if "admissible" in claimed:
        rows += [("tolerated", f"a Lipschitz constant up to {at_least(claimed['admissible'])}")]
    if "gamma" in claimed:
        statement = claimed.get("statement", "")
        drive = "v" if "norm2(v)" in statement or "|v|^2" in statement else "w"
        rows += levels(claimed, meaning(drive))
    return [*rows, *decay_rows(claimed, "decay")]


def figures(made: Mapping[str, Any]) -> Rows:
    """What an engineer asks first of the gain L."""
    return [
        ("gain", f"|L| = {spectral_norm(made['L']):.4g}"),
        ("L", matrix_text(made["L"])),
        *timing(made),
        *linear(made),
    ]
