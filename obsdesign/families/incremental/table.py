"""Gains L1 and L2 as text, and figures of any gain."""

from collections.abc import Iterator, Mapping
from typing import Any

from obsdesign.families.incremental.theorems import THEOREMS
from obsdesign.tables.text import matrix_text, pole_text, spectral_norm


def claim(claimed: Mapping[str, Any], family: str) -> list[tuple[str, str]]:
    """What is proved of the gains L1 and L2."""
    if "gamma" not in claimed:
        return []
    rows = [("gamma", f"{claimed['gamma']:g}   {THEOREMS[family].meaning}")]
    rows += [("decay rate", f"{claimed['alpha']:g} 1/s")]
    if "reconstruction" in claimed:
        rows += [("reconstruction", reconstruction_text(claimed["reconstruction"]))]
    return rows


def gains(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What an engineer asks first of the gains L1 and L2."""
    return [("gain", f"|L1| = {spectral_norm(made['L1']):.4g}"), ("L2", matrix_text(made["L2"])), *linear(made)]


def linear(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Figures of the linear error dynamics."""
    rows = [("poles", ", ".join(pole_text(p) for p in made["poles"]))]
    rows += [("largest step", f"{made['largest_step']:.3g} s (Runge-Kutta 4)")] if "largest_step" in made else []
    noise = ", ".join(f"{name} {value:.3g}" for name, value in made["noise_gain"].items())
    rows += [("noise gain", noise)] if noise else []
    rows += [("cond(P)", f"{made['condition_P']:.3g}")] if "condition_P" in made else []
    return rows


def reconstruction_text(bound: Mapping[str, float]) -> str:
    """Bound on the reconstruction error."""
    terms = zip(("w", "w_rate", "x_rate"), ("sup|w|", "sup|w'|", "sup|x'|"), strict=True)
    return "limsup |what - w| <= " + " + ".join(f"{bound[key]:.4g} {norm}" for key, norm in terms if bound[key])


def curves(search: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Points of a search, or of each of its curves."""
    parameter = search.get("parameter", "alpha")
    for curve in search.get("curves", [{"points": search.get("points", [])}]):
        if "injection" in curve:
            yield "curve", f"{curve['injection']}, {curve['relaxation']}"
        yield from (("curve", f"{parameter} {p[parameter]:<10.4g} {shown(p)}") for p in curve["points"])


def shown(point: Mapping[str, Any]) -> str:
    """One point of a curve."""
    if "gamma" not in point:
        return f"T2 {point['T2']:.6g}" if "T2" in point and "decay" in point else str(point["status"])
    proved = point.get("certified")
    return f"gamma {point['gamma']:.6g}" + (
        f"   certified {proved['gamma']:.6g}, |L| = {proved['L']:.4g}" if proved else ""
    )
