"""Observers side by side, as text."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from obsdesign.families.guarantee import HELD

NOISE = "noise rms"
HEADER = ("observer", "type", "status", "order", "fastest 1/s", "estimate", "5 % s", "1 % s", NOISE, "floor")
NUMBERS = {"order", "fastest 1/s", "5 % s", "1 % s", NOISE, "floor"}  # columns that are aligned to the right
STARTS = "from 0"  # an error that is 0 at first, of which no part is a level

HOLDS = "not held"  # a level that the error comes below so late that the run does not show it stays there
MARK = "*"
TRANSIENT = f"{MARK} no floor: the error still falls over the window; a longer horizon leaves the transient out of it"


def comparison_table(report: Mapping[str, Any]) -> str:
    """One row an estimate of each observer."""
    rows = [row for observer in report["observers"] for row in rows_of(observer, report["plant"]["horizon"])]
    low, high = report["window"]
    seeds = len(report["seeds"])
    falling = any(observer["transient"] for observer in report["observers"])
    still, late = (any(word in row for row in rows) for word in (STARTS, HOLDS))
    quiet = not any(state["noise_rms"] != 0 for one in report["observers"] for state in one["states"].values())
    noise = f"noise rms: what noise adds to the estimate in the window, mean of {seeds} seeds +- deviation"
    notes = [
        "5 %, 1 %: time in s after which |error| without noise stays below that part of |error(0)|, if in this run",
        *([f"{HOLDS}: it is above that level as late as in the last twentieth of the run"] if late else []),
        *([f"{STARTS}: there is no initial error; peak of the error without noise instead"] if still else []),
        f"window: {low:.4g} to {high:.4g} s, the last 5/6 of the horizon",
        "no noise: the spec of the plant has no simulation.noise, so that nothing is told of it" if quiet else noise,
        "floor: rms of the error without noise in the window",
        *([TRANSIENT] if falling else []),
        *report["notes"],
        *(f"{one['label']}: {said_of(one)}".replace("; ", ";\n  ") for one in report["observers"]),
    ]
    table = [[cell for cell, name in zip(row, HEADER, strict=True) if name != NOISE or not quiet] for row in rows]
    header = [name for name in HEADER if name != NOISE or not quiet]
    return "\n".join([*columns([header, *table]), "", *notes])


def rows_of(observer: Mapping[str, Any], horizon: float) -> list[Sequence[str]]:
    """Rows of an observer; only the first says which it is."""
    fastest = "-" if observer["fastest"] is None else f"{observer['fastest']:.4g}"
    known: tuple[str, ...] = (observer["label"], observer["type"], observer["status"], str(observer["order"]), fastest)
    rows: list[Sequence[str]] = []
    for name, state in observer["states"].items():
        times = [HOLDS if (state[key] or 0) > HELD * horizon else number(state[key], "never") for key in ("t5", "t1")]
        if state["t5"] == 0:
            times = [STARTS, f"peak {state['peak']:.4g}"]
        spread = f" +- {state['noise_rms_std']:.1e}" if state["noise_rms"] else ""
        floor = number(state["floor"], "none") + (MARK if name in observer["transient"] else "")
        rows.append((*known, name, *times, number(state["noise_rms"], "none") + spread, floor))
        known = ("",) * len(known)
    return rows


def number(value: float | None, missing: str) -> str:
    """Number of a table."""
    return missing if value is None else f"{value:.4g}"


def columns(rows: Sequence[Sequence[str]], right: Collection[str] = ()) -> list[str]:
    """Aligned lines; `right`: further columns that are aligned to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = [str.rjust if name in NUMBERS or name in right else str.ljust for name in rows[0]]
    return [
        "  ".join(side(cell, width) for side, cell, width in zip(sides, row, widths, strict=True)).rstrip()
        for row in rows
    ]


def said_of(observer: Mapping[str, Any]) -> str:
    """What is proved of an observer, and whether its run reached the end, and stayed where that holds."""
    said, validity = [observer["claim"] or "no guarantee"], observer["validity"]
    if observer["run"] != "done":
        said.append(f"its run ended early: {observer['run']}")
    if validity and not validity["holds"]:
        said.append(validity["note"])
    return "; ".join(said)
