"""Estimates on a log as text."""

from collections.abc import Mapping
from typing import Any

from obsdesign.tables.text import aligned, plain

ZERO = "zero to rounding"  # of innovations
ENGINES = {"c": "C, compiled here", "numpy": "Python: gcc is not installed"}


def estimates_table(report: Mapping[str, Any], samples: str, figure: str) -> str:
    """What is said of a log, and the files that estimates and figure are in."""
    holes = f", {report['missing']:,} with something missing" if report["missing"] else ""
    rows = [("rows", f"{report['rows']:,}{holes}")]
    unused = f", {report['lost']:,} of them not used" if report.get("lost") else ""
    rows += (
        [("late", f"{report['late']:,} rows came after others that were made later{unused}")] if report["late"] else []
    )
    if stale := report.get("stale"):
        said = f"{stale['rows']:,} rows, y used up to {plain(stale['longest'])} s after its time"
        rows.append(("stale", f"{said}; nothing is proved from the first of them on"))
    gaps, waited = report.get("gaps"), report.get("waited")
    rows += [("gaps", f"{gaps:,} samples without a row, taken as rows without outputs")] if gaps else []
    if hole := report.get("holes"):
        number = f"{hole['count']:,} interval" + "s" * (hole["count"] > 1)
        said = f"{number} longer than 20 times the mean before, at most {plain(hole['longest'])} s, up to line"
        rows.append(("holes", f"{said} {hole['line']}; u and y go on there as hold says"))
    if waited:
        known = " and ".join(waited["for"])
        rows.append(("begins", f"at the first row with {known}; {waited['rows']:,} before it have no estimates"))
    counts = report.get("repaired", {}).items()
    rows += [("repaired", ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counts))] if counts else []
    steps = f", in steps of {plain(report['step'])} s, found by halving" if report["step"] else ""
    rows.append(("engine", f"{ENGINES[report['engine']]}{steps}"))
    for name, told in report["innovations"].items():
        if told["rms"] is None:
            rows.append(("innovation", f"{name}: never known"))
            continue
        white = "" if told["white"] is None else f", {whiteness(told['white'])}"
        white = f", {ZERO}" if "zero_to_rounding" in told else white
        rows.append(("innovation", f"{name}: mean {plain(told['mean'])}, rms {plain(told['rms'])}{white}"))
    rows += [("outlying", one["note"]) for one in report.get("outlying", ())]
    radius = report["radius"]
    rows.append(("radii", f"if {radius['premise']}" if "premise" in radius else f"none: {radius['none']}"))
    if count := report.get("contradicted"):
        said = "with a larger innovation than v_sup and e0 allow: the log contradicts these, or the plant of the spec"
        rows.append(("contradicted", f"{count:,} rows, from line {report['first_contradicted']['line']} on, {said}"))
    if report["uncovered"]:
        rows.append(("uncovered", f"{report['uncovered']:,} rows, of which nothing is proved (column covered)"))
    return aligned([*rows, ("estimates", samples), ("figure", figure or "none")])


def whiteness(p: float) -> str:
    """What the probability of a correlation says."""
    return f"white noise would be as correlated with probability {p:.2g}" if p >= 1e-3 else "not white"
