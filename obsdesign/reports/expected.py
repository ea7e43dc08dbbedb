"""What a spec expects of its result, as a page shows it: what was found, and whether that is proved."""

from collections.abc import Mapping, Sequence
from typing import Any

from obsdesign.design import Design
from obsdesign.expectation import CLAIMED, PROVED, rests_on
from obsdesign.families.agreement import numerical
from obsdesign.families.outcome import Proof

Row = dict[str, Any]


def rows_of(design: Design, proof: Proof | None, summary: Mapping[str, Any]) -> list[Row]:
    """Every expectation, with what a paper prints, what was found, what that rests on, and whether it is met."""
    unproved, proved = numerical(design.result, design.spec), bool(proof and proof.holds)
    found = []
    for row in design.expected(summary):
        rests, record = rests_on(row["key"], design.result, proved, unproved), design.spec.expect[row["key"]]
        told = record if isinstance(record, Mapping) else {}
        found.append(
            {
                **row,
                "rests": rests,
                "found": str(row["found"]) if rests == PROVED else told_of(row["found"]),  # proved: whole
                "met": ("not verified" if rests == CLAIMED else "yes") if row["holds"] else "NO",
                "printed": told.get("printed"),
                "note": told.get("note", ""),
            }
        )
    return found


def in_all(rows: Sequence[Row]) -> str:
    """Whether all expectations are met, as far as that is proved."""
    told = {row["met"] for row in rows}
    if not told:
        return "none"
    if told != {"yes"}:
        return "NOT met" if "NO" in told else "not verified"
    return "met" if all(row["rests"] == PROVED for row in rows) else "met, in part numerical"


def told_of(value: Any) -> str:
    """Entry of a diagnosis in a line."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {told_of(item)}" for key, item in value.items())
    if isinstance(value, list):
        return f"[{', '.join(map(told_of, value))}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
