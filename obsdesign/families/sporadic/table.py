"""Gains for sporadic measurements as text."""

from collections.abc import Iterator, Mapping
from typing import Any

from obsdesign.families.sporadic.certificate import span, told
from obsdesign.families.sporadic.clock.claim import MEANING
from obsdesign.lmi.formula import printed
from obsdesign.tables.text import UNBOUNDED, at_least, at_most, gamma_text, matrix_text, rate_text, spectral_norm


def proved(_: Mapping[str, Any], claimed: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What is proved of the gains L and H."""
    w = "v" if "|v|_2" in claimed["statement"] else "w"
    rows = [("gamma", gamma_text(claimed, MEANING.format(w=w)))]
    rows += [("decay rate", rate_text(claimed["decay"], claimed.get("statement", "")))]
    T1, T2 = (printed(claimed[name]) for name in ("T1", "T2"))
    rows += [("intervals", f"{span(T1, T2)}{told(', a jitter of {} %', T1, T2)}")]
    size = "|e|" if "|(e, d)|" not in claimed["statement"] else "|(e, d)|"
    rows += [("noise", f"{at_most(claimed['noise'], 4)} sup|eta| at most in {size}")] if "noise" in claimed else []
    rows += [("tolerated", f"T2 up to {at_least(claimed['T2_max'])} s")] if "T2_max" in claimed else []
    return rows


def figures(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Gains for sporadic measurements, and how they contract the error over one interval."""
    known = ", ".join(f"{k:.3g} over {name}" for name, k in made["contraction"].items() if k is not None)
    said = f"{known}   the slowest that was found of f = K q of the types" if known else UNBOUNDED
    rows = [*gains(made), *([("delta", f"{made['delta']:g} 1/s")] if "delta" in made else []), ("contraction", said)]
    apart = " or ".join(made["multipliers"])
    noise = ", ".join(f"{name} {gain:.3g}" for name, gain in made["noise_gain"].items())
    return rows + ([("noise gain", f"{noise}   at the measurements, {apart} apart")] if noise else [])


def gains(made: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Size and entries of the gains; of one that depends on the interval those at its ends."""
    if "K_of_gap" in made:
        segments = made["K_of_gap"]["K"]
        yield "gain", f"|K| at most {max(spectral_norm(K) for segment in segments for K in segment):.4g}"
        yield "K after T1", matrix_text(segments[0][0])
        yield "K after T2", matrix_text(segments[-1][-1])
        return
    name = "K" if "K" in made else "L"
    yield "gain", f"|{name}| = {spectral_norm(made[name]):.4g}"
    yield from ((key, matrix_text(made[key])) for key in ("L", "H", "K") if key in made)
