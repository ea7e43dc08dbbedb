"""Families of observers, a folder each, and by name: the only place that names a family outside its folder.

Importing it imports no family's mathematics, no solver and no reader: what a family does it imports when it is asked.
To add one: a folder whose `__init__.py` holds an object as `family.py` describes it, and its name here.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from obsdesign.families.family import Family
from obsdesign.families.incremental import INCREMENTAL
from obsdesign.families.lipschitz import LIPSCHITZ
from obsdesign.families.sporadic import SPORADIC

if TYPE_CHECKING:
    from obsdesign.dissipation.engine import Engine
    from obsdesign.spec import Spec

FAMILIES: dict[str, Family] = {
    name: family for family in (INCREMENTAL, SPORADIC, LIPSCHITZ) for name in family.names
}  # by observer.type

__all__ = ["FAMILIES", "Family", "rescaled"]


def rescaled(spec: "Spec", engine: "Engine", T: Sequence[str] | None) -> dict[str, Any]:
    """Lipschitz constants in scaled coordinates: those that are given, or the best that are found."""
    from obsdesign.families.lipschitz.coordinates import scaling

    return scaling(spec, engine, T)
