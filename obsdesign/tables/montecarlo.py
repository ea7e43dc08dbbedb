"""Many runs as text."""

from collections.abc import Mapping, Sequence
from typing import Any

from obsdesign.tables.text import aligned, at_most, checked_until, compared, plain, seed_range

MOST = 8  # seeds in a row


def montecarlo_table(report: Mapping[str, Any], files: tuple[str, str] | None = None) -> str:
    """What many runs say, and the files that their envelope is in."""
    beside = [] if files is None else [("envelope", files[0]), ("figure", files[1])]
    return aligned([*montecarlo_rows(report), *beside])


def montecarlo_rows(report: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Rows of a name and a text."""
    runs = report["runs"]
    rows = [("runs", f"{runs}, {seed_range(report)}")]
    rows += [("guarantee", report["no_guarantee"])] if "no_guarantee" in report else []
    rows += [("drawn", text) for text in drawn_texts(report["drawn"])]
    rows += [("bound" if bound["proved"] else "observed", bound_text(bound, runs)) for bound in report["bounds"]]
    rows += [("left out", f"in {one['runs']} of {runs} runs: {one['reason']}") for one in report["bounds_omitted"]]
    rows += [("error", f"{name}: {error_text(errors)}") for name, errors in report["errors"].items()]
    for key in ("escaped", "stalled", "stopped", "left_region"):
        if report[key] or key == "escaped":
            rows.append((key.replace("_", " "), seeds_text(report[key], runs)))
    rows += [("note", note) for note in report["notes"]]
    return [*rows, ("again", "one run of these: simulate with --set simulation.seed=SEED in place of --runs")]


def drawn_texts(drawn: Mapping[str, Any]) -> list[str]:
    """What differs from run to run."""
    width = ", ".join(f"{name} within {plain(w)}" for name, w in drawn["x0_width"].items())
    ranges = ", ".join(f"{name} {plain(low)} to {plain(high)}" for name, (low, high) in drawn["parameters"].items())
    return [
        *([f"x0: {width} of that of the spec"] if width else []),
        *([f"parameters of the plant: {ranges}"] if ranges else []),
        *(["measurement noise"] if drawn["noise"] else []),
        *(["intervals between measurements"] if drawn["intervals"] else []),
    ]


def bound_text(bound: Mapping[str, Any], runs: int) -> str:
    """One bound in all the runs of which it is stated, and in the worst one."""
    kept = f"{bound['kept']} of {bound['checked']} runs"
    kept += f", not stated of the other {runs - bound['checked']}" if bound["checked"] < runs else ""
    kept += f", {until}" if (until := checked_until(bound)) else ""
    verdict = "kept in" if not bound["proved"] else "holds in" if bound["holds"] else "VIOLATED, holds in"
    sign = compared(bound["value"], bound["bound"])
    worst = f"worst {bound['value']:.6g} {sign} {at_most(bound['bound'])} (seed {bound['seed']})"
    label = "" if bound["proved"] else "; no guarantee"
    return f"{verdict} {kept}, {worst}   {bound['name']}{label}"


def error_text(errors: Mapping[str, Any]) -> str:
    """Errors of one estimate."""
    if errors["rms"] is None:
        return "no run came to its end"
    worst = f"worst run {plain(errors['worst_rms'])} (seed {errors['worst_rms_seed']})"
    return f"rms {plain(errors['rms'])}, {worst}, peak {plain(errors['peak'])} (seed {errors['seed']})"


def seeds_text(seeds: Sequence[int], runs: int) -> str:
    """Some of the runs, by their seeds."""
    if not seeds:
        return "none"
    listed = ", ".join(map(str, seeds[:MOST])) + (", .." if len(seeds) > MOST else "")
    return f"{len(seeds)} of {runs}: seed{'s' * (len(seeds) > 1)} {listed}"
