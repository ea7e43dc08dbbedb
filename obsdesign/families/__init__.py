"""Families of observers, a folder each, and by name: the only place that names a family outside its folder.

Importing it imports no family's mathematics, no solver and no reader: what a family does it imports when it is asked.
To add one: a folder whose `__init__.py` holds an object as `family.py` describes it, and its name here.
"""

from obsdesign.families.family import Family
from obsdesign.families.incremental import INCREMENTAL
from obsdesign.families.lipschitz import LIPSCHITZ
from obsdesign.families.sporadic import SPORADIC

FAMILIES: dict[str, Family] = {
    name: family for family in (INCREMENTAL, SPORADIC, LIPSCHITZ) for name in family.names
}  # by observer.type

__all__ = ["FAMILIES", "Family"]
