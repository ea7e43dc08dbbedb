"""The form of an entry, held on whatever is read from a disk: anyone may have written it."""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from obsdesign.errors import EXIT, NOT_ONE_LINE

STATUSES = (
    "certified",
    "infeasible",
    "refuted",
    "uncertified",
    "invalid",
    "timeout",
    "memory",
    "crashed",
    "skipped",
)
CLAIMS = ("certified", "refuted")  # statuses that hold only with a proof
KINDS = ("gains", "csv", "png")  # files of a spec
CODES = (0, 1, 2, 3, 4)  # exit codes of a spec
Entry = dict[str, Any]  # of `specs` in a summary


def parsed(raw: bytes) -> Any:
    """JSON each number of which is a finite double, or an integer that has one. Raises `ValueError`: it is none."""
    try:
        return json.loads(raw, parse_constant=finite, parse_float=finite, parse_int=lambda text: int(finite(text, int)))
    except RecursionError:
        raise ValueError("nested too deep") from None


def finite(text: str, kind: type[float] | type[int] = float) -> float:
    """Number of a text. Raises `ValueError`: it is not finite, or no double is near it."""
    if not math.isfinite(float(text)):
        raise ValueError(f"{text[:20]} is beyond doubles")
    return kind(text)


def is_text(value: Any) -> bool:
    """Whether it is a text that has a UTF-8 form."""
    return isinstance(value, str) and not any("\ud800" <= c <= "\udfff" for c in value)


def is_number(value: Any) -> bool:
    """Whether it is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def is_name(value: Any) -> bool:
    """Whether it is a text of one line."""
    return is_text(value) and not NOT_ONE_LINE.search(value)


def is_truth(value: Any) -> bool:
    """Whether it is true, false, or not known."""
    return value is None or isinstance(value, bool)


def is_problem(value: Any) -> bool:
    """Whether it says what is wrong, with its id."""
    if not isinstance(value, dict) or not value.keys() >= {"message", "id"}:
        return False
    places = [value[key] for key in ("line", "column") if key in value]
    return all(map(is_text, (value["message"], value["id"], value.get("file", ""), value.get("key", "")))) and all(
        isinstance(place, int) and not isinstance(place, bool) and place > 0 for place in places
    )


def is_expectation(value: Any) -> bool:
    """Whether it says what was expected and found."""
    return isinstance(value, dict) and value.keys() >= {"key", "expected", "found", "holds"} and is_text(value["key"])


def of_each(holds: Callable[[Any], bool]) -> Callable[[Any], bool]:
    """Whether each of a list is so."""
    return lambda value: isinstance(value, list) and all(map(holds, value))


def by_name(names: Callable[[Any], bool], holds: Callable[[Any], bool]) -> Callable[[Any], bool]:
    """Whether each of a mapping is so, and its name too."""
    return lambda value: isinstance(value, dict) and all(map(names, value)) and all(map(holds, value.values()))


FORM: Mapping[str, Callable[[Any], bool]] = {
    "path": is_text,
    "set": of_each(is_text),
    "sha256": lambda value: value is None or is_text(value),
    "status": lambda value: value in STATUSES,
    "exit_code": lambda value: value is None or (value in CODES and not isinstance(value, bool)),
    "as_expected": is_truth,
    "verified": is_truth,
    "up_to_date": lambda value: isinstance(value, bool),
    "why": lambda value: value is None or is_text(value),
    "expected": of_each(is_expectation),
    "recorded": of_each(is_text),
    "guarantee": by_name(is_name, is_number),
    "problems": of_each(is_problem),
    "files": by_name(lambda name: name in KINDS, is_text),
    "time_s": is_number,
}


def sound(value: Any) -> Entry | None:
    """Entry in the order of a summary; None where it is none."""
    if not isinstance(value, dict):
        return None
    entry = {"set": [], "recorded": [], **value}  # which a summary without changes, and one of old, need not have
    whole = entry.keys() >= FORM.keys() and all(holds(entry[key]) for key, holds in FORM.items())
    return {key: entry[key] for key in FORM} if whole else None


def agrees(entry: Entry) -> bool:
    """Whether its parts do not contradict each other: what is as expected is proved, and ended as its spec says."""
    status, code, fine, proved = (entry[key] for key in ("status", "exit_code", "as_expected", "verified"))
    if status == "skipped" or code is None or fine is None:
        return status == "skipped" and code is None and fine is None
    if status in CLAIMS and code == EXIT[status] and proved is not True:
        return False
    if not fine:
        return True
    wanted = next((one["expected"] for one in entry["expected"] if one["key"] == "status"), "certified")
    codes = {EXIT[status], 0 if status == "uncertified" else EXIT[status]} if status in EXIT else set()
    holds = all(one["holds"] is True for one in entry["expected"])
    return holds and proved is not False and code in codes and ended_as(wanted, status, code)


def ended_as(wanted: Any, status: str, code: int) -> bool:
    """Whether a spec ended as it says, by its code; one that can prove nothing may say that it is uncertified."""
    return code == EXIT.get(str(wanted)) or (code == 0 and wanted == status == "uncertified")
