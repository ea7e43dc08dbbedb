"""A batch in lines: none begins with what a spec or its path says, nor holds what a terminal would obey."""

import json
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import TYPE_CHECKING, Any

from obsdesign.batches.find import titled
from obsdesign.batches.form import STATUSES, Entry
from obsdesign.errors import LOGGED, NOT_ONE_LINE
from obsdesign.sections.values import counted
from obsdesign.tables.text import safe

if TYPE_CHECKING:
    from obsdesign.batches.summary import Summary

MARKS = {True: "ok  ", False: "FAIL", None: "-   "}
COLUMN = max(map(len, STATUSES))
NUMBERS = 3  # of a guarantee, its first
UNMET = "OBS617"  # id of an expectation that does not hold
LONGEST = 100  # characters of a path to which the others are aligned


def shown(text: str) -> str:
    """Text for one line of a terminal or of a log: what would be obeyed there is written out."""
    plain = NOT_ONE_LINE.sub(lambda found: json.dumps(found[0])[1:-1], text)
    return LOGGED.sub(r"#\\u0023", plain)


def line(entry: Entry, width: int = 0) -> str:
    """One spec: whether it is as expected, its status, its path, what is guaranteed, s it took, what is as recorded."""
    told = ", ".join(f"{name} {safe(name, value)}" for name, value in islice(entry["guarantee"].items(), NUMBERS))
    path = title(entry)
    time = "up to date" if entry["up_to_date"] else f"{entry['time_s']:.1f} s" if entry["time_s"] else ""
    parts = (MARKS[entry["as_expected"]], f"{entry['status']:{COLUMN}}", f"{path:{width}}", f"{time:>10}", told)
    mark = f"  ({remark(entry)})" if entry["recorded"] else ""
    return "  ".join(parts).rstrip() + mark


def remark(entry: Entry) -> str:
    """Which expectations of a result that is up to date nothing proves again, nor refutes."""
    return f"as recorded, not found again: {shown(', '.join(entry['recorded']))}"


def title(entry: Entry) -> str:
    """Path of a spec and its changes."""
    return shown(titled(entry["path"], entry["set"]))


def complaints(entry: Entry) -> Iterator[str]:
    """What is wrong with a spec that is not as expected, a line each."""
    for problem in entry["problems"] if entry["as_expected"] is False else ():
        yield f"{label(entry, problem)}: {shown(sentence(problem) + changed(entry))}"


def label(entry: Entry, problem: Mapping[str, Any]) -> str:
    """What a problem makes of a spec: its status, or that it is not as expected where it did not end for that."""
    return "not as expected" if problem["id"] == UNMET or entry["status"] == "certified" else str(entry["status"])


def changed(entry: Entry) -> str:
    """What was changed in a spec, behind a sentence on it."""
    return f" (--set {' --set '.join(entry['set'])})" if entry["set"] else ""


def sentence(problem: Mapping[str, Any]) -> str:
    """Problem as any command prints it."""
    place = ":".join(str(problem[key]) for key in ("file", "line", "column") if key in problem)
    said = ": ".join(part for part in (place, problem.get("key"), problem["message"]) if part)
    return f"{said} [{problem['id']}]"


def rows(summary: "Summary") -> Iterator[str]:
    """Table of a batch, and a last line on all of it."""
    width = min(max((len(title(entry)) for entry in summary.specs), default=0), LONGEST)
    done, believed = 0, list[int]()
    for entry in summary.specs:
        done += bool(entry["up_to_date"])
        believed += [len(entry["recorded"])] if entry["recorded"] else []
        yield line(entry, width)
    counts = summary.counts
    kinds = ", ".join(f"{counts[status]} {status}" for status in STATUSES if counts[status])
    fine, asked = counts["as_expected"], counts["total"] - counts["skipped"]
    said = "all as expected" if fine == asked else f"{asked - fine} not as expected"
    again = f", {done} up to date: what is proved was proved anew, the rest is as recorded" if done else ""
    again += f"; {as_recorded(sum(believed), len(believed))}" if believed else ""
    again += ", and nothing is said of what was skipped" if counts["skipped"] and asked else ""
    yield f"specs {counts['total']}: {kinds or 'none'}; {said}{again}; {summary.time_s:.1f} s; {shown(summary.path)}"


def as_recorded(expectations: int, results: int) -> str:
    """How many expectations, of how many results, are held against what nobody proves again; and what would."""
    held = f"{counted(expectations, 'expectation')} of {counted(results, 'result')}"
    verb, it = ("is", "it") if expectations == 1 else ("are", "them")
    return f"{held} {verb} held against what is recorded, not found again: --force computes {it}"
