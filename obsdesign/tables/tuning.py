"""What a log says of the numbers of a spec, as text."""

from collections.abc import Mapping, Sequence
from typing import Any

from obsdesign.tables.comparison import columns, number
from obsdesign.tables.estimates import ZERO, whiteness
from obsdesign.tables.text import aligned, plain

HEADER = ("innovation", "part", "rows", "rms before", "rms", "white before", "white")
PROVED = {
    "certified": "as the numbers in the file are, for which gains were found and certified; solve writes them",
    "no guarantee": "nothing: there is no guarantee of this type",
}


def tuning_table(report: Mapping[str, Any], file: str) -> str:
    """What was fitted, and how the outputs are predicted before and after, output by output."""
    old = report["before"]["values"]
    rows = [
        ("fitted", f"{key} {shown(old[key])} -> {shown(value)}{flatness(report['flat'].get(key))}")
        for key, value in report["fitted"].items()
    ]
    if report["kept"]:
        searched = ", ".join(report["searched"])
        rows = [
            ("kept", f"{searched} as before: nothing that was tried is better on the rows held back, but by chance")
        ]
    rows += [("end", f"{key}: the best is at an end of what was searched") for key in report["ends"]]
    worse = ", ".join(name for name in report["test"]["white"] if blurred(report, name))
    remark = f"; on the rows held back those of {worse} were white before and are not now" if worse else ""
    rows.append(("judged by", f"{report['criterion']} of the innovations, {report['trials']} settings tried{remark}"))
    rows.append(("proved", PROVED.get(report["status"], f"nothing: {report['status']}")))
    rows += [] if report["comments"] else [("comments", "lost: a changed key could not be replaced as it stood")]
    return "\n".join([*columns([HEADER, *innovations(report)]), "", aligned([*rows, ("spec", file)])])


def innovations(report: Mapping[str, Any]) -> list[list[str]]:
    """Rows of the innovations of each output in each part."""
    found = []
    for part in ("train", "test"):
        now, before = report[part], report["before"][part]
        for name, rms in now["innovation_rms"].items():
            sizes = [number(value, "none") for value in (before["innovation_rms"][name], rms)]
            p = [said(entry, name) for entry in (before, now)]
            found.append([name, part, f"{now['rows']:,}", *sizes, *p])
    return found


def flatness(ends: Sequence[Any] | None) -> str:
    """That a log does not tell a number, if it does not."""
    if not ends:
        return ""
    low, high = map(shown, ends)
    return f"; the log does not tell it: values from {low} to {high} predict as well"


def blurred(report: Mapping[str, Any], name: str) -> bool:
    """Whether innovations of an output were white on the rows held back, and are not any more."""
    before, now = (said(part, name) for part in (report["before"]["test"], report["test"]))
    return now == "no" and before not in {"no", "-"}


def shown(value: Any) -> str:
    """Value as a spec has it."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{name}: {shown(entry)}' for name, entry in value.items())}}}"
    return f"[{', '.join(map(shown, value))}]" if isinstance(value, list) else plain(value)


def said(part: Mapping[str, Any], name: str) -> str:
    """What the probability of a correlation of an output says, in a cell."""
    p = part["white"][name]
    if name in part.get("zero_to_rounding", ()):
        return ZERO
    if p is None:
        return "-"
    return "no" if whiteness(p) == "not white" else f"{p:.2g}"
