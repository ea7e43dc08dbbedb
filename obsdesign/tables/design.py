"""Results as text."""

from collections.abc import Iterator, Mapping
from typing import Any

from obsdesign.families import FAMILIES
from obsdesign.tables.search import certified, search_rows
from obsdesign.tables.text import limit_text

LIMITS = {"limit": "limit", "limit_bounded": "within bounds"}


def design_rows(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What an engineer wants to know of a result, from the result file."""
    rows = [("problem", content["name"]), ("status", content["status"])]
    claimed, made = content.get("guarantee", {}), content.get("observer", {})
    family = FAMILIES[made["type"]] if made else None
    rows += family.proved(made, claimed) if family else []
    rows += [*limits(claimed), *background(claimed)]
    rows += family.figures(made) if family else []
    rows += proof(content.get("certificate", {}))
    if "diagnosis" in content:
        rows += [(k, str(v)) for k, v in content["diagnosis"].items() if k in {"reason", "suggestion"}]
    rows += search_rows(content.get("search", {}))
    return rows + [("note", note) for note in content.get("notes", [])]


def background(claimed: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What bounds the limit, and what the relaxations cost."""
    rows = []
    if "widened" in claimed:
        wide = claimed["widened"]
        rows += [("widened", f"gamma {wide['gamma']:.6g} as if the Lipschitz constant were {wide['lipschitz']:.6g}")]
    if "ceiling" in claimed:
        rows += [("ceiling", f"lipschitz {claimed['ceiling']:.6g}   no gain tolerates more")]
    return rows + [("relaxation", compared(row)) for row in claimed.get("comparison", [])]


def compared(row: Mapping[str, Any]) -> str:
    """One relaxation of a comparison."""
    parts = [f"{row['relaxation']:<12}"]
    if row.get("limit"):
        parts.append(f"limit {limit_text(row['limit'])}")
    if "certified" in row:
        parts.append(f"certified {certified(row['certified'])}")
    if row.get("status") in ("refused", "undecided"):
        parts.append(f"{row['status']}, see the note")
    elif "reason" in row:
        parts.append(row["reason"])
    return "   ".join(parts)


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
