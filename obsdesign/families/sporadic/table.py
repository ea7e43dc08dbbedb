"""Gains for sporadic measurements as text."""

from collections.abc import Mapping
from typing import Any

from obsdesign.families.sporadic.certificate import MEANING
from obsdesign.tables.text import UNBOUNDED, matrix_text, spectral_norm


def proved(_: Mapping[str, Any], claimed: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What is proved of the gains L and H."""
    rows = [("gamma", f"{claimed['gamma']:g}   {MEANING}")]
    rows += [("decay rate", f"{claimed['decay']:g} 1/s")]
    rows += [("intervals", f"{claimed['T1']:g} to {claimed['T2']:g} s, a jitter of {100 * claimed['jitter']:.3g} %")]
    rows += [("noise", f"{claimed['noise']:.4g} sup|eta| at most in |(e, d)|")] if "noise" in claimed else []
    rows += [("tolerated", f"T2 up to {claimed['T2_max']:g} s")] if "T2_max" in claimed else []
    return rows


def figures(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Gains for sporadic measurements, and how they contract the error over one interval."""
    rows = [
        ("gain", f"|L| = {spectral_norm(made['L']):.4g}"),
        ("L", matrix_text(made["L"])),
        ("H", matrix_text(made["H"])),
    ]
    known = ", ".join(f"{k:.3g} over {name}" for name, k in made["contraction"].items() if k is not None)
    said = f"{known}   the slowest that was found of f = K q of the types" if known else UNBOUNDED
    return [*rows, ("delta", f"{made['delta']:g} 1/s"), ("contraction", said)]
