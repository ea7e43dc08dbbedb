"""Rows, matrices and numbers as text."""

import decimal
from collections.abc import Mapping
from typing import Any

import numpy as np
from flint import fmpq

FROM_ABOVE = (  # numbers of a guarantee that are proved from above; the others are from below
    *("gamma", "gamma_v", "rho", "mu2", "mu", "overshoot", "initial", "disturbance", "noise", "growth", "T1"),
    *("w", "w_rate", "x_rate"),
)

UNBOUNDED = "not told: slopes of f are not bounded, or not all their matrices are known"

UNSTABLE = "not told: there is no stable pole to bound it"


def aligned(rows: list[tuple[str, str]]) -> str:
    """Two columns."""
    width = max(len(key) for key, _ in rows)
    return "\n".join(f"{key:<{width}}  {value}" for key, value in rows)


def at_most(x: float | fmpq, digits: int = 6) -> str:
    """Smallest decimal of so many significant digits that is not below x: how an upper bound is shown.

    A double is the decimal that prints it.
    """
    return directed(x, digits, decimal.ROUND_CEILING)


def at_least(x: float | fmpq, digits: int = 6) -> str:
    """Largest decimal of so many significant digits that is not above x: how a lower bound is shown."""
    return directed(x, digits, decimal.ROUND_FLOOR)


def safe(name: str, value: float, digits: int = 6) -> str:
    """Number of a guarantee, by its name, on the side that claims no more than is proved."""
    return (at_most if name in FROM_ABOVE else at_least)(value, digits)


def directed(x: float | fmpq, digits: int, rounding: str) -> str:
    """Shortest text of a number that is rounded in one direction."""
    with decimal.localcontext(prec=digits, rounding=rounding):
        above, below = (x.p, x.q) if isinstance(x, fmpq) else (repr(float(x)), 1)
        found = decimal.Decimal(str(above)) / decimal.Decimal(str(below))
    text = f"{float(found):.{digits}g}"
    return text if decimal.Decimal(text) == found else f"{found:g}"  # beyond the normal numbers of doubles


def compared(value: float, bound: float) -> str:
    """Sign between a value and what it should not exceed."""
    return ">" if value > bound else "<="


def gamma_text(claimed: Mapping[str, Any], meaning: str) -> str:
    """Level that is proved, with its meaning, and whether it was sought at all."""
    limit = {**claimed.get("limit", {}), **claimed.get("limit_bounded", {})}
    other = "gamma" not in limit and not {"lipschitz", "alpha", "rho", "T2", "decay"}.isdisjoint(limit)
    return f"{at_most(claimed['gamma'])}   {meaning}{'; it was not minimised' if other else ''}"


def rate_text(rate: float, statement: str) -> str:
    """Decay rate that is proved; where it is 0, whether the statement says that the error vanishes all the same."""
    if rate:
        return f"{at_least(rate)} 1/s"
    vanishes = any(words in statement for words in ("-> 0", "exp(-"))
    said = "e(t) -> 0 without a disturbance" if vanishes else "nothing says that e(t) -> 0"
    return f"0 1/s   {said}; no rate is claimed"


def decay_rows(claimed: Mapping[str, Any], key: str = "alpha") -> list[tuple[str, str]]:
    """Decay that is proved: a rate, by its key, or in samples rho, and alpha where there is one."""
    if "rho" not in claimed:
        return [("decay rate", rate_text(claimed[key], claimed.get("statement", "")))]
    rho = claimed["rho"]
    said = "a sample: |e_k| <= c rho^k |e_0| without a disturbance"
    if rho == 1:
        vanishing = "e_k" if "e_k -> 0" in claimed.get("statement", "") else "z_k"
        said = f"a sample: {vanishing} -> 0 without a disturbance; no decay is claimed"
    alpha = [("alpha", f"{at_least(claimed['alpha'])} per second   -ln(rho) / period")] if claimed.get("alpha") else []
    return [("rho", f"{at_most(rho)} {said}"), *alpha]


def plain(value: Any) -> str:
    """Value in a table."""
    if isinstance(value, float):
        return f"{value:.6g}"
    return ", ".join(map(plain, value)) if isinstance(value, list | tuple) else str(value)


def matrix_text(rows: list[list[float]]) -> str:
    """Small matrix in one line."""
    return "[" + ", ".join("[" + ", ".join(f"{x:g}" for x in row) + "]" for row in rows) + "]"


def pole_text(pole: list[float]) -> str:
    """Pole, in 1/s or of samples."""
    real, imaginary = pole
    return f"{real:.4g}" if imaginary == 0 else f"{real:.4g}{imaginary:+.4g}j"


def spectral_norm(rows: list[list[float]]) -> float:
    """Spectral norm of a matrix."""
    return float(np.linalg.norm(np.array(rows), 2))


def limit_text(limit: Mapping[str, Any]) -> str:
    """One limit."""
    numbers = [f"{k} {v:.6g}" for k, v in limit.items() if k not in {"attained", "unbounded", "kind", "at", "gap"}]
    said = [", ".join([*(["unbounded"] if limit.get("unbounded") else []), *numbers])]
    said += [", ".join(f"at {key} {value:.6g}" for key, value in limit["at"].items())] if "at" in limit else []
    said += ["the best that was found"] if limit.get("kind") == "best-found" else []
    return "   ".join(said)


def seed_range(report: Mapping[str, Any]) -> str:
    """Seeds of the runs."""
    first, last = report["seed"], report["seed"] + report["runs"] - 1
    return f"seed {first}" if first == last else f"seeds {first} to {last}"


def checked_until(bound: Mapping[str, Any]) -> str:
    """Until when a bound was checked, where that is not the end of every run; otherwise nothing."""
    if not (cut := bound["cut"]):
        return ""
    who = "each until it" if cut == bound["checked"] else f"in {cut} of these only until {'they' if cut > 1 else 'it'}"
    first = "earliest " if cut > 1 else ""
    return f"{who} {' or '.join(bound['cut_by'])} ({first}t = {bound['until']:.4g} s)"
