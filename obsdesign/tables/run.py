"""Runs as text."""

from collections.abc import Mapping
from typing import Any

from obsdesign.families.guarantee import HELD
from obsdesign.spec import Spec
from obsdesign.tables.text import aligned, at_most, compared, plain

BOUNDS = ("gamma", "bound")
MEANT = {  # unit or definition of a number of a run, after it
    "time": "s",
    "initial_error": "  |e(0)|, of all states",
    "final_error": "  |e| at the end",
}


def run_table(summary: Mapping[str, Any], spec: Spec, guaranteed: bool, files: tuple[str, str]) -> str:
    """Summary of a run, and the files that it is in."""
    return aligned([*run_rows(summary, spec, guaranteed), ("samples", files[0]), ("figure", files[1])])


def run_rows(summary: Mapping[str, Any], spec: Spec, guaranteed: bool) -> list[tuple[str, str]]:
    """Summary of a run, as rows of a name and a text; whether anything is proved of it is said where nothing is."""
    said = spec.signals
    rows = [("signals", said)] if said else []
    rows += (
        [("input", f"simulation.u.{u} is not given; 0 is used") for u in spec.simulation.silent]
        if spec.simulation
        else []
    )
    without = "no guarantee: nothing is proved of these gains with this plant"
    why = summary.get("no_guarantee", "" if guaranteed else without)
    rows += [("guarantee", why)] if why else []
    told = {"no_guarantee", *(["bounds_omitted"] if summary.get("bounds_omitted") == why else [])}
    texts = {"bounds": ("bound", bound_text), "observed": ("observed", observed_text)}
    for key, value in ((key, value) for key, value in summary.items() if key not in told):
        if key in texts:
            name, text_of = texts[key]
            rows += [(name, text_of(bound)) for bound in value]
        elif key == "status":
            rows.append(
                (key, value if value == "done" else f"{value} at t = {summary['time']:.6g} s: computed until then")
            )
        elif key == "ratio":
            rows += [] if value is None else [("ratio", f"{plain(value)}   {summary['ratio_of']}{related(summary)}")]
        elif "_norm2" in key:
            letter = "z" if key.startswith("z") else spec.observer.drive
            span = "for all t >= 0" if key.endswith("infinite") else "over the run"
            rows += [] if value is None else [(f"{letter} norm2", f"{plain(value)}   {span}")]
        elif key == "settling":
            rows += [("settling", f"{name}: {settling_text(times, summary['time'])}") for name, times in value.items()]
        elif key == "bounds_omitted" and value is not None:
            rows.append(("left out", value))
        elif key == "guard":
            rows += [(key, guarded(name, acts)) for name, acts in value.items()]
        elif key == "reconstruction":
            rows.append((key, reconstructed(value)))
        elif key == "validity":
            rows.append(("region", value["note"]))
        elif isinstance(value, Mapping):
            rows.append(several(key, value))
        elif key == "settling_time" or (value is not None and key != "ratio_of"):
            text = settled(value, summary["time"]) if key == "settling_time" else shown(key, value)
            rows.append((key.replace("_", " "), text))
    return rows


def several(key: str, values: Mapping[str, Any]) -> tuple[str, str]:
    """Row of several values."""
    if key == "worst_peak":
        return "largest error", f"{plain(values['value'])} of {values['name']}, at t = {values['time']:.4g} s"
    return key.replace("_", " "), entries(values)


def related(summary: Mapping[str, Any]) -> str:
    """What gamma says of the ratio of the norms of a run, if it says it of all of the run."""
    if summary["gamma"] is None or summary["bounds_omitted"]:
        return ""
    if "initial_eps" in summary:
        return "; at most gamma from eps(0) = 0" + (
            ", and this run begins with another" if summary["initial_eps"] else ""
        )
    offset = summary.get("initial_distance", summary["initial_error"])
    return "; at most gamma from zero error" + (", and this run begins with an error" if offset else "")


def reconstructed(found: Mapping[str, Any]) -> str:
    """Accuracy of an unknown input that is reconstructed, and what bounds it."""
    late, peak = (plain(found[key]) for key in ("limsup", "peak"))
    parts = [f"|what - w| is at most {late} in the last fifth of the run, {peak} at its peak"]
    if "bound" in found:
        left = at_most(found["transient_left"], 3)
        parts.append(
            f"at most {at_most(found['bound'])} for t -> infinity is proved, and {left} of the transient is left"
        )
        known = {"w_sup": "sup|w|", "w_rate_sup": "sup|w'|", "x_rate_sup": "sup|x'|"}
        parts.append(", ".join(f"{name} {plain(found[key])}" for key, name in known.items()))
    return "; ".join([*parts, *([found["note"]] if "note" in found else [])])


def guarded(name: str, acts: Mapping[str, Any]) -> str:
    """How often an estimate was kept from its end, and whether it still is."""
    count = acts["activations"]
    if not count:
        return f"{name}: never acts"
    times = f"acts {count} time{'s' * (count > 1)}, for {acts['share']:.2%} of the run"
    return f"{name}: {times}{', at its end too: the estimate is not to be believed there' * acts['at_end']}"


def entries(values: Mapping[str, Any]) -> str:
    """Keys and values in one line, and a note at its end."""
    text = ", ".join(f"{key.replace('_', ' ')} {shown(key, value)}" for key, value in values.items() if key != "note")
    return f"{text}; {values['note']}" if "note" in values else text


def shown(key: str, value: Any) -> str:
    """Value in a table, with what it means; of what bounds a run an upper bound."""
    text = at_most(value) if key in BOUNDS and value is not None else plain(value)
    return f"{text} {MEANT[key]}" if key in MEANT else text


def settled(time: float | None, end: float) -> str:
    """When the error of all states has come within 1 % of its largest for good, if that is seen."""
    if time is None:
        return "not in this run: |e| is above 1 % of its largest at the end"
    if time > HELD * end:
        return f"not held before the end: |e| is above 1 % of its largest until {time:.4g} s"
    return f"{plain(time)} s   after that |e| stays below 1 % of its largest"


def settling_text(times: Mapping[str, float | None], end: float) -> str:
    """When an estimate has come within 5 % and 1 % of its initial error for good, if it has and if there was one."""
    if times["t5"] == 0:
        return f"starts at 0, |error| at most {times['peak']:.4g}"
    told = (f"below {share} % {reached(times[f't{share}'], end)}" for share in (5, 1))
    return f"|error| stays {', '.join(told)}   of |error(0)|"


def reached(time: float | None, end: float) -> str:
    """When a level was reached for good; what only the last twentieth of a run keeps is not seen to be kept."""
    if time is None:
        return "never"
    return f"after {time:.4g} s" if time <= HELD * end else "not held before the end"


def observed_text(bound: Mapping[str, Any]) -> str:
    """One bound that is proved of another plant, against the run."""
    said, value, limit = "kept" if bound["holds"] else "not kept", bound["value"], bound["bound"]
    told = f"{value:.6g} {compared(value, limit)} {at_most(limit)}   {bound['name']}; no guarantee"
    return f"{said}{until_text(bound)}: {told}"


def bound_text(bound: Mapping[str, Any]) -> str:
    """One bound of a guarantee against the run; where it is met by the accuracy of the run alone, with that."""
    verdict = "holds" if bound["holds"] else "VIOLATED"
    within = f" + {at_most(bound['accuracy'], 2)}, the accuracy of the run" if bound["value"] > bound["bound"] else ""
    return f"{verdict}{until_text(bound)}: {bound['value']:.6g} <= {at_most(bound['bound'])}{within}   {bound['name']}"


def until_text(bound: Mapping[str, Any]) -> str:
    """Until when a bound was checked, where that is not the end of the run; otherwise nothing."""
    return f" until t = {bound['until']:.4g} s" if "until" in bound else ""
