"""Results as text."""

from collections.abc import Iterator, Mapping
from typing import Any

from obsdesign.families.incremental import table as incremental
from obsdesign.families.lipschitz import table as lipschitz
from obsdesign.families.sporadic import table as sporadic
from obsdesign.tables.text import aligned, limit_text

GAINS = {"sporadic": sporadic.gains, "lipschitz": lipschitz.gains}  # what an engineer asks first of them
LIMITS = {"limit": "limit", "limit_bounded": "within bounds"}


def design_table(content: Mapping[str, Any], target: str) -> str:
    """What an engineer wants to know of a result, one line each."""
    rows = [("problem", content["name"]), ("status", content["status"])]
    claimed, made, search = (content.get(key, {}) for key in ("guarantee", "observer", "search"))
    if made:
        rows += claim(claimed, made["type"])
    rows += [*limits(claimed), *lipschitz.background(claimed)]
    if made:
        rows += GAINS.get(made["type"], incremental.gains)(made)
    rows += proof(content.get("certificate", {}))
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
    known = ((name, limit_text(claimed.get(key, {}))) for key, name in LIMITS.items())
    return [(name, text) for name, text in known if text]


def proof(certificate: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What was proved in one line, led by the main inequality, and each condition that was not."""
    checks = list(conditions(certificate))
    held = [check["name"] for check in checks if check["holds"]]
    rows = [("NOT PROVED", check["name"]) for check in checks if not check["holds"]]
    if held:
        rest = f", and {len(held) - 1} further conditions" if len(held) > 1 else ""
        rows.append(("proved", f"{held[0]}{rest}, in rationals"))
    return rows


def conditions(certificate: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Conditions of a certificate and of those within it."""
    yield from certificate.get("checks", [])
    for part in certificate.values():
        if isinstance(part, Mapping):
            yield from conditions(part)
