"""Gains L1 and L2 as text, and figures of any gain."""

from collections.abc import Mapping
from typing import Any

from obsdesign.families.incremental.theorems import THEOREMS
from obsdesign.tables.text import at_most, gamma_text, matrix_text, pole_text, rate_text, spectral_norm


def proved(observer: Mapping[str, Any], claimed: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What is proved of the gains L1 and L2."""
    if "gamma" not in claimed:
        return []
    rows = [("gamma", gamma_text(claimed, THEOREMS[observer["type"]].about.gamma))]
    rows += [("decay rate", rate_text(claimed["alpha"], claimed.get("statement", "")))]
    if "reconstruction" in claimed:
        rows += [("reconstruction", reconstruction_text(claimed["reconstruction"]))]
    return rows


def figures(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What an engineer asks first of the gains L1 and L2."""
    gains = [(name, matrix_text(made[name])) for name in ("L1", "L2")]
    return [("gain", f"|L1| = {spectral_norm(made['L1']):.4g}"), *gains, *linear(made)]


def linear(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Figures of the linear error dynamics."""
    rows = [("poles", f"{', '.join(pole_text(p) for p in made['poles'])}   of the linear part, without f")]
    noise = ", ".join(f"{name} {value:.3g}" for name, value in made["noise_gain"].items())
    rows += [("noise gain", noise)] if noise else []
    rows += [("cond(P)", f"{made['condition_P']:.3g}")] if "condition_P" in made else []
    return rows


def reconstruction_text(bound: Mapping[str, float]) -> str:
    """Bound on the reconstruction error."""
    terms = zip(("w", "w_rate", "x_rate"), ("sup|w|", "sup|w'|", "sup|x'|"), strict=True)
    return "limsup |what - w| <= " + " + ".join(f"{at_most(bound[key], 4)} {norm}" for key, norm in terms if bound[key])
