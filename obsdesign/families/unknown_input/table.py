"""Unknown-input observers as text."""

from collections.abc import Mapping
from typing import Any

from obsdesign.families.incremental.table import linear
from obsdesign.families.unknown_input.theorem import DIRECT, gain_words
from obsdesign.tables.text import decay_rows, gamma_text, matrix_text, spectral_norm

Rows = list[tuple[str, str]]


def proved(made: Mapping[str, Any], claimed: Mapping[str, Any]) -> Rows:
    """What is proved of the gains."""
    if "statement" not in claimed:
        return []
    rows = [("cancelled", f"{', '.join(made['cancelled'])}   what is proved holds whatever it is: T B = 0, exactly")]
    meaning = gain_words(direct=DIRECT in claimed["statement"])
    rows += [("gamma", gamma_text(claimed, meaning))] if "gamma" in claimed else []
    return [*rows, *decay_rows(claimed)]


def figures(made: Mapping[str, Any]) -> Rows:
    """What an engineer asks first of the gains E and L."""
    E = [[x if isinstance(x, str) else f"{x:.6g}" for x in row] for row in made["E"]]
    text = "; ".join(", ".join(row) for row in E)
    period = [("period", f"{made['period']:g} s")] if "period" in made else []
    gain = [("gain", f"|L| = {spectral_norm(made['L']):.4g}"), ("E", f"[{text}]"), ("L", matrix_text(made["L"]))]
    return [*gain, *period, *linear(made)]
