"""Runs as text."""

from collections.abc import Mapping
from typing import Any

from obsdesign.tables.text import aligned, at_most, plain

BOUNDS = ("gamma", "bound")


def run_table(summary: Mapping[str, Any], guaranteed: bool, files: tuple[str, str]) -> str:
    """Summary of a run."""
    rows = [] if guaranteed else [("guarantee", "no guarantee: nothing is proved of these gains with this plant")]
    for key, value in summary.items():
        if key == "bounds":
            rows += [("bound", bound_text(bound)) for bound in value]
        elif key == "ratio":
            rows += [] if value is None else [("ratio", f"{plain(value)}   {summary['ratio_of']}")]
        elif key.endswith("_norm2") and value is not None:
            rows.append((key.replace("_", " "), f"{plain(value)}   over the run"))
        elif key == "settling":
            rows += [("settling", f"{name}: {settling_text(times)}") for name, times in value.items()]
        elif key == "validity":
            rows.append(("region", value["note"]))
        elif isinstance(value, Mapping):
            rows.append((key.replace("_", " "), entries(value)))
        elif value is not None and key != "ratio_of":
            rows.append((key.replace("_", " "), shown(key, value)))
    return aligned([*rows, ("samples", files[0]), ("figure", files[1])])


def entries(values: Mapping[str, Any]) -> str:
    """Keys and values in one line, and a note at its end."""
    text = ", ".join(f"{key.replace('_', ' ')} {shown(key, value)}" for key, value in values.items() if key != "note")
    return f"{text}; {values['note']}" if "note" in values else text


def shown(key: str, value: Any) -> str:
    """Value in a table; of what bounds a run an upper bound."""
    return at_most(value) if key in BOUNDS and value is not None else plain(value)


def settling_text(times: Mapping[str, float | None]) -> str:
    """When an estimate has come within 5 % and 1 % of its initial error for good, if it has."""
    known = {key.removeprefix("t"): "not reached" if t is None else f"{t:.4g} s" for key, t in times.items()}
    return ", ".join(f"{share} % {text}" for share, text in known.items()) + " (of the initial error)"


def bound_text(bound: Mapping[str, Any]) -> str:
    """One bound of a guarantee against the run; where it is met by the accuracy of the run alone, with that."""
    verdict = "holds" if bound["holds"] else "VIOLATED"
    within = f" + {at_most(bound['accuracy'], 2)}, the accuracy of the run" if bound["value"] > bound["bound"] else ""
    return f"{verdict}: {bound['value']:.6g} <= {at_most(bound['bound'])}{within}   {bound['name']}"
