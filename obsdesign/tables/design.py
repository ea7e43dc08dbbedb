"""Results as text."""

from collections.abc import Mapping
from typing import Any

from obsdesign.tables import incremental, lipschitz, sporadic
from obsdesign.tables.text import aligned, limit_text

GAINS = {"sporadic": sporadic.gains, "lipschitz": lipschitz.gains}  # what an engineer asks first of them


def design_table(content: Mapping[str, Any], target: str) -> str:
    """What an engineer wants to know of a result, one line each."""
    rows = [("problem", content["name"]), ("status", content["status"])]
    claimed, made, search = (content.get(key, {}) for key in ("guarantee", "observer", "search"))
    if made:
        rows += claim(claimed, made["type"])
    rows += [*limits(claimed), *lipschitz.background(claimed)]
    if made:
        rows += GAINS.get(made["type"], incremental.gains)(made)
    for check_ in content.get("certificate", {}).get("checks", []):
        rows.append(("proved" if check_["holds"] else "NOT PROVED", check_["name"]))
    if "diagnosis" in content:
        rows += [(k, str(v)) for k, v in content["diagnosis"].items() if k in {"reason", "suggestion"}]
    rows += lipschitz.front(search) if lipschitz.is_front(search) else list(incremental.curves(search))
    rows += [("note", note) for note in content.get("notes", [])]
    return aligned([*rows, ("file", target)])


def claim(claimed: Mapping[str, Any], family: str) -> list[tuple[str, str]]:
    """What is proved of the gains."""
    if family == "lipschitz":
        return lipschitz.claim(claimed)
    return sporadic.claim(claimed) if family == "sporadic" else incremental.claim(claimed, family)


def limits(claimed: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Limits of the objective."""
    known = ((key.replace("_", " "), limit_text(claimed.get(key, {}))) for key in ("limit", "limit_bounded"))
    return [(name, text) for name, text in known if text]
