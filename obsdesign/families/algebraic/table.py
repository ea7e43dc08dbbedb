"""Observers without an LMI as text."""

from collections.abc import Mapping
from typing import Any

from obsdesign.families.algebraic.scheme import OPEN
from obsdesign.tables.text import at_least


def proved(_: Mapping[str, Any], claimed: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What is proved: coordinates, and how fast they decay."""
    rows = [
        (
            "coordinate",
            f"{c['name']} -> {c['phi']}" + (" - theta" if c["lambda"] == "0" else f", lambda = {c['lambda']}"),
        )
        for c in claimed.get("coordinates", [])
    ]
    rows += [("rate", f"{name}: at least {at_least(rate)} 1/s") for name, rate in claimed.get("rates", {}).items()]
    clauses = claimed["statement"].split("; ") if claimed else []
    return rows + [("not proved", c.removeprefix(OPEN)) if c.startswith(OPEN) else ("says", c) for c in clauses]


def figures(made: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Equations of the observer."""
    rows = [(f"{name}'", side) for name, side in made["dynamics"].items()]
    return [*rows, *((f"{name}hat", side) for name, side in made["estimates"].items())]
