"""Results and runs as text for a terminal."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from obsdesign.observers import FAMILIES
from obsdesign.observers.sporadic_certificate import MEANING


def design_table(content: Mapping[str, Any], target: str) -> str:
    """What an engineer wants to know of a result, one line each."""
    rows = [("problem", content["name"]), ("status", content["status"])]
    claimed, made = content.get("guarantee", {}), content.get("observer", {})
    if made:
        rows += sporadic_claim(claimed) if made["type"] == "sporadic" else claim(claimed, made)
    for key in ("limit", "limit_bounded"):
        numbers = ", ".join(f"{k} {v:.6g}" for k, v in claimed.get(key, {}).items() if k != "attained")
        rows += [(key.replace("_", " "), numbers)] if numbers else []
    if made:
        rows += sporadic_gains(made) if made["type"] == "sporadic" else gains(made)
    for check_ in content.get("certificate", {}).get("checks", []):
        rows.append(("proved" if check_["holds"] else "NOT PROVED", check_["name"]))
    if "diagnosis" in content:
        rows += [(k, str(v)) for k, v in content["diagnosis"].items() if k in {"reason", "suggestion"}]
    rows += list(curve_rows(content.get("search", {})))
    rows += [("note", note) for note in content.get("notes", [])]
    return aligned([*rows, ("file", target)])


def claim(claimed: Mapping[str, Any], made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What is proved of the gains L1 and L2."""
    if "gamma" not in claimed:
        return []
    rows = [("gamma", f"{claimed['gamma']:g}   {FAMILIES[made['type']].meaning}")]
    rows += [("decay rate", f"{claimed['alpha']:g} 1/s")]
    if "reconstruction" in claimed:
        rows += [("reconstruction", reconstruction_text(claimed["reconstruction"]))]
    return rows


def gains(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What an engineer asks first of the gains L1 and L2."""
    rows = [("gain", f"|L1| = {spectral_norm(made['L1']):.4g}"), ("L2", matrix_text(made["L2"]))]
    rows += [("poles", ", ".join(pole_text(p) for p in made["poles"]))]
    rows += [("largest step", f"{made['largest_step']:.3g} s (Runge-Kutta 4)")] if "largest_step" in made else []
    noise = ", ".join(f"{name} {value:.3g}" for name, value in made["noise_gain"].items())
    rows += [("noise gain", noise)] if noise else []
    rows += [("cond(P)", f"{made['condition_P']:.3g}")] if "condition_P" in made else []
    return rows


def sporadic_claim(claimed: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What is proved of the gains L and H."""
    rows = [("gamma", f"{claimed['gamma']:g}   {MEANING}")]
    rows += [("decay rate", f"{claimed['decay']:g} 1/s")]
    rows += [("intervals", f"{claimed['T1']:g} to {claimed['T2']:g} s, a jitter of {100 * claimed['jitter']:.3g} %")]
    rows += [("noise", f"{claimed['noise']:.4g} sup|eta| at most in |(e, d)|")] if "noise" in claimed else []
    rows += [("tolerated", f"T2 up to {claimed['T2_max']:g} s")] if "T2_max" in claimed else []
    return rows


def sporadic_gains(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Gains for sporadic measurements, and how they contract the error over one interval."""
    rows = [
        ("gain", f"|L| = {spectral_norm(made['L']):.4g}"),
        ("L", matrix_text(made["L"])),
        ("H", matrix_text(made["H"])),
    ]
    contraction = ", ".join(
        f"{abs(complex(*values[0])):.3g} over {name}" for name, values in made["multipliers"].items()
    )
    return [*rows, ("delta", f"{made['delta']:g} 1/s"), ("contraction", f"{contraction} (linear part)")]


def curve_rows(search: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Points of a search, or of each of its curves."""
    parameter = search.get("parameter", "alpha")
    for curve in search.get("curves", [{"points": search.get("points", [])}]):
        if "injection" in curve:
            yield "curve", f"{curve['injection']}, {curve['relaxation']}"
        yield from (("curve", f"{parameter} {p[parameter]:<10.4g} {shown(p)}") for p in curve["points"])


def reconstruction_text(bound: Mapping[str, float]) -> str:
    """Bound on the reconstruction error."""
    terms = zip(("w", "w_rate", "x_rate"), ("sup|w|", "sup|w'|", "sup|x'|"), strict=True)
    return "limsup |what - w| <= " + " + ".join(f"{bound[key]:.4g} {norm}" for key, norm in terms if bound[key])


def shown(point: Mapping[str, Any]) -> str:
    """One point of a curve."""
    if "gamma" not in point:
        return f"T2 {point['T2']:.6g}" if "T2" in point and "decay" in point else str(point["status"])
    proved = point.get("certified")
    return f"gamma {point['gamma']:.6g}" + (
        f"   certified {proved['gamma']:.6g}, |L| = {proved['L']:.4g}" if proved else ""
    )


def run_table(summary: Mapping[str, Any], guaranteed: bool, files: tuple[str, str]) -> str:
    """Summary of a run."""
    rows = [] if guaranteed else [("guarantee", "no guarantee: these gains are not certified")]
    for key, value in summary.items():
        if key == "bounds":
            rows += [("bound", bound_text(bound)) for bound in value]
        elif key == "ratio":
            rows += [] if value is None else [("ratio", f"{plain(value)}   {summary['ratio_of']}")]
        elif key == "validity":
            rows.append(("region", value["note"]))
        elif isinstance(value, Mapping):
            rows.append((key.replace("_", " "), entries(value)))
        elif value is not None and key != "ratio_of":
            rows.append((key.replace("_", " "), plain(value)))
    return aligned([*rows, ("samples", files[0]), ("figure", files[1])])


def entries(values: Mapping[str, Any]) -> str:
    """Keys and values in one line, and a note at its end."""
    text = ", ".join(f"{key.replace('_', ' ')} {plain(value)}" for key, value in values.items() if key != "note")
    return f"{text}; {values['note']}" if "note" in values else text


def bound_text(bound: Mapping[str, Any]) -> str:
    """One bound of a guarantee against the run."""
    verdict = "holds" if bound["holds"] else "VIOLATED"
    return f"{verdict}: {bound['value']:.6g} <= {bound['bound']:.6g}   {bound['name']}"


def plain(value: Any) -> str:
    """Value in a table."""
    if isinstance(value, float):
        return f"{value:.6g}"
    return ", ".join(map(plain, value)) if isinstance(value, list | tuple) else str(value)


def aligned(rows: list[tuple[str, str]]) -> str:
    """Two columns."""
    width = max(len(key) for key, _ in rows)
    return "\n".join(f"{key:<{width}}  {value}" for key, value in rows)


def matrix_text(rows: list[list[float]]) -> str:
    """Small matrix in one line."""
    return "[" + ", ".join("[" + ", ".join(f"{x:g}" for x in row) + "]" for row in rows) + "]"


def pole_text(pole: list[float]) -> str:
    """Pole in 1/s."""
    real, imaginary = pole
    return f"{real:.4g}" if imaginary == 0 else f"{real:.4g}{imaginary:+.4g}j"


def spectral_norm(rows: list[list[float]]) -> float:
    """Spectral norm of a matrix."""
    return float(np.linalg.norm(np.array(rows), 2))
