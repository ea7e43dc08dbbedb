"""Gains L1 and L2 as text, and figures of any gain."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from obsdesign.families.incremental.theorems import THEOREMS
from obsdesign.tables.text import at_most, decay_rows, gamma_text, matrix_text, pole_text, spectral_norm

SPLIT = "of the inequality, for (v_b at k, v_d at k + 1): b the channels of v that act on x, d those in y"
GONE = 1e-7  # absolute value of a pole of samples, below which its error is gone in the next


def proved(observer: Mapping[str, Any], claimed: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What is proved of the gains L1 and L2."""
    if "gamma" not in claimed:
        return []
    rows = [*levels(claimed, THEOREMS[observer["type"]].about.gamma), *decay_rows(claimed)]
    if "at_samples" in claimed:
        rows += [("at samples", claimed["at_samples"]["statement"])]
    if "reconstruction" in claimed:
        rows += [("reconstruction", reconstruction_text(claimed["reconstruction"]))]
    return rows


def levels(claimed: Mapping[str, Any], meaning: str) -> list[tuple[str, str]]:
    """Gamma, with its meaning; of filtered estimates that of the inequality, and what follows of v itself."""
    if "gamma_v" not in claimed:
        return [("gamma", gamma_text(claimed, meaning))]
    of_v = meaning.replace("gamma", "gamma_v")
    return [("gamma", gamma_text(claimed, SPLIT)), ("gamma_v", f"{at_most(claimed['gamma_v'])}   {of_v}")]


def figures(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What an engineer asks first of the gains L1 and L2."""
    gains = [(name, matrix_text(made[name])) for name in ("L1", "L2")]
    return [("gain", f"|L1| = {spectral_norm(made['L1']):.4g}"), *gains, *timing(made), *linear(made)]


def timing(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Of samples, which y an estimate knows, and how far apart they are."""
    if "period" not in made:
        return []
    known = {"predicted": "xhat_k knows y_0 .. y_{k-1}", "filtered": "xhat_k knows y_0 .. y_k"}
    return [("estimate", f"{made['estimate']}: {known[made['estimate']]}"), ("period", f"{made['period']:g} s")]


def linear(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Figures of the linear error dynamics."""
    rows = [("poles", f"{', '.join(pole_text(p) for p in made['poles'])}   of the linear part, without f")]
    rows += time_constants(made)
    noise = ", ".join(f"{name} {value:.3g}" for name, value in made["noise_gain"].items())
    rows += [("noise gain", noise)] if noise else []
    rows += [("cond(P)", f"{made['condition_P']:.3g}")] if "condition_P" in made else []
    return rows


def time_constants(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """-period / ln|pole| of the slowest and the fastest pole in samples; in continuous time `fastest` says as much."""
    sizes = np.abs([complex(*pole) for pole in made["poles"]])
    if "period" not in made or not (sizes < 1).all():
        return []
    slow, fast = (-made["period"] / np.log(size) if size > GONE else 0.0 for size in (sizes.max(), sizes.min()))
    ends = f"{slow:.3g} s" if slow == fast else f"{slow:.3g} s to {fast:.3g} s"
    return [("time constants", f"{ends}   -period / ln|pole|")]


def reconstruction_text(bound: Mapping[str, float]) -> str:
    """Bound on the reconstruction error."""
    terms = zip(("w", "w_rate", "x_rate"), ("sup|w|", "sup|w'|", "sup|x'|"), strict=True)
    return "limsup |what - w| <= " + " + ".join(f"{at_most(bound[key], 4)} {norm}" for key, norm in terms if bound[key])
