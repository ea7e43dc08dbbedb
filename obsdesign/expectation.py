"""What a spec may expect: dotted names that a result of its family, or the summary of a run, can have, and values."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from obsdesign.errors import Problem
from obsdesign.families import FAMILIES
from obsdesign.families.agreement import HELD
from obsdesign.sections.changes import opened
from obsdesign.sections.words import unknown
from obsdesign.spec import Spec

RUN = "simulation"  # the summary of a run
PROVED, NUMERICAL, CLAIMED = "proved", "numerical", "not verified"  # what an entry of a file rests on
FILE = {  # parts of a result file, each with the names that it has in every family; none: any
    "status": (),
    **dict.fromkeys(
        ("name", "spec", "certificate", "diagnosis", "search", "solver", "analysis", "split", "discretised"), ()
    ),
    **dict.fromkeys(("notes", "assumed", "numerical", "tool", "created", "obsdesign", "theorem"), ()),
    "guarantee": ("statement",),
    "observer": ("type",),
}
LIMIT = ("gamma", "alpha", "rho", "lipschitz", "T2", "decay", "attained", "kind", "at", "objective", "unbounded", "gap")
SUMMARY = (
    *("status", "time", "reason", "z_norm2", "v_norm2", "w_norm2", "v_norm2_infinite", "w_norm2_infinite"),
    *("z_sup", "v_sup", "w_sup", "ratio", "ratio_of", "gamma", "bounds", "bounds_omitted", "reconstruction"),
    *("validity", "sampling", "settling", "settling_time", "worst_peak", "initial_error", "final_error"),
    *("initial_distance", "final_distance", "initial_eps", "start", "excitation", "guard"),
    *("no_guarantee", "observed", "drawn_x0", "drawn_parameters"),
)


def strays(spec: Spec) -> Iterator[Problem]:
    """Expectations that no result can meet, for it has no entry of this name; each at its place in the spec."""
    results = FAMILIES[spec.observer.type].results
    wrong = {key: said for key in spec.expect if (said := stray(key, results))}
    document = opened(spec.text, spec.path, spec.changes) if wrong else None
    for key, said in wrong.items():
        assert document
        yield document.problem(("expect", key), said, id="OBS201", at_key=True)


def stray(key: str, results: Mapping[str, Sequence[str]]) -> str | None:
    """What is wrong with a dotted name that no result of a family has; None where one may have it.

    `results`: names in the parts `guarantee` and `observer` of a result.
    """
    first, *rest = re.findall(r"[^.\[\]]+", key)
    parts = {part: (*names, *results.get(part, ())) for part, names in FILE.items()} | {RUN: SUMMARY}
    if first not in parts:
        first, rest = "guarantee", [first, *rest]
    allowed = parts[first]
    if rest and allowed and rest[0] not in allowed:
        others = parts if not key.startswith((f"{first}.", f"{first}[")) else ()
        return unknown(f"entry of {first}", rest[0], tuple(dict.fromkeys((*allowed, *others))), {})
    if rest[:1] and rest[0].startswith("limit") and len(rest) > 1 and rest[1] not in LIMIT:
        return unknown(f"entry of {rest[0]}", rest[1], LIMIT, {})
    return None


def at(content: Mapping[str, Any], path: str) -> Any:
    """Value at a dotted path into a result, or into its guarantee; None if there is none."""
    value: Any = content if path.partition(".")[0].partition("[")[0] in content else content.get("guarantee", {})
    for name in re.findall(r"[^.\[\]]+", path):
        try:
            value = value[int(name) if isinstance(value, list) else name]
        except (KeyError, IndexError, TypeError, ValueError):
            return None
    return value


def rests_on(key: str, content: Mapping[str, Any], proved: bool, unproved: Sequence[str]) -> str:
    """What an entry of a result rests on, by the dotted name that a spec has for it.

    `proved`: whether the claim of the result was proved anew; `unproved`: paths of what is not proved then.
    """
    names = [name for name in re.findall(r"[^.\[\]]+", key) if not name.isdecimal()]
    names = names if names[0] in (*content, RUN) else ["guarantee", *names]
    if names[0] == RUN:
        return NUMERICAL
    if not proved:
        return CLAIMED
    path = ".".join(names) + "."
    computed = any(path.startswith(f"{one}.") or f"{one}.".startswith(path) for one in unproved)
    return PROVED if names[0] in ("status", *HELD) and not computed else NUMERICAL


def meets(found: Any, expected: Any) -> bool:
    """Whether a value is the one that is expected; a record says within which tolerances."""
    if not isinstance(expected, Mapping):
        return same(found, expected)
    verified = expected["verified"]
    if not is_number(found) or not is_number(verified):
        return same(found, verified)
    return bool(abs(found - verified) <= max(expected.get("atol", 0.0), expected.get("rtol", 1e-3) * abs(verified)))


def same(found: Any, expected: Any) -> bool:
    """Whether two values are the same, in lists too; true is not 1."""
    if isinstance(found, list | tuple) and isinstance(expected, list | tuple):
        return len(found) == len(expected) and all(map(same, found, expected))
    return isinstance(found, bool) == isinstance(expected, bool) and bool(found == expected)


def is_number(value: Any) -> bool:
    """Whether a value is a number, which true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)
