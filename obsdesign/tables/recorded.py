"""Observers side by side on a log, as text."""

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import Any

from obsdesign.tables.comparison import STARTS, columns, number
from obsdesign.tables.estimates import ZERO

KNOWN = ("observer", "type", "status", "order", "step us", "steps a row", "row us")
SEEN, TRUE = ("output", "innovation", "white"), ("estimate", "error rms", "5 % s", "1 % s")
RIGHT = ("innovation", "white", "error rms", "step us", "steps a row", "row us")


def recorded_table(report: Mapping[str, Any]) -> str:
    """Rows of each observer: one an output, and beside it one an estimate whose truth is known."""
    truth, (low, high) = report["data"]["truth"], report["window"]
    rows = [row for observer in report["observers"] for row in rows_of(observer, bool(truth))]
    notes = [
        f"log: {report['data']['file']}, {report['data']['rows']:,} rows; window: {low:.4g} to {high:.4g} s, "
        "the last 5/6 of it",
        "innovation: rms of y less what is expected of it, in the window; white: probability that white noise is as "
        "correlated",
        *(
            [
                "error rms: of the estimate less the truth of the log, in the window",
                f"5 %, 1 %: time in s after which |error| stays below that part of the first one, if in this log; "
                f"{STARTS}: that is none",
            ]
            if truth
            else ["no truth: no column is called as a state; --map STATE=COLUMN names one"]
        ),
        "step us, row us: CPU time of one step, and of all steps from a row to the next, in microseconds, reading left "
        "out; they differ between two runs",
        *(f"{one['label']}: {said_of(one)}".replace("; ", ";\n  ") for one in report["observers"]),
    ]
    return "\n".join([*columns([[*KNOWN, *SEEN, *(TRUE if truth else ())], *rows], RIGHT), "", *notes])


def rows_of(observer: Mapping[str, Any], truth: bool) -> list[Sequence[str]]:
    """Rows of an observer; only the first says which it is."""
    times = ["-"] * 3
    if observer["time_s"] is not None:
        times = [micro(observer["time_s"]), f"{observer['steps_a_row']:.4g}", micro(observer["row_s"])]
    known = (observer["label"], observer["type"], observer["status"], str(observer["order"]), *times)
    zero = observer.get("zero_to_rounding", ())
    seen = [
        (name, number(rms, "none"), ZERO if name in zero else white(observer["white"][name]))
        for name, rms in observer["innovation_rms"].items()
    ]
    errors = [
        (name, number(one["error_rms"], "none"), *(settled(one[key]) for key in ("t5", "t1")))
        for name, one in observer["states"].items()
    ]
    rows: list[Sequence[str]] = []
    for k, (one, error) in enumerate(zip_longest(seen, errors, fillvalue=None)):
        begin = known if k == 0 else ("",) * len(known)
        rows.append([*begin, *(one or ("",) * len(SEEN)), *((error or ("",) * len(TRUE)) if truth else ())])
    return rows


def micro(time: float) -> str:
    """Time in s as microseconds."""
    return f"{1e6 * time:.3g}"


def settled(time: float | None) -> str:
    """Settling time in a table."""
    return STARTS if time == 0 else number(time, "never")


def white(p: float | None) -> str:
    """Probability in a table."""
    return "-" if p is None else f"{p:.2g}" if p >= 1e-3 else "no"


def said_of(observer: Mapping[str, Any]) -> str:
    """What is proved of an observer, and whether it reached the end of the log."""
    said = [observer["claim"] or "no guarantee"]
    if observer["run"] != "done":
        said.append(f"it ended early: {observer['run']}")
    if observer["claim"] and observer["uncovered"]:
        said.append(f"of {observer['uncovered']:,} rows nothing is proved")
    return "; ".join(said)
